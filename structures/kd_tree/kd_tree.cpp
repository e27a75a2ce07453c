#include "kd_tree.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <numeric>

#include "kd_brick_writer.hpp"
#include "kd_bricks.hpp"
#include "kd_detail.hpp"
#include "kd_draw_tree.hpp"
#include "structures/common/layout.hpp"
#include "structures/common/texture_handles.hpp"

namespace amrtex {
namespace {

using namespace kd;

constexpr std::array<Filter, 4> kFilters{Filter::nearest, Filter::linear_lod, Filter::linear_vertex, Filter::basis};

/// A start grid takes at most this part of what tree and pool take.
constexpr std::int64_t kGridShare = 16;

constexpr const char* kPoolName = "tex_kd_pool";
constexpr const char* kBricksName = "tex_kd_bricks";
constexpr const char* kHandlesName = "kd_handles";
constexpr const char* kBindless = "storage_kind \"bindless\"";

/// Normalised coordinates of a brick's texels: the pool's size is a define.
bool needs_brick_sizes(const BuildRequest& request, const Options& o) {
  return o.bindless && stored_filtering(request) == Filtering::hardware;
}

class KdTree final : public Encoding {
 public:
  std::string_view name() const override { return "kd_tree"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"storage_kind",
             "where bricks are stored: in one texture, or each in its own",
             "pool",
             choices({"pool", "bindless"}),
             {"pool", "bindless"}},
            {"packing", "how bricks are packed into the pool", "best_fit", choices({"best_fit", "nfdh"})},
            {"traversal", "where the search for a leaf starts: at a grid's cell, or at the root", "grid",
             choices({"grid", "restart"})},
            {"wrap", "is what lies outside of all subgrids of a node split off before it is divided among them?", true,
             true_or_false()}};
  }
  std::vector<UnsupportedValue> unsupported_values(const ContextInfo& context) const override {
    const Support support = supports_handles(context);
    if (support.ok) return {};
    return {{"storage_kind", "bindless", support.reason}};
  }
  Support level_of_detail() const override { return {}; }
  bool prunes() const override { return true; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters, const SceneNeeds& needs) const;
  Plan plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const;
  void plan_pool(const BuildRequest& request, const Options& o, Plan& p) const;
  Layout layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p) const;
};

Options KdTree::options(const Json& parameters, const SceneNeeds& needs) const {
  Options o;
  o.bindless = parameters.at("storage_kind") == "bindless";
  o.paper_packing = parameters.at("packing") == "nfdh";
  o.grid = parameters.at("traversal") == "grid";
  o.wrap = parameters.at("wrap").get<bool>();
  o.detail = needs.level_of_detail;
  o.vertices = needs.filter == Filter::linear_vertex;
  o.hats = needs.filter == Filter::basis;
  o.border = needs.filter == Filter::linear_lod || (needs.keeps_border() && !o.vertices) ? 1 : 0;
  return o;
}

/// Bindless.
PoolPacking own_textures(std::size_t bricks, const Vec3i& largest) {
  PoolPacking pool{{largest, std::vector<Vec3i>(bricks, Vec3i(0))}, std::vector<int>(bricks), static_cast<int>(bricks)};
  std::iota(pool.texture_of.begin(), pool.texture_of.end(), 0);
  return pool;
}

