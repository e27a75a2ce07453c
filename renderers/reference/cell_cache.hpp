// Direct-mapped caches of what was found about cells; of one thread. Private to the reference.
#pragma once

#include <cstdint>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// T has members `level` (-1 at first) and `cell`, by which the caller sees whether the entry is the one that it asked for.
template <class T>
class CellCache {
 public:
  T& at(int level, const Vec3i& c) {
    // neighbouring cells never share a slot
    const auto slot =
        static_cast<std::uint32_t>((c.x & 31) | (c.y & 31) << 5 | (c.z & 31) << 10) ^ static_cast<std::uint32_t>(level) * 0x9E35U;
    return entries_[slot & (kEntries - 1)];
  }

 private:
  static constexpr std::uint32_t kEntries = 1U << 16;
  std::vector<T> entries_ = std::vector<T>(kEntries);
};

}  // namespace amrtex
