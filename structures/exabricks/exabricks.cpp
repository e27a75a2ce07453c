#include "exabricks.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <atomic>
#include <bit>
#include <cmath>

#include "bricks.hpp"
#include "bvh.hpp"
#include "exabricks_layout.h"
#include "regions.hpp"
#include "structures/common/brick_packing.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/kd_tree/start_grid.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex {
namespace {

using namespace exa;

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::basis};

constexpr int kNarrowestBrick = 2;
constexpr int kWidestBrick = 256;
/// A start grid takes at most this part of what the other bytes of one field are.
constexpr std::int64_t kGridShare = 16;
constexpr int kMiddleOffset = 1 << (AMRTEX_EXA_OFFSET_BITS - 1);

enum class Traversal { grid, kd, bvh };

struct Options {
  int brick_width = 32;
  int border = 1;
  Traversal traversal = Traversal::grid;
  bool cells = false;  ///< each sample searches its cells
  bool hats = false;   ///< filter basis
};

struct Plan {
  BrickTree tree;
  RegionSet set;
  kd::Packing packing;
  kd::StartGrid grid;
  SupportList supports;  ///< of bricks, where samples search them
  std::vector<BvhNode> bvh;
  std::vector<std::int64_t> leaf_region;  ///< of an item of the BVH; -1: no mesh
  std::vector<std::int64_t> first_piece;  ///< of a region, among those that are stored
  std::int64_t stored_pieces = 0;
  bool cells_missing = false;  ///< do bricks hold cells without value?
  bool missing = false;        ///< are there bits that tell so?
  Vec3i texel_bits{0};         ///< of a packed texel
  std::int64_t validity_words = 0;
  std::int64_t brick_texels = 0;
  std::int64_t brick_cells = 0;
  /// A plain region needs none, but may turn out to have cells without value.
  bool keeps_pieces(const Options& o, const Region& r) const { return o.hats && !o.cells && (!r.plain || cells_missing); }
  std::int64_t regions() const { return static_cast<std::int64_t>(set.regions.size()); }
  std::int64_t bricks() const { return static_cast<std::int64_t>(tree.bricks.size()); }
};

/// Where the region's lower corner lies from the piece's, in cell widths of the region.
Vec3i corner_offset(const AmrHierarchy& h, const Plan& p, const Region& r, const Piece& piece) {
  const Brick& b = p.tree.bricks[static_cast<std::size_t>(piece.brick)];
  return (r.box.lower - piece.cells.lower * b.width) / h.cell_width(r.level);
}

/// Past the last texel of a piece the rounding of the normalised coordinate (3 times 2^-24 of the pool an axis) lets the
/// texture unit see a little of the next texel.
double leaked_value(const FieldStatistics& s, const Vec3i& pool) {
  const double weight = 3 * std::ldexp(3.0, -24) * std::max({pool.x, pool.y, pool.z});
  return weight * std::max({s.max - s.min, std::abs(s.min), std::abs(s.max)});
}

struct Stores {
  std::vector<HostTexture> pools;  ///< one a field, all laid out in the same way
  HostTexture validity;            ///< without data where every cell of a brick has a value
};

/// Do two threads write the same word? Bits of a brick's texels share words with other bricks'.
void set_shared_bit(std::uint32_t* words, std::size_t bit) {
  std::atomic_ref<std::uint32_t>(words[bit / 32]).fetch_or(1U << (bit % 32), std::memory_order_relaxed);
}

/// Writes the values of bricks and their borders. One object a thread; a brick is one thread's.
class BrickWriter {
 public:
  BrickWriter(const AmrHierarchy& h, const BuildRequest& request, const Plan& plan, int border, const EncodedField& field,
              Stores& out)
      : hierarchy_(h), request_(request), plan_(plan), border_(border), field_(field), out_(out) {}

  void write(std::size_t brick) {
    const Brick& b = plan_.tree.bricks[brick];
    box_ = b.cells.grown(border_);
    for (int number = 0; number < field_.field_count; ++number) {
      read(b.level, request_.field_at(number));
      for (const Repeat& r : plan_.set.repeats[brick]) values_[box_.offset(r.cell)] = values_[box_.offset(r.source)];
      store(brick, number);
    }
  }

 private:
  void read(int level, int field) {
    values_.resize(static_cast<std::size_t>(box_.cells()));
    missing_.assign(values_.size(), 0);
    if (border_ > 0) return filled_level_values(hierarchy_, field, level, box_, values_, missing_);
    level_values(hierarchy_, field, level, box_, values_);
    for (std::size_t i = 0; i < values_.size(); ++i) missing_[i] = std::isnan(values_[i]) ? 1 : 0;
  }

