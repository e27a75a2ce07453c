#include "octree.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>

#include "octree_gradients.hpp"
#include "octree_layout.h"
#include "octree_leaps.hpp"
#include "octree_ranges.hpp"
#include "octree_reader.hpp"
#include "octree_shape.hpp"
#include "octree_writer.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/layout.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using namespace oct;

constexpr std::array<Filter, 2> kFilters{Filter::nearest, Filter::linear_lod};
/// A start grid chosen by us is at most this part of the tree.
constexpr std::int64_t kStartGridShare = 12;
constexpr int kPaperAddressBits = 8;  ///< an axis

/// One tree serves several fields where all have a value in the same cells.
void require_shared_tree(const AmrHierarchy& h, const BuildRequest& request, const Options& o) {
  if (o.paper_layout)
    throw UnsupportedError(
        "encoding octree: layout rgba8 has room for one sample in a leaf; accepted: layout wide, or one field");
  for (int i = 0; i < request.field_count(); ++i)
    if (h.statistics(request.field_at(i)).cells_without_value > 0)
      throw UnsupportedError(
          fmt::format("encoding octree: field {} has {} cells without a value, and the tree of several fields has one shape; "
                      "accepted: fields that have a value in every cell, or one field",
                      clipped(h.fields()[static_cast<std::size_t>(request.field_at(i))]),
                      h.statistics(request.field_at(i)).cells_without_value));
}

/// Nodes may go where only the volume is drawn, by its own filter.
void require_prunable(const BuildRequest& request, const Options& o) {
  if (request.needs.level_of_detail)
    throw UnsupportedError(
        "encoding octree: prune with a level of detail: an inner cell may show what none of its leaves does; accepted: one of "
        "both");
  if (o.paper_layout && o.store_gradients && request.needs.gradients)
    throw UnsupportedError(
        "encoding octree: prune with layout rgba8 and stored gradients: a gradient is interpolated between leaves that the "
        "filter "
        "does not read, and they would be gone; accepted: gradients computed, or layout wide");
}

class Octree final : public Encoding {
 public:
  std::string_view name() const override { return "octree"; }
  std::span<const Filter> filters() const override { return kFilters; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"layout", "what a node is made of", "wide", choices({"wide", "rgba8"}), {"wide", "rgba8"}},
            {"traversal", "how a sample finds its cells", "fast", choices({"fast", "paper"})},
            {"gradients", "of surfaces that are lit, where the layout has room", "stored", choices({"stored", "computed"})},
            {"start_grid", "cells along the longest axis of the grid in place of the upper levels; 0: none", "auto",
             either({"auto", 0}, {.first = 2, .last = 1024, .powers_of_two = true})}};
  }
  Support level_of_detail() const override { return {}; }
  bool prunes() const override { return true; }
  EncodedField build(const AmrHierarchy& hierarchy, const BuildRequest& request) const override;

 private:
  Options options(const Json& parameters) const;
  void require_support(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const;
  Plan plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree) const;
  Layout layout(const BuildRequest& request, const Options& o, const Tree& tree, const Plan& p) const;
  void plan_stores(const BuildRequest& request, const Options& o, const Tree& tree, Plan& p) const;
};

Options Octree::options(const Json& parameters) const {
  Options o;
  o.paper_layout = parameters.at("layout") == "rgba8";
  o.paper_traversal = parameters.at("traversal") == "paper";
  o.store_gradients = parameters.at("gradients") == "stored";
  const Json& start_grid = parameters.at("start_grid");
  if (start_grid != "auto") o.start_grid = start_grid.get<int>();
  return o;
}

void Octree::require_support(const AmrHierarchy& h, const BuildRequest& request, const Options& o) const {
  require_filter(*this, request.needs.filter);
  for (int l = 0; l < h.finest_level(); ++l)
    if (!std::has_single_bit(static_cast<unsigned>(h.ratio_to_finer(l))))
      throw UnsupportedError(fmt::format(
          "encoding octree: level {} is refined by {}, a node has 2 x 2 x 2 children; accepted: ratios that are powers of two", l,
          h.ratio_to_finer(l)));
  if (request.needs.filter == Filter::linear_lod && request.needs.filtering == Filtering::hardware &&
      request.storage != Storage::r64f)
    throw UnsupportedError(
        "encoding octree: filtering hardware with linear_lod: the texture unit cannot interpolate across nodes; accepted: "
        "manual");
  if (o.paper_layout && request.storage != Storage::r8)
    throw UnsupportedError(
        fmt::format("encoding octree: layout rgba8 holds a sample in 8 bits, not in {}; accepted: storage r8, or layout wide",
                    format_name(request.storage)));
  if (o.paper_layout && request.needs.level_of_detail)
    throw UnsupportedError(
        "encoding octree: no level of detail with layout rgba8: the word of an inner node has no room for a gradient, nor to say "
        "whether it has a value; accepted: layout wide");
  if (!request.needs.invisible.empty()) require_prunable(request, o);
  if (request.field_count() > 1) require_shared_tree(h, request, o);
  if (o.paper_traversal && o.start_grid > 0)
    throw UnsupportedError(
        fmt::format("encoding octree: traversal paper descends from the root, start_grid is {}; accepted: 0, or traversal fast",
                    o.start_grid));
}

