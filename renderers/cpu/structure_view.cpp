#include "renderers/cpu/structure_view.hpp"

#include <fmt/format.h>

#include "renderers/bindings/scene_bindings.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// An axis that is far from parallel to the direction.
Vec3d any_up(const Vec3d& direction) {
  const Vec3d size = glm::abs(direction);
  if (size.z <= size.x && size.z <= size.y) return {0, 0, 1};
  return size.y <= size.x ? Vec3d(0, 1, 0) : Vec3d(1, 0, 0);
}

/// A picture of one pixel whose ray is `ray`.
Scene scene_of(const WorldRay& ray, Sampling sampling, double step) {
  Scene scene;
  scene.view.eye = ray.origin;
  scene.view.at = ray.origin + ray.direction;
  scene.view.up = any_up(ray.direction);
  scene.view.orthographic = true;
  scene.settings.mode = Mode::projection;
  scene.settings.sampling = sampling;
  scene.settings.step = step;
  scene.settings.width = 1;
  scene.settings.height = 1;
  return scene;
}

}  // namespace

std::vector<FieldRegion> list_regions(const DomainGeometry& geometry, const EncodedField& field) {
  const Box domain{Vec3i(0), geometry.cells};
  if (domain.cells() > kMostListedCells)
    throw UnsupportedError(
        fmt::format("regions of {}: the domain has {} cells of the finest level; listed are those of at most {}", field.encoding,
                    domain.cells(), kMostListedCells));
  const auto cpu = make_cpu_field(field.encoding, Precision::double_precision);
  std::vector<const HostTexture*> textures;
  for (const HostTexture& t : field.textures) textures.push_back(&t);
  cpu->set(probe_key(field, 0), field_uniforms(geometry, field), textures);
  std::vector<FieldRegion> regions;
  std::vector<bool> seen(static_cast<std::size_t>(domain.cells()));
  for_each_cell(domain, [&](const Vec3i& cell) {
    if (seen[domain.offset(cell)]) return;
    regions.push_back(cpu->region_at(cell));
    for_each_cell(intersection(regions.back().cells, domain), [&](const Vec3i& c) { seen[domain.offset(c)] = true; });
  });
  return regions;
}

std::vector<SamplePlace> list_samples(const DomainGeometry& geometry, const EncodedField& field, const FieldValues& values,
                                      const WorldRay& ray, Sampling sampling, double step) {
  std::vector<SamplePlace> places;  // one pixel, so one thread
  const FieldValues note = [&](const FinestPosition& p, int number) {
    places.push_back({geometry.lower + (Vec3d(p.cell) + p.fraction) * geometry.spacing, values(p, number)});
    return places.back().value;
  };
  render_sampled(geometry, field, scene_of(ray, sampling, step), note);
  return places;
}

}  // namespace amrtex
