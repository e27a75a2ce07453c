#include "structures/readers/exabrick/exa_mesh.hpp"

#include <fmt/format.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <limits>

#include "structures/mesh/cell_boxes.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

using Cells = std::vector<Vec3i>;

std::string text(const ExaCell& c) { return fmt::format("({}, {}, {}) of level {}", c.x, c.y, c.z, c.level); }

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.string(), what));
}

std::int64_t floor_to(std::int64_t value, std::int64_t width) {
  const std::int64_t rest = value % width;
  return value - (rest < 0 ? rest + width : rest);
}

/// Where the grid of the coarsest cells begins and how far it goes, in the file's units.
struct Extent {
  std::array<std::int64_t, 3> lower{};
  std::array<std::int64_t, 3> upper{};
};

Extent find_extent(const fs::path& file, const std::vector<ExaCell>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (cells[i].level < 0 || cells[i].level > kMostExaLevel)
      refuse(file, fmt::format("cell {} has level {}; accepted: 0 to {}", i, cells[i].level, kMostExaLevel));
  const ExaCell& widest =
      *std::max_element(cells.begin(), cells.end(), [](const ExaCell& a, const ExaCell& b) { return a.level < b.level; });
  Extent extent;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = [axis](const ExaCell& c) -> std::int64_t { return std::array{c.x, c.y, c.z}[axis]; };
    std::int64_t lower = std::numeric_limits<std::int64_t>::max();
    std::int64_t upper = std::numeric_limits<std::int64_t>::min();
    for (const ExaCell& c : cells) {
      lower = std::min(lower, at(c));
      upper = std::max(upper, at(c) + c.width());
    }
    const std::int64_t origin = at(widest);  // a corner of the coarsest grid
    extent.lower[axis] = origin + floor_to(lower - origin, widest.width());
    extent.upper[axis] = origin - floor_to(origin - upper, widest.width());
    if (extent.upper[axis] - extent.lower[axis] > std::numeric_limits<std::int32_t>::max())
      refuse(file, fmt::format("its cells reach from {} to {} along axis {}; at most 31 bits are supported", lower, upper,
                               "xyz"[axis]));
  }
  return extent;
}

/// A cell's parent on a grid `ratio` times as wide. No cell is below 0.
Vec3i parent_of(const Vec3i& cell, int ratio) { return cell / ratio; }

void sort_cells(Cells& cells) { tbb::parallel_sort(cells.begin(), cells.end(), array_order); }

/// What a level holds, met from the finest level on.
struct LevelCells {
  Cells whole;    ///< leaves, and cells whose children are all whole
  Cells parents;  ///< of the next coarser level: those whose children are all whole
  Cells touched;  ///< of the next coarser level: those with anything under them
};

Cells leaf_cells_of(const std::vector<PlacedCell>& leaves) {
  Cells cells;
  cells.reserve(leaves.size());
  for (const PlacedCell& leaf : leaves) cells.push_back(leaf.cell);
  return cells;
}

Cells merged(const Cells& a, const Cells& b) {
  Cells both(a.size() + b.size());
  std::merge(a.begin(), a.end(), b.begin(), b.end(), both.begin(), array_order);
  return both;
}

/// Finds the parents of a level's cells, `ratio` times as wide.
void find_parents(LevelCells& level, const Cells& touched_here, int ratio) {
  Cells all;
  all.reserve(level.whole.size());
  for (const Vec3i& c : level.whole) all.push_back(parent_of(c, ratio));
  sort_cells(all);
  const double children = static_cast<double>(ratio) * ratio * ratio;
  for (std::size_t i = 0; i < all.size();) {
    std::size_t end = i;
    while (end < all.size() && all[end] == all[i]) ++end;
    if (static_cast<double>(end - i) == children) level.parents.push_back(all[i]);
    level.touched.push_back(all[i]);
    i = end;
  }
  for (const Vec3i& c : touched_here) level.touched.push_back(parent_of(c, ratio));
  sort_cells(level.touched);
  level.touched.erase(std::unique(level.touched.begin(), level.touched.end()), level.touched.end());
}

/// Boxes of a level's cells: those of whole parents by the parents' boxes, so that no stored parent is cut.
std::vector<Box> boxes_of_level(const LevelCells& level, int ratio) {
  std::vector<Box> boxes = boxes_of_cells(level.parents);
  for (Box& box : boxes) box = box.refined(ratio);
  Cells others;
  for (const Vec3i& c : level.whole)
    if (!std::binary_search(level.parents.begin(), level.parents.end(), parent_of(c, ratio), array_order)) others.push_back(c);
  const std::vector<Box> rest = boxes_of_cells(others);
  boxes.insert(boxes.end(), rest.begin(), rest.end());
  return boxes;
}

