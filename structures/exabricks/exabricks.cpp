#include "exabricks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "brick_writer.hpp"
#include "exa_plan.hpp"
#include "exabricks_layout.h"
#include "region_writer.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"

namespace amrtex {
namespace {

using namespace exa;

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::basis};

constexpr int kNarrowestBrick = 2;
constexpr int kWidestBrick = 256;
/// A start grid takes at most this part of what the other bytes of one field are.
constexpr std::int64_t kGridShare = 16;
class Exabricks final : public Encoding {
 public:
  std::string_view name() const override { return "exabricks"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {
        {"brick_width", "cells of a brick along an axis, at most", 32, integers(kNarrowestBrick, kWidestBrick), {16, 32, 64}},
        {"border", "texels around a brick that hold its neighbours' cells (filter basis)", 1, choices({0, 1})},
        {"locate", "who finds the cells of a sample (filter basis): its region knows them, or each sample searches", "regions",
         choices({"regions", "cells"})},
        {"traversal", "how the region of a place is found: down the planes from a grid's cell or from the root, or through a BVH",
         "grid", choices({"grid", "kd", "bvh"})}};
  }
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
  Layout layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p) const;
};

Options Exabricks::options(const Json& parameters, const SceneNeeds& needs) const {
  Options o;
  o.brick_width = parameters.at("brick_width").get<int>();
  o.border = parameters.at("border").get<int>();
  const Json& traversal = parameters.at("traversal");
  o.traversal = traversal == "grid" ? Traversal::grid : traversal == "kd" ? Traversal::kd : Traversal::bvh;
  o.hats = needs.filter == Filter::basis;
  o.cells = o.hats && parameters.at("locate") == "cells";
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
  p.brick_texels = packing::used_texels(sizes);
  const int limit = request.context.max_3d_texture_size;
  if (sizes.empty())
    p.packing.size = Vec3i(1);
  else if (std::max({largest.x, largest.y, largest.z}) <= limit)
    p.packing = packing::pack_best_fit(sizes, limit);
  if (!p.packing.valid())
    throw UnsupportedError(
        fmt::format("encoding exabricks: {} bricks of up to {} x {} x {} texels do not fit a 3D texture of {} texels an axis",
                    sizes.size(), largest.x, largest.y, largest.z, limit));
  for (int a = 0; a < 3; ++a) p.texel_bits[a] = std::bit_width(static_cast<unsigned>(p.packing.size[a] - 1));
  if (const int bits = p.texel_bits.x + p.texel_bits.y + p.texel_bits.z; bits > 32)
    throw UnsupportedError(fmt::format("encoding exabricks: texels of a pool of {} x {} x {} take {} bits, a brick tells 32",
                                       p.packing.size.x, p.packing.size.y, p.packing.size.z, bits));
  p.validity_words = words_for_bits(p.packing.texels());
}

void Exabricks::plan_traversal(const AmrHierarchy& h, const BuildRequest& request, const Options& o, Plan& p) const {
  if (o.traversal == Traversal::kd) return;
  if (o.traversal == Traversal::grid) {
    const std::int64_t others =
        p.packing.texels() * texel_bytes(request.storage) + 8 * static_cast<std::int64_t>(p.set.nodes.size());
    p.grid = make_start_grid(h, p.set, std::max<std::int64_t>(others / kGridShare / 4, 1));
    return;
  }
  const std::vector<Box> boxes = node_boxes(h, p.set);
  std::vector<Box> leaves;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (p.set.nodes[i].first_child != 0) continue;
    leaves.push_back(boxes[i]);
    p.leaf_region.push_back(p.set.nodes[i].region);
  }
  p.bvh = BvhBuilder(leaves).build();
}

