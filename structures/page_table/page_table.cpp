#include "page_table.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "page_table_layout.h"
#include "structures/common/build_tools.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex {
namespace {

constexpr std::array<Filter, 3> kFilters{Filter::nearest, Filter::linear_page, Filter::linear_vertex};

/// One-level tables stay below this; a larger one is split in two levels.
constexpr std::int64_t kMaxTableBytes = std::int64_t{256} << 20;
/// Texture axes beyond this cost bits of the normalised coordinate (hardware filtering).
constexpr int kPreferredPoolEdge = 1024;
constexpr std::int64_t kMostPages = std::int64_t{1} << AMRTEX_PAGE_INDEX_BITS;
constexpr int kMostLevels = 1 << AMRTEX_PAGE_LEVEL_BITS;

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

std::uint32_t red_of(int kind, int level, std::uint32_t index) {
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
bool lay_out(std::int64_t blocks, int edge, int limit, PoolLayout& layout) {
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
std::vector<Page> partition(const AmrHierarchy& h, int page_size) {
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
  std::int64_t entry_bytes() const { return green ? 8 : 4; }
  bool two_levels() const { return sub_edge > 1; }
  std::int64_t top_bytes() const { return std::int64_t{top.x} * top.y * top.z * entry_bytes(); }
  std::int64_t sub_bytes() const {
    const Vec3i t = sub_layout.texels();
    return two_levels() ? std::int64_t{t.x} * t.y * t.z * entry_bytes() : 0;
  }
};

std::int64_t entries(const Vec3d& n) { return static_cast<std::int64_t>(std::min(n.x * n.y * n.z, 1e18)); }

TablePlan plan_table(const AmrHierarchy& h, const std::vector<Page>& pages, int page_size, const BuildRequest& request,
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

/// What one field has in one page.
struct PageContents {
  ValueRange range;  ///< of all texels, the border and fills included
  bool any = true;   ///< has any cell a value?
  bool all = true;   ///< have all of them in the domain?
};

/// Values of one page as they will be stored, of one field after the other.
class PageReader {
 public:
  PageReader(const AmrHierarchy& h, const Options& options)
      : hierarchy_(h), options_(options), values_(static_cast<std::size_t>(options.page_texels())), missing_(values_.size()) {}

  /// Fills values() from a field of the mesh.
  PageContents read(const Page& page, int field) {
    const Vec3i first = page.index_in_level * options_.page_size;
    const Box cells{first, first + Vec3i(options_.page_size)};
    box_ = options_.nodes ? Box{first, first + Vec3i(options_.edge)} : cells.grown(options_.border);
    if (options_.nodes) {
      vertex_values(hierarchy_, field, page.level, box_, values_);
      std::fill(missing_.begin(), missing_.end(), std::uint8_t{0});  // another field may have been read before
      if (hierarchy_.has_missing(field)) mark_missing(page.level, cells, field);
    } else {
      filled_level_values(hierarchy_, field, page.level, box_, values_, missing_);
    }
    return contents(intersection(cells, hierarchy_.domain(page.level)), field);
  }
  std::span<const double> values() const { return values_; }

  /// Sets the bit of each cell of the page that has a value.
  void write_validity(const Page& page, std::uint32_t* words) const {
    const Vec3i first = page.index_in_level * options_.page_size;
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

  void mark_missing(int level, const Box& cells, int field) {
    std::vector<double> own(static_cast<std::size_t>(cells.cells()));
    level_values(hierarchy_, field, level, cells, own);
    std::size_t i = 0;
    for_each_cell(cells, [&](const Vec3i& c) { missing_[box_.offset(c)] = std::isnan(own[i++]) ? 1 : 0; });
  }

  PageContents contents(const Box& inside, int field) const {
    PageContents c;
    for (double v : values_) c.range.add(v);
    if (!hierarchy_.has_missing(field)) return c;
    c.any = false;
    for_each_cell(inside, [&](const Vec3i& cell) { (is_missing(cell) ? c.all : c.any) = !is_missing(cell); });
    return c;
  }

  const AmrHierarchy& hierarchy_;
  const Options& options_;
  Box box_;
  std::vector<double> values_;
  std::vector<std::uint8_t> missing_;
};

/// The table holds a float: what it would lose, a page of the same storage must lose as well.
bool constant_is_exact(double v, Storage storage) {
  return storage == Storage::r32f || static_cast<double>(static_cast<float>(v)) == v;
}

/// A constant page is one of a single field: an entry has room for one value, and what is constant in
/// one field seldom is in the others.
bool is_constant(const PageContents& c, const BuildRequest& request) {
  return request.more_fields.empty() && c.all && c.range.min == c.range.max && constant_is_exact(c.range.min, request.storage);
}

/// Node-centred pages lie side by side without a border: in a page's last vertex the rounding of the
/// normalised coordinate (3 times 2^-24 of the pool an axis) lets the texture unit see a little of the next page.
double leaked_value(const FieldStatistics& s, const Vec3i& pool) {
  const double weight = 3 * std::ldexp(3.0, -24) * std::max({pool.x, pool.y, pool.z});
  return weight * std::max({s.max - s.min, std::abs(s.min), std::abs(s.max)});
}

/// Which pages the scene cannot show.
class HiddenPages {
 public:
  HiddenPages(const AmrHierarchy& h, const BuildRequest& request, const Options& o)
      : request_(request), statistics_(h.statistics(request.field)), leak_(most_leaked(request, o)) {}
  bool operator()(const PageContents& c) const {
    const StorageScale scale = storage_scale(request_.storage, statistics_.min, statistics_.max);
    ValueRange range = c.range;
    if (!range.empty()) range = {range.min - leak_, range.max + leak_};
    return hidden(request_.needs, range, range_origin(statistics_, request_.storage, scale), request_.storage, scale);
  }

 private:
  /// Before the pool's size is known.
  double most_leaked(const BuildRequest& request, const Options& o) const {
    return o.nodes ? leaked_value(statistics_, Vec3i(request.context.max_3d_texture_size)) : 0;
  }

  const BuildRequest& request_;
  const FieldStatistics& statistics_;
  double leak_;
};

/// Sets the kind of a page, and what a constant one holds. Further fields are read only where those before have nothing.
void classify(PageReader& reader, const BuildRequest& request, const HiddenPages& is_hidden, Page& page) {
  PageContents c = reader.read(page, request.field);
  page.pruned = c.any && is_hidden(c);
  if (page.pruned) return;  // absent, at its own level: rays step over the same box
  for (const int other : request.more_fields)
    if (!c.any) c = reader.read(page, other);
  page.kind = !c.any ? AMRTEX_PAGE_ABSENT : is_constant(c, request) ? AMRTEX_PAGE_CONSTANT : AMRTEX_PAGE_STORED;
  if (page.kind == AMRTEX_PAGE_CONSTANT) page.green = std::bit_cast<std::uint32_t>(static_cast<float>(c.range.min));
}

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
    return {{"page_size", "cells along the edge of a page", 16, "4, 8, 16, 32, 64 or 128", {4, 8, 16, 32, 64}},
            {"centring",
             "what a texel of a page is: a cell, or a vertex (then the filter is linear_vertex)",
             "cell",
             "\"cell\" or \"node\"",
             {"cell", "node"}}};
  }
  void check_parameters(const Json& parameters) const override { values(parameters); }
  Support supported(const ContextInfo&) const override { return {}; }
  Support level_of_detail() const override {
    return {false, "a page is stored at the finest level that it holds, and at no other"};
  }
  bool prunes() const override { return true; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options values(const Json& parameters) const;
  Options options(const Json& parameters, const SceneNeeds& needs) const;
  Sizes sizes(std::int64_t stored, const Options& o, const TablePlan& table, bool validity, const BuildRequest& request) const;
};

Options PageTable::values(const Json& parameters) const {
  Options o{};
  o.page_size = integer_parameter(*this, parameters, "page_size");
  if (o.page_size < 4 || o.page_size > 128 || !std::has_single_bit(static_cast<unsigned>(o.page_size)))
    throw UsageError(
        fmt::format("encoding page_table: parameter page_size is {}; accepted: 4, 8, 16, 32, 64 or 128", o.page_size));
  const Json& centring = parameters.at("centring");
  if (centring != "cell" && centring != "node")
    throw UsageError(
        fmt::format("encoding page_table: parameter centring is {}; accepted: \"cell\" or \"node\"", centring.dump()));
  o.nodes = centring == "node";
  return o;
}

Options PageTable::options(const Json& parameters, const SceneNeeds& needs) const {
  const Filter filter = needs.filter;
  Options o = values(parameters);
  if (o.nodes != (filter == Filter::linear_vertex))
    throw UnsupportedError(
        fmt::format("encoding page_table: centring {} has no filter {}; centring cell has nearest, linear_page and centring node "
                    "has linear_vertex",
                    o.nodes ? "node" : "cell", filter_name(filter)));
  o.border = filter == Filter::linear_page || (needs.keeps_border() && !o.nodes) ? 1 : 0;
  o.edge = o.nodes ? o.page_size + 1 : o.page_size + 2 * o.border;
  return o;
}

/// Exact bytes of a build with so many stored pages; throws when they pass a limit.
Sizes PageTable::sizes(std::int64_t stored, const Options& o, const TablePlan& table, bool validity,
                       const BuildRequest& request) const {
  Sizes s;
  s.stored = stored;
  const int limit = request.context.max_3d_texture_size;
  if (!lay_out(std::max<std::int64_t>(stored, 1), o.edge, limit, s.pool))
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: {} pages of {}^3 texels do not fit a 3D texture of {} texels an axis",
                    o.page_size, stored, o.edge, limit));
  const int fields = request.field_count();
  const std::int64_t validity_bytes = validity ? fields * stored * o.page_cells() / 8 : 0;
  if (validity_bytes > request.context.max_buffer_bytes)
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: validity bits take {} bytes, a buffer of this context at most {}",
                    o.page_size, validity_bytes, request.context.max_buffer_bytes));
  if (stored > kMostPages)
    throw UnsupportedError(
        fmt::format("encoding page_table with page_size {}: {} pages, an entry of the table numbers at most {}", o.page_size,
                    stored, kMostPages));
  const std::int64_t pool_bytes = fields * s.pool_texels() * texel_bytes(request.storage);
  require_budget(*this, pool_bytes + table.top_bytes() + table.sub_bytes() + validity_bytes + MoreRanges::bytes(request, stored),
                 request);
  return s;
}