void require_apart(const fs::path& file, const Cells& leaves, const Cells& touched, int width) {
  Cells both;
  std::set_intersection(leaves.begin(), leaves.end(), touched.begin(), touched.end(), std::back_inserter(both), array_order);
  if (!both.empty())
    refuse(file, fmt::format("{} cells overlap finer ones; the first is {} finest cells wide, at ({}, {}, {}) of its level",
                             both.size(), width, both[0].x, both[0].y, both[0].z));
}

}  // namespace

ExaLeaves place_leaves(const fs::path& file, ExaCells cells) {
  const Extent extent = find_extent(file, cells.cells);
  std::array<std::vector<PlacedCell>, kMostExaLevel + 1> by_level;
  for (std::size_t i = 0; i < cells.cells.size(); ++i) {
    const ExaCell& c = cells.cells[i];
    const std::array from = {c.x - extent.lower[0], c.y - extent.lower[1], c.z - extent.lower[2]};
    for (const std::int64_t d : from)
      if (d % c.width() != 0)
        refuse(file, fmt::format("cell {} {} does not lie on a multiple of its width, {}", i, text(c), c.width()));
    const Vec3i at(static_cast<int>(from[0] / c.width()), static_cast<int>(from[1] / c.width()),
                   static_cast<int>(from[2] / c.width()));
    by_level[static_cast<std::size_t>(c.level)].push_back(
        {at, cells.scalar.empty() ? static_cast<std::uint32_t>(i) : cells.scalar[i]});
  }
  cells = {};
  ExaLeaves leaves;
  for (int level = kMostExaLevel; level >= 0; --level) {
    auto& placed = by_level[static_cast<std::size_t>(level)];
    if (placed.empty()) continue;
    tbb::parallel_sort(placed.begin(), placed.end(),
                       [](const PlacedCell& a, const PlacedCell& b) { return array_order(a.cell, b.cell); });
    const auto twice = std::adjacent_find(placed.begin(), placed.end(),
                                          [](const PlacedCell& a, const PlacedCell& b) { return a.cell == b.cell; });
    if (twice != placed.end())
      refuse(file, fmt::format("cells {} and {} overlap: both are of level {} at one place", twice->scalar, (twice + 1)->scalar,
                               level));
    leaves.widths.push_back(1 << level);
    leaves.levels.push_back(std::move(placed));
  }
  const std::int64_t root = leaves.widths.front();
  const std::int64_t finest = leaves.widths.back();
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    leaves.lower[axis] = static_cast<double>(extent.lower[a]);
    leaves.upper[axis] = static_cast<double>(extent.upper[a]);
    leaves.root_cells[axis] = static_cast<int>((extent.upper[a] - extent.lower[a]) / root);
  }
  for (int& width : leaves.widths) width = static_cast<int>(width / finest);
  return leaves;
}

std::vector<std::vector<Box>> patch_boxes(const fs::path& file, const ExaLeaves& leaves) {
  const std::size_t levels = leaves.levels.size();
  std::vector<std::vector<Box>> boxes(levels);
  LevelCells finer;
  for (std::size_t l = levels; l-- > 0;) {
    LevelCells level;
    const Cells own = leaf_cells_of(leaves.levels[l]);
    require_apart(file, own, finer.touched, leaves.widths[l]);
    level.whole = merged(own, finer.parents);
    if (l == 0) {
      boxes[0] = boxes_of_cells(level.whole);
      break;
    }
    const int ratio = leaves.widths[l - 1] / leaves.widths[l];
    find_parents(level, finer.touched, ratio);
    boxes[l] = boxes_of_level(level, ratio);
    finer = std::move(level);
  }
  return boxes;
}

CellArray<float> box_values(const Box& box, const std::vector<PlacedCell>& leaves, const std::vector<float>& scalars) {
  CellArray<float> values(static_cast<std::size_t>(box.cells()), std::numeric_limits<float>::quiet_NaN());
  const int length = box.size().x;
  float* row = values.data();
  for (int z = box.lower.z; z < box.upper.z; ++z)
    for (int y = box.lower.y; y < box.upper.y; ++y, row += length) {
      const Vec3i first(box.lower.x, y, z);
      auto leaf = std::lower_bound(leaves.begin(), leaves.end(), first,
                                   [](const PlacedCell& a, const Vec3i& b) { return array_order(a.cell, b); });
      for (; leaf != leaves.end() && leaf->cell.z == z && leaf->cell.y == y && leaf->cell.x < box.upper.x; ++leaf)
        row[leaf->cell.x - box.lower.x] = scalars[leaf->scalar];
    }
  return values;
}

}  // namespace amrtex
