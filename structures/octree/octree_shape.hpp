// The shape of the octree over a mesh: where it lies, how many nodes it has, and in what they are stored.
#pragma once

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

#include "octree_layout.h"
#include "octree_mesh.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex::oct {

inline constexpr std::int64_t kMostNodes = std::int64_t{1} << AMRTEX_OCTREE_INDEX_BITS;
/// Subtrees from this depth on are built in parallel.
inline constexpr int kSubtreeDepth = 5;
inline constexpr int kAutomatic = -1;

struct Options {
  bool paper_layout = false;
  bool paper_traversal = false;
  bool store_gradients = true;
  int start_grid = kAutomatic;  ///< cells along the longest axis; 0: none
};

/// Where the tree lies, and how many nodes it has.
struct Tree {
  TreeCell root;
  bool ghosts = false;
  int level_0_shift = 0;
  std::int64_t nodes = 0;
  std::int64_t leaves = 0;                ///< slots of cells with a value
  std::int64_t pruned = 0;                ///< nodes that are not stored because nothing reads them that can be seen
  std::optional<VisibleParts> visible{};  ///< where it is asked for
  const VisibleParts* stored_parts() const { return visible ? &*visible : nullptr; }
};

/// Nodes in a 3D texture: 2^shift.x by 2^shift.y by `layers`.
struct NodeTexture {
  Vec3i shift{0};
  int layers = 1;
  Vec3i nodes() const { return {1 << shift.x, 1 << shift.y, layers}; }
  Vec3i position(std::int64_t node) const {
    const auto n = static_cast<int>(node);
    return {n & ((1 << shift.x) - 1), (n >> shift.x) & ((1 << shift.y) - 1), n >> (shift.x + shift.y)};
  }
};

/// False where no texture of at most `limit` nodes an axis holds them.
inline bool lay_out(std::int64_t nodes, int limit, NodeTexture& texture) {
  for (int x = 0; (1 << x) <= limit; ++x)
    for (int y = 0; (1 << y) <= limit; ++y) {
      const std::int64_t layers = (nodes + (std::int64_t{1} << (x + y)) - 1) >> (x + y);
      if (layers > limit) continue;
      texture = {{x, y, 0}, static_cast<int>(layers)};
      return true;
    }
  return false;
}

/// What is built, before anything is.
struct Plan {
  bool node_buffer = true;
  bool value_buffer = true;
  bool lod_texture = false;
  bool averages_in_slots = false;  ///< of inner children, in the texels that they leave unused
  bool validity = false;
  bool ranges = false;
  NodeTexture texture;
  Vec3i start{0};            ///< cells of the start grid; 0: none
  int start_shift = 0;       ///< depths from the cells where a descent starts to level 0
  bool start_slots = false;  ///< the start grid knows where its cells' averages stand
  std::int64_t node_words = 0;
  std::int64_t start_cells() const { return std::int64_t{start.x} * start.y * start.z; }
};

inline Tree place_tree(const AmrHierarchy& h, const BuildRequest& request) {
  Tree tree;
  tree.level_0_shift = std::countr_zero(static_cast<unsigned>(h.cell_width(0)));
  tree.ghosts = request.needs.filter != Filter::nearest && h.has_missing(request.field);
  const int border = tree.ghosts ? 1 : 0;  // of level-0 cells, for the fills outside of the domain
  const Vec3i n = h.cells(0);
  const auto cells = static_cast<std::uint64_t>(std::max({n.x, n.y, n.z})) + 2U * static_cast<unsigned>(border);
  const int depths = std::max(static_cast<int>(std::bit_width(cells - 1)), 1);
  tree.root = {Vec3l(-std::int64_t{border} * h.cell_width(0)), tree.level_0_shift + depths, false};
  return tree;
}

/// What lies below a node.
struct Count {
  std::int64_t nodes = 0, leaves = 0, pruned = 0;
  void add(const Count& c) {
    nodes += c.nodes;
    leaves += c.leaves;
    pruned += c.pruned;
  }
};

/// A node of kSubtreeDepth: its subtree is counted and written by itself.
struct Subtree {
  TreeCell cell;
  Count below = {};
  std::int64_t index = 0;  ///< its own
  std::int64_t first = 0;  ///< of the nodes below it
};

/// Nodes below a cell of the mesh, whether they are stored or not.
inline std::int64_t nodes_below(TreeMesh& mesh, const TreeCell& node) {
  std::int64_t n = 0;
  for (int i = 0; i < 8; ++i) {
    TreeCell child = node.child(i);
    double value;
    if (mesh.classify(child, value) == CellKind::inner) n += 1 + nodes_below(mesh, child);
  }
  return n;
}

/// What is below the node, through `below(child)` of the inner ones; stops soon after `most` nodes.
template <class Below>
Count count_children(TreeMesh& mesh, const TreeCell& node, std::int64_t most, Below&& below) {
  Count n;
  for (int i = 0; i < 8 && n.nodes <= most; ++i) {
    TreeCell child = node.child(i);
    double value;
    const CellKind kind = mesh.stored(child, value);
    if (kind == CellKind::inner) {
      ++n.nodes;
      n.add(below(child, most - n.nodes));
    }
    if (kind == CellKind::pruned) n.pruned += 1 + nodes_below(mesh, child);
    n.leaves += kind == CellKind::leaf || kind == CellKind::hidden ? 1 : 0;
  }
  return n;
}

inline Count count_below(TreeMesh& mesh, const TreeCell& node, std::int64_t most) {
  return count_children(mesh, node, most, [&](const TreeCell& c, std::int64_t rest) { return count_below(mesh, c, rest); });
}

/// What is above kSubtreeDepth; collects the nodes at that depth.
inline Count count_above(TreeMesh& mesh, const TreeCell& node, int depth, std::vector<Subtree>& subtrees) {
  if (depth < kSubtreeDepth)
    return count_children(mesh, node, kMostNodes,
                          [&](const TreeCell& c, std::int64_t) { return count_above(mesh, c, depth + 1, subtrees); });
  subtrees.push_back({node});
  return {};
}

inline std::vector<Subtree> count_nodes(const AmrHierarchy& h, int field, Tree& tree) {
  std::vector<Subtree> subtrees;
  TreeMesh mesh(h, field, tree.ghosts, tree.stored_parts());
  Count all = count_above(mesh, tree.root, 0, subtrees);
  tbb::enumerable_thread_specific<TreeMesh> meshes([&] { return TreeMesh(h, field, tree.ghosts, tree.stored_parts()); });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, subtrees.size()), [&](const auto& range) {
    TreeMesh& own = meshes.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) subtrees[i].below = count_below(own, subtrees[i].cell, kMostNodes);
  });
  for (const Subtree& s : subtrees) all.add(s.below);
  tree.nodes = 1 + all.nodes;
  tree.leaves = all.leaves;
  tree.pruned = all.pruned;
  return subtrees;
}

}  // namespace amrtex::oct