void write_page(const Options& o, const PoolLayout& pool, std::int64_t index, Storage storage, StorageScale scale,
                std::span<const double> values, HostTexture& texture) {
  const Vec3i at = pool.position(index);
  const Box all{Vec3i(0), texture.size};
  const auto edge = static_cast<std::size_t>(o.edge);
  for (int z = 0; z < o.edge; ++z)
    for (int y = 0; y < o.edge; ++y)
      store_values(storage, scale, &values[edge * (static_cast<std::size_t>(y) + edge * static_cast<std::size_t>(z))], edge,
                   texture.data.data(), all.offset(at + Vec3i(0, y, z)));
}

/// Reads every page to learn what is absent or constant, then numbers the stored ones.
std::int64_t number_pages(const AmrHierarchy& h, const BuildRequest& request, const Options& o, std::vector<Page>& pages) {
  const HiddenPages is_hidden(h, request, o);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageReader reader(h, o);
    for (std::size_t i = range.begin(); i != range.end(); ++i) classify(reader, request, is_hidden, pages[i]);
  });
  std::int64_t stored = 0;
  for (Page& p : pages)
    if (p.kind == AMRTEX_PAGE_STORED) p.index = static_cast<std::uint32_t>(stored++);
  return stored;
}

struct Entry {
  std::uint32_t red = 0;
  std::uint32_t green = 0;
};

