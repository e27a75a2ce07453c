// What is built of a mesh: the tree's leaves gathered in bricks, what the scene hides taken out, and their place in the pool.
#pragma once

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "hidden_leaves.hpp"
#include "kd_hats.hpp"
#include "kd_partition.hpp"
#include "kd_pool.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/start_grid.hpp"

namespace amrtex::kd {

struct Options {
  bool bindless = false;  ///< a texture a brick, no pool
  bool paper_packing = false;
  bool grid = true;
  bool wrap = false;
  bool detail = false;  ///< refined cells may be drawn
  bool vertices = false;
  bool hats = false;  ///< each sample searches the leaves whose cells' hats reach it
  int border = 0;     ///< texels before the first cell of a brick
};

/// What is stored of one subgrid: the box around its drawn blocks.
struct Brick {
  int level;
  int patch;
  Box cells;                ///< level space
  std::vector<int> leaves;  ///< of the tree
  Box texels(const Options& o) const { return o.vertices ? Box{cells.lower, cells.upper + Vec3i(1)} : cells.grown(o.border); }
};

/// What was left out because the scene does not show it.
struct Pruned {
  std::int64_t leaves = 0;
  std::int64_t bricks = 0;        ///< subgrids of which nothing is stored
  std::int64_t brick_cells = 0;   ///< of bricks, by which the others shrank included
  std::int64_t brick_texels = 0;  ///< the same with borders
  std::int64_t leaf_cells = 0;
  std::int64_t support_bytes = 0;
};

struct Plan {
  Tree tree;
  Pruned pruned;
  std::vector<Brick> bricks;
  std::vector<int> brick_of;  ///< a leaf
  PoolPacking pool;           ///< bindless: every brick at 0, in a texture of its own, and the largest extents
  bool numbered = false;      ///< do data nodes tell the texture?
  StartGrid grid;
  std::vector<HatNode> hats;
  SupportList supports;
  Vec3i position_bits{0};  ///< of a packed position
  int data_words = 1;
  std::int64_t validity_words = 0;  ///< that there are, or would be
  std::int64_t brick_texels = 0;
  std::int64_t leaf_cells = 0;
  std::int64_t detail_cells = 0;  ///< refined ones that are stored
  std::int64_t leaf_count = 0;
  std::int64_t leaf_bricks = 0;  ///< that hold a leaf
  std::int64_t node_count() const { return static_cast<std::int64_t>(tree.nodes.size()); }
  std::int64_t brick_count() const { return static_cast<std::int64_t>(bricks.size()); }
  /// Texels of one field.
  std::int64_t texels(const Options& o) const { return o.bindless ? brick_texels : pool.packing.texels() * pool.textures; }
  std::int64_t block_count() const { return static_cast<std::int64_t>(tree.leaves.size()); }
};

/// Adds a block's cells to those of leaves, or to the refined ones.
inline void count_block(const Leaf& block, std::int64_t& leaf_cells, std::int64_t& refined_cells) {
  if (block.next == kNothingFiner)
    leaf_cells += block.cells.cells();
  else if (!block.repeated)
    refined_cells += block.cells.cells();
}

inline std::vector<Brick> make_bricks(const Tree& tree, std::vector<int>& brick_of) {
  std::map<std::pair<int, int>, int> known;  // level, patch
  std::vector<Brick> bricks;
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) {
    const Leaf& leaf = tree.leaves[i];
    const auto [it, added] = known.try_emplace({leaf.level, leaf.patch}, static_cast<int>(bricks.size()));
    if (added) bricks.push_back({leaf.level, leaf.patch, leaf.cells, {}});
    Brick& brick = bricks[static_cast<std::size_t>(it->second)];
    brick.cells = {glm::min(brick.cells.lower, leaf.cells.lower), glm::max(brick.cells.upper, leaf.cells.upper)};
    brick.leaves.push_back(static_cast<int>(i));
    brick_of.push_back(it->second);
  }
  return bricks;
}

/// Bricks of vertices and of hats lie side by side without a border.
inline bool may_leak(const Options& o) { return o.vertices || o.hats; }

/// Removes the leaves of which nothing can be seen. A brick is then the box around those that are left.
inline Pruned prune(const AmrHierarchy& h, const BuildRequest& request, const Options& o, Tree& tree) {
  Pruned pruned;
  if (request.needs.invisible.empty()) return pruned;
  const auto count = [&](const Tree& t, int sign) {
    std::vector<int> brick_of;
    for (const Brick& b : make_bricks(t, brick_of)) {
      pruned.bricks += sign;
      pruned.brick_cells += sign * b.cells.cells();
      pruned.brick_texels += sign * b.texels(o).cells();
    }
    for (const Leaf& leaf : t.leaves) pruned.leaf_cells += sign * leaf.cells.cells();
    if (o.hats) pruned.support_bytes += sign * SupportList(hat_nodes(h, t), hat_code).bytes();
    pruned.leaves += sign * static_cast<std::int64_t>(t.leaves.size());
  };
  count(tree, 1);
  // the pool's size is not known yet; it is no larger
  const Vec3i largest_pool(request.context.max_3d_texture_size);
  const double leak = may_leak(o) ? leaked_value(h.statistics(request.field), largest_pool) : 0;
  remove_leaves(tree, hidden_leaves(h, request, tree, {o.vertices, o.hats, o.border, leak}));
  count(tree, -1);
  return pruned;
}

}  // namespace amrtex::kd
