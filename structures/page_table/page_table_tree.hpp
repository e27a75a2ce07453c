// The page table as a tree of tables: entries of a first level, each divided further where smaller pages lie in it, and so on.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "page_partition.hpp"

namespace amrtex::pages {

/// A first level holds at most this many entries: where it stands against a deep mesh, it costs little.
inline constexpr std::int64_t kMostTopEntries = 1 << 15;
/// Along the edge of a sub-table, where the refinement ratios let it be that few.
inline constexpr int kSubtableEdge = 8;

/// One level of the tree.
struct TableStage {
  int width = 0;  ///< of an entry, finest cells
  int edge = 0;   ///< entries along an edge of each of its tables; of the first level 0
};

/// Where the entries of a page stand.
struct EntryPlace {
  std::size_t stage = 0;
  std::int64_t first = 0;  ///< entry of the sub-table, among those of all sub-tables
  Box table;               ///< entries that the (sub-)table holds, counted from the domain's corner
  Box entries;             ///< those of the page in it
};

/// Widths of entries that pages and groups of pages can have, ascending: each is a multiple of the one before by a prime, from
/// that of the finest page on. A page wider than 31 bits can tell is divided itself.
inline std::vector<int> entry_widths(const AmrHierarchy& h, int page_size, int finest_level) {
  constexpr std::int64_t kWidest = std::numeric_limits<int>::max();
  std::int64_t width = std::int64_t{page_size} * h.cell_width(finest_level);
  while (width > kWidest) width /= 2;
  std::vector<int> widths{static_cast<int>(width)};
  const auto widen = [&](int factor) {
    width *= factor;
    if (width <= kWidest) widths.push_back(static_cast<int>(width));
  };
  for (int level = finest_level - 1; level >= 0 && width <= kWidest; --level) {
    int rest = h.ratio_to_finer(level);
    for (int factor = 2; rest > 1 && width <= kWidest; ++factor) {
      if (std::int64_t{factor} * factor > rest) factor = rest;
      for (; rest % factor == 0 && width <= kWidest; rest /= factor) widen(factor);
    }
  }
  const Vec3i domain = h.cells(h.finest_level());
  while (width < std::max({domain.x, domain.y, domain.z})) widen(2);
  return widths;
}

class TableTree {
 public:
  /// Tables for these pages, of which the first has at most `most_top` entries, where the ratios let it be that few; nullopt
  /// where it does not fit a texture of `limit` texels an axis.
  static std::optional<TableTree> over(const AmrHierarchy& h, const Division& division, const std::vector<Page>& pages, int limit,
                                       std::int64_t most_top = kMostTopEntries) {
    TableTree tree(h, division.page_size());
    if (!tree.choose_stages(entry_widths(h, division.page_size(), division.finest_level()), limit, most_top)) return std::nullopt;
    for (const Page& page : pages) tree.add_tables_above(page);
    return tree;
  }

  const std::vector<TableStage>& stages() const { return stages_; }
  const Vec3i& top() const { return top_; }
  std::int64_t subtables() const { return subtables_; }
  /// Of all sub-tables; INT64_MAX where that takes more than 63 bits.
  std::int64_t entries() const { return entries_.or_most(); }

  EntryPlace place(const Page& page) const {
    EntryPlace at;
    while (page_width(page) < stages_[at.stage].width) ++at.stage;
    const int entry_width = stages_[at.stage].width;
    const Vec3i first = corner(page) / entry_width;
    std::tie(at.first, at.table) = table_of(at.stage, first);
    const Vec3i table = at.table.size();
    const int most = std::max({table.x, table.y, table.z});
    const auto n = static_cast<int>(std::min<std::int64_t>(page_width(page) / entry_width, most));
    at.entries = intersection(Box{first, first + Vec3i(n)}, at.table);
    return at;
  }

  /// Calls f(stage of the entry, entry, unit of the sub-table that it points to) for each sub-table.
  template <class F>
  void for_each_subtable(F&& f) const {
    for (std::size_t stage = 1; stage < stages_.size(); ++stage)
      for (const auto& [entry, first] : tables_[stage])
        f(stage - 1, Vec3i(entry[0], entry[1], entry[2]), static_cast<std::uint32_t>(first / AMRTEX_PAGE_NODE_UNIT));
  }
  /// Where the table of a stage that holds an entry begins, and what it holds.
  std::pair<std::int64_t, Box> table_of(std::size_t stage, const Vec3i& entry) const {
    if (stage == 0) return {0, {Vec3i(0), top_}};
    const Vec3i owner = entry / stages_[stage].edge;
    return {tables_[stage].at(key(owner)), Box{owner, owner + Vec3i(1)}.refined(stages_[stage].edge)};
  }

 private:
  using Key = std::array<int, 3>;
  static Key key(const Vec3i& v) { return {v.x, v.y, v.z}; }

  TableTree(const AmrHierarchy& h, int page_size) : hierarchy_(&h), page_size_(page_size) {}

  /// Finest cells.
  std::int64_t page_width(const Page& page) const { return std::int64_t{page_size_} * hierarchy_->cell_width(page.level); }
  Vec3i corner(const Page& page) const { return page.index_in_level * page_size_ * hierarchy_->cell_width(page.level); }

  Vec3i entries_along(int width) const { return ceil_div(hierarchy_->cells(hierarchy_->finest_level()), width); }

  /// The first level: of the smallest entries of which it has few enough. From there on steps of at most kSubtableEdge.
  bool choose_stages(const std::vector<int>& widths, int limit, std::int64_t most_top) {
    std::size_t i = 0;
    while (i + 1 < widths.size() && Box{Vec3i(0), entries_along(widths[i])}.cells() > most_top) ++i;
    top_ = entries_along(widths[i]);
    stages_.push_back({.width = widths[i], .edge = 0});
    while (i > 0) {
      std::size_t next = i - 1;
      while (next > 0 && widths[i] / widths[next - 1] <= kSubtableEdge) --next;
      stages_.push_back({.width = widths[next], .edge = widths[i] / widths[next]});
      i = next;
    }
    tables_.resize(stages_.size());
    return std::max({top_.x, top_.y, top_.z}) <= limit;
  }

  void add_tables_above(const Page& page) {
    for (std::size_t stage = 1; page_width(page) < stages_[stage - 1].width; ++stage) {
      const auto [table, added] = tables_[stage].try_emplace(key(corner(page) / stages_[stage - 1].width), entries_.or_most());
      if (!added) continue;
      ++subtables_;
      entries_ += table_entries(stages_[stage].edge);
    }
  }

  /// Of one sub-table, with what is unused to keep the next on a whole unit.
  static CheckedSize table_entries(int edge) {
    const std::int64_t used = Box{Vec3i(0), Vec3i(edge)}.cells();
    return CheckedSize(used) + CheckedSize((AMRTEX_PAGE_NODE_UNIT - used % AMRTEX_PAGE_NODE_UNIT) % AMRTEX_PAGE_NODE_UNIT);
  }

  const AmrHierarchy* hierarchy_;
  int page_size_;
  std::vector<TableStage> stages_;
  Vec3i top_{1};
  std::vector<std::map<Key, std::int64_t>> tables_;  ///< a stage: by the entry that points to one, where it begins
  std::int64_t subtables_ = 0;
  CheckedSize entries_;
};

}  // namespace amrtex::pages
