// Facts of `kd_tree` alone; what every encoding must do is in tests/.
#include "structures/kd_tree/kd_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <chrono>
#include <cmath>

#include "renderers/consumers/raycaster.hpp"
#include "structures/common/brick_packing.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/texture_handles.hpp"
#include "structures/generators/random_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/kd_tree/kd_detail.hpp"
#include "structures/kd_tree/kd_hats.hpp"
#include "structures/kd_tree/kd_partition.hpp"
#include "structures/kd_tree/start_grid.hpp"
#include "tests/encoding_cases.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

EncodedField kd_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                      const BuildOptions& options = {}) {
  return build(h, {&find_encoding("kd_tree"), filter, parameters}, options);
}

std::span<const Filter> kd_filters() { return find_encoding("kd_tree").filters(); }

/// 16^3 root cells, of which 4^3 in the corner are refined.
AmrHierarchy refined_corner() {
  return MeshBuilder(Vec3i(16), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).hierarchy();
}

/// Two subgrids of level 0 and one of level 1 over both.
AmrHierarchy not_nested() {
  return MeshBuilder({16, 8, 8}, {2})
      .patch(0, {{0, 0, 0}, {8, 8, 8}}, waves)
      .patch(0, {{8, 0, 0}, {16, 8, 8}}, waves)
      .patch(1, {{12, 4, 4}, {20, 12, 12}}, waves)
      .hierarchy();
}

// ---- bits

TEST(KdTree, LayoutFillsTwoWordsWithoutOverlap) {
  static_assert(AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS + 2 == 32);
  static_assert(AMRTEX_KD_DATA_BITS + AMRTEX_KD_SPLIT_BITS == 32);
  static_assert(AMRTEX_KD_NO_DATA == (1 << AMRTEX_KD_DATA_BITS) - 1);
  kd::Node n;
  n.first_child = 0xabcdef;
  n.axis = 2;
  n.level = 63;
  n.split = 4095;
  n.leaf = 0x54321;
  EXPECT_EQ(kd::first_word(n), 0xbfabcdefU);
  EXPECT_EQ(kd::second_word(n), 0xfff54321U);
  n.leaf = -1;
  n.split = 1;
  EXPECT_EQ(kd::second_word(n), 0x001fffffU);
}

/// Decoded with the layout's numbers.
kd::Node node_at(const EncodedField& field, std::size_t i) {
  const auto* words = field.find("kd_nodes")->as<std::uint32_t>() + 2 * i;
  kd::Node n;
  n.first_child = words[0] & ((1U << AMRTEX_KD_CHILD_BITS) - 1);
  n.level = static_cast<int>((words[0] >> AMRTEX_KD_CHILD_BITS) & ((1U << AMRTEX_KD_LEVEL_BITS) - 1));
  n.axis = static_cast<int>(words[0] >> (AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS));
  n.split = static_cast<int>(words[1] >> AMRTEX_KD_DATA_BITS);
  const std::uint32_t data = words[1] & AMRTEX_KD_NO_DATA;
  n.leaf = data == AMRTEX_KD_NO_DATA ? -1 : static_cast<int>(data);
  return n;
}

TEST(KdTree, NodesHoldWhatTheLayoutSays) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const kd::Tree tree = kd::build_tree(h);
    const EncodedField field = kd_field(h, Filter::nearest, {{"wrap", false}});
    ASSERT_EQ(field.find("kd_nodes")->texels(), static_cast<std::int64_t>(tree.nodes.size()));
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
      const kd::Node& n = tree.nodes[i];
      const kd::Node read = node_at(field, i);
      EXPECT_EQ(std::tie(read.first_child, read.level, read.axis, read.split, read.leaf),
                std::tie(n.first_child, n.level, n.axis, n.split, n.leaf));
    }
  }
}

// ---- the tree

struct Counts {
  std::size_t nodes, leaves;
  std::int64_t fully_refined, mixed, empty, cut_subgrids;
  int depth;
  bool operator==(const Counts&) const = default;
};
std::ostream& operator<<(std::ostream& out, const Counts& c) {
  return out << c.nodes << " nodes, " << c.leaves << " leaves, " << c.fully_refined << " fully refined, " << c.mixed << " mixed, "
             << c.empty << " empty, " << c.cut_subgrids << " cut, depth " << c.depth;
}
Counts counts(const AmrHierarchy& h) {
  const kd::Tree t = kd::build_tree(h);
  return {t.nodes.size(), t.leaves.size(), t.fully_refined, t.mixed, t.empty, t.cut_subgrids, t.depth};
}

TEST(KdTree, TreesOfHandMadeMeshes) {
  EXPECT_EQ(counts(MeshBuilder(Vec3i(1)).root(waves).hierarchy()), (Counts{1, 1, 0, 0, 0, 0, 0})) << "one cell";
  EXPECT_EQ(counts(single_level(waves).hierarchy()), (Counts{1, 1, 0, 0, 0, 0, 0})) << "one subgrid";
  // a box in a corner takes a plane an axis
  EXPECT_EQ(counts(refined_corner()), (Counts{7, 4, 0, 3, 0, 0, 3}));
  // one plane between the parents, which cuts the fine subgrid; then five planes on each side
  EXPECT_EQ(counts(not_nested()), (Counts{23, 12, 0, 11, 0, 1, 6}));
  // a subgrid that two others cover
  const AmrHierarchy covered = MeshBuilder({4, 2, 2}, {2})
                                   .root(waves)
                                   .patch(1, {{0, 0, 0}, {4, 4, 4}}, waves)
                                   .patch(1, {{4, 0, 0}, {8, 4, 4}}, waves)
                                   .hierarchy();
  EXPECT_EQ(counts(covered), (Counts{3, 2, 1, 0, 0, 0, 1}));
  // one half of the domain is a hole
  const AmrHierarchy hole = MeshBuilder(Vec3i(16)).patch(0, {{8, 0, 0}, {16, 16, 16}}, waves).hierarchy();
  EXPECT_EQ(counts(hole), (Counts{3, 1, 0, 1, 1, 0, 1}));
  // five faces of the fine box lie inside the domain, the sixth on its face
  EXPECT_EQ(counts(jump_of_two(waves).hierarchy()), (Counts{11, 6, 0, 5, 0, 0, 5}));
}

TEST(KdTree, CutsWhereNothingElseIsPossible) {
  // a pinwheel of four boxes around a middle: every plane cuts one at least
  const AmrHierarchy h = MeshBuilder({3, 3, 1})
                             .patch(0, {{0, 0, 0}, {2, 1, 1}}, waves)
                             .patch(0, {{2, 0, 0}, {3, 2, 1}}, waves)
                             .patch(0, {{1, 2, 0}, {3, 3, 1}}, waves)
                             .patch(0, {{0, 1, 0}, {1, 3, 1}}, waves)
                             .patch(0, {{1, 1, 0}, {2, 2, 1}}, waves)
                             .hierarchy();
  const Counts c = counts(h);
  EXPECT_EQ(c.cut_subgrids, 1);
  EXPECT_EQ(c.leaves, 6u);
}

