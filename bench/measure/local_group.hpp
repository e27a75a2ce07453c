// Points measured in this process, one data set after the other.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "bench/measure/point_measurer.hpp"
#include "bench/measure/run_options.hpp"

namespace amrtex {

class LocalGroups {
 public:
  /// Both must outlive it.
  LocalGroups(const Experiment& experiment, const RunOptions& options, std::function<void(Phase)> phase = [](Phase) {});

  std::vector<PlannedPoint> plan(std::size_t dataset) { return of(dataset).plan(); }
  /// PointMeasurer::draw_references of points of one data set.
  void draw_references(const std::vector<PlannedPoint>& points);
  /// PointMeasurer::measure of the build's data set.
  void measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition, const std::function<void(const Json&)>& done);
  Json failure(std::size_t build, std::size_t render, int repetition, std::string_view reason);
  /// Of all since the last call.
  TimeShares take_shares();

 private:
  PointMeasurer& of(std::size_t dataset);

  const Experiment& experiment_;
  const RunOptions& options_;
  std::function<void(Phase)> phase_;
  Json shader_cache_;  ///< found before there is a context
  std::unique_ptr<PointMeasurer> measurer_;
  TimeShares shares_;  ///< of measurers before this one
};

Json to_json(const std::vector<PlannedPoint>& points);
std::vector<PlannedPoint> planned_points_from_json(const Json& json);

}  // namespace amrtex
