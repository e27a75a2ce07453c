// The kD-tree over the subgrids of a mesh (Kähler & Abel 2013, section 3.2): its leaves are blocks of leaf cells of
// one subgrid, or hold no mesh.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "kd_tree_layout.h"
#include "structures/amr_hierarchy.hpp"

namespace amrtex::kd {

inline constexpr std::int64_t kMostNodes = std::int64_t{1} << AMRTEX_KD_CHILD_BITS;
inline constexpr std::int64_t kMostLeaves = AMRTEX_KD_NO_DATA;
inline constexpr int kMostLevels = 1 << AMRTEX_KD_LEVEL_BITS;
inline constexpr int kMostSplit = (1 << AMRTEX_KD_SPLIT_BITS) - 1;

struct Node {
  std::uint32_t first_child = 0;  ///< 0: a leaf
  int axis = 0;
  int level = 0;   ///< of a leaf's cells; of the cells at whose faces the plane lies
  int split = 0;   ///< cells of `level` from the node's lower corner to the plane
  int leaf = -1;   ///< index of the block that is drawn; -1: inner node, or no mesh
  int owner = -1;  ///< level of the subgrid that covers the whole node, itself perhaps refined; -1: none
};

/// A drawn leaf: cells of one subgrid that no other refines.
struct Leaf {
  int level;
  int patch;
  Box cells;  ///< level space
};

struct Tree {
  std::vector<Node> nodes;
  std::vector<Leaf> leaves;
  int depth = 0;                   ///< splits from the root to the deepest leaf
  std::int64_t empty = 0;          ///< leaves without mesh
  std::int64_t fully_refined = 0;  ///< inner nodes that a subgrid covers and others refine everywhere
  std::int64_t mixed = 0;          ///< other inner nodes
  std::int64_t subgrids = 0;       ///< of the mesh
  std::int64_t cut_subgrids = 0;   ///< divided by a plane
};

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

/// Builds the tree. The paper pushes one level of subgrids after the other down the whole tree; here a node is
/// finished, all levels, before the next: the planes are the same, and nodes that lie close stand close.
class Partition {
 public:
  explicit Partition(const AmrHierarchy& h) : hierarchy_(h) {
    for (int l = 0; l < h.level_count(); ++l) {
      cut_.emplace_back(h.patches(l).size(), std::uint8_t{0});
      tree_.subgrids += static_cast<std::int64_t>(h.patches(l).size());
    }
  }

  Tree build() {
    if (hierarchy_.level_count() > kMostLevels)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: {} levels, a node tells at most {}", hierarchy_.level_count(), kMostLevels));
    tree_.nodes.emplace_back();
    Task root;
    root.box = hierarchy_.domain(hierarchy_.finest_level());
    root.blocks = blocks_in(0, root.box);
    tasks_.push_back(std::move(root));
    while (!tasks_.empty()) {
      Task task = std::move(tasks_.back());
      tasks_.pop_back();
      refine(task);
    }
    count();
    return std::move(tree_);
  }

 private:
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

  std::vector<Block> blocks_in(int level, const Box& box) {
    std::vector<Block> blocks;
    const int w = hierarchy_.cell_width(level);
    for (const int k : hierarchy_.patches_in(level, box.coarsened(w))) {
      const Box whole = hierarchy_.patches(level)[static_cast<std::size_t>(k)].box.refined(w);
      const Box part = intersection(whole, box);
      if (part.empty()) continue;
      if (part != whole) cut_[static_cast<std::size_t>(level)][static_cast<std::size_t>(k)] = 1;
      blocks.push_back({part, k});
    }
    return blocks;
  }

  /// Goes on to finer subgrids while there is nothing to split; true where none are left.
  bool descend_levels(Task& t) {
    while (t.level < hierarchy_.level_count()) {
      if (t.blocks.size() == 1 && t.blocks[0].box == t.box) {
        t.owner = t.level;
        t.owner_patch = t.blocks[0].patch;
        t.split_level = t.level;
      } else if (!t.blocks.empty()) {
        return false;
      }
      if (++t.level < hierarchy_.level_count()) t.blocks = blocks_in(t.level, t.box);
    }
    return true;
  }

  void refine(Task& t) {
    const bool finished = descend_levels(t);
    Node& node = tree_.nodes[t.node];
    node.owner = t.owner;
    node.level = t.split_level;
    tree_.depth = std::max(tree_.depth, t.depth);
    if (!finished) return split(t);
    if (t.owner >= 0) add_leaf(t);
  }

