#include "renderers/scene/scene_bindings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "renderers/consumers/triangle_layer.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex {
namespace {

/// Transfer functions of more points are drawn from a table.
constexpr std::size_t kMostPoints = kMostExactPoints;
constexpr int kTableBins = 4096;
constexpr std::size_t kMostInvisibleRanges = 8;

/// Beyond this many cells a float cannot hold a position on the lattice (2^-13 of a cell);
/// then rays are held in double and positions are rounded once more in each region.
constexpr int kFloatRayCells = 2048;

double smallest_edge(const AmrHierarchy& h) {
  const Vec3d s = h.spacing(h.finest_level());
  return std::min({s.x, s.y, s.z});
}

bool needs_double_rays(const AmrHierarchy& h, const Scene& scene) {
  const Vec3i n = h.cells(h.finest_level());
  const Vec3d size = h.domain_upper() - h.domain_lower();
  const double distance = glm::length(scene.view.eye - (h.domain_lower() + h.domain_upper()) * 0.5);
  const bool narrow = !scene.view.orthographic && scene.view.fov_y < 1;
  return std::max({n.x, n.y, n.z}) > kFloatRayCells || distance > 16 * glm::length(size) || narrow;
}

/// As u_color_points in transfer_function.glsl.
std::vector<double> color_points(const TransferFunction& tf) {
  std::vector<double> color{tf.axis(tf.color.front().value), 0, tf.color.front().rgb.x, tf.color.front().rgb.y,
                            tf.color.front().rgb.z};
  for (std::size_t i = 1; i < tf.color.size(); ++i) {
    const double x = tf.axis(tf.color[i].value);
    const Vec3d step = tf.color[i].rgb - tf.color[i - 1].rgb;
    color.insert(color.end(), {x, 1 / (x - tf.axis(tf.color[i - 1].value)), step.x, step.y, step.z});
  }
  return color;
}

/// `unit`: multiplies extinction so that it is per unit of ray length. `suffix`: of the uniforms' names.
void add_points(const TransferFunction& tf, double unit, UniformValues& uniforms, const std::string& suffix = "") {
  std::vector<double> extinction;
  for (std::size_t i = 0; i < tf.extinction.size(); ++i) {
    const double x = tf.axis(tf.extinction[i].value);
    const double kappa = std::min(tf.extinction[i].extinction * unit, 1e30);
    double slope = 0;
    if (i + 1 < tf.extinction.size())
      slope = (std::min(tf.extinction[i + 1].extinction * unit, 1e30) - kappa) / (tf.axis(tf.extinction[i + 1].value) - x);
    extinction.insert(extinction.end(), {x, kappa, slope});
  }
  uniforms.push_back({"u_extinction_points" + suffix, extinction});
  uniforms.push_back({"u_color_points" + suffix, color_points(tf)});
}

void add_table(const TransferFunction& tf, double unit, SceneBindings& b) {
  const double lower = tf.axis(std::min(tf.extinction.front().value, tf.color.front().value));
  const double upper = tf.axis(std::max(tf.extinction.back().value, tf.color.back().value));
  const double scale = upper > lower ? kTableBins / (upper - lower) : 1;
  HostTexture table = make_buffer("transfer_table", TexelFormat::rgba32f, kTableBins + 1);
  auto* entries = table.as<glm::vec4>();
  for (int i = 0; i <= kTableBins; ++i) {
    const double x = lower + i / scale;
    const double v = tf.logarithmic ? std::pow(10.0, x) : x;
    entries[i] = glm::vec4(Vec3f(tf.color_at(v)), static_cast<float>(std::min(tf.extinction_at(v) * unit, 1e30)));
  }
  b.uniforms.push_back({"u_transfer_axis", std::vector<double>{lower, scale}});
  b.uniforms.push_back({"u_transfer_last", std::vector<int>{kTableBins}});
  b.buffers.push_back(std::move(table));
}

/// Shader knots as u_knots in preintegrated.glsl; more stand in a buffer.
constexpr std::size_t kMostKnots = 34;

/// Both curves' points as one list, and one point beyond all values at each end.
std::vector<double> knots(const TransferFunction& tf, double unit) {
  constexpr double kFar = 1e30;
  std::vector<double> values;
  for (const auto& p : tf.extinction) values.push_back(p.value);
  for (const auto& p : tf.color) values.push_back(p.value);
  std::sort(values.begin(), values.end());
  // the shader must be able to tell them apart
  const auto same = [&](double a, double b) { return static_cast<float>(tf.axis(a)) == static_cast<float>(tf.axis(b)); };
  values.erase(std::unique(values.begin(), values.end(), same), values.end());
  std::vector<double> numbers;
  const auto add = [&](double x, double inverse, double value) {
    const Vec3d rgb = tf.color_at(value);
    numbers.insert(numbers.end(), {x, inverse, std::min(tf.extinction_at(value) * unit, 1e30), rgb.r, rgb.g, rgb.b});
  };
  add(-kFar, 0, values.front());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = tf.axis(values[i]);
    add(x, i + 1 < values.size() ? 1 / (tf.axis(values[i + 1]) - x) : 0, values[i]);
  }
  add(kFar, 0, values.back());
  return numbers;
}

