// Bricks: a kD-tree whose leaves hold cells of one level that fill their box (Wald et al. 2020, section 3.1).
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <array>
#include <map>
#include <memory>
#include <vector>

#include "structures/common/hat_supports.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex::exa {

/// A box of cells of one level.
struct CellBox {
  int level = 0;
  Box cells;  ///< level space
};

/// The leaf cells of a patch as boxes: runs along x, joined along y, then along z, where they are equal.
inline void add_leaf_boxes(const AmrHierarchy& h, int level, int patch, std::vector<CellBox>& out) {
  const Box box = h.patches(level)[static_cast<std::size_t>(patch)].box;
  const auto mask = h.leaf_mask(level, patch);
  const auto is_leaf = [&](int x, int y, int z) { return mask[box.offset({x, y, z})] != 0; };
  using Rectangle = std::array<int, 4>;  // x and y, from and to
  std::map<Rectangle, int> open;         // to the z it begins at
  const auto rectangles = [&](int z) {
    std::vector<Rectangle> done;
    std::map<std::array<int, 2>, int> runs;  // x from and to; the y it begins at
    for (int y = box.lower.y; y <= box.upper.y; ++y) {
      std::map<std::array<int, 2>, int> here;
      for (int x = box.lower.x; y < box.upper.y && x < box.upper.x;) {
        const int from = x;
        while (x < box.upper.x && is_leaf(x, y, z)) ++x;
        if (x > from) here[{from, x}] = y;
        while (x < box.upper.x && !is_leaf(x, y, z)) ++x;
      }
      for (const auto& [run, begin] : runs) {
        const auto it = here.find(run);
        if (it != here.end())
          it->second = begin;
        else
          done.push_back({run[0], run[1], begin, y});
      }
      runs = std::move(here);
    }
    return done;
  };
  for (int z = box.lower.z; z <= box.upper.z; ++z) {
    std::map<Rectangle, int> here;
    if (z < box.upper.z)
      for (const Rectangle& r : rectangles(z)) here[r] = z;
    for (const auto& [r, begin] : open) {
      const auto it = here.find(r);
      if (it != here.end())
        it->second = begin;
      else
        out.push_back({level, {{r[0], r[2], begin}, {r[1], r[3], z}}});
    }
    open = std::move(here);
  }
}

