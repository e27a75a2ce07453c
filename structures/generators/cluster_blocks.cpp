#include "structures/generators/cluster_blocks.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <iterator>
#include <span>
#include <tuple>

namespace amrtex {

namespace {

using Blocks = std::span<Vec3i>;

struct Cut {
  int axis = 0;
  int at = 0;  ///< first layer above the cut
};

Box bounds(Blocks blocks) {
  Box box{blocks.front(), blocks.front() + 1};
  for (const Vec3i& b : blocks) box = {glm::min(box.lower, b), glm::max(box.upper, b + 1)};
  return box;
}

/// Blocks a layer across an axis: the signature of the paper.
std::vector<int> signature(Blocks blocks, const Box& box, int axis) {
  std::vector<int> count(static_cast<std::size_t>(box.size()[axis]), 0);
  for (const Vec3i& b : blocks) ++count[static_cast<std::size_t>(b[axis] - box.lower[axis])];
  return count;
}

/// The axes, that of the longest edge first.
std::array<int, 3> axes_by_length(const Box& box) {
  std::array<int, 3> axes{0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return box.size()[a] > box.size()[b]; });
  return axes;
}

/// The empty layer nearest to the middle of any axis; at < 0 where there is none.
Cut cut_at_hole(Blocks blocks, const Box& box) {
  Cut best{0, -1};
  int distance = 0;
  for (const int axis : axes_by_length(box)) {
    const std::vector<int> count = signature(blocks, box, axis);
    for (int i = 0; i < std::ssize(count); ++i) {
      const int from_middle = std::abs(2 * i + 1 - static_cast<int>(std::ssize(count)));
      if (count[static_cast<std::size_t>(i)] > 0 || (best.at >= 0 && from_middle >= distance)) continue;
      best = {axis, box.lower[axis] + i};
      distance = from_middle;
    }
    if (best.at >= 0) return best;
  }
  return best;
}

/// Between the two layers over which the second difference of the signature changes its sign most.
Cut cut_at_edge(Blocks blocks, const Box& box) {
  Cut best{0, -1};
  int strongest = 0;
  for (const int axis : axes_by_length(box)) {
    const std::vector<int> count = signature(blocks, box, axis);
    const auto second = [&](std::size_t i) { return count[i - 1] - 2 * count[i] + count[i + 1]; };
    for (std::size_t i = 2; i + 1 < count.size(); ++i) {
      const int before = second(i - 1);
      const int after = second(i);
      if ((before < 0) == (after < 0) || std::abs(after - before) <= strongest) continue;
      strongest = std::abs(after - before);
      best = {axis, box.lower[axis] + static_cast<int>(i)};
    }
  }
  return best;
}

Cut best_cut(Blocks blocks, const Box& box, bool full) {
  Cut cut{0, -1};
  if (!full) cut = cut_at_hole(blocks, box);
  if (!full && cut.at < 0) cut = cut_at_edge(blocks, box);
  if (cut.at >= 0) return cut;
  const int axis = axes_by_length(box).front();
  return {axis, box.lower[axis] + box.size()[axis] / 2};
}

void cluster(Blocks blocks, const ClusterRules& rules, std::vector<Box>& boxes) {
  if (blocks.empty()) return;
  const Box box = bounds(blocks);
  const bool full = static_cast<double>(std::ssize(blocks)) >= rules.efficiency * static_cast<double>(box.cells());
  const Vec3i size = box.size();
  if (full && std::max({size.x, size.y, size.z}) <= rules.longest_edge) {
    boxes.push_back(box);
    return;
  }
  const Cut cut = best_cut(blocks, box, full);
  const auto middle = std::stable_partition(blocks.begin(), blocks.end(), [&](const Vec3i& b) { return b[cut.axis] < cut.at; });
  cluster({blocks.begin(), middle}, rules, boxes);
  cluster({middle, blocks.end()}, rules, boxes);
}

}  // namespace

std::vector<Box> cluster_blocks(BlockList blocks, const ClusterRules& rules) {
  std::vector<Box> boxes;
  if (rules.longest_edge == 1)
    for (const Vec3i& b : blocks) boxes.push_back({b, b + 1});
  else
    cluster(blocks, rules, boxes);
  std::sort(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) {
    return std::tie(a.lower.x, a.lower.y, a.lower.z) < std::tie(b.lower.x, b.lower.y, b.lower.z);
  });
  return boxes;
}

std::vector<std::vector<Box>> cluster_tree(const BlockGrid& grid, const TreeRules& tree_rules, const ClusterRules& rules,
                                           BlockTree& tree) {
  std::vector<std::vector<Box>> boxes(tree.levels.size());
  // from the finest level down: what a level's new blocks need lies on coarser levels
  for (int level = grid.level_count() - 1; level >= 0; --level) {
    const auto l = static_cast<std::size_t>(level);
    boxes[l] = cluster_blocks(tree.levels[l], rules);
    if (rules.efficiency == 1) continue;
    BlockList filled;
    for (const Box& box : boxes[l]) for_each_cell(box, [&](const Vec3i& b) { filled.push_back(b); });
    tree.add(level, std::move(filled));
    close_tree(grid, tree_rules, tree);
  }
  return boxes;
}

}  // namespace amrtex
