#include "kd_tree.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <cmath>
#include <map>

#include "hidden_leaves.hpp"
#include "kd_detail.hpp"
#include "kd_draw_tree.hpp"
#include "kd_hats.hpp"
#include "kd_partition.hpp"
#include "start_grid.hpp"
#include "structures/common/brick_packing.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/texture_handles.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex {
namespace {

using namespace kd;

constexpr std::array<Filter, 4> kFilters{Filter::nearest, Filter::linear_lod, Filter::linear_vertex, Filter::basis};

/// Values are read in blocks of at most so many cells along an axis.
constexpr int kChunk = 32;
/// A start grid takes at most this part of what tree and pool take.
constexpr std::int64_t kGridShare = 16;

constexpr const char* kPoolName = "tex_kd_pool";
constexpr const char* kBricksName = "tex_kd_bricks";
constexpr const char* kHandlesName = "kd_handles";
constexpr const char* kBindless = "storage_kind \"bindless\"";

struct Options {
  bool bindless = false;  ///< a texture a brick, no pool
  bool paper_packing = false;
  bool grid = true;
  bool wrap = false;
  bool detail = false;  ///< refined cells may be drawn
  bool vertices = false;
  bool hats = false;  ///< each sample searches the leaves whose cells' hats reach it
  int border = 0;     ///< texels before the first cell of a brick
};

/// What is stored of one subgrid: the box around its drawn blocks.
struct Brick {
  int level;
  int patch;
  Box cells;                ///< level space
  std::vector<int> leaves;  ///< of the tree
  Box texels(const Options& o) const { return o.vertices ? Box{cells.lower, cells.upper + Vec3i(1)} : cells.grown(o.border); }
};

/// What was left out because the scene does not show it.
struct Pruned {
  std::int64_t leaves = 0;
  std::int64_t bricks = 0;        ///< subgrids of which nothing is stored
  std::int64_t brick_cells = 0;   ///< of bricks, by which the others shrank included
  std::int64_t brick_texels = 0;  ///< the same with borders
  std::int64_t leaf_cells = 0;
  std::int64_t support_bytes = 0;
};

struct Plan {
  Tree tree;
  Pruned pruned;
  std::vector<Brick> bricks;
  std::vector<int> brick_of;  ///< a leaf
  Packing packing;            ///< bindless: every brick at 0 and the largest extents
  StartGrid grid;
  std::vector<HatNode> hats;
  SupportList supports;
  Vec3i position_bits{0};  ///< of a packed position
  int data_words = 1;
  std::int64_t validity_words = 0;
  std::int64_t brick_texels = 0;
  std::int64_t leaf_cells = 0;
  std::int64_t detail_cells = 0;  ///< refined ones that are stored
  std::int64_t leaf_count = 0;
  std::int64_t leaf_bricks = 0;  ///< that hold a leaf
  std::int64_t node_count() const { return static_cast<std::int64_t>(tree.nodes.size()); }
  std::int64_t brick_count() const { return static_cast<std::int64_t>(bricks.size()); }
  /// Texels of one field.
  std::int64_t texels(const Options& o) const { return o.bindless ? brick_texels : packing.texels(); }
  std::int64_t block_count() const { return static_cast<std::int64_t>(tree.leaves.size()); }
};

/// Adds a block's cells to those of leaves, or to the refined ones.
void count_block(const Leaf& block, std::int64_t& leaf_cells, std::int64_t& refined_cells) {
  if (block.next == kNothingFiner)
    leaf_cells += block.cells.cells();
  else if (!block.repeated)
    refined_cells += block.cells.cells();
}

std::vector<Brick> make_bricks(const Tree& tree, std::vector<int>& brick_of) {
  std::map<std::pair<int, int>, int> known;  // level, patch
  std::vector<Brick> bricks;
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) {
    const Leaf& leaf = tree.leaves[i];
    const auto [it, added] = known.try_emplace({leaf.level, leaf.patch}, static_cast<int>(bricks.size()));
    if (added) bricks.push_back({leaf.level, leaf.patch, leaf.cells, {}});
    Brick& brick = bricks[static_cast<std::size_t>(it->second)];
    brick.cells = {glm::min(brick.cells.lower, leaf.cells.lower), glm::max(brick.cells.upper, leaf.cells.upper)};
    brick.leaves.push_back(static_cast<int>(i));
    brick_of.push_back(it->second);
  }
  return bricks;
}