  void store(std::size_t brick, int number) {
    const Vec3i shift = plan_.packing.at[brick] - box_.lower;
    HostTexture& pool = out_.pools[static_cast<std::size_t>(number)];
    const Box all{Vec3i(0), pool.size};
    const auto row = static_cast<std::size_t>(box_.size().x);
    for (int z = box_.lower.z; z < box_.upper.z; ++z)
      for (int y = box_.lower.y; y < box_.upper.y; ++y) {
        const Vec3i first(box_.lower.x, y, z);
        store_values(pool.format, field_.scale_of(number), &values_[box_.offset(first)], row, pool.data.data(),
                     all.offset(first + shift));
      }
    if (out_.validity.data.empty()) return;
    auto* words = out_.validity.as<std::uint32_t>() + number * plan_.validity_words;
    std::size_t i = 0;
    for_each_cell(box_, [&](const Vec3i& c) {
      if (missing_[i++] == 0) set_shared_bit(words, all.offset(c + shift));
    });
  }

  const AmrHierarchy& hierarchy_;
  const BuildRequest& request_;
  const Plan& plan_;
  int border_;
  const EncodedField& field_;
  Stores& out_;
  Box box_;
  std::vector<double> values_;
  std::vector<std::uint8_t> missing_;
};

/// What the stored cells of a region's pieces say of it.
struct RegionFacts {
  ValueRange range;      ///< of field 0, as stored
  bool missing = false;  ///< has a cell no value, in any field?
};

/// Has a texel of the pool a value in a field?
bool has_value(const Plan& p, const Stores& stores, int number, std::size_t texel) {
  const auto* words = stores.validity.as<std::uint32_t>() + number * p.validity_words;
  return ((words[texel / 32] >> (texel % 32)) & 1U) != 0;
}

/// Calls f(texel) for every stored cell of a region's pieces.
template <class F>
void for_each_stored_cell(const Plan& p, int border, const Region& r, const HostTexture& pool, F&& f) {
  const Box all{Vec3i(0), pool.size};
  for (int k = 0; k < r.pieces; ++k) {
    const Piece& piece = p.set.pieces[static_cast<std::size_t>(r.first_piece + k)];
    const auto brick = static_cast<std::size_t>(piece.brick);
    const Vec3i shift = p.packing.at[brick] + Vec3i(border) - p.tree.bricks[brick].cells.lower;
    for_each_cell(piece.cells, [&](const Vec3i& c) { f(all.offset(c + shift)); });
  }
}

RegionFacts region_facts(const Plan& p, int border, const Region& r, const Stores& stores, StorageScale scale) {
  RegionFacts facts;
  const HostTexture& pool = stores.pools.front();
  for_each_stored_cell(p, border, r, pool, [&](std::size_t texel) {
    bool has = true;
    for (std::size_t number = 0; p.missing && number < stores.pools.size(); ++number) {
      const bool bit = has_value(p, stores, static_cast<int>(number), texel);
      if (number == 0) has = bit;
      facts.missing = facts.missing || !bit;
    }
    if (has) facts.range.add(load_value(pool.format, scale, pool.data.data(), texel));
  });
  return facts;
}

/// Of the cells of a region's pieces in a field, as stored.
ValueRange range_in_field(const Plan& p, int border, const Region& r, const Stores& stores, StorageScale scale, int number) {
  ValueRange range;
  const HostTexture& pool = stores.pools[static_cast<std::size_t>(number)];
  for_each_stored_cell(p, border, r, pool, [&](std::size_t texel) {
    if (!p.missing || has_value(p, stores, number, texel)) range.add(load_value(pool.format, scale, pool.data.data(), texel));
  });
  return range;
}

class Exabricks final : public Encoding {
 public:
  std::string_view name() const override { return "exabricks"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {
        {"brick_width",
         "cells of a brick along an axis, at most",
         32,
         fmt::format("an integer from {} to {}", kNarrowestBrick, kWidestBrick),
         {16, 32, 64}},
        {"border", "texels around a brick that hold its neighbours' cells (filter basis)", 1, "0 or 1"},
        {"locate", "who finds the cells of a sample (filter basis): its region knows them, or each sample searches", "regions",
         "\"regions\" or \"cells\""},
        {"traversal", "how the region of a place is found: down the planes from a grid's cell or from the root, or through a BVH",
         "grid", "\"grid\", \"kd\" or \"bvh\""}};
  }
  void check_parameters(const Json& parameters) const override { options(parameters, {.filter = Filter::basis}); }
  Support supported(const ContextInfo&) const override { return {}; }
  Support analytic_gradients(Filter filter) const override {
    return filter == Filter::basis ? Support{} : Support{false, "a value a cell has no derivative"};
  }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters, const SceneNeeds& needs) const;
  Plan plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const;
  void plan_pool(const BuildRequest& request, const Options& o, Plan& p) const;
  void plan_traversal(const AmrHierarchy& h, const BuildRequest& request, const Options& o, Plan& p) const;
  void require_offsets(const AmrHierarchy& h, const Plan& p, const Region& r) const;
  void require_sizes(const BuildRequest& request, const Options& o, const Plan& p) const;
};

