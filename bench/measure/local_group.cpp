#include "bench/measure/local_group.hpp"

#include <utility>

#include "bench/measure/shader_cache.hpp"

namespace amrtex {

LocalGroups::LocalGroups(const Experiment& experiment, const RunOptions& options, std::function<void(Phase)> phase)
    : experiment_(experiment),
      options_(options),
      phase_(std::move(phase)),
      shader_cache_(options.shader_cache.empty() ? Json() : Json(use_shader_cache(options.shader_cache))) {}

PointMeasurer& LocalGroups::of(std::size_t dataset) {
  if (measurer_ && measurer_->dataset() == dataset) return *measurer_;
  if (measurer_) shares_.add(measurer_->take_shares());
  measurer_.reset();  // two meshes at a time may be too many
  measurer_ = std::make_unique<PointMeasurer>(
      experiment_, dataset,
      MeasuringOptions{options_.folder, options_.pictures, options_.count_work, shader_cache_, experiment_.context, phase_});
  return *measurer_;
}

void LocalGroups::draw_references(const std::vector<PlannedPoint>& points) {
  if (!points.empty()) of(experiment_.builds.at(points.front().build).dataset).draw_references(points);
}

void LocalGroups::measure(std::size_t build, const std::vector<std::size_t>& renders, int repetition,
                          const std::function<void(const Json&)>& done) {
  of(experiment_.builds.at(build).dataset).measure(build, renders, repetition, done);
}

Json LocalGroups::failure(std::size_t build, std::size_t render, int repetition, std::string_view reason) {
  return of(experiment_.builds.at(build).dataset).failure(build, render, repetition, reason);
}

TimeShares LocalGroups::take_shares() {
  if (measurer_) shares_.add(measurer_->take_shares());
  return std::exchange(shares_, {});
}

Json to_json(const std::vector<PlannedPoint>& points) {
  Json json = Json::array();
  for (const PlannedPoint& p : points) json.push_back({p.build, p.render, p.configuration, p.structure});
  return json;
}

std::vector<PlannedPoint> planned_points_from_json(const Json& json) {
  std::vector<PlannedPoint> points;
  for (const Json& p : json) points.push_back({p.at(0), p.at(1), p.at(2), p.at(3)});
  return points;
}

}  // namespace amrtex
