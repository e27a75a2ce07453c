// Facts of `kd_tree` alone; what every encoding must do is in tests/.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "renderers/consumers/raycaster.hpp"
#include "structures/common/brick_packing.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/common/start_grid.hpp"
#include "structures/kd_tree/kd_detail.hpp"
#include "structures/kd_tree/kd_hats.hpp"
#include "structures/kd_tree/kd_partition.hpp"
#include "structures/kd_tree/kd_test_tools.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

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
    const std::vector<Box> boxes = node_boxes(h, tree);
    for (const std::int64_t most : {1, 100, 100000}) {
      const StartGrid grid = make_start_grid(h, tree, most);
      ASSERT_EQ(static_cast<std::int64_t>(grid.entries.size()), packing::volume(grid.cells));
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

TEST(KdTree, RefusesWhatItsBitsCannotTell) {
  const AmrHierarchy wide = MeshBuilder({9000, 1, 1})
                                .patch(0, {{0, 0, 0}, {8000, 1, 1}}, waves)
                                .patch(0, {{8000, 0, 0}, {9000, 1, 1}}, waves)
                                .hierarchy();
  EXPECT_THAT(refusal(wide, {}), AllOf(HasSubstr("unsupported: encoding kd_tree"), HasSubstr("8000 cells"), HasSubstr("4095")));
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
  request.parameters = {{"traversal", "restart"}};  // no start grid, which would be larger than the nodes
  request.context.max_buffer_bytes = 40;
  EXPECT_THAT(refusal(h, request), AllOf(HasSubstr("unsupported:"), HasSubstr("nodes: 56 bytes"), HasSubstr("40")));
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

TEST(KdTree, NearestVolumesHoldCellsNodesAndStartGridAndFivePercent) {
  expect_nearest_holds_little_more("kd_tree", [](const AmrHierarchy& h, const EncodedField& f) {
    // two words a node, a position and a range a leaf, an entry and a node of the start grid
    return h.leaf_cells() * 4 + counted(f, "nodes") * 8 + counted(f, "leaves") * 8 + f.find("kd_start")->bytes() +
           f.find("kd_start_nodes")->bytes();
  });
}

}  // namespace
}  // namespace amrtex
