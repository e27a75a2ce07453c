#include "renderers/scene/scene.hpp"

#include <fmt/format.h>

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

/// What is wrong with the values of points that a curve joins; nothing where they are right.
template <class Point>
std::string points_problem(const std::vector<Point>& points, bool logarithmic) {
  if (points.empty()) return "has no point; at least one is needed";
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double v = points[k].value;
    if (!std::isfinite(v)) return fmt::format("point {}: the value {} is not finite", k, v);
    if (logarithmic && v <= 0) return fmt::format("point {}: the value {} must be above 0 on a logarithmic scale", k, v);
    if (k > 0 && !(v > points[k - 1].value))
      return fmt::format("point {}: the value {} does not lie above the one before, {}", k, v, points[k - 1].value);
  }
  return "";
}

std::string rgb_problem(const Vec3d& rgb) {
  for (int c = 0; c < 3; ++c)
    if (!(rgb[c] >= 0 && rgb[c] <= 1)) return fmt::format("{} must lie between 0 and 1", rgb[c]);
  return "";
}

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

std::string extinction_problem(const TransferFunction& tf) {
  std::string problem = points_problem(tf.extinction, tf.logarithmic);
  for (std::size_t k = 0; problem.empty() && k < tf.extinction.size(); ++k)
    if (!(tf.extinction[k].extinction >= 0))
      problem = fmt::format("point {}: the extinction {} must not be negative", k, tf.extinction[k].extinction);
  return problem;
}

std::string color_problem(const std::vector<TransferFunction::ColorPoint>& points, bool logarithmic) {
  if (std::string problem = points_problem(points, logarithmic); !problem.empty()) return problem;
  for (std::size_t k = 0; k < points.size(); ++k)
    if (const std::string problem = rgb_problem(points[k].rgb); !problem.empty()) return fmt::format("point {}: {}", k, problem);
  return "";
}

void validate(const TransferFunction& tf) {
  for (const auto& [key, problem] :
       {std::pair("extinction", extinction_problem(tf)), std::pair("color", color_problem(tf.color, tf.logarithmic))})
    if (!problem.empty()) throw Error(fmt::format("transfer function: '{}' {}", key, problem));
}

int RenderSettings::picture_channels() const {
  if (draws_surfaces()) return isosurfaces.output == Output::depth ? 1 : 4;
  return mode == Mode::dvr ? 4 : 1;
}

void require_resolved(const DomainGeometry& geometry, const Scene& scene) {
  constexpr double kSmallest = 1e-150, kLargest = 1e150;  // world; squares are doubles
  constexpr double kFarthest = 0x1p41;                    // finest cells; a double tells 2^-12 of one apart
  const Vec3d size = geometry.size();
  const double longest = std::max({size.x, size.y, size.z});
  if (!(geometry.smallest_edge() >= kSmallest && longest <= kLargest))
    throw UnsupportedError(
        fmt::format("domain: finest cells of {:.3g} in a domain of {:.3g} (longest edge); accepted: from {} to {}",
                    geometry.smallest_edge(), longest, kSmallest, kLargest));
  const Vec3d eye = glm::abs(geometry.in_finest_cells(scene.view.eye));
  if (const double cells = std::max({eye.x, eye.y, eye.z}); cells > kFarthest)
    throw UnsupportedError(
        fmt::format("view: the eye lies {:.3g} finest cells from the domain's lower corner; accepted: at most {:.3g}, "
                    "beyond which doubles do not tell places in a cell apart",
                    cells, kFarthest));
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

}  // namespace amrtex
