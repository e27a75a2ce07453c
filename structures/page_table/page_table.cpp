#include "page_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "page_partition.hpp"
#include "page_reader.hpp"
#include "page_table_layout.h"
#include "page_writer.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"

namespace amrtex {
namespace {

using namespace pages;

constexpr std::array<Filter, 3> kFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};

/// Texels of the pool by role: cells inside the domain, and copies of others.
MemoryByRole texels_by_role(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages) {
  MemoryByRole texels;
  for (const Page& p : pages) {
    if (p.kind != AMRTEX_PAGE_STORED) continue;
    const Vec3i first = p.index_in_level * o.page_size;
    texels.payload += intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    texels.duplicated += o.page_texels() - o.page_cells();
  }
  return texels;
}

/// Counts of pages, and where they go.
struct Sizes {
  std::int64_t stored = 0, constant = 0, pruned = 0;
  TablePlan table;
  PoolLayout pool;
};

class PageTable final : public Encoding {
 public:
  std::string_view name() const override { return "page_table"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"page_size", "cells along the edge of a page", 16, choices({4, 8, 16, 32, 64, 128}), {4, 8, 16, 32, 64}},
            {"centring",
             "what a texel of a page is: a cell, or a vertex (then the filter is linear_vertex)",
             "cell",
             choices({"cell", "node"}),
             {"cell", "node"}}};
  }
  Support level_of_detail() const override {
    return {false, "a page is stored at the finest level that it holds, and at no other"};
  }
  bool prunes() const override { return true; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters, const SceneNeeds& needs) const;
  Sizes sizes(const AmrHierarchy& h, const BuildRequest& request, const Options& o, std::vector<Page>& pages) const;
  Layout layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Sizes& s,
                const std::vector<Page>& pages) const;
};

Options PageTable::options(const Json& parameters, const SceneNeeds& needs) const {
  const Filter filter = needs.filter;
  Options o{};
  o.page_size = parameters.at("page_size").get<int>();
  o.nodes = parameters.at("centring") == "node";
  if (o.nodes != (filter == Filter::linear_vertex))
    throw UnsupportedError(
        fmt::format("encoding page_table: centring {} has no filter {}; centring cell has nearest, linear_page and centring node "
                    "has linear_vertex",
                    o.nodes ? "node" : "cell", filter_name(filter)));
  o.border = filter == Filter::linear_page || (needs.keeps_border() && !o.nodes) ? 1 : 0;
  o.edge = o.nodes ? o.page_size + 1 : o.page_size + 2 * o.border;
  return o;
}

/// Reads all pages, and lays out what they need.
Sizes PageTable::sizes(const AmrHierarchy& h, const BuildRequest& request, const Options& o, std::vector<Page>& pages) const {
  Sizes s;
  s.stored = number_pages(h, request, o, pages);
  for (const Page& p : pages) {
    s.constant += p.kind == AMRTEX_PAGE_CONSTANT ? 1 : 0;
    s.pruned += p.pruned ? 1 : 0;
  }
  s.table = plan_table(h, pages, o.page_size, request, s.constant > 0);
  const int limit = request.context.max_3d_texture_size;
  if (!lay_out(std::max<std::int64_t>(s.stored, 1), o.edge, limit, s.pool))
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: {} pages of {}^3 texels do not fit a 3D texture of {} texels an axis",
                    o.page_size, s.stored, o.edge, limit));
  if (s.stored > kMostPages)
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: {} pages, an entry of the table numbers at most {}", o.page_size,
                    s.stored, kMostPages));
  return s;
}

Layout PageTable::layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Sizes& s,
                         const std::vector<Page>& pages) const {
  Layout layout(*this, request);
  const bool validity = any_missing(h, request);
  const int fields = request.field_count();
  if (s.pruned > 0) {
    const std::int64_t bits = validity ? s.pruned * o.page_words() * fields * 4 : 0;
    layout.leave_out({"pages", "the transfer function hides all that is in them",
                      layout.value_bytes(s.pruned * o.page_texels()) + bits, Need::hidden});
  }
  layout.add(s.table.top_part());
  layout.add(s.table.sub_part());
  for (int number = 0; number < fields; ++number)
    layout.add(layout.values("tex_pages", number, s.pool.texels()).holding(texels_by_role(h, o, pages)));
  layout.add(buffer_part("page_validity", "validity bits", TexelFormat::r32ui, s.stored * fields * o.page_words())
                 .when(validity, "every cell has a value", Need::validity));
  if (!s.table.green)  // as large as the first
    layout.leave_out({"second channel of the table", "no region is skipped and no page is constant",
                      s.table.top_part().bytes() + (s.table.two_levels() ? s.table.sub_part().bytes() : 0), Need::value_ranges});
  if (!o.nodes && o.border == 0) {
    const std::int64_t with_border = std::int64_t{o.page_size + 2} * (o.page_size + 2) * (o.page_size + 2);
    layout.leave_out({"border layer", "the filter nearest reads one cell",
                      layout.value_bytes(s.stored * (with_border - o.page_cells())), Need::border});
  }
  layout.add(layout.more_ranges("page_more_ranges", s.stored));
  layout.add_working(static_cast<std::int64_t>(pages.size() * sizeof(Page)));
  layout.set_remedy(fmt::format("; page_size is {}, {} pages are stored", o.page_size, s.stored));
  return layout;
}

