// Level of detail: nodes whose cells are all refined (kind (a) of the paper) may be drawn themselves
// (Kaehler & Hege 2002, section 7).
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "kd_partition.hpp"
#include "structures/common/start_grid.hpp"

namespace amrtex::kd {

/// Coarsest level of the subgrids that cover a node or one below it, and none above.
inline std::vector<int> coarsest_covers(const Tree& tree) {
  std::vector<int> coarsest(tree.nodes.size(), std::numeric_limits<int>::max());
  for (std::size_t i = tree.nodes.size(); i-- > 0;) {
    const Node& n = tree.nodes[i];
    const CoverSpan& span = tree.node_covers[i];
    const std::uint32_t own = span.inherited ? 1 : 0;
    if (span.count > own)
      coarsest[i] = tree.covers[span.first + own].level;
    else if (n.first_child != 0)
      coarsest[i] = std::min(coarsest[n.first_child], coarsest[n.first_child + 1]);
  }
  return coarsest;
}

/// Gives each node the blocks that may be drawn in place of what lies below it, the coarsest first, and behind them its leaf.
/// A node has a block of each subgrid that covers it and whose cells there are all refined. One that was drawable in the node
/// above already is there again only where it is refined by another level than there: it may be needed where the larger one
/// is not (`max_level`). Needs Tree::covers, and drops them. Throws UnsupportedError for more blocks than a node can tell apart.
inline void add_detail_blocks(const AmrHierarchy& h, Tree& tree, const Limits& limits = {}) {
  constexpr int kNotAbove = -1;
  const std::vector<Box> boxes = node_boxes(h, tree);
  const std::vector<int> coarsest = coarsest_leaves(tree);
  const std::vector<int> below = coarsest_covers(tree);
  std::vector<int> next_above(tree.nodes.size(), kNotAbove);  // of the node's inherited subgrid, where that is drawable above
  std::vector<Leaf> blocks;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    Node& n = tree.nodes[i];
    const CoverSpan& span = tree.node_covers[i];
    const int leaf = n.leaf;
    n.leaf = -1;
    const auto first = static_cast<int>(blocks.size());
    int next = kNotAbove;
    for (std::uint32_t k = 0; k < span.count; ++k) {
      const Cover cover = tree.covers[span.first + k];
      if (leaf >= 0 && k + 1 == span.count) {
        blocks.push_back(tree.leaves[static_cast<std::size_t>(leaf)]);
        break;
      }
      next = kNotAbove;
      if (coarsest[i] <= cover.level) continue;
      next =
          k + 1 < span.count ? tree.covers[span.first + k + 1].level : std::min(below[n.first_child], below[n.first_child + 1]);
      const bool repeated = k == 0 && span.inherited && next_above[i] != kNotAbove;
      if (repeated && next_above[i] == next) continue;
      const int w = h.cell_width(cover.level);
      blocks.push_back({cover.level, cover.patch, {boxes[i].lower / w, boxes[i].upper / w}, next, false, repeated});
    }
    if (n.first_child != 0) next_above[n.first_child] = next_above[n.first_child + 1] = next;
    if (static_cast<int>(blocks.size()) == first) continue;
    n.leaf = first;
    blocks.back().last = true;
    require_blocks(static_cast<std::int64_t>(blocks.size()), limits);
  }
  tree.leaves = std::move(blocks);
  tree.covers = {};
  tree.node_covers = {};
}

/// What the shader reads of a block: kd_tree_layout.h.
inline std::uint32_t detail_word(const Leaf& block) {
  return static_cast<std::uint32_t>(block.level) | (static_cast<std::uint32_t>(block.next) << AMRTEX_KD_LEVEL_BITS) |
         (block.last ? 1U << AMRTEX_KD_DETAIL_LAST_BIT : 0U);
}

}  // namespace amrtex::kd