Options Exabricks::options(const Json& parameters, const SceneNeeds& needs) const {
  const auto bad = [&](const char* name, const char* accepted) {
    throw UsageError(
        fmt::format("encoding exabricks: parameter {} is {}; accepted: {}", name, parameters.at(name).dump(), accepted));
  };
  Options o;
  o.brick_width = integer_parameter(*this, parameters, "brick_width");
  if (o.brick_width < kNarrowestBrick || o.brick_width > kWidestBrick)
    bad("brick_width", fmt::format("an integer from {} to {}", kNarrowestBrick, kWidestBrick).c_str());
  o.border = integer_parameter(*this, parameters, "border");
  if (o.border != 0 && o.border != 1) bad("border", "0 or 1");
  const Json& traversal = parameters.at("traversal");
  if (traversal != "grid" && traversal != "kd" && traversal != "bvh") bad("traversal", R"("grid", "kd" or "bvh")");
  o.traversal = traversal == "grid" ? Traversal::grid : traversal == "kd" ? Traversal::kd : Traversal::bvh;
  const Json& locate = parameters.at("locate");
  if (locate != "regions" && locate != "cells") bad("locate", R"("regions" or "cells")");
  o.hats = needs.filter == Filter::basis;
  o.cells = o.hats && locate == "cells";
  if (!o.hats) o.border = needs.keeps_border() ? 1 : 0;
  return o;
}

void Exabricks::plan_pool(const BuildRequest& request, const Options& o, Plan& p) const {
  std::vector<Vec3i> sizes;
  Vec3i largest(1);
  for (const Brick& b : p.tree.bricks) {
    sizes.push_back(b.cells.grown(o.border).size());
    largest = glm::max(largest, sizes.back());
    p.brick_cells += b.cells.cells();
  }
  p.brick_texels = kd::used_texels(sizes);
  const int limit = request.context.max_3d_texture_size;
  if (sizes.empty())
    p.packing.size = Vec3i(1);
  else if (std::max({largest.x, largest.y, largest.z}) <= limit)
    p.packing = kd::pack_best_fit(sizes, limit);
  if (!p.packing.valid())
    throw UnsupportedError(
        fmt::format("encoding exabricks: {} bricks of up to {} x {} x {} texels do not fit a 3D texture of {} texels an axis",
                    sizes.size(), largest.x, largest.y, largest.z, limit));
  for (int a = 0; a < 3; ++a) p.texel_bits[a] = std::bit_width(static_cast<unsigned>(p.packing.size[a] - 1));
  if (const int bits = p.texel_bits.x + p.texel_bits.y + p.texel_bits.z; bits > 32)
    throw UnsupportedError(fmt::format("encoding exabricks: texels of a pool of {} x {} x {} take {} bits, a brick tells 32",
                                       p.packing.size.x, p.packing.size.y, p.packing.size.z, bits));
  if (p.missing) p.validity_words = words_for_bits(p.packing.texels());
}

/// The planes as the start grid's builder takes them.
kd::Tree as_kd_tree(const AmrHierarchy& h, const RegionSet& set) {
  kd::Tree tree;
  std::vector<Box> boxes(set.nodes.size());
  boxes[0] = h.domain(h.finest_level());
  for (std::size_t i = 0; i < set.nodes.size(); ++i) {
    const RegionNode& n = set.nodes[i];
    kd::Node node;
    node.level = h.finest_level();
    node.leaf = n.region;
    if (n.first_child != 0) {
      node.first_child = static_cast<std::uint32_t>(n.first_child);
      node.axis = n.axis;
      node.split = n.plane - boxes[i].lower[n.axis];
      const auto child = static_cast<std::size_t>(n.first_child);
      boxes[child] = boxes[child + 1] = boxes[i];
      boxes[child].upper[n.axis] = boxes[child + 1].lower[n.axis] = n.plane;
    }
    tree.nodes.push_back(node);
  }
  tree.depth = set.depth;
  return tree;
}

