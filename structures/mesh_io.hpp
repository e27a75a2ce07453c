// Opening data sets of any format, and saying what is in them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "amr_hierarchy.hpp"

namespace amrtex {

/// Reads the data set at `path`, whatever its format. Only `field` is read, or all
/// fields where none is given. Throws Error naming the file and what is wrong, and
/// UsageError naming the fields there are when `field` does not exist.
MeshDescription read_mesh(const std::filesystem::path& path, const std::optional<std::string>& field = std::nullopt);

}  // namespace amrtex
