// Files of triangles: OBJ, PLY and STL.
#pragma once

#include <filesystem>

#include "renderers/scene/triangle_mesh.hpp"

namespace amrtex {

/// All triangles of a file that ends in .obj, .ply or .stl, in its order; polygons are cut into triangles, points and lines
/// left out. Coordinates are as the file has them, rounded to 32-bit floats. No other file is opened. Throws Error naming the
/// file, what is wrong and what is accepted. What stands in a file outside of its folder, which a link leads to, is not quoted.
TriangleMesh read_triangles(const std::filesystem::path& path);
/// `folder`: where somebody else's path to the file begins, as that of an experiment file. No link below it is followed by
/// quoting.
TriangleMesh read_triangles(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace amrtex
