#include "renderers/consumers/screen_polygons.hpp"

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

/// Boxes grow by this part of a pixel: the rasteriser's grid has at least 1/16 of this ...
constexpr double kPixelMargin = 1.0 / 16;
/// ... and by this part of a finest cell: positions of samples are rounded to 2^-12 of one.
constexpr double kCellMargin = 1.0 / 256;
/// Units: what lies nearer to the eye is not projected.
constexpr double kNear = 1e-3;

/// Pairs of corners that differ in one bit: the edges of a box.
constexpr std::array<std::array<std::size_t, 2>, 12> kEdges{
    {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};

double cross(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Corners of the convex hull, anticlockwise (Andrew's monotone chain).
void make_hull(ScreenPolygon& points) {
  std::sort(points.begin(), points.end(),
            [](const glm::dvec2& a, const glm::dvec2& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points.clear();
  ScreenPolygon hull;
  const auto add = [&](const glm::dvec2& p, std::size_t least) {
    while (hull.size() >= least + 2 && cross(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
    hull.push_back(p);
  };
  for (const glm::dvec2& p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], lower);
  hull.pop_back();  // the first point again
  points = std::move(hull);
}

/// Keeps what lies at sign * coordinate <= bound.
void cut(ScreenPolygon& polygon, int axis, double sign, double bound) {
  const auto beyond = [&](const glm::dvec2& p) { return sign * p[axis] - bound; };
  if (std::none_of(polygon.begin(), polygon.end(), [&](const glm::dvec2& p) { return beyond(p) > 0; })) return;
  ScreenPolygon kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec2& a = polygon[i];
    const glm::dvec2& b = polygon[(i + 1) % polygon.size()];
    const double from = beyond(a);
    const double to = beyond(b);
    if (from <= 0) kept.push_back(a);
    if ((from < 0 && to > 0) || (from > 0 && to < 0)) kept.push_back(a + (b - a) * (from / (from - to)));
  }
  polygon = std::move(kept);
}

}  // namespace

ScreenPolygons::ScreenPolygons(const FinestCamera& camera, int width, int height)
    : camera_(camera),
      pixel_(2 * std::max(glm::length(camera.right) / width, glm::length(camera.up) / height)),
      edge_(1 + 2.0 / width, 1 + 2.0 / height) {}

ScreenPolygons::Part ScreenPolygons::drawn_part(const Box& cells) const {
  return {glm::max(Vec3d(cells.lower), camera_.lower), glm::min(Vec3d(cells.upper), camera_.upper)};
}

ScreenPolygons::Part ScreenPolygons::grown(const Part& part, double depth) const {
  const double pixel = pixel_ * (camera_.orthographic ? 1 : std::max(depth, kNear));
  const Vec3d margin = glm::max(Vec3d(kCellMargin), camera_.cells_per_unit * (pixel * kPixelMargin));
  return {part.lower - margin, part.upper + margin};
}

ScreenPolygons::Corners ScreenPolygons::corners(const Part& part) const {
  Corners corners;
  const Vec3d right = camera_.right / glm::dot(camera_.right, camera_.right);
  const Vec3d up = camera_.up / glm::dot(camera_.up, camera_.up);
  for (std::size_t i = 0; i < 8; ++i) {
    const Vec3d p((i & 1) != 0 ? part.upper.x : part.lower.x, (i & 2) != 0 ? part.upper.y : part.lower.y,
                  (i & 4) != 0 ? part.upper.z : part.lower.z);
    const Vec3d from_eye = (p - camera_.eye) / camera_.cells_per_unit;
    corners[i] = {glm::dot(from_eye, right), glm::dot(from_eye, up), glm::dot(from_eye, camera_.forward)};
  }
  return corners;
}

glm::dvec2 ScreenPolygons::on_screen(const Vec3d& corner) const {
  return glm::dvec2(corner) / (camera_.orthographic ? 1.0 : corner.z);
}

std::array<double, 2> ScreenPolygons::depths(const Box& cells) const {
  const Part part = drawn_part(cells);
  if (part.empty()) return {1, -1};
  const Corners all = corners(part);
  const auto [nearest, farthest] =
      std::minmax_element(all.begin(), all.end(), [](const Vec3d& a, const Vec3d& b) { return a.z < b.z; });
  return {nearest->z, farthest->z};
}

void ScreenPolygons::finish(ScreenPolygon& points) const {
  make_hull(points);
  for (int axis = 0; axis < 2; ++axis)
    for (const double sign : {1.0, -1.0}) cut(points, axis, sign, edge_[axis]);
}

void ScreenPolygons::cover_box(const Box& cells, ScreenPolygon& polygon) const {
  polygon.clear();
  const double farthest = depths(cells)[1];
  if (!(farthest >= 0)) return;
  const Part part = grown(drawn_part(cells), farthest);
  const Corners all = corners(part);
  if (!camera_.orthographic) {
    // near the eye no projection is needed: the box may be anywhere on screen
    const Vec3d reach = camera_.cells_per_unit * (kNear * (1 + glm::length(camera_.right) + glm::length(camera_.up)));
    if (glm::all(glm::greaterThanEqual(camera_.eye, part.lower - reach)) &&
        glm::all(glm::lessThanEqual(camera_.eye, part.upper + reach))) {
      polygon = {-edge_, {edge_.x, -edge_.y}, edge_, {-edge_.x, edge_.y}};
      return;
    }
  }
  const double near = camera_.orthographic ? -std::numeric_limits<double>::infinity() : kNear;
  for (const Vec3d& c : all)
    if (c.z >= near) polygon.push_back(on_screen(c));
  for (const auto& [a, b] : kEdges)
    if ((all[a].z < near) != (all[b].z < near))
      polygon.push_back(on_screen(glm::mix(all[a], all[b], (near - all[a].z) / (all[b].z - all[a].z))));
  finish(polygon);
}

void ScreenPolygons::cover_slice(const Box& cells, double depth, ScreenPolygon& polygon) const {
  polygon.clear();
  const Part part = drawn_part(cells);
  if (part.empty()) return;
  const Corners all = corners(grown(part, depth));
  for (const auto& [a, b] : kEdges) {
    const double from = all[a].z - depth;
    const double to = all[b].z - depth;
    if ((from < 0) != (to < 0)) {
      Vec3d at = glm::mix(all[a], all[b], from / (from - to));
      at.z = depth;
      polygon.push_back(on_screen(at));
    }
  }
  finish(polygon);
}

}  // namespace amrtex
