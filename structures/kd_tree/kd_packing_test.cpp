// Bricks in the pool.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "structures/common/brick_packing.hpp"
#include "structures/kd_tree/kd_test_tools.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

// ---- the pool

std::vector<Vec3i> mixed_boxes(std::uint64_t seed, int count, int least = 4, int most = 40) {
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<int> edge(least, most);
  std::vector<Vec3i> boxes;
  for (int i = 0; i < count; ++i) boxes.emplace_back(edge(random), edge(random), edge(random));
  return boxes;
}

/// Every texel of the pool belongs to one brick at most.
void expect_apart(const packing::Packing& p, std::span<const Vec3i> bricks) {
  ASSERT_TRUE(p.valid());
  ASSERT_EQ(p.at.size(), bricks.size());
  std::vector<std::uint8_t> taken(static_cast<std::size_t>(p.texels()));
  const Box all{Vec3i(0), p.size};
  std::int64_t twice = 0;
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    const Box box{p.at[i], p.at[i] + bricks[i]};
    ASSERT_TRUE(all.contains(box));
    for_each_cell(box, [&](const Vec3i& t) { twice += taken[all.offset(t)]++; });
  }
  EXPECT_EQ(twice, 0);
}

TEST(KdTreePacking, BricksNeverOverlap) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const auto bricks = mixed_boxes(seed, seed == 0 ? 1 : 20 + 30 * static_cast<int>(seed), 1, 24);
    for (const int limit : {2048, 128}) {
      expect_apart(packing::pack_nfdh(bricks, limit), bricks);
      expect_apart(packing::pack_best_fit(bricks, limit, 20'000'000), bricks);
    }
  }
}

TEST(KdTreePacking, MixedBricksFillMostOfThePool) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const auto bricks = mixed_boxes(seed, 200 + 50 * static_cast<int>(seed));
    const packing::Packing best = packing::pack_best_fit(bricks, 2048);
    const packing::Packing paper = packing::pack_nfdh(bricks, 2048);
    expect_apart(best, bricks);
    EXPECT_GE(packing::fill(best, bricks), 0.85);
    EXPECT_LT(packing::fill(paper, bricks), 0.75) << "the paper's own: 30 to 50 %";
    EXPECT_GT(packing::fill(paper, bricks), 0.3);
  }
}

TEST(KdTreePacking, ThousandsOfBricksArePackedInLayers) {
  const auto bricks = mixed_boxes(1, 3000, 4, 20);
  const packing::Packing best = packing::pack_best_fit(bricks, 2048);
  expect_apart(best, bricks);
  EXPECT_GE(packing::fill(best, bricks), 0.9);
}

TEST(KdTreePacking, EqualBricksLeaveAlmostNothing) {
  for (const int count : {1, 7, 64, 1000, 4173}) {
    const std::vector<Vec3i> bricks(static_cast<std::size_t>(count), Vec3i(18));
    EXPECT_GE(packing::fill(packing::pack_best_fit(bricks, 2048), bricks), 0.93) << count;
  }
}

TEST(KdTreePacking, WhatDoesNotFitHasNoPacking) {
  EXPECT_FALSE(packing::pack_nfdh(std::vector<Vec3i>(9, Vec3i(5)), 10).valid());
  EXPECT_FALSE(packing::pack_best_fit(std::vector<Vec3i>(9, Vec3i(5)), 10).valid());
  EXPECT_TRUE(packing::pack_best_fit(std::vector<Vec3i>(8, Vec3i(5)), 10).valid());
}

}  // namespace
}  // namespace amrtex
