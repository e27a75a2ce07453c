// How fast a field changes on a coarse grid over the domain: what a renderer needs to choose how far samples may lie apart.
#pragma once

#include <limits>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/value_units.hpp"

namespace amrtex {

/// Bounds on the trilinear field between level values (filter linear_lod) in a block, in the field's units; lengths are those of
/// rays, smallest edges of a finest cell. Of other linear filters, and where pages join cells of two levels, they are estimates.
struct BlockVariation {
  float low = std::numeric_limits<float>::infinity();  ///< of its values
  float high = -std::numeric_limits<float>::infinity();
  float slope = 0;  ///< of |df/ds| along a ray of any direction
  float bend = 0;   ///< of |d2f/ds2|, where a kink between cells counts as spread over the cells beside it

  void add(const BlockVariation& other);
  bool operator==(const BlockVariation&) const = default;
};

/// Blocks as those of LeapGrid. From the differences between neighbouring level values of each leaf cell: first ones bound the
/// slope, second and mixed ones the bend.
struct VariationGrid {
  int shift = 0;                          ///< log2 of a block's edge, finest cells
  Vec3i blocks{0};                        ///< along each axis
  std::vector<BlockVariation> of_blocks;  ///< x fastest; low > high where there is no leaf with a value
  bool empty() const { return of_blocks.empty(); }

  /// Empty where there is no LeapGrid either.
  static VariationGrid of(const AmrHierarchy& hierarchy, int field, const ValueUnits& units);
};

}  // namespace amrtex
