#include "renderers/scene/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>
#include <span>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

bool finite(const Vec3d& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Unit vector; scaled first, so that views of worlds of 1e200 or 1e-200 work.
Vec3d direction_of(const Vec3d& v, const char* what) {
  const double size = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(size > 0) || !finite(v)) throw Error(fmt::format("view: {}", what));
  return glm::normalize(v / size);
}

/// Place of x among ascending points: the upper one's index and the weight of it.
template <class Point, class Axis>
std::pair<std::size_t, double> find_segment(const std::vector<Point>& points, double x, Axis&& axis) {
  if (points.empty() || !(x > axis(points.front().value))) return {0, 1};
  std::size_t k = 1;
  while (k < points.size() && x >= axis(points[k].value)) ++k;
  if (k == points.size()) return {k - 1, 1};
  const double a = axis(points[k - 1].value);
  return {k, (x - a) / (axis(points[k].value) - a)};
}

template <class Point>
void check_points(const std::vector<Point>& points, const char* what, const char* key, bool logarithmic) {
  if (points.empty()) throw Error(fmt::format("{}: '{}' has no point; at least one is needed", what, key));
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double v = points[k].value;
    if (!std::isfinite(v)) throw Error(fmt::format("{}: '{}' point {}: the value {} is not finite", what, key, k, v));
    if (logarithmic && v <= 0)
      throw Error(fmt::format("{}: '{}' point {}: the value {} must be above 0 on a logarithmic scale", what, key, k, v));
    if (k > 0 && !(v > points[k - 1].value))
      throw Error(fmt::format("{}: '{}' point {}: the value {} does not lie above the one before, {}", what, key, k, v,
                              points[k - 1].value));
  }
}

void check_color(const Vec3d& rgb, std::string_view where) {
  for (int c = 0; c < 3; ++c)
    if (!(rgb[c] >= 0 && rgb[c] <= 1)) throw Error(fmt::format("{}: {} must lie between 0 and 1", where, rgb[c]));
}

void check_keys(const Json& json, const char* what, std::span<const char* const> accepted) {
  if (!json.is_object()) throw UsageError(fmt::format("{}: must be an object with the keys {}", what, fmt::join(accepted, ", ")));
  for (const auto& item : json.items())
    if (std::find(accepted.begin(), accepted.end(), item.key()) == accepted.end())
      throw UsageError(fmt::format("{}: unknown key '{}'; accepted are {}", what, item.key(), fmt::join(accepted, ", ")));
}

double number(const Json& json, const char* what, const char* key) {
  if (!json.is_number()) throw UsageError(fmt::format("{}: '{}' must be a number, not {}", what, key, json.dump()));
  return json.get<double>();
}

/// A list of `n` numbers.
std::vector<double> numbers(const Json& json, std::size_t n, const char* what, const char* key, const char* accepted) {
  std::vector<double> out;
  if (json.is_array())
    for (const Json& v : json)
      if (v.is_number()) out.push_back(v.get<double>());
  if (!json.is_array() || json.size() != n || out.size() != n)
    throw UsageError(fmt::format("{}: '{}' accepts {}, not {}", what, key, accepted, json.dump()));
  return out;
}

Vec3d vector_of(const Json& json, const char* what, const char* key) {
  const auto v = numbers(json, 3, what, key, "three numbers [x, y, z]");
  return {v[0], v[1], v[2]};
}

std::string choice(const Json& json, const char* what, const char* key, std::span<const char* const> accepted) {
  const std::string given = json.is_string() ? json.get<std::string>() : json.dump();
  if (std::find(accepted.begin(), accepted.end(), given) == accepted.end())
    throw UsageError(fmt::format("{}: '{}' accepts {}, not {}", what, key, fmt::join(accepted, ", "), given));
  return given;
}

const Json& points_of(const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end() || !it->is_array() || it->empty())
    throw UsageError(fmt::format("transfer_function: '{}' must be a list of points", key));
  return *it;
}

Json list(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }

}  // namespace