void Exabricks::plan_traversal(const AmrHierarchy& h, const BuildRequest& request, const Options& o, Plan& p) const {
  if (o.traversal == Traversal::kd) return;
  const kd::Tree tree = as_kd_tree(h, p.set);
  if (o.traversal == Traversal::grid) {
    const std::int64_t others =
        p.packing.texels() * texel_bytes(request.storage) + 8 * static_cast<std::int64_t>(p.set.nodes.size());
    p.grid = kd::make_start_grid(h, tree, std::max<std::int64_t>(others / kGridShare / 4, 1));
    return;
  }
  const std::vector<Box> boxes = kd::node_boxes(h, tree);
  std::vector<Box> leaves;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (tree.nodes[i].first_child != 0) continue;
    leaves.push_back(boxes[i]);
    p.leaf_region.push_back(tree.nodes[i].leaf);
  }
  p.bvh = BvhBuilder(leaves).build();
}

/// Exact bytes against the limits of the context and of the user, before anything is allocated.
void Exabricks::require_sizes(const BuildRequest& request, const Options& o, const Plan& p) const {
  const auto nodes = static_cast<std::int64_t>(p.set.nodes.size());
  const std::array<std::pair<const char*, std::int64_t>, 11> buffers{
      {{"regions", 32 * std::max<std::int64_t>(p.regions(), 1)},
       {"value ranges", request.needs.value_ranges ? 4 * std::max<std::int64_t>(p.regions(), 1) : 0},
       {"bricks", o.cells ? 32 * std::max<std::int64_t>(p.bricks(), 1) : 0},
       {"pieces", o.hats && !o.cells ? 16 * std::max<std::int64_t>(p.stored_pieces, 1) : 0},
       {"nodes over the regions", o.traversal == Traversal::bvh ? 0 : 8 * nodes},
       {"the BVH over the regions", 32 * static_cast<std::int64_t>(p.bvh.size())},
       {"the start grid", 4 * static_cast<std::int64_t>(p.grid.entries.size())},
       {"the start grid's nodes", 32 * static_cast<std::int64_t>(p.grid.nodes.size())},
       {"boxes of supports", o.cells ? p.supports.bytes() : 0},
       {"validity bits", 4 * request.field_count() * p.validity_words},
       {"value ranges of further fields", MoreRanges::bytes(request, p.regions())}}};
  const std::string remedy = o.brick_width < kWidestBrick
                                 ? fmt::format("; a brick_width above {} makes fewer, up to {}", o.brick_width, kWidestBrick)
                                 : std::string();
  std::int64_t bytes = request.field_count() * p.packing.texels() * texel_bytes(request.storage);
  for (const auto& [what, size] : buffers) {
    if (size > request.context.max_buffer_bytes)
      throw UnsupportedError(
          fmt::format("encoding exabricks: {} take {} bytes for {} bricks and {} regions, a buffer of this context at most {}{}",
                      what, size, p.bricks(), p.regions(), request.context.max_buffer_bytes, remedy));
    bytes += size;
  }
  try {
    require_budget(*this, bytes, request);
  } catch (const BudgetError& e) {
    throw BudgetError(fmt::format("{}; {} bricks and {} regions{}", e.what(), p.bricks(), p.regions(), remedy), e.needed_bytes());
  }
}

/// A piece tells where its region lies in 16 bits an axis, enough but for jumps over very many levels.
void Exabricks::require_offsets(const AmrHierarchy& h, const Plan& p, const Region& r) const {
  for (int k = 0; k < r.pieces; ++k) {
    const Vec3i offset = corner_offset(h, p, r, p.set.pieces[static_cast<std::size_t>(r.first_piece + k)]);
    for (int a = 0; a < 3; ++a)
      if (std::abs(offset[a]) >= kMiddleOffset)
        throw UnsupportedError(
            fmt::format("encoding exabricks: a region lies {} of its cells from cells that reach into it, a piece tells "
                        "less than {}; levels that meet differ by too much",
                        std::abs(offset[a]), kMiddleOffset));
  }
}

