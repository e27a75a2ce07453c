#include "renderers/bindings/scene_bindings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "renderers/bindings/finest_camera.hpp"
#include "renderers/bindings/leap_bindings.hpp"
#include "renderers/bindings/light_bindings.hpp"
#include "renderers/bindings/picture_units.hpp"
#include "renderers/bindings/plan_bindings.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/bindings/transfer_bindings.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "renderers/scene/stored_units.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Part of the tolerance that a ray may leave behind it.
constexpr double kToleranceLeft = 0.1;
/// What the bounds of a pixel's intervals may come to, in tolerances. Errors are smaller than their bounds and cancel in part;
/// the factor is measured (tests/tolerance_test.cpp), and no pixel is off by more than it and kToleranceLeft.
constexpr double kSumOfBounds = 1.5;

/// Cells of one level that may lie in a row in a region: along the diagonal of its largest patch, or of the largest page.
double longest_run(const DomainGeometry& geometry) {
  return std::max(std::min(128 * std::sqrt(3.0), glm::length(Vec3d(geometry.cells))), geometry.longest_patch);
}

/// Throws UsageError for what no picture can be made of, UnsupportedError for more steps than the loops count.
void check_sampling(const DomainGeometry& geometry, const Scene& scene) {
  const double step = scene.settings.step;
  if (!(step > 0) || !std::isfinite(step))
    throw UsageError(fmt::format("step {}: accepted: a positive number of cell widths", step));
  if (scene.region)
    for (int a = 0; a < 3; ++a)
      if (std::isnan((*scene.region)[0][a]) || std::isnan((*scene.region)[1][a]))
        throw UsageError("region: a corner is no number; accepted: two corners in world units");
  // lattice: samples of a ray are counted in 32 bits; adaptive: those of a region in a float's 24
  const bool lattice = scene.settings.sampling == Sampling::lattice;
  const double cells = lattice ? glm::length(geometry.size() / geometry.smallest_edge()) : longest_run(geometry);
  const double most = lattice ? 0x1p31 : 0x1p24;
  if (cells / step >= most)
    throw UnsupportedError(fmt::format("step {}: {:.3g} samples of sampling {} may lie in a row; at most {:.3g} are counted",
                                       step, cells / step, sampling_name(scene.settings.sampling), most));
}

/// Throws UnsupportedError for a curve over log10 of values that no float holds.
void require_log_axes(const EncodedField& field, const Scene& scene) {
  if (scene.settings.draws_volume())
    require_log_axis(scene.transfer_function, field.scale.units, field.values.front().least_magnitude);
  for (std::size_t i = 0; i < scene.more_fields.size(); ++i) {
    const auto number = static_cast<int>(i) + 1;
    require_log_axis(scene.more_fields[i].transfer_function, field.scale_of(number).units, field.values[i + 1].least_magnitude);
  }
}

/// What the shader draws: pictures of depth and normals have no volume.
Mode shader_mode(const RenderSettings& s) { return s.mode == Mode::dvr_iso && !s.draws_volume() ? Mode::iso : s.mode; }

/// a, b of each field, to numbers in its units.
std::vector<double> value_scales(const EncodedField& field) {
  std::vector<double> scales;
  for (int i = 0; i < field.field_count; ++i) {
    const StorageScale s = field.scale_of(i).in_units();
    scales.insert(scales.end(), {s.offset, s.scale});
  }
  return scales;
}

void add_march(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  const double least = by_tolerance ? kToleranceLeft * s.tolerance : 0;
  b.set("u_step", s.step);
  b.set("u_early_end", std::max(1 - s.early_end.value_or(1), least));
  // lengths that are multiplied by an offset need all their digits
  b.define("AMRTEX_RAY_DOUBLE", needs_double_rays(geometry, scene) || b.picture.length > 0 ? 1 : 0);
  b.define("AMRTEX_MODE", static_cast<int>(shader_mode(s)));
  b.define("AMRTEX_LATTICE", s.sampling == Sampling::lattice ? 1 : 0);
  b.define("AMRTEX_SKIP", s.skip ? 1 : 0);
  b.define("AMRTEX_EARLY_END", (s.early_end || by_tolerance) && s.draws_volume() ? 1 : 0);
  b.define("AMRTEX_ISOVALUES", s.draws_surfaces() ? static_cast<int>(s.isosurfaces.values.size()) : 0);
}

