// Data sets of the ExaBricks family: `.cells` or `.bricks` with `.scalars`, or a `.exa` file that names them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for one of these files, and for a folder that holds one data set of them.
bool is_exabrick(const std::filesystem::path& path);

MeshDescription read_exabrick(const std::filesystem::path& path, const FieldChoice& fields);

/// The leaf cells, values as float. One field: `name.cells` and `name.scalars`; several: `name.cells` and
/// `name.<field>.scalars`. No file of these names may exist; nothing is left behind on failure.
void write_exabrick(const AmrHierarchy& hierarchy, const std::filesystem::path& path);

}  // namespace amrtex
