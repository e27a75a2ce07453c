#include "bench/measure/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <random>
#include <utility>

#include "bench/measure/environment.hpp"
#include "bench/measure/local_group.hpp"
#include "bench/measure/process_group.hpp"
#include "bench/measure/stopwatch.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// Points of one structure.
struct Group {
  std::size_t build = 0;
  std::vector<PlannedPoint> points;
};

/// One structure after the other, of one encoding after the other, each encoding's own in the order of the seed: what drifts with time must
/// favour no encoding because of its place in the file.
std::vector<Group> interleaved(const Experiment& experiment, std::vector<Group> groups, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto shuffle = [&](auto& list) {
    for (std::size_t i = list.size(); i > 1; --i) std::swap(list[i - 1], list[random() % i]);
  };
  shuffle(groups);
  std::map<std::string, std::vector<Group>> by_encoding;
  for (Group& group : groups) by_encoding[experiment.builds[group.build].encoding].push_back(std::move(group));
  std::vector<Group> order;
  while (!by_encoding.empty()) {
    std::vector<std::string> encodings;
    for (const auto& [name, list] : by_encoding) encodings.push_back(name);
    shuffle(encodings);
    for (const std::string& name : encodings) {
      std::vector<Group>& list = by_encoding[name];
      order.push_back(std::move(list.back()));
      list.pop_back();
      if (list.empty()) by_encoding.erase(name);
    }
  }
  return order;
}

/// What becomes of records: which points have one, and where new ones go.
class Ledger {
 public:
  Ledger(const Experiment& experiment, const RunOptions& options)
      : experiment_(experiment), options_(options), implementation_(implementation_hash()), file_(options.folder) {
    for (const char* folder : {"", "pictures", "references"}) remove_unfinished_files(options.folder / folder);
    for (const Json& record : file_.records()) latest_[{configuration(record), record.value("repetition", 0)}] = record;
  }

  const std::vector<std::string>& warnings() const { return file_.warnings(); }
  RunSummary& summary() { return summary_; }

  /// Is the point's record there, drawn by this program's shaders and builders? Counts it then.
  bool keeps(const PlannedPoint& point, int repetition) {
    const auto found = latest_.find({point.configuration, repetition});
    if (found == latest_.end() || options_.force) return false;
    const Json& record = found->second;
    if (!options_.keep_old && record.at("implementation") != implementation_) return false;
    const bool failed = record.at("status") == status_name(Status::failed);
    if (failed && options_.retry_failed) return false;
    ++(failed ? summary_.failed : summary_.kept);
    return true;
  }

  void add(const Json& record) {
    file_.append(record);
    options_.recorded(record);
    const std::string status = record.at("status");
    if (status == status_name(Status::ok))
      ++summary_.measured;
    else if (status == status_name(Status::unsupported))
      ++summary_.unsupported;
    else if (status == status_name(Status::over_budget))
      ++summary_.over_budget;
    else
      ++summary_.failed;
  }

 private:
  static std::string configuration(const Json& record) { return record.value("configuration", std::string()); }

  const Experiment& experiment_;
  const RunOptions& options_;
  std::string implementation_;
  RecordFile file_;
  std::map<std::pair<std::string, int>, Json> latest_;  ///< of any context: a folder that was copied is gone on from
  RunSummary summary_;
};

bool is_wanted(const Experiment& experiment, const RunOptions& options, const PlannedPoint& point) {
  if (options.wanted && !options.wanted(experiment.builds[point.build], experiment.renders[point.render])) return false;
  return options.only.empty() || std::any_of(options.only.begin(), options.only.end(), [&](const std::string& beginning) {
           return point.configuration.starts_with(beginning);
         });
}

/// `Measuring`: LocalGroups or ProcessGroups.
template <class Measuring>
class Sweep {
 public:
  Sweep(const Experiment& experiment, const RunOptions& options, Measuring& measuring)
      : experiment_(experiment), options_(options), measuring_(measuring), ledger_(experiment, options) {}

  RunSummary run() {
    for (const std::string& warning : ledger_.warnings()) options_.progress(warning);
    for (std::size_t dataset = 0; dataset < experiment_.datasets.size(); ++dataset) run_dataset(dataset);
    RunSummary summary = ledger_.summary();
    summary.warnings = ledger_.warnings();
    summary.shares = measuring_.take_shares();
    summary.seconds = clock_.seconds();
    return summary;
  }

 private:
  void run_dataset(std::size_t dataset) {
    if (!any_wanted(dataset)) return;
    std::vector<PlannedPoint> points = measuring_.plan(dataset);
    std::erase_if(points, [&](const PlannedPoint& p) { return !is_wanted(experiment_, options_, p); });
    for (int repetition = 0; repetition < options_.repeat; ++repetition) {
      if constexpr (requires { measuring_.end_process(); })
        if (repetition > 0) measuring_.end_process();
      std::vector<Group> open = open_groups(points, repetition);
      int count = 0;
      for (const Group& group : open) count += static_cast<int>(group.points.size());
      options_.planned(count);
      draw_references(open);
      const std::uint64_t seed = experiment_.seed + static_cast<std::uint64_t>(repetition);
      for (const Group& group : interleaved(experiment_, std::move(open), seed)) measure(group, repetition);
    }
    if constexpr (requires { measuring_.end_process(); }) measuring_.end_process();
  }

