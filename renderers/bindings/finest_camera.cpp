#include "renderers/bindings/finest_camera.hpp"

#include <algorithm>

namespace amrtex {
namespace {

/// Beyond this many cells a float cannot hold a position on the lattice (2^-13 of a cell);
/// then rays are held in double and positions are rounded once more in each region.
constexpr int kFloatRayCells = 2048;

std::vector<double> numbers(const Vec3d& v) { return {v.x, v.y, v.z}; }

}  // namespace

FinestCamera finest_camera(const DomainGeometry& geometry, const Scene& scene) {
  const CameraFrame frame = camera_frame(scene.view, scene.settings.width, scene.settings.height);
  const double unit = geometry.smallest_edge();
  const double to_units = frame.orthographic ? 1 / unit : 1;
  FinestCamera camera;
  camera.eye = geometry.in_finest_cells(frame.eye);
  camera.forward = frame.forward;
  camera.right = frame.right * to_units;
  camera.up = frame.up * to_units;
  camera.cells_per_unit = Vec3d(unit) / geometry.spacing;
  camera.upper = Vec3d(geometry.cells);
  camera.orthographic = frame.orthographic;
  if (scene.region) {
    camera.lower = glm::max(camera.lower, geometry.in_finest_cells((*scene.region)[0]));
    camera.upper = glm::max(camera.lower, glm::min(camera.upper, geometry.in_finest_cells((*scene.region)[1])));
  }
  return camera;
}

bool needs_double_rays(const DomainGeometry& geometry, const Scene& scene) {
  const Vec3i n = geometry.cells;
  const double distance = glm::length(scene.view.eye - geometry.middle());
  const bool narrow = !scene.view.orthographic && scene.view.fov_y < 1;
  return std::max({n.x, n.y, n.z}) > kFloatRayCells || distance > 16 * glm::length(geometry.size()) || narrow;
}

void add_camera(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  const FinestCamera camera = finest_camera(geometry, scene);
  b.set_ray("u_eye", numbers(camera.eye));
  b.set_ray("u_forward", numbers(camera.forward));
  b.set_ray("u_right", numbers(camera.right));
  b.set_ray("u_up", numbers(camera.up));
  b.set("u_orthographic", camera.orthographic ? 1 : 0);
  b.set_ray("u_cells_per_unit", numbers(camera.cells_per_unit));
  b.set_ray("u_draw_lower", numbers(camera.lower));
  b.set_ray("u_draw_upper", numbers(camera.upper));
  b.set("u_picture_size", {static_cast<double>(s.width), static_cast<double>(s.height)});
}

/// A cell w finest cells wide is smaller than the threshold where w * diagonal * pixels < threshold * distance; `pixels` are
/// those of one world unit at distance 1, or at any one.
void add_detail(const DomainGeometry& geometry, const Scene& scene, SceneBindings& b) {
  const RenderSettings& s = scene.settings;
  const CameraFrame camera = camera_frame(scene.view, s.width, s.height);
  const double unit = geometry.smallest_edge();
  const double diagonal = unit * glm::length(geometry.spacing / unit);
  const double pixels = s.height / 2.0 / glm::length(camera.up);
  const double threshold = s.level_of_detail.value_or(0);
  constexpr double kMost = 1e18;  // its square is a float
  Vec3d scale(0);
  double far = 0;
  if (camera.orthographic)
    far = std::min(threshold / (diagonal * pixels), kMost);
  else
    scale = glm::min(geometry.spacing / diagonal * (threshold / pixels), Vec3d(kMost));
  b.set("u_detail_level", std::min(s.max_level.value_or(geometry.finest_level()), geometry.finest_level()));
  b.set("u_detail_eye", numbers(geometry.in_finest_cells(camera.eye)));
  b.set("u_detail_scale", numbers(scale));
  b.set("u_detail_far", far * far);
}

}  // namespace amrtex
