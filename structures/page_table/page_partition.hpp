// The pages of a mesh, and the table that finds them: what there is before any page is read.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "page_table_layout.h"
#include "structures/common/encoding.hpp"

namespace amrtex::pages {

/// One-level tables stay below this; a larger one is split in two levels.
inline constexpr std::int64_t kMaxTableBytes = std::int64_t{256} << 20;
/// Texture axes beyond this cost bits of the normalised coordinate (hardware filtering).
inline constexpr int kPreferredPoolEdge = 1024;
inline constexpr std::int64_t kMostPages = std::int64_t{1} << AMRTEX_PAGE_INDEX_BITS;
inline constexpr int kMostLevels = 1 << AMRTEX_PAGE_LEVEL_BITS;

struct Options {
  int page_size;
  bool nodes;
  int border;  ///< texels before the first cell of a page
  int edge;    ///< texels along the edge of a stored page
  std::int64_t page_texels() const { return std::int64_t{edge} * edge * edge; }
  std::int64_t page_cells() const { return std::int64_t{page_size} * page_size * page_size; }
  std::int64_t page_words() const { return page_cells() / 32; }  ///< of validity bits, of one field
};

/// A final page of the partition: where it lies, and what became of it.
struct Page {
  int level;
  Vec3i index_in_level;  ///< in pages of its level
  int kind = AMRTEX_PAGE_ABSENT;
  std::uint32_t index = 0;  ///< in the pool
  std::uint32_t green = 0;  ///< second channel of its entries
  bool pruned = false;      ///< absent because nothing of it can be seen
};

inline std::uint32_t red_of(int kind, int level, std::uint32_t index) {
  return index | (static_cast<std::uint32_t>(level) << AMRTEX_PAGE_INDEX_BITS) |
         (static_cast<std::uint32_t>(kind) << (AMRTEX_PAGE_INDEX_BITS + AMRTEX_PAGE_LEVEL_BITS));
}

/// Blocks of `edge` texels in a 3D texture of 2^shift.x by 2^shift.y by `layers` blocks:
/// powers of two, so that the shader finds a block by shifts.
struct PoolLayout {
  Vec3i shift{0};
  int layers = 1;
  int edge = 1;
  Vec3i texels() const { return Vec3i(1 << shift.x, 1 << shift.y, layers) * edge; }
  Vec3i position(std::int64_t block) const {
    const auto b = static_cast<int>(block);
    return Vec3i(b & ((1 << shift.x) - 1), (b >> shift.x) & ((1 << shift.y) - 1), b >> (shift.x + shift.y)) * edge;
  }
};

/// False when the blocks do not fit into one texture of at most `limit` texels an axis. As few
/// blocks side by side along x as possible, so that a block's rows lie close in memory; then
/// as few along y, which leaves least unused.
inline bool lay_out(std::int64_t blocks, int edge, int limit, PoolLayout& layout) {
  for (std::int64_t most : {std::min(limit, kPreferredPoolEdge), limit})
    for (int x = 0; (std::int64_t{edge} << x) <= most; ++x)
      for (int y = 0; (std::int64_t{edge} << y) <= most; ++y) {
        const std::int64_t layers = std::max<std::int64_t>((blocks + (std::int64_t{1} << (x + y)) - 1) >> (x + y), 1);
        if (edge * layers > most) continue;
        layout = {{x, y, 0}, static_cast<int>(layers), edge};
        return true;
      }
  return false;
}

/// The partition of section 4.1: a page is divided until no leaf in its box is finer than its level.
inline std::vector<Page> partition(const AmrHierarchy& h, int page_size) {
  std::vector<Page> pages;
  const auto descend = [&](auto&& self, int level, const Vec3i& index) -> void {
    const Box box{index * page_size, (index + Vec3i(1)) * page_size};
    const Box inside = intersection(box, h.domain(level));
    if (inside.empty()) return;
    if (!h.refined_within(level, inside)) {
      pages.push_back({.level = level, .index_in_level = index});
      return;
    }
    const int r = h.ratio_to_finer(level);
    for_each_cell(Box{index, index + Vec3i(1)}.refined(r), [&](const Vec3i& child) { self(self, level + 1, child); });
  };
  for_each_cell({Vec3i(0), ceil_div(h.cells(0), page_size)}, [&](const Vec3i& index) { descend(descend, 0, index); });
  return pages;
}

/// The pages' boxes under planes that cut none of them: whole ranges of pages are halved, then a divided page into its own.
class PageDrawTree {
 public:
  PageDrawTree(const AmrHierarchy& h, int page_size, const std::vector<Page>& pages) : hierarchy_(h), page_size_(page_size) {
    for (const Page& p : pages) pages_[key(p.level, p.index_in_level)] = p.kind;
    tree_.nodes.emplace_back();
    grow(0, 0, {Vec3i(0), ceil_div(h.cells(0), page_size)});
  }
  DrawTree tree() && { return std::move(tree_); }

 private:
  static std::array<int, 4> key(int level, const Vec3i& index) { return {level, index.x, index.y, index.z}; }

