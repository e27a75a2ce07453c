// A cell of the octree.
#pragma once

#include <cstdint>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

using Vec3l = glm::vec<3, std::int64_t>;  // finest cells where 31 bits may be passed

/// A cell of the tree: a cube of 2^shift finest cells.
struct TreeCell {
  Vec3l lower{0};  ///< finest; negative before the domain
  int shift = 0;
  /// Nothing in it has a value: it is divided for the sake of its neighbours' fills.
  bool missing = false;

  TreeCell child(int octant) const {
    const std::int64_t half = std::int64_t{1} << (shift - 1);
    return {lower + Vec3l(octant & 1, (octant >> 1) & 1, octant >> 2) * half, shift - 1, missing};
  }
};

}  // namespace amrtex
