// Equal cells to levels of blocks: where a coarse cell says the same, or where nobody sees the difference.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/raw_volume/volume_source.hpp"

namespace amrtex {

struct Volume {
  std::string name;  ///< of the data set
  std::string field;
  Vec3i cells{1};
  Vec3d lower{0};                        ///< world
  Vec3d spacing{1};                      ///< world, a cell
  std::unique_ptr<VolumeSource> source;  ///< of the values
  RealType type = RealType::float64;     ///< holds each of them exactly
  std::string unit = {};                 ///< of the values; empty where nothing says it
};

/// When a block becomes coarse. A block of level l is `block` cells of that level along each axis.
struct CoarsenCriterion {
  /// A block is made of cells of width 2^k when each of them is their mean, and no value under it differs from it by more
  /// than this share of the volume's range. 0: only where values are equal.
  double tolerance = 1.0 / 256;
  /// It is as well when all its values lie in one of these ranges, which a transfer function hides.
  std::vector<std::array<double, 2>> hidden = {};
  int levels = 5;  ///< at most; 1 to 16
  int block = 8;   ///< cells along an axis; even, 2 to 256
};

/// Throws UsageError naming the parameter and what is accepted.
void validate(const CoarsenCriterion& criterion);

/// The volume's own cells are the finest level; only levels that are used are made. Blocks are asked from the coarsest on. A
/// cell that is missing (NaN or infinite) is kept fine unless all beside it are. Where the size is no multiple of the coarsest
/// cell, the domain ends behind the volume, with a hole there.
MeshDescription coarsen_volume(Volume volume, const CoarsenCriterion& criterion = {});

}  // namespace amrtex
