// Data sets written in any of the formats that can be.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Writes to a name that must not exist yet, in the format of this name or, where none is given, in that of the path's
/// ending; a path of no known ending becomes the folder of an AMReX plotfile. Nothing is left behind on failure.
/// Throws UsageError for an unknown format and for endings of formats that are not written.
void write_mesh(const AmrHierarchy& hierarchy, const std::filesystem::path& path, std::string_view format = {});

/// Throws as write_mesh() does, before there is a mesh.
void require_writable_format(const std::filesystem::path& path, std::string_view format);

/// For help texts: "amrex (a folder), exabrick (.cells), ...".
std::string written_formats();

}  // namespace amrtex
