#include "bench/measure/measuring_child.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <optional>
#include <string>
#include <string_view>

#include "bench/measure/local_group.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

class Lines {
 public:
  explicit Lines(int descriptor) : descriptor_(descriptor) {}

  std::optional<std::string> next() {
    std::array<char, 4096> part;
    for (;;) {
      if (const std::size_t end = text_.find('\n'); end != std::string::npos) {
        const std::string line = text_.substr(0, end);
        text_.erase(0, end + 1);
        return line;
      }
      const ssize_t n = ::read(descriptor_, part.data(), part.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return std::nullopt;
      text_.append(part.data(), static_cast<std::size_t>(n));
    }
  }

 private:
  int descriptor_;
  std::string text_;
};

void answer(int descriptor, const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  std::string_view rest = text;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) ::_exit(1);  // nobody listens any more
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
}

constexpr std::array<std::string_view, 3> kPhases = {"building", "drawing", "other"};

}  // namespace

int answer_questions(const Experiment& experiment, const RunOptions& options, int questions, int answers) {
  LocalGroups local(experiment, options, [&](Phase phase) { answer(answers, {{"phase", kPhases[static_cast<std::size_t>(phase)]}}); });
  Lines lines(questions);
  try {
    while (const auto line = lines.next()) {
      const Json question = Json::parse(*line);
      if (question.contains("plan")) {
        answer(answers, {{"points", to_json(local.plan(question["plan"]))}});
      } else if (question.contains("references")) {
        local.draw_references(planned_points_from_json(question["references"]));
        answer(answers, {{"shares", to_json(local.take_shares())}});
        answer(answers, {{"done", true}});
      } else if (question.contains("fail")) {
        answer(answers, {{"record", local.failure(question["fail"], question["render"], question["repetition"],
                                                  question["reason"].get<std::string>())}});
      } else {
        local.measure(question["build"], question["renders"], question["repetition"],
                      [&](const Json& record) { answer(answers, {{"record", record}}); });
        answer(answers, {{"shares", to_json(local.take_shares())}});
        answer(answers, {{"done", true}});
      }
    }
    return 0;
  } catch (const UsageError& error) {
    answer(answers, {{"usage_error", error.what()}});
  } catch (const OutputError& error) {
    answer(answers, {{"output_error", error.what()}});
  } catch (const std::exception& error) {
    answer(answers, {{"error", error.what()}});
  }
  return 1;
}

}  // namespace amrtex
