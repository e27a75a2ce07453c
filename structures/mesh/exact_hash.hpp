// What tells two meshes apart where their content hash does not.
#pragma once

#include <span>
#include <string>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Hex digits of a hash over everything that a structure or a picture of these fields can depend on: the domain's corners, its
/// cells and ratios, each patch's box, and each value as the double that holds it, bit by bit. Unlike `content_hash` it knows
/// origin and spacing and rounds nothing; equal meshes whose patches were cut or ordered in another way differ. Names of data
/// set and fields do not count, nor do values that the file stored under finer patches, which the mesh has replaced.
std::string exact_hash(const AmrHierarchy& mesh, std::span<const int> fields);

}  // namespace amrtex