Plan Exabricks::plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const {
  if (h.level_count() > (1 << AMRTEX_EXA_LEVEL_BITS))
    throw UnsupportedError(
        fmt::format("encoding exabricks: {} levels, a region tells at most {}", h.level_count(), 1 << AMRTEX_EXA_LEVEL_BITS));
  Plan p;
  p.tree = build_bricks(h, o.brick_width);
  p.set = build_regions(h, p.tree, {o.hats ? o.border : 0, o.hats, !o.cells});
  if (o.cells) p.supports = SupportList(p.tree.nodes, [](const BrickNode& n) { return static_cast<std::uint32_t>(n.brick + 1); });
  if (p.set.nodes.size() >= std::size_t{1} << AMRTEX_EXA_CHILD_BITS)
    throw UnsupportedError(fmt::format("encoding exabricks: {} nodes over {} regions, a child's index has {} bits",
                                       p.set.nodes.size(), p.regions(), AMRTEX_EXA_CHILD_BITS));
  for (int number = 0; number < request.field_count(); ++number)
    p.cells_missing = p.cells_missing || h.statistics(request.field_at(number)).cells_without_value > 0;
  p.missing = p.cells_missing || request.needs.keeps_validity();
  for (const Region& r : p.set.regions) {
    if (r.pieces >= 1 << AMRTEX_EXA_PIECE_BITS)
      throw UnsupportedError(fmt::format("encoding exabricks: {} pieces reach into one region, it tells less than {}", r.pieces,
                                         1 << AMRTEX_EXA_PIECE_BITS));
    p.first_piece.push_back(p.stored_pieces);
    if (!p.keeps_pieces(o, r)) continue;
    p.stored_pieces += r.pieces;
    require_offsets(h, p, r);
  }
  plan_pool(request, o, p);
  plan_traversal(h, request, o, p);
  require_sizes(request, o, p);
  return p;
}

Stores make_stores(const AmrHierarchy& h, const Plan& p, const EncodedField& field) {
  Stores out;
  for (int number = 0; number < field.field_count; ++number) {
    HostTexture& pool = out.pools.emplace_back(make_texture(element_name("tex_exa_pool", number), field.storage, p.packing.size));
    pool.hardware_linear = field.filtering == Filtering::hardware;
    pool.holds_values = true;
    const int bytes = texel_bytes(pool.format);
    pool.roles = {};
    pool.roles.payload = h.leaf_cells() * bytes;
    pool.roles.duplicated = (p.brick_texels - p.brick_cells) * bytes;
    pool.roles.padding = pool.bytes() - pool.roles.payload - pool.roles.duplicated;
  }
  if (p.missing) out.validity = make_buffer("exa_validity", TexelFormat::r32ui, field.field_count * p.validity_words);
  return out;
}

Stores store_bricks(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p,
                    const EncodedField& field) {
  Stores out = make_stores(h, p, field);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, p.tree.bricks.size()), [&](const auto& range) {
    BrickWriter writer(h, request, p, o.border, field, out);
    for (std::size_t i = range.begin(); i != range.end(); ++i) writer.write(i);
  });
  return out;
}

std::uint32_t packed_texel(const Plan& p, const Vec3i& texel) {
  return static_cast<std::uint32_t>(texel.x) | static_cast<std::uint32_t>(texel.y) << p.texel_bits.x |
         static_cast<std::uint32_t>(texel.z) << (p.texel_bits.x + p.texel_bits.y);
}

std::uint32_t packed_size(const Vec3i& size) {
  return static_cast<std::uint32_t>(size.x) | static_cast<std::uint32_t>(size.y) << AMRTEX_EXA_SIZE_BITS |
         static_cast<std::uint32_t>(size.z) << (2 * AMRTEX_EXA_SIZE_BITS);
}

/// The regions as the shader reads them, and what is known of their cells.
struct RegionTables {
  HostTexture regions, ranges;
  MoreRanges more_ranges;
  std::vector<RegionFacts> facts;
  double leak = 0;
};

/// What a group of regions may hold, coded: with holes or missing cells any value, since rays may not pass it as if it had a
/// side.
constexpr std::uint32_t kAnyRange = 0x7f80ff80U;

std::uint32_t coded_range(const BuildRequest& request, const EncodedField& field, const RegionFacts& facts, double leak) {
  if (facts.range.empty()) return kVacantRange;
  return encode_range({facts.range.min - leak, facts.range.max + leak}, field.range_origin, request.storage, field.scale);
}

