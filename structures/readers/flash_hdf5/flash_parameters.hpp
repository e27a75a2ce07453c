// What the lists of parameters in a FLASH file say: versions 8 and 9 have lists by type, version 7 one record.
#pragma once

#include <array>
#include <optional>

#include "structures/mesh/spaces.hpp"
#include "structures/readers/hdf5_file.hpp"

namespace amrtex {

struct FlashParameters {
  std::int64_t version = 0;
  int dimensions = 3;                          ///< 2 or 3
  Vec3i block_cells{1};                        ///< 1 along axes that there are not
  std::array<std::optional<double>, 3> lower;  ///< of the domain, world
  std::array<std::optional<double>, 3> upper;
  std::array<std::optional<std::int64_t>, 3> root_blocks;
  bool double_plot_files = false;  ///< were plot files of float64 asked for?
};

/// Throws Error where the version, the dimension or the geometry cannot be read.
FlashParameters scan_flash_parameters(const Hdf5File& file);

}  // namespace amrtex