void KdTree::plan_pool(const BuildRequest& request, const Options& o, Plan& p) const {
  std::vector<Vec3i> sizes;
  Vec3i largest(1);
  for (const Brick& b : p.bricks) {
    sizes.push_back(b.texels(o).size());
    largest = glm::max(largest, sizes.back());
  }
  p.brick_texels = packing::used_texels(sizes);
  const int limit = request.context.max_3d_texture_size;
  if (sizes.empty())
    p.pool.packing.size = Vec3i(1);
  else if (o.bindless && std::max({largest.x, largest.y, largest.z}) <= limit)
    p.pool = own_textures(sizes.size(), largest);
  else if (std::max({largest.x, largest.y, largest.z}) <= limit)
    p.pool = pack_pool(request, sizes, o.paper_packing);
  const Vec3i size = p.pool.packing.size;
  if (!p.pool.packing.valid())
    throw UnsupportedError(
        fmt::format("encoding kd_tree: {} bricks of up to {} x {} x {} texels do not fit {} 3D textures of {} texels an axis",
                    sizes.size(), largest.x, largest.y, largest.z, most_pool_textures(request.field_count()), limit));
  p.numbered = o.bindless || p.pool.textures > 1;
  for (int a = 0; a < 3; ++a) p.position_bits[a] = std::bit_width(static_cast<unsigned>(size[a] - 1));
  const int bits = p.position_bits.x + p.position_bits.y + p.position_bits.z;
  if (bits > 32)
    throw UnsupportedError(
        fmt::format("encoding kd_tree: positions in a {} of {} x {} x {} texels take {} bits, a data node has 32",
                    o.bindless ? "brick" : "pool", size.x, size.y, size.z, bits));
}

Plan KdTree::plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const {
  if (o.hats && o.detail)
    throw UnsupportedError(
        "encoding kd_tree: no level of detail (level_of_detail, max_level) with filter basis: its hats are of leaf cells; "
        "accepted: nearest, linear_lod, linear_vertex");
  Plan p;
  p.tree = build_tree(h, {.wrap = o.wrap, .covers = o.detail, .limits = {}});
  p.pruned = prune(h, request, o, p.tree);
  if (o.hats) {
    p.hats = hat_nodes(h, p.tree);
    require_places(h, p.tree, p.hats);
    p.supports = SupportList(p.hats, hat_code);
  }
  if (o.detail) add_detail_blocks(h, p.tree);
  p.bricks = make_bricks(p.tree, p.brick_of);
  const bool validity = any_missing(h, request);
  std::vector<std::uint8_t> holds_leaf(p.bricks.size());
  for (std::size_t i = 0; i < p.tree.leaves.size(); ++i) {
    const Leaf& block = p.tree.leaves[i];
    const bool leaf = block.next == kNothingFiner;
    p.leaf_count += leaf ? 1 : 0;
    if (leaf) holds_leaf[static_cast<std::size_t>(p.brick_of[i])] = 1;
    count_block(block, p.leaf_cells, p.detail_cells);
    p.validity_words += request.field_count() * words_for_bits(block.cells.cells());
  }
  p.leaf_bricks = std::count(holds_leaf.begin(), holds_leaf.end(), 1);
  if (o.bindless) require_handles(*this, kBindless, p.brick_count(), request);
  plan_pool(request, o, p);
  p.data_words = 1 + (p.numbered ? 1 : 0) + (request.needs.value_ranges ? 1 : 0) + (validity ? 1 : 0);
  if (o.grid) {
    // of one field: the grid is the same for several
    const std::int64_t others = p.texels(o) * texel_bytes(request.storage) + 8 * p.node_count();
    p.grid = make_start_grid(h, p.tree, std::max<std::int64_t>(others / kGridShare / 4, 1));
  }
  return p;
}

/// Texels of one or more bricks, by what they hold.
struct TexelCounts {
  std::int64_t all = 0;
  std::int64_t cells = 0;    ///< of bricks; the rest are borders
  std::int64_t leaves = 0;   ///< leaf cells among them
  std::int64_t refined = 0;  ///< cells that are drawn for a level of detail alone
  MemoryByRole by_role() const { return {.payload = leaves, .duplicated = all - cells + refined}; }
};

void count_brick(const Options& o, const Plan& p, const Brick& b, TexelCounts& n) {
  n.all += b.texels(o).cells();
  n.cells += b.cells.cells();
  for (const int leaf : b.leaves) count_block(p.tree.leaves[static_cast<std::size_t>(leaf)], n.leaves, n.refined);
}

