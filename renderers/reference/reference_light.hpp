// Light of a lamp at a place, in double precision: what the volume lets through on the way. Private to the reference.
#pragma once

#include "renderers/reference/ray_integral.hpp"
#include "renderers/reference/reference_tracer.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

/// What the secondary rays of one picture share.
struct LampScene {
  LampScene(const Scene& scene, const FilterReference& filter, double extinction_scale, const Vec3d& lower, const Vec3d& upper,
            double part);

  const FilterReference& filter;
  TransferTable table;   ///< extinction alone: of one colour, so that pieces are integrated exactly
  Vec3d position;        ///< finest cells
  Vec3d cells_a_length;  ///< finest cells a world length, along the axes
  Vec3d lower, upper;    ///< of what is drawn, finest cells
  double part;           ///< world length of the largest part
  double ambient;
  std::vector<ClipPlane> planes;  ///< that cut what is drawn, finest cells
};

/// Traces secondary rays; of one thread.
class LampTracer {
 public:
  explicit LampTracer(const LampScene& scene) : scene_(scene), tracer_(scene.filter) {}

  /// ambient + (1 - ambient) T at a point of finest space in the drawn box.
  double light_at(const Vec3d& p);

 private:
  const LampScene& scene_;
  ReferenceTracer tracer_;
};

}  // namespace amrtex
