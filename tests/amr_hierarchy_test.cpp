// The mesh: which cells are leaves, what values coarser cells take, what is refused and how it is said.
#include "structures/mesh/amr_hierarchy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <random>

#include "structures/generators/random_mesh.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr Box kRoot2{Vec3i(0), Vec3i(2)};

std::vector<int> leaf_mask(const AmrHierarchy& h, int level, int patch) {
  const auto mask = h.leaf_mask(level, patch);
  return {mask.begin(), mask.end()};
}

std::string refusal(const MeshDescription& mesh) {
  try {
    const AmrHierarchy h(mesh);
    return "accepted";
  } catch (const Error& e) {
    return e.what();
  }
}

// ---- leaves ----

TEST(Leaves, AreTheCellsThatNoFinerPatchCovers) {
  // 2 x 2 x 1 cells, the second refined
  const AmrHierarchy h = MeshBuilder({2, 2, 1}, {2}).root(constant(1)).patch(1, {{2, 0, 0}, {4, 2, 2}}, constant(2)).hierarchy();
  EXPECT_EQ(leaf_mask(h, 0, 0), (std::vector<int>{1, 0, 1, 1}));
  EXPECT_EQ(leaf_mask(h, 1, 0), std::vector<int>(8, 1));
  EXPECT_EQ(h.leaf_cells(0), 3);
  EXPECT_EQ(h.leaf_cells(1), 8);
  EXPECT_EQ(h.leaf_cells(), 11);
  EXPECT_EQ(h.stored_cells(0), 4);
  EXPECT_EQ(h.stored_cells(), 12);
  EXPECT_FALSE(h.has_holes());
}

TEST(Leaves, PatchesTwoLevelsFinerCoverToo) {
  const AmrHierarchy h = MeshBuilder({2, 1, 1}, {2, 3}).root(constant(1)).patch(2, {Vec3i(0), Vec3i(6)}, constant(2)).hierarchy();
  EXPECT_EQ(leaf_mask(h, 0, 0), (std::vector<int>{0, 1}));
  EXPECT_EQ(h.leaf_cells(1), 0);
  EXPECT_EQ(h.leaf_cells(2), 216);
  EXPECT_FALSE(h.has_holes());
  EXPECT_EQ(h.find_leaf({5, 5, 5})->level, 2);
  EXPECT_EQ(h.find_leaf({6, 5, 5})->level, 0);
  EXPECT_EQ(h.find_leaf({6, 5, 5})->cell, Vec3i(1, 0, 0));
}

TEST(Leaves, ACellMayBeRefinedByPatchesOfSeveralLevels) {
  // the cell's lower half by level 2, its upper half by two patches of level 3
  const AmrHierarchy h = MeshBuilder({1, 1, 1}, {2, 2, 2})
                             .root(constant(kPoison))
                             .patch(2, {{0, 0, 0}, {4, 4, 2}}, constant(1))
                             .patch(3, {{0, 0, 4}, {8, 4, 8}}, constant(3))
                             .patch(3, {{0, 4, 4}, {8, 8, 8}}, constant(5))
                             .hierarchy();
  EXPECT_EQ(leaf_mask(h, 0, 0), std::vector<int>{0});
  EXPECT_EQ(h.leaf_cells(), 32 + 128 + 128);
  EXPECT_FALSE(h.has_holes());
  // half of the volume holds 1, a quarter 3, a quarter 5
  EXPECT_DOUBLE_EQ(h.level_value(0, Vec3i(0), 0), 0.5 * 1 + 0.25 * 3 + 0.25 * 5);
}

TEST(Leaves, EveryFinestCellHasOneLeafOrLiesInAHole) {
  // volumes of leaves add up to the domain without the hole
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  std::int64_t held = 0;
  for_each_cell(h.domain(h.finest_level()), [&](const Vec3i& c) {
    const auto leaf = h.find_leaf(c);
    if (!leaf) return;
    ++held;
    const Patch& patch = h.patches(leaf->level)[static_cast<std::size_t>(leaf->patch)];
    EXPECT_EQ(leaf->cell, c / h.cell_width(leaf->level));
    EXPECT_EQ(h.leaf_mask(leaf->level, leaf->patch)[patch.box.offset(leaf->cell)], 1);
  });
  EXPECT_EQ(held, 8 * h.leaf_cells(0) + h.leaf_cells(1));
  EXPECT_TRUE(h.has_holes());
  EXPECT_FALSE(h.find_leaf({-1, 0, 0}));
  EXPECT_FALSE(h.find_leaf({0, 16, 0}));
}

