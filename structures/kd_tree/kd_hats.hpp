// Leaves of the kD-tree as boxes of hats (filter basis): which of them reach into which.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "kd_partition.hpp"
#include "structures/common/hat_supports.hpp"
#include "structures/common/start_grid.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex::kd {

/// A node of the tree as hat_supports.hpp wants it.
struct HatNode {
  int first_child = 0;
  int leaf = -1;
  int level = 0;   ///< of a leaf's cells
  int widest = 0;  ///< cell below this node, finest cells
  Box box;         ///< finest cells
};

inline std::vector<HatNode> hat_nodes(const AmrHierarchy& h, const Tree& tree) {
  const std::vector<Box> boxes = node_boxes(h, tree);
  std::vector<HatNode> nodes(tree.nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& n = tree.nodes[i];
    nodes[i].first_child = static_cast<int>(n.first_child);
    nodes[i].box = boxes[i];
    if (n.first_child != 0 || n.leaf < 0) continue;
    nodes[i].leaf = n.leaf;
    nodes[i].level = n.level;
    nodes[i].widest = h.cell_width(n.level);
  }
  find_widest(nodes);
  return nodes;
}

/// As the shader knows a leaf: kd_tree_layout.h.
inline std::uint32_t hat_code(const HatNode& n) {
  return 1 + (static_cast<std::uint32_t>(n.leaf) | static_cast<std::uint32_t>(n.level) << AMRTEX_KD_DATA_BITS);
}

/// Calls f(cells' leaf, cells) for the cells of every leaf whose hats reach into a leaf, its own included.
template <class F>
void for_each_hat(const AmrHierarchy& h, const Tree& tree, const std::vector<HatNode>& nodes, const Leaf& leaf, F&& f) {
  const Box box = leaf.cells.refined(h.cell_width(leaf.level));
  for_each_reaching(nodes, box, [&](const HatNode& n) {
    f(n.leaf, intersection(tree.leaves[static_cast<std::size_t>(n.leaf)].cells, reaching_cells(box, n.widest)));
  });
}

/// Adds the values of all cells of other leaves whose hats reach into one.
inline void add_reaching_values(const AmrHierarchy& h, int field, const Tree& tree, const std::vector<HatNode>& nodes, int leaf,
                                ValueRange& range) {
  std::vector<double> values;
  for_each_hat(h, tree, nodes, tree.leaves[static_cast<std::size_t>(leaf)], [&](int other, const Box& cells) {
    if (other == leaf) return;
    values.resize(static_cast<std::size_t>(cells.cells()));
    level_values(h, field, tree.leaves[static_cast<std::size_t>(other)].level, cells, values);
    for (const double v : values) range.add(v);
  });
}

/// A region's floats tell places to 2^-25 of its extent: enough while that is at most so many of the finest cells that reach in.
inline constexpr std::int64_t kMostReachingCells = 2048;

/// Finer hats begin inside of a leaf, in a layer of half of their cell, and regions are not cut there: an adaptive step of the
/// leaf's own cell width must not pass over more than so many of these cells.
inline constexpr int kMostCellsInAStep = 64;

/// Throws UnsupportedError where a leaf is wider than that, or its cells are.
inline void require_places(const AmrHierarchy& h, const Tree& tree, const std::vector<HatNode>& nodes) {
  for (const Leaf& leaf : tree.leaves) {
    int finest = leaf.level;
    for_each_hat(h, tree, nodes, leaf,
                 [&](int other, const Box&) { finest = std::max(finest, tree.leaves[static_cast<std::size_t>(other)].level); });
    if (finest == leaf.level) continue;  // as under the other filters
    const Vec3i size = leaf.cells.size();
    const std::int64_t extent =
        std::max({size.x, size.y, size.z}) * std::int64_t{h.cell_width(leaf.level)} / h.cell_width(finest);
    if (extent > kMostReachingCells)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: filter basis: a leaf of level {} is {} of the cells of level {} wide whose hats reach "
                      "into it; accepted: "
                      "at most {}, beyond which floats place samples badly; exabricks cuts its regions there",
                      leaf.level, extent, finest, kMostReachingCells));
    if (const int ratio = h.cell_width(leaf.level) / h.cell_width(finest); ratio > kMostCellsInAStep)
      throw UnsupportedError(fmt::format(
          "encoding kd_tree: filter basis: hats of level {} reach into a leaf of level {} whose cells are {} times as wide; "
          "accepted: at most {} times, beyond which steps of the leaf pass over them; exabricks cuts its regions there",
          finest, leaf.level, ratio, kMostCellsInAStep));
  }
}

/// Of leaves that show nothing, keeps the mark of those whose hats reach into such leaves alone: others read the rest.
inline void keep_read_leaves(const AmrHierarchy& h, const Tree& tree, const std::vector<HatNode>& nodes,
                             std::vector<std::uint8_t>& hides) {
  std::vector<std::uint8_t> unread = hides;
  for (std::size_t i = 0; i < hides.size(); ++i)
    if (hides[i] == 0)
      for_each_hat(h, tree, nodes, tree.leaves[i], [&](int other, const Box&) { unread[static_cast<std::size_t>(other)] = 0; });
  hides = std::move(unread);
}

}  // namespace amrtex::kd
