// The pages of a mesh: what there is before any value is read. All of it follows from the boxes of patches.
#pragma once

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <vector>

#include "page_table_layout.h"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/checked.hpp"

namespace amrtex::pages {

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

/// Pages of one level, in the order of for_each_cell, each once.
using PageList = std::vector<Vec3i>;

/// The partition of section 4.1: a page is divided until no leaf in its box is finer than its level. So those are divided that
/// patches of finer levels reach into; no page is visited to learn it, and a refinement by 100000 costs what its patches do.
class Division {
 public:
  Division(const AmrHierarchy& h, int page_size)
      : hierarchy_(h), page_size_(page_size), divided_(static_cast<std::size_t>(h.level_count())) {
    for (int level = h.finest_level() - 1; level >= 0; --level) {
      const int r = h.ratio_to_finer(level);
      PageList& list = divided_[static_cast<std::size_t>(level)];
      for (const Vec3i& finer : divided(level + 1)) list.push_back(finer / r);
      add_patches(level + 1, r, list);
      sort_once(list);
    }
    roots_ = divided(0);
    add_patches(0, 1, roots_);
    sort_once(roots_);
  }

  int page_size() const { return page_size_; }
  const PageList& divided(int level) const { return divided_[static_cast<std::size_t>(level)]; }
  std::int64_t divided_count(int level) const { return static_cast<std::int64_t>(divided(level).size()); }
  bool divides(int level, const Vec3i& page) const {
    return std::binary_search(divided(level).begin(), divided(level).end(), page, stands_before);
  }
  /// Pages of level 0 with any mesh in them. Of the others none is listed.
  const PageList& roots() const { return roots_; }
  /// Along each axis, of a level.
  Vec3i pages_along(int level) const { return ceil_div(hierarchy_.cells(level), page_size_); }
  /// What a divided page is divided into: pages of the next level, those that lie in the domain.
  Box children(int level, const Vec3i& page) const {
    return intersection(Box{page, page + Vec3i(1)}.refined(hierarchy_.ratio_to_finer(level)),
                        Box{Vec3i(0), pages_along(level + 1)});
  }
  /// The finest level that has pages.
  int finest_level() const {
    int level = 0;
    while (level < hierarchy_.finest_level() && !divided(level).empty()) ++level;
    return level;
  }
  /// How many pages partition() lists; INT64_MAX where that takes more than 63 bits.
  std::int64_t pages() const {
    CheckedSize all = static_cast<std::int64_t>(roots_.size());
    std::int64_t not_final = 0;
    for (int level = 0; level < hierarchy_.finest_level(); ++level) {
      not_final += divided_count(level);
      for (const Vec3i& page : divided(level)) all += children(level, page).cells();
    }
    return all.fits() ? all.or_most() - not_final : all.or_most();
  }

 private:
  static bool stands_before(const Vec3i& a, const Vec3i& b) { return std::tie(a.z, a.y, a.x) < std::tie(b.z, b.y, b.x); }
  static void sort_once(PageList& list) {
    std::sort(list.begin(), list.end(), stands_before);
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  /// Pages into which patches of a level reach; `ratio`: of the pages' cells to theirs.
  void add_patches(int level, int ratio, PageList& list) const {
    for (const Patch& patch : hierarchy_.patches(level))
      for_each_cell(patch.box.coarsened(ratio).coarsened(page_size_), [&](const Vec3i& page) { list.push_back(page); });
  }

  const AmrHierarchy& hierarchy_;
  int page_size_;
  std::vector<PageList> divided_;  ///< a level
  PageList roots_;
};

/// All final pages but those of level 0 without mesh.
inline std::vector<Page> partition(const Division& division) {
  std::vector<Page> pages;
  const auto descend = [&](auto&& self, int level, const Vec3i& index) -> void {
    if (division.divides(level, index))
      for_each_cell(division.children(level, index), [&](const Vec3i& child) { self(self, level + 1, child); });
    else
      pages.push_back({.level = level, .index_in_level = index});
  };
  for (const Vec3i& root : division.roots()) descend(descend, 0, root);
  return pages;
}

/// Pages of level 0 that partition() does not list.
inline std::int64_t pages_without_mesh(const Division& division) {
  return Box{Vec3i(0), division.pages_along(0)}.cells() - static_cast<std::int64_t>(division.roots().size());
}

}  // namespace amrtex::pages