/// A level of two clusters so many cells apart along x: side^3 patches of 2^3 cells with a gap of one between them.
AmrHierarchy two_clusters(int apart, int side) {
  MeshBuilder mesh({apart + 3 * side, 3 * side, 3 * side});
  for (const int lower : {0, apart})
    for_each_cell({Vec3i(0), Vec3i(side)}, [&](const Vec3i& i) {
      const Vec3i at = i * 3 + Vec3i(lower, 0, 0);
      mesh.patch(0, {at, at + Vec3i(2)}, std::vector<double>(8, i.x));
    });
  return mesh.hierarchy();
}

TEST(Leaves, AreFoundInClustersFarApart) {
  constexpr int kSide = 9, kApart = 1 << 30;
  const AmrHierarchy h = two_clusters(kApart, kSide);
  EXPECT_EQ(h.leaf_cells(), 2 * 8 * kSide * kSide * kSide);
  for (const int lower : {0, kApart})
    for_each_cell({Vec3i(0), Vec3i(3 * kSide)}, [&](const Vec3i& i) {
      const bool gap = i.x % 3 == 2 || i.y % 3 == 2 || i.z % 3 == 2;
      const auto leaf = h.find_leaf(i + Vec3i(lower, 0, 0));
      ASSERT_EQ(leaf.has_value(), !gap);
      if (leaf) {
        ASSERT_EQ(h.value(*leaf, 0), i.x / 3);
      }
    });
  EXPECT_FALSE(h.find_leaf({kApart / 2, 1, 1}));
  EXPECT_FALSE(h.find_leaf({kApart - 1, 0, 0}));
  EXPECT_EQ(std::ssize(h.patches_in(0, h.domain(0))), 2 * kSide * kSide * kSide);
  EXPECT_EQ(std::ssize(h.patches_in(0, {Vec3i(1), {kApart - 1, 3, 3 * kSide}})), kSide * kSide) << "a slice of the first";
  EXPECT_EQ(h.patches_in(0, {{kApart + 3, 6, 3}, {kApart + 4, 7, 4}}).size(), 1u);
}

