#include "bench/figure/overlay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <tuple>

#include "renderers/cpu/structure_view.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Told apart by people who see few colours, on light and on dark pictures.
constexpr std::array<std::string_view, 8> kLevelColors = {"#8d96a5", "#e69f00", "#d1432b", "#0072b2",
                                                          "#009e73", "#cc79a7", "#56b4e9", "#f0e442"};
constexpr double kRayWidth = 0.15;      ///< mm, and
constexpr double kSampleWidth = 1.0;    ///< of a dot
constexpr double kHiddenWidth = 0.5;    ///< of an edge behind its own box, of the line's
constexpr double kHiddenOpacity = 0.4;  ///< likewise

std::vector<LevelBox> node_boxes(const AmrHierarchy& mesh, const EncodedField& field) {
  if (field.draw_tree.empty())
    throw UnsupportedError(fmt::format(
        "nodes: encoding {} has no tree of boxes; accepted: page_table, kd_tree, or the overlay regions", field.encoding));
  std::vector<LevelBox> boxes;
  const std::function<void(int, const Box&, int)> visit = [&](int index, const Box& box, int depth) {
    boxes.push_back({box, depth});
    const DrawNode& node = field.draw_tree.nodes[static_cast<std::size_t>(index)];
    if (node.axis < 0) return;
    Box lower = box, upper = box;
    lower.upper[node.axis] = upper.lower[node.axis] = node.plane;
    visit(node.first_child, lower, depth + 1);
    visit(node.first_child + 1, upper, depth + 1);
  };
  visit(0, mesh.domain(mesh.finest_level()), 0);
  return boxes;
}

std::vector<LevelBox> cell_boxes(const AmrHierarchy& mesh) {
  std::vector<LevelBox> boxes;
  for (int l = 0; l < mesh.level_count(); ++l)
    for (std::size_t p = 0; p < mesh.patches(l).size(); ++p) {
      const Box& patch = mesh.patches(l)[p].box;
      const auto leaf = mesh.leaf_mask(l, static_cast<int>(p));
      for_each_cell(patch, [&](const Vec3i& cell) {
        if (leaf[patch.offset(cell)] != 0) boxes.push_back({Box{cell, cell + Vec3i(1)}.refined(mesh.cell_width(l)), l});
      });
    }
  return boxes;
}

/// Those of the levels that are drawn, coarse ones first.
std::vector<LevelBox> chosen(std::vector<LevelBox> boxes, const OverlaySpec& overlay) {
  const auto& levels = overlay.levels;
  if (!levels.empty())
    std::erase_if(boxes, [&](const LevelBox& b) { return std::find(levels.begin(), levels.end(), b.level) == levels.end(); });
  if (boxes.size() > kMostOverlayBoxes)
    throw UsageError(fmt::format("overlay {}: {} boxes; drawn are at most {}; accepted: fewer 'levels', or a slice",
                                 overlay.boxes, boxes.size(), kMostOverlayBoxes));
  std::stable_sort(boxes.begin(), boxes.end(), [](const LevelBox& a, const LevelBox& b) { return a.level < b.level; });
  return boxes;
}

/// World -> parts of the picture.
class Projection {
 public:
  explicit Projection(const Scene& scene) : camera_(camera_frame(scene.view, scene.settings.width, scene.settings.height)) {}

  const Vec3d& eye() const { return camera_.eye; }
  double distance(const Vec3d& p) const {
    return camera_.orthographic ? glm::dot(p - camera_.eye, camera_.forward) : glm::length(p - camera_.eye);
  }
  /// Does a face with this normal look at the eye?
  bool faces(const Vec3d& normal, const Vec3d& on_face) const {
    return glm::dot(normal, camera_.orthographic ? camera_.forward : on_face - camera_.eye) < 0;
  }
  /// The part of a line in front of the eye; nothing where there is none.
  std::optional<std::array<Point, 2>> line(Vec3d a, Vec3d b) const {
    if (!camera_.orthographic) {
      const double depth_a = depth(a), depth_b = depth(b),
                   least = 1e-6 * std::max({std::abs(depth_a), std::abs(depth_b), 1e-300});
      if (depth_a < least && depth_b < least) return std::nullopt;
      const Vec3d from = a, way = b - a;
      if (depth_a < least) a = from + way * ((least - depth_a) / (depth_b - depth_a));
      if (depth_b < least) b = from + way * ((least - depth_a) / (depth_b - depth_a));
    }
    return std::array{place(a), place(b)};
  }