/// All leaf cells, in boxes; in an order that does not depend on threads.
inline std::vector<CellBox> leaf_boxes(const AmrHierarchy& h) {
  std::vector<CellBox> all;
  for (int level = 0; level < h.level_count(); ++level) {
    std::vector<std::vector<CellBox>> parts(h.patches(level).size());
    tbb::parallel_for(std::size_t{0}, parts.size(),
                      [&](std::size_t k) { add_leaf_boxes(h, level, static_cast<int>(k), parts[k]); });
    for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

struct Brick {
  int level = 0;
  int width = 1;  ///< of its cells, finest cells
  Box cells;      ///< level space
  Box box() const { return cells.refined(width); }
};

/// Does any hat of the brick's cells reach into the box (finest cells)?
inline bool reaches(const Brick& b, const Box& box) { return hats_reach(b.box(), b.width, box); }

struct BrickNode {
  int first_child = 0;  ///< 0: a leaf; the second child is the next node
  int axis = 0;
  int plane = 0;   ///< finest cells
  int brick = -1;  ///< of a leaf; -1: no mesh
  int widest = 0;  ///< cell below this node, finest cells
  Box box;         ///< finest cells
};

struct BrickTree {
  std::vector<BrickNode> nodes;  ///< children after their parent, the lower side's first
  std::vector<Brick> bricks;     ///< in the order of the tree's leaves
  int depth = 0;
};

/// Splits a node's bounding box along its longest axis, next to the middle, at a multiple of the coarsest cell in it.
class BrickPartition {
 public:
  BrickPartition(const AmrHierarchy& h, int widest_brick) : hierarchy_(h), most_(widest_brick) {}

  BrickTree build() {
    std::vector<CellBox> boxes = leaf_boxes(hierarchy_);
    Part root;
    divide(root, hierarchy_.domain(hierarchy_.finest_level()), std::move(boxes));
    tree_.nodes.emplace_back();
    number(root, 0, hierarchy_.domain(hierarchy_.finest_level()), 0);
    find_widest(tree_.nodes);
    return std::move(tree_);
  }

 private:
  /// A node before it has a number.
  struct Part {
    int axis = -1;  ///< -1: a leaf
    int plane = 0;
    std::unique_ptr<Part> below, above;
    bool full = false;  ///< a leaf with cells
    CellBox cells;
  };
  /// Subtrees of fewer boxes are no task of their own.
  static constexpr std::size_t kTask = 64;

  int width(int level) const { return hierarchy_.cell_width(level); }
  Box finest(const CellBox& b) const { return b.cells.refined(width(b.level)); }

  void divide(Part& part, const Box& box, std::vector<CellBox> boxes) {
    if (boxes.empty()) return;
    Box around = finest(boxes.front());
    int coarsest = width(boxes.front().level);
    bool one_level = true;
    double cells = 0;
    for (const CellBox& b : boxes) {
      const Box f = finest(b);
      around = {glm::min(around.lower, f.lower), glm::max(around.upper, f.upper)};
      coarsest = std::max(coarsest, width(b.level));
      one_level = one_level && b.level == boxes.front().level;
      cells += static_cast<double>(b.cells.cells());
    }
    const Vec3i size = around.size();
    if (one_level) {
      const Vec3d n = Vec3d(size) / static_cast<double>(coarsest);
      if (n.x * n.y * n.z == cells && std::max({n.x, n.y, n.z}) <= most_) return fill(part, box, around, boxes.front().level);
    }
    // stable: of equal extents the first axis
    std::array<int, 3> axes{0, 1, 2};
    std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
    for (const int axis : axes) {
      const std::int64_t lower = around.lower[axis], upper = around.upper[axis];
      std::int64_t plane = ((lower + upper) / 2 + coarsest / 2) / coarsest * coarsest;
      if (plane <= lower) plane = (lower / coarsest + 1) * coarsest;
      if (plane >= upper) plane = ((upper + coarsest - 1) / coarsest - 1) * coarsest;
      if (plane <= lower || plane >= upper) continue;
      return split(part, box, axis, static_cast<int>(plane), std::move(boxes));
    }
    throw Error("exabricks: cells that fill no box and cannot be divided");  // not with whole cells
  }

  void split(Part& part, const Box& box, int axis, int plane, std::vector<CellBox> boxes) {
    std::vector<CellBox> below, above;
    for (const CellBox& b : boxes) {
      const int at = plane / width(b.level);  // a multiple of the node's coarsest cells, so of all
      if (b.cells.lower[axis] < at) {
        below.push_back(b);
        below.back().cells.upper[axis] = std::min(b.cells.upper[axis], at);
      }
      if (b.cells.upper[axis] > at) {
        above.push_back(b);
        above.back().cells.lower[axis] = std::max(b.cells.lower[axis], at);
      }
    }
    const bool tasks = boxes.size() > kTask;
    boxes = {};
    part.axis = axis;
    part.plane = plane;
    part.below = std::make_unique<Part>();
    part.above = std::make_unique<Part>();
    Box lower = box, upper = box;
    lower.upper[axis] = upper.lower[axis] = plane;
    const auto first = [&] { divide(*part.below, lower, std::move(below)); };
    const auto second = [&] { divide(*part.above, upper, std::move(above)); };
    if (tasks) return tbb::parallel_invoke(first, second);
    first();
    second();
  }

  /// A leaf: planes cut off what of the node holds no mesh.
  void fill(Part& part, Box box, const Box& around, int level) {
    Part* p = &part;
    for (int axis = 0; axis < 3; ++axis)
      for (const bool lower : {true, false}) {
        const int plane = lower ? around.lower[axis] : around.upper[axis];
        if (plane == (lower ? box.lower : box.upper)[axis]) continue;
        (lower ? box.lower : box.upper)[axis] = plane;
        p->axis = axis;
        p->plane = plane;
        p->below = std::make_unique<Part>();
        p->above = std::make_unique<Part>();
        p = lower ? p->above.get() : p->below.get();
      }
    p->full = true;
    p->cells = {level, {around.lower / width(level), around.upper / width(level)}};
  }

  void number(const Part& part, std::size_t node, const Box& box, int depth) {
    tree_.depth = std::max(tree_.depth, depth);
    tree_.nodes[node].box = box;
    if (part.axis < 0) {
      if (!part.full) return;
      tree_.nodes[node].brick = static_cast<int>(tree_.bricks.size());
      tree_.nodes[node].widest = width(part.cells.level);
      tree_.bricks.push_back({part.cells.level, width(part.cells.level), part.cells.cells});
      return;
    }
    const std::size_t child = tree_.nodes.size();
    tree_.nodes.resize(child + 2);
    tree_.nodes[node].first_child = static_cast<int>(child);
    tree_.nodes[node].axis = part.axis;
    tree_.nodes[node].plane = part.plane;
    Box lower = box, upper = box;
    lower.upper[part.axis] = upper.lower[part.axis] = part.plane;
    number(*part.below, child, lower, depth + 1);
    number(*part.above, child + 1, upper, depth + 1);
  }

  const AmrHierarchy& hierarchy_;
  int most_;
  BrickTree tree_;
};

inline BrickTree build_bricks(const AmrHierarchy& h, int widest_brick) { return BrickPartition(h, widest_brick).build(); }

}  // namespace amrtex::exa
