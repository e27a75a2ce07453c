// Cells far wider than high, and what a ray through them has to see. Tests use it too.
#pragma once

#include "bench/verify/pictures.hpp"

namespace amrtex::verify {

/// A constant 2 in 8 x 8 x 1 cells of edges (aspect, aspect, 1).
inline AmrHierarchy thin_mesh(double aspect) {
  return MeshBuilder({8, 8, 1}, {}, Vec3d(0), {8 * aspect, 8 * aspect, 1}).root(constant(2)).hierarchy();
}

/// Line integrals, seen at about 45 degrees.
inline Scene thin_scene(double aspect, Sampling sampling) {
  const double edge = 8 * aspect;
  Scene scene = small_scene(Mode::projection, {}, sampling, 6);
  scene.view.eye = {1.5 * edge, 0.5 * edge, edge};
  scene.view.at = {0.5 * edge, 0.5 * edge, 0.5};
  scene.view.up = {0, 1, 0};
  scene.view.orthographic = true;
  scene.view.height = 0.6 * edge;
  scene.settings.step = 0.5;
  return scene;
}

/// Largest relative error of a picture against 2 L, of each ray's chord L.
inline double thin_error(const Picture& picture, const Scene& scene, const AmrHierarchy& h) {
  double largest = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double off = std::abs(picture.pixel(x, y)[0] / (2 * chord(scene, x, y, h.domain_lower(), h.domain_upper())) - 1);
      largest = std::max(largest, std::isnan(off) ? kInf : off);
    }
  return largest;
}

}  // namespace amrtex::verify