/// The finest start grid that is asked for or that stays small beside the tree; never finer than level 0,
/// so that no cell that a filter looks for is wider than the grid's.
void plan_start_grid(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree,
                     std::int64_t tree_bytes, Plan& p) {
  const int coarsest = tree.root.shift - tree.level_0_shift;
  p.start_shift = coarsest;
  if (o.paper_traversal || o.start_grid == 0) return;
  const Vec3l cells = Vec3l(h.cells(0)) + Vec3l(tree.ghosts ? 2 : 0);
  for (int shift = 0; shift < coarsest; ++shift) {
    const Vec3l n = (cells + Vec3l((std::int64_t{1} << shift) - 1)) >> static_cast<std::int64_t>(shift);
    const std::int64_t longest = std::max({n.x, n.y, n.z});
    if (longest > 1024) continue;  // three axes stay in 31 bits
    const std::int64_t bytes = 4 * n.x * n.y * n.z * (p.averages_in_slots ? 2 : 1);
    if (bytes > request.context.max_buffer_bytes) continue;
    if (o.start_grid == kAutomatic ? bytes * kStartGridShare > tree_bytes : longest > o.start_grid) continue;
    p.start = Vec3i(n);
    p.start_shift = shift;
    p.start_slots = p.averages_in_slots;
    return;
  }
}

void Octree::plan_stores(const BuildRequest& request, const Options& o, const Tree& tree, Plan& p) const {
  const std::int64_t most_bytes = request.context.max_buffer_bytes;
  const bool linear = request.needs.filter != Filter::nearest;
  const bool averages = linear || request.needs.level_of_detail;
  p.node_words = o.paper_layout ? 8 * tree.nodes : tree.nodes;
  p.node_buffer = !o.paper_traversal && 4 * p.node_words <= most_bytes;
  // several fields have their values in textures, of which a shader takes an array
  p.value_buffer =
      !o.paper_traversal && request.storage == Storage::r32f && 32 * tree.nodes <= most_bytes && request.field_count() == 1;
  p.lod_texture = averages && (o.paper_layout || o.paper_traversal);
  p.averages_in_slots = averages && !p.lod_texture;
  p.ranges = linear && request.needs.value_ranges;
  const int most_texels = request.context.max_3d_texture_size / 2;
  const int limit = o.paper_layout ? std::min(most_texels, 1 << kPaperAddressBits) : most_texels;
  const bool textures = !p.node_buffer || !p.value_buffer || p.lod_texture;
  if (textures && !lay_out(tree.nodes, limit, p.texture))
    throw UnsupportedError(
        fmt::format("encoding octree with layout {}: {} nodes of 2^3 texels, a 3D texture of {} texels an axis{} holds {}",
                    o.paper_layout ? "rgba8" : "wide", tree.nodes, request.context.max_3d_texture_size,
                    o.paper_layout ? " and addresses of 8 bits an axis" : "", std::int64_t{limit} * limit * limit));
}

Plan Octree::plan(const AmrHierarchy& h, const BuildRequest& request, const Options& o, const Tree& tree) const {
  if (tree.nodes > kMostNodes)
    throw UnsupportedError(
        fmt::format("encoding octree: {} nodes or more, an address of {} bits tells at most {} apart ({} leaf cells fit)",
                    tree.nodes, AMRTEX_OCTREE_INDEX_BITS, kMostNodes, 7 * kMostNodes + 1));
  Plan p;
  p.validity = (any_missing(h, request) || tree.pruned > 0) && !o.paper_layout;
  plan_stores(request, o, tree, p);
  // beside the tree of one field without padding, so that it does not depend on where the tree stands
  const std::int64_t values = o.paper_layout ? 0 : 8 * tree.nodes * texel_bytes(request.storage);
  plan_start_grid(h, request, o, tree, 4 * p.node_words + values, p);
  return p;
}