/// Textures of all fields of the pool's first part, then of the second, ...
void add_pools(const BuildRequest& request, const Options& o, const Plan& p, Layout& layout) {
  std::vector<TexelCounts> counts(static_cast<std::size_t>(p.pool.textures));
  for (std::size_t i = 0; i < p.bricks.size(); ++i)
    count_brick(o, p, p.bricks[i], counts[static_cast<std::size_t>(p.pool.texture_of[i])]);
  int texture = 0;
  for (const TexelCounts& n : counts)
    for (int number = 0; number < request.field_count(); ++number)
      layout.add(layout.values(kPoolName, texture++, p.pool.packing.size).holding(n.by_role()));
}

/// Textures of all fields of the first brick, then of the second, ...
void add_brick_textures(const BuildRequest& request, const Options& o, const Plan& p, Layout& layout) {
  std::int64_t index = 0;
  for (const Brick& b : p.bricks) {
    TexelCounts n;
    count_brick(o, p, b, n);
    for (int number = 0; number < request.field_count(); ++number) {
      Part part = layout.values(kBricksName, 0, b.texels(o).size()).holding(n.by_role());
      part.handles = kHandlesName;
      part.handle_index = index++;
      layout.add(std::move(part));
    }
  }
}

/// Texels of subgrids that others refine everywhere, and of the parts of others around which no leaf cell lies.
std::int64_t undrawn_cells(const AmrHierarchy& h, const Plan& p) {
  std::int64_t cells = h.stored_cells() - p.pruned.brick_cells;
  for (const Brick& b : p.bricks) cells -= b.cells.cells();
  return cells;
}

/// Shares of nodes, data nodes and bricks that nothing reads.
void leave_out(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p, Layout& layout) {
  if (p.pruned.leaves > 0)
    layout.leave_out({"leaves, and what they leave of bricks", "the transfer function hides all that is in them",
                      layout.value_bytes(p.pruned.brick_texels) + 4 * p.data_words * p.pruned.leaves + p.pruned.support_bytes,
                      Need::hidden});
  if (!any_missing(h, request))  // a word of each data node, beside the bits
    layout.leave_out({"validity bits", "every cell has a value", 4 * p.block_count(), Need::validity});
  if (!request.needs.value_ranges)
    layout.leave_out({"value ranges", "no region is skipped", 4 * p.block_count(), Need::value_ranges});
  if (const std::int64_t cells = undrawn_cells(h, p); cells > 0)
    layout.leave_out({"refined parts of subgrids", "no level of detail is drawn", layout.value_bytes(cells)});
  if (!o.vertices && o.border == 0)
    layout.leave_out({"border layer", o.hats ? "each sample searches the cells around it" : "the filter nearest reads one cell",
                      layout.value_bytes(border_cells(p.bricks)), Need::border});
}

Layout KdTree::layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p) const {
  Layout layout(*this, request);
  leave_out(h, request, o, p, layout);
  layout.add(buffer_part("kd_nodes", "nodes", TexelFormat::rg32ui, p.node_count()));
  layout.add(buffer_part("kd_data", "data nodes", TexelFormat::r32ui, p.data_words * p.block_count()));
  layout.add(buffer_part("kd_detail", "levels of data nodes", TexelFormat::r32ui, p.block_count()).when(o.detail));
  layout.add(p.grid.entries_part("kd_start").when(o.grid));
  layout.add(p.grid.nodes_part("kd_start_nodes").when(o.grid));
  layout.add(p.supports.part().when(o.hats));
  layout.add(buffer_part(kHandlesName, "handles", TexelFormat::rg32ui, p.brick_count() * request.field_count()).when(o.bindless));
  layout.add(
      buffer_part("kd_brick_sizes", "brick sizes", TexelFormat::r32ui, p.brick_count()).when(needs_brick_sizes(request, o)));
  if (o.bindless)
    add_brick_textures(request, o, p, layout);
  else
    add_pools(request, o, p, layout);
  layout.add(buffer_part("kd_validity", "validity bits", TexelFormat::r32ui, p.validity_words)
                 .when(any_missing(h, request), "every cell has a value", Need::validity));
  layout.add(layout.more_ranges("kd_more_ranges", p.block_count()));
  layout.add_working(
      static_cast<std::int64_t>(p.tree.nodes.size() * (sizeof(Node) + sizeof(Box)) + p.hats.size() * sizeof(HatNode)));
  return layout;
}

