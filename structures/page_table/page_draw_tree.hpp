// The pages' boxes under planes that cut none of them.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <span>
#include <vector>

#include "page_partition.hpp"
#include "structures/common/draw_tree.hpp"

namespace amrtex::pages {

/// Whole ranges of pages are halved, then a divided page into its own. Ranges without mesh stay one leaf, in which nothing is
/// drawn.
class PageDrawTree {
 public:
  PageDrawTree(const AmrHierarchy& h, const Division& division, const std::vector<Page>& pages)
      : hierarchy_(h), division_(division) {
    for (const Page& p : pages) pages_[key(p.level, p.index_in_level)] = p.kind;
    tree_.nodes.emplace_back();
    std::vector<Vec3i> roots = division.roots();
    grow_roots(0, {Vec3i(0), division.pages_along(0)}, roots);
  }
  DrawTree tree() && { return std::move(tree_); }

 private:
  static std::array<int, 4> key(int level, const Vec3i& index) { return {level, index.x, index.y, index.z}; }
  static int longest_axis(const Vec3i& n) { return n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2; }

  /// Divides a leaf of the tree in the middle of its range of pages; returns the lower child.
  std::size_t halve(std::size_t node, int level, int axis, std::array<Box, 2>& halves) {
    const Box range = halves[0];
    const int middle = range.lower[axis] + range.size()[axis] / 2;
    halves[0].upper[axis] = halves[1].lower[axis] = middle;
    return tree_.split(node, axis, middle * division_.page_size() * hierarchy_.cell_width(level));
  }

  /// `roots`: the pages of level 0 in the range that have mesh.
  void grow_roots(std::size_t node, const Box& range, std::span<Vec3i> roots) {
    if (roots.empty()) return;
    const int axis = longest_axis(range.size());
    if (range.size()[axis] == 1) return add(node, 0, range.lower);
    std::array<Box, 2> halves{range, range};
    const std::size_t child = halve(node, 0, axis, halves);
    const auto above = std::partition(roots.begin(), roots.end(), [&](const Vec3i& r) { return halves[0].contains(r); });
    const auto below = static_cast<std::size_t>(above - roots.begin());
    grow_roots(child, halves[0], roots.first(below));
    grow_roots(child + 1, halves[1], roots.subspan(below));
  }

  void grow(std::size_t node, int level, const Box& range) {
    const int axis = longest_axis(range.size());
    if (range.size()[axis] == 1) return add(node, level, range.lower);
    std::array<Box, 2> halves{range, range};
    const std::size_t child = halve(node, level, axis, halves);
    for (const std::size_t side : {0, 1}) grow(child + side, level, halves[side]);
  }

  void add(std::size_t node, int level, const Vec3i& index) {
    if (division_.divides(level, index)) return grow(node, level + 1, division_.children(level, index));
    if (pages_.at(key(level, index)) == AMRTEX_PAGE_ABSENT) return;
    const Box cells = intersection(Box{index, index + Vec3i(1)}.refined(division_.page_size()), hierarchy_.domain(level));
    tree_.set_box(node, cells.refined(hierarchy_.cell_width(level)), level);
  }

  const AmrHierarchy& hierarchy_;
  const Division& division_;
  std::map<std::array<int, 4>, int> pages_;  ///< level and index: kind
  DrawTree tree_;
};

}  // namespace amrtex::pages
