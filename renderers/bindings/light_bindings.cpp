#include "renderers/bindings/light_bindings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "renderers/bindings/transfer_bindings.hpp"
#include "renderers/scene/stored_units.hpp"
#include "renderers/scene/triangle_layer.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kFar = 1e30;  // farther than any domain, and a float

/// Beyond this distance, in diagonals of the domain, a lamp is moved nearer along its own direction: what changes
/// is below the rounding of a float, in which positions of lamps further off may not fit.
constexpr double kFarLamp = 1e7;

/// Bisections after which an interval between two samples is no longer than the tolerance.
int bisections(const RenderSettings& s) {
  return std::clamp(static_cast<int>(std::ceil(std::log2(s.step / s.isosurfaces.tolerance))), 1, 32);
}

/// Optical depth of a surface; of an opaque one so much that nothing is left.
double surface_depth(double opacity) { return opacity < 1 ? -std::log1p(-opacity) : 1e4; }

/// Colours of surfaces over a second field.
void add_surface_map(const Scene& scene, const EncodedField& field, SceneBindings& b) {
  const Isosurfaces& iso = scene.settings.isosurfaces;
  const bool mapped = !iso.color_field.empty() && iso.output == Output::color;
  TransferFunction map = surface_colors(scene);
  if (mapped && field.field_count < 2)
    throw Error(fmt::format("surfaces coloured by the field {}: the structure was built without it", quote(iso.color_field)));
  if (mapped) map = in_units(map, field.scale_of(1).units);
  if (map.color.size() > kMostExactColors)
    throw UsageError(fmt::format("surfaces coloured by the field {}: {} colour points; at most {} are supported",
                                 quote(iso.color_field), map.color.size(), kMostExactColors));
  if (mapped) b.set("u_surface_points", color_points(map));
  b.define("AMRTEX_SURFACE_POINTS", mapped ? static_cast<int>(map.color.size()) : 0);
  b.define("AMRTEX_SURFACE_LOGARITHMIC", mapped && map.logarithmic ? 1 : 0);
}

/// Four floats a pixel, row by row from the lower left, as `triangle_layer` in shaders/triangles.glsl; `unit`: world length of
/// one unit of ray length.
HostTexture triangle_buffer(const TriangleLayer& layer, double unit) {
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

}  // namespace

void add_surfaces(const Scene& scene, const Scene& stored, const EncodedField& field, SceneBindings& b) {
  if (!scene.settings.draws_surfaces()) return;
  const Isosurfaces& iso = scene.settings.isosurfaces;
  std::vector<double> light;
  for (std::size_t i = 0; i < iso.values.size(); ++i) {
    const Vec3d rgb = surface_color(scene, iso.values[i]);
    light.insert(light.end(), {rgb.r, rgb.g, rgb.b, surface_depth(iso.opacity.empty() ? 1 : iso.opacity[i])});
  }
  b.set("u_isovalues", stored.settings.isosurfaces.values);
  b.set("u_surface_light", light);
  b.set("u_surface_ambient", surface_light(0));
  // no less than the quantum of positions can tell
  b.set("u_face_distance", std::clamp(2 * iso.tolerance, 1.0 / 1024, 0.5));
  b.set("u_bisections", bisections(scene.settings));
  add_surface_map(scene, field, b);
  b.define("AMRTEX_OUTPUT", static_cast<int>(iso.output));
  b.define("AMRTEX_SHADING", static_cast<int>(iso.shading));
}

void add_occlusion(const DomainGeometry& geometry, const RenderSettings& s, SceneBindings& b) {
  const auto& around = s.isosurfaces.ambient_occlusion;
  const bool on = s.draws_surfaces() && around;
  b.define("AMRTEX_OCCLUSION", on ? 1 : 0);
  if (!on) return;
  b.set("u_occlusion_rays", around->rays);
  b.set("u_occlusion_radius", std::min(around->radius / geometry.smallest_edge(), kFar));
  b.set("u_occlusion_seed", static_cast<int>(around->seed));
}

void add_light(const DomainGeometry& geometry, const RenderSettings& s, SceneBindings& b) {
  b.define("AMRTEX_SHADOWS", s.point_light ? 1 : 0);
  if (!s.point_light) return;
  const double far = kFarLamp * glm::length(geometry.size());
  Vec3d way = s.point_light->position - geometry.middle();
  if (const double most = std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)}); most > far) way *= far / most;
  const Vec3d lamp = (geometry.middle() - geometry.lower + way) / geometry.spacing;
  b.set_ray("u_lamp", {lamp.x, lamp.y, lamp.z});
  b.set("u_lamp_ambient", s.point_light->ambient);
  b.set("u_shadow_step", s.point_light->shadow_step);
}

void add_clip_planes(const DomainGeometry& geometry, const RenderSettings& s, SceneBindings& b) {
  b.define("AMRTEX_CLIP_PLANES", static_cast<int>(s.clip_planes.size()));
  std::vector<double> planes;
  for (const ClipPlane& plane : s.clip_planes) {
    const ClipPlane p = in_finest_cells(geometry, plane);
    // a plane beyond kFar keeps all or nothing
    planes.insert(planes.end(), {p.normal.x, p.normal.y, p.normal.z, std::clamp(p.distance, -kFar, kFar)});
  }
  if (!planes.empty()) b.set_ray("u_clip_planes", planes);
}

void add_ray_offset(const RenderSettings& s, SceneBindings& b) {
  b.define("AMRTEX_RAY_OFFSET", s.ray_offset ? 1 : 0);
  if (s.ray_offset) b.set("u_ray_seed", static_cast<int>(*s.ray_offset));
}

void add_mirror(const RenderSettings& s, SceneBindings& b) {
  b.define("AMRTEX_MIRROR", s.mirror ? 2 * s.mirror->axis + (s.mirror->upper ? 2 : 1) : 0);
}

void add_triangles(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  const std::vector<TriangleObject>& objects = scene.settings.triangles;
  if (objects.empty()) return;
  const auto start = std::chrono::steady_clock::now();
  b.buffers.push_back(triangle_buffer(trace_triangles(scene), geometry.smallest_edge()));
  b.triangle_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::vector<double> colors;
  for (const TriangleObject& object : objects) colors.insert(colors.end(), {object.color.r, object.color.g, object.color.b});
  b.define("AMRTEX_TRIANGLES", static_cast<int>(objects.size()));
  b.set("u_triangle_colors", colors);
}

}  // namespace amrtex
