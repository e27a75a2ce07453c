// Level values v_L and their fills for whole boxes: the only definition that encodings use
// (docs/filters.md; the double reference has its own).
#pragma once

#include <span>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Writes v_L of every cell of `box` (space of `level`, may overhang the domain) to
/// `out`, x fastest; NaN where the mesh or the value is missing.
void level_values(const AmrHierarchy& hierarchy, int field, int level, const Box& box, std::span<double> out);

/// The same with every missing cell that has an existing neighbour replaced by its
/// fill value: the mean of the existing v_L of its face neighbours, else of its edge
/// neighbours, else of its corner neighbours. Cells without any stay NaN.
/// `missing`, when not empty, receives 1 for each cell that had no value of its own.
void filled_level_values(const AmrHierarchy& hierarchy, int field, int level, const Box& box, std::span<double> out,
                         std::span<std::uint8_t> missing = {});

}  // namespace amrtex