CameraFrame camera_frame(const View& view, int width, int height) {
  if (width < 1 || height < 1)
    throw Error(fmt::format("view: a picture of {} x {} pixels; both must be at least 1", width, height));
  CameraFrame camera;
  camera.eye = view.eye;
  camera.orthographic = view.orthographic;
  camera.forward = direction_of(view.at - view.eye, "'eye' and 'at' must be finite and differ");
  const Vec3d right = glm::cross(camera.forward, direction_of(view.up, "'up' must be finite and not 0"));
  if (!(glm::length(right) > 1e-9)) throw Error("view: 'up' must not be parallel to the direction from 'eye' to 'at'");
  double half_height = view.height / 2;
  if (view.orthographic) {
    if (!(view.height > 0) || !std::isfinite(view.height))
      throw Error(fmt::format("view: 'height' is {}; it must be positive", view.height));
  } else {
    if (!(view.fov_y > 0 && view.fov_y < 180))
      throw Error(fmt::format("view: 'fov_y' is {}; it must lie between 0 and 180 degrees", view.fov_y));
    half_height = std::tan(glm::radians(view.fov_y) / 2);
  }
  camera.right = glm::normalize(right) * (half_height * width / height);
  camera.up = glm::normalize(glm::cross(right, camera.forward)) * half_height;
  return camera;
}

WorldRay camera_ray(const CameraFrame& camera, int x, int y, int width, int height) {
  const double u = 2 * (x + 0.5) / width - 1;
  const double v = 1 - 2 * (y + 0.5) / height;
  const Vec3d across = camera.right * u + camera.up * v;
  if (camera.orthographic) return {camera.eye + across, camera.forward};
  return {camera.eye, glm::normalize(camera.forward + across)};
}

double TransferFunction::axis(double value) const {
  if (!logarithmic) return value;
  return value > 0 ? std::log10(value) : -std::numeric_limits<double>::infinity();
}

double TransferFunction::extinction_at(double value) const {
  if (extinction.empty()) return 0;
  const auto [k, w] = find_segment(extinction, axis(value), [&](double v) { return axis(v); });
  const double upper = extinction[k].extinction;
  if (w == 1) return upper;
  const double lower = extinction[k - 1].extinction;
  if (w == 0) return lower;
  // between two points of which one is infinite all is; 0 times infinity would be no number
  return std::isinf(lower + upper) ? lower + upper : lower + w * (upper - lower);
}

Vec3d TransferFunction::color_at(double value) const {
  if (color.empty()) return Vec3d(0);
  const auto [k, w] = find_segment(color, axis(value), [&](double v) { return axis(v); });
  if (w == 1) return color[k].rgb;
  return color[k - 1].rgb + w * (color[k].rgb - color[k - 1].rgb);
}

double TransferFunction::max_extinction(double min, double max) const {
  double most = std::max(extinction_at(min), extinction_at(max));
  for (const ExtinctionPoint& p : extinction)
    if (p.value >= min && p.value <= max) most = std::max(most, p.extinction);
  return most;
}

void validate(const TransferFunction& tf) {
  check_points(tf.extinction, "transfer function", "extinction", tf.logarithmic);
  check_points(tf.color, "transfer function", "color", tf.logarithmic);
  for (std::size_t k = 0; k < tf.extinction.size(); ++k)
    if (!(tf.extinction[k].extinction >= 0))
      throw Error(fmt::format("transfer function: 'extinction' point {}: the extinction {} must not be negative", k,
                              tf.extinction[k].extinction));
  for (std::size_t k = 0; k < tf.color.size(); ++k)
    check_color(tf.color[k].rgb, fmt::format("transfer function: 'color' point {}", k));
}

std::string_view mode_name(Mode mode) {
  switch (mode) {
    case Mode::dvr:
      return "dvr";
    case Mode::projection:
      return "projection";
    case Mode::mip:
      return "mip";
    case Mode::iso:
      return "iso";
    case Mode::dvr_iso:
      return "dvr_iso";
  }
  return "";
}

std::string_view output_name(Output output) {
  switch (output) {
    case Output::color:
      return "color";
    case Output::depth:
      return "depth";
    case Output::normal:
      return "normal";
  }
  return "";
}

std::string_view shading_name(Shading shading) {
  constexpr std::array<std::string_view, 5> kNames{"none", "gradient", "central", "clamped", "analytic"};
  return kNames[static_cast<std::size_t>(shading)];
}

int RenderSettings::picture_channels() const {
  if (draws_surfaces()) return isosurfaces.output == Output::depth ? 1 : 4;
  return mode == Mode::dvr ? 4 : 1;
}

std::string_view consumer_name(ConsumerKind consumer) {
  switch (consumer) {
    case ConsumerKind::raycast:
      return "raycast";
    case ConsumerKind::multipass:
      return "multipass";
    case ConsumerKind::slices:
      return "slices";
    case ConsumerKind::stencil_slices:
      return "stencil_slices";
  }
  return "";
}

