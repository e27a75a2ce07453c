#include "page_table.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <set>

#include "page_table_layout.h"
#include "structures/build_tools.hpp"
#include "structures/level_values.hpp"
#include "structures/vertex_values.hpp"

namespace amrtex {
namespace {

constexpr std::array<Filter, 3> kFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};

/// One-level tables stay below this; a larger one is split in two levels.
constexpr std::int64_t kMaxTableBytes = std::int64_t{256} << 20;
/// Texture axes beyond this cost bits of the normalised coordinate (hardware filtering).
constexpr int kPreferredPoolEdge = 1024;
constexpr int kEntryBytes = 8;

struct Options {
  int page_size;
  bool nodes;
  int border;  ///< texels before the first cell of a page
  int edge;    ///< texels along the edge of a stored page
  std::int64_t page_texels() const { return std::int64_t{edge} * edge * edge; }
  std::int64_t page_cells() const { return std::int64_t{page_size} * page_size * page_size; }
};

/// A final page of the partition: where it lies, and what became of it.
struct Page {
  int level;
  Vec3i index;  ///< in pages of its level
  int kind = AMRTEX_PAGE_ABSENT;
  std::uint32_t code = 0;  ///< index in the pool, or the constant's bits
  ValueRange range;
};

struct Entry {
  std::uint32_t red;
  std::uint32_t green;
};
static_assert(sizeof(Entry) == kEntryBytes);

Entry entry_of(const Page& page) {
  return {page.code, static_cast<std::uint32_t>(page.level) | (static_cast<std::uint32_t>(page.kind) << AMRTEX_PAGE_KIND_SHIFT)};
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

/// False when the blocks do not fit into one texture of at most `limit` texels an axis.
bool lay_out(std::int64_t blocks, int edge, int limit, PoolLayout& layout) {
  for (int most : {std::min(limit, kPreferredPoolEdge), limit})
    for (int bits = 0; bits < 40; ++bits) {
      const PoolLayout l{{(bits + 1) / 2, bits / 2, 0}, static_cast<int>(std::min<std::int64_t>((blocks + (std::int64_t{1} << bits) - 1) >> bits, 1 << 30)), edge};
      if (static_cast<std::int64_t>(edge) << l.shift.x > most) break;
      if (std::int64_t{edge} * l.layers > most) continue;
      layout = l;
      layout.layers = std::max(layout.layers, 1);
      return true;
    }
  return false;
}

/// The partition of section 4.1: a page is divided until no leaf in its box is finer than its level.
std::vector<Page> partition(const AmrHierarchy& h, int page_size) {
  std::vector<Page> pages;
  const auto descend = [&](auto&& self, int level, const Vec3i& index) -> void {
    const Box box{index * page_size, (index + Vec3i(1)) * page_size};
    const Box inside = intersection(box, h.domain(level));
    if (inside.empty()) return;
    if (!h.refined_within(level, inside)) {
      pages.push_back({.level = level, .index = index, .range = {}});
      return;
    }
    const int r = h.ratio_to_finer(level);
    for_each_cell(Box{index, index + Vec3i(1)}.refined(r), [&](const Vec3i& child) { self(self, level + 1, child); });
  };
  for_each_cell({Vec3i(0), ceil_div(h.cells(0), page_size)}, [&](const Vec3i& index) { descend(descend, 0, index); });
  return pages;
}

/// The table: entries of the finest pages' size, in one level or two.
struct TablePlan {
  int finest_level = 0;     ///< of any page
  int top_level = 0;        ///< whose pages have one entry each in the first level of the table
  Vec3i top{1};             ///< entries of the first level
  int sub_edge = 1;         ///< entries along the edge of a sub-table; 1: one level
  std::int64_t subtables = 0;
  PoolLayout sub_layout;
  bool two_levels() const { return sub_edge > 1; }
  std::int64_t top_bytes() const { return std::int64_t{top.x} * top.y * top.z * kEntryBytes; }
  std::int64_t sub_bytes() const {
    const Vec3i t = sub_layout.texels();
    return two_levels() ? std::int64_t{t.x} * t.y * t.z * kEntryBytes : 0;
  }
};

std::int64_t entries(const Vec3d& n) { return static_cast<std::int64_t>(std::min(n.x * n.y * n.z, 1e18)); }

TablePlan plan_table(const AmrHierarchy& h, const std::vector<Page>& pages, int page_size, const BuildRequest& request) {
  TablePlan plan;
  for (const Page& p : pages) plan.finest_level = std::max(plan.finest_level, p.level);
  const Vec3i roots = ceil_div(h.cells(0), page_size);
  const int limit = request.context.max_3d_texture_size;
  const auto top_of = [&](int level) { return Vec3d(roots) * static_cast<double>(h.cell_width(0) / h.cell_width(level)); };
  const auto fits = [&](const Vec3d& n) { return std::max({n.x, n.y, n.z}) <= limit; };

  const Vec3d one = top_of(plan.finest_level);
  plan.top_level = plan.finest_level;
  if (fits(one) && entries(one) * kEntryBytes <= std::min(kMaxTableBytes, request.memory_limit)) {
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
        const Vec3i i = p.index / (h.cell_width(level) / h.cell_width(p.level));
        divided.insert({i.x, i.y, i.z});
      }
    PoolLayout layout;
    const auto count = static_cast<std::int64_t>(divided.size());
    if (edge > limit || !lay_out(count, edge, limit, layout)) continue;
    const std::int64_t bytes = entries(top) * kEntryBytes + count * kEntryBytes * edge * edge * edge;
    if (bytes >= best) continue;
    best = bytes;
    plan.top_level = level;
    plan.top = Vec3i(top);
    plan.sub_edge = edge;
    plan.subtables = count;
    plan.sub_layout = layout;
  }
  if (!plan.two_levels())
    throw UnsupportedError(fmt::format("encoding page_table with page_size {}: a table of {:.0f} x {:.0f} x {:.0f} entries, and no split in two levels "
                                       "fits a 3D texture of {} texels an axis; a larger page_size needs fewer entries",
                                       page_size, one.x, one.y, one.z, limit));
  return plan;
}

/// Values of one page as they will be stored.
class PageReader {
 public:
  PageReader(const AmrHierarchy& h, const BuildRequest& request, const Options& options)
      : hierarchy_(h), request_(request), options_(options), values_(static_cast<std::size_t>(options.page_texels())), missing_(values_.size()) {}

