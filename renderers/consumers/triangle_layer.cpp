#include "renderers/consumers/triangle_layer.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "structures/common/build_tools.hpp"

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

HostTexture triangle_buffer(const TriangleLayer& layer, double unit) {
  constexpr double kFar = 1e30;  // farther than any domain, and a float
  HostTexture buffer = make_buffer("triangle_layer", TexelFormat::rgba32f, static_cast<std::int64_t>(layer.pixels.size()));
  auto* texels = buffer.as<glm::vec4>();
  for (int y = layer.height - 1; y >= 0; --y)
    for (int x = 0; x < layer.width; ++x) {
      const TriangleLayer::Pixel& pixel = layer.at(x, y);
      const double distance = pixel.object < 0 ? 0 : std::min(pixel.distance / unit, kFar);
      const auto rounded = static_cast<float>(distance);
      *texels++ = {rounded, static_cast<float>(distance - static_cast<double>(rounded)), static_cast<float>(pixel.light),
                   static_cast<float>(pixel.object)};
    }
  return buffer;
}

}  // namespace amrtex