Json statistics(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const Sizes& s) {
  std::int64_t absent = 0;
  std::int64_t cells = 0;
  std::vector<std::int64_t> levels(static_cast<std::size_t>(h.level_count()));
  for (const Page& p : pages) {
    absent += p.kind == AMRTEX_PAGE_ABSENT ? 1 : 0;
    if (p.kind == AMRTEX_PAGE_STORED) {
      ++levels[static_cast<std::size_t>(p.level)];
      const Vec3i first = p.index_in_level * o.page_size;
      cells += intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    }
  }
  const double pages_cells = static_cast<double>(std::max<std::int64_t>(s.stored, 1) * o.page_cells());
  Json json;
  json["pages"] = s.stored;
  json["constant_pages"] = s.constant;
  json["absent_pages"] = absent;
  json["pruned_pages"] = s.pruned;
  json["pages_a_level"] = levels;
  json["page_texels"] = o.page_texels();
  json["border_overhead"] = static_cast<double>(s.stored * (o.page_texels() - o.page_cells())) / pages_cells;
  json["border_overhead_formula"] = static_cast<double>(o.page_texels()) / static_cast<double>(o.page_cells()) - 1;
  json["oversampling"] = static_cast<double>(cells) / static_cast<double>(h.leaf_cells());
  json["table_levels"] = s.table.two_levels() ? 2 : 1;
  json["table_entries"] = s.table.top_part().texels();
  json["subtables"] = s.table.subtables;
  return json;
}

void add_shader_inputs(const AmrHierarchy& h, const Options& o, const Sizes& size, EncodedField& field) {
  const TablePlan& table = size.table;
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_PAGE_SIZE", o.page_size);
  defines.emplace_back("AMRTEX_PAGE_BORDER", o.border);
  defines.emplace_back("AMRTEX_PAGE_EDGE", o.edge);
  defines.emplace_back("AMRTEX_PAGE_NODES", o.nodes ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_CONSTANTS", size.constant > 0 ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_TABLE_LEVELS", table.two_levels() ? 2 : 1);
  const Vec3i pool = size.pool.texels();
  defines.emplace_back("AMRTEX_POOL_X", pool.x);
  defines.emplace_back("AMRTEX_POOL_Y", pool.y);
  defines.emplace_back("AMRTEX_POOL_Z", pool.z);
  auto& uniforms = field.integer_uniforms;
  uniforms.emplace_back("u_page_table", Vec3i(o.page_size * h.cell_width(table.top_level), 0, 0));
  uniforms.emplace_back("u_pool_shift", size.pool.shift);
  if (!table.two_levels()) return;
  uniforms.emplace_back("u_subtable", Vec3i(table.sub_edge, o.page_size * h.cell_width(table.finest_level), 0));
  uniforms.emplace_back("u_subtable_shift", table.sub_layout.shift);
}

EncodedField PageTable::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_level_of_detail(*this, request.needs);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters, request.needs);
  if (h.level_count() > kMostLevels)
    throw UnsupportedError(
        fmt::format("encoding page_table: {} levels, an entry of the table tells at most {}", h.level_count(), kMostLevels));
  std::vector<Page> pages = partition(h, o.page_size);
  const Sizes size = sizes(h, request, o, pages);
  const Layout parts = layout(h, request, o, size, pages);
  parts.require_limits();
  parts.require_budget();

  EncodedField field = start_field(*this, h, request, parameters);
  if (request.needs.filter == Filter::linear_page) field.definition.page_size = o.page_size;
  parts.allocate(field);
  store_pages(h, request, o, size.pool, pages, field);  // and their ranges, which the table holds
  write_table(h, size.table, pages, field);
  field.statistics = statistics(h, o, pages, size);
  add_shader_inputs(h, o, size, field);
  if (request.needs.draw_boxes) set_draw_tree(field, PageDrawTree(h, o.page_size, pages).tree());
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_page_table() { return std::make_unique<PageTable>(); }

}  // namespace amrtex