  /// Fills values() and the page's kind, range and constant.
  void read(Page& page) {
    const Vec3i first = page.index * options_.page_size;
    const Box cells{first, first + Vec3i(options_.page_size)};
    box_ = options_.nodes ? Box{first, first + Vec3i(options_.edge)} : cells.grown(options_.border);
    if (options_.nodes) {
      vertex_values(hierarchy_, request_.field, page.level, box_, values_);
      if (hierarchy_.has_missing(request_.field)) mark_missing(page.level, cells);
    } else {
      filled_level_values(hierarchy_, request_.field, page.level, box_, values_, missing_);
    }
    classify(page, cells);
  }
  std::span<const double> values() const { return values_; }

  /// Sets the bit of each cell of the page that has a value.
  void write_validity(const Page& page, std::uint32_t* words) const {
    const Vec3i first = page.index * options_.page_size;
    std::int64_t bit = 0;
    const Box domain = hierarchy_.domain(page.level);
    for_each_cell({first, first + Vec3i(options_.page_size)}, [&](const Vec3i& c) {
      if (domain.contains(c) && !is_missing(c)) set_bit(words, bit);
      ++bit;
    });
  }

 private:
  /// In a node-centred page the missing flags belong to cells and stand at their lower vertex.
  bool is_missing(const Vec3i& cell) const { return missing_[box_.offset(cell)] != 0; }

  void mark_missing(int level, const Box& cells) {
    std::vector<double> own(static_cast<std::size_t>(cells.cells()));
    level_values(hierarchy_, request_.field, level, cells, own);
    std::fill(missing_.begin(), missing_.end(), std::uint8_t{0});
    std::size_t i = 0;
    for_each_cell(cells, [&](const Vec3i& c) { missing_[box_.offset(c)] = std::isnan(own[i++]) ? 1 : 0; });
  }

  void classify(Page& page, const Box& cells) {
    page.range = {};
    for (double v : values_) page.range.add(v);
    const Box inside = intersection(cells, hierarchy_.domain(page.level));
    bool any = false;
    bool all = true;
    if (hierarchy_.has_missing(request_.field)) {
      for_each_cell(inside, [&](const Vec3i& c) { (is_missing(c) ? all : any) = !is_missing(c); });
    } else {
      any = true;
    }
    page.kind = AMRTEX_PAGE_STORED;
    if (!any) page.kind = AMRTEX_PAGE_ABSENT;
    else if (all && page.range.min == page.range.max && constant_is_exact(page.range.min)) {
      page.kind = AMRTEX_PAGE_CONSTANT;
      page.code = std::bit_cast<std::uint32_t>(static_cast<float>(page.range.min));
    }
  }

