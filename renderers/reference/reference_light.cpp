#include "renderers/reference/reference_light.hpp"

#include <cmath>

#include "renderers/reference/reference_clip.hpp"

namespace amrtex {
namespace {

TransferFunction of_one_color(TransferFunction tf) {
  tf.color = {{tf.extinction.front().value, Vec3d(1)}};
  return tf;
}

}  // namespace

LampScene::LampScene(const Scene& scene, const FilterReference& f, double extinction_scale, const Vec3d& draw_lower,
                     const Vec3d& draw_upper, double largest_part)
    : filter(f),
      table(of_one_color(scene.transfer_function), extinction_scale),
      lower(draw_lower),
      upper(draw_upper),
      part(largest_part),
      ambient(scene.settings.point_light->ambient) {
  const AmrHierarchy& h = f.hierarchy();
  cells_a_length = Vec3d(h.cells(h.finest_level())) / (h.domain_upper() - h.domain_lower());
  for (const ClipPlane& plane : scene.settings.clip_planes) planes.push_back(in_finest_cells(h, plane));
  position = (scene.settings.point_light->position - h.domain_lower()) * cells_a_length;
}

double LampTracer::light_at(const Vec3d& p) {
  const Vec3d way = (scene_.position - p) / scene_.cells_a_length;
  const double largest = std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)});
  if (!(largest > 0)) return 1;
  const double distance = largest * glm::length(way / largest);  // the square of a far lamp's may be no number
  const IndexRay ray{p, way / distance * scene_.cells_a_length};
  double end = distance;
  for (int a = 0; a < 3; ++a) {
    if (ray.direction[a] == 0) continue;
    const double face = ray.direction[a] > 0 ? scene_.upper[a] : scene_.lower[a];
    end = std::min(end, (face - p[a]) / ray.direction[a]);
  }
  end = cut(ray, scene_.planes, {0, end}).to;  // it begins where something is drawn, whatever rounding says
  LightIntegral shade(scene_.table);
  tracer_.trace(ray, end, [&](const PieceFunction& f, double from, double to) {
    shade.add(f, to - from, scene_.part);
    return shade.transmittance() >= LightIntegral::kOpaque;
  });
  return scene_.ambient + (1 - scene_.ambient) * shade.transmittance();
}

}  // namespace amrtex
