#include "structures/mesh/block_tree.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <tuple>
#include <utility>

#include "structures/mesh/error.hpp"

namespace amrtex {

namespace {

bool before(const Vec3i& a, const Vec3i& b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }

/// Blocks of level `to` that hold the 26 neighbours of a block, itself included.
Box neighbour_ancestors(const BlockGrid& grid, int level, const Vec3i& block, int to) {
  const Box neighbours = intersection(Box{block, block + Vec3i(1)}.grown(1), {Vec3i(0), grid.blocks(level)});
  return neighbours.coarsened(grid.ratio_between(to, level));
}

void drop_holes(const BlockGrid& grid, const BlockTree& tree, int level, BlockList& blocks) {
  const int ratio = grid.ratio_between(0, level);
  std::erase_if(blocks, [&](const Vec3i& b) { return !tree.contains(0, floor_div(b, ratio)); });
}

void sort_unique(BlockList& blocks) {
  std::sort(blocks.begin(), blocks.end(), before);
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
}

void add_parents(const BlockGrid& grid, int level, BlockTree& tree) {
  BlockList parents;
  for (const Vec3i& block : tree.levels[static_cast<std::size_t>(level)])
    parents.push_back(floor_div(block, grid.ratio_between(level - 1, level)));
  tree.add(level - 1, std::move(parents));
}

void add_neighbours(const BlockGrid& grid, int level, int to, BlockTree& tree) {
  BlockList wanted;
  for (const Vec3i& block : tree.levels[static_cast<std::size_t>(level)])
    for_each_cell(neighbour_ancestors(grid, level, block, to), [&](const Vec3i& b) { wanted.push_back(b); });
  sort_unique(wanted);
  drop_holes(grid, tree, to, wanted);
  tree.add(to, std::move(wanted));
}

std::int64_t cells_of_blocks(const BlockGrid& grid, CheckedSize blocks) {
  return (blocks * grid.patch * grid.patch * grid.patch).or_most();
}

void require_at_most(std::int64_t cells, const TreeRules& rules) {
  if (cells <= rules.max_cells) return;
  throw UsageError(
      fmt::format("generator: the mesh would hold {} cells or more, at most {} are made; accepted: smaller \"root\" or "
                  "\"levels\", or a \"refine\" that selects less",
                  cells, rules.max_cells));
}

}  // namespace

int BlockGrid::ratio_between(int coarser, int finer) const {
  int product = 1;
  for (int l = coarser; l < finer; ++l) product *= ratios[static_cast<std::size_t>(l)];
  return product;
}

Box BlockGrid::box(int level, const Vec3i& block) const {
  return intersection({block * patch, (block + Vec3i(1)) * patch}, domain(level));
}

Box BlockGrid::children(int level, const Vec3i& block) const {
  const int ratio = ratio_between(level, level + 1);
  return intersection({block * ratio, (block + Vec3i(1)) * ratio}, {Vec3i(0), blocks(level + 1)});
}

bool BlockTree::contains(int level, const Vec3i& block) const {
  const BlockList& list = levels[static_cast<std::size_t>(level)];
  return std::binary_search(list.begin(), list.end(), block, before);
}

void BlockTree::add(int level, BlockList blocks) {
  BlockList& list = levels[static_cast<std::size_t>(level)];
  sort_unique(blocks);
  BlockList merged;
  merged.reserve(list.size() + blocks.size());
  std::set_union(list.begin(), list.end(), blocks.begin(), blocks.end(), std::back_inserter(merged), before);
  list = std::move(merged);
}

std::int64_t count_cells(const BlockGrid& grid, const BlockTree& tree) {
  std::int64_t blocks = 0;
  for (const BlockList& list : tree.levels) blocks += static_cast<std::int64_t>(list.size());
  return cells_of_blocks(grid, blocks);
}

void require_children(const BlockGrid& grid, const TreeRules& rules, int level, const BlockList& blocks) {
  CheckedSize count;
  for (const Vec3i& block : blocks) count += grid.children(level, block).cells();
  require_at_most(cells_of_blocks(grid, count), rules);
}

BlockList all_children(const BlockGrid& grid, int level, const BlockList& blocks) {
  BlockList result;
  for (const Vec3i& block : blocks) for_each_cell(grid.children(level, block), [&](const Vec3i& b) { result.push_back(b); });
  return result;
}

void require_cells(const BlockGrid& grid, const TreeRules& rules, const BlockTree& tree) {
  require_at_most(count_cells(grid, tree), rules);
}

void close_tree(const BlockGrid& grid, const TreeRules& rules, BlockTree& tree) {
  const int finest = grid.level_count() - 1;
  // A sweep from the finest level down only adds coarser blocks, so one is enough
  // unless a skipped level then hands its new blocks down again.
  for (std::int64_t cells_before = -1; cells_before != count_cells(grid, tree);) {
    cells_before = count_cells(grid, tree);
    for (int level = finest; level > 0; --level) {
      add_parents(grid, level, tree);
      if (rules.level_jump > 0 && level > rules.level_jump) add_neighbours(grid, level, level - rules.level_jump, tree);
    }
    for (int level = 0; level < finest; ++level) {
      const auto l = static_cast<std::size_t>(level);
      if (rules.skipped[l]) {
        require_children(grid, rules, level, tree.levels[l]);
        tree.add(level + 1, all_children(grid, level, tree.levels[l]));
      }
      require_cells(grid, rules, tree);
    }
  }
}

}  // namespace amrtex