void write_entry(HostTexture& texture, const Vec3i& texel, const Entry& entry) {
  const std::size_t i = Box{Vec3i(0), texture.size}.offset(texel);
  if (texture.format == TexelFormat::r32ui)
    texture.as<std::uint32_t>()[i] = entry.red;
  else
    texture.as<Entry>()[i] = entry;
}

/// Writes the entries of one page into `table`, the box of entries (pages of `table_level`)
/// that stand in the texture from texel `at`.
void write_entries(const AmrHierarchy& h, const Page& page, int table_level, const Box& table, HostTexture& texture,
                   const Vec3i& at) {
  const int r = h.cell_width(page.level) / h.cell_width(table_level);
  const Entry entry{red_of(page.kind, page.level, page.index), page.green};
  for_each_cell(intersection(Box{page.index_in_level, page.index_in_level + Vec3i(1)}.refined(r), table),
                [&](const Vec3i& i) { write_entry(texture, i - table.lower + at, entry); });
}

std::vector<HostTexture> make_table(const AmrHierarchy& h, const TablePlan& plan, const std::vector<Page>& pages) {
  const TexelFormat format = plan.green ? TexelFormat::rg32ui : TexelFormat::r32ui;
  std::vector<HostTexture> textures;
  textures.push_back(make_texture("tex_page_table", format, plan.top));
  if (plan.two_levels()) textures.push_back(make_texture("tex_page_subtables", format, plan.sub_layout.texels()));
  HostTexture& top = textures[0];
  const Box top_box{Vec3i(0), plan.top};
  std::map<std::size_t, std::uint32_t> subtables;  // by the entry that points to it
  for (const Page& page : pages) {
    if (page.level <= plan.top_level) {
      write_entries(h, page, plan.top_level, top_box, top, Vec3i(0));
      continue;
    }
    const Vec3i owner = page.index_in_level / (h.cell_width(plan.top_level) / h.cell_width(page.level));
    const auto [sub, added] = subtables.try_emplace(top_box.offset(owner), static_cast<std::uint32_t>(subtables.size()));
    if (added) write_entry(top, owner, {red_of(AMRTEX_PAGE_SUBTABLE, 0, sub->second), 0});
    const Box entries = Box{owner, owner + Vec3i(1)}.refined(plan.sub_edge);
    write_entries(h, page, plan.finest_level, entries, textures[1], plan.sub_layout.position(sub->second));
  }
  for (HostTexture& t : textures) t.roles.topology = t.bytes();
  if (plan.two_levels()) {
    const std::int64_t used = plan.subtables * plan.entry_bytes() * plan.sub_edge * plan.sub_edge * plan.sub_edge;
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
    const Vec3i first = p.index_in_level * o.page_size;
    const std::int64_t own = intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    roles.payload += own * bytes;
    roles.duplicated += (o.page_texels() - o.page_cells()) * bytes;
    roles.padding += (o.page_cells() - own) * bytes;
  }
  roles.padding = pool.bytes() - roles.payload - roles.duplicated;
  return roles;
}

