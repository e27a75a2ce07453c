// VTKHDF files of type OverlappingAMR, which ParaView 5.11 and later read.
#pragma once

#include <filesystem>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Throws Error where there is something of this name; nothing is left behind on failure.
void write_vtkhdf(const AmrHierarchy& hierarchy, const std::filesystem::path& path);

}  // namespace amrtex
