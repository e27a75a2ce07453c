// Integer boxes and the conversions between the index spaces of levels: the only
// place for such arithmetic. Three spaces meet in this project:
//   world   the file's own units (double), origin and spacing as the file says
//   level   integer cells of one level, the domain's lower corner at (0,0,0)
//   finest  integer cells of the finest level
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>

#include "structures/mesh/checked.hpp"

namespace amrtex {

using Vec3i = glm::ivec3;
using Vec3f = glm::vec3;
using Vec3d = glm::dvec3;

/// Division that rounds towards minus infinity, so that cell -1 has parent -1 and not 0.
constexpr int floor_div(int a, int b) {
  const int q = a / b;
  return (a % b != 0 && (a < 0) != (b < 0)) ? q - 1 : q;
}
constexpr int ceil_div(int a, int b) { return -floor_div(-a, b); }

inline Vec3i floor_div(const Vec3i& a, int b) { return {floor_div(a.x, b), floor_div(a.y, b), floor_div(a.z, b)}; }
inline Vec3i ceil_div(const Vec3i& a, int b) { return {ceil_div(a.x, b), ceil_div(a.y, b), ceil_div(a.z, b)}; }

/// A half-open range [lower, upper) of cells.
struct Box {
  Vec3i lower{0};
  Vec3i upper{0};

  bool operator==(const Box&) const = default;
  Vec3i size() const { return upper - lower; }
  bool empty() const { return upper.x <= lower.x || upper.y <= lower.y || upper.z <= lower.z; }
  /// How many; INT64_MAX where that takes more than 63 bits, which a domain may.
  std::int64_t cells() const {
    if (empty()) return 0;
    const Vec3i s = size();
    return (CheckedSize(s.x) * CheckedSize(s.y) * CheckedSize(s.z)).or_most();
  }
  bool contains(const Vec3i& i) const {
    return i.x >= lower.x && i.y >= lower.y && i.z >= lower.z && i.x < upper.x && i.y < upper.y && i.z < upper.z;
  }
  bool contains(const Box& b) const { return b.empty() || (contains(b.lower) && contains(b.upper - Vec3i(1))); }
  Box grown(int n) const { return {lower - Vec3i(n), upper + Vec3i(n)}; }
  Box shifted(const Vec3i& d) const { return {lower + d, upper + d}; }
  /// Smallest box of cells `ratio` times as wide that covers this one.
  Box coarsened(int ratio) const { return {floor_div(lower, ratio), ceil_div(upper, ratio)}; }
  Box refined(int ratio) const { return {lower * ratio, upper * ratio}; }
  /// Offset of cell i in an array over this box, x fastest.
  std::size_t offset(const Vec3i& i) const {
    const Vec3i s = size();
    const Vec3i d = i - lower;
    return static_cast<std::size_t>(d.x) +
           static_cast<std::size_t>(s.x) *
               (static_cast<std::size_t>(d.y) + static_cast<std::size_t>(s.y) * static_cast<std::size_t>(d.z));
  }
};

inline Box intersection(const Box& a, const Box& b) { return {glm::max(a.lower, b.lower), glm::min(a.upper, b.upper)}; }
inline bool overlap(const Box& a, const Box& b) { return !intersection(a, b).empty(); }

/// Calls f(cell) for every cell of the box, x fastest.
template <class F>
void for_each_cell(const Box& box, F&& f) {
  for (int z = box.lower.z; z < box.upper.z; ++z)
    for (int y = box.lower.y; y < box.upper.y; ++y)
      for (int x = box.lower.x; x < box.upper.x; ++x) f(Vec3i(x, y, z));
}

/// The first cell of the box, x fastest, for which `f` holds.
template <class F>
std::optional<Vec3i> first_cell(const Box& box, F&& f) {
  for (int z = box.lower.z; z < box.upper.z; ++z)
    for (int y = box.lower.y; y < box.upper.y; ++y)
      for (int x = box.lower.x; x < box.upper.x; ++x)
        if (f(Vec3i(x, y, z))) return Vec3i(x, y, z);
  return std::nullopt;
}

}  // namespace amrtex