Json statistics(const AmrHierarchy& h, const Options& o, const std::vector<Page>& pages, const TablePlan& table,
                std::int64_t stored) {
  std::int64_t constant = 0;
  std::int64_t absent = 0;
  std::int64_t cells = 0;
  std::vector<std::int64_t> levels(static_cast<std::size_t>(h.level_count()));
  for (const Page& p : pages) {
    constant += p.kind == AMRTEX_PAGE_CONSTANT ? 1 : 0;
    absent += p.kind == AMRTEX_PAGE_ABSENT ? 1 : 0;
    if (p.kind == AMRTEX_PAGE_STORED) {
      ++levels[static_cast<std::size_t>(p.level)];
      const Vec3i first = p.index_in_level * o.page_size;
      cells += intersection(Box{first, first + Vec3i(o.page_size)}, h.domain(p.level)).cells();
    }
  }
  const double pages_cells = static_cast<double>(std::max<std::int64_t>(stored, 1) * o.page_cells());
  Json json;
  json["pages"] = stored;
  json["constant_pages"] = constant;
  json["absent_pages"] = absent;
  json["pruned_pages"] = std::count_if(pages.begin(), pages.end(), [](const Page& p) { return p.pruned; });
  json["pages_a_level"] = levels;
  json["page_texels"] = o.page_texels();
  json["border_overhead"] = static_cast<double>(stored * (o.page_texels() - o.page_cells())) / pages_cells;
  json["border_overhead_formula"] = static_cast<double>(o.page_texels()) / static_cast<double>(o.page_cells()) - 1;
  json["oversampling"] = static_cast<double>(cells) / static_cast<double>(h.leaf_cells());
  json["table_levels"] = table.two_levels() ? 2 : 1;
  json["table_entries"] = table.top_bytes() / table.entry_bytes();
  json["subtables"] = table.subtables;
  return json;
}