/// What preintegrated.glsl and tolerance.glsl need; returns AMRTEX_KNOTS.
int add_knots(const TransferFunction& tf, double unit, SceneBindings& b) {
  const std::vector<double> numbers = knots(tf, unit);
  const std::size_t count = numbers.size() / 6;
  // over log10 a line from a value near 0 would lie at tiny values nearly all of its way: a decade below the first point will do
  b.uniforms.push_back({"u_knot_lowest", std::vector<double>{tf.logarithmic ? numbers[6] - 1 : -1e30}});
  if (count <= kMostKnots) {
    b.uniforms.push_back({"u_knots", numbers});
    return static_cast<int>(count);
  }
  HostTexture buffer = make_buffer("transfer_knots", TexelFormat::r32f, static_cast<int>(numbers.size()));
  std::transform(numbers.begin(), numbers.end(), buffer.as<float>(), [](double v) { return static_cast<float>(v); });
  b.uniforms.push_back({"u_knot_count", std::vector<int>{static_cast<int>(count)}});
  b.buffers.push_back(std::move(buffer));
  return 0;
}

/// Intervals of values without extinction, first and last value of each; a little inside of
/// the true ones, by what the shader's own evaluation may be off (`margin`, on the axis).
std::vector<double> invisible_ranges(const TransferFunction& tf, double margin) {
  constexpr double kFar = 3e38;
  const auto value = [&](double x) { return tf.logarithmic ? std::pow(10.0, x) : x; };
  std::vector<double> ranges;
  const auto& points = tf.extinction;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].extinction > 0) continue;
    std::size_t last = i;
    while (last + 1 < points.size() && !(points[last + 1].extinction > 0)) ++last;
    const double from = i == 0 ? -kFar : value(tf.axis(points[i].value) + margin);
    const double to = last + 1 == points.size() ? kFar : value(tf.axis(points[last].value) - (last == 0 && i == 0 ? 0 : margin));
    if (from < to && ranges.size() < 2 * kMostInvisibleRanges) ranges.insert(ranges.end(), {from, to});
    i = last;
  }
  return ranges;
}

/// Is the transfer function evaluated from its points, or from a table?
bool is_exact(const TransferFunction& tf) { return std::max(tf.extinction.size(), tf.color.size()) <= kMostPoints; }

std::vector<double> invisible_ranges(const TransferFunction& tf) {
  const double first = tf.axis(tf.extinction.front().value);
  const double span = tf.axis(tf.extinction.back().value) - first;
  return invisible_ranges(tf, is_exact(tf) ? 1e-6 * (span + std::abs(first)) : 1.01 * span / kTableBins);
}

std::vector<double> numbers(const Vec3d& v) { return {v.x, v.y, v.z}; }

void add_camera(const AmrHierarchy& h, const Scene& scene, UniformValues& uniforms) {
  const RenderSettings& s = scene.settings;
  const FinestCamera camera = finest_camera(h, scene);
  uniforms.push_back({"u_eye", numbers(camera.eye), true});
  uniforms.push_back({"u_forward", numbers(camera.forward), true});
  uniforms.push_back({"u_right", numbers(camera.right), true});
  uniforms.push_back({"u_up", numbers(camera.up), true});
  uniforms.push_back({"u_orthographic", std::vector<int>{camera.orthographic ? 1 : 0}});
  uniforms.push_back({"u_cells_per_unit", numbers(camera.cells_per_unit), true});
  uniforms.push_back({"u_draw_lower", numbers(camera.lower), true});
  uniforms.push_back({"u_draw_upper", numbers(camera.upper), true});
  uniforms.push_back({"u_picture_size", std::vector<double>{static_cast<double>(s.width), static_cast<double>(s.height)}});
}

