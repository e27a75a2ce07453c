// Plot files that AMReX writes in HDF5, with one data set a level or one for each component.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for an HDF5 file that says which kind of AMReX plot file it is.
bool is_amrex_hdf5(const std::filesystem::path& path);

MeshDescription read_amrex_hdf5(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
