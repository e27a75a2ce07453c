#include "bench/measure/process_group.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "bench/measure/local_group.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

constexpr double kLeastTimeOut = 60;   // seconds
constexpr double kFirstTimeOut = 600;  // before any point tells how long one takes
constexpr int kTries = 3;

Phase phase_named(std::string_view name) {
  if (name == "building") return Phase::building;
  return name == "drawing" ? Phase::drawing : Phase::other;
}

/// Answers that concern the whole experiment.
void throw_errors(const Json& answer) {
  if (answer.contains("usage_error")) throw UsageError(answer["usage_error"].get<std::string>());
  if (answer.contains("output_error")) throw OutputError(answer["output_error"].get<std::string>());
  if (answer.contains("error")) throw Error(answer["error"].get<std::string>());
}

}  // namespace

ProcessGroups::~ProcessGroups() { end_process(); }

MeasuringProcess& ProcessGroups::process() {
  if (!process_) {
    process_ = std::make_unique<MeasuringProcess>(options_.measuring_process, options_.process_limit);
    options_.measuring(process_->id());
  }
  return *process_;
}

void ProcessGroups::end_process() {
  if (!process_) return;
  process_.reset();
  options_.measuring(0);
}

double ProcessGroups::limit() const {
  if (options_.time_out) return *options_.time_out;
  return longest_ > 0 ? std::max(kLeastTimeOut, 10 * longest_) : kFirstTimeOut;
}

/// Absent when the process has ended, or `seconds` have passed.
std::optional<Json> ProcessGroups::answer_before(double seconds) {
  const auto whole = std::chrono::milliseconds(static_cast<std::int64_t>(std::clamp(seconds, 0.0, 1e9) * 1000));
  return process_->receive(whole);
}

ProcessGroups::Outcome ProcessGroups::ended(Phase phase) {
  const MeasuringProcess::Ending ending = process_->finish();
  end_process();
  Outcome outcome;
  outcome.phase = phase;
  outcome.may_try_again = ending.end == MeasuringProcess::End::killed;
  outcome.reason = fmt::format("the process that measured it {}", ending.reason);
  return outcome;
}

ProcessGroups::Outcome ProcessGroups::timed_out(Phase phase, double seconds) {
  const std::string words = process_->last_words();
  end_process();
  Outcome outcome;
  outcome.timed_out = true;
  outcome.phase = phase;
  outcome.reason = fmt::format("took more than {:.3g} s of {}{}", seconds, phase == Phase::building ? "building" : "drawing",
                               words.empty() ? "" : "; last words: " + words);
  return outcome;
}

/// Waits for the answers to a question. The time of building and drawing is limited for each point; what else a process does, reading and
/// references, is not.
ProcessGroups::Outcome ProcessGroups::ask(const Json& question, const std::function<void(const Json&)>& record) {
  process().send(question);
  Phase phase = Phase::other;
  double used = 0;  // of this point's time
  for (;;) {
    const bool limited = phase != Phase::other;
    const double most = limit();
    const Stopwatch waiting;
    const std::optional<Json> answer = answer_before(limited ? most - used : 1e9);
    if (limited) used += waiting.seconds();
    if (!answer) return process_->ended() ? ended(phase) : timed_out(phase, most);
    throw_errors(*answer);
    if (answer->contains("phase")) phase = phase_named((*answer)["phase"].get<std::string>());
    if (answer->contains("shares")) shares_.add(time_shares_from_json((*answer)["shares"]));
    if (answer->contains("record")) {
      longest_ = std::max(longest_, std::exchange(used, 0));
      record((*answer)["record"]);
    }
    if (answer->contains("points")) record(*answer);
    if (answer->contains("done") || answer->contains("points") || question.contains("fail")) {
      Outcome outcome;
      outcome.answered = true;
      return outcome;
    }
  }
}

std::vector<PlannedPoint> ProcessGroups::plan(std::size_t dataset) {
  std::vector<PlannedPoint> points;
  for (int tries = 1;; ++tries) {
    const Outcome outcome =
        ask({{"plan", dataset}}, [&](const Json& answer) { points = planned_points_from_json(answer["points"]); });
    if (outcome.answered) return points;
    if (!outcome.may_try_again || tries == kTries) throw Error(fmt::format("reading the data set: {}", outcome.reason));
  }
}

void ProcessGroups::draw_references(const std::vector<PlannedPoint>& points) {
  if (points.empty()) return;
  for (int tries = 1; tries <= kTries; ++tries) {
    const Outcome outcome = ask({{"references", to_json(points)}}, [](const Json&) {});
    if (outcome.answered || !outcome.may_try_again) return;
  }
}

void ProcessGroups::fail(std::size_t build, std::size_t render, int repetition, std::string_view reason,
                         const std::function<void(const Json&)>& done) {
  const Json question = {{"fail", build}, {"render", render}, {"repetition", repetition}, {"reason", reason}};
  const Outcome outcome = ask(question, done);
  if (!outcome.answered) throw Error(fmt::format("{}; and describing it: {}", reason, outcome.reason));
}

void ProcessGroups::measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition,
                            const std::function<void(const Json&)>& done) {
  std::vector<std::size_t> open = renders;
  int tries = 0;
  while (!open.empty()) {
    const Outcome outcome = ask({{"build", build}, {"renders", open}, {"repetition", repetition}}, [&](const Json& record) {
      open.erase(open.begin());
      tries = 0;
      done(record);
    });
    if (outcome.answered) return;
    if (outcome.may_try_again && ++tries < kTries) continue;
    // a structure that cannot be built is none of these points'; one that cannot be drawn is its own alone
    const std::size_t lost = outcome.phase == Phase::building ? open.size() : std::min<std::size_t>(open.size(), 1);
    for (std::size_t i = 0; i < lost; ++i) fail(build, open[i], repetition, outcome.reason, done);
    open.erase(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(lost));
    tries = 0;
  }
}

}  // namespace amrtex
