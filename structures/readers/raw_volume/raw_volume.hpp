// Volumes of equal cells: `.raw` with its shape in its name, NRRD, `.npy`. They become a mesh by a stated criterion.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/raw_volume/coarsen_volume.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// True for a NRRD header, an array of NumPy, and a file whose name says shape and type, `name_WxHxD_type.raw`.
bool is_raw_volume(const std::filesystem::path& path);

/// A volume of equal cells, whose values are read as they are asked for.
Volume read_volume(const std::filesystem::path& path);

/// A volume as a mesh, by the criterion's defaults. `fields` may name its one field.
MeshDescription read_raw_volume(const std::filesystem::path& path, const FieldChoice& fields);

}  // namespace amrtex