RegionTables make_regions(const Encoding& encoding, const AmrHierarchy& h, const BuildRequest& request, const Options& o,
                          const Plan& p, const EncodedField& field, const Stores& stores) {
  RegionTables out{{}, {}, MoreRanges(encoding, request, "exa_more_ranges", p.regions()), {}};
  out.regions = make_buffer("exa_regions", TexelFormat::rgba32ui, 2 * p.regions());
  if (request.needs.value_ranges) out.ranges = make_buffer("exa_ranges", TexelFormat::r32ui, p.regions());
  out.facts.resize(p.set.regions.size());
  const HostTexture& pool = stores.pools.front();
  out.leak = pool.hardware_linear ? leaked_value(h.statistics(request.field), pool.size) : 0;
  tbb::parallel_for(std::size_t{0}, p.set.regions.size(), [&](std::size_t i) {
    const Region& r = p.set.regions[i];
    const auto brick = static_cast<std::size_t>(r.brick);
    const Brick& b = p.tree.bricks[brick];
    RegionFacts& facts = out.facts[i];
    if (p.missing || request.needs.value_ranges) facts = region_facts(p, o.border, r, stores, field.scale);
    const bool plain = r.plain && (!o.hats || !facts.missing);
    auto* words = out.regions.as<std::uint32_t>() + i * 8;
    words[0] = packed_texel(p, p.packing.at[brick] + Vec3i(o.border));
    words[1] = packed_size(b.cells.size());
    words[2] = static_cast<std::uint32_t>(p.first_piece[i]);
    words[3] = static_cast<std::uint32_t>(r.pieces) | static_cast<std::uint32_t>(b.level) << AMRTEX_EXA_PIECE_BITS |
               static_cast<std::uint32_t>(r.level) << (AMRTEX_EXA_PIECE_BITS + AMRTEX_EXA_LEVEL_BITS + 1) |
               (plain ? AMRTEX_EXA_PLAIN_FLAG : 0U) | (facts.missing ? AMRTEX_EXA_MISSING_FLAG : 0U) |
               (r.own ? AMRTEX_EXA_OWN_FLAG : 0U);
    for (int a = 0; a < 3; ++a) words[4 + a] = static_cast<std::uint32_t>(b.box().lower[a]);
    words[7] = static_cast<std::uint32_t>(r.brick);
    if (request.needs.value_ranges) out.ranges.as<std::uint32_t>()[i] = coded_range(request, field, facts, out.leak);
    for (int number = 1; out.more_ranges.needed() && number < field.field_count; ++number) {
      ValueRange range = range_in_field(p, o.border, r, stores, field.scale_of(number), number);
      const double leak = pool.hardware_linear ? leaked_value(h.statistics(request.field_at(number)), pool.size) : 0;
      if (!range.empty()) range = {range.min - leak, range.max + leak};
      out.more_ranges.set(field, static_cast<std::int64_t>(i), number, range);
    }
  });
  return out;
}

/// Of all regions below each node; `missing` where there are holes or cells without value.
std::vector<RegionFacts> facts_of_nodes(const Plan& p, const std::vector<RegionFacts>& regions) {
  std::vector<RegionFacts> nodes(p.set.nodes.size());
  for (std::size_t i = nodes.size(); i-- > 0;) {
    const RegionNode& n = p.set.nodes[i];
    if (n.first_child == 0) {
      if (n.region < 0)
        nodes[i].missing = true;
      else
        nodes[i] = regions[static_cast<std::size_t>(n.region)];
      continue;
    }
    for (const int child : {n.first_child, n.first_child + 1}) {
      const RegionFacts& part = nodes[static_cast<std::size_t>(child)];
      nodes[i].missing = nodes[i].missing || part.missing;
      if (part.range.empty()) continue;
      nodes[i].range.add(part.range.min);
      nodes[i].range.add(part.range.max);
    }
  }
  return nodes;
}

HostTexture make_bricks(const Options& o, const Plan& p) {
  HostTexture bricks = make_buffer("exa_bricks", TexelFormat::rgba32ui, 2 * p.bricks());
  auto* words = bricks.as<std::uint32_t>();
  for (std::size_t i = 0; i < p.tree.bricks.size(); ++i, words += 8) {
    const Brick& b = p.tree.bricks[i];
    for (int a = 0; a < 3; ++a) words[a] = static_cast<std::uint32_t>(b.box().lower[a]);
    words[3] = static_cast<std::uint32_t>(b.level);
    words[6] = packed_texel(p, p.packing.at[i] + Vec3i(o.border));
    words[7] = packed_size(b.cells.size());
  }
  return bricks;
}

HostTexture make_pieces(const AmrHierarchy& h, const Options& o, const Plan& p) {
  HostTexture pieces = make_buffer("exa_pieces", TexelFormat::rgba32ui, p.stored_pieces);
  auto* words = pieces.as<std::uint32_t>();
  for (const Region& r : p.set.regions)
    for (int k = 0; p.keeps_pieces(o, r) && k < r.pieces; ++k, words += 4) {
      const Piece& piece = p.set.pieces[static_cast<std::size_t>(r.first_piece + k)];
      const auto brick = static_cast<std::size_t>(piece.brick);
      const Brick& b = p.tree.bricks[brick];
      words[0] = packed_texel(p, p.packing.at[brick] + Vec3i(o.border) + piece.cells.lower - b.cells.lower);
      words[1] = packed_size(piece.cells.size());
      const Vec3i offset = corner_offset(h, p, r, piece) + Vec3i(kMiddleOffset);
      words[2] = static_cast<std::uint32_t>(offset.x) | static_cast<std::uint32_t>(offset.y) << AMRTEX_EXA_OFFSET_BITS;
      words[3] = static_cast<std::uint32_t>(offset.z) | static_cast<std::uint32_t>(b.level) << AMRTEX_EXA_OFFSET_BITS;
    }
  return pieces;
}