TEST(Leaves, OfClustersFarApartTakeNoLongerThanOfNeighbours) {
  const auto seconds = [](int apart) {
    const auto begin = std::chrono::steady_clock::now();
    two_clusters(apart, 32);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const double near_by = std::max(seconds(96), seconds(96));
  EXPECT_LT(seconds(1 << 30), 10 * near_by) << "one list a cluster would make it some hundred times as long";
}

TEST(Leaves, RefinedWithinAsksForFinerPatchesInABox) {
  const AmrHierarchy h = jump_of_two(waves).hierarchy();  // level 2 over cells [1, 3) x [1, 2) x [1, 4) of level 0
  EXPECT_TRUE(h.refined_within(0, {{0, 0, 0}, {2, 2, 2}}));
  EXPECT_FALSE(h.refined_within(0, {{0, 0, 0}, {1, 4, 4}}));
  EXPECT_FALSE(h.refined_within(0, {{3, 0, 0}, {5, 4, 4}}));
  EXPECT_TRUE(h.refined_within(1, {{2, 2, 2}, {3, 3, 3}}));
  EXPECT_FALSE(h.refined_within(2, h.domain(2))) << "nothing is finer than the finest";
}

// ---- level values ----

TEST(LevelValue, OfALeafIsItsOwnAndAlsoThatOfTheCellsInside) {
  const AmrHierarchy h = MeshBuilder({2, 1, 1}, {2, 2}).patch(0, {Vec3i(0), {2, 1, 1}}, std::vector<double>{3, 4}).hierarchy();
  EXPECT_EQ(h.level_value(0, {1, 0, 0}, 0), 4);
  EXPECT_EQ(h.level_value(1, {1, 1, 0}, 0), 3);
  EXPECT_EQ(h.level_value(2, {4, 3, 3}, 0), 4);
  EXPECT_TRUE(std::isnan(h.level_value(2, {8, 0, 0}, 0))) << "outside the domain";
  EXPECT_TRUE(std::isnan(h.level_value(0, {-1, 0, 0}, 0)));
}

TEST(LevelValue, OfARefinedCellIsTheVolumeWeightedMeanOfItsLeaves) {
  // 7 children hold 1; the last is refined into 8 cells that hold 9: (7 * 1 + 1 * 9) / 8
  MeshBuilder mesh(Vec3i(1), {2, 2});
  mesh.root(constant(kPoison))
      .patch(1, kRoot2, std::vector<double>{1, 1, 1, 1, 1, 1, 1, kPoison})
      .patch(2, {Vec3i(2), Vec3i(4)}, constant(9));
  const AmrHierarchy h = mesh.hierarchy();
  EXPECT_DOUBLE_EQ(h.level_value(0, Vec3i(0), 0), 2);
  EXPECT_DOUBLE_EQ(h.level_value(1, Vec3i(1), 0), 9);
  EXPECT_DOUBLE_EQ(h.value(*h.find_leaf({3, 3, 3}), 0), 9);
}

TEST(LevelValue, LeavesMissingValuesOutByVolume) {
  // 64 children: one without a value, one refined into 8 cells of 50, the others 1
  for (const double missing : {kNan, kInf, -kInf}) {
    MeshBuilder mesh(Vec3i(1), {4, 2});
    mesh.patch(1, {Vec3i(0), Vec3i(4)}, [&](const Vec3d& p) { return p.x < 0.25 && p.y < 0.25 && p.z < 0.25 ? missing : 1.0; });
    mesh.patch(2, {Vec3i(6), Vec3i(8)}, constant(50));
    const AmrHierarchy h = mesh.hierarchy();
    EXPECT_DOUBLE_EQ(h.level_value(0, Vec3i(0), 0), (62 * 1 + 1 * 50) / 63.0);
    EXPECT_EQ(h.statistics(0).cells_without_value, 1);
  }
}

TEST(LevelValue, OfACellThatIsPartHoleIsTheMeanOfWhatExists) {
  // one patch of level 2 in an otherwise empty domain
  MeshBuilder mesh({2, 1, 1}, {2, 2});
  mesh.patch(2, {{0, 0, 0}, {2, 2, 2}}, constant(7));
  const AmrHierarchy h = mesh.hierarchy();
  EXPECT_TRUE(h.has_holes());
  EXPECT_EQ(h.level_value(1, {0, 0, 0}, 0), 7);
  EXPECT_EQ(h.level_value(0, {0, 0, 0}, 0), 7) << "an eighth of the cell exists, with value 7";
  EXPECT_TRUE(std::isnan(h.level_value(0, {1, 0, 0}, 0)));
  EXPECT_TRUE(std::isnan(h.level_value(1, {1, 0, 0}, 0)));
}

TEST(LevelValue, OfACellWithoutAnyValueIsNone) {
  const AmrHierarchy h = MeshBuilder({2, 1, 1}, {2}).root(constant(5)).patch(1, kRoot2, constant(kNan)).hierarchy();
  EXPECT_TRUE(std::isnan(h.level_value(0, {0, 0, 0}, 0)));
  EXPECT_EQ(h.level_value(0, {1, 0, 0}, 0), 5);
}

TEST(LevelValue, OfLevelsBetweenAJumpOfTwo) {
  // level 1 is empty: inside the fine patch its cells are means of 8, elsewhere the coarse leaf's value
  const AmrHierarchy h = jump_of_two([](const Vec3d& p) { return p.x; }).hierarchy();
  double sum = 0;
  for_each_cell(Box{{4, 4, 4}, {6, 6, 6}}, [&](const Vec3i& c) { sum += h.value(*h.find_leaf(c), 0); });
  EXPECT_NEAR(h.level_value(1, {2, 2, 2}, 0), sum / 8, 1e-15);
  EXPECT_EQ(h.level_value(1, {0, 3, 3}, 0), h.level_value(0, {0, 1, 1}, 0));
}

TEST(LevelValue, BoxesHoldWhatSingleCellsHold) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    for (int level = 0; level < h.level_count(); ++level) {
      const Box all = h.domain(level).grown(2);
      const Box box = intersection(all, {all.lower, all.lower + Vec3i(13)});
      std::vector<double> values(static_cast<std::size_t>(box.cells()));
      level_values(h, 0, level, box, values);
      for_each_cell(box, [&](const Vec3i& c) {
        const double one = h.level_value(level, c, 0);
        const double many = values[box.offset(c)];
        ASSERT_TRUE(std::isnan(one) ? std::isnan(many) : one == many) << "level " << level;
      });
    }
  }
}

