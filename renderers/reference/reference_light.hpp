// Light of a lamp at a place, in double precision: what the volume lets through on the way. Private to the reference.
#pragma once

#include <utility>

#include "renderers/reference/ray_integral.hpp"
#include "renderers/reference/reference_tracer.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

/// What the secondary rays of one picture share.
struct LampScene {
  LampScene(const Scene& scene, const FilterReference& filter, double extinction_scale, const Vec3d& lower, const Vec3d& upper,
            const RayRule& rule);

  const FilterReference& filter;
  TransferTable table;   ///< extinction alone: of one colour, so that pieces are integrated exactly
  Vec3d position;        ///< finest cells
  Vec3d cells_a_length;  ///< finest cells a world length, along the axes
  Vec3d lower, upper;    ///< of what is drawn, finest cells
  RayRule rule;          ///< without the length, which is each ray's own
  double ambient;
  std::vector<ClipPlane> planes;  ///< that cut what is drawn, finest cells
};

/// Traces secondary rays; of one thread.
class LampTracer {
 public:
  explicit LampTracer(const LampScene& scene) : scene_(scene), tracer_(scene.filter) {}

  /// ambient + (1 - ambient) T at a point of finest space in the drawn box.
  double light_at(const Vec3d& p);

  /// The most that light_at() was off by since it was asked last.
  double take_error() { return std::exchange(error_, 0); }
  std::int64_t evaluations() const { return evaluations_; }

 private:
  const LampScene& scene_;
  ReferenceTracer tracer_;
  double error_ = 0;
  std::int64_t evaluations_ = 0;
};

}  // namespace amrtex