  /// Before anything is timed.
  void draw_references(const std::vector<Group>& open) {
    std::vector<PlannedPoint> points;
    for (const Group& group : open) points.insert(points.end(), group.points.begin(), group.points.end());
    if (!points.empty() && experiment_.reference) options_.progress("references");
    measuring_.draw_references(points);
  }

  /// A data set that no wanted point is of need not be read.
  bool any_wanted(std::size_t dataset) const {
    for (const BuildPoint& build : experiment_.builds) {
      if (build.dataset != dataset) continue;
      if (!options_.wanted) return true;
      for (const RenderPoint& render : experiment_.renders)
        if (options_.wanted(build, render)) return true;
    }
    return false;
  }

  std::vector<Group> open_groups(const std::vector<PlannedPoint>& points, int repetition) {
    std::map<std::pair<std::size_t, int>, Group> groups;
    for (const PlannedPoint& point : points) {
      if (ledger_.keeps(point, repetition)) continue;
      Group& group = groups[{point.build, point.structure}];
      group.build = point.build;
      group.points.push_back(point);
    }
    std::vector<Group> list;
    for (auto& [key, group] : groups) list.push_back(std::move(group));
    return list;
  }

  void measure(const Group& group, int repetition) {
    if (options_.time_limit && clock_.seconds() >= *options_.time_limit) {
      ledger_.summary().left += static_cast<int>(group.points.size());
      return;
    }
    const BuildPoint& build = experiment_.builds[group.build];
    options_.progress(fmt::format("{} {} {} {}: {} points", build.encoding, build.parameters.dump(), filter_name(build.filter),
                                  format_name(build.storage), group.points.size()));
    std::vector<std::size_t> renders;
    for (const PlannedPoint& point : group.points) renders.push_back(point.render);
    measuring_.measure(group.build, renders, repetition, [&](const Json& record) { ledger_.add(record); });
  }

  const Experiment& experiment_;
  const RunOptions& options_;
  Measuring& measuring_;
  Ledger ledger_;
  Stopwatch clock_;
};

/// The experiment as it is measured: records are named by what was really used.
Experiment settled(const Experiment& experiment, const RunOptions& options) {
  Experiment result = experiment;
  if (options.context) result.context = options.context->name();
  if (options.memory_limit) result.memory_limit = options.memory_limit;
  return result;
}

}  // namespace

Json to_json(const RunSummary& s) {
  Json shares = Json::object();
  for (std::size_t i = 0; i < kShareNames.size(); ++i) shares[std::string(kShareNames[i])] = s.shares.seconds[i];
  return {{"measured", s.measured},       {"kept", s.kept},     {"unsupported", s.unsupported},
          {"over_budget", s.over_budget}, {"failed", s.failed}, {"left", s.left},
          {"seconds", s.seconds},         {"shares", shares},   {"warnings", s.warnings}};
}

RunSummary run_experiment(const Experiment& experiment, const RunOptions& options) {
  const Experiment used = settled(experiment, options);
  if (options.measuring_process.empty()) {
    LocalGroups local(used, options);
    return Sweep(used, options, local).run();
  }
  ProcessGroups processes(options);
  return Sweep(used, options, processes).run();
}

Json point_settings(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render) {
  const DatasetSource& source = experiment.datasets[build.dataset];
  return {{"dataset", {{"name", source.name}, {"field", source.field ? Json(*source.field) : Json()}}},
          {"encoding", build.encoding},
          {"build_parameters", build.parameters},
          {"filter", filter_name(build.filter)},
          {"storage", format_name(build.storage)},
          {"filtering", filtering_name(build.filtering)},
          {"render", render_json(render)}};
}

std::vector<ListedPoint> list_points(const Experiment& experiment, const RunOptions& options) {
  const Experiment used = settled(experiment, options);
  std::map<std::string, std::string> statuses;
  if (fs::exists(options.folder / "records.jsonl"))
    for (const Json& record : load_records(options.folder)) statuses[record.value("configuration", "")] = record.at("status");
  LocalGroups local(used, options);
  std::vector<ListedPoint> listed;
  for (std::size_t dataset = 0; dataset < used.datasets.size(); ++dataset)
    for (const PlannedPoint& p : local.plan(dataset)) {
      if (!is_wanted(used, options, p)) continue;
      const auto found = statuses.find(p.configuration);
      listed.push_back({p.configuration, point_settings(used, used.builds[p.build], used.renders[p.render]),
                        found == statuses.end() ? "open" : found->second});
    }
  return listed;
}

}  // namespace amrtex
