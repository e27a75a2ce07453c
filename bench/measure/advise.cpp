#include "bench/measure/advise.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <set>

#include "bench/measure/judgement.hpp"
#include "bench/measure/loaded_data.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/numbers/pareto.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Small pictures see the same errors: their rays are a sample of the full picture's.
constexpr int kCoarseShare = 4;       ///< of the full picture's width and height
constexpr int kLeastCoarseEdge = 64;  ///< pixels
constexpr int kCoarseFrames = 3;
constexpr double kCoarseSlack = 1.3;         ///< a structure is dropped where its small picture misses the tolerance by more
constexpr std::size_t kLeastKept = 2;        ///< that go on where all miss it: their numbers say how far the goal is
constexpr int kFilterEdge = 64;              ///< pixels; the largest picture by which filters are left behind
constexpr std::size_t kCoarseShapes = 6;     ///< structures tried with all storages, filterings and steps
constexpr double kReferenceShare = 1e-3;     ///< of the tolerance asked for: what references may be off
constexpr std::size_t kCarefulSettings = 8;  ///< settings measured at full size, at a time
constexpr int kCarefulRounds = 3;
constexpr double kAlike = 1.1;  ///< ratios of times and bytes below it are not told

RenderSettings with(Integrator integrator, double step) {
  RenderSettings s;
  s.integrator = integrator;
  s.step = step;
  return s;
}

/// To see which error a structure can reach: a fine step of the shader that is compiled in any case, and the most exact of all
/// ways.
RenderSettings fine_settings() { return with(Integrator::exponential_midpoint, 0.125); }
RenderSettings most_exact_settings() { return with(Integrator::preintegrated, 0.25); }

