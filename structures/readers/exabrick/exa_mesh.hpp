// Single leaf cells to levels of patches.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/exabrick/exa_files.hpp"

namespace amrtex {

/// A leaf in our spaces.
struct PlacedCell {
  Vec3i cell;            ///< level space
  std::uint32_t scalar;  ///< place in the arrays of scalars
};

/// Leaves by level, coarsest first, in array order. Only levels that have leaves.
struct ExaLeaves {
  std::vector<int> widths;                      ///< a level, in finest cells
  std::vector<std::vector<PlacedCell>> levels;  ///< a level
  Vec3d lower{0}, upper{1};                     ///< of the domain, in the file's units
  Vec3i root_cells{1};
};

/// Sorts cells into levels. `file` is for messages. Throws Error for levels out of range and cells that do not lie on
/// multiples of their width, or that lie twice in one place.
ExaLeaves place_leaves(const std::filesystem::path& file, ExaCells cells);

/// Boxes of patches a level. A cell whose children exist all the way down is stored as well, so that its mean is computed
/// once; cells around holes become patches of leaves alone. Throws Error for leaves that overlap.
std::vector<std::vector<Box>> patch_boxes(const std::filesystem::path& file, const ExaLeaves& leaves);

/// The values of a box, x fastest; NaN where a cell is no leaf.
CellArray<float> box_values(const Box& box, const std::vector<PlacedCell>& leaves, const std::vector<float>& scalars);

}  // namespace amrtex