TEST(KdTree, TheMostEvenOfThePlanesThatCutNothing) {
  // four slabs of 2, 2, 2 and 10 cells along x: 6 against 10 is the most even
  MeshBuilder mesh({16, 4, 4});
  for (const auto& [lower, upper] : {std::pair(0, 2), std::pair(2, 4), std::pair(4, 6), std::pair(6, 16)})
    mesh.patch(0, {{lower, 0, 0}, {upper, 4, 4}}, waves);
  const kd::Tree tree = kd::build_tree(mesh.hierarchy());
  EXPECT_EQ(tree.nodes[0].axis, 0);
  EXPECT_EQ(tree.nodes[0].split, 6);
  EXPECT_EQ(tree.nodes.size(), 7u);
}

TEST(KdTree, CellsOfALeafStayWholeBesideFacesInsideOfRefinedCells) {
  // two subgrids of level 2 share root cell 0; a plane between them would divide nothing but is no face of root cells
  const AmrHierarchy h = MeshBuilder({2, 1, 1}, {2, 2})
                             .root(waves)
                             .patch(2, {{0, 0, 0}, {2, 4, 4}}, waves)
                             .patch(2, {{2, 0, 0}, {4, 4, 4}}, waves)
                             .hierarchy();
  const kd::Tree tree = kd::build_tree(h);
  EXPECT_EQ(counts(h), (Counts{5, 3, 1, 1, 0, 0, 2}));
  EXPECT_EQ(tree.nodes[0].level, 0);
  EXPECT_EQ(tree.nodes[0].split, 1);
  const kd::Node& covered = tree.nodes[tree.nodes[0].first_child];
  EXPECT_EQ(covered.level, 1) << "the plane is a face of cells of level 1";
  EXPECT_EQ(covered.split, 1);
}

TEST(KdTree, EveryLeafCellOfRandomMeshesLiesInOneDrawnNodeOfItsLevel) {
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    const kd::Tree tree = kd::build_tree(h);
    const std::vector<Box> boxes = kd::node_boxes(h, tree);
    std::int64_t cells = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
      const kd::Node& n = tree.nodes[i];
      const int w = h.cell_width(n.level);
      EXPECT_FALSE(boxes[i].empty());
      for (int a = 0; a < 3; ++a) EXPECT_EQ(boxes[i].lower[a] % w, 0) << "node " << i;
      if (n.leaf < 0) continue;
      const kd::Leaf& leaf = tree.leaves[static_cast<std::size_t>(n.leaf)];
      EXPECT_EQ(leaf.cells.refined(w), boxes[i]);
      const Box& patch = h.patches(leaf.level)[static_cast<std::size_t>(leaf.patch)].box;
      ASSERT_TRUE(patch.contains(leaf.cells));
      const auto mask = h.leaf_mask(leaf.level, leaf.patch);
      for_each_cell(leaf.cells, [&](const Vec3i& c) { cells += mask[patch.offset(c)]; });
    }
    // nodes divide the domain by construction, so equal counts mean every leaf cell once
    EXPECT_EQ(cells, h.leaf_cells());
    std::int64_t in_leaves = 0;
    for (const kd::Leaf& leaf : tree.leaves) in_leaves += leaf.cells.cells();
    EXPECT_EQ(in_leaves, h.leaf_cells());
  }
}

/// Every other block of a checkerboard is refined: blocks^3 / 2 subgrids of 4^3 cells, none beside another.
AmrHierarchy checkerboard(int blocks) {
  MeshBuilder mesh(Vec3i(2 * blocks), {2});
  mesh.root(constant(1));
  for_each_cell({Vec3i(0), Vec3i(blocks)}, [&](const Vec3i& b) {
    if ((b.x + b.y + b.z) % 2 == 0) mesh.patch(1, {b * 4, (b + 1) * 4}, constant(2));
  });
  return mesh.hierarchy();
}

TEST(KdTree, ThePartitionDoesNotDependOnThreads) {
  const AmrHierarchy h = checkerboard(20);
  const auto nodes = [&](std::size_t threads, bool covers) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    kd::Tree tree = kd::build_tree(h, {.wrap = false, .covers = covers, .limits = {}});
    if (covers) kd::add_detail_blocks(h, tree);
    std::vector<std::uint32_t> words;
    for (const kd::Node& n : tree.nodes) words.insert(words.end(), {kd::first_word(n), kd::second_word(n)});
    for (const kd::Leaf& l : tree.leaves) words.insert(words.end(), {kd::detail_word(l), static_cast<std::uint32_t>(l.patch)});
    return words;
  };
  for (const bool covers : {false, true}) EXPECT_EQ(nodes(1, covers), nodes(4, covers));
}

TEST(KdTree, TenThousandSubgridsTakeSeconds) {
  const AmrHierarchy h = checkerboard(28);
  ASSERT_EQ(h.patches(1).size(), 10976U);
  const auto start = std::chrono::steady_clock::now();
  const kd::Tree tree = kd::build_tree(h);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_LT(seconds.count(), 5);
  EXPECT_LE(tree.depth, 64);
  RecordProperty("milliseconds", static_cast<int>(1000 * seconds.count()));
}

// ---- wrapping

/// Leaf blocks, after a check that they hold each leaf cell of the mesh once.
std::size_t leaves_of(const AmrHierarchy& h, bool wrap) {
  const kd::Tree tree = kd::build_tree(h, {.wrap = wrap, .covers = false, .limits = {}});
  std::int64_t cells = 0;
  for (const kd::Leaf& leaf : tree.leaves) {
    const Box& patch = h.patches(leaf.level)[static_cast<std::size_t>(leaf.patch)].box;
    EXPECT_TRUE(patch.contains(leaf.cells));
    const auto mask = h.leaf_mask(leaf.level, leaf.patch);
    for_each_cell(leaf.cells, [&](const Vec3i& c) {
      EXPECT_EQ(mask[patch.offset(c)], 1);
      ++cells;
    });
  }
  EXPECT_EQ(cells, h.leaf_cells());  // nodes divide the domain: each once
  return tree.leaves.size();
}

TEST(KdTree, WrappingSavesLeavesWhereSubgridsLieTogether) {
  // after figure 9 of Kaehler & Hege 2002: a row of subgrids in the middle of a large region. The planes between them cut the
  // region around into as many parts; its six sides first leave the subgrids' own box alone.
  MeshBuilder mesh({24, 12, 12}, {2});
  mesh.root(waves);
  for (int i = 0; i < 5; ++i) mesh.patch(1, {{8 + 6 * i, 8, 8}, {14 + 6 * i, 16, 16}}, waves);
  const AmrHierarchy h = mesh.hierarchy();
  EXPECT_EQ(leaves_of(h, true), 6U + 5U);
  EXPECT_GT(leaves_of(h, false), 11U);
  EXPECT_EQ(kd_field(h, Filter::nearest, {{"wrap", true}}).statistics["leaves"], 11);
}

TEST(KdTree, WrappedLeavesStillPartitionRandomMeshesAndAreFewer) {
  std::size_t wrapped = 0;
  std::size_t plain = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    wrapped += leaves_of(h, true);
    plain += leaves_of(h, false);
  }
  EXPECT_LE(wrapped, plain) << "in all; a single mesh may have more";
}

// ---- level of detail