double number_at(const Json& record, const std::string& pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string build_key(const BuildPoint& b) {
  return fmt::format("{} {} {} {} {}", b.encoding, b.parameters.dump(), filter_name(b.filter), format_name(b.storage),
                     filtering_name(b.filtering));
}

/// Alike but for storage and filtering.
std::string shape_key(const BuildPoint& b) {
  return fmt::format("{} {} {}", b.encoding, b.parameters.dump(), filter_name(b.filter));
}

std::string settings_key(const RenderSettings& settings) {
  return fmt::format("{} {} {} {}", integrator_name(settings.integrator), settings.step, settings.tolerance,
                     settings.level_of_detail.value_or(0));
}

std::string key_of(const Candidate& c) { return build_key(c.build) + " " + settings_key(c.settings); }

/// All values of an encoding's parameters that are compared, crossed.
std::vector<Json> parameter_choices(const Encoding& encoding) {
  std::vector<Json> choices = {Json::object()};
  for (const ParameterInfo& p : encoding.parameters()) {
    const std::vector<Json> values = p.compared.empty() ? std::vector<Json>{p.default_value} : p.compared;
    std::vector<Json> next;
    for (const Json& choice : choices)
      for (const Json& value : values) {
        next.push_back(choice);
        next.back()[p.name] = value;
      }
    choices = std::move(next);
  }
  return choices;
}

/// A record as a candidate with its numbers; nothing where it has no time, no error or too many bytes.
struct Reading {
  double frame_ms, error, max_error;
  std::int64_t bytes;
};

std::optional<Reading> reading_of(const Json& record, const AdviceRequest& request) {
  const std::string error = request.reference ? "/error_common" : "/error";
  const Json& bytes = value_at(record, "/memory/total_bytes");
  const Reading r{number_at(record, "/frame/wall_ms/median"), number_at(record, error + "/p95_seen"),
                  number_at(record, error + "/max"), bytes.is_number_integer() ? bytes.get<std::int64_t>() : 0};
  if (!std::isfinite(r.frame_ms) || !std::isfinite(r.error) || r.bytes > request.memory_limit) return std::nullopt;
  return r;
}

/// What successive halving goes through.
class Search {
 public:
  Search(const AdviceRequest& request, const Effort& full, const Measure& measure, const FilterError& filter_error,
         const std::function<void(const std::string&)>& progress)
      : request_(request), full_(full), measure_(measure), filter_error_(filter_error), progress_(progress) {
    coarse_ = full;
    coarse_.width = coarse_edge(full.width);
    coarse_.height = coarse_edge(full.height);
    coarse_.frames = std::min(full.frames, kCoarseFrames);
  }

  Advice run() {
    Shapes shapes;
    for (const BuildPoint& build : candidate_builds(request_)) shapes[shape_key(build)].push_back(build);
    std::vector<MeasuredCandidate> coarse = one_of_each_shape(with_good_filters(shapes));
    add(coarse, measured(missing_drawn_most_exactly(coarse), coarse_, "more exact"));
    const std::vector<BuildPoint> best = fastest_builds(within_slack(best_of_each_build(coarse)), kCoarseShapes);
    // in the order in which shaders take longer to compile
    add(coarse, measured(with_settings(variants(best, shapes), Integrator::exponential_midpoint), coarse_,
                         "storages, filterings and steps"));
    for (const auto& [integrator, most] : {std::pair{Integrator::preintegrated, 4}, std::pair{Integrator::tolerance, 2}}) {
      const std::vector<BuildPoint> few =
          fastest_builds(within_slack(best_of_each_build(coarse)), static_cast<std::size_t>(most));
      add(coarse, measured(with_settings(few, integrator), coarse_, integrator_name(integrator)));
    }
    measure_carefully(std::move(coarse));
    pass_reasons_on(shapes);
    conclude();
    return std::move(advice_);
  }

 private:
  using Shapes = std::map<std::string, std::vector<BuildPoint>>;

  static int coarse_edge(int full) { return std::min(full, std::max(kLeastCoarseEdge, full / kCoarseShare)); }

  /// Those whose filter can reach the tolerance, or comes nearest to it.
  Shapes with_good_filters(const Shapes& shapes) {
    std::map<std::string, double> errors;
    for (const auto& [shape, builds] : shapes)
      if (const auto error = filter_error_(builds.front(), coarse_)) errors[shape] = *error;
    std::vector<double> ascending;
    for (const auto& [shape, error] : errors) ascending.push_back(error);
    std::sort(ascending.begin(), ascending.end());
    double bound = slack();
    if (ascending.size() == shapes.size() && ascending.front() > bound)
      bound = ascending[std::min(ascending.size(), kLeastKept) - 1];
    Shapes good;
    for (const auto& [shape, builds] : shapes) {
      const auto error = errors.find(shape);
      if (error == errors.end() || error->second <= bound)
        good[shape] = builds;
      else
        lose(builds.front(), fmt::format("its filter does not reach the error at any step: {:.2g}", error->second));
    }
    return good;
  }

  /// Each shape in the first storage that fits, with a fine step.
  std::vector<MeasuredCandidate> one_of_each_shape(const Shapes& shapes) {
    std::vector<MeasuredCandidate> all;
    std::set<std::string> fitting;
    for (const Storage storage : request_.storages) {
      std::vector<Candidate> next;
      for (const auto& [shape, builds] : shapes) {
        if (fitting.contains(shape)) continue;
        const auto build = std::find_if(builds.begin(), builds.end(), [&](const BuildPoint& b) { return b.storage == storage; });
        if (build != builds.end()) next.push_back({*build, fine_settings()});
      }
      for (MeasuredCandidate& m : measured(next, coarse_, format_name(storage))) {
        fitting.insert(shape_key(m.candidate.build));
        all.push_back(std::move(m));
      }
    }
    return all;
  }

  /// All storages and filterings of builds, but for those whose storage is known not to fit.
  std::vector<BuildPoint> variants(const std::vector<BuildPoint>& of, const Shapes& shapes) const {
    std::vector<BuildPoint> all;
    for (const BuildPoint& build : of)
      for (const BuildPoint& other : shapes.at(shape_key(build)))
        if (!too_large_.contains(storage_key(other))) all.push_back(other);
    return all;
  }

  /// Those that miss the tolerance with a fine step: perhaps another integrator reaches it.
  std::vector<Candidate> missing_drawn_most_exactly(const std::vector<MeasuredCandidate>& all) const {
    std::vector<Candidate> missing;
    for (const MeasuredCandidate& m : all)
      if (m.error > slack()) missing.push_back({m.candidate.build, most_exact_settings()});
    return missing;
  }

  double slack() const { return request_.tolerance * kCoarseSlack; }

  static void add(std::vector<MeasuredCandidate>& all, std::vector<MeasuredCandidate> more) {
    all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
  }

  /// Of each structure the fastest that reaches the tolerance, or else the most exact.
  std::vector<MeasuredCandidate> best_of_each_build(const std::vector<MeasuredCandidate>& all) const {
    const auto before = [&](const MeasuredCandidate& a, const MeasuredCandidate& b) {
      const bool a_reaches = a.error <= request_.tolerance, b_reaches = b.error <= request_.tolerance;
      if (a_reaches != b_reaches) return a_reaches;
      return a_reaches ? a.frame_ms < b.frame_ms : a.error < b.error;
    };
    std::vector<MeasuredCandidate> best;
    std::map<std::string, std::size_t> place;
    for (const MeasuredCandidate& m : all) {
      const auto [known, is_new] = place.emplace(build_key(m.candidate.build), best.size());
      if (is_new)
        best.push_back(m);
      else if (before(m, best[known->second]))
        best[known->second] = m;
    }
    return best;
  }

  static std::string storage_key(const BuildPoint& b) { return shape_key(b) + " " + std::string(format_name(b.storage)); }

  /// A shape that was left behind takes its other storages and filterings along.
  void pass_reasons_on(const Shapes& shapes) {
    for (const auto& [shape, builds] : shapes)
      for (const BuildPoint& known : builds) {
        const auto reason = reasons_.find(build_key(known));
        if (reason == reasons_.end()) continue;
        const std::string text = reason->second.reason;
        for (const BuildPoint& other : builds)
          if (!tried_.contains(build_key(other)) && !too_large_.contains(storage_key(other))) lose(other, text);
        break;
      }
  }

  /// Those that were measured; others are remembered as refused.
  std::vector<MeasuredCandidate> measured(const std::vector<Candidate>& candidates, const Effort& effort, std::string_view what) {
    if (candidates.empty()) return {};
    progress_(fmt::format("{} {} at {} x {} pixels", candidates.size(), what, effort.width, effort.height));
    const std::vector<Json> records = measure_(candidates, effort);
    std::vector<MeasuredCandidate> list;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      note_bytes(records[i]);
      tried_.insert(build_key(candidates[i].build));
      if (const auto r = reading_of(records[i], request_)) {
        list.push_back({candidates[i], r->frame_ms, r->error, r->max_error, r->bytes});
        ++advice_.pictures;
      } else {
        refuse(candidates[i], records[i]);
      }
    }
    return list;
  }

  void note_bytes(const Json& record) {
    for (const char* pointer : {"/memory/total_bytes", "/needed_bytes"})
      if (const Json& bytes = value_at(record, pointer); bytes.is_number_integer() && bytes.get<std::int64_t>() > 0)
        if (advice_.smallest_bytes == 0 || bytes.get<std::int64_t>() < advice_.smallest_bytes)
          advice_.smallest_bytes = bytes.get<std::int64_t>();
  }

  void refuse(const Candidate& candidate, const Json& record) {
    const std::string status = value_at(record, "/status").get<std::string>();
    std::string reason =
        value_at(record, "/reason").is_string() ? value_at(record, "/reason").get<std::string>() : "no error or time";
    // one line for all sizes: what they need differs
    const double needed = number_at(record, "/needed_bytes");
    if (needed > 0) too_large_.insert(storage_key(candidate.build));
    if (needed > 0)
      reason = fmt::format("needs {:.1f} x the memory limit or more", needed / static_cast<double>(request_.memory_limit));
    for (Refusal& r : advice_.refused)
      if (r.encoding == candidate.build.encoding && r.status == status && (r.reason == reason || needed > 0)) {
        ++r.count;
        if (needed > 0 && needed < least_needed_[candidate.build.encoding]) {
          least_needed_[candidate.build.encoding] = needed;
          r.reason = reason;
        }
        return;
      }
    if (needed > 0) least_needed_[candidate.build.encoding] = needed;
    advice_.refused.push_back({candidate.build.encoding, status, reason, 1});
  }

  void lose(const BuildPoint& build, const std::string& reason) { reasons_[build_key(build)] = {build, reason}; }

  /// Where none is left, the most exact ones go on: their numbers say how far the goal is.
  std::vector<MeasuredCandidate> within_slack(std::vector<MeasuredCandidate> all) {
    std::vector<MeasuredCandidate> left;
    for (const MeasuredCandidate& m : all) {
      if (m.error <= slack())
        left.push_back(m);
      else
        lose(m.candidate.build, fmt::format("does not reach the error at any step: {:.2g} at the finest", m.error));
    }
    if (!left.empty() || all.empty()) return left;
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
    all.resize(std::min(all.size(), kLeastKept));
    return all;
  }

  /// The fastest of each encoding and filter, then the fastest of all.
  std::vector<BuildPoint> fastest_builds(std::vector<MeasuredCandidate> all, std::size_t most) {
    // those within the slack alone come after those that reach the tolerance
    std::sort(all.begin(), all.end(), [&](const auto& a, const auto& b) {
      const bool a_misses = a.error > request_.tolerance, b_misses = b.error > request_.tolerance;
      return a_misses != b_misses ? b_misses : a.frame_ms < b.frame_ms;
    });
    std::set<std::pair<std::string, Filter>> seen;
    std::vector<MeasuredCandidate> order, others;
    for (const MeasuredCandidate& m : all)
      (seen.insert({m.candidate.build.encoding, m.candidate.build.filter}).second ? order : others).push_back(m);
    order.insert(order.end(), others.begin(), others.end());
    std::vector<BuildPoint> best;
    for (const MeasuredCandidate& m : order) {
      if (best.size() < most)
        best.push_back(m.candidate.build);
      else
        lose(m.candidate.build, slower_text(m.frame_ms, all.front().frame_ms) + " on a small picture");
    }
    return best;
  }

  /// The builds with all settings of an integrator.
  std::vector<Candidate> with_settings(const std::vector<BuildPoint>& builds, Integrator integrator) const {
    std::vector<Candidate> all;
    for (const BuildPoint& build : builds)
      for (const RenderSettings& settings : candidate_settings(request_)) {
        if (settings.integrator != integrator) continue;
        if (!interpolates(build.filter) && settings.integrator == Integrator::tolerance) continue;
        if (settings.level_of_detail && !find_encoding(build.encoding).level_of_detail().ok) continue;
        all.push_back({build, settings});
      }
    return all;
  }

  /// The fastest settings that reached the goal on small pictures at full size, and more exact ones until one reaches it there.
  void measure_carefully(std::vector<MeasuredCandidate> coarse) {
    std::sort(coarse.begin(), coarse.end(), [](const auto& a, const auto& b) { return a.frame_ms < b.frame_ms; });
    std::set<std::string> done;
    for (int round = 0; round < kCarefulRounds && !goal_reached(); ++round) {
      // each round asks the small pictures for half of the error of the round before
      const double bound = request_.tolerance * std::pow(0.5, round);
      std::vector<Candidate> next = fastest_of_each_build(coarse, bound, done);
      if (next.empty()) next = most_exact_of_all(coarse, done);
      for (MeasuredCandidate& m : measured(next, full_, "settings")) advice_.measured.push_back(std::move(m));
    }
    for (const MeasuredCandidate& m : coarse)
      if (!reasons_.contains(build_key(m.candidate.build))) note_coarse_loss(coarse, m.candidate.build);
  }

  bool goal_reached() const {
    return std::any_of(advice_.measured.begin(), advice_.measured.end(),
                       [&](const MeasuredCandidate& m) { return m.error <= request_.tolerance; });
  }

  /// For each structure the fastest that reaches the bound and the one after it, in case that the small picture was kind.
  std::vector<Candidate> fastest_of_each_build(const std::vector<MeasuredCandidate>& by_time, double bound,
                                               std::set<std::string>& done) const {
    std::map<std::string, int> taken;
    std::vector<Candidate> next;
    for (const MeasuredCandidate& m : by_time) {
      if (next.size() == kCarefulSettings) break;
      if (m.error > bound || taken[build_key(m.candidate.build)] == 2 || !done.insert(key_of(m.candidate)).second) continue;
      ++taken[build_key(m.candidate.build)];
      next.push_back(m.candidate);
    }
    return next;
  }

  std::vector<Candidate> most_exact_of_all(std::vector<MeasuredCandidate> coarse, std::set<std::string>& done) const {
    std::stable_sort(coarse.begin(), coarse.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
    std::vector<Candidate> next;
    for (const MeasuredCandidate& m : coarse)
      if (next.size() < kCarefulSettings / 2 && done.insert(key_of(m.candidate)).second) next.push_back(m.candidate);
    return next;
  }

  /// Of a structure that was drawn with all steps on small pictures and not at full size.
  void note_coarse_loss(const std::vector<MeasuredCandidate>& by_time, const BuildPoint& build) {
    const MeasuredCandidate* best = nullptr;
    double least = std::numeric_limits<double>::infinity(), fastest = least;
    for (const MeasuredCandidate& m : by_time) {
      const bool reaches = m.error <= request_.tolerance;
      if (reaches) fastest = std::min(fastest, m.frame_ms);
      if (build_key(m.candidate.build) != build_key(build)) continue;
      least = std::min(least, m.error);
      if (reaches && best == nullptr) best = &m;
    }
    lose(build, best == nullptr ? fmt::format("does not reach the error at any step: {:.2g} at best", least)
                                : slower_text(best->frame_ms, fastest) + " on a small picture");
  }

  static std::string slower_text(double time, double best) {
    return time > kAlike * best ? fmt::format("{:.1f} x slower", time / best) : "no faster";
  }

  std::string loss_text(const MeasuredCandidate& m, const MeasuredCandidate& best) const {
    if (m.error > request_.tolerance) return fmt::format("{:.2g} at full size is more than the error asked for", m.error);
    std::string text = slower_text(m.frame_ms, best.frame_ms);
    if (static_cast<double>(m.bytes) > kAlike * static_cast<double>(best.bytes))
      text += fmt::format(", needs {:.1f} x the memory", static_cast<double>(m.bytes) / static_cast<double>(best.bytes));
    if (static_cast<double>(best.bytes) > kAlike * static_cast<double>(m.bytes))
      text +=
          fmt::format(", though it needs {:.2f} of the memory", static_cast<double>(m.bytes) / static_cast<double>(best.bytes));
    return text;
  }

  void conclude() {
    auto& all = advice_.measured;
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.frame_ms < b.frame_ms; });
    std::vector<CostPoint> points;
    for (const MeasuredCandidate& m : all) points.push_back({m.frame_ms, m.error});
    advice_.chosen = fastest_within(points, request_.tolerance);
    if (!advice_.chosen) advice_.nearest = most_exact(points);
    const auto best = advice_.chosen ? advice_.chosen : advice_.nearest;
    std::set<std::string> told;
    if (best) told.insert(build_key(all[*best].candidate.build));
    // the best reason of a structure is that of its fastest setting that reaches the goal
    for (const bool reaching : {true, false})
      for (const MeasuredCandidate& m : all)
        if ((m.error <= request_.tolerance) == reaching && told.insert(build_key(m.candidate.build)).second)
          advice_.lost.push_back({m.candidate.build, loss_text(m, all[*best])});
    for (const auto& [key, loss] : reasons_)
      if (told.insert(key).second) advice_.lost.push_back(loss);
  }

  const AdviceRequest& request_;
  Effort full_, coarse_;
  const Measure& measure_;
  const FilterError& filter_error_;
  const std::function<void(const std::string&)>& progress_;
  Advice advice_;
  std::map<std::string, Loss> reasons_;         ///< by structure
  std::set<std::string> tried_;                 ///< structures
  std::set<std::string> too_large_;             ///< shapes and storages that pass the limit
  std::map<std::string, double> least_needed_;  ///< bytes, of those over the limit, by encoding
};