// ---- fills ----

double filled(const AmrHierarchy& h, const Vec3i& cell) {
  std::vector<double> v(1);
  std::vector<std::uint8_t> missing(1);
  filled_level_values(h, 0, 0, {cell, cell + Vec3i(1)}, v, missing);
  EXPECT_EQ(missing[0] != 0, std::isnan(h.level_value(0, cell, 0)));
  return v[0];
}

TEST(Fill, IsTheMeanOfFaceElseEdgeElseCornerNeighbours) {
  // value 100 z + 10 y + x at cell (x, y, z); only these cells exist
  const auto only = [](const std::vector<Vec3i>& cells) {
    MeshBuilder mesh(Vec3i(3));
    for (const Vec3i& c : cells) mesh.patch(0, {c, c + Vec3i(1)}, constant(100.0 * c.z + 10 * c.y + c.x));
    return mesh.hierarchy();
  };
  const std::vector<Vec3i> corners{{0, 0, 0}, {2, 2, 0}};
  EXPECT_DOUBLE_EQ(filled(only(corners), Vec3i(1)), (0 + 22) / 2.0);
  EXPECT_DOUBLE_EQ(filled(only({corners[0], corners[1], {1, 2, 2}, {0, 1, 0}}), Vec3i(1)), (221 + 10) / 2.0)
      << "edges before corners";
  EXPECT_DOUBLE_EQ(filled(only({corners[0], {1, 2, 2}, {1, 1, 2}, {0, 1, 1}, {1, 0, 1}}), Vec3i(1)), (211 + 110 + 101) / 3.0)
      << "faces before edges and corners";
  EXPECT_EQ(filled(only({{1, 1, 1}, {0, 1, 1}}), Vec3i(1)), 111) << "its own value before any other";
}

TEST(Fill, ClampsAtTheDomainsBoundaryAndEndsOneCellOut) {
  const AmrHierarchy h = MeshBuilder(Vec3i(2)).patch(0, kRoot2, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8}).hierarchy();
  EXPECT_EQ(filled(h, {2, 0, 1}), 6) << "face";
  EXPECT_EQ(filled(h, {2, 2, 0}), 4) << "edge";
  EXPECT_EQ(filled(h, {-1, 2, 2}), 7) << "corner";
  EXPECT_TRUE(std::isnan(filled(h, {3, 0, 0})));
  EXPECT_TRUE(std::isnan(filled(h, {-2, -1, 0}))) << "fills never use other fills";
}

TEST(Fill, OfACellDependsOnThatCellAlone) {
  // the same whatever box it is asked in
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const Box all = h.domain(1).grown(2);
  std::vector<double> whole(static_cast<std::size_t>(all.cells()));
  filled_level_values(h, 0, 1, all, whole);
  for (const Box& box : {Box{{4, 4, 4}, {9, 8, 7}}, Box{{5, 7, 7}, {13, 9, 9}}, Box{{-2, -2, -2}, {3, 1, 2}}}) {
    std::vector<double> part(static_cast<std::size_t>(box.cells()));
    filled_level_values(h, 0, 1, box, part);
    for_each_cell(box, [&](const Vec3i& c) {
      const double a = whole[all.offset(c)];
      const double b = part[box.offset(c)];
      EXPECT_TRUE(std::isnan(a) ? std::isnan(b) : a == b);
    });
  }
}