HostTexture make_nodes(const RegionSet& set) {
  HostTexture nodes = make_buffer("exa_nodes", TexelFormat::rg32ui, static_cast<std::int64_t>(set.nodes.size()));
  auto* words = nodes.as<std::uint32_t>();
  for (const RegionNode& n : set.nodes) {
    *words++ = static_cast<std::uint32_t>(n.first_child) | static_cast<std::uint32_t>(n.axis) << AMRTEX_EXA_CHILD_BITS;
    *words++ = n.first_child != 0 ? static_cast<std::uint32_t>(n.plane)
               : n.region < 0     ? AMRTEX_EXA_NO_REGION
                                  : static_cast<std::uint32_t>(n.region);
  }
  return nodes;
}

HostTexture make_bvh(const Plan& p) {
  HostTexture bvh = make_buffer("exa_bvh", TexelFormat::rgba32ui, 2 * static_cast<std::int64_t>(p.bvh.size()));
  auto* words = bvh.as<std::uint32_t>();
  for (const BvhNode& n : p.bvh) {
    const std::int64_t region = n.item < 0 ? -1 : p.leaf_region[static_cast<std::size_t>(n.item)];
    const std::uint32_t code = n.item < 0 ? 0U : region < 0 ? AMRTEX_EXA_NO_REGION : static_cast<std::uint32_t>(region + 1);
    write_box(n.box, code, static_cast<std::uint32_t>(n.skip), words);
    words += 8;
  }
  return bvh;
}

void add_start_grid(const AmrHierarchy& h, const BuildRequest& request, const Plan& p, const RegionTables& tables,
                    EncodedField& field) {
  HostTexture entries = make_buffer("exa_start", TexelFormat::r32ui, static_cast<std::int64_t>(p.grid.entries.size()));
  std::copy(p.grid.entries.begin(), p.grid.entries.end(), entries.as<std::uint32_t>());
  HostTexture nodes = make_buffer("exa_start_nodes", TexelFormat::rgba32ui, 2 * static_cast<std::int64_t>(p.grid.nodes.size()));
  const std::vector<Box> boxes = kd::node_boxes(h, as_kd_tree(h, p.set));
  auto* words = nodes.as<std::uint32_t>();
  std::vector<RegionFacts> facts;
  if (request.needs.value_ranges) facts = facts_of_nodes(p, tables.facts);
  for (const std::uint32_t node : p.grid.nodes) {
    const std::uint32_t range = facts.empty()         ? 0U
                                : facts[node].missing ? kAnyRange
                                                      : coded_range(request, field, facts[node], tables.leak);
    write_box(boxes[node], node, range, words);
    words += 8;
  }
  field.textures.push_back(std::move(entries));
  field.textures.push_back(std::move(nodes));
  field.integer_uniforms.emplace_back("u_exa_grid", p.grid.cells);
  field.integer_uniforms.emplace_back("u_exa_grid_width", Vec3i(p.grid.width, 0, 0));
}

void add_defines(const Options& o, const Plan& p, EncodedField& field) {
  auto& defines = field.shader.defines;
  const int depth = o.traversal == Traversal::grid ? p.grid.depth
                    : o.traversal == Traversal::kd ? p.set.depth
                                                   : static_cast<int>(p.bvh.size());
  defines.emplace_back("AMRTEX_EXA_DEPTH", depth);
  defines.emplace_back("AMRTEX_EXA_GRID", o.traversal == Traversal::grid ? 1 : 0);
  defines.emplace_back("AMRTEX_EXA_BVH", o.traversal == Traversal::bvh ? 1 : 0);
  defines.emplace_back("AMRTEX_EXA_CELLS", o.cells ? 1 : 0);
  defines.emplace_back("AMRTEX_EXA_BORDER", o.border);
  defines.emplace_back("AMRTEX_EXA_MISSING", p.missing ? 1 : 0);
  defines.emplace_back("AMRTEX_EXA_X_BITS", p.texel_bits.x);
  defines.emplace_back("AMRTEX_EXA_Y_BITS", p.texel_bits.y);
  defines.emplace_back("AMRTEX_POOL_X", p.packing.size.x);
  defines.emplace_back("AMRTEX_POOL_Y", p.packing.size.y);
  defines.emplace_back("AMRTEX_POOL_Z", p.packing.size.z);
}

