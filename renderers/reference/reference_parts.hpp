// A ray in parts: one, or two where it goes through a mirror; each is a way through the field. Private to the reference.
#pragma once

#include <vector>

#include "renderers/reference/reference_tracer.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

struct RayPart {
  IndexRay ray;           ///< from where the part begins
  Vec3d direction;        ///< world, unit length
  double start = 0;       ///< world length of the parts before
  double length = 0;      ///< world
  bool mirrored = false;  ///< reflected, since it lies in the image
};

/// The parts of a ray of world length `end`, front to back. `face`: of the mirror, finest cells.
inline std::vector<RayPart> parts_of(const IndexRay& ray, const Vec3d& direction, double end, const std::optional<Mirror>& mirror,
                                     double face) {
  if (!mirror) return {{ray, direction, 0, end, false}};
  const int axis = mirror->axis;
  const double outward = mirror->upper ? 1 : -1;
  const double height = (ray.origin[axis] - face) * outward;
  const double rise = ray.direction[axis] * outward;
  const double fold = rise == 0 ? end : -height / rise;
  const bool folds = fold > 0 && fold < end;
  const bool in_image = height > 0 || (height == 0 && rise > 0);
  std::vector<RayPart> parts{{ray, direction, 0, folds ? fold : end, in_image}};
  if (folds) {
    RayPart& second = parts.emplace_back(RayPart{ray, direction, fold, end - fold, !in_image});
    second.ray.origin += fold * ray.direction;
    second.ray.origin[axis] = face;
  }
  for (RayPart& part : parts) {
    if (!part.mirrored) continue;
    part.ray.origin[axis] = 2 * face - part.ray.origin[axis];
    part.ray.direction[axis] = -part.ray.direction[axis];
    part.direction[axis] = -part.direction[axis];
  }
  return parts;
}

}  // namespace amrtex