// ---- vertices ----

TEST(VertexValue, HangingVerticesLieOnTheCoarseFace) {
  // two cells of 0 and 8, the first refined: on the face between them every vertex has 4
  const AmrHierarchy h = MeshBuilder({2, 1, 1}, {2})
                             .patch(0, {Vec3i(0), {2, 1, 1}}, std::vector<double>{kPoison, 8})
                             .patch(1, kRoot2, constant(0))
                             .hierarchy();
  const Box vertices{{0, 0, 0}, {3, 3, 3}};
  std::vector<double> v(27);
  vertex_values(h, 0, 1, vertices, v);
  for_each_cell(vertices, [&](const Vec3i& i) { EXPECT_DOUBLE_EQ(v[vertices.offset(i)], i.x == 2 ? 4 : 0); });
}

// ---- the content hash ----

TEST(ContentHash, DoesNotDependOnPatchesOrTheirOrder) {
  const auto parts = [](const std::vector<Box>& boxes) {
    MeshBuilder mesh({4, 4, 2}, {2});
    for (const Box& b : boxes) mesh.patch(0, b, waves);
    return mesh.patch(1, {{2, 2, 0}, {6, 4, 2}}, waves).hierarchy().content_hash(0);
  };
  const std::string whole = parts({{{0, 0, 0}, {4, 4, 2}}});
  EXPECT_EQ(whole.size(), 32u);
  EXPECT_EQ(parts({{{0, 0, 0}, {2, 4, 2}}, {{2, 0, 0}, {4, 4, 2}}}), whole);
  EXPECT_EQ(parts({{{2, 0, 0}, {4, 4, 2}}, {{0, 0, 0}, {2, 4, 2}}}), whole);
  EXPECT_EQ(parts({{{0, 2, 0}, {4, 4, 2}}, {{0, 0, 1}, {4, 2, 2}}, {{0, 0, 0}, {4, 2, 1}}}), whole);
  EXPECT_NE(parts({{{0, 0, 0}, {4, 3, 2}}}), whole) << "a hole";
}

TEST(ContentHash, SeesLeavesAlone) {
  const auto hash = [](double under, double leaf, int levels = 2) {
    MeshBuilder mesh({2, 1, 1}, std::vector<int>(static_cast<std::size_t>(levels - 1), 2));
    mesh.patch(0, {Vec3i(0), {2, 1, 1}}, std::vector<double>{under, leaf});
    return mesh.patch(1, kRoot2, constant(3)).hierarchy().content_hash(0);
  };
  EXPECT_EQ(hash(1, 2), hash(kNan, 2)) << "what is stored under finer patches";
  EXPECT_NE(hash(1, 2), hash(1, 2.001));
  EXPECT_EQ(hash(1, 2), hash(1, 2, 3)) << "levels without cells";
  EXPECT_EQ(hash(1, 0.0), hash(1, -0.0));
  EXPECT_EQ(hash(1, kNan), hash(1, kInf)) << "cells without a value";
  EXPECT_NE(hash(1, kNan), hash(1, 0));
}

TEST(ContentHash, OfShuffledRandomMeshesIsTheSame) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    MeshDescription mesh = random_mesh(seed);
    const std::string before = AmrHierarchy(mesh).content_hash(0);
    std::mt19937_64 random(seed);
    for (auto& level : mesh.levels) std::shuffle(level.begin(), level.end(), random);
    EXPECT_EQ(AmrHierarchy(mesh).content_hash(0), before) << "seed " << seed;
  }
}

// ---- statistics ----

TEST(Statistics, LeaveMissingValuesOutAndCountThem) {
  // cells of volume 1/2: 3 and NaN; the integral is 3 / 2
  const AmrHierarchy h = MeshBuilder({2, 1, 1}).patch(0, {Vec3i(0), {2, 1, 1}}, std::vector<double>{3, kNan}).hierarchy();
  const FieldStatistics& s = h.statistics(0);
  EXPECT_EQ(s.min, 3);
  EXPECT_EQ(s.max, 3);
  EXPECT_EQ(s.cells_without_value, 1);
  EXPECT_DOUBLE_EQ(s.volume_integral, 1.5);
  EXPECT_TRUE(h.has_missing(0));
  EXPECT_FALSE(h.has_holes());
}

