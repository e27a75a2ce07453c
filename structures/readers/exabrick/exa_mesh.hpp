// Single leaf cells to levels of boxes.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "structures/mesh/spaces.hpp"
#include "structures/readers/exabrick/exa_cells.hpp"

namespace amrtex {

/// Where the mesh lies in the file's units, finest cells, and which levels it has: coarsest first, those alone that have leaves.
struct ExaGrid {
  std::array<std::int64_t, 3> lower{};  ///< of the domain, on the grid of the coarsest cells
  std::array<std::int64_t, 3> upper{};
  std::vector<int> levels;                            ///< the file's number of each of ours
  std::array<std::size_t, kMostExaLevel + 1> ours{};  ///< our number of each of the file's levels

  /// Of our levels, in cells of the finest one.
  int width(std::size_t level) const { return 1 << (levels[level] - levels.back()); }
  int ratio_to_finer(std::size_t level) const { return 1 << (levels[level] - levels[level + 1]); }
  Vec3i root_cells() const;
  std::size_t level_of(const ExaCell& cell) const { return ours[static_cast<std::size_t>(cell.level)]; }
  /// Space of its level.
  Vec3i place(const ExaCell& cell) const;
};

/// Throws Error for a domain of more than 31 bits of index.
ExaGrid find_grid(const ExaCellFile& file);

/// Boxes of patches a level. A cell whose children exist all the way down is stored as well, so that its mean is computed
/// once; cells around holes become patches of leaves alone. Throws Error for cells that do not lie on multiples of their width,
/// that lie twice in one place, or over finer ones.
std::vector<std::vector<Box>> patch_boxes(const ExaCellFile& file, const ExaGrid& grid);

}  // namespace amrtex
