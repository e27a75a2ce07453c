// Value ranges on a coarse grid over the domain: what a renderer needs to find how far a ray may leap where nothing can be seen.
#pragma once

#include <cstdint>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

struct EncodedField;

/// The domain in cubes of equal size. An encoding covers it with its regions and their coded value ranges (encode_range()); a
/// block's range is that of all regions that reach into it.
struct LeapGrid {
  int shift = 0;                      ///< log2 of a block's edge, finest cells
  Vec3i blocks{0};                    ///< along each axis
  std::vector<std::uint32_t> ranges;  ///< x fastest; kNoRange where no region was covered
  bool empty() const { return ranges.empty(); }

  /// Blocks of the fewest cells of which a domain of `cells` (finest) has at most `most`. Empty for domains of more than 2^30
  /// cells along an axis.
  static LeapGrid over(const Vec3i& cells, std::int64_t most);
  /// At most kMostLeapBlocks, and a block for every kLeafCellsPerLeapBlock.
  static LeapGrid over(const AmrHierarchy& h);
  /// `box`: finest, inside the domain. kNoRange covers nothing.
  void cover(const Box& box, std::uint32_t range);
};

/// At this many, distances stay in a core's second cache, and a change of transfer function takes milliseconds.
inline constexpr std::int64_t kMostLeapBlocks = std::int64_t{1} << 18;
/// Eight distances a block are then half a byte a leaf cell at most.
inline constexpr std::int64_t kLeafCellsPerLeapBlock = 16;

}  // namespace amrtex
