// The table that finds the pages: how many levels it has, and its parts.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "page_partition.hpp"
#include "page_pool.hpp"
#include "page_table_tree.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex::pages {

/// One-level tables stay below this.
inline constexpr std::int64_t kMaxTableBytes = std::int64_t{256} << 20;
/// A table up to this, or up to what its pages would take, has as few levels as fit: fewer look-ups are worth it.
inline constexpr std::int64_t kSmallTableBytes = std::int64_t{4} << 20;

/// The table: entries of the finest pages' size in one level or two, or a tree of tables.
struct TablePlan {
  int entry_width = 1;   ///< of the first level, finest cells
  Vec3i top{1};          ///< entries of the first level
  int top_level = 0;     ///< two levels: whose pages have one entry each in the first
  int finest_level = 0;  ///< of any page
  int sub_edge = 1;      ///< two levels: entries along the edge of a sub-table
  std::int64_t subtables = 0;
  PoolLayout sub_layout;
  std::optional<TableTree> tree;
  bool green = true;  ///< entries have their second channel

  TexelFormat format() const { return green ? TexelFormat::rg32ui : TexelFormat::r32ui; }
  int entry_words() const { return green ? 2 : 1; }
  bool two_levels() const { return sub_edge > 1; }
  int levels() const { return tree ? static_cast<int>(tree->stages().size()) : two_levels() ? 2 : 1; }
  Part top_part() const { return texture_part("tex_page_table", "entries of the table", format(), top); }
  Part sub_part() const {
    const std::int64_t used = subtables * sub_edge * sub_edge * sub_edge;
    return texture_part("tex_page_subtables", "entries of sub-tables", format(), sub_layout.texels())
        .holding({.topology = used})
        .when(two_levels());
  }
  Part nodes_part() const {
    const CheckedSize words = tree ? CheckedSize(tree->entries()) * CheckedSize(entry_words()) : CheckedSize();
    return buffer_part("page_nodes", "entries of sub-tables", TexelFormat::r32ui, words.or_most()).when(levels() > 1 && tree);
  }
  Part stages_part() const {
    return buffer_part("page_stages", "widths of sub-tables", TexelFormat::rg32ui, levels() - 1).when(levels() > 1 && tree);
  }
  std::int64_t stages_bytes() const { return stages_part().present ? stages_part().bytes() : 0; }
  std::int64_t bytes() const {
    CheckedSize all;
    for (const Part& part : {top_part(), sub_part(), nodes_part(), stages_part()})
      if (part.present) all += part.bytes();
    return all.or_most();
  }
};

/// Chooses the table's form from boxes alone.
class TablePlanner {
 public:
  /// `green`: do entries have their second channel?
  TablePlanner(const AmrHierarchy& h, const Division& division, const BuildRequest& request, bool green)
      : hierarchy_(h), division_(division), request_(request), finest_(division.finest_level()), green_(green) {}

  /// `page_bytes`: what all pages would take.
  TablePlan plan(const std::vector<Page>& pages, std::int64_t page_bytes) const {
    const std::int64_t enough = std::max(kSmallTableBytes, page_bytes);
    std::optional<TablePlan> best = one_level();
    if (!best || best->bytes() > enough) take_smaller(best, two_levels());
    if (!best || best->bytes() > enough) take_smaller(best, tree(pages));
    if (!best) refuse();
    return *best;
  }

 private:
  static void take_smaller(std::optional<TablePlan>& best, std::optional<TablePlan> other) {
    if (other && (!best || other->bytes() < best->bytes())) best = std::move(other);
  }

  int limit() const { return request_.context.max_3d_texture_size; }
  std::int64_t entry_bytes() const { return green_ ? 8 : 4; }
  /// Entries along each axis, one a page of a level, while ints hold them and the widths of pages.
  std::optional<Vec3i> entries_along(int level) const {
    if (std::int64_t{division_.page_size()} * hierarchy_.cell_width(level) > std::numeric_limits<int>::max()) return std::nullopt;
    const Vec3d n =
        Vec3d(division_.pages_along(0)) * static_cast<double>(hierarchy_.cell_width(0) / hierarchy_.cell_width(level));
    return std::max({n.x, n.y, n.z}) <= limit() ? std::optional(Vec3i(n)) : std::nullopt;
  }
  TablePlan with_top(int level, const Vec3i& top) const {
    TablePlan plan;
    plan.green = green_;
    plan.finest_level = finest_;
    plan.top_level = level;
    plan.top = top;
    plan.entry_width = division_.page_size() * hierarchy_.cell_width(level);
    return plan;
  }

  std::optional<TablePlan> one_level() const {
    const auto top = entries_along(finest_);
    if (!top) return std::nullopt;
    TablePlan plan = with_top(finest_, *top);
    if (plan.bytes() > std::min(kMaxTableBytes, request_.memory_limit)) return std::nullopt;
    return plan;
  }

  /// The first level has one entry for each page of some level; those that are divided further point to a sub-table.
  std::optional<TablePlan> two_levels() const {
    std::optional<TablePlan> best;
    for (int level = finest_ - 1; level >= 0; --level) {
      const auto top = entries_along(level);
      const int edge = hierarchy_.cell_width(level) / hierarchy_.cell_width(finest_);
      PoolLayout layout;
      if (!top || edge > limit() || !lay_out(division_.divided_count(level), edge, limit(), layout)) continue;
      TablePlan plan = with_top(level, *top);
      plan.sub_edge = edge;
      plan.subtables = division_.divided_count(level);
      plan.sub_layout = layout;
      if (!best || used_bytes(plan) < used_bytes(*best)) best = plan;
    }
    return best;
  }
  std::int64_t used_bytes(const TablePlan& plan) const {
    const std::int64_t edge = plan.sub_edge;
    return (Box{Vec3i(0), plan.top}.cells() + plan.subtables * edge * edge * edge) * entry_bytes();
  }

  std::optional<TablePlan> tree(const std::vector<Page>& pages) const {
    TablePlan plan;
    plan.green = green_;
    plan.tree = TableTree::over(hierarchy_, division_, pages, limit());
    if (!plan.tree) return std::nullopt;
    plan.finest_level = finest_;
    plan.entry_width = plan.tree->stages().front().width;
    plan.top = plan.tree->top();
    plan.subtables = plan.tree->subtables();
    if (plan.levels() > 1 && plan.nodes_part().bytes() > request_.context.max_buffer_bytes) return std::nullopt;
    return plan;
  }

  [[noreturn]] void refuse() const {
    const Vec3d one =
        Vec3d(division_.pages_along(0)) * static_cast<double>(hierarchy_.cell_width(0) / hierarchy_.cell_width(finest_));
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: a table of {:.0f} x {:.0f} x {:.0f} entries, and no split in levels "
                    "fits a 3D texture of {} texels an axis and a buffer of {} bytes; a larger page_size needs fewer entries",
                    division_.page_size(), one.x, one.y, one.z, limit(), request_.context.max_buffer_bytes));
  }

  const AmrHierarchy& hierarchy_;
  const Division& division_;
  const BuildRequest& request_;
  int finest_;
  bool green_;
};

}  // namespace amrtex::pages