std::string_view slice_target_name(SliceTarget target) { return target == SliceTarget::rgba32f ? "rgba32f" : "rgba8"; }

ConsumerKind parse_consumer(std::string_view name) {
  for (const ConsumerKind kind :
       {ConsumerKind::raycast, ConsumerKind::multipass, ConsumerKind::slices, ConsumerKind::stencil_slices})
    if (name == consumer_name(kind)) return kind;
  throw UsageError(fmt::format("unknown consumer '{}'; accepted are raycast, multipass, slices, stencil_slices", name));
}

SliceTarget parse_slice_target(std::string_view name) {
  for (const SliceTarget target : {SliceTarget::rgba32f, SliceTarget::rgba8})
    if (name == slice_target_name(target)) return target;
  throw UsageError(fmt::format("unknown slice_target '{}'; accepted are rgba32f, rgba8", name));
}

std::string_view sampling_name(Sampling sampling) { return sampling == Sampling::lattice ? "lattice" : "adaptive"; }

std::string_view integrator_name(Integrator integrator) {
  switch (integrator) {
    case Integrator::exponential_midpoint:
      return "exponential_midpoint";
    case Integrator::euler:
      return "euler";
    case Integrator::left:
      return "left";
    case Integrator::preintegrated:
      return "preintegrated";
    case Integrator::tolerance:
      return "tolerance";
  }
  return "";
}

Integrator parse_integrator(std::string_view name) {
  if (name == "midpoint") return Integrator::exponential_midpoint;
  for (const Integrator integrator :
       {Integrator::exponential_midpoint, Integrator::euler, Integrator::left, Integrator::preintegrated, Integrator::tolerance})
    if (name == integrator_name(integrator)) return integrator;
  throw UsageError(fmt::format(
      "unknown integrator '{}'; accepted are exponential_midpoint (or midpoint), euler, left, preintegrated, tolerance", name));
}

void validate_integrator(const RenderSettings& s) {
  if (s.integrator == Integrator::exponential_midpoint) return;
  if (s.mode != Mode::dvr)
    throw UsageError(fmt::format("the mode {} takes the integrator exponential_midpoint alone; {} accepts the mode dvr",
                                 mode_name(s.mode), integrator_name(s.integrator)));
  if (s.integrator != Integrator::tolerance) return;
  if (s.sampling != Sampling::adaptive)
    throw UsageError("the integrator tolerance chooses its intervals: it accepts the sampling adaptive, not lattice");
  if (!(s.tolerance > 0 && s.tolerance <= 1))
    throw UsageError(
        fmt::format("the tolerance {} is the error asked of a channel of a pixel; it must lie in (0, 1]", s.tolerance));
}

void validate_prune(const RenderSettings& s) {
  if (!s.prune) return;
  if (s.mode != Mode::dvr)
    throw UsageError(
        fmt::format("in mode {} the transfer function hides nothing for good; accepted: mode dvr", mode_name(s.mode)));
  if (s.everything) throw UsageError("needs 'all' keeps what pruning leaves out; accepted: one of both");
  if (s.prunes_levels())
    throw UsageError("level_of_detail and max_level draw cells that pruning knows nothing of; accepted: one of both");
  if (s.integrator == Integrator::preintegrated || s.integrator == Integrator::tolerance)
    throw UsageError(
        fmt::format("the integrator {} joins hidden values to visible ones; accepted: exponential_midpoint, euler, left",
                    integrator_name(s.integrator)));
}

Mode parse_mode(std::string_view name) {
  for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso})
    if (name == mode_name(mode)) return mode;
  throw UsageError(fmt::format("unknown mode '{}'; accepted are dvr, projection, mip, iso, dvr_iso", name));
}

Output parse_output(std::string_view name) {
  for (const Output output : {Output::color, Output::depth, Output::normal})
    if (name == output_name(output)) return output;
  throw UsageError(fmt::format("unknown output '{}'; accepted are color, depth, normal", name));
}

Shading parse_shading(std::string_view name) {
  for (const Shading shading : {Shading::none, Shading::gradient, Shading::central, Shading::clamped, Shading::analytic})
    if (name == shading_name(shading)) return shading;
  throw UsageError(fmt::format("unknown shading '{}'; accepted are none, gradient, central, clamped, analytic", name));
}

