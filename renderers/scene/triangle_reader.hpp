// Files of triangles: OBJ, PLY and STL.
#pragma once

#include <filesystem>

#include "renderers/scene/triangle_mesh.hpp"

namespace amrtex {

/// All triangles of a file that ends in .obj, .ply or .stl, in its order; polygons are cut into triangles, points and lines
/// left out. Coordinates are as the file has them, rounded to 32-bit floats. No other file is opened. Throws Error naming the
/// file, what is wrong and what is accepted.
TriangleMesh read_triangles(const std::filesystem::path& path);

}  // namespace amrtex