/// Normalised coordinates of a brick's texels: the pool's size is a define.
bool needs_brick_sizes(const BuildRequest& request, const Options& o) {
  return o.bindless && stored_filtering(request) == Filtering::hardware;
}

/// Bricks of vertices and of hats lie side by side without a border: at a brick's last texel the rounding of the
/// normalised coordinate (3 times 2^-24 of the pool an axis) lets the texture unit see a little of the next brick.
double leaked_value(const FieldStatistics& s, const Vec3i& pool) {
  const double weight = 3 * std::ldexp(3.0, -24) * std::max({pool.x, pool.y, pool.z});
  return weight * std::max({s.max - s.min, std::abs(s.min), std::abs(s.max)});
}

bool may_leak(const Options& o) { return o.vertices || o.hats; }

/// Removes the leaves of which nothing can be seen. A brick is then the box around those that are left.
Pruned prune(const AmrHierarchy& h, const BuildRequest& request, const Options& o, Tree& tree) {
  Pruned pruned;
  if (request.needs.invisible.empty()) return pruned;
  const auto count = [&](const Tree& t, int sign) {
    std::vector<int> brick_of;
    for (const Brick& b : make_bricks(t, brick_of)) {
      pruned.bricks += sign;
      pruned.brick_cells += sign * b.cells.cells();
      pruned.brick_texels += sign * b.texels(o).cells();
    }
    for (const Leaf& leaf : t.leaves) pruned.leaf_cells += sign * leaf.cells.cells();
    if (o.hats) pruned.support_bytes += sign * SupportList(hat_nodes(h, t), hat_code).bytes();
    pruned.leaves += sign * static_cast<std::int64_t>(t.leaves.size());
  };
  count(tree, 1);
  // the pool's size is not known yet; it is no larger
  const Vec3i largest_pool(request.context.max_3d_texture_size);
  const double leak = may_leak(o) ? leaked_value(h.statistics(request.field), largest_pool) : 0;
  remove_leaves(tree, hidden_leaves(h, request, tree, {o.vertices, o.hats, o.border, leak}));
  count(tree, -1);
  return pruned;
}

struct Stores {
  std::vector<HostTexture> values;  ///< one pool a field, all laid out in the same way; or one texture a brick and field
  HostTexture data;
  HostTexture validity;  ///< without data where every cell has a value
  MoreRanges more_ranges;
};

/// Writes the values, validity bits and ranges of bricks. One object a thread; a brick is one thread's.
class BrickWriter {
 public:
  BrickWriter(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& plan, const EncodedField& field,
              Stores& out)
      : hierarchy_(h), request_(request), options_(o), plan_(plan), field_(field), out_(out) {
    const bool leaks = field.filtering == Filtering::hardware && may_leak(o);
    for (int number = 0; number < field.field_count; ++number)
      leak_.push_back(leaks ? leaked_value(h.statistics(request.field_at(number)), plan.packing.size) : 0);
  }

  void write(int brick) {
    for (const int leaf : plan_.bricks[static_cast<std::size_t>(brick)].leaves)
      for (int number = 0; number < field_.field_count; ++number) write_leaf(brick, leaf, number);
  }

 private:
  void write_leaf(int brick, int leaf, int number) {
    const Leaf& l = plan_.tree.leaves[static_cast<std::size_t>(leaf)];
    range_ = {};
    any_ = false;
    for_each_cell({Vec3i(0), ceil_div(l.cells.size(), kChunk)}, [&](const Vec3i& i) {
      const Vec3i lower = l.cells.lower + i * kChunk;
      const Box chunk{lower, glm::min(lower + Vec3i(kChunk), l.cells.upper)};
      read(l.level, chunk, request_.field_at(number));
      store(brick, number);
      note(leaf, chunk, number);
    });
    if (!request_.needs.value_ranges) return;
    if (options_.hats) add_reaching_values(hierarchy_, request_.field_at(number), plan_.tree, plan_.hats, leaf, range_);
    if (number == 0) data_node(leaf)[options_.bindless ? 2 : 1] = encode_range(field_, 0, whole_range(0));
    out_.more_ranges.set(field_, leaf, number, whole_range(number));
  }

