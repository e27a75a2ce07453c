// A mesh as arrays of NumPy in one `.npz` file: what a few lines of Python read and write.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for a zip file.
bool is_npz_mesh(const std::filesystem::path& path);

MeshDescription read_npz_mesh(const std::filesystem::path& path, const FieldChoice& fields);

/// Throws Error where there is something of this name; nothing is left behind on failure.
void write_npz_mesh(const AmrHierarchy& hierarchy, const std::filesystem::path& path);

}  // namespace amrtex
