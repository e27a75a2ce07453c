// Filter basis: each sample searches the leaves whose cells' hats reach it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "structures/common/build_tools.hpp"
#include "structures/kd_tree/kd_hats.hpp"
#include "structures/kd_tree/kd_partition.hpp"
#include "structures/kd_tree/kd_test_tools.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

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

}  // namespace
}  // namespace amrtex
