#include "page_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>

#include "page_draw_tree.hpp"
#include "page_partition.hpp"
#include "page_pool.hpp"
#include "page_reader.hpp"
#include "page_table_layout.h"
#include "page_table_plan.hpp"
#include "page_writer.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"

namespace amrtex {
namespace {

using namespace pages;

constexpr std::array<Filter, 3> kFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};

/// Texels of one texture of the pool by role: cells inside the domain, and copies of others.
MemoryByRole texels_by_role(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const PagePool& pool,
                            int texture) {
  MemoryByRole texels;
  for (const Page& p : pages) {
    if (p.kind != AMRTEX_PAGE_STORED || pool.texture_of(p.index) != texture) continue;
    const Vec3i first = p.index_in_level * o.page_size;
    texels.payload += intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    texels.duplicated += o.page_texels() - o.page_cells();
  }
  return texels;
}

/// Counts of pages, and where they go.
struct Sizes {
  std::int64_t stored = 0, constant = 0, pruned = 0;
  std::int64_t without_mesh = 0;  ///< pages of level 0 that are not listed
  TablePlan table;
  PagePool pool;
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
  FilterDefinition definition(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters, const SceneNeeds& needs) const;
  void require_pages(const BuildRequest& request, const Options& o, const Division& division) const;
  void require_least(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Division& division,
                     const std::vector<Page>& pages) const;
  Sizes sizes(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Division& division,
              std::vector<Page>& pages) const;
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

/// What all pages would take.
std::int64_t bytes_of_pages(const BuildRequest& request, const Options& o, std::int64_t pages) {
  return (CheckedSize(pages) * CheckedSize(o.page_texels()) * CheckedSize(request.field_count() * texel_bytes(request.storage)))
      .or_most();
}

TablePlan plan_table(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Division& division,
                     const std::vector<Page>& pages, bool constants) {
  return TablePlanner(h, division, request, request.needs.value_ranges || constants)
      .plan(pages, bytes_of_pages(request, o, std::ssize(pages)));
}

PagePool plan_pool(const BuildRequest& request, const Options& o, std::int64_t stored) {
  PagePool pool;
  if (!lay_out_pool(request, o.edge, stored, pool))
    throw UnsupportedError(fmt::format(
        "encoding page_table with page_size {}: {} pages of {}^3 texels do not fit {} 3D textures of {} texels an axis",
        o.page_size, stored, o.edge, pool.textures, request.context.max_3d_texture_size));
  return pool;
}

/// Bytes that all pages may take in any number of textures.
std::int64_t most_page_bytes(const BuildRequest& request) {
  const int textures = most_pool_textures(request.field_count()) * request.field_count();
  return std::min(request.memory_limit, (CheckedSize(request.context.max_texture_bytes) * textures).or_most());
}

std::string remedy(const Options& o, const Sizes& s, const std::string& stored) {
  return fmt::format("; page_size is {}, {} pages are stored, in {} textures a field", o.page_size, stored, s.pool.textures);
}

/// From the boxes of patches, before a page is listed.
void PageTable::require_pages(const BuildRequest& request, const Options& o, const Division& division) const {
  const std::int64_t pages = division.pages();
  if (pages <= kMostPages) return;
  throw UnsupportedError(fmt::format(
      "encoding page_table with page_size {}: {} pages (about {:.2g} bytes), an entry of the table numbers at most {}; a larger "
      "page_size needs fewer",
      o.page_size, pages, static_cast<double>(bytes_of_pages(request, o, pages)), kMostPages));
}

/// Where all pages would pass a limit: what surely are stored may do so, and nothing needs to be read to know it.
void PageTable::require_least(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Division& division,
                              const std::vector<Page>& pages) const {
  const std::int64_t most = most_page_bytes(request);
  if (bytes_of_pages(request, o, std::ssize(pages)) <= most) return;
  Sizes least;
  const std::int64_t enough = most / bytes_of_pages(request, o, 1);
  least.stored = count_surely_stored(SurelyStored(h, request, o), pages, enough);
  least.table = plan_table(h, request, o, division, pages, false);
  least.pool = plan_pool(request, o, least.stored);
  Layout parts = layout(h, request, o, least, pages);
  parts.set_remedy(remedy(o, least, fmt::format("at least {} of {}", least.stored, pages.size())));
  parts.require_limits();
  parts.require_budget();
}

/// Reads all pages, and lays out what they need.
Sizes PageTable::sizes(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Division& division,
                       std::vector<Page>& pages) const {
  Sizes s;
  s.without_mesh = pages_without_mesh(division);
  s.stored = number_pages(h, request, o, pages);
  for (const Page& p : pages) {
    s.constant += p.kind == AMRTEX_PAGE_CONSTANT ? 1 : 0;
    s.pruned += p.pruned ? 1 : 0;
  }
  s.table = plan_table(h, request, o, division, pages, s.constant > 0);
  s.pool = plan_pool(request, o, s.stored);
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
  layout.add(s.table.nodes_part());
  layout.add(s.table.stages_part());
  for (int texture = 0; texture < s.pool.textures; ++texture) {
    const MemoryByRole texels = texels_by_role(h, o, pages, s.pool, texture);
    for (int number = 0; number < fields; ++number)
      layout.add(layout.values("tex_pages", texture * fields + number, s.pool.layout.texels()).holding(texels));
  }
  layout.add(buffer_part("page_validity", "validity bits", TexelFormat::r32ui, s.stored * fields * o.page_words())
                 .when(validity, "every cell has a value", Need::validity));
  if (!s.table.green)  // as large as the first
    layout.leave_out({"second channel of the table", "no region is skipped and no page is constant",
                      s.table.bytes() - s.table.stages_bytes(), Need::value_ranges});
  if (!o.nodes && o.border == 0) {
    const std::int64_t with_border = std::int64_t{o.page_size + 2} * (o.page_size + 2) * (o.page_size + 2);
    layout.leave_out({"border layer", "the filter nearest reads one cell",
                      layout.value_bytes(s.stored * (with_border - o.page_cells())), Need::border});
  }
  layout.add(layout.more_ranges("page_more_ranges", s.stored));
  layout.add_working(static_cast<std::int64_t>(pages.size() * sizeof(Page)));
  layout.set_remedy(remedy(o, s, std::to_string(s.stored)));
  return layout;
}

Json statistics(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const Sizes& s) {
  std::int64_t absent = s.without_mesh;
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
  json["pool_textures"] = s.pool.textures;
  json["border_overhead"] = static_cast<double>(s.stored * (o.page_texels() - o.page_cells())) / pages_cells;
  json["border_overhead_formula"] = static_cast<double>(o.page_texels()) / static_cast<double>(o.page_cells()) - 1;
  json["oversampling"] = static_cast<double>(cells) / static_cast<double>(h.leaf_cells());
  json["table_levels"] = s.table.levels();
  json["table_entries"] = s.table.top_part().texels();
  json["subtables"] = s.table.subtables;
  return json;
}

LeapGrid leap_grid(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const EncodedField& field) {
  LeapGrid grid = LeapGrid::over(h);
  for (const Page& p : pages) {
    if (p.kind == AMRTEX_PAGE_ABSENT) continue;
    const double constant = field.scale.units.value(static_cast<double>(std::bit_cast<float>(p.green)));
    const bool stored = p.kind == AMRTEX_PAGE_STORED;  // then its range stands in the table
    const Box cells = intersection(Box{p.index_in_level, p.index_in_level + Vec3i(1)}.refined(o.page_size), h.domain(p.level));
    grid.cover(cells.refined(h.cell_width(p.level)), stored ? p.green : encode_range(field, 0, {constant, constant}));
  }
  return grid;
}

void add_shader_inputs(const AmrHierarchy& h, const Options& o, const Sizes& size, EncodedField& field) {
  const TablePlan& table = size.table;
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_PAGE_SIZE", o.page_size);
  defines.emplace_back("AMRTEX_PAGE_BORDER", o.border);
  defines.emplace_back("AMRTEX_PAGE_EDGE", o.edge);
  defines.emplace_back("AMRTEX_PAGE_NODES", o.nodes ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_CONSTANTS", size.constant > 0 ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_TABLE_LEVELS", table.levels());
  defines.emplace_back("AMRTEX_PAGE_TABLE_TREE", table.tree && table.levels() > 1 ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_ENTRY_WORDS", table.entry_words());
  const Vec3i pool = size.pool.layout.texels();
  defines.emplace_back("AMRTEX_POOL_TEXTURES", size.pool.textures);
  defines.emplace_back("AMRTEX_POOL_X", pool.x);
  defines.emplace_back("AMRTEX_POOL_Y", pool.y);
  defines.emplace_back("AMRTEX_POOL_Z", pool.z);
  auto& uniforms = field.integer_uniforms;
  uniforms.emplace_back("u_page_table", Vec3i(table.entry_width, 0, 0));
  uniforms.emplace_back("u_pool_shift", size.pool.layout.shift);
  if (size.pool.textures > 1) uniforms.emplace_back("u_pool_pages", Vec3i(static_cast<int>(size.pool.pages), 0, 0));
  if (!table.two_levels()) return;
  uniforms.emplace_back("u_subtable", Vec3i(table.sub_edge, o.page_size * h.cell_width(table.finest_level), 0));
  uniforms.emplace_back("u_subtable_shift", table.sub_layout.shift);
}

FilterDefinition PageTable::definition(const AmrHierarchy& /*hierarchy*/, const BuildRequest& request) const {
  const bool pages = request.needs.filter == Filter::linear_page;
  return {.filter = request.needs.filter,
          .page_size = pages ? complete_parameters(*this, request.parameters).at("page_size").get<int>() : 0};
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
  const Division division(h, o.page_size);
  require_pages(request, o, division);
  std::vector<Page> pages = partition(division);
  require_least(h, request, o, division, pages);
  const Sizes size = sizes(h, request, o, division, pages);
  const Layout parts = layout(h, request, o, size, pages);
  parts.require_limits();
  parts.require_budget();

  EncodedField field = start_field(*this, h, request, parameters);
  parts.allocate(field);
  store_pages(h, request, o, size.pool, pages, field);  // and their ranges, which the table holds
  write_table(h, size.table, pages, field);
  field.statistics = statistics(h, o, pages, size);
  add_shader_inputs(h, o, size, field);
  if (request.needs.value_ranges) field.leaps = leap_grid(h, o, pages, field);
  if (request.needs.draw_boxes) set_draw_tree(field, PageDrawTree(h, division, pages).tree());
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_page_table() { return std::make_unique<PageTable>(); }

}  // namespace amrtex
