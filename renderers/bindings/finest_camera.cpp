#include "renderers/bindings/finest_camera.hpp"

#include <algorithm>

namespace amrtex {
namespace {

/// Beyond this many smallest edges a float cannot hold a position on the lattice (2^-13 of a cell);
/// then rays are held in double and positions are rounded once more in each region.
constexpr int kFloatRayEdges = 2048;
/// Where a ray goes so many times as far as what it meets is thin, floats would put its ends off by 2^-18 of that.
constexpr double kFloatDepth = 64;

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
  const double edge = geometry.smallest_edge();  // all below in edges: no square of a world length is asked for
  const Vec3d size = Vec3d(geometry.cells) * (geometry.spacing / edge);
  const double diagonal = glm::length(geometry.size() / edge);
  const double distance = glm::length((scene.view.eye - geometry.middle()) / edge);
  const FinestCamera camera = finest_camera(geometry, scene);
  const Vec3d drawn = (camera.upper - camera.lower) * (geometry.spacing / edge);
  const bool thin = distance + diagonal > kFloatDepth * std::min({drawn.x, drawn.y, drawn.z});
  const bool wide = scene.view.orthographic && scene.view.height / edge > kFloatDepth * diagonal;
  const bool narrow = !scene.view.orthographic && scene.view.fov_y < 1;
  return std::max({size.x, size.y, size.z}) > kFloatRayEdges * (1 + 1e-6) || distance > 16 * diagonal || thin || wide || narrow;
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
