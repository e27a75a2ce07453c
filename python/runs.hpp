// Experiments that Python runs.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/cli/run_arguments.hpp"
#include "bench/measure/runner.hpp"

namespace amrtex {

/// As the options of `amrtex run`.
struct RunRequest : RunArguments {
  std::string text;     ///< of the experiment; it is written to experiment.json of the output folder. Empty: `input` is its file
  std::string program;  ///< amrtex, which measures
  std::string where;
  std::vector<std::string> only;
  std::optional<std::int64_t> process_limit;   ///< bytes
  std::optional<double> time_limit, time_out;  ///< seconds
  int repeat = 1;
  bool force = false, keep_old = false, retry_failed = false;
};

/// Throws as parse_experiment() does.
void check_experiment(const RunRequest& request);
std::vector<ListedPoint> points_of(const RunRequest& request);

/// A run that another thread can end.
class CancelableRun {
 public:
  explicit CancelableRun(RunRequest request) : request_(std::move(request)) {}
  /// `recorded` hears each record that is on disk; what it throws ends the run.
  RunSummary run(const std::function<void(const Json&)>& recorded);
  /// Ends the process that measures: run() throws soon. What has a record keeps it.
  void cancel();

 private:
  RunRequest request_;
  std::atomic<bool> canceled_ = false;
  std::atomic<pid_t> process_ = 0;
};

}  // namespace amrtex
