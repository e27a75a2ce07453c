// Scalars of the cells into the patches.
#pragma once

#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/exabrick/exa_mesh.hpp"

namespace amrtex {

/// Gives each patch of the mesh its arrays, one a field; NaN where a cell is no leaf. Throws Error where a file cannot be read,
/// std::bad_alloc.
void read_exa_values(const ExaCellFile& file, const ExaGrid& grid, const std::vector<ExaField>& fields,
                     std::vector<std::vector<Patch>>& levels);

}  // namespace amrtex