TEST(KdTree, DetailBlocksAreTheRefinedCellsOfEachSubgridOnce) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    kd::Tree tree = kd::build_tree(h, {.wrap = false, .covers = true, .limits = {}});
    kd::add_detail_blocks(h, tree);
    const std::vector<Box> boxes = kd::node_boxes(h, tree);
    std::int64_t cells = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
      if (tree.nodes[i].leaf < 0) continue;
      for (auto k = static_cast<std::size_t>(tree.nodes[i].leaf);; ++k) {
        const kd::Leaf& block = tree.leaves[k];
        const Box& patch = h.patches(block.level)[static_cast<std::size_t>(block.patch)].box;
        EXPECT_EQ(block.cells.refined(h.cell_width(block.level)), boxes[i]) << "whole cells";
        EXPECT_TRUE(patch.contains(block.cells));
        EXPECT_GT(block.next, block.level);
        const auto mask = h.leaf_mask(block.level, block.patch);
        const bool leaf = block.next == kd::kNothingFiner;
        for_each_cell(block.cells, [&](const Vec3i& c) { EXPECT_EQ(mask[patch.offset(c)] != 0, leaf); });
        if (!block.repeated) cells += block.cells.cells();
        EXPECT_EQ(leaf, block.last && tree.nodes[i].first_child == 0);
        if (block.last) break;
      }
    }
    // a cell that several subgrids of a much finer level share is drawn at no node where their face divides it
    EXPECT_LE(cells, h.stored_cells());
    EXPECT_GE(cells, h.leaf_cells());
    const kd::StartGrid grid = kd::make_start_grid(h, tree, 1000);
    for (const std::uint32_t node : grid.nodes) {  // no start below a node that may be drawn
      for (std::size_t i = 0; i < tree.nodes.size(); ++i)
        EXPECT_FALSE(i != node && tree.nodes[i].leaf >= 0 && tree.nodes[i].first_child != 0 && boxes[i].contains(boxes[node]) &&
                     boxes[i] != boxes[node]);
    }
  }
}

TEST(KdTree, DetailOfAHandMadeMesh) {
  // the whole root is refined by two subgrids: one block of the root's 4 x 2 x 2 cells, two leaves
  const AmrHierarchy covered = MeshBuilder({4, 2, 2}, {2})
                                   .root(waves)
                                   .patch(1, {{0, 0, 0}, {4, 4, 4}}, waves)
                                   .patch(1, {{4, 0, 0}, {8, 4, 4}}, waves)
                                   .hierarchy();
  const EncodedField field = kd_field(covered, Filter::nearest, Json::object(), {.level_of_detail = true});
  EXPECT_EQ(field.statistics["detail_blocks"], 1);
  EXPECT_EQ(field.statistics["leaves"], 2);
  EXPECT_EQ(field.statistics["leaves_a_brick"], 1.0) << "the root's brick holds no leaf";
  EXPECT_EQ(field.statistics["bricks"], 3);
  EXPECT_EQ(field.find("tex_kd_pool")->roles.payload, 4 * 2 * 64);
  EXPECT_EQ(field.find("tex_kd_pool")->roles.duplicated, 4 * 16);
  const auto* words = field.find("kd_detail")->as<std::uint32_t>();
  EXPECT_EQ(words[0], 0U | (1U << 6) | (1U << 13)) << "level 0, refined by 1, alone in its node";
  EXPECT_EQ(words[1], 1U | (64U << 6) | (1U << 13)) << "level 1, refined by nothing";
  const EncodedField without = kd_field(covered, Filter::nearest);
  EXPECT_EQ(without.find("kd_detail"), nullptr);
  EXPECT_EQ(without.statistics["bricks"], 2);
}

// ---- the pool

std::vector<Vec3i> mixed_boxes(std::uint64_t seed, int count, int least = 4, int most = 40) {
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<int> edge(least, most);
  std::vector<Vec3i> boxes;
  for (int i = 0; i < count; ++i) boxes.emplace_back(edge(random), edge(random), edge(random));
  return boxes;
}

/// Every texel of the pool belongs to one brick at most.
void expect_apart(const kd::Packing& p, std::span<const Vec3i> bricks) {
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
      expect_apart(kd::pack_nfdh(bricks, limit), bricks);
      expect_apart(kd::pack_best_fit(bricks, limit, 20'000'000), bricks);
    }
  }
}

TEST(KdTreePacking, MixedBricksFillMostOfThePool) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const auto bricks = mixed_boxes(seed, 200 + 50 * static_cast<int>(seed));
    const kd::Packing best = kd::pack_best_fit(bricks, 2048);
    const kd::Packing paper = kd::pack_nfdh(bricks, 2048);
    expect_apart(best, bricks);
    EXPECT_GE(kd::fill(best, bricks), 0.85);
    EXPECT_LT(kd::fill(paper, bricks), 0.75) << "the paper's own: 30 to 50 %";
    EXPECT_GT(kd::fill(paper, bricks), 0.3);
  }
}

TEST(KdTreePacking, ThousandsOfBricksArePackedInLayers) {
  const auto bricks = mixed_boxes(1, 3000, 4, 20);
  const kd::Packing best = kd::pack_best_fit(bricks, 2048);
  expect_apart(best, bricks);
  EXPECT_GE(kd::fill(best, bricks), 0.9);
}

TEST(KdTreePacking, EqualBricksLeaveAlmostNothing) {
  for (const int count : {1, 7, 64, 1000, 4173}) {
    const std::vector<Vec3i> bricks(static_cast<std::size_t>(count), Vec3i(18));
    EXPECT_GE(kd::fill(kd::pack_best_fit(bricks, 2048), bricks), 0.93) << count;
  }
}

TEST(KdTreePacking, WhatDoesNotFitHasNoPacking) {
  EXPECT_FALSE(kd::pack_nfdh(std::vector<Vec3i>(9, Vec3i(5)), 10).valid());
  EXPECT_FALSE(kd::pack_best_fit(std::vector<Vec3i>(9, Vec3i(5)), 10).valid());
  EXPECT_TRUE(kd::pack_best_fit(std::vector<Vec3i>(8, Vec3i(5)), 10).valid());
}

TEST(KdTree, OneBrickASubgridWithTheBorderOfItsFilter) {
  // the root subgrid's leaves reach to all its faces: 16^3; the corner's 8^3
  const AmrHierarchy h = refined_corner();
  const std::int64_t cells = 16 * 16 * 16 - 4 * 4 * 4 + 8 * 8 * 8;
  const auto check = [&](Filter filter, std::int64_t root, std::int64_t corner) {
    const EncodedField field = kd_field(h, filter);
    EXPECT_EQ(field.statistics["bricks"], 2);
    EXPECT_EQ(field.find("tex_kd_pool")->roles.payload, 4 * cells);
    EXPECT_EQ(field.find("tex_kd_pool")->roles.duplicated, 4 * (root * root * root - 4096 + corner * corner * corner - 512));
  };
  check(Filter::nearest, 16, 8);
  check(Filter::basis, 16, 8);
  check(Filter::linear_lod, 18, 10);
  check(Filter::linear_vertex, 17, 9);
}