std::uint32_t packed(const Plan& p, const Vec3i& texel) {
  return static_cast<std::uint32_t>(texel.x) | (static_cast<std::uint32_t>(texel.y) << p.position_bits.x) |
         (static_cast<std::uint32_t>(texel.z) << (p.position_bits.x + p.position_bits.y));
}

void write_nodes(const Tree& tree, HostTexture& nodes) {
  auto* words = nodes.as<std::uint32_t>();
  for (const Node& n : tree.nodes) {
    *words++ = first_word(n);
    *words++ = second_word(n);
  }
}

/// All but ranges, which are known with the values.
void write_data_nodes(const BuildRequest& request, const Options& o, const Plan& p, bool validity, HostTexture& data) {
  auto* words = data.as<std::uint32_t>();
  std::int64_t first_word_of_leaf = 0;
  for (std::size_t i = 0; i < p.tree.leaves.size(); ++i, words += p.data_words) {
    const Leaf& leaf = p.tree.leaves[i];
    const auto brick = static_cast<std::size_t>(p.brick_of[i]);
    const Vec3i at = p.pool.packing.at[brick] + leaf.cells.lower - p.bricks[brick].texels(o).lower;
    words[0] = packed(p, at);
    if (p.numbered) words[1] = static_cast<std::uint32_t>(p.pool.texture_of[brick]);
    if (!validity) continue;
    words[p.data_words - 1] = static_cast<std::uint32_t>(first_word_of_leaf);
    first_word_of_leaf += request.field_count() * words_for_bits(leaf.cells.cells());
  }
}

void write_bricks(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p, EncodedField& field) {
  const auto values =
      std::find_if(field.textures.begin(), field.textures.end(), [](const HostTexture& t) { return t.holds_values; });
  const Stores out{values == field.textures.end() ? nullptr : &*values, field.find("kd_data"), field.find("kd_validity"),
                   MoreRanges(field, "kd_more_ranges")};
  write_data_nodes(request, o, p, out.validity != nullptr, *out.data);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, p.bricks.size(), 1), [&](const auto& range) {
    BrickWriter writer(h, request, o, p, field, out);
    for (std::size_t i = range.begin(); i != range.end(); ++i) writer.write(static_cast<int>(i));
  });
}

/// From the leaves' ranges, as they were written.
LeapGrid leap_grid(const AmrHierarchy& h, const Plan& p, EncodedField& field) {
  LeapGrid grid = LeapGrid::over(h);
  const auto* words = field.find("kd_data")->as<std::uint32_t>() + (p.numbered ? 2 : 1);
  for (const Leaf& leaf : p.tree.leaves) {
    grid.cover(leaf.cells.refined(h.cell_width(leaf.level)), *words);
    words += p.data_words;
  }
  return grid;
}

/// What only some structures have.
void write_optional_parts(const AmrHierarchy& h, const Options& o, const Plan& p, EncodedField& field) {
  if (HostTexture* detail = field.find("kd_detail"))
    std::transform(p.tree.leaves.begin(), p.tree.leaves.end(), detail->as<std::uint32_t>(), detail_word);
  if (o.grid)
    p.grid.write(
        node_boxes(h, p.tree), [](std::uint32_t) { return 0U; }, *field.find("kd_start"), *field.find("kd_start_nodes"));
  if (o.hats) p.supports.write(*field.find("basis_supports"));
  if (HostTexture* sizes = field.find("kd_brick_sizes")) {
    auto* words = sizes->as<std::uint32_t>();
    for (const Brick& b : p.bricks) *words++ = packed(p, b.texels(o).size() - Vec3i(1));
  }
}

