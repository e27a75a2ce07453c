// Two-dimensional data as a mesh: a slab one cell of the coarsest level thick and as deep as the finest cell's edge. As all
// axes of a mesh are refined alike, a cell of level l becomes the column of cells that refinement makes of the depth, all
// with its value.
#pragma once

#include <filesystem>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Cells of `level` in the slab's depth, for each cell in the plane. Ratios are those of the mesh.
std::int64_t slab_cells(const MeshDescription& mesh, std::size_t level);

/// Gives a mesh that was read with one cell along z in all its boxes its depth, and says that its data are
/// two-dimensional. `path` is for the message where that takes more memory than there is.
void make_slab(MeshDescription& mesh, const std::filesystem::path& path);

}  // namespace amrtex
