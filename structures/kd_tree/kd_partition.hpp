// The kD-tree over the subgrids of a mesh (Kähler & Abel 2013, section 3.2): its leaves are blocks of leaf cells of
// one subgrid, or hold no mesh.
#pragma once

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "kd_tree_layout.h"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex::kd {

inline constexpr std::int64_t kMostNodes = std::int64_t{1} << AMRTEX_KD_CHILD_BITS;
inline constexpr std::int64_t kMostLeaves = AMRTEX_KD_NO_DATA;
inline constexpr int kMostLevels = 1 << AMRTEX_KD_LEVEL_BITS;
inline constexpr int kMostSplit = (1 << AMRTEX_KD_SPLIT_BITS) - 1;
/// Stands for a level where nothing refines the cells.
inline constexpr int kNothingFiner = kMostLevels;

struct Node {
  std::uint32_t first_child = 0;  ///< 0: a leaf
  int axis = 0;
  int level = 0;          ///< of a leaf's cells; of the cells at whose faces the plane lies
  int split = 0;          ///< cells of `level` from the node's lower corner to the plane
  int leaf = -1;          ///< index of the first block that may be drawn; -1: none
  int owner = -1;         ///< level of the subgrid that covers the whole node, itself perhaps refined; -1: none
  bool finished = false;  ///< false while the tree is built
};

/// As start_grid.hpp asks.
inline int plane_of(const AmrHierarchy& h, const Node& n, const Box& box) {
  return box.lower[n.axis] + n.split * h.cell_width(n.level);
}
inline bool is_drawn(const Node& n) { return n.leaf >= 0; }

/// Cells of one subgrid that are drawn: a leaf, which no other subgrid refines, or with a level of detail
/// (kd_detail.hpp) cells that are refined everywhere.
struct Leaf {
  int level;
  int patch;
  Box cells;                 ///< level space
  int next = kNothingFiner;  ///< coarsest level that takes the place of refined cells
  bool last = true;          ///< of its node: no finer cells are drawn there
  bool repeated = false;     ///< the same cells are drawn in a node above as well
};

/// A subgrid that covers a node.
struct Cover {
  int level;
  int patch;
};

/// Subgrids that cover a node, from the coarsest: that of the node above, and those that cover no larger one.
struct CoverSpan {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  bool inherited = false;  ///< is the first that of the node above?
};

struct Tree {
  std::vector<Node> nodes;
  std::vector<Leaf> leaves;
  std::vector<Cover> covers;           ///< where PartitionOptions::covers asks for them
  std::vector<CoverSpan> node_covers;  ///< a node
  int depth = 0;                       ///< splits from the root to the deepest leaf
  std::int64_t empty = 0;              ///< leaves without mesh
  std::int64_t fully_refined = 0;      ///< inner nodes that a subgrid covers and others refine everywhere
  std::int64_t mixed = 0;              ///< other inner nodes
  std::int64_t subgrids = 0;           ///< of the mesh
  std::int64_t cut_subgrids = 0;       ///< divided by a plane
};

/// Coarsest level of any leaf below each node; -1 where a part of it has no mesh.
inline std::vector<int> coarsest_leaves(const Tree& tree) {
  std::vector<int> coarsest(tree.nodes.size());
  for (std::size_t i = tree.nodes.size(); i-- > 0;) {  // children stand after their parent
    const Node& n = tree.nodes[i];
    if (n.first_child == 0)
      coarsest[i] = n.leaf >= 0 ? n.level : -1;
    else
      coarsest[i] = std::min(coarsest[n.first_child], coarsest[n.first_child + 1]);
  }
  return coarsest;
}

/// A subgrid inside a node.
struct Block {
  Box box;  ///< finest cells, inside the node
  int patch;
};

struct Plane {
  int axis = -1;  ///< -1: there is none
  int at = 0;     ///< finest cells
  std::int64_t cuts = std::numeric_limits<std::int64_t>::max();
  double imbalance = 0;  ///< difference of subgrid cells on the two sides, finest cells
  bool better_than(const Plane& other) const {
    return axis >= 0 && (cuts < other.cuts || (cuts == other.cuts && imbalance < other.imbalance));
  }
};

/// The plane along one axis that cuts the fewest blocks, and of these the one that divides their cells most evenly.
/// Planes are faces of blocks inside `box` at multiples of `alignment` finest cells: any other cuts no fewer.
inline Plane best_plane_along(int axis, const Box& box, const std::vector<Block>& blocks, int alignment) {
  struct Face {
    int at;
    double area;
  };
  std::vector<Face> lower, upper;
  double total = 0;
  for (const Block& b : blocks) {
    const Vec3d size(b.box.size());
    const double area = size[(axis + 1) % 3] * size[(axis + 2) % 3];
    lower.push_back({b.box.lower[axis], area});
    upper.push_back({b.box.upper[axis], area});
    total += area * size[axis];
  }
  const auto before = [](const Face& a, const Face& b) { return a.at < b.at; };
  std::stable_sort(lower.begin(), lower.end(), before);
  std::stable_sort(upper.begin(), upper.end(), before);

  Plane best;
  // sums over the blocks that begin, and that end, before the plane: areas, and areas times where they do
  double begun = 0, begun_at = 0, ended = 0, ended_at = 0;
  std::size_t l = 0, u = 0;
  while (u < upper.size()) {
    const int at = l < lower.size() ? std::min(lower[l].at, upper[u].at) : upper[u].at;
    std::size_t ends_here = u;
    while (ends_here < upper.size() && upper[ends_here].at == at) ++ends_here;
    if (at > box.lower[axis] && at < box.upper[axis] && at % alignment == 0) {
      const double below = (begun * at - begun_at) - (ended * at - ended_at);
      const Plane plane{axis, at, static_cast<std::int64_t>(l) - static_cast<std::int64_t>(ends_here),
                        std::abs(total - 2 * below)};
      if (plane.better_than(best)) best = plane;
    }
    for (; l < lower.size() && lower[l].at == at; ++l) {
      begun += lower[l].area;
      begun_at += lower[l].area * at;
    }
    for (; u < ends_here; ++u) {
      ended += upper[u].area;
      ended_at += upper[u].area * at;
    }
  }
  return best;
}

inline Plane best_plane(const Box& box, const std::vector<Block>& blocks, int alignment) {
  Plane best;
  for (int axis = 0; axis < 3; ++axis) {
    const Plane plane = best_plane_along(axis, box, blocks, alignment);
    if (plane.better_than(best)) best = plane;
  }
  return best;
}

/// What a node can tell. Tests pass these limits with small meshes.
struct Limits {
  int levels = kMostLevels;
  std::int64_t nodes = kMostNodes;
  std::int64_t blocks = kMostLeaves;  ///< that are drawn
  int split = kMostSplit;             ///< cells from a node's corner to its plane
};

struct PartitionOptions {
  /// Before a node is divided among subgrids, the region outside of their common box is split off
  /// (Kaehler & Hege 2002, figure 10).
  bool wrap = false;
  bool covers = false;  ///< fill Tree::covers
  Limits limits;
};

inline void require_blocks(std::int64_t blocks, const Limits& limits) {
  if (blocks > limits.blocks)
    throw UnsupportedError(fmt::format(
        "encoding kd_tree: more than {} blocks of cells to draw, which is the most that a node can tell apart", limits.blocks));
}

inline void require_nodes(std::int64_t nodes, const Limits& limits) {
  if (nodes > limits.nodes)
    throw UnsupportedError(
        fmt::format("encoding kd_tree: more than {} nodes, which is the most that a child's index of {} bits can tell apart",
                    limits.nodes, AMRTEX_KD_CHILD_BITS));
}

/// Builds the tree. The paper pushes one level of subgrids after the other down the whole tree; here a node is
/// finished, all levels, before the next: the planes are the same, and nodes that lie close stand close.
/// Upper nodes are built one after the other, what lies below them in parallel; the result is that of one thread.
class Partition {
 public:
  explicit Partition(const AmrHierarchy& h, const PartitionOptions& options = {}) : hierarchy_(h), options_(options) {
    for (int l = 0; l < h.level_count(); ++l) {
      cut_.emplace_back(h.patches(l).size(), std::uint8_t{0});
      subgrids_ += static_cast<std::int64_t>(h.patches(l).size());
    }
  }

  Tree build() {
    if (hierarchy_.level_count() > options_.limits.levels)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: {} levels, a node tells at most {}", hierarchy_.level_count(), options_.limits.levels));
    Task root;
    root.box = hierarchy_.domain(hierarchy_.finest_level());
    root.blocks = blocks_in(0, root.box);
    std::vector<Task> open;
    const Tree upper = grow(std::move(root), &open);
    std::vector<Tree> below(open.size());
    tbb::parallel_for(std::size_t{0}, open.size(), [&](std::size_t i) { below[i] = grow(std::move(open[i]), nullptr); });
    Tree tree = join(upper, below);
    tree.subgrids = subgrids_;
    count(tree);
    return tree;
  }

 private:
  /// Subtrees of a node with this many subgrids or fewer, of the level that is pushed down, are built by one thread.
  static constexpr std::size_t kSubtreeBlocks = 1024;

  /// A node that is not finished.
  struct Task {
    std::size_t node = 0;
    Box box;              ///< finest cells
    int split_level = 0;  ///< at whose cell faces its faces lie
    int owner = -1;       ///< level of the subgrid that covers it, while cells of it may be leaves; -1: none
    int owner_patch = -1;
    int level = 0;              ///< of the subgrids that are being pushed down
    std::vector<Block> blocks;  ///< these
    int depth = 0;
  };

  /// The tree below a task, whose node becomes node 0. Where `open` is given, tasks with few blocks are left there, each
  /// at an unfinished node, in the order in which the tree would go on.
  Tree grow(Task root, std::vector<Task>* open) {
    Tree tree;
    tree.nodes.emplace_back();
    if (options_.covers) tree.node_covers.emplace_back();
    root.node = 0;
    std::vector<Task> tasks;
    tasks.push_back(std::move(root));
    while (!tasks.empty()) {
      Task task = std::move(tasks.back());
      tasks.pop_back();
      if (open != nullptr && task.depth > 0 && task.blocks.size() <= kSubtreeBlocks) {
        open->push_back(std::move(task));
        continue;
      }
      refine(tree, tasks, task);
    }
    return tree;
  }

  /// Puts the subtrees in the places of the upper tree's unfinished nodes: children of a node side by side, then all
  /// that lies below the lower one, as one thread would have made them.
  Tree join(const Tree& upper, std::vector<Tree>& below) {
    if (below.empty()) return upper;
    Tree tree;
    tree.depth = upper.depth;
    std::size_t next_below = 0;
    std::vector<std::pair<std::size_t, std::size_t>> places{{0, 0}};  // in `upper`, in `tree`
    tree.nodes.resize(1);
    if (options_.covers) tree.node_covers.resize(1);
    const auto is_open = open_nodes(upper);
    while (!places.empty()) {
      const auto [from, to] = places.back();
      places.pop_back();
      if (is_open[from] != 0) {
        append(tree, to, below[next_below]);
        below[next_below++] = {};
        continue;
      }
      put(tree, to, upper, from, 0);
      if (upper.nodes[from].first_child == 0) continue;
      const std::size_t child = tree.nodes.size();
      tree.nodes[to].first_child = static_cast<std::uint32_t>(child);
      extend(tree, 2);
      for (const std::size_t side : {1U, 0U}) places.emplace_back(upper.nodes[from].first_child + side, child + side);
    }
    return tree;
  }

  /// Nodes of the upper tree that were left unfinished.
  static std::vector<std::uint8_t> open_nodes(const Tree& upper) {
    std::vector<std::uint8_t> open(upper.nodes.size());
    for (std::size_t i = 0; i < open.size(); ++i) open[i] = upper.nodes[i].finished ? 0 : 1;
    return open;
  }

  void extend(Tree& tree, std::size_t nodes) const {
    require_nodes(static_cast<std::int64_t>(tree.nodes.size() + nodes), options_.limits);
    tree.nodes.resize(tree.nodes.size() + nodes);
    if (options_.covers) tree.node_covers.resize(tree.nodes.size());
  }

  /// Copies a node with its leaf and its covers; `shift` is added to its first child.
  void put(Tree& tree, std::size_t to, const Tree& from, std::size_t i, std::size_t shift) const {
    Node n = from.nodes[i];
    if (n.first_child != 0) n.first_child += static_cast<std::uint32_t>(shift);
    if (n.leaf >= 0) {
      require_blocks(static_cast<std::int64_t>(tree.leaves.size()) + 1, options_.limits);
      tree.leaves.push_back(from.leaves[static_cast<std::size_t>(n.leaf)]);
      n.leaf = static_cast<int>(tree.leaves.size()) - 1;
    }
    tree.nodes[to] = n;
    if (!options_.covers) return;
    CoverSpan span = from.node_covers[i];
    const auto* first = from.covers.data() + span.first;
    span.first = static_cast<std::uint32_t>(tree.covers.size());
    tree.covers.insert(tree.covers.end(), first, first + span.count);
    tree.node_covers[to] = span;
  }

  /// Puts a subtree's root in the place of node `to`, and what lies below it at the end.
  void append(Tree& tree, std::size_t to, const Tree& part) const {
    const std::size_t base = tree.nodes.size();
    const auto leaves = static_cast<int>(tree.leaves.size());
    require_blocks(leaves + static_cast<std::int64_t>(part.leaves.size()), options_.limits);
    extend(tree, part.nodes.size() - 1);
    tree.depth = std::max(tree.depth, part.depth);
    tree.leaves.insert(tree.leaves.end(), part.leaves.begin(), part.leaves.end());
    const auto covers = static_cast<std::uint32_t>(tree.covers.size());
    tree.covers.insert(tree.covers.end(), part.covers.begin(), part.covers.end());
    for (std::size_t i = 0; i < part.nodes.size(); ++i) {
      const std::size_t at = i == 0 ? to : base + i - 1;
      Node n = part.nodes[i];
      if (n.first_child != 0) n.first_child += static_cast<std::uint32_t>(base - 1);
      if (n.leaf >= 0) n.leaf += leaves;
      tree.nodes[at] = n;
      if (!options_.covers) continue;
      tree.node_covers[at] = part.node_covers[i];
      tree.node_covers[at].first += covers;
    }
  }

  void note_cut(int level, int patch) {
    std::atomic_ref<std::uint8_t>(cut_[static_cast<std::size_t>(level)][static_cast<std::size_t>(patch)])
        .store(1, std::memory_order_relaxed);
  }

  std::vector<Block> blocks_in(int level, const Box& box) {
    std::vector<Block> blocks;
    const int w = hierarchy_.cell_width(level);
    for (const int k : hierarchy_.patches_in(level, box.coarsened(w))) {
      const Box whole = hierarchy_.patches(level)[static_cast<std::size_t>(k)].box.refined(w);
      const Box part = intersection(whole, box);
      if (part.empty()) continue;
      if (part != whole) note_cut(level, k);
      blocks.push_back({part, k});
    }
    return blocks;
  }

  /// Goes on to finer subgrids while there is nothing to split; true where none are left.
  bool descend_levels(Tree& tree, Task& t) {
    while (t.level < hierarchy_.level_count()) {
      if (t.blocks.size() == 1 && t.blocks[0].box == t.box) {
        t.owner = t.level;
        t.owner_patch = t.blocks[0].patch;
        t.split_level = t.level;
        note_cover(tree, t);
      } else if (!t.blocks.empty()) {
        return false;
      }
      if (++t.level < hierarchy_.level_count()) t.blocks = blocks_in(t.level, t.box);
    }
    return true;
  }

  void note_cover(Tree& tree, const Task& t) const {
    if (!options_.covers) return;
    tree.covers.push_back({t.owner, t.owner_patch});
    ++tree.node_covers[t.node].count;
  }

  void refine(Tree& tree, std::vector<Task>& tasks, Task& t) {
    if (options_.covers) {
      tree.node_covers[t.node] = {static_cast<std::uint32_t>(tree.covers.size()), 0, t.owner >= 0};
      if (t.owner >= 0) note_cover(tree, t);
    }
    const bool finished = descend_levels(tree, t);
    Node& node = tree.nodes[t.node];
    node.finished = true;
    node.owner = t.owner;
    node.level = t.split_level;
    tree.depth = std::max(tree.depth, t.depth);
    if (!finished) return split(tree, tasks, t);
    if (t.owner >= 0) add_leaf(tree, t);
  }

  void add_leaf(Tree& tree, const Task& t) const {
    require_blocks(static_cast<std::int64_t>(tree.leaves.size()) + 1, options_.limits);
    tree.nodes[t.node].leaf = static_cast<int>(tree.leaves.size());
    const int w = hierarchy_.cell_width(t.owner);
    tree.leaves.push_back({t.owner, t.owner_patch, {t.box.lower / w, t.box.upper / w}});
  }

  /// The plane for a node. Cells of its owner must stay whole, and a subgrid two levels finer may end inside of one
  /// (another covers the rest): such faces are taken only where all cells of the owner are refined.
  Plane choose(Task& t) {
    const int width = t.owner >= 0 ? hierarchy_.cell_width(t.owner) : 1;
    Plane plane;
    if (options_.wrap && t.blocks.size() > 1) plane = wrapping_plane(t, width);
    if (plane.axis < 0) plane = best_plane(t.box, t.blocks, width);
    for (int finer = t.level + 1; plane.axis < 0 && finer < hierarchy_.level_count(); ++finer)
      plane = best_plane(t.box, blocks_in(finer, t.box), width);
    if (plane.axis >= 0) return plane;
    t.owner = -1;
    return best_plane(t.box, t.blocks, 1);
  }

  /// Splits off the largest part of a node outside of the common box of its blocks; no plane where that box fills it.
  Plane wrapping_plane(const Task& t, int alignment) const {
    Box common = t.blocks.front().box;
    for (const Block& b : t.blocks) common = {glm::min(common.lower, b.box.lower), glm::max(common.upper, b.box.upper)};
    Plane best;
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (const bool below : {true, false}) {
        const int at = below ? common.lower[axis] : common.upper[axis];
        const double part = static_cast<double>(below ? at - t.box.lower[axis] : t.box.upper[axis] - at) / t.box.size()[axis];
        if (at % alignment != 0 || !(part > largest)) continue;
        largest = part;
        best = {axis, at, 0, 0};
      }
    return best;
  }

  void split(Tree& tree, std::vector<Task>& tasks, Task& t) {
    const Plane plane = choose(t);
    int level = t.owner >= 0 ? t.owner : std::max(t.level - 1, t.split_level);
    const int offset = plane.at - t.box.lower[plane.axis];
    while (offset % hierarchy_.cell_width(level) != 0) ++level;  // beside a hole a subgrid may end inside of a coarser cell
    const int cells = offset / hierarchy_.cell_width(level);
    if (cells > options_.limits.split)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: a node is split {} cells of level {} from its corner, it tells at most {}", cells, level,
                      options_.limits.split));
    const std::size_t child = tree.nodes.size();
    extend(tree, 2);
    Node& node = tree.nodes[t.node];
    node.first_child = static_cast<std::uint32_t>(child);
    node.axis = plane.axis;
    node.level = level;
    node.split = cells;
    // the lower child comes off the stack first
    for (const int side : {1, 0}) tasks.push_back(half(t, plane, side, level, child));
  }

  Task half(const Task& t, const Plane& plane, int side, int level, std::size_t child) {
    Task h;
    h.node = child + static_cast<std::size_t>(side);
    h.box = t.box;
    (side == 0 ? h.box.upper : h.box.lower)[plane.axis] = plane.at;
    h.split_level = level;
    h.owner = t.owner;
    h.owner_patch = t.owner_patch;
    h.level = t.level;
    h.depth = t.depth + 1;
    for (const Block& b : t.blocks) {
      const Box part = intersection(b.box, h.box);
      if (part.empty()) continue;
      if (part != b.box) note_cut(t.level, b.patch);
      h.blocks.push_back({part, b.patch});
    }
    return h;
  }

  /// Sorts nodes by the paper's kinds (a) and (c); its (b) are the leaves.
  void count(Tree& tree) const {
    const std::vector<int> coarsest = coarsest_leaves(tree);
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
      const Node& n = tree.nodes[i];
      if (n.first_child == 0)
        tree.empty += n.leaf < 0 ? 1 : 0;
      else
        ++(n.owner >= 0 && coarsest[i] > n.owner ? tree.fully_refined : tree.mixed);
    }
    for (const auto& level : cut_)
      for (const std::uint8_t c : level) tree.cut_subgrids += c;
  }

  const AmrHierarchy& hierarchy_;
  PartitionOptions options_;
  std::int64_t subgrids_ = 0;
  std::vector<std::vector<std::uint8_t>> cut_;  ///< a level and subgrid
};

inline Tree build_tree(const AmrHierarchy& h, const PartitionOptions& options = {}) { return Partition(h, options).build(); }

inline std::uint32_t first_word(const Node& n) {
  return n.first_child | (static_cast<std::uint32_t>(n.level) << AMRTEX_KD_CHILD_BITS) |
         (static_cast<std::uint32_t>(n.axis) << (AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS));
}

inline std::uint32_t second_word(const Node& n) {
  const auto data = n.leaf >= 0 ? static_cast<std::uint32_t>(n.leaf) : std::uint32_t{AMRTEX_KD_NO_DATA};
  return data | (static_cast<std::uint32_t>(n.split) << AMRTEX_KD_DATA_BITS);
}

}  // namespace amrtex::kd
