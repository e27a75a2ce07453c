// Ranges of cells as files state them, before they become boxes of a mesh.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <string>

namespace amrtex {

/// Indices as files write them; wider than their 32 bits so that sums cannot overflow.
using Vec3l = glm::vec<3, std::int64_t>;

/// A range of indices in the convention of AMReX and Chombo: both corners inclusive, any origin.
struct IndexBox {
  Vec3l lower{0};
  Vec3l upper{0};

  bool operator==(const IndexBox&) const = default;
  Vec3l size() const { return upper - lower + std::int64_t{1}; }
  bool contains(const IndexBox& b) const {
    return glm::all(glm::lessThanEqual(lower, b.lower)) && glm::all(glm::greaterThanEqual(upper, b.upper));
  }
};

inline std::string text(const Vec3l& v) { return fmt::format("({},{},{})", v.x, v.y, v.z); }
inline std::string text(const IndexBox& b) { return fmt::format("({} {})", text(b.lower), text(b.upper)); }

}  // namespace amrtex
