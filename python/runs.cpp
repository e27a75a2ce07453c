#include "python/runs.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <filesystem>
#include <memory>

#include "bench/records/point_query.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

Experiment experiment_of(const RunRequest& request) {
  if (request.text.empty()) return request.experiment();
  return parse_experiment(request.text, "experiment", {.set = request.set, .most_points = request.max_points});
}

RunOptions options_of(const RunRequest& request, const Experiment& experiment) {
  RunOptions options = request.options();
  options.force = request.force;
  options.keep_old = request.keep_old;
  options.retry_failed = request.retry_failed;
  options.repeat = request.repeat;
  options.time_limit = request.time_limit;
  options.time_out = request.time_out;
  options.process_limit = request.process_limit.value_or(0);
  options.only = request.only;
  if (request.where.empty()) return options;
  const auto query = std::make_shared<PointQuery>(request.where, "where");
  options.wanted = [query, &experiment](const BuildPoint& build, const RenderPoint& render) {
    return query->holds(point_settings(experiment, build, render));
  };
  return options;
}

/// The file that processes read which measure.
void write_experiment(RunRequest& request) {
  if (request.text.empty()) return;
  make_folder(request.output);
  request.input = (fs::path(request.output) / "experiment.json").string();
  write_atomically(request.input, request.text + "\n");
}

}  // namespace

void check_experiment(const RunRequest& request) { static_cast<void>(experiment_of(request)); }

std::vector<ListedPoint> points_of(const RunRequest& request) {
  const Experiment experiment = experiment_of(request);
  return list_points(experiment, options_of(request, experiment));
}

RunSummary CancelableRun::run(const std::function<void(const Json&)>& recorded) {
  write_experiment(request_);
  const Experiment experiment = experiment_of(request_);
  RunOptions options = options_of(request_, experiment);
  options.measuring_process = request_.measuring_process(request_.program);
  options.measuring = [this](pid_t process) {
    process_ = process;
    if (process > 0 && canceled_) throw Error("interrupted");  // where a process is begun: those that end one may not throw
  };
  options.recorded = recorded;
  return run_experiment(experiment, options);
}

void CancelableRun::cancel() {
  canceled_ = true;
  if (const pid_t process = process_; process > 0) ::kill(process, SIGKILL);
}

}  // namespace amrtex
