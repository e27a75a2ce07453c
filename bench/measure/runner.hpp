// Running experiments: which points are open, in which order and where they are measured, and what becomes of their records.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/measure/run_options.hpp"
#include "bench/measure/time_shares.hpp"
#include "bench/settings/experiment.hpp"

namespace amrtex {

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

/// For programs: counts, seconds, warnings.
Json to_json(const RunSummary& summary);

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