Layout Exabricks::layout(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Plan& p) const {
  Layout layout(*this, request);
  const bool bvh = o.traversal == Traversal::bvh;
  const auto nodes = static_cast<std::int64_t>(p.set.nodes.size());
  layout.add(buffer_part("exa_pieces", "pieces", TexelFormat::rgba32ui, p.stored_pieces).when(o.hats && !o.cells));
  layout.add(buffer_part("exa_bvh", "nodes of the BVH over the regions", TexelFormat::rgba32ui,
                         2 * static_cast<std::int64_t>(p.bvh.size()))
                 .when(bvh));
  layout.add(buffer_part("exa_nodes", "nodes over the regions", TexelFormat::rg32ui, nodes).when(!bvh));
  layout.add(p.grid.entries_part("exa_start").when(o.traversal == Traversal::grid));
  layout.add(p.grid.nodes_part("exa_start_nodes").when(o.traversal == Traversal::grid));
  layout.add(buffer_part("exa_regions", "regions", TexelFormat::rgba32ui, 2 * p.regions()));
  layout.add(buffer_part("exa_ranges", "value ranges", TexelFormat::r32ui, p.regions())
                 .when(request.needs.value_ranges, "no region is skipped", Need::value_ranges));
  layout.add(layout.more_ranges("exa_more_ranges", p.regions()));
  layout.add(buffer_part("exa_bricks", "bricks", TexelFormat::rgba32ui, 2 * p.bricks()).when(o.cells));
  layout.add(p.supports.part().when(o.cells));
  for (int number = 0; number < request.field_count(); ++number)
    layout.add(layout.values("tex_exa_pool", number, p.packing.size)
                   .holding({.payload = h.leaf_cells(), .duplicated = p.brick_texels - p.brick_cells}));
  layout.add(buffer_part("exa_validity", "validity bits", TexelFormat::r32ui, request.field_count() * p.validity_words)
                 .when(p.missing, "every cell has a value", Need::validity));
  if (!o.hats && o.border == 0)
    layout.leave_out(
        {"border layer", "the filter nearest reads one cell", layout.value_bytes(border_cells(p.tree.bricks)), Need::border});
  layout.add_working(nodes * static_cast<std::int64_t>(sizeof(RegionNode) + sizeof(Box)) +
                     static_cast<std::int64_t>(2 * p.set.regions.size() * sizeof(Region) +
                                               2 * p.set.pieces.size() * sizeof(Piece) +
                                               p.tree.nodes.size() * sizeof(BrickNode)));
  layout.set_remedy(fmt::format("; {} bricks and {} regions", p.bricks(), p.regions()) +
                    (o.brick_width < kWidestBrick
                         ? fmt::format("; a brick_width above {} makes fewer, up to {}", o.brick_width, kWidestBrick)
                         : std::string()));
  return layout;
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
  return p;
}

void add_shader_inputs(const Options& o, const Plan& p, EncodedField& field) {
  if (o.traversal == Traversal::grid) {
    field.integer_uniforms.emplace_back("u_exa_grid", p.grid.cells);
    field.integer_uniforms.emplace_back("u_exa_grid_width", Vec3i(p.grid.width, 0, 0));
  }
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

/// From the regions' ranges.
LeapGrid leap_grid(const AmrHierarchy& h, const Plan& p, EncodedField& field) {
  LeapGrid grid = LeapGrid::over(h);
  const auto* codes = field.find("exa_ranges")->as<std::uint32_t>();
  for (const Region& r : p.set.regions) grid.cover(r.box, *codes++);
  return grid;
}

EncodedField Exabricks::build(const AmrHierarchy& h, const BuildRequest& request) const {
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
  const Stores stores(field);
  write_bricks(h, request, o, p, field, stores);
  const RegionTables tables = write_regions(h, request, o, p, stores, field);
  if (HostTexture* pieces = field.find("exa_pieces")) write_pieces(h, o, p, *pieces);
  if (HostTexture* nodes = field.find("exa_nodes")) write_nodes(p.set, *nodes);
  if (HostTexture* bvh = field.find("exa_bvh")) write_bvh(p, *bvh);
  if (o.traversal == Traversal::grid) write_start_grid(h, request, p, tables, field);
  if (o.cells) {
    write_brick_list(o, p, *field.find("exa_bricks"));
    p.supports.write(*field.find("basis_supports"));
  }
  if (request.needs.value_ranges) field.leaps = leap_grid(h, p, field);
  field.statistics = statistics(o, p);
  add_shader_inputs(o, p, field);
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_exabricks() { return std::make_unique<Exabricks>(); }

}  // namespace amrtex