  /// The table holds a float: what it would lose, a page of the same storage must lose as well.
  bool constant_is_exact(double v) const { return request_.storage == Storage::r32f || static_cast<double>(static_cast<float>(v)) == v; }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Options& options_;
  Box box_;
  std::vector<double> values_;
  std::vector<std::uint8_t> missing_;
};

struct Sizes {
  std::int64_t stored = 0;
  PoolLayout pool;
  std::int64_t pool_texels() const {
    const Vec3i t = pool.texels();
    return std::int64_t{t.x} * t.y * t.z;
  }
};

class PageTable final : public Encoding {
 public:
  std::string_view name() const override { return "page_table"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"page_size", "cells along the edge of a page", 16, "4, 8, 16, 32, 64 or 128"},
            {"centring", "what a texel of a page is: a cell, or a vertex (then the filter is linear_vertex)", "cell", "\"cell\" or \"node\""}};
  }
  Support supported(const ContextInfo&) const override { return {}; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters, Filter filter) const;
  Sizes sizes(std::int64_t stored, const Options& o, const TablePlan& table, bool validity, const BuildRequest& request) const;
};

Options PageTable::options(const Json& parameters, Filter filter) const {
  Options o{};
  o.page_size = integer_parameter(*this, parameters, "page_size");
  if (o.page_size < 4 || o.page_size > 128 || !std::has_single_bit(static_cast<unsigned>(o.page_size)))
    throw UsageError(fmt::format("encoding page_table: parameter page_size is {}; accepted: 4, 8, 16, 32, 64 or 128", o.page_size));
  const Json& centring = parameters.at("centring");
  if (centring != "cell" && centring != "node")
    throw UsageError(fmt::format("encoding page_table: parameter centring is {}; accepted: \"cell\" or \"node\"", centring.dump()));
  o.nodes = centring == "node";
  if (o.nodes != (filter == Filter::linear_vertex))
    throw UnsupportedError(fmt::format("encoding page_table: centring {} has no filter {}; centring cell has nearest, linear_page and centring node has linear_vertex",
                                       centring.get<std::string>(), filter_name(filter)));
  o.border = filter == Filter::linear_page ? 1 : 0;
  o.edge = o.nodes ? o.page_size + 1 : o.page_size + 2 * o.border;
  return o;
}

/// Exact bytes of a build with so many stored pages; throws when they pass a limit.
Sizes PageTable::sizes(std::int64_t stored, const Options& o, const TablePlan& table, bool validity, const BuildRequest& request) const {
  Sizes s;
  s.stored = stored;
  const int limit = request.context.max_3d_texture_size;
  if (!lay_out(std::max<std::int64_t>(stored, 1), o.edge, limit, s.pool))
    throw UnsupportedError(fmt::format("encoding page_table with page_size {}: {} pages of {}^3 texels do not fit a 3D texture of {} texels an axis",
                                       o.page_size, stored, o.edge, limit));
  const std::int64_t validity_bytes = validity ? stored * o.page_cells() / 8 : 0;
  const std::int64_t range_bytes = request.needs.value_ranges ? 8 * stored : 0;
  for (std::int64_t buffer : {validity_bytes, range_bytes})
    if (buffer > request.context.max_buffer_bytes)
      throw UnsupportedError(fmt::format("encoding page_table with page_size {}: a buffer of {} bytes, this context has at most {}", o.page_size,
                                         buffer, request.context.max_buffer_bytes));
  require_budget(*this, s.pool_texels() * texel_bytes(request.storage) + table.top_bytes() + table.sub_bytes() + validity_bytes + range_bytes, request);
  return s;
}

void write_page(const Options& o, const PoolLayout& pool, std::int64_t index, Storage storage, StorageScale scale, std::span<const double> values,
                HostTexture& texture) {
  const Vec3i at = pool.position(index);
  const Box all{Vec3i(0), texture.size};
  const auto edge = static_cast<std::size_t>(o.edge);
  for (int z = 0; z < o.edge; ++z)
    for (int y = 0; y < o.edge; ++y)
      store_values(storage, scale, &values[edge * (static_cast<std::size_t>(y) + edge * static_cast<std::size_t>(z))], edge, texture.data.data(),
                   all.offset(at + Vec3i(0, y, z)));
}

