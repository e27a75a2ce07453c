// Output of Enzo: a parameter file, a hierarchy of grids as text, and the values in HDF5.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for a folder that holds an output, for its parameter file, its hierarchy, or a file of its values.
bool is_enzo(const std::filesystem::path& path);

MeshDescription read_enzo(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