TEST(KdTree, StatisticsOfAHandMadeMesh) {
  const EncodedField field = kd_field(not_nested(), Filter::linear_lod);
  const Json& s = field.statistics;
  EXPECT_EQ(s["nodes"], 23);
  EXPECT_EQ(s["leaves"], 12);
  EXPECT_EQ(s["subgrids"], 3);
  EXPECT_EQ(s["bricks"], 3);
  EXPECT_EQ(s["leaves_a_brick"], 4.0);
  const HostTexture& pool = *field.find("tex_kd_pool");
  EXPECT_DOUBLE_EQ(s["fill"].get<double>(), (2.0 * 1000 + 1000) / static_cast<double>(pool.texels()));
  EXPECT_EQ(s["pool"], Json({pool.size.x, pool.size.y, pool.size.z}));
}

TEST(KdTree, RefinedSubgridsAreNotStored) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).hierarchy();
  const EncodedField field = kd_field(h, Filter::nearest);
  EXPECT_EQ(field.statistics["bricks"], 1);
  EXPECT_EQ(field.statistics["nodes"], 1);
  const auto it = std::find_if(field.left_out.begin(), field.left_out.end(),
                               [](const LeftOut& l) { return l.what == "refined parts of subgrids"; });
  ASSERT_NE(it, field.left_out.end());
  EXPECT_EQ(it->bytes, 4 * 64);
}

// ---- traversal and packing change no value

TEST(KdTree, TraversalsAndPackingsGiveTheSameBits) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    const auto positions = probe_positions(h, 20, seed);
    for (const Filter filter : kd_filters()) {
      const EncodedField usual = kd_field(h, filter);
      const auto expected = probe_on_cpu(h, usual, Precision::single_precision, positions);
      for (const Json& parameters : {Json{{"traversal", "restart"}}, Json{{"packing", "nfdh"}}}) {
        const EncodedField other = kd_field(h, filter, parameters);
        const Comparison same =
            compare(positions, values_of(expected), probe_on_cpu(h, other, Precision::single_precision, positions), 0.0);
        EXPECT_TRUE(same) << parameters.dump() << ": " << same;
      }
    }
  }
}

TEST(KdTree, TreesWithoutWrappingHoldTheSameField) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h(random_mesh(seed));
    const auto positions = probe_positions(h, 20, seed);
    for (const Filter filter : kd_filters()) {
      const Comparison result = compare_double(h, kd_field(h, filter, {{"wrap", false}}, {.storage = Storage::r64f}), positions);
      EXPECT_TRUE(result) << result;
    }
  }
}

/// The whole mesh from an oblique side, values above 1/2 visible.
Scene oblique_scene(const AmrHierarchy& h, int width, int height) {
  Scene scene;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  scene.view.eye = middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8);
  scene.view.at = middle;
  scene.transfer_function.extinction = {{0.5, 0}, {1, 20}};
  scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  scene.settings.width = width;
  scene.settings.height = height;
  return scene;
}

TEST(KdTree, TraversalsGiveTheSamePicture) {
  Context& gl = context(ContextKind::egl);
  for (const MeshBuilder& mesh : {nested(waves), holes_and_missing(waves, 3)}) {
    const AmrHierarchy h = mesh.hierarchy();
    const Scene scene = oblique_scene(h, 60, 48);
    const auto draw = [&](const char* traversal, Filtering filtering) {
      const EncodedField field = kd_field(h, Filter::linear_lod, {{"traversal", traversal}}, {.filtering = filtering});
      const Structure structure(gl, field);
      Raycaster raycaster(gl, h, structure, scene);
      raycaster.draw();
      return raycaster.read().values;
    };
    for (const Filtering filtering : {Filtering::manual, Filtering::hardware}) {
      const auto from_grid = draw("grid", filtering);
      EXPECT_GT(*std::max_element(from_grid.begin(), from_grid.end()), 0);
      EXPECT_EQ(draw("restart", filtering), from_grid);
    }
  }
}

TEST(KdTree, ThirteenLevelsHoldTheField) {
  // 16 * 2^12 = 65536 cells along an axis: no start grid reaches the finest subgrids
  const AmrHierarchy h(generate_mesh(Json::parse(
      R"({"field": {"type": "sum", "terms": [{"type": "linear", "gradient": [1, 2, 3]}, {"type": "blobs"}]},
          "levels": 13, "root": 16, "patch": 4, "refine": {"criterion": "nested", "center": [0.51, 0.43, 0.62]}})")));
  ASSERT_EQ(h.level_count(), 13);
  const auto positions = probe_positions(h, 30);
  for (const Filter filter : kd_filters()) {
    const EncodedField field = kd_field(h, filter, Json::object(), {.storage = Storage::r64f});
    EXPECT_GT(field.statistics["start_depth"], 0);
    const Comparison result = compare_double(h, field, positions);
    EXPECT_TRUE(result) << filter_name(filter) << ": " << result;
  }
}

TEST(KdTree, StartGridKnowsTheDeepestNodeOfEachCell) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const kd::Tree tree = kd::build_tree(h);
    const std::vector<Box> boxes = kd::node_boxes(h, tree);
    for (const std::int64_t most : {1, 100, 100000}) {
      const kd::StartGrid grid = kd::make_start_grid(h, tree, most);
      ASSERT_EQ(static_cast<std::int64_t>(grid.entries.size()), kd::volume(grid.cells));
      for_each_cell({Vec3i(0), grid.cells}, [&](const Vec3i& g) {
        const std::uint32_t node = grid.nodes[grid.entries[Box{Vec3i(0), grid.cells}.offset(g)]];
        const Box cell = intersection({g * grid.width, (g + 1) * grid.width}, boxes[0]);
        EXPECT_TRUE(boxes[node].contains(cell));
        const kd::Node& n = tree.nodes[node];
        if (n.first_child == 0) return;
        EXPECT_FALSE(boxes[n.first_child].contains(cell) || boxes[n.first_child + 1].contains(cell));
      });
    }
  }
}

// ---- basis: each sample searches the leaves whose cells' hats reach it

/// Small ones: leaves are compared two by two.
AmrHierarchy small_random_mesh(std::uint64_t seed) { return AmrHierarchy(random_mesh(seed, {.max_finest_cells = 1 << 15})); }

const std::vector<Json>& basis_parameters() {
  static const std::vector<Json> sets{Json::object(), Json{{"wrap", false}, {"traversal", "restart"}}, Json{{"packing", "nfdh"}}};
  return sets;
}

TEST(KdTreeBasis, CellsWhoseHatsReachALeafAreThoseOfABruteForceSearch) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    const AmrHierarchy h = small_random_mesh(seed);
    const kd::Tree tree = kd::build_tree(h, {.wrap = true, .covers = false, .limits = {}});
    const std::vector<kd::HatNode> nodes = kd::hat_nodes(h, tree);
    for (const kd::Leaf& leaf : tree.leaves) {
      const Box box = leaf.cells.refined(h.cell_width(leaf.level));
      std::int64_t expected = 0, found = 0;
      for (const kd::Leaf& other : tree.leaves)
        for_each_cell(other.cells, [&](const Vec3i& c) {
          const int w = h.cell_width(other.level);
          for (int a = 0; a < 3; ++a)  // its hat: from half a cell before the cell to half a cell behind it
            if ((2 * c[a] - 1) * w >= 2 * box.upper[a] || (2 * c[a] + 3) * w <= 2 * box.lower[a]) return;
          ++expected;
        });
      kd::for_each_hat(h, tree, nodes, leaf, [&](int, const Box& cells) { found += cells.cells(); });
      ASSERT_EQ(found, expected);
    }
  }
}