void validate(const Isosurfaces& iso) {
  if (iso.values.empty()) throw UsageError("isosurfaces: 'isovalues' is missing; it accepts a list of field values");
  if (iso.values.size() > kMostIsovalues)
    throw UsageError(
        fmt::format("isosurfaces: 'isovalues' has {} values; at most {} are supported", iso.values.size(), kMostIsovalues));
  for (std::size_t i = 0; i < iso.values.size(); ++i) {
    if (!std::isfinite(iso.values[i]))
      throw UsageError(fmt::format("isosurfaces: 'isovalues' holds {}; it must be finite", iso.values[i]));
    if (i > 0 && !(iso.values[i] > iso.values[i - 1])) throw UsageError("isosurfaces: 'isovalues' must ascend");
  }
  if (!iso.opacity.empty() && iso.opacity.size() != iso.values.size())
    throw UsageError(
        fmt::format("isosurfaces: 'iso_opacity' has {} values for {} isovalues; it accepts one number, or one a value",
                    iso.opacity.size(), iso.values.size()));
  for (const double o : iso.opacity)
    if (!(o > 0 && o <= 1)) throw UsageError(fmt::format("isosurfaces: 'iso_opacity' is {}; it must lie in (0, 1]", o));
  if (iso.color.size() > 16) throw UsageError("isosurfaces: 'surface_color' has more than 16 points");
  if (!iso.color.empty()) check_points(iso.color, "isosurfaces", "surface_color", false);
  for (const auto& point : iso.color) check_color(point.rgb, "isosurfaces: 'surface_color'");
  if (!(iso.tolerance > 0 && iso.tolerance <= 1))
    throw UsageError(fmt::format("isosurfaces: 'iso_tolerance' is {}; it must lie in (0, 1] cell widths", iso.tolerance));
  if (!iso.ambient_occlusion) return;
  const AmbientOcclusion& around = *iso.ambient_occlusion;
  if (around.rays < 1 || around.rays > kMostOcclusionRays)
    throw UsageError(
        fmt::format("isosurfaces: 'ambient_occlusion' has {} rays; it accepts 1 to {}", around.rays, kMostOcclusionRays));
  if (!(around.radius > 0) || !std::isfinite(around.radius))
    throw UsageError(
        fmt::format("isosurfaces: 'ambient_occlusion' has the radius {}; it must be above 0, in world units", around.radius));
  if (iso.output != Output::color)
    throw UsageError(fmt::format("isosurfaces: 'ambient_occlusion' darkens colours: it accepts the output color, not {}",
                                 output_name(iso.output)));
}

void validate_light(const RenderSettings& s) {
  if (!s.point_light) return;
  const PointLight& light = *s.point_light;
  if (!finite(light.position))
    throw UsageError(fmt::format("'point_light' is ({}, {}, {}); it must be three finite numbers [x, y, z]", light.position.x,
                                 light.position.y, light.position.z));
  if (!(light.ambient >= 0 && light.ambient <= 1))
    throw UsageError(fmt::format("'ambient' is {}; it must lie in [0, 1]", light.ambient));
  if (!(light.shadow_step > 0 && std::isfinite(light.shadow_step)))
    throw UsageError(fmt::format("'shadow_step' is {}; it must be above 0, in cell widths", light.shadow_step));
  if (s.integrator != Integrator::exponential_midpoint)
    throw UsageError(
        fmt::format("'point_light' takes the integrator exponential_midpoint alone, not {}", integrator_name(s.integrator)));
  if (s.draws_volume()) return;
  const bool measures = s.mode == Mode::dvr_iso;
  throw UsageError(fmt::format("'point_light' lights a volume: the modes dvr and dvr_iso (output color) accept it, not {}{}",
                               mode_name(s.mode),
                               measures ? fmt::format(" with output {}", output_name(s.isosurfaces.output)) : ""));
}

void validate_clip_planes(const std::vector<ClipPlane>& planes) {
  if (planes.size() > kMostClipPlanes)
    throw UsageError(fmt::format("'clip_planes' has {} planes; at most {} are supported", planes.size(), kMostClipPlanes));
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const Vec3d& n = planes[i].normal;
    if (!finite(n) || !std::isfinite(planes[i].distance))
      throw UsageError(fmt::format("'clip_planes' plane {}: [{}, {}, {}, {}] must be four finite numbers", i, n.x, n.y, n.z,
                                   planes[i].distance));
    if (n == Vec3d(0))
      throw UsageError(
          fmt::format("'clip_planes' plane {}: the normal (0, 0, 0) has no direction; accepted: [a, b, c, d] with "
                      "a, b or c other than 0, which keeps a x + b y + c z >= d",
                      i));
  }
}

