// Plot files of Chombo, and of codes that write with it, in HDF5.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for an HDF5 file with a group `Chombo_global` or levels as Chombo numbers them.
bool is_chombo_hdf5(const std::filesystem::path& path);

MeshDescription read_chombo_hdf5(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