  std::uint32_t* data_node(int leaf) const {
    return out_.data.as<std::uint32_t>() + static_cast<std::ptrdiff_t>(leaf) * plan_.data_words;
  }

  /// All that the filter may read for a sample in the chunk.
  void read(int level, const Box& chunk, int field) {
    box_ = options_.vertices ? Box{chunk.lower, chunk.upper + Vec3i(1)} : chunk.grown(options_.border);
    values_.resize(static_cast<std::size_t>(box_.cells()));
    missing_.assign(values_.size(), 0);
    if (!options_.vertices) return filled_level_values(hierarchy_, field, level, box_, values_, missing_);
    vertex_values(hierarchy_, field, level, box_, values_);
    if (!hierarchy_.has_missing(field)) return;
    own_.resize(static_cast<std::size_t>(chunk.cells()));
    level_values(hierarchy_, field, level, chunk, own_);
    std::size_t i = 0;  // the flags belong to cells and stand at their lower vertex
    for_each_cell(chunk, [&](const Vec3i& c) { missing_[box_.offset(c)] = std::isnan(own_[i++]) ? 1 : 0; });
  }

  void store(int brick, int number) {
    const auto b = static_cast<std::size_t>(brick);
    const Vec3i shift = plan_.packing.at[b] - plan_.bricks[b].texels(options_).lower;
    const int textures = options_.bindless ? brick * field_.field_count : 0;  // of bricks before this one
    HostTexture& texture = out_.values[static_cast<std::size_t>(textures + number)];
    const Box all{Vec3i(0), texture.size};
    const auto row = static_cast<std::size_t>(box_.size().x);
    for (int z = box_.lower.z; z < box_.upper.z; ++z)
      for (int y = box_.lower.y; y < box_.upper.y; ++y) {
        const Vec3i first(box_.lower.x, y, z);
        store_values(texture.format, field_.scale_of(number), &values_[box_.offset(first)], row, texture.data.data(),
                     all.offset(first + shift));
      }
  }

  /// Range and validity bits of what was read.
  void note(int leaf, const Box& chunk, int number) {
    for (const double v : values_) range_.add(v);
    if (out_.validity.data.empty()) {
      any_ = true;
      return;
    }
    const Box cells = plan_.tree.leaves[static_cast<std::size_t>(leaf)].cells;
    std::uint32_t* words =
        out_.validity.as<std::uint32_t>() + data_node(leaf)[plan_.data_words - 1] + number * words_for_bits(cells.cells());
    for_each_cell(chunk, [&](const Vec3i& c) {
      if (missing_[box_.offset(c)] != 0) return;
      any_ = true;
      set_bit(words, static_cast<std::int64_t>(cells.offset(c)));
    });
  }