/// Reads every page to learn what is absent or constant, then numbers the stored ones.
std::int64_t number_pages(const AmrHierarchy& h, const BuildRequest& request, const Options& o, std::vector<Page>& pages) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageReader reader(h, request, o);
    for (std::size_t i = range.begin(); i != range.end(); ++i) reader.read(pages[i]);
  });
  std::int64_t stored = 0;
  for (Page& p : pages)
    if (p.kind == AMRTEX_PAGE_STORED) p.code = static_cast<std::uint32_t>(stored++);
  return stored;
}

/// Writes the entries of one page into a table (first level or sub-table) whose entries are
/// pages of `table_level`; `origin` is the table's first entry, in pages of that level.
void write_entries(const AmrHierarchy& h, const Page& page, int table_level, const Box& table, HostTexture& texture, const Vec3i& at) {
  const int r = h.cell_width(page.level) / h.cell_width(table_level);
  const Box all{Vec3i(0), texture.size};
  for_each_cell(intersection(Box{page.index, page.index + Vec3i(1)}.refined(r), table),
                [&](const Vec3i& i) { texture.as<Entry>()[all.offset(i - table.lower + at)] = entry_of(page); });
}

std::vector<HostTexture> make_table(const AmrHierarchy& h, const TablePlan& plan, const std::vector<Page>& pages) {
  std::vector<HostTexture> textures;
  textures.push_back(make_texture("tex_page_table", TexelFormat::rg32ui, plan.top));
  if (plan.two_levels()) textures.push_back(make_texture("tex_page_subtables", TexelFormat::rg32ui, plan.sub_layout.texels()));
  HostTexture& top = textures[0];
  const Box top_box{Vec3i(0), plan.top};
  std::uint32_t next = 0;
  for (const Page& page : pages) {
    if (page.level <= plan.top_level) {
      write_entries(h, page, plan.top_level, top_box, top, Vec3i(0));
      continue;
    }
    const Vec3i owner = page.index / (h.cell_width(plan.top_level) / h.cell_width(page.level));
    Entry& entry = top.as<Entry>()[top_box.offset(owner)];
    if ((entry.green >> AMRTEX_PAGE_KIND_SHIFT) != AMRTEX_PAGE_SUBTABLE) entry = {next++, AMRTEX_PAGE_SUBTABLE << AMRTEX_PAGE_KIND_SHIFT};
    const Box sub = Box{owner, owner + Vec3i(1)}.refined(plan.sub_edge);
    write_entries(h, page, plan.finest_level, sub, textures[1], plan.sub_layout.position(entry.red));
  }
  for (HostTexture& t : textures) t.roles.topology = t.bytes();
  if (plan.two_levels()) {
    const std::int64_t used = plan.subtables * kEntryBytes * plan.sub_edge * plan.sub_edge * plan.sub_edge;
    textures[1].roles = {0, 0, used, textures[1].bytes() - used};
  }
  return textures;
}

/// Bytes of the pool by role: cells inside the domain, copies of others, and what no value needs.
MemoryByRole pool_roles(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const HostTexture& pool) {
  MemoryByRole roles;
  const int bytes = texel_bytes(pool.format);
  for (const Page& p : pages) {
    if (p.kind != AMRTEX_PAGE_STORED) continue;
    const Vec3i first = p.index * o.page_size;
    const std::int64_t own = intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    roles.payload += own * bytes;
    roles.duplicated += (o.page_texels() - o.page_cells()) * bytes;
    roles.padding += (o.page_cells() - own) * bytes;
  }
  roles.padding = pool.bytes() - roles.payload - roles.duplicated;
  return roles;
}

Json statistics(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const TablePlan& table, std::int64_t stored) {
  std::int64_t constant = 0;
  std::int64_t absent = 0;
  std::int64_t cells = 0;
  std::vector<std::int64_t> levels(static_cast<std::size_t>(h.level_count()));
  for (const Page& p : pages) {
    constant += p.kind == AMRTEX_PAGE_CONSTANT ? 1 : 0;
    absent += p.kind == AMRTEX_PAGE_ABSENT ? 1 : 0;
    if (p.kind == AMRTEX_PAGE_STORED) {
      ++levels[static_cast<std::size_t>(p.level)];
      const Vec3i first = p.index * o.page_size;
      cells += intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    }
  }
  const double pages_cells = static_cast<double>(std::max<std::int64_t>(stored, 1) * o.page_cells());
  Json json;
  json["pages"] = stored;
  json["constant_pages"] = constant;
  json["absent_pages"] = absent;
  json["pages_a_level"] = levels;
  json["page_texels"] = o.page_texels();
  json["border_overhead"] = static_cast<double>(stored * (o.page_texels() - o.page_cells())) / pages_cells;
  json["oversampling"] = static_cast<double>(cells) / static_cast<double>(h.leaf_cells());
  json["table_levels"] = table.two_levels() ? 2 : 1;
  json["table_entries"] = table.top_bytes() / kEntryBytes;
  json["subtables"] = table.subtables;
  return json;
}

