// Pools that are divided over several textures of one size, where the context takes none as large as the whole.
#pragma once

#include <algorithm>

#include "structures/common/encoding.hpp"
#include "structures/mesh/checked.hpp"

namespace amrtex {

/// Textures that a field's pool may be divided over (AMRTEX_MOST_POOL_TEXTURES in shaders/contract.glsl).
inline constexpr int kMostPoolTextures = 8;

/// Each is a unit of the context, of which any has 16 at least.
inline int most_pool_textures(int fields) { return std::min(kMostPoolTextures, 16 / fields); }

/// Does the context take a texture of values of this size?
inline bool takes_values(const BuildRequest& request, const Vec3i& size) {
  const CheckedSize bytes = CheckedSize(size.x) * size.y * size.z * texel_bytes(request.storage);
  return std::max({size.x, size.y, size.z}) <= request.context.max_3d_texture_size &&
         bytes.or_most() <= request.context.max_texture_bytes;
}

}  // namespace amrtex