/// Judged by a common filter, or each by its own.
ReferenceSettings reference_of(const AdviceRequest& request) {
  ReferenceSettings reference{.common_filter = request.reference, .own = !request.reference};
  reference.tolerance = std::max(reference.tolerance, kReferenceShare * request.tolerance);
  return reference;
}

/// One value for each text, in the order in which they come.
template <class T, class Text>
void add_once(std::vector<T>& list, std::set<std::string>& seen, const T& item, Text&& text) {
  if (seen.insert(text(item)).second) list.push_back(item);
}

}  // namespace

std::vector<BuildPoint> candidate_builds(const AdviceRequest& request) {
  std::vector<BuildPoint> builds;
  std::set<std::string> seen;
  for (const Encoding* encoding : all_encodings())
    for (const Json& parameters : parameter_choices(*encoding))
      for (const Filter filter : encoding->filters()) {
        if (std::find(request.filters.begin(), request.filters.end(), filter) == request.filters.end()) continue;
        for (const Storage storage : request.storages)
          for (const Filtering filtering : request.filterings) {
            BuildPoint build;
            build.encoding = encoding->name();
            build.parameters = complete_parameters(*encoding, parameters);
            build.filter = filter;
            build.storage = storage;
            build.filtering = interpolates(filter) ? filtering : Filtering::manual;
            add_once(builds, seen, build, build_key);
          }
      }
  if (builds.empty()) {
    std::vector<std::string_view> names;
    for (const Filter filter : request.filters) names.push_back(filter_name(filter));
    throw UsageError(fmt::format("no encoding has a filter among {}; `amrtex encodings` lists them", fmt::join(names, ", ")));
  }
  return builds;
}