  /// Of all that a field can return in the leaf; empty where it has no value.
  ValueRange whole_range(int number) const {
    const double leak = leak_[static_cast<std::size_t>(number)];
    return any_ ? ValueRange{range_.min - leak, range_.max + leak} : ValueRange{};
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Options& options_;
  const Plan& plan_;
  const EncodedField& field_;
  Stores& out_;
  std::vector<double> leak_;  ///< of each field
  Box box_;
  std::vector<double> values_, own_;
  std::vector<std::uint8_t> missing_;
  ValueRange range_;
  bool any_ = false;
};

class KdTree final : public Encoding {
 public:
  std::string_view name() const override { return "kd_tree"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {
        {"storage_kind",
         "where bricks are stored: in one texture, or each in its own",
         "pool",
         "\"pool\" or \"bindless\"",
         {"pool", "bindless"}},
        {"packing", "how bricks are packed into the pool", "best_fit", "\"best_fit\" or \"nfdh\""},
        {"traversal", "where the search for a leaf starts: at a grid's cell, or at the root", "grid", "\"grid\" or \"restart\""},
        {"wrap", "is what lies outside of all subgrids of a node split off before it is divided among them?", true,
         "true or false"}};
  }
  void check_parameters(const Json& parameters) const override { options(parameters, {}); }
  Support supported(const ContextInfo&) const override { return {}; }
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
  void require_sizes(const BuildRequest& request, const Options& o, const Plan& p) const;
};

Options KdTree::options(const Json& parameters, const SceneNeeds& needs) const {
  const auto second = [&](const char* name, const char* first_value, const char* second_value) {
    const Json& value = parameters.at(name);
    if (value != first_value && value != second_value)
      throw UsageError(fmt::format("encoding kd_tree: parameter {} is {}; accepted: \"{}\" or \"{}\"", name, value.dump(),
                                   first_value, second_value));
    return value == second_value;
  };
  Options o;
  o.bindless = second("storage_kind", "pool", "bindless");
  o.paper_packing = second("packing", "best_fit", "nfdh");
  o.grid = !second("traversal", "grid", "restart");
  if (!parameters.at("wrap").is_boolean())
    throw UsageError(
        fmt::format("encoding kd_tree: parameter wrap is {}; accepted: true or false", parameters.at("wrap").dump()));
  o.wrap = parameters.at("wrap").get<bool>();
  o.detail = needs.level_of_detail;
  o.vertices = needs.filter == Filter::linear_vertex;
  o.hats = needs.filter == Filter::basis;
  o.border = needs.filter == Filter::linear_lod || (needs.keeps_border() && !o.vertices) ? 1 : 0;
  return o;
}

void KdTree::plan_pool(const BuildRequest& request, const Options& o, Plan& p) const {
  std::vector<Vec3i> sizes;
  Vec3i largest(1);
  for (const Brick& b : p.bricks) {
    sizes.push_back(b.texels(o).size());
    largest = glm::max(largest, sizes.back());
  }
  p.brick_texels = used_texels(sizes);
  const int limit = request.context.max_3d_texture_size;
  if (sizes.empty())
    p.packing.size = Vec3i(1);
  else if (o.bindless && std::max({largest.x, largest.y, largest.z}) <= limit)
    p.packing = {largest, std::vector<Vec3i>(sizes.size(), Vec3i(0))};
  else if (std::max({largest.x, largest.y, largest.z}) <= limit)
    p.packing = o.paper_packing ? pack_nfdh(sizes, limit) : pack_best_fit(sizes, limit);
  if (!p.packing.valid())
    throw UnsupportedError(
        fmt::format("encoding kd_tree: {} bricks of up to {} x {} x {} texels do not fit a 3D texture of {} texels an axis",
                    sizes.size(), largest.x, largest.y, largest.z, limit));
  for (int a = 0; a < 3; ++a) p.position_bits[a] = std::bit_width(static_cast<unsigned>(p.packing.size[a] - 1));
  const int bits = p.position_bits.x + p.position_bits.y + p.position_bits.z;
  if (bits > 32)
    throw UnsupportedError(
        fmt::format("encoding kd_tree: positions in a {} of {} x {} x {} texels take {} bits, a data node has 32",
                    o.bindless ? "brick" : "pool", p.packing.size.x, p.packing.size.y, p.packing.size.z, bits));
}

/// Exact bytes against the limits of the context and of the user, before anything is allocated.
void KdTree::require_sizes(const BuildRequest& request, const Options& o, const Plan& p) const {
  const auto starts = static_cast<std::int64_t>(p.grid.nodes.size());
  const std::int64_t bricks = o.bindless ? std::max<std::int64_t>(p.brick_count(), 1) : 0;
  const std::array<std::pair<const char*, std::int64_t>, 10> buffers{
      {{"nodes", 8 * p.node_count()},
       {"handles", 8 * bricks * request.field_count()},
       {"brick sizes", needs_brick_sizes(request, o) ? 4 * bricks : 0},
       {"data nodes", 4 * std::max<std::int64_t>(p.data_words * p.block_count(), 1)},
       {"levels of data nodes", request.needs.level_of_detail ? 4 * std::max<std::int64_t>(p.block_count(), 1) : 0},
       {"boxes of supports", o.hats ? p.supports.bytes() : 0},
       {"validity bits", 4 * p.validity_words},
       {"value ranges of further fields", MoreRanges::bytes(request, p.block_count())},
       {"the start grid", 4 * static_cast<std::int64_t>(p.grid.entries.size())},
       {"the start grid's nodes", 32 * starts}}};
  std::int64_t bytes = request.field_count() * p.texels(o) * texel_bytes(request.storage);
  for (const auto& [what, size] : buffers) {
    if (size > request.context.max_buffer_bytes)
      throw UnsupportedError(fmt::format("encoding kd_tree: {} take {} bytes, a buffer of this context at most {}", what, size,
                                         request.context.max_buffer_bytes));
    bytes += size;
  }
  require_budget(*this, bytes, request);
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
    if (validity) p.validity_words += request.field_count() * words_for_bits(block.cells.cells());
  }
  p.leaf_bricks = std::count(holds_leaf.begin(), holds_leaf.end(), 1);
  p.data_words = 1 + (o.bindless ? 1 : 0) + (request.needs.value_ranges ? 1 : 0) + (validity ? 1 : 0);
  if (o.bindless) require_handles(*this, kBindless, p.brick_count(), request);
  plan_pool(request, o, p);
  if (o.grid) {
    // of one field: the grid is the same for several
    const std::int64_t others = p.texels(o) * texel_bytes(request.storage) + 8 * p.node_count();
    p.grid = make_start_grid(h, p.tree, std::max<std::int64_t>(others / kGridShare / 4, 1));
  }
  require_sizes(request, o, p);
  return p;
}

