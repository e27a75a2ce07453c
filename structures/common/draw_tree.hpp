// Boxes of a built field that can be drawn one by one, and the planes that tell in which order they are seen.
#pragma once

#include <cstdint>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// Part of the domain in which one locate() stays valid: all of it lies in the region that locate() gives at its lower cell.
struct DrawBox {
  Box cells;  ///< finest cells, not empty
  int level = 0;
};

/// An axis-aligned plane, or a leaf.
struct DrawNode {
  int axis = -1;        ///< 0 to 2; -1: a leaf
  int plane = 0;        ///< finest cells: the first child lies below it, the next one above
  int first_child = 0;  ///< its children stand side by side, after it
  int box = -1;         ///< of a leaf, index in DrawTree::boxes; -1: nothing is drawn there
};

/// A binary space partition, so that an order exists for every eye: no box is both before and behind another.
/// Built where SceneNeeds::draw_boxes asks for it; on the host alone, no part of what the GPU holds.
struct DrawTree {
  std::vector<DrawNode> nodes;  ///< the root first; none: the field gives no boxes
  std::vector<DrawBox> boxes;

  bool empty() const { return nodes.empty(); }
  std::int64_t bytes() const {
    return static_cast<std::int64_t>(nodes.size() * sizeof(DrawNode) + boxes.size() * sizeof(DrawBox));
  }
  /// Makes the leaf `node` draw a box.
  void set_box(std::size_t node, const Box& cells, int level);
  /// Divides the leaf `node`; returns the lower child's index.
  std::size_t split(std::size_t node, int axis, int plane);
};

/// From where boxes are seen.
struct Viewpoint {
  bool parallel = false;
  Vec3d eye{0};        ///< finest cells; where rays start from one point
  Vec3d direction{0};  ///< of parallel rays, any length
};

/// Indices of all boxes: where a ray meets two of them, the one that it meets first stands first.
std::vector<int> front_to_back(const DrawTree& tree, const Viewpoint& viewpoint);

}  // namespace amrtex