void add_shader_inputs(const BuildRequest& request, const Options& o, const Plan& p, EncodedField& field) {
  if (o.grid) {
    field.integer_uniforms.emplace_back("u_kd_grid", p.grid.cells);
    field.integer_uniforms.emplace_back("u_kd_grid_width", Vec3i(p.grid.width, 0, 0));
  }
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_KD_DEPTH", o.grid ? p.grid.depth : p.tree.depth);
  defines.emplace_back("AMRTEX_KD_GRID", o.grid ? 1 : 0);
  defines.emplace_back("AMRTEX_KD_VERTICES", o.vertices ? 1 : 0);
  defines.emplace_back("AMRTEX_KD_DATA_WORDS", p.data_words);
  defines.emplace_back("AMRTEX_KD_X_BITS", p.position_bits.x);
  defines.emplace_back("AMRTEX_KD_Y_BITS", p.position_bits.y);
  defines.emplace_back("AMRTEX_KD_BINDLESS", o.bindless ? 1 : 0);
  defines.emplace_back("AMRTEX_KD_NUMBERED", p.numbered ? 1 : 0);
  if (o.bindless) return add_handle_access(request.context, field);
  const Vec3i& size = p.pool.packing.size;
  defines.emplace_back("AMRTEX_POOL_TEXTURES", p.pool.textures);
  defines.emplace_back("AMRTEX_POOL_X", size.x);
  defines.emplace_back("AMRTEX_POOL_Y", size.y);
  defines.emplace_back("AMRTEX_POOL_Z", size.z);
}

Json statistics(const Options& o, const Plan& p) {
  const Tree& t = p.tree;
  Json json;
  json["nodes"] = p.node_count();
  json["fully_refined_nodes"] = t.fully_refined;
  json["mixed_nodes"] = t.mixed;
  json["leaves"] = p.leaf_count;
  json["empty_leaves"] = t.empty;
  if (o.detail) json["detail_blocks"] = p.block_count() - p.leaf_count;
  json["pruned_leaves"] = p.pruned.leaves;
  json["pruned_bricks"] = p.pruned.bricks;
  json["depth"] = t.depth;
  json["subgrids"] = t.subgrids;
  json["cut_subgrids"] = t.cut_subgrids;
  json["bricks"] = p.bricks.size();
  json["leaves_a_brick"] = static_cast<double>(p.leaf_count) / static_cast<double>(std::max<std::int64_t>(p.leaf_bricks, 1));
  const Vec3i& size = p.pool.packing.size;
  json["pool"] = o.bindless ? Json(nullptr) : Json{size.x, size.y, size.z};
  json["pool_textures"] = o.bindless ? Json(nullptr) : Json(p.pool.textures);
  json["fill"] = static_cast<double>(p.brick_texels) / static_cast<double>(std::max<std::int64_t>(p.texels(o), 1));
  json["start_grid"] = o.grid ? Json{p.grid.cells.x, p.grid.cells.y, p.grid.cells.z} : Json(nullptr);
  json["start_depth"] = o.grid ? p.grid.depth : t.depth;
  return json;
}

EncodedField KdTree::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters, request.needs);
  const Plan p = plan(h, request, o);
  const Layout parts = layout(h, request, o, p);
  parts.require_limits();
  parts.require_budget();

  EncodedField field = start_field(*this, h, request, parameters);
  parts.allocate(field);
  write_nodes(p.tree, *field.find("kd_nodes"));
  write_bricks(h, request, o, p, field);
  write_optional_parts(h, o, p, field);
  field.statistics = statistics(o, p);
  add_shader_inputs(request, o, p, field);
  if (request.needs.value_ranges) field.leaps = leap_grid(h, p, field);
  if (request.needs.draw_boxes) set_draw_tree(field, make_draw_tree(h, p.tree));
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_kd_tree() { return std::make_unique<KdTree>(); }

}  // namespace amrtex