/// What the pages are written to.
struct Storages {
  std::vector<HostTexture> pools;  ///< one a field, all laid out in the same way
  HostTexture validity;            ///< without data where every cell has a value
  MoreRanges more_ranges;
};

Storages make_storages(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request, const Options& o,
                       const Sizes& size, const EncodedField& field, const std::vector<Page>& pages) {
  Storages out{{}, {}, MoreRanges(encoding, request, "page_more_ranges", size.stored)};
  for (int number = 0; number < field.field_count; ++number) {
    HostTexture& pool =
        out.pools.emplace_back(make_texture(element_name("tex_pages", number), field.storage, size.pool.texels()));
    pool.hardware_linear = field.filtering == Filtering::hardware;
    pool.holds_values = true;
    pool.roles = pool_roles(h, o, pages, pool);
  }
  if (any_missing(h, request))
    out.validity = make_buffer("page_validity", TexelFormat::r32ui, size.stored * field.field_count * o.page_words());
  return out;
}

/// Writes stored pages: values, validity bits and coded ranges.
class PageWriter {
 public:
  PageWriter(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Sizes& size, const EncodedField& field,
             Storages& out)
      : request_(request), options_(o), size_(size), field_(field), out_(out), reader_(h, o) {
    const HostTexture& pool = out.pools.front();
    for (int number = 0; number < field.field_count; ++number)
      leak_.push_back(pool.hardware_linear && o.nodes ? leaked_value(h.statistics(request.field_at(number)), pool.size) : 0);
  }

  void write(Page& page) {
    for (int number = 0; number < field_.field_count; ++number) {
      const PageContents contents = reader_.read(page, request_.field_at(number));
      write_page(options_, size_.pool, page.index, request_.storage, field_.scale_of(number), reader_.values(),
                 out_.pools[static_cast<std::size_t>(number)]);
      if (!out_.validity.data.empty()) reader_.write_validity(page, validity_words(page, number));
      if (number == 0 && request_.needs.value_ranges) page.green = coded_range(contents);
      out_.more_ranges.set(field_, page.index, number, range_of(contents, number));
    }
  }

 private:
  /// A page's words of all fields stand side by side.
  std::uint32_t* validity_words(const Page& page, int number) {
    return out_.validity.as<std::uint32_t>() + (page.index * field_.field_count + number) * options_.page_words();
  }
  /// Of what a field can return in a page; empty where it has no value.
  ValueRange range_of(const PageContents& c, int number) const {
    const double leak = leak_[static_cast<std::size_t>(number)];
    return c.any ? ValueRange{c.range.min - leak, c.range.max + leak} : ValueRange{};
  }
  std::uint32_t coded_range(const PageContents& c) const { return encode_range(field_, 0, range_of(c, 0)); }

