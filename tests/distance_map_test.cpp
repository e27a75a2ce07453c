#include "renderers/bindings/distance_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "structures/mesh/spaces.hpp"

namespace amrtex {
namespace {

/// max(|dx|, |dy|, |dz|) to the nearest marked block, by asking all.
std::vector<std::uint8_t> by_definition(const Vec3i& blocks, const std::vector<std::uint8_t>& marked) {
  const Box all{Vec3i(0), blocks};
  std::vector<std::uint8_t> distances(marked.size(), kMostDistance);
  for_each_cell(all, [&](const Vec3i& to) {
    if (marked[all.offset(to)] == 0) return;
    for_each_cell(all, [&](const Vec3i& b) {
      const Vec3i way = glm::abs(b - to);
      const int distance = std::min(std::max({way.x, way.y, way.z}), kMostDistance);
      distances[all.offset(b)] = std::min(distances[all.offset(b)], static_cast<std::uint8_t>(distance));
    });
  });
  return distances;
}

TEST(DistanceMap, IsTheChessboardDistanceOfRandomMarks) {
  std::mt19937 random(7);
  for (const Vec3i blocks : {Vec3i(1), Vec3i(9, 1, 1), Vec3i(1, 7, 2), Vec3i(11, 8, 13)})
    for (const int one_in : {1, 3, 40, 100000}) {
      std::vector<std::uint8_t> marked(static_cast<std::size_t>(Box{Vec3i(0), blocks}.cells()));
      for (std::uint8_t& m : marked) m = random() % static_cast<unsigned>(one_in) == 0 ? 1 : 0;
      EXPECT_EQ(chessboard_distances(blocks, marked), by_definition(blocks, marked))
          << blocks.x << " x " << blocks.y << " x " << blocks.z << ", one in " << one_in;
    }
}

/// The same to blocks that lie at or ahead of each along every axis.
std::vector<std::uint8_t> ahead_by_definition(const Vec3i& blocks, const std::vector<std::uint8_t>& marked, int octant) {
  const Box all{Vec3i(0), blocks};
  std::vector<std::uint8_t> distances(marked.size(), kMostDistance);
  const Vec3i sense(octant & 1 ? -1 : 1, octant & 2 ? -1 : 1, octant & 4 ? -1 : 1);
  for_each_cell(all, [&](const Vec3i& to) {
    if (marked[all.offset(to)] == 0) return;
    for_each_cell(all, [&](const Vec3i& b) {
      const Vec3i way = (to - b) * sense;
      if (std::min({way.x, way.y, way.z}) < 0) return;
      const int distance = std::min(std::max({way.x, way.y, way.z}), kMostDistance);
      distances[all.offset(b)] = std::min(distances[all.offset(b)], static_cast<std::uint8_t>(distance));
    });
  });
  return distances;
}

/// A block is hidden so far as the domain goes, and further.
void cut_at_faces(const Vec3i& blocks, std::vector<std::uint8_t>& distances) {
  const int most = std::max({blocks.x, blocks.y, blocks.z});
  for (std::uint8_t& d : distances) d = static_cast<std::uint8_t>(std::min<int>(d, most));
}

TEST(DistanceMap, OfAnOctantKnowsWhatLiesAhead) {
  std::mt19937 random(8);
  const Vec3i blocks(7, 9, 5);
  for (int octant = 0; octant < 8; ++octant)
    for (const int one_in : {2, 30, 100000}) {
      std::vector<std::uint8_t> marked(static_cast<std::size_t>(Box{Vec3i(0), blocks}.cells()));
      for (std::uint8_t& m : marked) m = random() % static_cast<unsigned>(one_in) == 0 ? 1 : 0;
      std::vector<std::uint8_t> found = octant_distances(blocks, marked, octant);
      std::vector<std::uint8_t> expected = ahead_by_definition(blocks, marked, octant);
      cut_at_faces(blocks, found);
      cut_at_faces(blocks, expected);
      EXPECT_EQ(found, expected) << "octant " << octant << ", one in " << one_in;
    }
}

TEST(DistanceMap, CountsNoFurtherThanItsBytesHold) {
  std::vector<std::uint8_t> marked(1000);
  marked[0] = 1;
  const std::vector<std::uint8_t> distances = chessboard_distances({1000, 1, 1}, marked);
  EXPECT_EQ(distances[254], 254);
  EXPECT_EQ(distances[999], kMostDistance);
}

}  // namespace
}  // namespace amrtex