void validate_ray_offset(const RenderSettings& s) {
  if (!s.ray_offset || s.integrator == Integrator::exponential_midpoint || s.integrator == Integrator::euler) return;
  throw UsageError(
      fmt::format("'ray_offset' moves intervals that are sampled in their middle: the integrators exponential_midpoint "
                  "and euler accept it, not {}",
                  integrator_name(s.integrator)));
}

std::string mirror_name(const Mirror& mirror) { return fmt::format("{}{}", mirror.upper ? '+' : '-', "xyz"[mirror.axis]); }

Mirror parse_mirror(std::string_view name) {
  for (const int axis : {0, 1, 2})
    for (const bool upper : {false, true})
      if (name == mirror_name({axis, upper})) return {axis, upper};
  throw UsageError(fmt::format("unknown face '{}'; accepted are -x, +x, -y, +y, -z, +z", name));
}

void validate_mirror(const RenderSettings& s) {
  if (!s.mirror) return;
  if (s.point_light) throw UsageError("'mirror': rays to the lamp of 'point_light' do not see the image; accepted: one of both");
  if (s.draws_surfaces() && s.isosurfaces.ambient_occlusion)
    throw UsageError("'mirror': rays of 'ambient_occlusion' do not see the image; accepted: one of both");
  if (s.level_of_detail)
    throw UsageError("'mirror': 'level_of_detail' knows the sizes of cells and not of their images; accepted: one of both");
}

void validate_fields(const Scene& scene) {
  if (scene.more_fields.empty()) return;
  const RenderSettings& s = scene.settings;
  const auto refuse = [&](std::string_view what) {
    throw UsageError(fmt::format("'transfer_functions' of {} fields: {}", 1 + scene.more_fields.size(), what));
  };
  if (s.mode != Mode::dvr) refuse(fmt::format("the mode {} draws one; accepted: the mode dvr", mode_name(s.mode)));
  if (s.integrator == Integrator::preintegrated || s.integrator == Integrator::tolerance)
    refuse(
        fmt::format("the integrator {} knows light between two values of one field; accepted: exponential_midpoint, euler, left",
                    integrator_name(s.integrator)));
  if (s.point_light) refuse("rays to the lamp of 'point_light' gather the depth of one; accepted: one of both");
  if (s.prune) refuse("'prune' leaves out what is hidden in one and may be seen in another; accepted: one of both");
  const auto check = [&](const TransferFunction& tf, std::string_view field) {
    for (const auto& [curve, points] : {std::pair("extinction", tf.extinction.size()), std::pair("color", tf.color.size())})
      if (points > kMostExactPoints)
        refuse(fmt::format("'{}' of {} has {} points; at most {} are supported", curve, field, points, kMostExactPoints));
  };
  check(scene.transfer_function, "the first");
  for (const FieldTransfer& f : scene.more_fields) {
    validate(f.transfer_function);
    check(f.transfer_function, f.field);
  }
}

void validate_triangles(const RenderSettings& s) {
  if (s.triangles.empty()) return;
  if (s.triangles.size() > kMostTriangleObjects)
    throw UsageError(
        fmt::format("'triangles' has {} objects; at most {} are supported", s.triangles.size(), kMostTriangleObjects));
  for (std::size_t i = 0; i < s.triangles.size(); ++i)
    for (int c = 0; c < 3; ++c)
      if (const double v = s.triangles[i].color[c]; !(v >= 0 && v <= 1))
        throw UsageError(fmt::format("'triangles' object {}: the colour {} must lie in [0, 1]", i, v));
  if (s.draws_surfaces() && s.isosurfaces.output != Output::color)
    throw UsageError(fmt::format("'triangles' are no isosurface: with them the output color is accepted, not {}",
                                 output_name(s.isosurfaces.output)));
}

ClipPlane in_finest_cells(const DomainGeometry& geometry, const ClipPlane& plane) {
  const auto largest = [](const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); };
  const double size = largest(plane.normal);
  const Vec3d spacing = geometry.spacing;
  const double unit = largest(spacing);
  const Vec3d normal = plane.normal / size;
  const Vec3d in_cells = normal * (spacing / unit);
  const double distance = plane.distance / size - glm::dot(normal, geometry.lower);
  const double scale = largest(in_cells);
  return {in_cells / scale, distance / unit / scale};
}