/// Slots by what they are.
struct Counts {
  std::int64_t leaves, inner, empty;
};

Counts counts_of(const Tree& tree) { return {tree.leaves, tree.nodes - 1, 7 * tree.nodes + 1 - tree.leaves}; }

Part node_part(const Options& o, const Tree& tree, const Plan& p) {
  const Vec3i size = o.paper_layout ? p.texture.nodes() * 2 : p.texture.nodes();
  Part part = p.node_buffer ? buffer_part("octree_nodes", "nodes", TexelFormat::r32ui, p.node_words)
                            : texture_part("tex_octree_nodes", "nodes", TexelFormat::r32ui, size);
  const Counts counts = counts_of(tree);
  part.holds_values = o.paper_layout;
  part.roles = {{.topology = tree.nodes}};
  if (o.paper_layout) part.roles = {{.payload = counts.leaves, .topology = counts.inner}};
  return part;
}

Part value_part(const Options& o, const Tree& tree, const Plan& p, int number, const Layout& layout) {
  Part part = layout.values("tex_octree_values", number, p.texture.nodes() * 2);
  if (p.value_buffer) {
    part.name = "octree_values";
    part.kind = HostTexture::Kind::buffer;
    part.elements = 8 * tree.nodes;
  }
  const Counts counts = counts_of(tree);
  part.roles = {{.payload = counts.leaves, .duplicated = p.averages_in_slots ? counts.inner : 0}};
  part.present = !o.paper_layout;
  return part;
}

Part lod_part(const BuildRequest& request, const Tree& tree, const Plan& p, int number, const Layout& layout) {
  Part part = layout.values("tex_octree_lod", number, p.texture.nodes()).holding({.duplicated = tree.nodes}).when(p.lod_texture);
  part.what = "LOD texture";
  part.holds_values = false;
  if (number > 0) return part;
  part.why_absent = p.averages_in_slots ? "the averages stand in the texels that inner children leave unused"
                                        : "the filter nearest reads no averages";
  part.saved_bytes = tree.nodes * texel_bytes(request.storage);  // without what the texture would waste
  return part;
}

/// Nodes and channels that nothing reads.
void leave_out(const BuildRequest& request, const Options& o, const Tree& tree, const Plan& p, Layout& layout) {
  if (tree.pruned > 0) {
    std::int64_t bytes = 4 * (p.node_words / tree.nodes) * tree.pruned;
    if (!o.paper_layout) bytes += layout.value_bytes(8 * tree.pruned) - tree.nodes;  // what is left then needs bits
    if (p.lod_texture) bytes += layout.value_bytes(tree.pruned);
    if (p.ranges) bytes += 4 * tree.pruned;
    layout.leave_out({"nodes", "no filter reads them where something can be seen", bytes, Need::hidden});
  }
  if (o.paper_layout && !request.needs.gradients)
    layout.leave_out(
        {"gradients", "no surface is lit; their two channels stay empty", 0, o.store_gradients ? Need::gradients : Need::none});
}

Layout Octree::layout(const BuildRequest& request, const Options& o, const Tree& tree, const Plan& p) const {
  Layout layout(*this, request);
  leave_out(request, o, tree, p, layout);
  layout.add(node_part(o, tree, p));
  layout.add(value_part(o, tree, p, 0, layout));
  layout.add(lod_part(request, tree, p, 0, layout));
  Part validity = buffer_part("octree_validity", "validity bits", TexelFormat::r32ui, words_for_bits(8 * tree.nodes))
                      .when(p.validity, o.paper_layout ? "" : "every cell has a value", Need::validity);
  validity.saved_bytes = tree.nodes;
  layout.add(std::move(validity));
  layout.add(
      buffer_part("octree_start", "entries of the start grid", TexelFormat::r32ui, p.start_cells()).when(p.start_cells() > 0));
  layout.add(
      buffer_part("octree_start_slots", "slots of the start grid", TexelFormat::r32ui, p.start_cells()).when(p.start_slots));
  const bool linear = request.needs.filter != Filter::nearest;  // under nearest a leaf's range is its value
  layout.add(buffer_part("octree_ranges", "value ranges", TexelFormat::r32ui, tree.nodes)
                 .when(p.ranges, linear ? "no region is skipped" : "", Need::value_ranges));
  for (int number = 1; number < request.field_count(); ++number) {
    layout.add(value_part(o, tree, p, number, layout));
    layout.add(lod_part(request, tree, p, number, layout));
  }
  Part more = layout.more_ranges("octree_more_ranges", tree.nodes);
  more.present = more.present && p.ranges;
  layout.add(std::move(more));
  if (p.ranges) layout.add_working(tree.nodes * static_cast<std::int64_t>(sizeof(ValueRange)));
  if (tree.visible) layout.add_working(tree.visible->host_bytes());
  layout.set_remedy(fmt::format("; the tree has {} nodes", tree.nodes));
  return layout;
}