 private:
  double depth(const Vec3d& p) const { return glm::dot(p - camera_.eye, camera_.forward); }
  Point place(const Vec3d& p) const {
    const Vec3d way = p - camera_.eye;
    const double scale = camera_.orthographic ? 1 : depth(p);
    const double u = glm::dot(way, camera_.right) / glm::dot(camera_.right, camera_.right) / scale;
    const double v = glm::dot(way, camera_.up) / glm::dot(camera_.up, camera_.up) / scale;
    return {(u + 1) / 2, (1 - v) / 2};
  }

  CameraFrame camera_;
};

bool meets_picture(const std::array<Point, 2>& line) {
  const auto apart = [](double a, double b) { return (a < 0 && b < 0) || (a > 1 && b > 1); };
  return !apart(line[0].x, line[1].x) && !apart(line[0].y, line[1].y);
}

/// `place`: a line's ends in parts of the picture, where it can be seen.
template <class Place>
std::vector<Line> ray_lines(const RayPlaces& ray, const RaySpec& spec, Place&& place) {
  std::vector<Line> lines;
  if (const auto line = place(ray.from, ray.to))
    lines.push_back({{(*line)[0], (*line)[1]}, false, {0.1, 0.1, 0.1, 1}, kRayWidth});
  for (const Vec3d& sample : ray.samples)
    if (const auto dot = place(sample, sample))
      for (const auto& [ink, width] : {std::pair{Ink{1, 1, 1, 1}, kSampleWidth + kRayWidth}, {ink_of(spec.color), kSampleWidth}})
        lines.push_back({{(*dot)[0]}, false, ink, width});
  return lines;
}

/// Edges of boxes, each once a level.
class EdgeList {
 public:
  EdgeList(const DomainGeometry& geometry, const Projection& projection, const OverlaySpec& overlay)
      : geometry_(geometry), projection_(projection), overlay_(overlay) {}

  void add(const LevelBox& box) {
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 4; ++side) {
        const int first = (axis + 1) % 3, second = (axis + 2) % 3;
        const std::array<bool, 2> upper = {(side & 1) != 0, (side & 2) != 0};
        Vec3i a = box.cells.lower;
        a[first] = (upper[0] ? box.cells.upper : box.cells.lower)[first];
        a[second] = (upper[1] ? box.cells.upper : box.cells.lower)[second];
        Vec3i b = a;
        b[axis] = box.cells.upper[axis];
        add(a, b, box.level, seen(a, first, upper[0]) || seen(a, second, upper[1]));
      }
  }
  /// Hidden ones behind all others.
  std::vector<Line> lines() {
    std::vector<Line> all = std::move(hidden_);
    all.insert(all.end(), front_.begin(), front_.end());
    return all;
  }

 private:
  bool seen(const Vec3i& on_face, int axis, bool upper) const {
    Vec3d normal(0);
    normal[axis] = upper ? 1 : -1;
    return projection_.faces(normal, world(on_face));
  }
  Vec3d world(const Vec3i& corner) const { return geometry_.lower + Vec3d(corner) * geometry_.spacing; }
  void add(const Vec3i& a, const Vec3i& b, int level, bool front) {
    if (!there_.emplace(a.x, a.y, a.z, b.x, b.y, b.z, level, front).second) return;
    const auto line = projection_.line(world(a), world(b));
    if (!line || !meets_picture(*line)) return;
    Ink ink = level_ink(overlay_, level);
    if (!front) ink.opacity *= kHiddenOpacity;
    (front ? front_ : hidden_).push_back({{(*line)[0], (*line)[1]}, false, ink, overlay_.line * (front ? 1 : kHiddenWidth)});
  }

  const DomainGeometry& geometry_;
  const Projection& projection_;
  const OverlaySpec& overlay_;
  std::set<std::tuple<int, int, int, int, int, int, int, bool>> there_;
  std::vector<Line> front_, hidden_;
};

}  // namespace

std::vector<LevelBox> mesh_boxes(const AmrHierarchy& mesh, std::string_view kind) {
  if (kind == "domain") return {{mesh.domain(mesh.finest_level()), 0}};
  if (kind == "cells") return cell_boxes(mesh);
  std::vector<LevelBox> boxes;
  for (int l = 0; l < mesh.level_count(); ++l)
    for (const Patch& p : mesh.patches(l)) boxes.push_back({p.box.refined(mesh.cell_width(l)), l});
  return boxes;
}

