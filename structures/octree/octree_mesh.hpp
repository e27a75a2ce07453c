// The mesh as the octree sees it: what fills any box of a power of two.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "octree_cell.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/level_values.hpp"
#include "visible_parts.hpp"

namespace amrtex {

enum class CellKind : std::uint8_t {
  empty,
  inner,
  leaf,
  hidden,  ///< a leaf that shows nothing, stored since one beside it reads it
  pruned   ///< an inner cell below which nothing is stored
};

/// Answers what a cell of the tree is. One object a thread: it remembers the patch that it found last on each level.
class TreeMesh {
 public:
  /// `ghosts`: missing cells are divided as far as the leaves beside them. `visible`: what is stored, null: everything.
  TreeMesh(const AmrHierarchy& h, int field, bool ghosts, const VisibleParts* visible)
      : hierarchy_(h), visible_(visible), field_(static_cast<std::size_t>(field)), ghosts_(ghosts), holes_(h.has_holes()) {
    level_.fill(-1);
    last_patch_.assign(static_cast<std::size_t>(h.level_count()), -1);
    for (int l = 0; l < h.level_count(); ++l) level_[static_cast<std::size_t>(shift_of(l))] = l;
  }

  /// log2 of a level's cell width in finest cells.
  int shift_of(int level) const { return std::countr_zero(static_cast<unsigned>(hierarchy_.cell_width(level))); }
  /// The level whose cells are 2^shift wide, -1 between and above levels.
  int level_at(int shift) const { return level_[static_cast<std::size_t>(shift)]; }
  Vec3i level_cell(const TreeCell& c) const { return Vec3i(c.lower >> static_cast<std::int64_t>(c.shift)); }

  /// What the cell is in the tree that is stored: classify(), less what cannot be seen.
  CellKind stored(TreeCell& c, double& value) {
    const CellKind kind = classify(c, value);
    if (visible_ == nullptr) return kind;
    if (kind == CellKind::inner && !visible_->keeps(c)) return CellKind::pruned;
    if (kind != CellKind::leaf) return kind;
    const int level = level_at(c.shift);
    const int patch = last_patch_[static_cast<std::size_t>(level)];
    const Box& box = hierarchy_.patches(level)[static_cast<std::size_t>(patch)].box;
    return visible_->shows(level, patch, box.offset(level_cell(c))) ? CellKind::leaf : CellKind::hidden;
  }

  /// What the cell is in the mesh; sets its `missing`, and `value` to the level value that the mesh stores (NaN: none).
  CellKind classify(TreeCell& c, double& value) {
    value = std::numeric_limits<double>::quiet_NaN();
    if (c.missing || outside(c)) return missing(c);
    const int level = level_at(c.shift);
    if (level < 0) return holds_mesh(c) ? CellKind::inner : missing(c);
    const Vec3i cell = level_cell(c);
    const int patch = find_patch(level, cell);
    if (patch < 0) return !holes_ || hierarchy_.refined_within(level, {cell, cell + Vec3i(1)}) ? CellKind::inner : missing(c);
    const Patch& p = hierarchy_.patches(level)[static_cast<std::size_t>(patch)];
    const std::size_t i = p.box.offset(cell);
    value = p.values[field_][i];
    if (hierarchy_.leaf_mask(level, patch)[i] == 0) return CellKind::inner;
    return std::isnan(value) ? missing(c) : CellKind::leaf;
  }

 private:
  bool outside(const TreeCell& c) const {
    const std::int64_t w = std::int64_t{1} << c.shift;
    const Vec3l n(hierarchy_.cells(hierarchy_.finest_level()));
    return glm::any(glm::lessThanEqual(c.lower + Vec3l(w), Vec3l(0))) || glm::any(glm::greaterThanEqual(c.lower, n));
  }

  int find_patch(int level, const Vec3i& cell) {
    int& last = last_patch_[static_cast<std::size_t>(level)];
    if (last < 0 || !hierarchy_.patches(level)[static_cast<std::size_t>(last)].box.contains(cell))
      last = hierarchy_.find_patch(level, cell);
    return last;
  }

  /// The cells of `level` within `border` of the cell, in the domain.
  Box level_box(const TreeCell& c, int level, int border) const {
    const auto shift = static_cast<std::int64_t>(shift_of(level));
    const Vec3l n(hierarchy_.cells(level));
    const Vec3l lower = (c.lower >> shift) - Vec3l(border);
    const Vec3l upper = ((c.lower + Vec3l(std::int64_t{1} << c.shift)) >> shift) + Vec3l(border);
    return {Vec3i(glm::clamp(lower, Vec3l(0), n)), Vec3i(glm::clamp(upper, Vec3l(0), n))};
  }

  bool patches_within(const TreeCell& c, int border) const {
    for (int l = 0; l < hierarchy_.level_count(); ++l)
      if (shift_of(l) < c.shift && !hierarchy_.patches_in(l, level_box(c, l, border)).empty()) return true;
    return false;
  }

  bool holds_mesh(const TreeCell& c) const { return !holes_ || patches_within(c, 0); }

  CellKind missing(TreeCell& c) const {
    c.missing = true;
    // patches stand in for their leaves: a few cells more than the leaves ask for
    return ghosts_ && patches_within(c, 1) ? CellKind::inner : CellKind::empty;
  }

  const AmrHierarchy& hierarchy_;
  const VisibleParts* visible_;
  std::size_t field_;
  bool ghosts_, holes_;
  std::array<int, 34> level_{};
  std::vector<int> last_patch_;
};

/// Fills of the cells of one node, read only where one is missing.
class NodeFills {
 public:
  NodeFills(const AmrHierarchy& h, int field) : hierarchy_(h), field_(field) {}
  /// Of the cell at `octant` of the 2^3 cells from `first` on; NaN where there is nothing to fill from.
  double at(int level, const Vec3i& first, int octant) {
    if (level != level_ || first != first_) filled_level_values(hierarchy_, field_, level, {first, first + Vec3i(2)}, values_);
    level_ = level;
    first_ = first;
    return values_[static_cast<std::size_t>(octant)];
  }

 private:
  const AmrHierarchy& hierarchy_;
  int field_;
  int level_ = -1;
  Vec3i first_{0};
  std::array<double, 8> values_{};
};

}  // namespace amrtex