/// Texels of one or more bricks, by what they hold.
struct TexelCounts {
  std::int64_t all = 0;
  std::int64_t cells = 0;    ///< of bricks; the rest are borders
  std::int64_t leaves = 0;   ///< leaf cells among them
  std::int64_t refined = 0;  ///< cells that are drawn for a level of detail alone
};

/// A texture of one field's values.
HostTexture make_values(std::string name, const Vec3i& size, const EncodedField& field, const TexelCounts& n) {
  HostTexture t = make_texture(std::move(name), field.storage, size);
  t.hardware_linear = field.filtering == Filtering::hardware;
  t.holds_values = true;
  const int bytes = texel_bytes(t.format);
  t.roles.payload = n.leaves * bytes;
  t.roles.duplicated = (n.all - n.cells + n.refined) * bytes;
  t.roles.padding = t.bytes() - t.roles.payload - t.roles.duplicated;
  return t;
}

std::vector<HostTexture> make_pools(const Plan& p, const EncodedField& field) {
  std::vector<HostTexture> pools;
  TexelCounts n{p.brick_texels, 0, p.leaf_cells, p.detail_cells};
  for (const Brick& b : p.bricks) n.cells += b.cells.cells();
  for (int number = 0; number < field.field_count; ++number)
    pools.push_back(make_values(element_name(kPoolName, number), p.packing.size, field, n));
  return pools;
}

/// Textures of all fields of the first brick, then of the second, ...
std::vector<HostTexture> make_brick_textures(const Options& o, const Plan& p, const EncodedField& field) {
  std::vector<HostTexture> textures;
  for (const Brick& b : p.bricks) {
    const Box texels = b.texels(o);
    TexelCounts n{texels.cells(), b.cells.cells(), 0, 0};
    for (const int leaf : b.leaves) count_block(p.tree.leaves[static_cast<std::size_t>(leaf)], n.leaves, n.refined);
    for (int number = 0; number < field.field_count; ++number) {
      HostTexture& t = textures.emplace_back(make_values(kBricksName, texels.size(), field, n));
      t.handles = kHandlesName;
      t.handle_index = static_cast<std::int64_t>(textures.size()) - 1;
    }
  }
  return textures;
}

std::uint32_t packed(const Plan& p, const Vec3i& texel) {
  return static_cast<std::uint32_t>(texel.x) | (static_cast<std::uint32_t>(texel.y) << p.position_bits.x) |
         (static_cast<std::uint32_t>(texel.z) << (p.position_bits.x + p.position_bits.y));
}

void add_handles(const BuildRequest& request, const Options& o, const Plan& p, EncodedField& field) {
  field.textures.push_back(make_buffer(kHandlesName, TexelFormat::rg32ui, p.brick_count() * field.field_count));
  if (!needs_brick_sizes(request, o)) return;
  HostTexture& sizes = field.textures.emplace_back(make_buffer("kd_brick_sizes", TexelFormat::r32ui, p.brick_count()));
  auto* words = sizes.as<std::uint32_t>();
  for (const Brick& b : p.bricks) *words++ = packed(p, b.texels(o).size() - Vec3i(1));
}

