// Output of Enzo: a parameter file, a hierarchy of grids as text, and the values in HDF5.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// True for a folder that holds an output, for its parameter file, its hierarchy, or a file of its values.
bool is_enzo(const std::filesystem::path& path);

/// Reads these fields, or all when none is given.
MeshDescription read_enzo(const std::filesystem::path& path, const std::vector<std::string>& fields);

}  // namespace amrtex
