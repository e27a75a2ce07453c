// Opening data sets of any format, and saying what is in them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Reads the data set at `path`, whatever its format. Only `fields` are read, in
/// that order, or all where none is given. Throws Error naming the file and what is wrong,
/// and UsageError naming the fields there are when one of `fields` does not exist.
MeshDescription read_mesh(const std::filesystem::path& path, const std::vector<std::string>& fields = {});

}  // namespace amrtex