Stores make_stores(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p,
                   const EncodedField& field) {
  Stores out{{}, {}, {}, MoreRanges(encoding, request, "kd_more_ranges", p.block_count())};
  out.values = o.bindless ? make_brick_textures(o, p, field) : make_pools(p, field);
  out.data = make_buffer("kd_data", TexelFormat::r32ui, p.data_words * p.block_count());
  const bool validity = any_missing(h, request);
  if (validity) out.validity = make_buffer("kd_validity", TexelFormat::r32ui, p.validity_words);
  auto* words = out.data.as<std::uint32_t>();
  std::int64_t first_word_of_leaf = 0;
  for (std::size_t i = 0; i < p.tree.leaves.size(); ++i, words += p.data_words) {
    const Leaf& leaf = p.tree.leaves[i];
    const auto brick = static_cast<std::size_t>(p.brick_of[i]);
    const Vec3i at = p.packing.at[brick] + leaf.cells.lower - p.bricks[brick].texels(o).lower;
    words[0] = packed(p, at);
    if (o.bindless) words[1] = static_cast<std::uint32_t>(brick);
    if (!validity) continue;
    words[p.data_words - 1] = static_cast<std::uint32_t>(first_word_of_leaf);
    first_word_of_leaf += request.field_count() * words_for_bits(leaf.cells.cells());
  }
  return out;
}

Stores store_bricks(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p,
                    const EncodedField& field) {
  Stores out = make_stores(encoding, h, request, o, p, field);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, p.bricks.size(), 1), [&](const auto& range) {
    BrickWriter writer(h, request, o, p, field, out);
    for (std::size_t i = range.begin(); i != range.end(); ++i) writer.write(static_cast<int>(i));
  });
  return out;
}

HostTexture make_nodes(const Tree& tree) {
  HostTexture nodes = make_buffer("kd_nodes", TexelFormat::rg32ui, static_cast<std::int64_t>(tree.nodes.size()));
  auto* words = nodes.as<std::uint32_t>();
  for (const Node& n : tree.nodes) {
    *words++ = first_word(n);
    *words++ = second_word(n);
  }
  return nodes;
}

HostTexture make_detail(const Tree& tree) {
  HostTexture detail = make_buffer("kd_detail", TexelFormat::r32ui, static_cast<std::int64_t>(tree.leaves.size()));
  std::transform(tree.leaves.begin(), tree.leaves.end(), detail.as<std::uint32_t>(), detail_word);
  return detail;
}

void add_start_grid(const AmrHierarchy& h, const Plan& p, EncodedField& field) {
  HostTexture entries = make_buffer("kd_start", TexelFormat::r32ui, static_cast<std::int64_t>(p.grid.entries.size()));
  std::copy(p.grid.entries.begin(), p.grid.entries.end(), entries.as<std::uint32_t>());
  HostTexture nodes = make_buffer("kd_start_nodes", TexelFormat::rgba32ui, 2 * static_cast<std::int64_t>(p.grid.nodes.size()));
  const std::vector<Box> boxes = node_boxes(h, p.tree);
  auto* words = nodes.as<std::uint32_t>();
  for (const std::uint32_t node : p.grid.nodes) {
    write_box(boxes[node], node, 0, words);
    words += 8;
  }
  field.textures.push_back(std::move(entries));
  field.textures.push_back(std::move(nodes));
  field.integer_uniforms.emplace_back("u_kd_grid", p.grid.cells);
  field.integer_uniforms.emplace_back("u_kd_grid_width", Vec3i(p.grid.width, 0, 0));
}

