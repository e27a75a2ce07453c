#include "renderers/bindings/distance_map.hpp"

#include <algorithm>

namespace amrtex {
namespace {

std::uint8_t next(std::uint8_t distance) { return static_cast<std::uint8_t>(std::min<int>(distance + 1, kMostDistance)); }

/// One pass in ascending or descending order over a grid of distances with a layer of kMostDistance around it.
class Pass {
 public:
  Pass(const Vec3i& blocks, std::vector<std::uint8_t>& padded)
      : blocks_(blocks), row_(blocks.x + 2), slice_(row_ * (blocks.y + 2)), padded_(padded) {}

  void run(bool ascending) {
    const std::ptrdiff_t way = ascending ? 1 : -1;
    for (int k = 0; k < blocks_.z; ++k)
      for (int j = 0; j < blocks_.y; ++j) row(ascending ? Vec3i(0, j, k) : Vec3i(0, blocks_.y - 1 - j, blocks_.z - 1 - k), way);
  }
  std::size_t offset(const Vec3i& block) const {
    return static_cast<std::size_t>(block.x + 1 + row_ * (block.y + 1) + slice_ * (block.z + 1));
  }

 private:
  /// The nine neighbours of the slice before and the three of the row before, then the one before in the row itself.
  void row(const Vec3i& first, std::ptrdiff_t way) {
    std::uint8_t* d = &padded_[offset(first)];
    for (int x = 0; x < blocks_.x; ++x, ++d) {
      std::uint8_t least = kMostDistance;
      for (const std::ptrdiff_t from : {slice_ - row_, slice_, slice_ + row_, row_})
        for (const std::ptrdiff_t x_from : {-1, 0, 1}) least = std::min(least, d[-way * from + x_from]);
      *d = std::min(*d, next(least));
    }
    d = &padded_[offset(first)];
    if (way < 0) d += blocks_.x - 1;
    for (int x = 0; x < blocks_.x; ++x, d += way) *d = std::min(*d, next(d[-way]));
  }
  Vec3i blocks_;
  std::ptrdiff_t row_, slice_;
  std::vector<std::uint8_t>& padded_;
};

}  // namespace

std::vector<std::uint8_t> chessboard_distances(const Vec3i& blocks, std::span<const std::uint8_t> marked) {
  const Box all{Vec3i(0), blocks};
  std::vector<std::uint8_t> padded(static_cast<std::size_t>(all.grown(1).cells()), kMostDistance);
  Pass pass(blocks, padded);
  for_each_cell(all, [&](const Vec3i& b) { padded[pass.offset(b)] = marked[all.offset(b)] != 0 ? 0 : kMostDistance; });
  pass.run(true);
  pass.run(false);
  std::vector<std::uint8_t> distances(marked.size());
  for_each_cell(all, [&](const Vec3i& b) { distances[all.offset(b)] = padded[pass.offset(b)]; });
  return distances;
}

std::vector<std::uint8_t> octant_distances(const Vec3i& blocks, std::span<const std::uint8_t> marked, int octant) {
  const std::ptrdiff_t row = blocks.x + 1, slice = row * (blocks.y + 1);
  // from the far corner of the octant inwards, with a layer of kMostDistance behind the last blocks
  std::vector<std::uint8_t> padded(static_cast<std::size_t>(slice * (blocks.z + 1)), kMostDistance);
  std::vector<std::uint8_t> distances(marked.size());
  const Box all{Vec3i(0), blocks};
  for_each_cell(all, [&](const Vec3i& far) {
    const std::ptrdiff_t at = far.x + 1 + row * (far.y + 1) + slice * (far.z + 1);
    const Vec3i b = {(octant & 1) != 0 ? far.x : blocks.x - 1 - far.x, (octant & 2) != 0 ? far.y : blocks.y - 1 - far.y,
                     (octant & 4) != 0 ? far.z : blocks.z - 1 - far.z};
    std::uint8_t least = kMostDistance;
    for (const std::ptrdiff_t before : {std::ptrdiff_t{1}, row, row + 1, slice, slice + 1, slice + row, slice + row + 1})
      least = std::min(least, padded[static_cast<std::size_t>(at - before)]);
    const std::size_t i = all.offset(b);
    distances[i] = padded[static_cast<std::size_t>(at)] = marked[i] != 0 ? std::uint8_t{0} : next(least);
  });
  return distances;
}

}  // namespace amrtex