/// Of level_suffices() in contract.glsl. A cell w finest cells wide is smaller than the threshold where
/// w * diagonal * pixels < threshold * distance; `pixels` are those of one world unit at distance 1, or at any one.
void add_detail(const AmrHierarchy& h, const Scene& scene, UniformValues& uniforms) {
  const RenderSettings& s = scene.settings;
  const CameraFrame camera = camera_frame(scene.view, s.width, s.height);
  const Vec3d spacing = h.spacing(h.finest_level());
  const double unit = smallest_edge(h);
  const double diagonal = unit * glm::length(spacing / unit);
  const double pixels = s.height / 2.0 / glm::length(camera.up);
  const double threshold = s.level_of_detail.value_or(0);
  constexpr double kMost = 1e18;  // its square is a float
  Vec3d scale(0);
  double far = 0;
  if (camera.orthographic)
    far = std::min(threshold / (diagonal * pixels), kMost);
  else
    scale = glm::min(spacing / diagonal * (threshold / pixels), Vec3d(kMost));
  uniforms.push_back({"u_detail_level", std::vector<int>{std::min(s.max_level.value_or(h.finest_level()), h.finest_level())}});
  uniforms.push_back({"u_detail_eye", numbers((camera.eye - h.domain_lower()) / spacing)});
  uniforms.push_back({"u_detail_scale", numbers(scale)});
  uniforms.push_back({"u_detail_far", std::vector<double>{far * far}});
}

/// Bisections after which an interval between two samples is no longer than the tolerance.
int bisections(const RenderSettings& s) {
  return std::clamp(static_cast<int>(std::ceil(std::log2(s.step / s.isosurfaces.tolerance))), 1, 32);
}

/// Optical depth of a surface; of an opaque one so much that nothing is left.
double surface_depth(double opacity) { return opacity < 1 ? -std::log1p(-opacity) : 1e4; }

void add_surfaces(const Scene& scene, const EncodedField& field, SceneBindings& b) {
  const Isosurfaces& iso = scene.settings.isosurfaces;
  std::vector<double> light;
  for (std::size_t i = 0; i < iso.values.size(); ++i) {
    const Vec3d rgb = surface_color(scene, iso.values[i]);
    light.insert(light.end(), {rgb.r, rgb.g, rgb.b, surface_depth(iso.opacity.empty() ? 1 : iso.opacity[i])});
  }
  b.uniforms.push_back({"u_isovalues", iso.values});
  b.uniforms.push_back({"u_surface_light", light});
  b.uniforms.push_back({"u_surface_ambient", std::vector<double>{surface_light(0)}});
  // no less than the quantum of positions can tell
  b.uniforms.push_back({"u_face_distance", std::vector<double>{std::clamp(2 * iso.tolerance, 1.0 / 1024, 0.5)}});
  b.uniforms.push_back({"u_bisections", std::vector<int>{bisections(scene.settings)}});
  const bool mapped = !iso.color_field.empty() && iso.output == Output::color;
  const TransferFunction map = surface_colors(scene);
  if (map.color.size() > kMostPoints)
    throw UsageError(fmt::format("surfaces coloured by the field '{}': {} colour points; at most {} are supported",
                                 iso.color_field, map.color.size(), kMostPoints));
  if (mapped && field.field_count < 2)
    throw Error(fmt::format("surfaces coloured by the field '{}': the structure was built without it", iso.color_field));
  if (mapped) b.uniforms.push_back({"u_surface_points", color_points(map)});
  b.defines.emplace_back("AMRTEX_SURFACE_POINTS", mapped ? static_cast<int>(map.color.size()) : 0);
  b.defines.emplace_back("AMRTEX_SURFACE_LOGARITHMIC", mapped && map.logarithmic ? 1 : 0);
  b.defines.emplace_back("AMRTEX_OUTPUT", static_cast<int>(iso.output));
  b.defines.emplace_back("AMRTEX_SHADING", static_cast<int>(iso.shading));
}

/// Beyond this distance, in diagonals of the domain, a lamp is moved nearer along its own direction: what changes
/// is below the rounding of a float, in which positions of lamps further off may not fit.
constexpr double kFarLamp = 1e7;

