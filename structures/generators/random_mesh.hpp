// Small meshes with everything that is legal and rare, for property tests.
#pragma once

#include <cstdint>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Limits and permissions; whether a given seed makes use of them is up to the seed.
struct RandomMeshOptions {
  int max_levels = 4;
  int max_root_cells = 7;                   ///< along an axis
  std::int64_t max_finest_cells = 1 << 18;  ///< of the whole domain; fewer levels are made to keep it
  int fields = 1;
  bool holes = true;                 ///< domain cells without a leaf, also ones that only finer patches fill
  bool empty_levels = true;          ///< levels without a patch, level 0 included
  bool missing_values = true;        ///< NaN and infinities in some seeds
  bool power_of_two_ratios = false;  ///< only 2 and 4, else 3 as well
};

/// A mesh that AmrHierarchy accepts: mixed ratios, anisotropic spacing, non-cubic domains
/// far from the origin, patches of any box, not nested in one parent and up to several
/// levels finer than what they lie on, one-cell patches, random or smooth values.
/// The same seed and options give the same mesh on every machine.
MeshDescription random_mesh(std::uint64_t seed, const RandomMeshOptions& options = {});

}  // namespace amrtex
