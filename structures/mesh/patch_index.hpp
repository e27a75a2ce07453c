// Search for the patch of a level that holds a cell, or those that a box meets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "structures/mesh/patch.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// Patches of one level by bins over their common bounding box: constant-time look-up.
class PatchIndex {
 public:
  explicit PatchIndex(std::span<const Patch> patches);

  /// Calls f(patch) for those that may meet the box, for some several times.
  template <class F>
  void for_candidates(const Box& box, F&& f) const {
    const Box inside = intersection(box, bounds_);
    if (inside.empty()) return;
    const Box bins = inside.shifted(-bounds_.lower).coarsened(bin_);
    for_each_cell(bins, [&](const Vec3i& b) {
      const std::size_t i = Box{Vec3i(0), bins_}.offset(b);
      for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k) f(patch_[k]);
    });
  }

  /// The patch that holds the cell, or -1. `patches` are those that the index was made of.
  int find(std::span<const Patch> patches, const Vec3i& cell) const;

 private:
  Box bins_of(const Box& box) const { return box.shifted(-bounds_.lower).coarsened(bin_); }
  bool too_many_bins(std::span<const Patch> patches);
  void fill(std::span<const Patch> patches);

  Box bounds_;
  Vec3i bins_{0};
  int bin_ = 1;
  std::vector<std::uint32_t> first_;
  std::vector<int> patch_;
};

}  // namespace amrtex