void add_light(const AmrHierarchy& h, const RenderSettings& s, SceneBindings& b) {
  b.defines.emplace_back("AMRTEX_SHADOWS", s.point_light ? 1 : 0);
  if (!s.point_light) return;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  const double far = kFarLamp * glm::length(h.domain_upper() - h.domain_lower());
  Vec3d way = s.point_light->position - middle;
  if (const double most = std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)}); most > far) way *= far / most;
  const Vec3d lamp = (middle - h.domain_lower() + way) / h.spacing(h.finest_level());
  b.uniforms.push_back({"u_lamp", numbers(lamp), true});
  b.uniforms.push_back({"u_lamp_ambient", std::vector<double>{s.point_light->ambient}});
  b.uniforms.push_back({"u_shadow_step", std::vector<double>{s.point_light->shadow_step}});
}

void add_clip_planes(const AmrHierarchy& h, const RenderSettings& s, SceneBindings& b) {
  b.defines.emplace_back("AMRTEX_CLIP_PLANES", static_cast<int>(s.clip_planes.size()));
  constexpr double kFar = 1e30;  // a plane beyond it keeps all or nothing, and is a float
  std::vector<double> planes;
  for (const ClipPlane& plane : s.clip_planes) {
    const ClipPlane p = in_finest_cells(h, plane);
    planes.insert(planes.end(), {p.normal.x, p.normal.y, p.normal.z, std::clamp(p.distance, -kFar, kFar)});
  }
  if (!planes.empty()) b.uniforms.push_back({"u_clip_planes", planes, true});
}

void add_ray_offset(const RenderSettings& s, SceneBindings& b) {
  b.defines.emplace_back("AMRTEX_RAY_OFFSET", s.ray_offset ? 1 : 0);
  if (s.ray_offset) b.uniforms.push_back({"u_ray_seed", std::vector<int>{static_cast<int>(*s.ray_offset)}});
}

void add_occlusion(const AmrHierarchy& h, const RenderSettings& s, SceneBindings& b) {
  const auto& around = s.isosurfaces.ambient_occlusion;
  const bool on = s.draws_surfaces() && around;
  b.defines.emplace_back("AMRTEX_OCCLUSION", on ? 1 : 0);
  if (!on) return;
  constexpr double kFar = 1e30;  // farther than any domain, and a float
  b.uniforms.push_back({"u_occlusion_rays", std::vector<int>{around->rays}});
  b.uniforms.push_back({"u_occlusion_radius", std::vector<double>{std::min(around->radius / smallest_edge(h), kFar)}});
  b.uniforms.push_back({"u_occlusion_seed", std::vector<int>{static_cast<int>(around->seed)}});
}

/// Nothing of it in a scene without triangles, not even a define: they have an entry point of their own.
void add_triangles(const AmrHierarchy& h, const Scene& scene, SceneBindings& b) {
  const std::vector<TriangleObject>& objects = scene.settings.triangles;
  if (objects.empty()) return;
  const auto start = std::chrono::steady_clock::now();
  b.buffers.push_back(triangle_buffer(trace_triangles(scene), smallest_edge(h)));
  b.triangle_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::vector<double> colors;
  for (const TriangleObject& object : objects) colors.insert(colors.end(), {object.color.r, object.color.g, object.color.b});
  b.defines.emplace_back("AMRTEX_TRIANGLES", static_cast<int>(objects.size()));
  b.uniforms.push_back({"u_triangle_colors", colors});
}

void require_detail(const EncodedField& field, const RenderSettings& s) {
  const auto& defines = field.shader.defines;
  const auto it = std::find(defines.begin(), defines.end(), std::pair<std::string, int>("AMRTEX_LEVEL_OF_DETAIL", 1));
  if (s.prunes_levels() && it == defines.end())
    throw Error(fmt::format("level of detail: the structure of encoding {} was built without it", field.encoding));
}

/// Cells of one level that may lie in a row in a region: along the diagonal of its largest patch, or of the largest page.
double longest_run(const AmrHierarchy& h) {
  double longest = std::min(128 * std::sqrt(3.0), glm::length(Vec3d(h.cells(h.finest_level()))));
  for (int l = 0; l < h.level_count(); ++l)
    for (const Patch& p : h.patches(l)) longest = std::max(longest, glm::length(Vec3d(p.box.size())));
  return longest;
}

