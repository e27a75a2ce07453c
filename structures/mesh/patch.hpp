// What a level is made of.
#pragma once

#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// A rectangular block of cells of one level as the simulation wrote it, ghost cells stripped.
struct Patch {
  Box box;                         ///< level space
  std::vector<CellValues> values;  ///< one array a field, box.cells() values each, x fastest
};

}  // namespace amrtex