EncodedField PageTable::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters, request.needs.filter);
  const bool validity = h.has_missing(request.field);
  std::vector<Page> pages = partition(h, o.page_size);
  const TablePlan table = plan_table(h, pages, o.page_size, request);
  const std::int64_t stored = number_pages(h, request, o, pages);
  const Sizes size = sizes(stored, o, table, validity, request);

  EncodedField field = start_field(*this, h, request, parameters);
  if (request.needs.filter == Filter::linear_page) field.definition.page_size = o.page_size;
  HostTexture pool = make_texture("tex_pages", request.storage, size.pool.texels());
  pool.hardware_linear = field.filtering == Filtering::hardware;
  pool.holds_values = true;
  HostTexture bits = validity ? make_buffer("page_validity", TexelFormat::r32ui, stored * o.page_cells() / 32) : HostTexture{};
  HostTexture ranges = request.needs.value_ranges ? make_buffer("page_ranges", TexelFormat::rg32f, stored) : HostTexture{};
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageReader reader(h, request, o);
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      if (pages[i].kind != AMRTEX_PAGE_STORED) continue;
      Page page = pages[i];
      reader.read(page);
      const std::int64_t index = pages[i].code;
      write_page(o, size.pool, index, request.storage, field.scale, reader.values(), pool);
      if (validity) reader.write_validity(page, bits.as<std::uint32_t>() + index * o.page_cells() / 32);
      if (request.needs.value_ranges) store_range(page.range, request.storage, field.scale, ranges.as<float>() + 2 * index);
    }
  });
  pool.roles = pool_roles(h, o, pages, pool);

  field.statistics = statistics(h, o, pages, table, stored);
  const bool constants = field.statistics["constant_pages"] != 0;
  for (const auto& [name, value] : std::initializer_list<std::pair<const char*, int>>{{"AMRTEX_PAGE_SIZE", o.page_size},
                                                                                       {"AMRTEX_PAGE_BORDER", o.border},
                                                                                       {"AMRTEX_PAGE_EDGE", o.edge},
                                                                                       {"AMRTEX_PAGE_NODES", o.nodes ? 1 : 0},
                                                                                       {"AMRTEX_PAGE_CONSTANTS", constants ? 1 : 0},
                                                                                       {"AMRTEX_PAGE_TABLE_LEVELS", table.two_levels() ? 2 : 1}})
    field.shader.defines.emplace_back(name, value);
  field.integer_uniforms = {{"u_page_table", Vec3i(o.page_size * h.cell_width(table.top_level), 0, 0)},
                            {"u_pool_shift", size.pool.shift},
                            {"u_pool_texels", pool.size}};
  if (table.two_levels()) {
    field.integer_uniforms.emplace_back("u_subtable", Vec3i(table.sub_edge, o.page_size * h.cell_width(table.finest_level), 0));
    field.integer_uniforms.emplace_back("u_subtable_shift", table.sub_layout.shift);
  }
  field.textures = make_table(h, table, pages);
  field.textures.push_back(std::move(pool));
  if (validity) field.textures.push_back(std::move(bits));
  else field.left_out.push_back({"validity bits", "every cell has a value", stored * o.page_cells() / 8});
  if (request.needs.value_ranges) field.textures.push_back(std::move(ranges));
  else field.left_out.push_back({"value ranges", "no region is skipped", 8 * stored});
  if (!o.nodes && o.border == 0) {
    const std::int64_t with_border = std::int64_t{o.page_size + 2} * (o.page_size + 2) * (o.page_size + 2);
    field.left_out.push_back({"border layer", "the filter nearest reads one cell", stored * (with_border - o.page_cells()) * texel_bytes(request.storage)});
  }
  field.host_peak_bytes = field.memory().total() + static_cast<std::int64_t>(pages.size() * sizeof(Page));
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_page_table() { return std::make_unique<PageTable>(); }

}  // namespace amrtex