TEST(KdTreeBasis, DoubleIsTheReferenceOnRandomMeshes) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const AmrHierarchy h = small_random_mesh(seed);
    const auto positions = probe_positions(h, 40, seed);
    for (const Json& parameters : basis_parameters()) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, parameters.dump()));
      const Comparison result = compare_double(h, kd_field(h, Filter::basis, parameters, {.storage = Storage::r64f}), positions);
      EXPECT_TRUE(result) << result;
    }
  }
}

TEST(KdTreeBasis, FloatIsTheReferenceOnBothSidesOfFacesEdgesAndCornersOfThreeLevels) {
  // one ulp to either side of every vertex of finest cells: f is continuous, so both values are the reference's there
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), jump_of_two(waves).hierarchy()}) {
    std::vector<FinestPosition> above, below;
    for_each_cell({Vec3i(1), h.cells(h.finest_level())}, [&](const Vec3i& c) {
      above.push_back({c, Vec3d(0)});
      below.push_back({c - Vec3i(1), Vec3d(kBelowOne)});
    });
    const EncodedField field = kd_field(h, Filter::basis);
    const Values expected = reference_values(h, field.definition, above);
    for (const auto& side : {above, below}) {
      const auto found = probe_on_cpu(h, field, Precision::single_precision, side);
      for (const ProbeResult& r : found) ASSERT_TRUE(r.found && std::isfinite(r.value));
      const Comparison result = compare(side, expected, found, 1e-5 * value_range(h));
      EXPECT_TRUE(result) << result;
    }
  }
}

