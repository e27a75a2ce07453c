// Leaves of which nothing can be seen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "structures/kd_tree/kd_test_tools.hpp"
#include "structures/kd_tree/kd_tree_layout.h"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

/// A leaf of the kD-tree as its texture tells.
struct KdLeaf {
  Box cells;  ///< of its level
  int level;
  Vec3i texel;  ///< of its lower cell
};

std::vector<KdLeaf> kd_leaves(const AmrHierarchy& h, const EncodedField& f) {
  std::vector<KdLeaf> leaves;
  const auto* nodes = f.find("kd_nodes")->as<std::uint32_t>();
  const auto* data = f.find("kd_data")->as<std::uint32_t>();
  const int x_bits = define(f, "AMRTEX_KD_X_BITS"), y_bits = define(f, "AMRTEX_KD_Y_BITS");
  const auto visit = [&](auto&& self, std::uint32_t node, const Box& box) -> void {
    const std::uint32_t first = nodes[2 * node], second = nodes[2 * node + 1];
    const int level = static_cast<int>((first >> AMRTEX_KD_CHILD_BITS) & ((1U << AMRTEX_KD_LEVEL_BITS) - 1));
    const std::uint32_t child = first & ((1U << AMRTEX_KD_CHILD_BITS) - 1);
    const int width = h.cell_width(level);
    if (child != 0) {
      const int axis = static_cast<int>(first >> (AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS));
      Box below = box, above = box;
      below.upper[axis] = above.lower[axis] = box.lower[axis] + static_cast<int>(second >> AMRTEX_KD_DATA_BITS) * width;
      self(self, child, below);
      self(self, child + 1, above);
      return;
    }
    const std::uint32_t index = second & ((1U << AMRTEX_KD_DATA_BITS) - 1);
    if (index == AMRTEX_KD_NO_DATA) return;
    const std::uint32_t at = data[index * static_cast<std::uint32_t>(define(f, "AMRTEX_KD_DATA_WORDS"))];
    leaves.push_back({{box.lower / width, box.upper / width},
                      level,
                      {static_cast<int>(at & ((1U << x_bits) - 1)), static_cast<int>((at >> x_bits) & ((1U << y_bits) - 1)),
                       static_cast<int>(at >> (x_bits + y_bits))}});
  };
  visit(visit, 0, h.domain(h.finest_level()));
  return leaves;
}

/// Do hats of one leaf's cells reach into another leaf? They end half a cell beyond the cell.
bool reaches(const AmrHierarchy& h, const KdLeaf& from, const KdLeaf& to) {
  const int w = h.cell_width(from.level), v = h.cell_width(to.level);
  for (int a = 0; a < 3; ++a)
    if ((2 * from.cells.lower[a] - 1) * w >= 2 * to.cells.upper[a] * v ||
        (2 * from.cells.upper[a] + 1) * w <= 2 * to.cells.lower[a] * v)
      return false;
  return true;
}

/// Under `basis` a leaf shows something where the cells do whose hats reach in; and what it reads is needed.
std::vector<bool> needed_by_hats(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf,
                                 const std::vector<KdLeaf>& leaves) {
  std::vector<bool> needed(leaves.size());
  const HostTexture& pool = *f.find("tex_kd_pool");
  for (const KdLeaf& leaf : leaves) {
    ValueRange range;
    std::vector<std::size_t> read;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const KdLeaf& other = leaves[i];
      if (!reaches(h, other, leaf)) continue;
      read.push_back(i);
      for_each_cell(other.cells, [&](const Vec3i& c) {
        const KdLeaf one{{c, c + Vec3i(1)}, other.level, {}};
        if (!reaches(h, one, leaf)) return;
        const Vec3i texel = other.texel + c - other.cells.lower;
        range.add(load_value(pool.format, f.scale, pool.data.data(), Box{Vec3i(0), pool.size}.offset(texel)));
      });
    }
    if (tf.max_extinction(range.min, range.max) > 0)
      for (const std::size_t i : read) needed[i] = true;
  }
  return needed;
}

/// Of a subgrid is stored the box around its leaves, or around those that show something.
HiddenTexels hidden_bricks(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  const bool vertices = f.definition.filter == Filter::linear_vertex;
  const int border = f.definition.filter == Filter::linear_lod ? 1 : 0;
  const auto texels_of = [&](const Box& b) { return vertices ? Box{b.lower, b.upper + Vec3i(1)} : b.grown(border); };
  const auto around = [](std::map<std::pair<int, int>, Box>& boxes, const std::pair<int, int>& brick, const Box& box) {
    const auto [it, added] = boxes.try_emplace(brick, box);
    if (!added) it->second = {glm::min(it->second.lower, box.lower), glm::max(it->second.upper, box.upper)};
  };
  std::map<std::pair<int, int>, Box> all, shown;
  const std::vector<KdLeaf> leaves = kd_leaves(h, f);
  std::vector<bool> needed;
  if (f.definition.filter == Filter::basis) needed = needed_by_hats(h, f, tf, leaves);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const KdLeaf& leaf = leaves[i];
    const std::pair brick(leaf.level, h.find_patch(leaf.level, leaf.cells.lower));
    around(all, brick, leaf.cells);
    const Box texels = texels_of(leaf.cells);
    const Vec3i shift = leaf.texel - leaf.cells.lower;
    const bool read =
        needed.empty() ? shows(tf, f, *f.find("tex_kd_pool"), {texels.lower + shift, texels.upper + shift}) : needed[i];
    if (read) around(shown, brick, leaf.cells);
  }
  HiddenTexels count;
  for (const auto& [brick, box] : all) count.all += texels_of(box).cells();
  count.hidden = count.all;
  for (const auto& [brick, box] : shown) count.hidden -= texels_of(box).cells();
  return count;
}

/// Without a start grid: its bytes follow from the tree that is left, and are no part of what was left out.
EncodingCase pruning_case(Filter filter) { return {&find_encoding("kd_tree"), filter, {{"traversal", "restart"}}}; }

TEST(KdTreePrune, DropsNineTenthsOfTheBricksThatAreHidden) {
  for (const Filter filter : kd_filters()) expect_drops_what_is_hidden(pruning_case(filter), hidden_bricks);
}

TEST(KdTreePrune, KeepsTheRegionsThatRaysMeet) {
  for (const Filter filter : kd_filters()) expect_same_steps(pruning_case(filter));
}

}  // namespace
}  // namespace amrtex
