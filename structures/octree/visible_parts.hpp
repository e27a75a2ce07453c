// What of the octree a picture reads: the leaves that show something under the scene's transfer function, and the
// nodes that hold a value which the filter takes about one of them. The others need not be stored.
#pragma once

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "octree_cell.hpp"
#include "octree_windows.hpp"

namespace amrtex {

class VisibleParts {
 public:
  /// Of a tree with this root. `ghosts`: cells outside of the domain have nodes; else they are those at its faces.
  VisibleParts(const AmrHierarchy& h, const BuildRequest& request, const TreeCell& root, bool ghosts)
      : hierarchy_(h), request_(request), root_(root), ghosts_(ghosts), kept_(static_cast<std::size_t>(root.shift) + 1) {
    const FieldStatistics& s = h.statistics(request.field);
    scale_ = storage_scale(request.storage, s);
    origin_ = range_origin(s, request.storage, scale_);
    for (int level = 0; level < h.level_count(); ++level) find_visible(level);
    for (std::size_t shift = 1; shift < kept_.size(); ++shift) {
      if (shift > 1)
        for (const Key& k : kept_[shift - 1]) kept_[shift].push_back({k[0] >> 1, k[1] >> 1, k[2] >> 1});
      tbb::parallel_sort(kept_[shift]);
      kept_[shift].erase(std::unique(kept_[shift].begin(), kept_[shift].end()), kept_[shift].end());
    }
  }

  /// Does the filter read a value below this inner cell for a leaf that shows something?
  bool keeps(const TreeCell& c) const {
    const Vec3l p = (c.lower - root_.lower) >> static_cast<std::int64_t>(c.shift);
    const auto& kept = kept_[static_cast<std::size_t>(c.shift)];
    return std::binary_search(kept.begin(), kept.end(), key(p));
  }

  /// Does a leaf, cell number `cell` of a patch, show something?
  bool shows(int level, int patch, std::size_t cell) const {
    return shown_[static_cast<std::size_t>(level)][static_cast<std::size_t>(patch)][cell] != 0;
  }

  std::int64_t host_bytes() const {
    std::int64_t bytes = 0;
    for (const auto& kept : kept_) bytes += static_cast<std::int64_t>(kept.size() * sizeof(Key));
    for (const auto& level : shown_)
      for (const auto& patch : level) bytes += static_cast<std::int64_t>(patch.size());
    return bytes;
  }

 private:
  /// Place among the tree's cells of one width.
  using Key = std::array<std::uint32_t, 3>;
  static Key key(const Vec3l& p) {
    return {static_cast<std::uint32_t>(p.x), static_cast<std::uint32_t>(p.y), static_cast<std::uint32_t>(p.z)};
  }

  bool linear() const { return request_.needs.filter != Filter::nearest; }

  void find_visible(int level) {
    const auto patches = hierarchy_.patches(level);
    auto& shown = shown_.emplace_back(patches.size());
    for (std::size_t k = 0; k < patches.size(); ++k) shown[k].resize(static_cast<std::size_t>(patches[k].box.cells()));
    const std::vector<PatchPart> parts = patch_parts(patches);
    tbb::enumerable_thread_specific<WindowRanges> windows;
    tbb::enumerable_thread_specific<std::vector<Key>> keys;
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      find_visible(level, parts[k], windows.local(), shown[parts[k].patch], keys.local());
    });
    const int shift = std::countr_zero(static_cast<unsigned>(hierarchy_.cell_width(level)));
    auto& kept = kept_[static_cast<std::size_t>(shift) + 1];
    for (const auto& own : keys) kept.insert(kept.end(), own.begin(), own.end());
  }

  /// Leaves of a part that show something, and the nodes that hold the cells about them.
  void find_visible(int level, const PatchPart& part, WindowRanges& window, std::vector<std::uint8_t>& shown,
                    std::vector<Key>& keys) const {
    const Patch& patch = hierarchy_.patches(level)[part.patch];
    const CellValues& values = patch.values[static_cast<std::size_t>(request_.field)];
    const auto mask = hierarchy_.leaf_mask(level, static_cast<int>(part.patch));
    const Box domain = ghosts_ ? hierarchy_.domain(level).grown(1) : hierarchy_.domain(level);
    const Vec3l first = -root_.lower / std::int64_t{hierarchy_.cell_width(level)};  // the domain's first cell in the tree
    const int reach = linear() ? 1 : 0;
    const Box read = intersection(part.box.grown(reach), domain);
    const Vec3l lower = (Vec3l(read.lower) + first) >> std::int64_t{1};
    const Box nodes{Vec3i(0), Vec3i(((Vec3l(read.upper) + first - Vec3l(1)) >> std::int64_t{1}) - lower) + Vec3i(1)};
    std::vector<std::uint8_t> kept(static_cast<std::size_t>(nodes.cells()));
    if (linear()) window.read(hierarchy_, request_.field, level, part.box);
    for_each_cell(part.box, [&](const Vec3i& c) {
      const std::size_t i = patch.box.offset(c);
      const double value = mask[i] == 0 ? std::numeric_limits<double>::quiet_NaN() : values[i];
      if (std::isnan(value)) return;
      ValueRange range;
      range.add(value);
      if (linear()) window.add_to(range, c);
      if (hidden(request_.needs, range, origin_, request_.storage, scale_)) return;
      shown[i] = 1;
      const Box about = intersection({c - Vec3i(reach), c + Vec3i(1 + reach)}, domain);
      const auto node = [&](const Vec3i& p) { return Vec3i(((Vec3l(p) + first) >> std::int64_t{1}) - lower); };
      for_each_cell({node(about.lower), node(about.upper - Vec3i(1)) + Vec3i(1)},
                    [&](const Vec3i& n) { kept[nodes.offset(n)] = 1; });
    });
    for_each_cell(nodes, [&](const Vec3i& n) {
      if (kept[nodes.offset(n)] != 0) keys.push_back(key(lower + Vec3l(n)));
    });
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  TreeCell root_;
  bool ghosts_;
  StorageScale scale_;
  double origin_ = 0;
  std::vector<std::vector<Key>> kept_;                         ///< by log2 of the cell's width; sorted
  std::vector<std::vector<std::vector<std::uint8_t>>> shown_;  ///< by level, patch and cell
};

}  // namespace amrtex
