// Boxes of a mesh or a structure as lines over a picture of it.
#pragma once

#include <vector>

#include "bench/figure/drawing.hpp"
#include "bench/settings/figure_settings.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

struct LevelBox {
  Box cells;  ///< finest cells
  int level = 0;
};

/// Beyond, lines would be a grey area.
inline constexpr std::size_t kMostOverlayBoxes = 50'000;

/// Patches of the mesh, its leaf cells, or its domain.
std::vector<LevelBox> mesh_boxes(const AmrHierarchy& mesh, std::string_view kind);
/// Of a structure: its regions that hold mesh, or, with their depth for a level, the nodes of the binary tree by which it is
/// drawn box by box. Throws UnsupportedError naming the encoding where it has none.
std::vector<LevelBox> structure_boxes(const AmrHierarchy& mesh, const EncodedField& field, std::string_view kind);

/// A plane across an axis.
struct CutPlane {
  int axis = 2;
  double at = 0;  ///< world
};
/// The two axes of a slice: to the right and upwards.
std::array<int, 2> slice_axes(int axis);
/// The index of the finest cells that a plane cuts.
int cut_layer(const AmrHierarchy& mesh, const CutPlane& plane);

/// Those that the layer cuts.
std::vector<LevelBox> boxes_in_layer(std::vector<LevelBox> boxes, int axis, int layer);

/// The colour of a level.
Ink level_ink(const OverlaySpec& overlay, int level);

/// Lines in parts of a picture's width and height. Throws UsageError where there are too many boxes.
/// As the scene's camera sees them: edges that lie behind their own box first, and thin; then the others, far boxes first.
std::vector<Line> seen_boxes(const DomainGeometry& geometry, const std::vector<LevelBox>& boxes, const Scene& scene,
                             const OverlaySpec& overlay);
/// Boxes of one layer across an axis, as exact rectangles, coarse ones first.
std::vector<Line> cut_boxes(const DomainGeometry& geometry, const std::vector<LevelBox>& boxes, int axis,
                            const OverlaySpec& overlay);

/// Places of a ray, world.
struct RayPlaces {
  Vec3d from, to;
  std::vector<Vec3d> samples;
};
/// A line along it and a dot at each sample.
std::vector<Line> seen_ray(const RayPlaces& ray, const Scene& scene, const RaySpec& spec);
/// As its shadow on a plane.
std::vector<Line> cut_ray(const DomainGeometry& geometry, const RayPlaces& ray, const CutPlane& plane, const RaySpec& spec);

}  // namespace amrtex