/// What follows f between samples takes no filter that jumps.
void require_interpolation(std::string_view setting, Filter filter) {
  if (interpolates(filter)) return;
  std::vector<std::string_view> accepted;
  for (const Filter other : interpolating_filters()) accepted.push_back(filter_name(other));
  throw UnsupportedError(fmt::format("{}: the filter {} jumps from cell to cell, which no interval follows; accepted are {}", setting,
                                     filter_name(filter), fmt::join(accepted, ", ")));
}

void add_integrator(const DomainGeometry& geometry, const Scene& scene, const FilterDefinition& definition, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  b.define("AMRTEX_INTEGRATOR", static_cast<int>(s.integrator));
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  if (by_tolerance || s.integrator == Integrator::preintegrated)
    add_knots(scene.transfer_function, extinction_unit(geometry, scene.transfer_function), b);
  if (!by_tolerance) return;
  require_interpolation("integrator tolerance", definition.filter);
  b.define("AMRTEX_CONTINUOUS", filter_info(definition.filter).continuity == Continuity::everywhere ? 1 : 0);
  b.set("u_error_bound", kSumOfBounds * s.tolerance);
}

}  // namespace

UniformValues field_uniforms(const DomainGeometry& geometry, const EncodedField& field) {
  SceneBindings b;
  b.uniforms.push_back({"u_domain_cells", std::vector<int>{geometry.cells.x, geometry.cells.y, geometry.cells.z}});
  b.uniforms.push_back({"u_level_width", geometry.level_widths});
  b.set("u_range_origin", field.range_origin);
  b.set("u_value_scale", value_scales(field));
  if (!field.more_range_origins.empty()) {
    std::vector<double> origins{field.range_origin};
    origins.insert(origins.end(), field.more_range_origins.begin(), field.more_range_origins.end());
    b.set("u_range_origins", origins);
  }
  // without a scene nothing is pruned
  b.set("u_detail_level", geometry.finest_level());
  for (const char* name : {"u_detail_eye", "u_detail_scale"}) b.set(name, {0, 0, 0});
  b.set("u_detail_far", 0.0);
  for (const auto& [name, v] : field.integer_uniforms) b.uniforms.push_back({name, std::vector<int>{v.x, v.y, v.z}});
  return std::move(b.uniforms);
}

ShaderKey probe_key(const EncodedField& field, int number) {
  ShaderKey key;
  key.entry = "probe.comp";
  return key.use(field.shader).define("AMRTEX_RAY_DOUBLE", 0).define("AMRTEX_PROBE_FIELD", number);
}

ShaderKey scene_key(const std::string& entry, const EncodedField& field, const SceneBindings& bindings, bool counting) {
  ShaderKey key;
  key.entry = entry;
  key.use(field.shader);
  for (const auto& [name, value] : bindings.defines) key.define(name, value);
  return key.define("AMRTEX_COUNT", counting ? 1 : 0);
}

const char* raycast_entry(const Scene& scene) {
  return scene.settings.triangles.empty() ? "raycast.frag" : "raycast_triangles.frag";
}

SceneBindings bind_scene(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, LeapMap leaps) {
  const RenderSettings& s = scene.settings;
  validate(scene);
  require_resolved(geometry, scene);
  check_sampling(geometry, scene);
  require_needs(field, scene);
  require_log_axes(field, scene);
  const Scene stored = in_units(scene, [&](int number) { return field.scale_of(number).units; });
  SceneBindings b;
  b.uniforms = field_uniforms(geometry, field);
  add_camera(geometry, scene, b);
  if (s.prunes_levels()) add_detail(geometry, scene, b);
  add_picture_units(geometry, field, scene, b);
  add_march(geometry, scene, b);
  add_transfer_function(geometry, stored, b);
  add_leaps(field, stored, leaps, b);
  if (s.sampling == Sampling::planned) require_interpolation("sampling planned", field.definition.filter);
  add_plan(geometry, field, stored, b);
  add_clip_planes(geometry, s, b);
  add_ray_offset(s, b);
  add_mirror(s, b);
  add_occlusion(geometry, s, b);
  add_light(geometry, s, b);
  add_more_transfer_functions(geometry, stored, b);
  add_triangles(geometry, scene, b);
  add_surfaces(scene, stored, field, b);
  add_integrator(geometry, stored, field.definition, b);
  return b;
}

}  // namespace amrtex