std::vector<RenderSettings> candidate_settings(const AdviceRequest& request) {
  std::vector<RenderSettings> all;
  for (const double step : {8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125}) all.push_back(with(Integrator::exponential_midpoint, step));
  for (const double step : {4.0, 2.0, 1.0, 0.5, 0.25}) all.push_back(with(Integrator::preintegrated, step));
  RenderSettings by_tolerance = with(Integrator::tolerance, RenderSettings{}.step);
  by_tolerance.tolerance = request.tolerance;
  all.push_back(by_tolerance);
  if (!request.level_of_detail) return all;
  const std::size_t whole = all.size();
  for (std::size_t i = 0; i < whole; ++i) {
    all.push_back(all[i]);
    all.back().level_of_detail = request.level_of_detail;
  }
  return all;
}

Advice advise(const AdviceRequest& request, const Effort& full, const Measure& measure, const FilterError& filter_error,
              const std::function<void(const std::string&)>& progress) {
  if (!(request.tolerance > 0 && request.tolerance <= 1))
    throw UsageError(
        fmt::format("a tolerance of {}; accepted: a number in (0, 1], the largest error of a channel", request.tolerance));
  return Search(request, full, measure, filter_error, progress).run();
}

FilterError filter_error_by_reference(const Experiment& scene, const AdviceRequest& request, const RunOptions& options) {
  if (!request.reference) return [](const BuildPoint&, const Effort&) { return std::nullopt; };
  struct Asked {
    Experiment experiment;
    LoadedData data;
    explicit Asked(const Experiment& e) : experiment(e), data(experiment, 0) {}
  };
  const auto asked = std::make_shared<Asked>(scene);
  asked->experiment.reference = reference_of(request);
  asked->experiment.reference->own = true;
  return [asked, folder = options.folder / "references"](const BuildPoint& build, const Effort& effort) -> std::optional<double> {
    RenderPoint render = asked->experiment.renders.front();
    render.settings.width = std::min(effort.width, kFilterEdge);
    render.settings.height = std::min(effort.height, kFilterEdge);
    return filter_error(asked->experiment, asked->data, {build, render}, folder);
  };
}