TEST(KdTreeBasis, FloatIsTheReferenceOverThirteenLevels) {
  const AmrHierarchy h(generate_mesh(Json::parse(
      R"({"field": {"type": "sum", "terms": [{"type": "linear", "gradient": [1, 2, 3]}, {"type": "blobs"}]},
          "levels": 13, "root": 16, "patch": 4, "refine": {"criterion": "nested", "center": [0.51, 0.43, 0.62]}})")));
  const auto positions = probe_positions(h, 30);
  const EncodedField field = kd_field(h, Filter::basis);
  const Comparison result = compare(positions, reference_values(h, field.definition, positions),
                                    probe_on_cpu(h, field, Precision::single_precision, positions), 1e-5 * value_range(h));
  EXPECT_TRUE(result) << result;
}

TEST(KdTreeBasis, AConstantStaysThatConstant) {
  // a mean of one value, whatever the weights
  for (const MeshBuilder& mesh : {nested(constant(0.7)), holes_and_missing(constant(0.7), 3)}) {
    const AmrHierarchy h = mesh.hierarchy();
    const auto positions = probe_positions(h, 60);
    int found = 0;
    for (const ProbeResult& r : probe_on_cpu(h, kd_field(h, Filter::basis), Precision::single_precision, positions)) {
      if (!r.found) continue;
      ++found;
      EXPECT_EQ(r.value, static_cast<double>(0.7F));
    }
    EXPECT_GT(found, 100);
  }
}

TEST(KdTreeBasis, SkippingChangesNoBit) {
  Context& gl = context(ContextKind::egl);
  for (const MeshBuilder& mesh : {nested(waves), holes_and_missing(waves, 3)}) {
    const AmrHierarchy h = mesh.hierarchy();
    Scene scene = oblique_scene(h, 60, 48);
    scene.settings.sampling = Sampling::lattice;
    const auto draw_field = [&](bool skip) {
      scene.settings.skip = skip;
      return draw(gl, h, kd_field(h, Filter::basis, Json::object(), {.value_ranges = skip}), scene);
    };
    const Picture all = draw_field(false);
    EXPECT_GT(largest(all), 0.01);
    EXPECT_EQ(draw_field(true).values, all.values);
  }
}

TEST(KdTreeBasis, ThePictureIsThatOfExabricks) {
  for (const MeshBuilder& mesh : {nested(waves), jump_of_two(waves), holes_and_missing(waves)}) {
    const AmrHierarchy h = mesh.hierarchy();
    Scene scene = oblique_scene(h, 60, 48);
    scene.settings.sampling = Sampling::lattice;
    const auto draw_with = [&](const char* encoding) {
      return render_on_cpu(h, build(h, {&find_encoding(encoding), Filter::basis, Json::object()}), scene, false);
    };
    const Picture picture = draw_with("kd_tree");
    EXPECT_GT(largest(picture), 0.01);
    EXPECT_LE(difference(picture, draw_with("exabricks")), 1e-6);
  }
}

TEST(KdTreeBasis, RangesHoldWhatReachesInAndNoMore) {
  // three leaves in a row: 0, 0, 1. The third one's hats reach half a cell into the second and not into the first.
  const AmrHierarchy h = MeshBuilder({12, 4, 4})
                             .patch(0, {{0, 0, 0}, {4, 4, 4}}, constant(0))
                             .patch(0, {{4, 0, 0}, {8, 4, 4}}, constant(0))
                             .patch(0, {{8, 0, 0}, {12, 4, 4}}, constant(1))
                             .hierarchy();
  const kd::Tree tree = kd::build_tree(h, {.wrap = true, .covers = false, .limits = {}});
  const EncodedField field = kd_field(h, Filter::basis);
  ASSERT_EQ(tree.leaves.size(), 3U);
  const auto* words = field.find("kd_data")->as<std::uint32_t>();  // place, range
  for (std::size_t i = 0; i < 3; ++i) {
    const double min = field.range_origin + std::bit_cast<float>(words[2 * i + 1] << 16);
    const double max = field.range_origin + std::bit_cast<float>(words[2 * i + 1] & 0xffff0000U);
    const int x = tree.leaves[i].cells.lower.x;
    EXPECT_NEAR(min, 0, 0.01);  // the second one's reach into the third as well
    EXPECT_NEAR(max, x < 4 ? 0 : 1, 0.01);
  }
}

TEST(KdTreeBasis, HoldsItsTreeItsCellsAndABoxANode) {
  // two words a node, a position and a range a leaf, eight words a node that has mesh, and no border
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = kd_field(h, Filter::basis, {{"traversal", "restart"}});
  const auto n = [&](const char* key) { return field.statistics.at(key).get<std::int64_t>(); };
  ASSERT_EQ(n("empty_leaves"), 0);
  EXPECT_EQ(field.find("basis_supports")->bytes(), 32 * n("nodes"));
  EXPECT_EQ(field.memory().topology, (8 + 32) * n("nodes") + 8 * n("leaves"));
  EXPECT_EQ(field.memory().payload, 4 * h.leaf_cells());
  EXPECT_EQ(field.memory().duplicated, 0);
  for (const Filter other : {Filter::nearest, Filter::linear_lod, Filter::linear_vertex})
    EXPECT_EQ(kd_field(h, other).find("basis_supports"), nullptr);
}

/// Boxes that the search for a place looks at, and leaves that it finds: as basis_next does it.
struct SearchCounts {
  int boxes = 0, leaves = 0;
};
SearchCounts count_search(const HostTexture& supports, const Vec3d& p) {
  SearchCounts counts;
  const auto* words = supports.as<std::int32_t>();
  std::size_t i = 0;
  do {
    const std::int32_t* w = words + 8 * i;
    ++counts.boxes;
    bool holds = true;
    for (int a = 0; a < 3; ++a) holds = holds && p[a] > w[a] && p[a] < w[4 + a];
    counts.leaves += holds && w[3] != 0 ? 1 : 0;
    i = holds && w[3] == 0 ? i + 1 : static_cast<std::size_t>(w[7]);
  } while (i != 0);
  return counts;
}

TEST(KdTreeBasis, ASearchLooksAtFewBoxes) {
  // 10^3 places: of some thousand leaves a search passes the depth of the tree a few times
  const AmrHierarchy h(generate_mesh(Json::parse(R"({"field": "blobs_shell", "levels": 4, "root": 32, "patch": 8})")));
  const EncodedField field = kd_field(h, Filter::basis);
  const HostTexture& supports = *field.find("basis_supports");
  const Vec3d size(h.cells(h.finest_level()));
  double boxes = 0, leaves = 0;
  for_each_cell({Vec3i(0), Vec3i(10)}, [&](const Vec3i& i) {
    const SearchCounts counts = count_search(supports, (Vec3d(i) + Vec3d(0.43, 0.51, 0.57)) * 0.1 * size);
    boxes += counts.boxes / 1000.0;
    leaves += counts.leaves / 1000.0;
  });
  RecordProperty("leaves", field.statistics["leaves"].dump());
  RecordProperty("depth", field.statistics["depth"].dump());
  RecordProperty("boxes", fmt::format("{:.1f}", boxes));
  RecordProperty("found", fmt::format("{:.2f}", leaves));
  EXPECT_GT(field.statistics["leaves"], 500);
  EXPECT_GE(leaves, 1);
  EXPECT_LE(leaves, 4);
  EXPECT_LE(boxes, 4 * field.statistics["depth"].get<double>());
}

TEST(KdTreeBasis, HolesHaveNoBox) {
  // one half of the domain is a hole: the root and the leaf
  const AmrHierarchy hole = MeshBuilder(Vec3i(16)).patch(0, {{8, 0, 0}, {16, 16, 16}}, waves).hierarchy();
  EXPECT_EQ(kd_field(hole, Filter::basis).find("basis_supports")->bytes(), 2 * 32);
}

// ---- refusals

std::string refusal(const AmrHierarchy& h, const BuildRequest& request) {
  try {
    find_encoding("kd_tree").build(h, request);
    return "built";
  } catch (const UsageError& e) {
    return fmt::format("usage: {}", e.what());
  } catch (const UnsupportedError& e) {
    return fmt::format("unsupported: {}", e.what());
  } catch (const BudgetError& e) {
    return fmt::format("budget: {}", e.what());
  }
}

TEST(KdTree, RefusesWhatItsBitsCannotTell) {
  const AmrHierarchy wide = MeshBuilder({9000, 1, 1})
                                .patch(0, {{0, 0, 0}, {8000, 1, 1}}, waves)
                                .patch(0, {{8000, 0, 0}, {9000, 1, 1}}, waves)
                                .hierarchy();
  EXPECT_THAT(refusal(wide, {}), AllOf(HasSubstr("unsupported: encoding kd_tree"), HasSubstr("8000 cells"), HasSubstr("4095")));
}

std::string partition_refusal(const AmrHierarchy& h, const kd::PartitionOptions& options) {
  try {
    kd::Tree tree = kd::build_tree(h, options);
    if (options.covers) kd::add_detail_blocks(h, tree, options.limits);
    return "built";
  } catch (const UnsupportedError& e) {
    return e.what();
  }
}

TEST(KdTree, RefusesMoreThanANodeCanTell) {
  // the numbers of the layout are too large for a test: the same code with smaller ones
  EXPECT_EQ(kd::kMostNodes, 1 << 24);
  EXPECT_EQ(kd::kMostLeaves, (1 << 20) - 1);
  EXPECT_EQ(kd::kMostLevels, 64);
  EXPECT_EQ(kd::kMostSplit, 4095);
  const AmrHierarchy h = refined_corner();  // 7 nodes, 4 leaves, 2 levels, planes 4 cells from a corner
  kd::PartitionOptions o;
  o.limits = {.levels = 2, .nodes = 7, .blocks = 4, .split = 4};
  EXPECT_EQ(partition_refusal(h, o), "built");
  o.limits.nodes = 6;
  EXPECT_THAT(partition_refusal(h, o), AllOf(HasSubstr("encoding kd_tree"), HasSubstr("more than 6 nodes")));
  o.limits = {.levels = 2, .nodes = 7, .blocks = 3, .split = 4};
  EXPECT_THAT(partition_refusal(h, o), AllOf(HasSubstr("encoding kd_tree"), HasSubstr("more than 3 blocks")));
  o.limits = {.levels = 1, .nodes = 7, .blocks = 4, .split = 4};
  EXPECT_THAT(partition_refusal(h, o), AllOf(HasSubstr("2 levels"), HasSubstr("at most 1")));
  o.limits = {.levels = 2, .nodes = 7, .blocks = 4, .split = 3};
  EXPECT_THAT(partition_refusal(h, o), AllOf(HasSubstr("4 cells of level 0"), HasSubstr("at most 3")));
  // with a level of detail the corner's refined root cells are a fifth block
  o.limits = {.levels = 2, .nodes = 7, .blocks = 4, .split = 4};
  o.covers = true;
  EXPECT_THAT(partition_refusal(h, o), HasSubstr("more than 4 blocks"));
}

TEST(KdTree, RefusesMoreThanASubtreeOfManyMayAdd) {
  const AmrHierarchy h = checkerboard(20);  // 4000 subgrids: subtrees are built side by side
  const auto blocks = static_cast<std::int64_t>(kd::build_tree(h).leaves.size());
  kd::PartitionOptions o;
  o.limits.blocks = blocks;
  EXPECT_EQ(partition_refusal(h, o), "built");
  o.limits.blocks = blocks - 1;
  EXPECT_THAT(partition_refusal(h, o), HasSubstr(fmt::format("more than {} blocks", blocks - 1)));
}

TEST(KdTree, MoreLevelsThanANodeTellsAreNoMesh) {
  // the mesh is refused before any encoding
  MeshDescription mesh = MeshBuilder(Vec3i(1), std::vector<int>(69, 2)).root(waves).description();
  try {
    const AmrHierarchy h(mesh);
    FAIL() << "accepted " << h.level_count() << " levels";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("70 levels; at most 64"));
  }
}

TEST(KdTree, NamesTheLimitThatItWouldPass) {
  const AmrHierarchy h = refined_corner();
  BuildRequest request;
  request.context.max_3d_texture_size = 15;
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported:"), HasSubstr("16 x 16 x 16"), HasSubstr("15 texels")));
  request = {};
  request.context.max_buffer_bytes = 40;
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported:"), HasSubstr("nodes take 56 bytes"), HasSubstr("40")));
  request = {};
  request.memory_limit = 1000;
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("budget:"), HasSubstr("1000 bytes")));
}

TEST(KdTree, ALevelOfDetailIsRefusedWithBasisByName) {
  BuildRequest request;
  request.needs.filter = Filter::basis;
  request.needs.level_of_detail = true;
  EXPECT_THAT(refusal(refined_corner(), request),
              AllOf(HasSubstr("unsupported: encoding kd_tree: no level of detail"), HasSubstr("basis"),
                    HasSubstr("accepted: nearest, linear_lod, linear_vertex")));
}

