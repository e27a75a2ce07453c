// Plot files of FLASH and Flash-X in HDF5: a tree of blocks of equal numbers of cells.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// True for an HDF5 file with a tree of blocks and a version as FLASH writes them.
bool is_flash_hdf5(const std::filesystem::path& path);

/// Reads these fields, or all when none is given.
MeshDescription read_flash_hdf5(const std::filesystem::path& path, const std::vector<std::string>& fields);

}  // namespace amrtex
