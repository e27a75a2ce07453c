// Single cells to few boxes: what formats that list cells, and meshes that are made block by block, have for patches.
#pragma once

#include <span>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// The order of cells in an array: z, then y, then x.
inline bool array_order(const Vec3i& a, const Vec3i& b) { return a.z != b.z ? a.z < b.z : a.y != b.y ? a.y < b.y : a.x < b.x; }

/// Disjoint boxes that hold exactly these cells, which are in array order and all different: rows, which become
/// rectangles where they fit, which become boxes.
std::vector<Box> boxes_of_cells(std::span<const Vec3i> cells);

/// The same of runs: rows of cells along x, in any order, that do not meet.
std::vector<Box> boxes_of_runs(std::vector<Box> runs);

/// Cells along an axis of the patches that are made of boxes: patches are worked on in parallel, and each with memory of its own.
inline constexpr int kWidestPatch = 64;

/// Parts of boxes from their lower corners on, at most `edge` cells wide, in the order of the boxes.
std::vector<Box> parts_of(std::span<const Box> boxes, int edge);

}  // namespace amrtex
