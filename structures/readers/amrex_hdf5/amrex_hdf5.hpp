// Plot files that AMReX writes in HDF5, with one data set a level or one for each component.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// True for an HDF5 file that says which kind of AMReX plot file it is.
bool is_amrex_hdf5(const std::filesystem::path& path);

/// Reads these fields, or all when none is given.
MeshDescription read_amrex_hdf5(const std::filesystem::path& path, const std::vector<std::string>& fields);

}  // namespace amrtex