TransferFunction surface_colors(const Scene& scene) {
  TransferFunction map = scene.transfer_function;
  if (!scene.settings.isosurfaces.color.empty()) {
    map.color = scene.settings.isosurfaces.color;
    map.logarithmic = false;
  }
  if (map.color.empty()) map.color = {{0, Vec3d(0.8)}};
  return map;
}

Vec3d surface_color(const Scene& scene, double value) { return surface_colors(scene).color_at(value); }

Sampling parse_sampling(std::string_view name) {
  for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
    if (name == sampling_name(sampling)) return sampling;
  throw UsageError(fmt::format("unknown sampling '{}'; accepted are lattice, adaptive", name));
}

View parse_view(const Json& json) {
  constexpr std::array<const char*, 6> kKeys{"eye", "at", "up", "projection", "fov_y", "height"};
  constexpr std::array<const char*, 2> kProjections{"perspective", "orthographic"};
  check_keys(json, "view", kKeys);
  for (const char* key : {"eye", "at"})
    if (!json.contains(key))
      throw UsageError(fmt::format("view: the key '{}' is missing; it accepts three numbers [x, y, z]", key));
  View view;
  view.eye = vector_of(json["eye"], "view", "eye");
  view.at = vector_of(json["at"], "view", "at");
  if (json.contains("up")) view.up = vector_of(json["up"], "view", "up");
  if (json.contains("projection"))
    view.orthographic = choice(json["projection"], "view", "projection", kProjections) == "orthographic";
  if (view.orthographic != json.contains("height"))
    throw UsageError("view: 'height' (world height of the picture) belongs to the projection 'orthographic' and only there");
  if (view.orthographic && json.contains("fov_y")) throw UsageError("view: 'fov_y' belongs to the projection 'perspective'");
  if (view.orthographic) view.height = number(json["height"], "view", "height");
  if (json.contains("fov_y")) view.fov_y = number(json["fov_y"], "view", "fov_y");
  return view;
}

TransferFunction parse_transfer_function(const Json& json) {
  constexpr std::array<const char*, 4> kKeys{"extinction", "color", "scale", "length_unit"};
  constexpr std::array<const char*, 2> kScales{"linear", "log"};
  constexpr std::array<const char*, 2> kUnits{"longest_edge", "world"};
  constexpr const char* kWhat = "transfer_function";
  check_keys(json, kWhat, kKeys);
  TransferFunction tf;
  for (const Json& point : points_of(json, "extinction")) {
    const auto p = numbers(point, 2, kWhat, "extinction", "points [value, extinction]");
    tf.extinction.push_back({p[0], p[1]});
  }
  for (const Json& point : points_of(json, "color")) {
    const auto p = numbers(point, 4, kWhat, "color", "points [value, r, g, b]");
    tf.color.push_back({p[0], {p[1], p[2], p[3]}});
  }
  if (json.contains("scale")) tf.logarithmic = choice(json["scale"], kWhat, "scale", kScales) == "log";
  if (json.contains("length_unit") && choice(json["length_unit"], kWhat, "length_unit", kUnits) == "world")
    tf.length_unit = TransferFunction::LengthUnit::world;
  validate(tf);
  return tf;
}

Json to_json(const View& view) {
  Json json{{"eye", list(view.eye)}, {"at", list(view.at)}, {"up", list(view.up)}};
  if (view.orthographic) {
    json["projection"] = "orthographic";
    json["height"] = view.height;
  } else {
    json["fov_y"] = view.fov_y;
  }
  return json;
}

Json to_json(const TransferFunction& tf) {
  Json json{{"extinction", Json::array()}, {"color", Json::array()}};
  for (const auto& p : tf.extinction) json["extinction"].push_back(Json::array({p.value, p.extinction}));
  for (const auto& p : tf.color) json["color"].push_back(Json::array({p.value, p.rgb.r, p.rgb.g, p.rgb.b}));
  json["scale"] = tf.logarithmic ? "log" : "linear";
  json["length_unit"] = tf.length_unit == TransferFunction::LengthUnit::world ? "world" : "longest_edge";
  return json;
}

Json to_json(const std::vector<FieldTransfer>& more_fields) {
  Json json = Json::array();
  for (const FieldTransfer& f : more_fields) {
    json.push_back({{"field", f.field}});
    json.back().update(to_json(f.transfer_function));
  }
  return json;
}

}  // namespace amrtex
