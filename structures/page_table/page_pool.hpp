// Blocks of texels in one 3D texture, found by shifts.
#pragma once

#include <algorithm>
#include <cstdint>

#include "structures/common/divided_pool.hpp"
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

/// The pool of a field: as few textures as hold its pages, of one size, and as many pages in each.
struct PagePool {
  PoolLayout layout;  ///< of a texture
  int textures = 1;
  std::int64_t pages = 1;  ///< in a texture; the last one may have fewer

  int texture_of(std::int64_t page) const { return static_cast<int>(page / pages); }
  /// In its texture, texels.
  Vec3i position(std::int64_t page) const { return layout.position(page % pages); }
};

/// False where the pages fit no number of textures with so many texels an axis. What does not fit by its bytes is laid out all
/// the same, in the most textures: the structure's Layout refuses it with the numbers.
inline bool lay_out_pool(const BuildRequest& request, int edge, std::int64_t pages, PagePool& pool) {
  const int most = most_pool_textures(request.field_count());
  bool fits = false;
  for (pool.textures = 1; pool.textures <= most; ++pool.textures) {
    pool.pages = std::max<std::int64_t>((pages + pool.textures - 1) / pool.textures, 1);
    fits = lay_out(pool.pages, edge, request.context.max_3d_texture_size, pool.layout);
    if (fits && takes_values(request, pool.layout.texels())) return true;
  }
  pool.textures = most;
  return fits;
}

}  // namespace amrtex::pages
