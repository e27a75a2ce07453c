// What the rays of a picture meet first of the scene's triangles: found once, in double, on the host; the shaders (in every
// precision) and the reference end their rays at the same distances.
#pragma once

#include <limits>
#include <vector>

#include "renderers/scene/scene.hpp"
#include "renderers/scene/triangle_mesh.hpp"

namespace amrtex {

struct TriangleLayer {
  struct Pixel {
    double distance =
        std::numeric_limits<double>::infinity();  ///< world, from where the ray starts; infinite where it meets none
    double light = 0;                             ///< that it reflects (surface_light)
    int object = -1;                              ///< in RenderSettings::triangles; -1: none
  };

  int width = 0;
  int height = 0;
  std::vector<Pixel> pixels;  ///< first row on top

  const Pixel& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
};

/// One ray through the centre of each pixel (camera_ray), all cores. Of equal distances the first object's counts.
TriangleLayer trace_triangles(const Scene& scene);

}  // namespace amrtex