/// Throws UsageError for what no picture can be made of, UnsupportedError for more steps than the loops count.
void check_sampling(const AmrHierarchy& h, const Scene& scene) {
  const double step = scene.settings.step;
  if (!(step > 0) || !std::isfinite(step))
    throw UsageError(fmt::format("step {}: accepted: a positive number of cell widths", step));
  if (scene.region)
    for (int a = 0; a < 3; ++a)
      if (std::isnan((*scene.region)[0][a]) || std::isnan((*scene.region)[1][a]))
        throw UsageError("region: a corner is no number; accepted: two corners in world units");
  // lattice: samples of a ray are counted in 32 bits; adaptive: those of a region in a float's 24
  const bool lattice = scene.settings.sampling == Sampling::lattice;
  const double cells = lattice ? glm::length((h.domain_upper() - h.domain_lower()) / smallest_edge(h)) : longest_run(h);
  const double most = lattice ? 0x1p31 : 0x1p24;
  if (cells / step >= most)
    throw UnsupportedError(fmt::format("step {}: {:.3g} samples of sampling {} may lie in a row; at most {:.3g} are counted",
                                       step, cells / step, sampling_name(scene.settings.sampling), most));
}

/// What the shader draws: pictures of depth and normals have no volume.
Mode shader_mode(const RenderSettings& s) { return s.mode == Mode::dvr_iso && !s.draws_volume() ? Mode::iso : s.mode; }

/// a, b of each field.
std::vector<double> value_scales(const EncodedField& field) {
  std::vector<double> scales;
  for (int i = 0; i < field.field_count; ++i) {
    const StorageScale s = field.scale_of(i);
    scales.insert(scales.end(), {s.offset, s.scale});
  }
  return scales;
}

/// Extinction per unit of ray length of an extinction of 1.
double extinction_unit(const AmrHierarchy& h, const TransferFunction& tf) {
  const Vec3d size = h.domain_upper() - h.domain_lower();
  const bool world = tf.length_unit == TransferFunction::LengthUnit::world;
  return world ? smallest_edge(h) : smallest_edge(h) / std::max({size.x, size.y, size.z});
}

/// Longest interval that `tolerance` tries, in cell widths of the region.
constexpr double kLongestInterval = 8;
/// Error that one interval may have: a smaller tolerance needs more of them, so each gets a smaller part. Errors of
/// intervals cancel in part, and corrected ones are smaller than estimated; the factor is measured (experiments/tolerance).
double interval_error(double tolerance) { return 1.2 * std::pow(tolerance, 1.25); }
/// Part of the tolerance that a ray may leave behind it.
constexpr double kToleranceLeft = 0.1;

void add_integrator(const Scene& scene, const EncodedField& field, double unit, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  b.defines.emplace_back("AMRTEX_INTEGRATOR", static_cast<int>(s.integrator));
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  if (by_tolerance || s.integrator == Integrator::preintegrated)
    b.defines.emplace_back("AMRTEX_KNOTS", add_knots(scene.transfer_function, unit, b));
  if (!by_tolerance) return;
  if (field.definition.filter == Filter::nearest)
    throw UnsupportedError(
        "integrator tolerance: the filter nearest jumps from cell to cell, which no interval follows; accepted "
        "are linear_lod, linear_page, linear_vertex, basis");
  b.uniforms.push_back({"u_interval_error", std::vector<double>{interval_error(s.tolerance)}});
  b.uniforms.push_back({"u_longest", std::vector<double>{kLongestInterval}});
}

/// The fields beside the first: nothing of theirs where there are none.
void add_fields(const AmrHierarchy& h, const EncodedField& field, const Scene& scene, SceneBindings& b) {
  const std::vector<FieldTransfer>& more = scene.more_fields;
  const auto count = static_cast<int>(more.size());
  b.defines.emplace_back("AMRTEX_TRANSFERS", 1 + count);
  if (more.empty()) return;
  if (count + 1 > kMostFields)
    throw UsageError(fmt::format("encoding {}: {} fields with transfer functions; at most {} are supported", field.encoding,
                                 count + 1, kMostFields));
  if (field.field_count < count + 1)
    throw Error(fmt::format("encoding {}: {} fields with transfer functions; the structure was built with {}", field.encoding,
                            count + 1, field.field_count));
  std::vector<double> invisible;
  for (int number = 1; number <= count; ++number) {
    const TransferFunction& tf = more[static_cast<std::size_t>(number - 1)].transfer_function;
    const std::string suffix = fmt::format("_{}", number);
    add_points(tf, extinction_unit(h, tf), b.uniforms, suffix);
    b.defines.emplace_back("AMRTEX_EXTINCTION_POINTS" + suffix, static_cast<int>(tf.extinction.size()));
    b.defines.emplace_back("AMRTEX_COLOR_POINTS" + suffix, static_cast<int>(tf.color.size()));
    b.defines.emplace_back("AMRTEX_LOGARITHMIC" + suffix, tf.logarithmic ? 1 : 0);
    const std::vector<double> ranges = invisible_ranges(tf);
    for (std::size_t i = 0; i < ranges.size(); i += 2)
      invisible.insert(invisible.end(), {static_cast<double>(number), ranges[i], ranges[i + 1]});
  }
  b.defines.emplace_back("AMRTEX_MORE_INVISIBLE_RANGES", static_cast<int>(invisible.size() / 3));
  if (!invisible.empty()) b.uniforms.push_back({"u_more_invisible_ranges", invisible});
}