TEST(Statistics, IntegralsWeighEachLeafByItsVolume) {
  // [0, 2] x [0, 3] x [0, 4]: 24, half of it refined; the integral of x is exact for cell means: 2^2 / 2 * 3 * 4
  MeshBuilder mesh({2, 3, 1}, {4}, Vec3d(0), {2, 3, 4});
  const auto x = [](const Vec3d& p) { return p.x; };
  const AmrHierarchy h = mesh.root(x).patch(1, {{0, 0, 0}, {4, 12, 4}}, x).hierarchy();
  EXPECT_NEAR(h.statistics(0).volume_integral, 24, 1e-13);
  EXPECT_EQ(h.statistics(0).min, 0.125) << "not 0.5: that cell is refined";
  EXPECT_EQ(h.statistics(0).max, 1.5);
}

TEST(Statistics, OfAFieldWithoutAnyValueAreNone) {
  const AmrHierarchy h = MeshBuilder(Vec3i(2)).root(constant(kNan)).hierarchy();
  EXPECT_TRUE(std::isnan(h.statistics(0).min));
  EXPECT_EQ(h.statistics(0).cells_without_value, 8);
  EXPECT_EQ(h.statistics(0).volume_integral, 0);
}

TEST(Fields, UnknownNamesAreAnsweredWithTheKnownOnes) {
  const AmrHierarchy h = MeshBuilder(Vec3i(2)).root(constant(1)).hierarchy();
  EXPECT_EQ(h.field_index("f"), 0);
  try {
    h.field_index("density");
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("hand-made"), HasSubstr("'density'"), HasSubstr("f")));
  }
}

// ---- what is refused ----

TEST(Refused, OverlappingPatchesAreNamed) {
  const auto mesh = MeshBuilder(Vec3i(4)).patch(0, kRoot2, constant(1)).patch(0, {Vec3i(1), Vec3i(3)}, constant(1));
  EXPECT_THAT(refusal(mesh.description()),
              AllOf(HasSubstr("hand-made"), HasSubstr("level 0"), HasSubstr("patches 0 [(0, 0, 0), (2, 2, 2))"),
                    HasSubstr("and 1 [(1, 1, 1), (3, 3, 3)) overlap")));
}

TEST(Refused, PatchesOutsideTheirLevel) {
  const auto above = MeshBuilder(Vec3i(4)).patch(0, {Vec3i(3), Vec3i(5)}, constant(1));
  EXPECT_THAT(refusal(above.description()),
              AllOf(HasSubstr("level 0, patch 0"), HasSubstr("lies outside its level"), HasSubstr("(4, 4, 4)")));
  const auto below = MeshBuilder(Vec3i(4)).patch(0, {{-1, 0, 0}, {1, 1, 1}}, constant(1));
  EXPECT_THAT(refusal(below.description()), HasSubstr("lies outside its level"));
  const auto empty = MeshBuilder(Vec3i(4)).patch(0, {Vec3i(1), Vec3i(1)}, constant(1));
  EXPECT_THAT(refusal(empty.description()), HasSubstr("is empty"));
}

TEST(Refused, BoxesThatCutCoarserCells) {
  const auto mesh = MeshBuilder(Vec3i(4), {2}).root(constant(1)).patch(1, {{1, 0, 0}, {4, 2, 2}}, constant(1));
  EXPECT_THAT(refusal(mesh.description()),
              AllOf(HasSubstr("level 1, patch 0"), HasSubstr("does not align with the cells of level 0"), HasSubstr("ratio 2")));
}