  void add_leaf(const Task& t) {
    if (static_cast<std::int64_t>(tree_.leaves.size()) >= kMostLeaves)
      throw UnsupportedError(fmt::format("encoding kd_tree: more than {} blocks of leaf cells, a node tells at most {}",
                                         tree_.leaves.size(), kMostLeaves));
    tree_.nodes[t.node].leaf = static_cast<int>(tree_.leaves.size());
    const int w = hierarchy_.cell_width(t.owner);
    tree_.leaves.push_back({t.owner, t.owner_patch, {t.box.lower / w, t.box.upper / w}});
  }

  /// The plane for a node. Cells of its owner must stay whole, and a subgrid two levels finer may end inside of one
  /// (another covers the rest): such faces are taken only where all cells of the owner are refined.
  Plane choose(Task& t) {
    const int width = t.owner >= 0 ? hierarchy_.cell_width(t.owner) : 1;
    Plane plane = best_plane(t.box, t.blocks, width);
    for (int finer = t.level + 1; plane.axis < 0 && finer < hierarchy_.level_count(); ++finer)
      plane = best_plane(t.box, blocks_in(finer, t.box), width);
    if (plane.axis >= 0) return plane;
    t.owner = -1;
    return best_plane(t.box, t.blocks, 1);
  }

  void split(Task& t) {
    const Plane plane = choose(t);
    const int level = t.owner >= 0 ? t.owner : std::max(t.level - 1, t.split_level);
    const int cells = (plane.at - t.box.lower[plane.axis]) / hierarchy_.cell_width(level);
    if (cells > kMostSplit)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: a node is split {} cells of level {} from its corner, it tells at most {}", cells, level,
                      kMostSplit));
    const std::size_t child = tree_.nodes.size();
    if (static_cast<std::int64_t>(child) + 2 > kMostNodes)
      throw UnsupportedError(
          fmt::format("encoding kd_tree: more than {} nodes, a child's index has {} bits", child, AMRTEX_KD_CHILD_BITS));
    Node& node = tree_.nodes[t.node];
    node.first_child = static_cast<std::uint32_t>(child);
    node.axis = plane.axis;
    node.level = level;
    node.split = cells;
    tree_.nodes.resize(child + 2);
    // the lower child comes off the stack first
    for (const int side : {1, 0}) tasks_.push_back(half(t, plane, side, level, child));
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
      if (part != b.box) cut_[static_cast<std::size_t>(t.level)][static_cast<std::size_t>(b.patch)] = 1;
      h.blocks.push_back({part, b.patch});
    }
    return h;
  }

  /// Sorts nodes by the paper's kinds (a) and (c); its (b) are the leaves.
  void count() {
    // coarsest level of any leaf below; children stand after their parent
    std::vector<int> coarsest(tree_.nodes.size());
    for (std::size_t i = tree_.nodes.size(); i-- > 0;) {
      const Node& n = tree_.nodes[i];
      if (n.first_child == 0) {
        coarsest[i] = n.leaf >= 0 ? n.level : -1;
        tree_.empty += n.leaf < 0 ? 1 : 0;
        continue;
      }
      coarsest[i] = std::min(coarsest[n.first_child], coarsest[n.first_child + 1]);
      ++(n.owner >= 0 && coarsest[i] > n.owner ? tree_.fully_refined : tree_.mixed);
    }
    for (const auto& level : cut_)
      for (const std::uint8_t c : level) tree_.cut_subgrids += c;
  }

  const AmrHierarchy& hierarchy_;
  Tree tree_;
  std::vector<Task> tasks_;
  std::vector<std::vector<std::uint8_t>> cut_;  ///< a level and subgrid
};

inline Tree build_tree(const AmrHierarchy& h) { return Partition(h).build(); }

inline std::uint32_t first_word(const Node& n) {
  return n.first_child | (static_cast<std::uint32_t>(n.level) << AMRTEX_KD_CHILD_BITS) |
         (static_cast<std::uint32_t>(n.axis) << (AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS));
}

inline std::uint32_t second_word(const Node& n) {
  const auto data = n.leaf >= 0 ? static_cast<std::uint32_t>(n.leaf) : std::uint32_t{AMRTEX_KD_NO_DATA};
  return data | (static_cast<std::uint32_t>(n.split) << AMRTEX_KD_DATA_BITS);
}

}  // namespace amrtex::kd
