// Running experiments: which points are open, in which order and where they are measured, and what becomes of their records.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench/measure/time_shares.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"

namespace amrtex {

struct RunOptions {
  std::filesystem::path folder;  ///< records, pictures and references are written below it
  bool force = false;            ///< measure again what has a record
  bool keep_old = false;         ///< keep records of another implementation too (environment.hpp)
  bool retry_failed = false;     ///< measure again what has a record `failed`
  bool pictures = true;          ///< keep those that are drawn
  bool count_work = true;        ///< records say how much was sampled, which takes another shader a point; only in this process
  int repeat = 1;                ///< processes that measure each point
  /// Compiled shaders are kept there for measurements alone (shader_cache.hpp); empty: wherever the driver keeps them.
  std::filesystem::path shader_cache{};
  std::optional<ContextKind> context;        ///< overrides the experiment's
  std::optional<std::int64_t> memory_limit;  ///< bytes of one build; overrides the experiment's
  /// Points that are measured; absent: all. Others are passed over as if they were not in the experiment.
  std::function<bool(const BuildPoint&, const RenderPoint&)> wanted;
  std::vector<std::string> only;  ///< configurations, or their beginnings; empty: all

  /// The command that starts a measuring process of the same experiment (measuring_child.hpp). A crash, a hang or a shortage of memory
  /// costs its point alone then. Empty: points are measured in this process, which suits a caller that can afford to lose it.
  std::vector<std::string> measuring_process;
  std::int64_t process_limit = 0;       ///< bytes that such a process may allocate; 0: any number
  std::optional<double> time_out;       ///< seconds a point; absent: ten times the longest so far, and at least 60
  std::optional<double> time_limit;     ///< seconds, after which no further point is begun
  std::function<void(pid_t)> measuring = [](pid_t) {};  ///< hears which process measures, 0 for none
  std::function<void(int)> planned = [](int) {};        ///< hears how many points of a data set are open
  std::function<void(const Json&)> recorded = [](const Json&) {};  ///< hears each record that is on disk now
  std::function<void(const std::string&)> progress = [](const std::string&) {};
};

struct RunSummary {
  int measured = 0;  ///< records with status ok, written now
  int kept = 0;      ///< had a record already
  int unsupported = 0;
  int over_budget = 0;
  int failed = 0;  ///< kept ones too
  int left = 0;    ///< not begun when the time was over
  std::vector<std::string> warnings;  ///< of the folder
  TimeShares shares;
  double seconds = 0;  ///< from beginning to end
};

/// Measures every point that has no record of this implementation yet. Points that fail or cannot be done
/// become records too; throws only for what concerns the whole experiment: bad parameters, the output folder.
RunSummary run_experiment(const Experiment& experiment, const RunOptions& options);

/// A point of an experiment with what is known of it before it is measured.
struct ListedPoint {
  std::string configuration;
  Json settings;       ///< as much of its record as says what was asked for
  std::string status;  ///< of its record; "open" where it would be measured
};
/// The points that a run would look at, in the order of the experiment. Reads the data sets; measures nothing, writes nothing.
std::vector<ListedPoint> list_points(const Experiment& experiment, const RunOptions& options);

/// What a record says of a point before anything is drawn, as far as the experiment tells it (point_query.hpp asks it).
Json point_settings(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render);

}  // namespace amrtex