TEST(KdTree, JumpsThatFloatsCannotPlaceAreRefusedWithBasisAlone) {
  // 150 root cells beside cells 16 times finer: 149 are 2384 of these wide
  const AmrHierarchy h = MeshBuilder({150, 1, 1}, {16}).root(waves).patch(1, {{0, 0, 0}, {16, 16, 16}}, waves).hierarchy();
  BuildRequest request;
  EXPECT_EQ(refusal(h, request), "built");
  request.needs.filter = Filter::basis;
  EXPECT_THAT(refusal(h, request),
              AllOf(HasSubstr("unsupported: encoding kd_tree: filter basis"), HasSubstr("2384 of the cells of level 1"),
                    HasSubstr("at most 2048"), HasSubstr("exabricks")));
}

TEST(KdTree, JumpsThatAStepPassesOverAreRefusedWithBasisAlone) {
  for (const int ratio : {64, 128}) {
    const AmrHierarchy h =
        MeshBuilder({5, 1, 1}, {ratio}).root(waves).patch(1, {Vec3i(0), Vec3i(ratio, ratio, ratio)}, waves).hierarchy();
    BuildRequest request;
    EXPECT_EQ(refusal(h, request), "built");
    request.needs.filter = Filter::basis;
    if (ratio == 64)
      EXPECT_EQ(refusal(h, request), "built");
    else
      EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported: encoding kd_tree: filter basis"),
                                             HasSubstr("128 times as wide"), HasSubstr("at most 64"), HasSubstr("exabricks")));
  }
}

TEST(KdTree, RefusesBadParametersWithWhatIsAccepted) {
  const AmrHierarchy h = refined_corner();
  for (const char* name : {"storage_kind", "packing", "traversal"})
    for (const Json& bad : {Json("other"), Json(1), Json(nullptr)}) {
      BuildRequest request;
      request.parameters = {{name, bad}};
      EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("usage: encoding kd_tree"), HasSubstr(name), HasSubstr("accepted: \"")));
    }
  BuildRequest wrap;
  wrap.parameters = {{"wrap", 1}};
  EXPECT_THAT(refusal(h, wrap), AllOf(HasSubstr("usage: encoding kd_tree"), HasSubstr("wrap"), HasSubstr("true or false")));
}

// ---- bindless: a texture a brick

const Json kBindless{{"storage_kind", "bindless"}};

/// As for a context without limits.
EncodedField bindless_field(const AmrHierarchy& h, Filter filter, Storage storage = Storage::r32f,
                            Filtering filtering = Filtering::manual, std::vector<int> more_fields = {}) {
  BuildRequest request;
  request.parameters = kBindless;
  request.needs.filter = filter;
  request.needs.filtering = filtering;
  request.storage = storage;
  request.more_fields = std::move(more_fields);
  return find_encoding("kd_tree").build(h, request);
}

/// 500 subgrids of 4^3 cells, none beside another, over one of 20^3.
AmrHierarchy many_subgrids() {
  MeshBuilder mesh(Vec3i(20), {2});
  mesh.root(waves);
  for_each_cell({Vec3i(0), Vec3i(10)}, [&](const Vec3i& b) {
    if ((b.x + b.y + b.z) % 2 == 0) mesh.patch(1, {b * 4, (b + 1) * 4}, waves);
  });
  return mesh.hierarchy();
}

TEST(KdTreeBindless, EveryBrickIsATextureWithItsBorder) {
  const AmrHierarchy h = refined_corner();
  const auto check = [&](Filter filter, int root, int corner) {
    const EncodedField field = bindless_field(h, filter);
    std::vector<const HostTexture*> bricks;
    for (const HostTexture& t : field.textures)
      if (!t.handles.empty()) bricks.push_back(&t);
    ASSERT_EQ(bricks.size(), 2u);
    // the root brick: 16^3 cells, of which the refined 4^3 are in no leaf
    const HostTexture& first = bricks[0]->size.x == root ? *bricks[0] : *bricks[1];
    const HostTexture& second = &first == bricks[0] ? *bricks[1] : *bricks[0];
    EXPECT_EQ(first.size, Vec3i(root));
    EXPECT_EQ(first.roles, (MemoryByRole{4 * (4096 - 64), 4 * (root * root * root - 4096), 0, 4 * 64}));
    EXPECT_EQ(second.size, Vec3i(corner));
    EXPECT_EQ(second.roles, (MemoryByRole{4 * 512, 4 * (corner * corner * corner - 512), 0, 0}));
    EXPECT_EQ(field.find("kd_handles")->roles, (MemoryByRole{0, 0, 2 * 8, 0}));
    EXPECT_EQ(field.find("tex_kd_pool"), nullptr);
    EXPECT_EQ(field.value_texels(), first.texels() + second.texels());
    EXPECT_EQ(field.statistics["fill"], 1.0);
    EXPECT_EQ(field.statistics["handle_loop"], true);
  };
  check(Filter::nearest, 16, 8);
  check(Filter::basis, 16, 8);
  check(Filter::linear_lod, 18, 10);
  check(Filter::linear_vertex, 17, 9);
}

TEST(KdTreeBindless, DataNodesHoldTheirBrickAndTheirPlaceInIt) {
  const AmrHierarchy h = refined_corner();
  const kd::Tree tree = kd::build_tree(h);
  const EncodedField field = bindless_field(h, Filter::nearest);
  const auto* words = field.find("kd_data")->as<std::uint32_t>();
  ASSERT_EQ(field.find("kd_data")->texels(), static_cast<std::int64_t>(3 * tree.leaves.size())) << "place, brick, value range";
  std::vector<const HostTexture*> bricks(2);
  for (const HostTexture& t : field.textures)
    if (!t.handles.empty()) bricks[static_cast<std::size_t>(t.handle_index)] = &t;
  for (const kd::Leaf& leaf : tree.leaves) {
    EXPECT_EQ(bricks.at(words[1])->size, Vec3i(leaf.level == 0 ? 16 : 8));
    const Vec3i at = leaf.cells.lower;  // both bricks start at cell 0; 16 texels an axis take 4 bits
    EXPECT_EQ(words[0], static_cast<std::uint32_t>(at.x | (at.y << 4) | (at.z << 8)));
    words += 3;
  }
}

TEST(KdTreeBindless, AFurtherFieldCostsItsTexturesAndTheirHandles) {
  const AmrHierarchy h =
      MeshBuilder(Vec3i(16), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).also("g", slopes).hierarchy();
  const MemoryByRole one = bindless_field(h, Filter::linear_lod).memory();
  const MemoryByRole two = bindless_field(h, Filter::linear_lod, Storage::r32f, Filtering::manual, {1}).memory();
  EXPECT_EQ(two, (MemoryByRole{2 * one.payload, 2 * one.duplicated, one.topology + 2 * 8, 2 * one.padding}));
}