std::vector<LevelBox> structure_boxes(const AmrHierarchy& mesh, const EncodedField& field, std::string_view kind) {
  if (kind == "nodes") return node_boxes(mesh, field);
  std::vector<LevelBox> boxes;
  for (const FieldRegion& r : list_regions(mesh, field))
    if (r.holds_mesh) boxes.push_back({r.cells, r.level});
  return boxes;
}

std::array<int, 2> slice_axes(int axis) { return axis == 0 ? std::array{1, 2} : axis == 1 ? std::array{0, 2} : std::array{0, 1}; }

int cut_layer(const AmrHierarchy& mesh, const CutPlane& plane) {
  const DomainGeometry geometry(mesh);
  const double lower = geometry.lower[plane.axis], upper = geometry.upper[plane.axis];
  if (!(plane.at >= lower && plane.at <= upper))
    throw UsageError(fmt::format("a slice at {} = {:.6g} misses the domain; accepted: {:.6g} to {:.6g}", "xyz"[plane.axis],
                                 plane.at, lower, upper));
  const double layer = std::floor((plane.at - lower) / geometry.spacing[plane.axis]);
  return static_cast<int>(std::clamp(layer, 0.0, geometry.cells[plane.axis] - 1.0));
}

Ink level_ink(const OverlaySpec& overlay, int level) {
  const auto index = static_cast<std::size_t>(std::max(level, 0));
  Ink ink = overlay.colors.empty() ? ink_of(kLevelColors[index % kLevelColors.size()])
                                   : ink_of(overlay.colors[index % overlay.colors.size()]);
  ink.opacity = overlay.opacity;
  return ink;
}

std::vector<Line> seen_boxes(const DomainGeometry& geometry, const std::vector<LevelBox>& boxes, const Scene& scene,
                             const OverlaySpec& overlay) {
  const Projection projection(scene);
  std::vector<LevelBox> drawn = chosen(boxes, overlay);
  const auto distance = [&](const LevelBox& b) {
    return projection.distance(geometry.lower + Vec3d(b.cells.lower + b.cells.upper) * 0.5 * geometry.spacing);
  };
  std::stable_sort(drawn.begin(), drawn.end(), [&](const LevelBox& a, const LevelBox& b) { return distance(a) > distance(b); });
  EdgeList edges(geometry, projection, overlay);
  for (const LevelBox& box : drawn) edges.add(box);
  return edges.lines();
}

std::vector<LevelBox> boxes_in_layer(std::vector<LevelBox> boxes, int axis, int layer) {
  std::erase_if(boxes, [&](const LevelBox& b) { return layer < b.cells.lower[axis] || layer >= b.cells.upper[axis]; });
  return boxes;
}

std::vector<Line> cut_boxes(const DomainGeometry& geometry, const std::vector<LevelBox>& boxes, int axis,
                            const OverlaySpec& overlay) {
  const auto [right, up] = slice_axes(axis);
  const double width = geometry.cells[right], height = geometry.cells[up];
  std::vector<Line> lines;
  for (const LevelBox& b : chosen(boxes, overlay)) {
    const double x0 = b.cells.lower[right] / width, x1 = b.cells.upper[right] / width;
    const double y0 = 1 - b.cells.upper[up] / height, y1 = 1 - b.cells.lower[up] / height;
    lines.push_back({{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}, true, level_ink(overlay, b.level), overlay.line});
  }
  return lines;
}

std::vector<Line> seen_ray(const RayPlaces& ray, const Scene& scene, const RaySpec& spec) {
  const Projection projection(scene);
  return ray_lines(ray, spec, [&](const Vec3d& a, const Vec3d& b) { return projection.line(a, b); });
}

std::vector<Line> cut_ray(const DomainGeometry& geometry, const RayPlaces& ray, const CutPlane& plane, const RaySpec& spec) {
  const std::array<int, 2> axes = slice_axes(plane.axis);
  const auto place = [&](const Vec3d& p) {
    const Vec3d part = (p - geometry.lower) / geometry.size();
    return Point{part[axes[0]], 1 - part[axes[1]]};
  };
  return ray_lines(ray, spec, [&](const Vec3d& a, const Vec3d& b) { return std::optional(std::array{place(a), place(b)}); });
}

}  // namespace amrtex