void add_defines(const Options& o, const Plan& p, EncodedField& field) {
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_KD_DEPTH", o.grid ? p.grid.depth : p.tree.depth);
  defines.emplace_back("AMRTEX_KD_GRID", o.grid ? 1 : 0);
  defines.emplace_back("AMRTEX_KD_VERTICES", o.vertices ? 1 : 0);
  defines.emplace_back("AMRTEX_KD_DATA_WORDS", p.data_words);
  defines.emplace_back("AMRTEX_KD_X_BITS", p.position_bits.x);
  defines.emplace_back("AMRTEX_KD_Y_BITS", p.position_bits.y);
  defines.emplace_back("AMRTEX_KD_BINDLESS", o.bindless ? 1 : 0);
  if (o.bindless) return;
  defines.emplace_back("AMRTEX_POOL_X", p.packing.size.x);
  defines.emplace_back("AMRTEX_POOL_Y", p.packing.size.y);
  defines.emplace_back("AMRTEX_POOL_Z", p.packing.size.z);
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
  json["pool"] = o.bindless ? Json(nullptr) : Json{p.packing.size.x, p.packing.size.y, p.packing.size.z};
  json["fill"] = static_cast<double>(p.brick_texels) / static_cast<double>(std::max<std::int64_t>(p.texels(o), 1));
  json["start_grid"] = o.grid ? Json{p.grid.cells.x, p.grid.cells.y, p.grid.cells.z} : Json(nullptr);
  json["start_depth"] = o.grid ? p.grid.depth : t.depth;
  return json;
}

/// Texels of subgrids that others refine everywhere, and of the parts of others around which no leaf cell lies.
std::int64_t undrawn_cells(const AmrHierarchy& h, const Plan& p) {
  std::int64_t cells = h.stored_cells() - p.pruned.brick_cells;
  for (const Brick& b : p.bricks) cells -= b.cells.cells();
  return cells;
}

std::vector<LeftOut> left_out(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p) {
  std::vector<LeftOut> list;
  const std::int64_t value_bytes = std::int64_t{request.field_count()} * texel_bytes(request.storage);
  if (p.pruned.leaves > 0)
    list.push_back({"leaves, and what they leave of bricks", "the transfer function hides all that is in them",
                    p.pruned.brick_texels * value_bytes + 4 * p.data_words * p.pruned.leaves + p.pruned.support_bytes,
                    Part::hidden});
  if (!any_missing(h, request)) {
    std::int64_t words = p.block_count();
    for (const Leaf& leaf : p.tree.leaves) words += request.field_count() * words_for_bits(leaf.cells.cells());
    list.push_back({"validity bits", "every cell has a value", 4 * words, Part::validity});
  }
  if (!request.needs.value_ranges)
    list.push_back({"value ranges", "no region is skipped", 4 * p.block_count(), Part::value_ranges});
  if (const std::int64_t cells = undrawn_cells(h, p); cells > 0)
    list.push_back({"refined parts of subgrids", "no level of detail is drawn", cells * value_bytes});
  if (!o.vertices && o.border == 0)
    list.push_back(border_left_out(
        p.bricks, o.hats ? "each sample searches the cells around it" : "the filter nearest reads one cell", request));
  return list;
}

EncodedField KdTree::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters, request.needs);
  const Plan p = plan(h, request, o);

  EncodedField field = start_field(*this, h, request, parameters);
  Stores stores = store_bricks(*this, h, request, o, p, field);
  field.statistics = statistics(o, p);
  add_defines(o, p, field);
  field.left_out = left_out(h, request, o, p);
  field.textures.push_back(make_nodes(p.tree));
  field.textures.push_back(std::move(stores.data));
  if (o.detail) field.textures.push_back(make_detail(p.tree));
  if (o.grid) add_start_grid(h, p, field);
  if (o.hats) field.textures.push_back(p.supports.texture());
  if (o.bindless) {
    add_handles(request, o, p, field);
    add_handle_access(request.context, field);
  }
  for (HostTexture& texture : stores.values) field.textures.push_back(std::move(texture));
  if (!stores.validity.data.empty()) field.textures.push_back(std::move(stores.validity));
  stores.more_ranges.move_to(field);
  if (request.needs.draw_boxes) field.draw_tree = make_draw_tree(h, p.tree);
  field.host_peak_bytes =
      field.memory().total() +
      static_cast<std::int64_t>(p.tree.nodes.size() * (sizeof(Node) + sizeof(Box)) + p.hats.size() * sizeof(HatNode)) +
      field.draw_tree.bytes();
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_kd_tree() { return std::make_unique<KdTree>(); }

}  // namespace amrtex