Json statistics(const Tree& tree, const Plan& p, const Counts& counts) {
  Json json;
  json["nodes"] = tree.nodes;
  json["depths"] = tree.root.shift;
  json["leaves"] = counts.leaves;
  json["empty"] = counts.empty;
  json["pruned_nodes"] = tree.pruned;
  json["start_grid"] = p.start_cells() > 0 ? Json{p.start.x, p.start.y, p.start.z} : Json(nullptr);
  json["start_grid_cells"] = p.start_cells();
  return json;
}

void add_shader_inputs(const Options& o, const Plan& p, const Tree& tree, EncodedField& field) {
  auto& defines = field.shader.defines;
  defines.emplace_back("AMRTEX_OCTREE_LAYOUT", o.paper_layout ? AMRTEX_OCTREE_RGBA8 : AMRTEX_OCTREE_WIDE);
  defines.emplace_back("AMRTEX_OCTREE_TRAVERSAL", o.paper_traversal ? AMRTEX_OCTREE_PAPER : AMRTEX_OCTREE_FAST);
  defines.emplace_back("AMRTEX_OCTREE_NODE_BUFFER", p.node_buffer ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_VALUE_BUFFER", p.value_buffer ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_LOD", p.lod_texture ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_START", p.start_cells() > 0 ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_START_SHIFT", p.start_shift);
  defines.emplace_back("AMRTEX_OCTREE_GHOSTS", tree.ghosts ? 1 : 0);
  defines.emplace_back("AMRTEX_OCTREE_PRUNED", tree.pruned > 0 ? 1 : 0);
  field.integer_uniforms.emplace_back("u_octree_shift", p.texture.shift);
  if (p.start_cells() > 0) field.integer_uniforms.emplace_back("u_octree_start", p.start);
}

EncodedField Octree::build(const AmrHierarchy& h, const BuildRequest& request) const {
  const Json parameters = complete_parameters(*this, request.parameters);
  const Options o = options(parameters);
  require_support(h, request, o);
  Tree tree = place_tree(h, request);
  if (!request.needs.invisible.empty()) tree.visible.emplace(h, request, tree.root, tree.ghosts);
  std::vector<Subtree> subtrees = count_nodes(h, request.field, tree);
  const Plan p = plan(h, request, o, tree);
  Layout parts = layout(request, o, tree, p);
  parts.add_working(static_cast<std::int64_t>(subtrees.size() * sizeof(Subtree)));
  parts.require_limits();
  parts.require_budget();

  EncodedField field = start_field(*this, h, request, parameters);
  parts.allocate(field);
  HostTexture& nodes = *field.find(p.node_buffer ? "octree_nodes" : "tex_octree_nodes");
  const Stores stores{&nodes, field.find(p.value_buffer ? "octree_values" : "tex_octree_values"), field.find("tex_octree_lod"),
                      field.find("octree_validity")};
  write_tree(h, request, tree, o, p, field.scale, subtrees, stores);
  write_more_fields(h, request, tree, o, p, subtrees, stores, field);
  const TreeReader reader(nodes, o, p);
  if (p.start_cells() > 0) write_start_grid(tree, reader, p, field);
  const bool gradients = o.paper_layout && o.store_gradients && request.needs.gradients;
  if (gradients) write_gradients(h, request, tree, reader, nodes);
  if (p.ranges) write_ranges(h, request, tree, reader, field);
  if (request.needs.value_ranges) field.leaps = leap_grid(h, request, tree, reader, field);
  field.statistics = statistics(tree, p, counts_of(tree));
  add_shader_inputs(o, p, tree, field);
  field.shader.defines.emplace_back("AMRTEX_OCTREE_GRADIENTS", gradients ? 1 : 0);
  return field;
}

}  // namespace

std::unique_ptr<Encoding> make_octree() { return std::make_unique<Octree>(); }

}  // namespace amrtex
