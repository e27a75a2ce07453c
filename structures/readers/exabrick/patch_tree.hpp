// Search for the patch that holds a cell, however patches lie: side by side, or few of them far apart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// A tree of boxes around half of the patches each. Patches do not overlap, and stay where they are as long as the tree lives.
class PatchTree {
 public:
  explicit PatchTree(std::span<const Patch> patches);

  /// The patch that holds the cell, or -1.
  int find(const Vec3i& cell) const { return order_.empty() ? -1 : find(cell, 0, 0, order_.size()); }

 private:
  static constexpr std::size_t kLeaf = 4;  // patches that are tried one by one

  const Box& box(std::size_t i) const { return patches_[order_[i]].box; }
  void build(std::size_t node, std::size_t begin, std::size_t end);
  int find(const Vec3i& cell, std::size_t node, std::size_t begin, std::size_t end) const;

  std::span<const Patch> patches_;
  std::vector<std::uint32_t> order_;  ///< numbers of patches: those of a node stand together
  std::vector<Box> bounds_;           ///< a node; its halves are 2 n + 1 and 2 n + 2
};

}  // namespace amrtex
