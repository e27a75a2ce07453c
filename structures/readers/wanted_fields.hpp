// Which fields of a data set are to be read.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace amrtex {

/// Where the wanted fields stand among those there are; all of them where none is named. Throws UsageError that names the
/// nearest name and those there are.
std::vector<std::size_t> wanted_fields(const std::filesystem::path& path, const std::vector<std::string>& there,
                                       const std::vector<std::string>& wanted);

}  // namespace amrtex