Measure measure_by_running(const Experiment& scene, const AdviceRequest& request, const RunOptions& options) {
  // part of the records' names
  const std::string data = exact_data_hash(load_dataset(scene, scene.datasets.front()), scene_of(scene, scene.renders.front()));
  return [scene, request, options, data](std::span<const Candidate> candidates, const Effort& effort) {
    Experiment experiment = scene;
    experiment.reference = reference_of(request);
    experiment.unchecked_because = "advise reads the error itself";
    if (options.context) experiment.context = options.context->name();
    if (request.memory_limit != std::numeric_limits<std::int64_t>::max()) experiment.memory_limit = request.memory_limit;
    experiment.builds.clear();
    experiment.renders.clear();
    std::set<std::string> builds, renders, wanted;
    std::vector<RenderPoint> drawn;
    for (const Candidate& c : candidates) {
      RenderPoint render = scene.renders.front();
      render.settings.integrator = c.settings.integrator;
      render.settings.step = c.settings.step;
      render.settings.tolerance = c.settings.tolerance;
      render.settings.level_of_detail = c.settings.level_of_detail;
      render.settings.width = effort.width;
      render.settings.height = effort.height;
      render.frames = effort.frames;
      render.warm_up = effort.warm_up;
      add_once(experiment.builds, builds, c.build, build_key);
      add_once(experiment.renders, renders, render, [](const RenderPoint& r) { return settings_key(r.settings); });
      drawn.push_back(render);
      wanted.insert(key_of(c));
    }
    RunOptions run = options;
    run.pictures = run.count_work = false;
    run.wanted = [&](const BuildPoint& b, const RenderPoint& r) { return wanted.contains(key_of({b, r.settings})); };
    run_experiment(experiment, run);
    std::map<std::string, Json> by_configuration;
    for (const Json& record : load_records(options.folder)) by_configuration[record.at("configuration")] = record;
    std::vector<Json> records;
    for (std::size_t i = 0; i < candidates.size(); ++i)
      records.push_back(
          by_configuration.at(configuration_hash(point_configuration(experiment, candidates[i].build, drawn[i], data))));
    return records;
  };
}

