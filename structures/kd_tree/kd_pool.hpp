// Where bricks lie in the pool: in one texture, or in several where the context takes none as large.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "structures/common/brick_packing.hpp"
#include "structures/common/divided_pool.hpp"

namespace amrtex::kd {

struct PoolPacking {
  packing::Packing packing;     ///< size: of each texture; at: of each brick, in its texture
  std::vector<int> texture_of;  ///< a brick
  int textures = 1;
};

/// Runs of bricks, as they came, with about as many texels each. Not valid where a run does not fit a texture of `limit` texels
/// an axis.
inline PoolPacking pack_textures(std::span<const Vec3i> bricks, int textures, bool paper, int limit) {
  PoolPacking p;
  p.textures = textures;
  const std::int64_t all = packing::used_texels(bricks);
  std::int64_t packed = 0;
  std::size_t first = 0;
  for (int t = 0; t < textures; ++t) {
    std::size_t last = first;
    while (last < bricks.size() && (t + 1 == textures || packed * textures < all * (t + 1)))
      packed += packing::volume(bricks[last++]);
    const auto run = bricks.subspan(first, last - first);
    first = last;
    if (run.empty()) continue;
    const packing::Packing one = paper ? packing::pack_nfdh(run, limit) : packing::pack_best_fit(run, limit);
    if (!one.valid()) return {};
    p.packing.size = glm::max(p.packing.size, one.size);
    p.packing.at.insert(p.packing.at.end(), one.at.begin(), one.at.end());
    p.texture_of.insert(p.texture_of.end(), run.size(), t);
  }
  return p;
}

/// The fewest textures that the context takes. Where it takes no number of them: what fits its edges and not its bytes, or
/// nothing valid.
inline PoolPacking pack_pool(const BuildRequest& request, std::span<const Vec3i> bricks, bool paper) {
  const int most = most_pool_textures(request.field_count());
  const auto enough = [&](int textures) {
    const CheckedSize bytes = CheckedSize(packing::used_texels(bricks)) * texel_bytes(request.storage);
    return bytes.or_most() / textures <= request.context.max_texture_bytes;
  };
  PoolPacking p;
  for (int textures = 1; textures <= most; ++textures) {
    if (textures < most && !enough(textures)) continue;  // packing takes longer than this look
    p = pack_textures(bricks, textures, paper, request.context.max_3d_texture_size);
    if (p.packing.valid() && takes_values(request, p.packing.size)) break;
  }
  return p;
}

}  // namespace amrtex::kd
