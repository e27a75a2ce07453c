// AMReX plotfiles (a folder with `Header` and `Level_<l>/Cell_H`, `Cell_D_*`).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True when the folder looks like a plotfile.
bool is_amrex_plotfile(const std::filesystem::path& path);

MeshDescription read_amrex_plotfile(const std::filesystem::path& path, const FieldChoice& fields);

/// Writes FABs of float32 where all fields of the patch are, else of float64, little endian, Cell_H version 1, one data file a level, into
/// a folder that must not exist yet; nothing is left behind on failure.
void write_amrex_plotfile(const AmrHierarchy& hierarchy, const std::filesystem::path& path);

}  // namespace amrtex
