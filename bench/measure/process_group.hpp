// Points measured in processes of their own, which may crash, hang or run out of memory.
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "bench/measure/measuring_process.hpp"
#include "bench/measure/point_measurer.hpp"
#include "bench/measure/run_options.hpp"
#include "bench/measure/stopwatch.hpp"

namespace amrtex {

class ProcessGroups {
 public:
  /// `options` must outlive it.
  explicit ProcessGroups(const RunOptions& options) : options_(options) {}
  ~ProcessGroups();

  std::vector<PlannedPoint> plan(std::size_t dataset);
  /// As PointMeasurer::draw_references. What ends the process is no error: the points that need a reference will tell.
  void draw_references(const std::vector<PlannedPoint>& points);
  /// As PointMeasurer::measure; what ends a process is a record `failed` of the point that it measured, or of all where it built their
  /// structure, and another process goes on. One that somebody else ended is begun again, twice at most.
  void measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition, const std::function<void(const Json&)>& done);
  /// The next group is measured in a new process.
  void end_process();
  TimeShares take_shares() { return std::exchange(shares_, {}); }

 private:
  /// What became of a question.
  struct Outcome {
    bool answered = false;
    bool timed_out = false;
    bool may_try_again = false;  ///< ended by somebody else
    Phase phase = Phase::other;  ///< when it ended
    std::string reason = {};
  };
  MeasuringProcess& process();
  Outcome ask(const Json& question, const std::function<void(const Json&)>& record);
  Outcome ended(Phase phase);
  Outcome timed_out(Phase phase, double seconds);
  std::optional<Json> answer_before(double deadline_seconds);
  double limit() const;
  void fail(std::size_t build, std::size_t render, int repetition, std::string_view reason, const std::function<void(const Json&)>& done);

  const RunOptions& options_;
  std::unique_ptr<MeasuringProcess> process_;
  TimeShares shares_;
  double longest_ = 0;  ///< seconds of building and drawing that one point took
};

}  // namespace amrtex