  void grow(std::size_t node, int level, const Box& range) {
    const Vec3i n = range.size();
    const int axis = n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2;
    if (n[axis] == 1) return add(node, level, range.lower);
    std::array<Box, 2> halves{range, range};
    const int middle = range.lower[axis] + n[axis] / 2;
    halves[0].upper[axis] = halves[1].lower[axis] = middle;
    const std::size_t child = tree_.split(node, axis, middle * page_size_ * hierarchy_.cell_width(level));
    for (const std::size_t side : {0, 1}) grow(child + side, level, halves[side]);
  }

  void add(std::size_t node, int level, const Vec3i& index) {
    const auto page = pages_.find(key(level, index));
    if (page == pages_.end()) {  // divided
      const Box inside{Vec3i(0), ceil_div(hierarchy_.cells(level + 1), page_size_)};
      return grow(node, level + 1, intersection(Box{index, index + Vec3i(1)}.refined(hierarchy_.ratio_to_finer(level)), inside));
    }
    if (page->second == AMRTEX_PAGE_ABSENT) return;
    const Box cells = intersection(Box{index, index + Vec3i(1)}.refined(page_size_), hierarchy_.domain(level));
    tree_.set_box(node, cells.refined(hierarchy_.cell_width(level)), level);
  }

  const AmrHierarchy& hierarchy_;
  int page_size_;
  std::map<std::array<int, 4>, int> pages_;  ///< level and index: kind
  DrawTree tree_;
};

/// The table: entries of the finest pages' size, in one level or two.
struct TablePlan {
  int finest_level = 0;  ///< of any page
  int top_level = 0;     ///< whose pages have one entry each in the first level of the table
  Vec3i top{1};          ///< entries of the first level
  int sub_edge = 1;      ///< entries along the edge of a sub-table; 1: one level
  std::int64_t subtables = 0;
  PoolLayout sub_layout;
  bool green = true;  ///< entries have their second channel
  TexelFormat format() const { return green ? TexelFormat::rg32ui : TexelFormat::r32ui; }
  int entry_bytes() const { return texel_bytes(format()); }
  bool two_levels() const { return sub_edge > 1; }
  Part top_part() const { return texture_part("tex_page_table", "entries of the table", format(), top); }
  Part sub_part() const {
    const std::int64_t used = subtables * sub_edge * sub_edge * sub_edge;
    return texture_part("tex_page_subtables", "entries of sub-tables", format(), sub_layout.texels())
        .holding({.topology = used})
        .when(two_levels());
  }
};

inline std::int64_t entries(const Vec3d& n) { return static_cast<std::int64_t>(std::min(n.x * n.y * n.z, 1e18)); }

inline TablePlan plan_table(const AmrHierarchy& h, const std::vector<Page>& pages, int page_size, const BuildRequest& request,
                            bool constants) {
  TablePlan plan;
  plan.green = request.needs.value_ranges || constants;
  for (const Page& p : pages) plan.finest_level = std::max(plan.finest_level, p.level);
  const Vec3i roots = ceil_div(h.cells(0), page_size);
  const int limit = request.context.max_3d_texture_size;
  const auto top_of = [&](int level) { return Vec3d(roots) * static_cast<double>(h.cell_width(0) / h.cell_width(level)); };
  const auto fits = [&](const Vec3d& n) { return std::max({n.x, n.y, n.z}) <= limit; };

  const Vec3d one = top_of(plan.finest_level);
  plan.top_level = plan.finest_level;
  if (fits(one) && entries(one) * plan.entry_bytes() <= std::min(kMaxTableBytes, request.memory_limit)) {
    plan.top = Vec3i(one);
    return plan;
  }
  std::int64_t best = std::numeric_limits<std::int64_t>::max();
  for (int level = plan.finest_level - 1; level >= 0; --level) {
    const Vec3d top = top_of(level);
    if (!fits(top)) continue;
    const int edge = h.cell_width(level) / h.cell_width(plan.finest_level);
    std::set<std::array<int, 3>> divided;
    for (const Page& p : pages)
      if (p.level > level) {
        const Vec3i i = p.index_in_level / (h.cell_width(level) / h.cell_width(p.level));
        divided.insert({i.x, i.y, i.z});
      }
    PoolLayout layout;
    const auto count = static_cast<std::int64_t>(divided.size());
    if (edge > limit || !lay_out(count, edge, limit, layout)) continue;
    const std::int64_t bytes = entries(top) * plan.entry_bytes() + count * plan.entry_bytes() * edge * edge * edge;
    if (bytes >= best) continue;
    best = bytes;
    plan.top_level = level;
    plan.top = Vec3i(top);
    plan.sub_edge = edge;
    plan.subtables = count;
    plan.sub_layout = layout;
  }
  if (!plan.two_levels())
    throw UnsupportedError(fmt::format(
        "encoding page_table with page_size {}: a table of {:.0f} x {:.0f} x {:.0f} entries, and no split in two levels "
        "fits a 3D texture of {} texels an axis; a larger page_size needs fewer entries",
        page_size, one.x, one.y, one.z, limit));
  return plan;
}

}  // namespace amrtex::pages
