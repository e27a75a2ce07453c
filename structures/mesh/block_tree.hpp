// Blocks of a generated mesh: a tree over square blocks of equal edge, in cells of their own level.
#pragma once

#include <cstdint>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// Where blocks can lie. Block b of a level holds the cells from b * patch on; blocks
/// at the domain's upper faces are clipped. `patch` is a multiple of every ratio, so
/// that each block lies over whole cells of one block of the next coarser level.
struct BlockGrid {
  Vec3i root_cells{1};      ///< cells of the domain at level 0
  std::vector<int> ratios;  ///< a level, to the next finer one
  int patch = 16;           ///< edge of a block, in cells of its own level

  int level_count() const { return static_cast<int>(ratios.size()) + 1; }
  /// Cells of `finer` a cell of `coarser`, along an axis.
  int ratio_between(int coarser, int finer) const;
  Vec3i cells(int level) const { return root_cells * ratio_between(0, level); }
  Box domain(int level) const { return {Vec3i(0), cells(level)}; }
  Vec3i blocks(int level) const { return ceil_div(cells(level), patch); }
  /// Cells of a block, level space.
  Box box(int level, const Vec3i& block) const;
  /// Cells of a box of blocks, level space.
  Box cells_of(int level, const Box& blocks) const {
    return {box(level, blocks.lower).lower, box(level, blocks.upper - 1).upper};
  }
  /// Blocks of the next finer level over a block.
  Box children(int level, const Vec3i& block) const;
};

/// Blocks in ascending order of x, then y, then z.
using BlockList = std::vector<Vec3i>;

struct BlockTree {
  std::vector<BlockList> levels;

  bool contains(int level, const Vec3i& block) const;
  /// Adds blocks in any order; those that are there already stay single.
  void add(int level, BlockList blocks);
};

struct TreeRules {
  int level_jump = 1;                  ///< largest level difference of 26-neighbouring leaf blocks; 0 = any
  std::vector<bool> skipped;           ///< levels whose blocks are all refined, so that they hold no leaf
  std::int64_t max_cells = INT64_MAX;  ///< of the whole tree
};

/// Cells of all blocks, unclipped; INT64_MAX where that takes more than 63 bits.
std::int64_t count_cells(const BlockGrid& grid, const BlockTree& tree);

/// All blocks of the next finer level over the given ones.
BlockList all_children(const BlockGrid& grid, int level, const BlockList& blocks);

/// Adds the fewest blocks that make the rules true and give every block its parent.
/// Where level 0 has no block nothing is added. Throws a UsageError past `max_cells`.
void close_tree(const BlockGrid& grid, const TreeRules& rules, BlockTree& tree);

/// Throws a UsageError when all blocks over the given ones hold more cells than allowed: asked before they are made.
void require_children(const BlockGrid& grid, const TreeRules& rules, int level, const BlockList& blocks);

/// Throws a UsageError when the tree holds more cells than allowed.
void require_cells(const BlockGrid& grid, const TreeRules& rules, const BlockTree& tree);

}  // namespace amrtex
