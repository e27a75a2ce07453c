// Codes of value ranges that stand for no values (encode_range() in build_tools.hpp makes the others).
#pragma once

#include <cstdint>

namespace amrtex {

/// Code of a range that holds no value: no mesh.
inline constexpr std::uint32_t kNoRange = 0xffffffffU;
/// Code of a region where the drawn field has no value and another one has: the mesh is there, and the
/// range covers nothing. It decodes to a minimum of infinity and a maximum at the origin: most volumes may
/// skip it, and no isovalue has all of it on one side, so that a ray does not take a side there.
inline constexpr std::uint32_t kVacantRange = 0x00007f80U;

}  // namespace amrtex
