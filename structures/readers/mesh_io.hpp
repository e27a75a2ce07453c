// Opening data sets of any format, and saying what is in them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// Reads the data set at `path`, whatever its format. Only the wanted fields are
/// read; `fields_there` of the mesh names all. Throws Error naming the file and what is wrong,
/// and UsageError naming the fields there are when a wanted one does not exist.
MeshDescription read_mesh(const std::filesystem::path& path, const FieldChoice& fields = {});

}  // namespace amrtex
