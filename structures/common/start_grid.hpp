// A dense grid over the domain: each cell knows the deepest node of a tree that holds it, so that descents are short.
//
// A tree has `nodes`, a node its `first_child` (0: a leaf; the second child is the next node; both stand after it) and `axis`.
// What else is asked of a node two functions beside its type tell:
//
//   int plane_of(const AmrHierarchy&, const Node&, const Box&)   where its plane lies, finest cells; the box is the node's
//   bool is_drawn(const Node&)                                   may it be drawn itself? Then no grid starts below it
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "structures/common/build_tools.hpp"

namespace amrtex {

/// Boxes of all nodes, in finest cells, from the root's down.
template <class Tree>
std::vector<Box> node_boxes(const AmrHierarchy& h, const Tree& tree) {
  std::vector<Box> boxes(tree.nodes.size());
  boxes[0] = h.domain(h.finest_level());
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const auto& n = tree.nodes[i];
    if (n.first_child == 0) continue;
    const auto child = static_cast<std::size_t>(n.first_child);
    boxes[child] = boxes[child + 1] = boxes[i];
    boxes[child].upper[n.axis] = boxes[child + 1].lower[n.axis] = plane_of(h, n, boxes[i]);
  }
  return boxes;
}

/// Splits from each node to the deepest leaf below it.
template <class Tree>
std::vector<int> node_heights(const Tree& tree) {
  std::vector<int> heights(tree.nodes.size());
  for (std::size_t i = tree.nodes.size(); i-- > 0;) {
    const auto child = static_cast<std::size_t>(tree.nodes[i].first_child);
    if (child != 0) heights[i] = 1 + std::max(heights[child], heights[child + 1]);
  }
  return heights;
}

struct StartGrid {
  int width = 0;  ///< of a cell, finest cells; 0: there is no grid
  Vec3i cells{0};
  std::vector<std::uint32_t> entries;  ///< a cell: index in `nodes`
  std::vector<std::uint32_t> nodes;    ///< of the tree, each once
  int depth = 0;                       ///< splits from where a descent starts to the deepest leaf
  std::int64_t leaf_cells = 0;         ///< cells of the grid that lie in one leaf: no descent at all
  std::int64_t bytes() const {
    return 4 * static_cast<std::int64_t>(entries.size()) + 32 * static_cast<std::int64_t>(nodes.size());
  }

  Part entries_part(std::string name) const {
    return buffer_part(std::move(name), "entries of the start grid", TexelFormat::r32ui,
                       static_cast<std::int64_t>(entries.size()));
  }
  /// Two times four words a node: write_box() of its box, with its index and its coded range.
  Part nodes_part(std::string name) const {
    return buffer_part(std::move(name), "nodes of the start grid", TexelFormat::rgba32ui,
                       2 * static_cast<std::int64_t>(nodes.size()));
  }
  /// `range_of(node)`: its coded range; 0 where nobody asks for it.
  template <class RangeOf>
  void write(const std::vector<Box>& boxes, RangeOf&& range_of, HostTexture& entry_buffer, HostTexture& node_buffer) const {
    std::copy(entries.begin(), entries.end(), entry_buffer.as<std::uint32_t>());
    auto* words = node_buffer.as<std::uint32_t>();
    for (const std::uint32_t node : nodes) {
      write_box(boxes[node], node, range_of(node), words);
      words += 8;
    }
  }
};

/// Widths that a grid may have, the widest first: those of each level's cells and their doubles up to the next coarser level's.
inline std::vector<int> grid_widths(const AmrHierarchy& h) {
  const Vec3i n = h.cells(h.finest_level());
  const std::int64_t domain = std::max({n.x, n.y, n.z});
  std::vector<int> widths;
  for (int l = 0; l < h.level_count(); ++l) {
    const std::int64_t coarser = l > 0 ? h.cell_width(l - 1) : std::min<std::int64_t>(2 * domain, std::int64_t{1} << 30);
    for (std::int64_t w = h.cell_width(l); w < coarser; w *= 2) widths.push_back(static_cast<int>(w));
  }
  std::sort(widths.rbegin(), widths.rend());
  return widths;
}

/// Whole cells of a grid that lie in a box.
inline std::int64_t whole_cells(const Box& box, int width) {
  std::int64_t count = 1;
  for (int a = 0; a < 3; ++a) count *= std::max(box.upper[a] / width - ceil_div(box.lower[a], width), 0);
  return count;
}

/// The widest grid of which nearly all cells lie in one leaf, or the finest of at most `most_cells` cells.
template <class Tree>
int choose_width(const AmrHierarchy& h, const Tree& tree, const std::vector<Box>& boxes, std::int64_t most_cells) {
  const Vec3i domain = h.cells(h.finest_level());
  int chosen = 0;
  for (const int w : grid_widths(h)) {
    const double cells = (domain.x / w + 1.0) * (domain.y / w + 1.0) * (domain.z / w + 1.0);
    if (chosen > 0 && cells > static_cast<double>(most_cells)) break;
    chosen = w;
    std::int64_t in_leaves = 0;
    for (std::size_t i = 0; i < boxes.size(); ++i)
      if (tree.nodes[i].first_child == 0) in_leaves += whole_cells(boxes[i], w);
    if (static_cast<double>(in_leaves) > 0.97 * static_cast<double>(whole_cells(boxes[0], w))) break;
  }
  return chosen;
}

/// The deepest node that holds all of a box of finest cells; with a level of detail, none below one that may be drawn itself.
template <class Tree>
std::uint32_t deepest_holding(const Tree& tree, const std::vector<Box>& boxes, const Box& box) {
  std::uint32_t i = 0;
  while (tree.nodes[i].first_child != 0 && !is_drawn(tree.nodes[i])) {
    const auto child = static_cast<std::uint32_t>(tree.nodes[i].first_child);
    if (boxes[child].contains(box))
      i = child;
    else if (boxes[child + 1].contains(box))
      i = child + 1;
    else
      break;
  }
  return i;
}

template <class Tree>
StartGrid make_start_grid(const AmrHierarchy& h, const Tree& tree, std::int64_t most_cells) {
  const std::vector<Box> boxes = node_boxes(h, tree);
  StartGrid grid;
  grid.width = choose_width(h, tree, boxes, most_cells);
  grid.cells = ceil_div(h.cells(h.finest_level()), grid.width);
  const std::vector<int> heights = node_heights(tree);
  std::vector<std::int64_t> number(tree.nodes.size(), -1);
  for_each_cell({Vec3i(0), grid.cells}, [&](const Vec3i& g) {
    const Vec3i lower = g * grid.width;
    const Vec3i upper = lower + glm::min(Vec3i(grid.width), boxes[0].upper - lower);
    const std::uint32_t node = deepest_holding(tree, boxes, {lower, upper});
    if (number[node] < 0) {
      number[node] = static_cast<std::int64_t>(grid.nodes.size());
      grid.nodes.push_back(node);
      grid.depth = std::max(grid.depth, heights[node]);
    }
    grid.leaf_cells += tree.nodes[node].first_child == 0 ? 1 : 0;
    grid.entries.push_back(static_cast<std::uint32_t>(number[node]));
  });
  return grid;
}

}  // namespace amrtex
