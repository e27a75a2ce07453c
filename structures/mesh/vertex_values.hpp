// Values at the vertices of cells, for encodings that store vertices (filter `linear_vertex`,
// after Kaehler & Hege 2002, section 3; the double reference has its own).
#pragma once

#include <array>
#include <span>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Writes the value at every vertex of `level` with index in `vertices` (half-open; vertex i
/// is the lower corner of cell i), x fastest: the mean of the 8 v_L around it where only cells
/// of this level or finer touch it, else the interpolant of the coarsest leaf that touches it.
/// Missing cells (holes, no value, outside) do not count as coarser and enter the mean by
/// their fill; a vertex without any value around it becomes NaN.
void vertex_values(const AmrHierarchy& hierarchy, int field, int level, const Box& vertices, std::span<double> out);

}  // namespace amrtex