TEST(Leaves, HolesMayBeSingleCellsWhereNoCoarserCellIsStored) {
  // of the cell (1, 0, 0) of level 0, which no patch stores, three children exist
  const AmrHierarchy h = MeshBuilder({3, 2, 2}, {2})
                             .patch(0, {{0, 0, 0}, {1, 2, 2}}, constant(1))
                             .patch(1, {{2, 0, 0}, {4, 1, 1}}, constant(2))
                             .patch(1, {{3, 1, 0}, {4, 2, 1}}, constant(8))
                             .hierarchy();
  EXPECT_EQ(h.leaf_cells(), 7);
  EXPECT_TRUE(h.has_holes());
  EXPECT_FALSE(h.find_leaf({2, 1, 0}).has_value());
  EXPECT_EQ(h.level_value(0, {1, 0, 0}, 0), 4) << "the mean of those that exist";
  EXPECT_DOUBLE_EQ(h.statistics(0).volume_integral, (4 * 8 * 1 + 2 * 2 + 8) / 96.0);
}

TEST(Refused, BoxesThatCutACoarserCellThatHasAPatch) {
  const auto mesh = [](int begin) {
    return MeshBuilder({4, 2, 2}, {2})
        .patch(0, {{0, 0, 0}, {2, 2, 2}}, constant(1))
        .patch(1, {{begin, 0, 0}, {8, 4, 4}}, constant(2));
  };
  EXPECT_EQ(refusal(mesh(5).description()), "accepted");
  EXPECT_THAT(refusal(mesh(3).description()), HasSubstr("does not align with the cells of level 0"));
}

TEST(Refused, CellsRefinedOnlyInPart) {
  // aligned with level 1, but only half of a cell of level 0 that is stored
  const auto mesh = MeshBuilder(Vec3i(4), {2, 2}).root(constant(1)).patch(2, {{0, 0, 0}, {2, 4, 4}}, constant(1));
  EXPECT_THAT(
      refusal(mesh.description()),
      AllOf(HasSubstr("level 0, patch 0"), HasSubstr("cell (0, 0, 0) is refined only in part"), HasSubstr("level 2, patch 0")));
}

TEST(Refused, RatiosBelowTwoAndWrongInNumber) {
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), {1}).root(constant(1)).description()),
              AllOf(HasSubstr("from level 0 to 1 is 1"), HasSubstr("at least 2")));
  MeshDescription mesh = MeshBuilder(Vec3i(4), {2}).root(constant(1)).description();
  mesh.ratios.clear();
  EXPECT_THAT(refusal(mesh), HasSubstr("2 levels need 1 refinement ratios, 0 given"));
}

TEST(Refused, MoreThanThirtyOneBitsOfIndex) {
  // 4 * 8^9 = 2^29 fits, 4 * 8^10 = 2^32 does not
  EXPECT_EQ(refusal(MeshBuilder(Vec3i(4), std::vector<int>(9, 8)).root(constant(1)).description()), "accepted");
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), std::vector<int>(10, 8)).root(constant(1)).description()),
              AllOf(HasSubstr("level 10 has 4294967296 cells along an axis"), HasSubstr("2147479551"), HasSubstr("31 bits")));
}

TEST(Refused, MeshesWithoutACell) {
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), {2}).description()), HasSubstr("no cell"));
  EXPECT_THAT(refusal(MeshBuilder({4, 0, 4}).description()), HasSubstr("(4, 0, 4)"));
}

TEST(Refused, DomainsWithoutVolume) {
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), {}, Vec3d(0), {1, 0, 1}).root(constant(1)).description()), HasSubstr("axis y"));
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), {}, Vec3d(0), {1, kNan, 1}).root(constant(1)).description()), HasSubstr("axis y"));
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(4), {}, Vec3d(0), {1, 1, kInf}).root(constant(1)).description()), HasSubstr("axis z"));
}

TEST(Refused, ArraysOfTheWrongLength) {
  EXPECT_THAT(refusal(MeshBuilder(Vec3i(2)).patch(0, kRoot2, std::vector<double>(7)).description()),
              HasSubstr("7 values for 8 cells"));
  MeshDescription mesh = MeshBuilder(Vec3i(2)).root(constant(1)).description();
  mesh.fields.push_back("g");
  EXPECT_THAT(refusal(mesh), HasSubstr("1 arrays for 2 fields"));
}

}  // namespace
}  // namespace amrtex