  const BuildRequest& request_;
  const Options& options_;
  const Sizes& size_;
  const EncodedField& field_;
  Storages& out_;
  PageReader reader_;
  std::vector<double> leak_;  ///< of each field
};

/// Reads the stored pages once more, to store them.
Storages store_pages(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request, const Options& o,
                     const Sizes& size, const EncodedField& field, std::vector<Page>& pages) {
  Storages out = make_storages(encoding, h, request, o, size, field, pages);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageWriter writer(h, request, o, size, field, out);
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      if (pages[i].kind == AMRTEX_PAGE_STORED) writer.write(pages[i]);
  });
  return out;
}

void add_shader_inputs(const AmrHierarchy& h, const Options& o, const TablePlan& table, const Sizes& size, bool constants,
                       EncodedField& field) {
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_PAGE_SIZE", o.page_size);
  defines.emplace_back("AMRTEX_PAGE_BORDER", o.border);
  defines.emplace_back("AMRTEX_PAGE_EDGE", o.edge);
  defines.emplace_back("AMRTEX_PAGE_NODES", o.nodes ? 1 : 0);
  defines.emplace_back("AMRTEX_PAGE_CONSTANTS", constants ? 1 : 0);
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

std::vector<LeftOut> left_out(const Options& o, const TablePlan& table, std::int64_t stored, std::int64_t pruned, bool validity,
                              const EncodedField& field) {
  std::vector<LeftOut> list;
  if (pruned > 0) {
    const std::int64_t page_bytes = o.page_texels() * texel_bytes(field.storage) + (validity ? o.page_cells() / 8 : 0);
    list.push_back(
        {"pages", "the transfer function hides all that is in them", pruned * page_bytes * field.field_count, Part::hidden});
  }
  const std::int64_t pages = stored * field.field_count;
  if (!validity) list.push_back({"validity bits", "every cell has a value", pages * o.page_cells() / 8, Part::validity});
  if (!table.green)
    list.push_back({"second channel of the table", "no region is skipped and no page is constant",
                    table.top_bytes() + table.sub_bytes(), Part::value_ranges});
  if (!o.nodes && o.border == 0) {
    const std::int64_t with_border = std::int64_t{o.page_size + 2} * (o.page_size + 2) * (o.page_size + 2);
    list.push_back({"border layer", "the filter nearest reads one cell",
                    pages * (with_border - o.page_cells()) * texel_bytes(field.storage), Part::border});
  }
  return list;
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
  const std::int64_t stored = number_pages(h, request, o, pages);
  const bool constants = std::any_of(pages.begin(), pages.end(), [](const Page& p) { return p.kind == AMRTEX_PAGE_CONSTANT; });
  const TablePlan table = plan_table(h, pages, o.page_size, request, constants);
  const bool validity = any_missing(h, request);
  const Sizes size = sizes(stored, o, table, validity, request);

  EncodedField field = start_field(*this, h, request, parameters);
  if (request.needs.filter == Filter::linear_page) field.definition.page_size = o.page_size;
  Storages stores = store_pages(*this, h, request, o, size, field, pages);
  field.statistics = statistics(h, o, pages, table, stored);
  add_shader_inputs(h, o, table, size, constants, field);
  const auto pruned = std::count_if(pages.begin(), pages.end(), [](const Page& p) { return p.pruned; });
  field.left_out = left_out(o, table, stored, pruned, validity, field);
  field.textures = make_table(h, table, pages);
  for (HostTexture& pool : stores.pools) field.textures.push_back(std::move(pool));
  if (validity) field.textures.push_back(std::move(stores.validity));
  stores.more_ranges.move_to(field);
  if (request.needs.draw_boxes) field.draw_tree = PageDrawTree(h, o.page_size, pages).tree();
  field.host_peak_bytes =
      field.memory().total() + static_cast<std::int64_t>(pages.size() * sizeof(Page)) + field.draw_tree.bytes();
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_page_table() { return std::make_unique<PageTable>(); }

}  // namespace amrtex
