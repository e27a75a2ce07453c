// Facts of `kd_tree` alone; what every encoding must do is in tests/.
#include "structures/kd_tree/kd_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "renderers/raycaster.hpp"
#include "structures/brick_packing.hpp"
#include "structures/kd_tree/kd_partition.hpp"
#include "structures/kd_tree/start_grid.hpp"
#include "structures/random_mesh.hpp"
#include "structures/synthetic.hpp"
#include "tests/encoding_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

EncodedField kd_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                      const BuildOptions& options = {}) {
  return build(h, {&find_encoding("kd_tree"), filter, parameters}, options);
}

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
    const EncodedField field = kd_field(h, Filter::nearest);
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

TEST(KdTree, TenThousandSubgridsTakeSeconds) {
  // every other block of a checkerboard is refined: 10 976 subgrids of 4^3 cells, none beside another
  MeshBuilder mesh(Vec3i(56), {2});
  mesh.root(constant(1));
  int subgrids = 0;
  for_each_cell({Vec3i(0), Vec3i(28)}, [&](const Vec3i& b) {
    if ((b.x + b.y + b.z) % 2 == 0) mesh.patch(1, {b * 4, (b + 1) * 4}, constant(2));
    subgrids += (b.x + b.y + b.z) % 2 == 0 ? 1 : 0;
  });
  const AmrHierarchy h = mesh.hierarchy();
  ASSERT_EQ(subgrids, 10976);
  const auto start = std::chrono::steady_clock::now();
  const kd::Tree tree = kd::build_tree(h);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_LT(seconds.count(), 5);
  EXPECT_LE(tree.depth, 64);
  RecordProperty("milliseconds", static_cast<int>(1000 * seconds.count()));
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
    for (const Filter filter : {Filter::nearest, Filter::linear_lod, Filter::linear_vertex}) {
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

TEST(KdTree, TraversalsGiveTheSamePicture) {
  Context& gl = context(ContextKind::egl);
  for (const MeshBuilder& mesh : {nested(waves), holes_and_missing(waves, 3)}) {
    const AmrHierarchy h = mesh.hierarchy();
    Scene scene;
    const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
    scene.view.eye = middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8);
    scene.view.at = middle;
    scene.transfer_function.extinction = {{0.5, 0}, {1, 20}};
    scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
    scene.settings.width = 60;
    scene.settings.height = 48;
    const auto draw = [&](const char* traversal, Filtering filtering) {
      const EncodedField field = kd_field(h, Filter::linear_lod, {{"traversal", traversal}}, {.filtering = filtering});
      const GpuField gpu(field, gl);
      Raycaster raycaster(gl, h, field, gpu, scene);
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
  for (const Filter filter : {Filter::nearest, Filter::linear_lod, Filter::linear_vertex}) {
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

TEST(KdTree, RefusesBadParametersWithWhatIsAccepted) {
  const AmrHierarchy h = refined_corner();
  for (const char* name : {"storage_kind", "packing", "traversal"})
    for (const Json& bad : {Json("other"), Json(1), Json(nullptr)}) {
      BuildRequest request;
      request.parameters = {{name, bad}};
      EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("usage: encoding kd_tree"), HasSubstr(name), HasSubstr("accepted: \"")));
    }
  BuildRequest request;
  request.parameters = {{"storage_kind", "bindless"}};
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported:"), HasSubstr("not available in this version")));
}

}  // namespace
}  // namespace amrtex
