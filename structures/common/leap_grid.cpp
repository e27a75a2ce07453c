#include "structures/common/leap_grid.hpp"

#include <algorithm>

#include "structures/common/coded_range.hpp"

namespace amrtex {
namespace {

constexpr std::uint32_t kLow = 0xffffU;

/// Both ends are upper halves of floats that are not negative: they are ordered as whole numbers are.
std::uint32_t hull(std::uint32_t a, std::uint32_t b) {
  if (a == kNoRange) return b;
  return std::max(a >> 16, b >> 16) << 16 | std::min(a & kLow, b & kLow);
}

}  // namespace

LeapGrid LeapGrid::over(const Vec3i& cells, std::int64_t most) {
  LeapGrid grid;
  if (std::max({cells.x, cells.y, cells.z}) > 1 << 30) return grid;
  const auto blocks = [&](int shift) { return ceil_div(cells, 1 << shift); };
  while (Box{Vec3i(0), blocks(grid.shift)}.cells() > most) ++grid.shift;
  grid.blocks = blocks(grid.shift);
  grid.ranges.assign(static_cast<std::size_t>(Box{Vec3i(0), grid.blocks}.cells()), kNoRange);
  return grid;
}

LeapGrid LeapGrid::over(const AmrHierarchy& h) {
  const std::int64_t by_cells = std::max<std::int64_t>(1, h.leaf_cells() / kLeafCellsPerLeapBlock);
  return over(h.cells(h.finest_level()), std::min(kMostLeapBlocks, by_cells));
}

void LeapGrid::cover(const Box& box, std::uint32_t range) {
  if (range == kNoRange || empty() || box.cells() <= 0) return;
  const Box all{Vec3i(0), blocks};
  const Box touched{box.lower >> shift, ((box.upper - Vec3i(1)) >> shift) + Vec3i(1)};
  for_each_cell(touched, [&](const Vec3i& b) {
    std::uint32_t& of_block = ranges[all.offset(b)];
    of_block = hull(of_block, range);
  });
}

}  // namespace amrtex
