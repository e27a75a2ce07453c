#include "renderers/reference/reference_light.hpp"

#include <cmath>

#include "renderers/reference/reference_clip.hpp"

namespace amrtex {
namespace {

// of a ray's tolerance: what a lamp's light is off by must not look like a change of that light along the ray
constexpr double kLampShare = 1.0 / 32;

TransferFunction of_one_color(TransferFunction tf) {
  tf.color = {{tf.extinction.front().value, Vec3d(1)}};
  return tf;
}

}  // namespace

LampScene::LampScene(const Scene& scene, const FilterReference& f, double extinction_scale, const Vec3d& draw_lower,
                     const Vec3d& draw_upper, const RayRule& ray_rule)
    : filter(f),
      table(of_one_color(scene.transfer_function), extinction_scale),
      lower(draw_lower),
      upper(draw_upper),
      rule(ray_rule),
      ambient(scene.settings.point_light->ambient) {
  const AmrHierarchy& h = f.hierarchy();
  cells_a_length = Vec3d(h.cells(h.finest_level())) / (h.domain_upper() - h.domain_lower());
  rule.tolerance *= kLampShare;
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
  LightIntegral shade({scene_.rule.part, scene_.rule.tolerance, end}, &scene_.table);
  tracer_.trace(ray, end, [&](const PieceFunction& f, double from, double to) {
    shade.add(f, {from, to});
    return !shade.opaque();
  });
  error_ = std::max(error_, (1 - scene_.ambient) * shade.error());
  evaluations_ += shade.evaluations();
  return scene_.ambient + (1 - scene_.ambient) * shade.transmittance();
}

}  // namespace amrtex
