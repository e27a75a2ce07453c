// Blocks of texels in one 3D texture, found by shifts.
#pragma once

#include <algorithm>
#include <cstdint>

#include "structures/mesh/spaces.hpp"

namespace amrtex::pages {

/// Texture axes beyond this cost bits of the normalised coordinate (hardware filtering).
inline constexpr int kPreferredPoolEdge = 1024;

/// Blocks of `edge` texels in a 3D texture of 2^shift.x by 2^shift.y by `layers` blocks:
/// powers of two, so that the shader finds a block by shifts.
struct PoolLayout {
  Vec3i shift{0};
  int layers = 1;
  int edge = 1;
  Vec3i texels() const { return Vec3i(1 << shift.x, 1 << shift.y, layers) * edge; }
  Vec3i position(std::int64_t block) const {
    const auto b = static_cast<int>(block);
    return Vec3i(b & ((1 << shift.x) - 1), (b >> shift.x) & ((1 << shift.y) - 1), b >> (shift.x + shift.y)) * edge;
  }
};

/// False when the blocks do not fit into one texture of at most `limit` texels an axis. As few
/// blocks side by side along x as possible, so that a block's rows lie close in memory; then
/// as few along y, which leaves least unused.
inline bool lay_out(std::int64_t blocks, int edge, int limit, PoolLayout& layout) {
  for (std::int64_t most : {std::min(limit, kPreferredPoolEdge), limit})
    for (int x = 0; (std::int64_t{edge} << x) <= most; ++x)
      for (int y = 0; (std::int64_t{edge} << y) <= most; ++y) {
        const std::int64_t layers = std::max<std::int64_t>((blocks + (std::int64_t{1} << (x + y)) - 1) >> (x + y), 1);
        if (edge * layers > most) continue;
        layout = {{x, y, 0}, static_cast<int>(layers), edge};
        return true;
      }
  return false;
}

}  // namespace amrtex::pages
