// VTKHDF of type OverlappingAMR: levels of overlapping boxes in HDF5, as VTK and ParaView write them.
#pragma once

#include <filesystem>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for an HDF5 file with a group `VTKHDF`, whatever its type.
bool is_vtkhdf(const std::filesystem::path& path);

MeshDescription read_vtkhdf(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
