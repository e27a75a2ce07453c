// Values of a box of cells as texels of a pool.
#pragma once

#include <vector>

#include "structures/common/build_tools.hpp"

namespace amrtex {

/// Stores the values of a box, x fastest, where the pool has the box's cells moved by `shift`.
inline void store_box(const Box& box, const std::vector<double>& values, const Vec3i& shift, StorageScale scale,
                      HostTexture& pool) {
  const Box all{Vec3i(0), pool.size};
  const auto row = static_cast<std::size_t>(box.size().x);
  for (int z = box.lower.z; z < box.upper.z; ++z)
    for (int y = box.lower.y; y < box.upper.y; ++y) {
      const Vec3i first(box.lower.x, y, z);
      store_values(pool.format, scale, &values[box.offset(first)], row, pool.data.data(), all.offset(first + shift));
    }
}

}  // namespace amrtex
