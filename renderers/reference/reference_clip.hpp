// Planes that cut a ray, in double precision. Private to the reference.
#pragma once

#include <limits>
#include <vector>

#include "renderers/reference/reference_tracer.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

/// A stretch of a ray: world lengths.
struct Span {
  double from = 0;
  double to = std::numeric_limits<double>::infinity();
};

/// What the planes (finest cells) keep of a stretch; empty where `to` is not above `from`.
inline Span cut(const IndexRay& ray, const std::vector<ClipPlane>& planes, Span span) {
  for (const ClipPlane& plane : planes) {
    const double height = glm::dot(plane.normal, ray.origin) - plane.distance;
    const double rise = glm::dot(plane.normal, ray.direction);
    if (rise > 0) span.from = std::max(span.from, -height / rise);
    if (rise < 0) span.to = std::min(span.to, -height / rise);
    if (rise == 0 && height < 0) span.to = span.from;
  }
  return span;
}

}  // namespace amrtex