/// Means over all regions, by count and by volume (the columns of the paper's table 1), and over what is summed up a sample.
Json statistics(const Options& o, const Plan& p) {
  double volume = 0, bricks = 0, bricks_by_volume = 0, pieces = 0, pieces_by_volume = 0, plain_volume = 0;
  std::int64_t plain = 0;
  int most = 0;
  for (const Region& r : p.set.regions) {
    const Vec3d size(r.box.size());
    const double v = size.x * size.y * size.z;
    volume += v;
    bricks += r.active_bricks;
    bricks_by_volume += r.active_bricks * v;
    pieces += r.pieces;
    pieces_by_volume += r.pieces * v;
    plain += r.plain ? 1 : 0;
    plain_volume += r.plain ? v : 0;
    most = std::max(most, r.pieces);
  }
  const auto n = static_cast<double>(std::max<std::int64_t>(p.regions(), 1));
  const double all = std::max(volume, 1.0);
  Json json;
  json["bricks"] = p.bricks();
  json["cells_a_brick"] = static_cast<double>(p.brick_cells) / static_cast<double>(std::max<std::int64_t>(p.bricks(), 1));
  json["regions"] = p.regions();
  json["empty_leaves"] = p.set.empty;
  json["bricks_a_region"] = bricks / n;
  json["bricks_a_region_by_volume"] = bricks_by_volume / all;
  json["pieces_a_region"] = pieces / n;
  json["pieces_a_region_by_volume"] = pieces_by_volume / all;
  json["most_pieces"] = most;
  json["plain_regions"] = plain;
  json["plain_volume"] = plain_volume / all;
  json["region_bytes"] = 36 * p.regions() + 16 * p.stored_pieces +
                         (o.traversal == Traversal::bvh ? 32 * static_cast<std::int64_t>(p.bvh.size())
                                                        : 8 * static_cast<std::int64_t>(p.set.nodes.size()) + p.grid.bytes());
  json["nodes"] =
      o.traversal == Traversal::bvh ? static_cast<std::int64_t>(p.bvh.size()) : static_cast<std::int64_t>(p.set.nodes.size());
  json["depth"] = p.set.depth;
  json["start_depth"] = o.traversal == Traversal::grid ? Json(p.grid.depth) : Json(nullptr);
  json["pool"] = {p.packing.size.x, p.packing.size.y, p.packing.size.z};
  json["fill"] = static_cast<double>(p.brick_texels) / static_cast<double>(p.packing.texels());
  return json;
}

std::vector<LeftOut> left_out(const BuildRequest& request, const Options& o, const Plan& p) {
  std::vector<LeftOut> list;
  if (!p.missing)
    list.push_back({"validity bits", "every cell has a value", 4 * request.field_count() * words_for_bits(p.packing.texels()),
                    Part::validity});
  if (!request.needs.value_ranges) list.push_back({"value ranges", "no region is skipped", 4 * p.regions(), Part::value_ranges});
  if (!o.hats && o.border == 0) list.push_back(border_left_out(p.tree.bricks, "the filter nearest reads one cell", request));
  return list;
}

EncodedField Exabricks::build(const AmrHierarchy& h, const BuildRequest& request) const {
  require_filter(*this, request.needs.filter);
  require_fields(*this, h, request);
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters, request.needs);
  const Plan p = plan(h, request, o);

  EncodedField field = start_field(*this, h, request, parameters);
  Stores stores = store_bricks(h, request, o, p, field);
  field.statistics = statistics(o, p);
  add_defines(o, p, field);
  field.left_out = left_out(request, o, p);
  RegionTables tables = make_regions(*this, h, request, o, p, field, stores);
  if (o.hats && !o.cells) field.textures.push_back(make_pieces(h, o, p));
  if (o.traversal == Traversal::bvh)
    field.textures.push_back(make_bvh(p));
  else
    field.textures.push_back(make_nodes(p.set));
  if (o.traversal == Traversal::grid) add_start_grid(h, request, p, tables, field);
  field.textures.push_back(std::move(tables.regions));
  if (request.needs.value_ranges) field.textures.push_back(std::move(tables.ranges));
  tables.more_ranges.move_to(field);
  if (o.cells) {
    field.textures.push_back(make_bricks(o, p));
    field.textures.push_back(p.supports.texture());
  }
  for (HostTexture& pool : stores.pools) field.textures.push_back(std::move(pool));
  if (p.missing) field.textures.push_back(std::move(stores.validity));
  field.host_peak_bytes =
      field.memory().total() +
      static_cast<std::int64_t>(p.set.nodes.size() * (sizeof(RegionNode) + sizeof(kd::Node) + sizeof(Box)) +
                                2 * p.set.regions.size() * sizeof(Region) + 2 * p.set.pieces.size() * sizeof(Piece) +
                                p.tree.nodes.size() * sizeof(BrickNode));
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_exabricks() { return std::make_unique<Exabricks>(); }

}  // namespace amrtex
