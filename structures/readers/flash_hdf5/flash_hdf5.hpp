// Plot files of FLASH and Flash-X in HDF5: a tree of blocks of equal numbers of cells.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for an HDF5 file with a tree of blocks and a version as FLASH writes them.
bool is_flash_hdf5(const std::filesystem::path& path);

MeshDescription read_flash_hdf5(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