std::string build_text(const BuildPoint& build) {
  std::vector<std::string> parameters;
  for (const ParameterInfo& p : find_encoding(build.encoding).parameters()) {
    const Json value = build.parameters.value(p.name, p.default_value);
    if (!p.compared.empty() || value != p.default_value)
      parameters.push_back(fmt::format("{} {}", p.name, value.is_string() ? value.get<std::string>() : value.dump()));
  }
  const std::string list = parameters.empty() ? "" : fmt::format(" ({})", fmt::join(parameters, ", "));
  return fmt::format("{}{}, {}, {}, {}", build.encoding, list, filter_name(build.filter), format_name(build.storage),
                     filtering_name(build.filtering));
}

std::string settings_text(const RenderSettings& settings) {
  const std::string detail =
      settings.level_of_detail ? fmt::format(", level of detail {} pixels", *settings.level_of_detail) : std::string();
  if (settings.integrator == Integrator::tolerance) return fmt::format("tolerance {}{}", settings.tolerance, detail);
  return fmt::format("{}, step {}{}", integrator_name(settings.integrator), settings.step, detail);
}

Json scene_with(Json scene, const Candidate& candidate) {
  const BuildPoint& build = candidate.build;
  Json encoding = {{"name", build.encoding}};
  encoding.update(build.parameters);
  scene["encodings"] = Json::array({encoding});
  scene["filters"] = filter_name(build.filter);
  scene["storage"] = format_name(build.storage);
  scene["filtering"] = filtering_name(build.filtering);
  scene["render"]["integrator"] = integrator_name(candidate.settings.integrator);
  if (candidate.settings.integrator == Integrator::tolerance)
    scene["render"]["tolerance"] = candidate.settings.tolerance;
  else
    scene["render"]["step"] = candidate.settings.step;
  if (candidate.settings.level_of_detail) scene["render"]["level_of_detail"] = *candidate.settings.level_of_detail;
  return scene;
}

}  // namespace amrtex