/// A structure without the parts that one transfer function hides has no other's picture.
void require_hidden_parts(const EncodedField& field, const Scene& scene) {
  if (field.invisible.empty()) return;
  Scene pruned = scene;
  pruned.settings.prune = true;
  for (const char* key : {"prune", "transfer_functions"}) validate_setting(pruned, key);
  const std::vector<double> hidden = invisible_ranges(scene.transfer_function);
  for (const auto& [from, to] : field.invisible) {
    bool still = false;
    for (std::size_t i = 0; i < hidden.size(); i += 2) still = still || (from >= hidden[i] && to <= hidden[i + 1]);
    if (!still)
      throw UsageError(fmt::format(
          "encoding {}: pruned for a transfer function that hides the values from {:.6g} to {:.6g}, of which this one "
          "shows some; draw it with that or build without --prune",
          field.encoding, from, to));
  }
}

}  // namespace

FinestCamera finest_camera(const AmrHierarchy& h, const Scene& scene) {
  const CameraFrame frame = camera_frame(scene.view, scene.settings.width, scene.settings.height);
  const Vec3d spacing = h.spacing(h.finest_level());
  const double unit = smallest_edge(h);
  const double to_units = frame.orthographic ? 1 / unit : 1;
  const auto to_finest = [&](const Vec3d& p) { return (p - h.domain_lower()) / spacing; };
  FinestCamera camera;
  camera.eye = to_finest(frame.eye);
  camera.forward = frame.forward;
  camera.right = frame.right * to_units;
  camera.up = frame.up * to_units;
  camera.cells_per_unit = Vec3d(unit) / spacing;
  camera.upper = Vec3d(h.cells(h.finest_level()));
  camera.orthographic = frame.orthographic;
  if (scene.region) {
    camera.lower = glm::max(camera.lower, to_finest((*scene.region)[0]));
    camera.upper = glm::max(camera.lower, glm::min(camera.upper, to_finest((*scene.region)[1])));
  }
  return camera;
}

UniformValues field_uniforms(const AmrHierarchy& h, const EncodedField& field) {
  const Vec3i n = h.cells(h.finest_level());
  std::vector<int> widths;
  for (int l = 0; l < h.level_count(); ++l) widths.push_back(h.cell_width(l));
  UniformValues uniforms;
  uniforms.push_back({"u_domain_cells", std::vector<int>{n.x, n.y, n.z}});
  uniforms.push_back({"u_level_width", widths});
  uniforms.push_back({"u_range_origin", std::vector<double>{field.range_origin}});
  uniforms.push_back({"u_value_scale", value_scales(field)});
  if (!field.more_range_origins.empty()) {
    std::vector<double> origins{field.range_origin};
    origins.insert(origins.end(), field.more_range_origins.begin(), field.more_range_origins.end());
    uniforms.push_back({"u_range_origins", origins});
  }
  // without a scene nothing is pruned
  uniforms.push_back({"u_detail_level", std::vector<int>{h.finest_level()}});
  for (const char* name : {"u_detail_eye", "u_detail_scale"}) uniforms.push_back({name, numbers(Vec3d(0))});
  uniforms.push_back({"u_detail_far", std::vector<double>{0}});
  for (const auto& [name, v] : field.integer_uniforms) uniforms.push_back({name, std::vector<int>{v.x, v.y, v.z}});
  return uniforms;
}

