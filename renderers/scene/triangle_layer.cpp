#include "renderers/scene/triangle_layer.hpp"

#include <tbb/parallel_for.h>

namespace amrtex {
namespace {

TriangleLayer::Pixel first_of(const std::vector<TriangleObject>& objects, const WorldRay& ray) {
  TriangleLayer::Pixel first;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const auto hit = objects[i].mesh->first_hit(ray.origin, ray.direction, first.distance);
    if (hit) first = {hit->distance, surface_light(hit->cosine), static_cast<int>(i)};
  }
  return first;
}

}  // namespace

TriangleLayer trace_triangles(const Scene& scene) {
  const RenderSettings& s = scene.settings;
  const CameraFrame camera = camera_frame(scene.view, s.width, s.height);
  TriangleLayer layer{s.width, s.height, {}};
  const auto width = static_cast<std::size_t>(s.width);
  layer.pixels.resize(width * static_cast<std::size_t>(s.height));
  tbb::parallel_for(0, s.height, [&](int y) {
    for (int x = 0; x < s.width; ++x)
      layer.pixels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)] =
          first_of(s.triangles, camera_ray(camera, x, y, s.width, s.height));
  });
  return layer;
}

}  // namespace amrtex