TEST(KdTreeBindless, TheCpuReadsThePoolsBits) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const auto positions = probe_positions(h, 20, seed);
    for (const Filter filter : kd_filters())
      for (const Storage storage : {Storage::r64f, Storage::r32f, Storage::r8, Storage::r16, Storage::r16f}) {
        SCOPED_TRACE(fmt::format("seed {} {} {}", seed, filter_name(filter), format_name(storage)));
        const auto expected =
            probe_on_cpu(h, kd_field(h, filter, Json::object(), {.storage = storage}), Precision::double_precision, positions);
        const auto got = probe_on_cpu(h, bindless_field(h, filter, storage), Precision::double_precision, positions);
        const Comparison same = compare(positions, values_of(expected), got, 0.0);
        EXPECT_TRUE(same) << same;
      }
  }
}

TEST(KdTreeBindless, HandlesAreCountedBeforeAnythingIsAllocated) {
  const AmrHierarchy h = many_subgrids();
  BuildRequest request;
  request.parameters = kBindless;
  request.context.max_resident_handles = 500;
  request.memory_limit = 1;  // would be refused next
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported: encoding kd_tree"), HasSubstr("bindless"),
                                         HasSubstr("501 textures x 1 field need 501 handles, the context takes 500")));
  request.context.max_resident_handles = 501;
  EXPECT_THAT(refusal(h, request), HasSubstr("budget:"));
  request.more_fields = {0};
  EXPECT_THAT(refusal(h, request), HasSubstr("501 textures x 2 fields need 1002 handles, the context takes 501"));
}

TEST(KdTreeBindless, NamesTheExtensionThatTheContextLacks) {
  const AmrHierarchy h = refined_corner();
  BuildRequest request;
  request.parameters = kBindless;
  request.context.renderer = "this renderer";
  const Encoding& encoding = find_encoding("kd_tree");
  EXPECT_TRUE(encoding.unsupported_values(request.context).empty());
  request.context.shader_ballot = false;
  EXPECT_THAT(refusal(h, request), HasSubstr("needs GL_ARB_shader_ballot, which this renderer lacks"));
  request.context.handles_may_differ = true;
  EXPECT_EQ(refusal(h, request), "built");
  request.context.bindless_texture = false;
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported: encoding kd_tree: storage_kind \"bindless\""),
                                         HasSubstr("needs GL_ARB_bindless_texture, which this renderer lacks")));
  ASSERT_EQ(encoding.unsupported_values(request.context).size(), 1u);
  EXPECT_EQ(encoding.unsupported_values(request.context)[0].value, "bindless");
  EXPECT_THAT(encoding.unsupported_values(request.context)[0].reason, HasSubstr("GL_ARB_bindless_texture"));
  EXPECT_TRUE(encoding.supported(request.context).ok) << "the pool needs nothing";
}

TEST(KdTreeBindless, NoLoopWhereHandlesMayDiffer) {
  BuildRequest request;
  request.parameters = kBindless;
  request.context.handles_may_differ = true;
  const EncodedField field = find_encoding("kd_tree").build(refined_corner(), request);
  EXPECT_EQ(field.shader.extensions, std::vector<std::string>{"GL_ARB_bindless_texture"});
  EXPECT_EQ(field.statistics["handle_loop"], false);
}

TEST(KdTreeBindless, AContextWithoutItRefusesTheUpload) {
  Context& gl = context(ContextKind::osmesa);
  if (gl.info().bindless_texture) GTEST_SKIP() << "OSMesa takes handles here";
  const EncodedField field = bindless_field(refined_corner(), Filter::nearest);
  try {
    const GpuField gpu(field, gl);
    ADD_FAILURE() << "uploaded";
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("encoding kd_tree"), HasSubstr("GL_ARB_bindless_texture")));
  }
}

/// These run on zink too (tests/with_bindless.cpp), where they may not be skipped.
class KdTreeBindlessOnGl : public testing::Test {
 protected:
  void SetUp() override {
    const Support support = supports_handles(gl_.info());
    if (!support.ok) GTEST_SKIP() << support.reason;
  }
  Context& gl_ = context(ContextKind::egl);
};

TEST_F(KdTreeBindlessOnGl, BytesAreWhatGlReports) {
  const AmrHierarchy h = not_nested();
  for (const Storage storage : {Storage::r8, Storage::r16, Storage::r16f, Storage::r32f})
    for (const Filtering filtering : {Filtering::manual, Filtering::hardware}) {
      const EncodedField field = bindless_field(h, Filter::linear_lod, storage, filtering, {0, 0, 0});
      const GpuField gpu(field, gl_);
      EXPECT_EQ(gpu.bytes(), field.memory().total());
      EXPECT_EQ(gpu.bytes_reported(), field.memory().total()) << format_name(storage);
    }
}

TEST_F(KdTreeBindlessOnGl, PicturesHaveThePoolsBits) {
  for (const AmrHierarchy& h : {many_subgrids(), holes_and_missing(waves, 3).hierarchy()}) {
    const Scene scene = oblique_scene(h, 80, 60);
    for (const Filter filter : kd_filters())
      for (const Filtering filtering : {Filtering::manual, Filtering::hardware}) {
        const auto draw = [&](const Json& parameters) {
          const EncodedField field = kd_field(h, filter, parameters, {.filtering = filtering});
          const Structure structure(gl_, field);
          Raycaster raycaster(gl_, h, structure, scene);
          raycaster.draw();
          return raycaster.read().values;
        };
        SCOPED_TRACE(fmt::format("{} {}", filter_name(filter), filtering_name(filtering)));
        const auto pool = draw(Json::object());
        const auto bindless = draw(kBindless);
        ASSERT_EQ(pool.size(), bindless.size());
        EXPECT_GT(*std::max_element(pool.begin(), pool.end()), 0);
        if (filter == Filter::nearest || filtering == Filtering::manual) {
          EXPECT_EQ(bindless, pool);
          continue;
        }
        // the texture coordinate is normalised by another size: 2^-12 of a value's range a sample, times the slope of light
        double worst = 0;
        for (std::size_t i = 0; i < pool.size(); ++i) worst = std::max(worst, std::abs(pool[i] - bindless[i]));
        EXPECT_LT(worst, 0.01);
      }
  }
}

TEST_F(KdTreeBindlessOnGl, HandlesAreGivenBackAndNeverPassTheLimit) {
  if (gl_.info().max_resident_handles != 1023) GTEST_SKIP() << "the limit of this driver is not known";
  const AmrHierarchy h = many_subgrids();
  const auto positions = probe_positions(h, 30);
  const EncodedField field = bindless_field(h, Filter::nearest);
  const auto expected = values_of(probe_on_cpu(h, field, Precision::single_precision, positions));
  // 6 x 501 handles, one after the other
  for (int i = 0; i < 6; ++i) {
    const Structure structure(gl_, field);
    EXPECT_TRUE(compare(positions, expected, probe_on_gl(gl_, h, structure, positions), 0.0));
  }
  const Structure first(gl_, field);
  auto second = std::make_unique<GpuField>(field, gl_);
  EXPECT_TRUE(compare(positions, expected, probe_on_gl(gl_, h, first, positions), 0.0));
  try {
    const GpuField third(field, gl_);
    ADD_FAILURE() << "1503 handles were taken";
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), HasSubstr("501 handles of textures beside 1002 in use, the context takes 1023"));
  }
  second.reset();
  const Structure third(gl_, field);
  EXPECT_TRUE(compare(positions, expected, probe_on_gl(gl_, h, third, positions), 0.0));
}

}  // namespace
}  // namespace amrtex
