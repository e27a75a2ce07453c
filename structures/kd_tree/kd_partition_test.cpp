// The tree over the subgrids: its words, its planes, its leaves, and how many it takes.
#include "structures/kd_tree/kd_partition.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <chrono>
#include <cmath>

#include "structures/common/start_grid.hpp"
#include "structures/kd_tree/kd_detail.hpp"
#include "structures/kd_tree/kd_test_tools.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

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
    const std::vector<Box> boxes = node_boxes(h, tree);
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
    const std::vector<Box> boxes = node_boxes(h, tree);
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
    const StartGrid grid = make_start_grid(h, tree, 1000);
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

// ---- limits

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

}  // namespace
}  // namespace amrtex