SceneBindings bind_scene(const AmrHierarchy& h, const EncodedField& field, const Scene& scene) {
  const RenderSettings& s = scene.settings;
  validate(scene);
  check_sampling(h, scene);
  const double unit = smallest_edge(h);
  SceneBindings b;
  b.uniforms = field_uniforms(h, field);
  add_camera(h, scene, b.uniforms);
  require_detail(field, s);
  require_hidden_parts(field, scene);
  if (s.prunes_levels()) add_detail(h, scene, b.uniforms);
  b.uniforms.push_back({"u_step", std::vector<double>{s.step}});
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  const double least = by_tolerance ? kToleranceLeft * s.tolerance : 0;
  b.uniforms.push_back({"u_early_end", std::vector<double>{std::max(1 - s.early_end.value_or(1), least)}});
  b.uniforms.push_back({"u_length_unit", std::vector<double>{unit}});
  // modes without a transfer function declare points of which nothing is read
  int extinction_points = 1;
  int color_points = 1;
  int invisible_count = 0;
  if (s.draws_volume()) {
    const TransferFunction& tf = scene.transfer_function;
    const double per_unit = extinction_unit(h, tf);
    b.transfer_exact = is_exact(tf);
    if (b.transfer_exact) {
      add_points(tf, per_unit, b.uniforms);
      extinction_points = static_cast<int>(tf.extinction.size());
      color_points = static_cast<int>(tf.color.size());
    } else {
      extinction_points = 0;
      color_points = 0;
      add_table(tf, per_unit, b);
    }
    const std::vector<double> invisible = invisible_ranges(tf);
    invisible_count = static_cast<int>(invisible.size() / 2);
    if (invisible_count > 0) b.uniforms.push_back({"u_invisible_ranges", invisible});
  }
  b.defines = {{"AMRTEX_RAY_DOUBLE", needs_double_rays(h, scene) ? 1 : 0},
               {"AMRTEX_LOGARITHMIC", s.draws_volume() && scene.transfer_function.logarithmic ? 1 : 0},
               {"AMRTEX_EXTINCTION_POINTS", extinction_points},
               {"AMRTEX_COLOR_POINTS", color_points},
               {"AMRTEX_INVISIBLE_RANGES", invisible_count},
               {"AMRTEX_MODE", static_cast<int>(shader_mode(s))},
               {"AMRTEX_LATTICE", s.sampling == Sampling::lattice ? 1 : 0},
               {"AMRTEX_SKIP", s.skip ? 1 : 0},
               {"AMRTEX_EARLY_END", (s.early_end || by_tolerance) && s.draws_volume() ? 1 : 0},
               {"AMRTEX_ISOVALUES", s.draws_surfaces() ? static_cast<int>(s.isosurfaces.values.size()) : 0}};
  add_clip_planes(h, s, b);
  add_ray_offset(s, b);
  add_occlusion(h, s, b);
  b.defines.emplace_back("AMRTEX_MIRROR", s.mirror ? 2 * s.mirror->axis + (s.mirror->upper ? 2 : 1) : 0);
  add_light(h, s, b);
  add_fields(h, field, scene, b);
  add_triangles(h, scene, b);
  if (s.draws_surfaces()) add_surfaces(scene, field, b);
  add_integrator(scene, field, extinction_unit(h, scene.transfer_function), b);
  return b;
}

SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering) {
  SceneNeeds needs;
  needs.filter = filter;
  needs.filtering = filter == Filter::nearest ? Filtering::manual : filtering;
  needs.level_of_detail = scene.settings.prunes_levels();
  needs.draw_boxes = scene.settings.consumer != ConsumerKind::raycast;
  needs.everything = scene.settings.everything;
  needs.value_ranges = scene.settings.skip || needs.everything;
  needs.field_ranges = needs.value_ranges && !scene.more_fields.empty();
  const Shading shading = scene.settings.draws_surfaces() ? scene.settings.isosurfaces.shading : Shading::none;
  const bool lit =
      shading == Shading::gradient || (scene.settings.draws_surfaces() && scene.settings.isosurfaces.ambient_occlusion);
  needs.analytic_gradients = shading == Shading::analytic;
  needs.gradients = lit || needs.everything;
  for (const char* key : {"transfer_functions", "prune"}) validate_setting(scene, key);
  if (!scene.settings.prune) return needs;
  const std::vector<double> ranges = invisible_ranges(scene.transfer_function);
  for (std::size_t i = 0; i < ranges.size(); i += 2) needs.invisible.push_back({ranges[i], ranges[i + 1]});
  return needs;
}

}  // namespace amrtex
