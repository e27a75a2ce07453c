// Facts of `octree` alone; what every encoding must do is in tests/.
#include "structures/octree/octree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <set>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "structures/generators/random_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/octree/octree_layout.h"
#include "tests/gl_probe.hpp"
#include "tests/leave_out_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

EncodedField octree_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                          const BuildOptions& options = {}) {
  return build(h, {&find_encoding("octree"), filter, parameters}, options);
}

std::uint32_t word(const EncodedField& field, std::int64_t i) {
  const HostTexture* nodes = field.find("octree_nodes");
  return (nodes != nullptr ? nodes : field.find("tex_octree_nodes"))->as<std::uint32_t>()[i];
}
float value_in_slot(const EncodedField& field, std::int64_t slot) { return field.find("octree_values")->as<float>()[slot]; }

/// In double, at a finest cell and a fraction.
double value_at(const AmrHierarchy& h, const EncodedField& field, const Vec3i& cell, const Vec3d& fraction) {
  const std::vector<FinestPosition> at{{cell, fraction}};
  const ProbeResult r = probe_on_cpu(h, field, Precision::double_precision, at)[0];
  return r.found ? r.value : kNan;
}

/// 4^3 root cells, of which 2^3 in the corner are refined.
AmrHierarchy refined_corner() { return MeshBuilder(Vec3i(4), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(4)}, waves).hierarchy(); }

// ---- nodes

TEST(Octree, WideNodesOfAHandMadeMesh) {
  // the root, its 8 children of 2^3 root cells, and the 8 refined cells: 17 nodes, 7 * 17 + 1 = 120 leaves
  const AmrHierarchy h = refined_corner();
  const EncodedField field = octree_field(h, Filter::nearest);
  EXPECT_EQ(field.statistics["nodes"], 17);
  EXPECT_EQ(field.statistics["leaves"], 120);
  EXPECT_EQ(h.leaf_cells(), 120);
  EXPECT_EQ(field.statistics["empty"], 0);
  // inner children of a node stand together, depth first otherwise: 0; 1 to 8; 9 to 16 below 1
  EXPECT_EQ(word(field, 0), (1U << AMRTEX_OCTREE_MASK_BITS) | 0xffU);
  EXPECT_EQ(word(field, 1), (9U << AMRTEX_OCTREE_MASK_BITS) | 0xffU);
  for (int node = 2; node < 17; ++node) EXPECT_EQ(word(field, node) & 0xffU, 0U) << node;
  // slot 8 n + i: child (1, 0, 1) of node 2, which is child (1, 0, 0) of the root, is root cell (3, 0, 1)
  const MeshBuilder mesh(Vec3i(4));
  EXPECT_EQ(value_in_slot(field, 8 * 2 + 5), static_cast<float>(waves(mesh.centre(0, {3, 0, 1}))));
}

TEST(Octree, MasksTellWhichChildrenAreInner) {
  // 2^3 root cells, (1, 0, 0) and (0, 1, 1) refined: children 1 and 6
  const AmrHierarchy h = MeshBuilder(Vec3i(2), {2})
                             .root(waves)
                             .patch(1, {{2, 0, 0}, {4, 2, 2}}, waves)
                             .patch(1, {{0, 2, 2}, {2, 4, 4}}, waves)
                             .hierarchy();
  const EncodedField field = octree_field(h, Filter::nearest);
  EXPECT_EQ(field.statistics["nodes"], 3);
  EXPECT_EQ(word(field, 0), (1U << AMRTEX_OCTREE_MASK_BITS) | 0b01000010U);
  const MeshBuilder mesh(Vec3i(2), {2});
  EXPECT_EQ(value_in_slot(field, 8 * 1 + 3), static_cast<float>(waves(mesh.centre(1, {3, 1, 0}))));
  EXPECT_EQ(value_in_slot(field, 8 * 2 + 4), static_cast<float>(waves(mesh.centre(1, {0, 2, 3}))));
}

TEST(Octree, PaperNodesOfAHandMadeMesh) {
  // preorder: the root 0, its first child 1 with 2 to 9 below it, then 10 to 16; one column of a 3D texture along z
  const AmrHierarchy h = refined_corner();
  const EncodedField field = octree_field(h, Filter::nearest, {{"layout", "rgba8"}}, {.storage = Storage::r8});
  const auto slot = [&](int node, int child) { return word(field, 8 * node + child); };
  const auto inner = [](unsigned node) { return (std::uint32_t{AMRTEX_OCTREE_INNER} << 24) | (node << 16); };
  EXPECT_EQ(field.find("octree_nodes")->texels(), 8 * 17);
  EXPECT_EQ(slot(0, 0), inner(1));
  for (unsigned i = 1; i < 8; ++i) EXPECT_EQ(slot(0, static_cast<int>(i)), inner(9 + i));
  for (unsigned i = 0; i < 8; ++i) EXPECT_EQ(slot(1, static_cast<int>(i)), inner(2 + i));
  // a leaf: type and code (v - min) / (max - min) * 255 of 8 bits
  const MeshBuilder mesh(Vec3i(4), {2});
  const double v = waves(mesh.centre(0, {3, 0, 1}));
  const auto code = static_cast<std::uint32_t>(std::lround((v - field.scale.offset) / field.scale.scale * 255));
  EXPECT_EQ(slot(10, 5), (std::uint32_t{AMRTEX_OCTREE_LEAF} << 24) | code);
}

TEST(Octree, ATexelACellAndASeventh) {
  // a full tree of 8^k leaves has (8^k - 1) / 7 inner nodes: 8/7 texels a cell, less the root's share
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root(waves).hierarchy();
  const EncodedField field = octree_field(h, Filter::linear_lod);
  EXPECT_EQ(field.statistics["nodes"], (32768 - 1) / 7);
  EXPECT_EQ(field.value_texels(), 8 * (32768 - 1) / 7);
}

TEST(Octree, RatioFourTakesTwoLevelsOfTheTree) {
  // one root cell refined by 4: the root (of 2^3 root cells), 1 node a root cell, 8 below it; 64 leaves in 2^3 - 1 + 64 slots
  const AmrHierarchy h = MeshBuilder(Vec3i(2), {4}).root(waves).patch(1, {Vec3i(0), Vec3i(4)}, waves).hierarchy();
  const EncodedField field = octree_field(h, Filter::nearest);
  EXPECT_EQ(field.statistics["nodes"], 1 + 1 + 8);
  EXPECT_EQ(field.statistics["leaves"], 7 + 64);
}

// ---- the filter

/// Bars along x: root cells 0 and 1 hold 0 and 10, cells 4 to 7 of level 1 behind them 104 to 107.
AmrHierarchy bars() {
  return MeshBuilder(Vec3i(4), {2})
      .root([](const Vec3d& p) { return 10 * std::floor(p.x * 4); })
      .patch(1, {{4, 0, 0}, {8, 8, 8}}, [](const Vec3d& p) { return 100 + std::floor(p.x * 8); })
      .hierarchy();
}

class OctreeFilter : public testing::TestWithParam<Json> {};

TEST_P(OctreeFilter, NeighbourOfTheSameDepthGivesItsSample) {
  // three quarters into root cell 0: a quarter of the way from its centre to the next
  const AmrHierarchy h = bars();
  const EncodedField field = octree_field(h, Filter::linear_lod, GetParam(), {.storage = Storage::r64f});
  EXPECT_DOUBLE_EQ(value_at(h, field, {1, 3, 3}, {0.5, 0.3, 0.4}), 0.75 * 0 + 0.25 * 10);
}

TEST_P(OctreeFilter, FinerNeighbourGivesItsAverageAtTheLeafsDepth) {
  // three quarters into root cell 1; the average of 104 and 105 behind it
  const AmrHierarchy h = bars();
  const EncodedField field = octree_field(h, Filter::linear_lod, GetParam(), {.storage = Storage::r64f});
  EXPECT_DOUBLE_EQ(value_at(h, field, {3, 3, 3}, {0.5, 0.3, 0.4}), 0.75 * 10 + 0.25 * 104.5);
}

TEST_P(OctreeFilter, CoarserNeighbourGivesItsSample) {
  // a quarter into cell 4 of level 1; cell 3 lies in the root cell of value 10
  const AmrHierarchy h = bars();
  const EncodedField field = octree_field(h, Filter::linear_lod, GetParam(), {.storage = Storage::r64f});
  EXPECT_DOUBLE_EQ(value_at(h, field, {4, 3, 3}, {0.25, 0.3, 0.4}), 0.25 * 10 + 0.75 * 104);
}

TEST_P(OctreeFilter, MissingNeighbourGivesItsFill) {
  // 1, nothing, 5 along x: the fill is 3. Once a hole, once NaN
  const AmrHierarchy hole = MeshBuilder({3, 1, 1})
                                .patch(0, {{0, 0, 0}, {1, 1, 1}}, constant(1))
                                .patch(0, {{2, 0, 0}, {3, 1, 1}}, constant(5))
                                .hierarchy();
  const AmrHierarchy nan = MeshBuilder({3, 1, 1}).patch(0, {Vec3i(0), {3, 1, 1}}, {1, kNan, 5}).hierarchy();
  for (const AmrHierarchy* h : {&hole, &nan}) {
    const EncodedField field = octree_field(*h, Filter::linear_lod, GetParam(), {.storage = Storage::r64f});
    EXPECT_DOUBLE_EQ(value_at(*h, field, {0, 0, 0}, {0.75, 0.5, 0.5}), 0.75 * 1 + 0.25 * 3);
    EXPECT_DOUBLE_EQ(value_at(*h, field, {2, 0, 0}, {0.25, 0.5, 0.5}), 0.25 * 3 + 0.75 * 5);
    EXPECT_TRUE(std::isnan(value_at(*h, field, {1, 0, 0}, {0.5, 0.5, 0.5})));
  }
}

TEST_P(OctreeFilter, FillsBeyondTheDomainAreNotClampedWhereTheCellThereIsMissing) {
  // cells (1, 0), (0, 1), (1, 1) hold 1, 3, 7 and (0, 0) nothing, so its fill is 2. Beyond the face lie (-1, 1) with the fill 3
  // of its face neighbour and (-1, 0), which has but the edge neighbour (0, 1): 3, where clamping would give 2
  const AmrHierarchy h = MeshBuilder({2, 2, 1}).patch(0, {Vec3i(0), {2, 2, 1}}, {kNan, 1, 3, 7}).hierarchy();
  const EncodedField field = octree_field(h, Filter::linear_lod, GetParam(), {.storage = Storage::r64f});
  EXPECT_DOUBLE_EQ(value_at(h, field, {0, 1, 0}, {0.25, 0.25, 0.5}), 0.75 * 3 + 0.25 * (0.25 * 3 + 0.75 * 2));
}

TEST_P(OctreeFilter, IsTheReferenceForEveryRatioAndShape) {
  std::vector<NamedMesh> meshes;
  for (const std::vector<int>& ratios : std::vector<std::vector<int>>{{2, 2}, {4, 2}, {2, 4}, {8, 2}, {4, 4}})
    meshes.push_back({fmt::format("{} {}", ratios[0], ratios[1]), nested(waves, ratios).hierarchy()});
  meshes.push_back({"5 x 3 x 17", MeshBuilder({5, 3, 17}).root(waves).hierarchy()});
  meshes.push_back({"jump", jump_of_two(waves).hierarchy()});
  for (const int ratio : {2, 4, 8})
    meshes.push_back({fmt::format("holes {}", ratio), holes_and_missing(waves, ratio).hierarchy()});
  for (const NamedMesh& m : meshes)
    for (const Filter filter : {Filter::nearest, Filter::linear_lod}) {
      const Comparison result =
          compare_double(m.hierarchy, octree_field(m.hierarchy, filter, GetParam(), {.storage = Storage::r64f}),
                         probe_positions(m.hierarchy, 80));
      EXPECT_TRUE(result) << m.name << " " << filter_name(filter) << ": " << result;
    }
}

INSTANTIATE_TEST_SUITE_P(Traversals, OctreeFilter,
                         testing::Values(Json::object(), Json{{"start_grid", 0}}, Json{{"start_grid", 2}},
                                         Json{{"traversal", "paper"}}),
                         [](const auto& test) {
                           std::string name = test.param.empty() ? "defaults" : "";
                           for (const auto& [parameter, value] : test.param.items())
                             name += parameter + "_" + (value.is_string() ? value.template get<std::string>() : value.dump());
                           return name;
                         });

TEST(Octree, TheLayoutOfThePaperHoldsTheFieldInEightBits) {
  // half a step of 1/255 of the range
  Context& gl = context(ContextKind::egl);
  for (const AmrHierarchy& h : {nested(waves, {2, 4}).hierarchy(), holes_and_missing(waves).hierarchy()})
    for (const Filter filter : {Filter::nearest, Filter::linear_lod})
      for (const char* traversal : {"fast", "paper"}) {
        const EncodedField field =
            octree_field(h, filter, {{"layout", "rgba8"}, {"traversal", traversal}}, {.storage = Storage::r8});
        const auto positions = probe_positions(h, 60);
        const Values expected = reference_values(h, field.definition, positions);
        const double tolerance = (0.5 / 255 + 1e-6) * value_range(h);
        const Comparison on_cpu =
            compare(positions, expected, probe_on_cpu(h, field, Precision::double_precision, positions), tolerance);
        EXPECT_TRUE(on_cpu) << filter_name(filter) << " " << traversal << ": " << on_cpu;
        const Comparison on_gl = compare(positions, expected, probe_on_gl(gl, h, Structure(gl, field), positions), tolerance);
        EXPECT_TRUE(on_gl) << filter_name(filter) << " " << traversal << ": " << on_gl;
      }
}

// ---- depth

TEST(Octree, ThirteenLevels) {
  const AmrHierarchy h(generate_mesh(Json::parse(
      R"({"field": {"type": "sum", "terms": [{"type": "linear", "gradient": [1, 2, 3]}, {"type": "blobs"}]},
          "levels": 13, "root": 16, "patch": 4, "refine": {"criterion": "nested", "center": [0.51, 0.43, 0.62]}})")));
  const auto positions = probe_positions(h, 30);
  for (const Filter filter : {Filter::nearest, Filter::linear_lod}) {
    const Comparison result = compare_double(h, octree_field(h, filter, {}, {.storage = Storage::r64f}), positions);
    EXPECT_TRUE(result) << filter_name(filter) << ": " << result;
  }
}

/// 15 * 2^27 finest cells along an axis, the last cell of each level refined: 28 levels in 31 bits.
AmrHierarchy deepest(const Function& f) {
  MeshBuilder mesh(Vec3i(15), std::vector<int>(27, 2));
  mesh.root(f);
  int cells = 15;
  for (int l = 1; l <= 27; ++l) {
    cells *= 2;
    mesh.patch(l, {Vec3i(cells - 2), Vec3i(cells)}, f);
  }
  return mesh.hierarchy();
}

TEST(Octree, ThirtyOneBitsOfFinestIndex) {
  // the second mesh misses a root cell beside the refined corner: ghosts lie before and behind the domain, in the 32nd bit
  const AmrHierarchy whole = deepest(waves);
  const AmrHierarchy missing = deepest([](const Vec3d& p) { return Vec3i(p * 15.0) == Vec3i(13, 14, 14) ? kNan : waves(p); });
  for (const AmrHierarchy* h : {&whole, &missing})
    for (const Filter filter : {Filter::nearest, Filter::linear_lod})
      for (const char* traversal : {"fast", "paper"}) {
        const EncodedField field = octree_field(*h, filter, {{"traversal", traversal}}, {.storage = Storage::r64f});
        const Comparison result = compare_double(*h, field, probe_positions(*h, 20));
        EXPECT_TRUE(result) << filter_name(filter) << " " << traversal << ": " << result;
      }
}

// ---- traversals: one picture

Scene askew(Sampling sampling) {
  Scene scene;
  scene.view.eye = {2.1, 1.7, 1.4};
  scene.view.at = {0.5, 0.5, 0.5};
  scene.transfer_function.extinction = {{0, 0}, {0.4, 0}, {1, 12}};
  scene.transfer_function.color = {{0, {0, 0.2, 0.9}}, {1, {0.9, 0.5, 0.1}}};
  scene.settings.sampling = sampling;
  scene.settings.step = 0.35;
  scene.settings.width = scene.settings.height = 48;
  scene.settings.skip = false;
  return scene;
}

TEST(Octree, TraversalsAndStartGridsDrawOnePicture) {
  Context& gl = context(ContextKind::egl);
  std::size_t mesh = 0;
  for (const AmrHierarchy& h :
       {nested(waves).hierarchy(), nested(waves, {4, 2}).hierarchy(), holes_and_missing(waves).hierarchy()}) {
    ++mesh;
    std::size_t way = 0;  // on GL each mesh with another filter and sampling
    for (const Filter filter : {Filter::nearest, Filter::linear_lod})
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        const bool on_gl = chosen(mesh, way++, 4);
        const EncodedField whole = octree_field(h, filter);
        WorkCounts counts;
        const Picture fast = render_on_cpu(h, whole, askew(sampling), false);
        const Picture fast_on_gl = on_gl ? draw(gl, h, whole, askew(sampling), &counts) : Picture();
        EXPECT_GT(largest(fast), 0.1);
        for (const Json& other : {Json{{"start_grid", 0}}, Json{{"start_grid", 2}}, Json{{"traversal", "paper"}}}) {
          SCOPED_TRACE(fmt::format("{} {}", other.dump(), filter_name(filter)));
          const EncodedField field = octree_field(h, filter, other);
          EXPECT_EQ(picture_hash(render_on_cpu(h, field, askew(sampling), false)), picture_hash(fast));
          if (!on_gl) continue;
          WorkCounts others;
          EXPECT_EQ(picture_hash(draw(gl, h, field, askew(sampling), &others)), picture_hash(fast_on_gl));
          EXPECT_EQ(others.samples, counts.samples) << "work is counted, not guessed";
        }
      }
  }
}

TEST(Octree, NearestIsTheDenseTexturesPictureToTheBit) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const auto hash = [&](const EncodedField& field) {
    return picture_hash(draw(context(ContextKind::egl), h, field, askew(Sampling::lattice)));
  };
  EXPECT_EQ(hash(octree_field(h, Filter::nearest)), hash(build(h, {&find_encoding("uniform"), Filter::nearest, Json::object()})));
}

// ---- what is left out

std::int64_t left_out_bytes(const EncodedField& field, const std::string& what) {
  for (const LeftOut& l : field.left_out)
    if (l.what == what) return l.bytes;
  return -1;
}

TEST(Octree, TheLodTextureIsLeftOutWhereNothingReadsIt) {
  const AmrHierarchy h = refined_corner();  // 17 nodes
  const EncodedField nearest = octree_field(h, Filter::nearest, {{"traversal", "paper"}});
  EXPECT_EQ(nearest.find("tex_octree_lod"), nullptr);
  EXPECT_EQ(left_out_bytes(nearest, "LOD texture"), 17 * 4);
  const EncodedField linear = octree_field(h, Filter::linear_lod, {{"traversal", "paper"}});
  ASSERT_NE(linear.find("tex_octree_lod"), nullptr);
  EXPECT_FALSE(linear.find("tex_octree_lod")->holds_values);
  EXPECT_EQ(left_out_bytes(linear, "LOD texture"), -1);
  // node 1 is the corner of 2^3 refined root cells, at no level: the mean of all below it
  double sum = 0;
  const MeshBuilder mesh(Vec3i(4), {2});
  for_each_cell({Vec3i(0), Vec3i(4)}, [&](const Vec3i& c) { sum += waves(mesh.centre(1, c)); });
  EXPECT_FLOAT_EQ(linear.find("tex_octree_lod")->as<float>()[1], static_cast<float>(sum / 64));
  // fast: the same averages stand in the slots of inner children
  const EncodedField fast = octree_field(h, Filter::linear_lod);
  EXPECT_EQ(left_out_bytes(fast, "LOD texture"), 17 * 4);
  EXPECT_EQ(fast.memory().duplicated, 16 * 4);
  EXPECT_FLOAT_EQ(value_in_slot(fast, 0), static_cast<float>(sum / 64));
}

TEST(Octree, ValidityIsKeptOnlyWhereCellsAreMissing) {
  EXPECT_EQ(octree_field(refined_corner(), Filter::nearest).find("octree_validity"), nullptr);
  const EncodedField field = octree_field(holes_and_missing(waves).hierarchy(), Filter::nearest);
  ASSERT_NE(field.find("octree_validity"), nullptr);
  EXPECT_EQ(field.find("octree_validity")->texels(), (field.statistics["nodes"].get<std::int64_t>() * 8 + 31) / 32);
}

// ---- pruning

template <class E>
std::string refusal(const AmrHierarchy& h, const BuildRequest& request) {
  try {
    find_encoding("octree").build(h, request);
    return "built";
  } catch (const E& e) {
    return e.what();
  }
}

/// Intervals of values for BuildOptions::invisible: all up to `last`.
std::vector<std::array<double, 2>> invisible_up_to(double last) { return {{-3e38, last}}; }

/// 8^3 cells of one level; 1 in one of them, 0 elsewhere.
AmrHierarchy one_cell(const Vec3i& cell) {
  const MeshBuilder mesh(Vec3i(8));
  const Vec3d centre = mesh.centre(0, cell);
  return MeshBuilder(Vec3i(8)).root([=](const Vec3d& p) { return p == centre ? 1.0 : 0.0; }).hierarchy();
}

TEST(Octree, PruningLeavesTheNodesThatAFilterReadsAboutWhatShows) {
  const auto nodes = [](const Vec3i& cell, Filter filter, const BuildOptions& options) {
    const EncodedField field = octree_field(one_cell(cell), filter, {{"start_grid", 0}}, options);
    EXPECT_EQ(field.statistics["nodes"].get<int>() + field.statistics["pruned_nodes"].get<int>(), 1 + 8 + 64);
    return field.statistics["nodes"].get<int>();
  };
  const BuildOptions pruned{.invisible = invisible_up_to(0.5)};
  EXPECT_EQ(nodes({0, 0, 0}, Filter::nearest, {}), 73);
  // the way to the cell: the root, a node of 4^3 cells, one of 2^3
  EXPECT_EQ(nodes({0, 0, 0}, Filter::nearest, pruned), 1 + 1 + 1);
  EXPECT_EQ(nodes({3, 3, 3}, Filter::nearest, pruned), 1 + 1 + 1);
  // cells 0 and 1 of each axis show something; they read 0 to 2: 2^3 nodes of 2^3 cells, all in one of 4^3
  EXPECT_EQ(nodes({0, 0, 0}, Filter::linear_lod, pruned), 1 + 1 + 8);
  // cells 2 to 4 do; they read 1 to 5: 3^3 nodes of 2^3 cells, in all 2^3 of 4^3
  EXPECT_EQ(nodes({3, 3, 3}, Filter::linear_lod, pruned), 1 + 8 + 27);
  EXPECT_EQ(nodes({3, 3, 3}, Filter::linear_lod, {.invisible = invisible_up_to(2)}), 1);
}

TEST(Octree, PruningStoresTheAverageInPlaceOfASubtree) {
  // root cells of 10 x, the corner of 4^3 of them refined; what shows lies at the upper end of x
  const AmrHierarchy h = MeshBuilder(Vec3i(8), {2})
                             .root([](const Vec3d& p) { return p.x; })
                             .patch(1, {Vec3i(0), Vec3i(8)}, [](const Vec3d& p) { return 10 + p.x; })
                             .hierarchy();
  // leaves of level 0 that show something: cells 4 to 7 along x; those of x = 4 read averages of the patch behind their face
  for (const char* traversal : {"fast", "paper"}) {
    const EncodedField whole = octree_field(h, Filter::linear_lod, {{"traversal", traversal}});
    const EncodedField pruned =
        octree_field(h, Filter::linear_lod, {{"traversal", traversal}}, {.invisible = {{0.0, 0.4}, {9.9, 11.0}}});
    EXPECT_GT(pruned.statistics["pruned_nodes"], 0);
    for (const double x : {0.1, 0.4, 0.9})
      for (const Vec3i cell : {Vec3i(8, 3, 3), Vec3i(8, 8, 7), Vec3i(11, 12, 1)})
        EXPECT_EQ(value_at(h, pruned, cell, {x, 0.3, 0.6}), value_at(h, whole, cell, {x, 0.3, 0.6})) << traversal;
  }
}

TEST(Octree, PruningFindsNothingInPlacesThatShowNothing) {
  const AmrHierarchy h = one_cell({3, 3, 3});
  for (const char* layout : {"wide", "rgba8"}) {
    const Storage storage = std::string_view(layout) == "wide" ? Storage::r32f : Storage::r8;
    const EncodedField field =
        octree_field(h, Filter::nearest, {{"layout", layout}}, {.storage = storage, .invisible = invisible_up_to(0.5)});
    EXPECT_EQ(value_at(h, field, {3, 3, 3}, Vec3d(0.5)), 1.0);
    EXPECT_TRUE(std::isnan(value_at(h, field, {2, 3, 3}, Vec3d(0.5))));  // a leaf beside it, in its node
    EXPECT_TRUE(std::isnan(value_at(h, field, {7, 7, 7}, Vec3d(0.5))));  // in a subtree that is gone
  }
}

/// Opaque from the middle of the field's values on.
Scene upper_half(const AmrHierarchy& h, bool skip) {
  const FieldStatistics& s = h.statistics(0);
  const double middle = 0.6 * s.min + 0.4 * s.max;
  Scene scene;
  scene.view = perspective(h.domain_upper() + (h.domain_upper() - h.domain_lower()) * Vec3d(1.2, 0.9, 0.6),
                           (h.domain_lower() + h.domain_upper()) / 2.0);
  scene.settings.sampling = Sampling::lattice;
  scene.settings.skip = skip;
  scene.settings.width = scene.settings.height = 24;
  scene.transfer_function.extinction = {{middle, 0}, {s.max, 20}};
  scene.transfer_function.color = {{s.min, {0, 0, 0.3}}, {s.max, {0.8, 0.5, 0}}};
  return scene;
}

/// Every layout and traversal, with and without a start grid, as built with and without ranges.
template <class F>
void for_each_pruned(const AmrHierarchy& h, F&& f) {
  for (const Filter filter : {Filter::nearest, Filter::linear_lod})
    for (const Json& parameters : {Json::object(), Json{{"start_grid", 0}}, Json{{"traversal", "paper"}},
                                   Json{{"layout", "rgba8"}}, Json{{"layout", "rgba8"}, {"traversal", "paper"}}})
      for (const bool skip : {true, false}) {
        SCOPED_TRACE(fmt::format("{} {} skip {}", filter_name(filter), parameters.dump(), skip));
        const Scene scene = upper_half(h, skip);
        BuildOptions options{.storage = parameters.contains("layout") ? Storage::r8 : Storage::r32f, .value_ranges = skip};
        const EncodedField whole = octree_field(h, filter, parameters, options);
        options.invisible = {{-3e38, scene.transfer_function.extinction.front().value - 1e-5}};
        f(scene, whole, octree_field(h, filter, parameters, options));
      }
}

TEST(Octree, PruningLeavesThePictureTheSameToTheBit) {
  const AmrHierarchy meshes[] = {
      AmrHierarchy(generate_mesh(Json::parse(R"({"field": "blobs_shell", "levels": 3, "root": 16, "patch": 4})"))),
      nested(waves).hierarchy(),
      nested(waves, {4, 2}).hierarchy(),
      jump_of_two(waves).hierarchy(),
      holes_and_missing(waves).hierarchy(),
      holes_and_missing(waves, 4).hierarchy()};
  for (const AmrHierarchy& h : meshes) {
    std::int64_t gone = 0;
    for_each_pruned(h, [&](const Scene& scene, const EncodedField& whole, const EncodedField& pruned) {
      const Picture picture = render_on_cpu(h, whole, scene, false);
      EXPECT_GT(largest(picture), 0.1);
      EXPECT_EQ(difference(picture, render_on_cpu(h, pruned, scene, false)), 0);
      gone += pruned.statistics["pruned_nodes"].get<std::int64_t>();
    });
    EXPECT_GT(gone, 0) << "nothing was pruned: this tests nothing";
  }
}

// Whether skipping is on or not, and whatever lies about: a hidden place is found nowhere, a visible one is what it was.
TEST(Octree, PruningLeavesWhatShowsAloneOnRandomMeshes) {
  std::int64_t gone = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    bool powers = true;
    for (int l = 0; l < h.finest_level(); ++l) powers = powers && std::has_single_bit(static_cast<unsigned>(h.ratio_to_finer(l)));
    if (!powers || h.statistics(0).min >= h.statistics(0).max) continue;
    SCOPED_TRACE(seed);
    for_each_pruned(h, [&](const Scene& scene, const EncodedField& whole, const EncodedField& pruned) {
      EXPECT_EQ(difference(render_on_cpu(h, whole, scene, false), render_on_cpu(h, pruned, scene, false)), 0);
      gone += pruned.statistics["pruned_nodes"].get<std::int64_t>();
    });
  }
  EXPECT_GT(gone, 0);
}

TEST(Octree, PruningIsRefusedWhereGradientsOrAveragesReadFurther) {
  const AmrHierarchy h = one_cell({3, 3, 3});
  const auto complaint = [&](const Json& parameters, const auto& need) {
    BuildRequest request;
    request.storage = Storage::r8;
    request.parameters = parameters;
    request.needs.invisible = invisible_up_to(0.5);
    need(request.needs);
    return refusal<UnsupportedError>(h, request);
  };
  const auto lit = [](SceneNeeds& n) { n.gradients = true; };
  EXPECT_THAT(complaint({{"layout", "rgba8"}}, lit), AllOf(HasSubstr("prune"), HasSubstr("gradients"), HasSubstr("wide")));
  EXPECT_EQ(complaint({{"layout", "rgba8"}, {"gradients", "computed"}}, lit), "built");
  EXPECT_THAT(complaint(Json::object(), [](SceneNeeds& n) { n.level_of_detail = true; }),
              AllOf(HasSubstr("prune"), HasSubstr("level of detail")));
}

// ---- refusals

TEST(Octree, RefusesWithNumbersAndWhatIsAccepted) {
  const AmrHierarchy h = refined_corner();
  BuildRequest request;
  EXPECT_THAT(refusal<UnsupportedError>(nested(waves, {3, 2}).hierarchy(), request),
              AllOf(HasSubstr("refined by 3"), HasSubstr("powers of two")));
  request.needs = {.filter = Filter::linear_lod, .filtering = Filtering::hardware};
  EXPECT_THAT(refusal<UnsupportedError>(h, request), AllOf(HasSubstr("texture unit"), HasSubstr("manual")));
  request.needs = {};
  request.parameters = {{"layout", "rgba8"}};
  EXPECT_THAT(refusal<UnsupportedError>(h, request), AllOf(HasSubstr("r32f"), HasSubstr("storage r8"), HasSubstr("wide")));
  request.parameters = {{"traversal", "paper"}, {"start_grid", 16}};
  EXPECT_THAT(refusal<UnsupportedError>(h, request), AllOf(HasSubstr("start_grid"), HasSubstr("traversal fast")));
  for (const Json& bad : {Json(-2), Json(3), Json(2048), Json("none"), Json(2.5)}) {
    request.parameters = {{"start_grid", bad}};
    EXPECT_THAT(refusal<UsageError>(h, request), AllOf(HasSubstr("start_grid"), HasSubstr("\"auto\", 0"))) << bad.dump();
  }
  request.parameters = {{"layout", "rgba"}};
  EXPECT_THAT(refusal<UsageError>(h, request), AllOf(HasSubstr("layout"), HasSubstr("\"wide\" or \"rgba8\"")));
}

TEST(Octree, MoreNodesThanATextureHoldsAreRefusedWithTheNumbers) {
  // 32^3 cells: 4681 nodes; a texture of 16 texels an axis holds 8^3 = 512 blocks of 2^3
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root(waves).hierarchy();
  BuildRequest request;
  request.parameters = {{"traversal", "paper"}};
  request.context.max_3d_texture_size = 16;
  EXPECT_THAT(refusal<UnsupportedError>(h, request),
              AllOf(HasSubstr("4681 nodes"), HasSubstr("16 texels"), HasSubstr("holds 512")));
  // buffers that are too small give way to textures
  request.parameters = Json::object();
  request.context.max_3d_texture_size = 64;
  request.context.max_buffer_bytes = 20000;
  const EncodedField field = find_encoding("octree").build(h, request);
  EXPECT_EQ(field.find("octree_values"), nullptr);
  EXPECT_NE(field.find("octree_nodes"), nullptr) << "4 * 4681 bytes fit";
  EXPECT_TRUE(compare(probe_positions(h, 50), reference_values(h, field.definition, probe_positions(h, 50)),
                      probe_on_cpu(h, field, Precision::double_precision, probe_positions(h, 50)), 1e-6));
}

// ---- gradients

constexpr const char* kGradientProbe = R"(#include "portable_glsl.h"
#include "contract.glsl"
layout(local_size_x = 64) in;
layout(std430) readonly buffer cells_block { ivec4 cells[]; };
layout(std430) writeonly buffer results_block { vec4 results[]; };
uniform int u_count;
void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= u_count) return;
  Position p;
  p.cell = cells[i].xyz;
  p.fraction = vec3(0.3, 0.6, 0.2);
  Region r;
  bool inside = locate(p, r);
  results[i] = vec4(fetch_gradient(r, region_position(r, p)), inside ? 1.0 : 0.0);
}
)";

glm::vec4 gradient_at(const AmrHierarchy& h, const EncodedField& field, const Vec3i& cell) {
  const std::vector<glm::ivec4> cells{{cell, 0}};
  return run_probe<glm::vec4>(context(ContextKind::egl), field, field_uniforms(h, field), kGradientProbe, 1,
                              {{"cells_block", cells}})
      .front();
}

TEST(Octree, GradientsKeepTheirDirection) {
  // f = a x + b y + c z has the gradient (a, b, c) in every cell of its interior; steps of pi / 254 and 2 pi / 256 err by half
  for (const Vec3d& g : {Vec3d(1, 2, 3), Vec3d(-1, 0.2, 0.1), Vec3d(0.3, -2, -1), Vec3d(0, 0, -1)}) {
    const Function f = [g](const Vec3d& p) { return glm::dot(g, p); };
    const AmrHierarchy h = MeshBuilder(Vec3i(8), {2}).root(f).patch(1, {Vec3i(0), Vec3i(8)}, f).hierarchy();
    for (const Filter filter : {Filter::nearest, Filter::linear_lod})
      for (const char* traversal : {"fast", "paper"}) {
        BuildRequest request;
        request.storage = Storage::r8;
        request.needs.filter = filter;
        request.needs.gradients = true;
        request.parameters = {{"layout", "rgba8"}, {"traversal", traversal}};
        const EncodedField field = find_encoding("octree").build(h, request);
        for (const Vec3i& cell : {Vec3i(3, 4, 5), Vec3i(12, 11, 10)}) {  // of levels 1 and 0
          const glm::vec4 got = gradient_at(h, field, cell);
          EXPECT_EQ(got.w, 1.0F);
          EXPECT_GT(glm::dot(glm::normalize(g), Vec3d(got)), std::cos(0.015)) << filter_name(filter) << " " << traversal;
        }
        // nothing else changes
        request.needs.gradients = false;
        const EncodedField without = find_encoding("octree").build(h, request);
        EXPECT_EQ(without.memory(), field.memory());
        const auto positions = probe_positions(h, 20);
        EXPECT_TRUE(compare(positions, values_of(probe_on_cpu(h, without, Precision::single_precision, positions)),
                            probe_on_cpu(h, field, Precision::single_precision, positions), 0.0));
      }
  }
}

// ---- controls: what is wrong is noticed

TEST(OctreeControl, OctantsAndAverages) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const auto positions = probe_positions(h, 1000);  // every leaf
  const auto noticed = [&](const EncodedField& field) {
    try {
      return !compare_double(h, field, positions);
    } catch (const Error&) {
      return true;
    }
  };
  const EncodedField field = octree_field(h, Filter::linear_lod, {{"traversal", "paper"}}, {.storage = Storage::r64f});
  ASSERT_FALSE(noticed(field));
  const auto with = [&](const char* name, const auto& change) {
    EncodedField copy = field;
    for (HostTexture& t : copy.textures)
      if (t.name == name) change(t);
    return copy;
  };
  EXPECT_TRUE(noticed(with("tex_octree_values", [](HostTexture& t) {  // x and y of each octant
    const Box all{Vec3i(0), t.size};
    for_each_cell({Vec3i(0), t.size / 2}, [&](const Vec3i& n) {
      for (int z = 0; z < 2; ++z)
        std::swap(t.as<double>()[all.offset(n * 2 + Vec3i(1, 0, z))], t.as<double>()[all.offset(n * 2 + Vec3i(0, 1, z))]);
    });
  })));
  EXPECT_TRUE(noticed(with("tex_octree_lod", [](HostTexture& t) {
    std::rotate(t.data.begin(), t.data.begin() + 8, t.data.end());
  }))) << "averages of the next node";
  EXPECT_TRUE(noticed(with("tex_octree_nodes", [](HostTexture& t) { t.as<std::uint32_t>()[0] ^= 1U; }))) << "a bit of the mask";
}

// ---- pruning

/// Nodes of the octree of which no value is read for a leaf that shows something, from the mesh alone. A node is the
/// parent of eight cells: of 2^depth finest cells, at a multiple of its width.
HiddenTexels hidden_nodes(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  const int reach = f.definition.filter == Filter::nearest ? 0 : 1;
  const int root = f.statistics.at("depths").get<int>();
  std::set<std::array<int, 4>> read;
  const auto read_cell = [&](int level, const Vec3i& cell) {  // it stands in its leaf's node where the leaf is wider
    const int width = std::max(h.cell_width(level), h.cell_width(h.find_leaf(cell * h.cell_width(level))->level));
    for (int depth = std::countr_zero(static_cast<unsigned>(width)) + 1; depth <= root; ++depth) {
      const Vec3i at = (cell * h.cell_width(level)) >> depth;
      if (!read.insert({depth, at.x, at.y, at.z}).second) return;
    }
  };
  for (int level = 0; level < h.level_count(); ++level)
    for_each_cell(h.domain(level), [&](const Vec3i& c) {
      const std::optional<LeafCell> leaf = h.find_leaf(c * h.cell_width(level));
      if (leaf->level != level) return;
      const Box about = intersection({c - Vec3i(reach), c + Vec3i(1 + reach)}, h.domain(level));
      ValueRange range;
      for_each_cell(about, [&](const Vec3i& i) { range.add(h.level_value(level, i, 0)); });
      if (tf.max_extinction(range.min, range.max) > 0) for_each_cell(about, [&](const Vec3i& i) { read_cell(level, i); });
    });
  const auto nodes = f.statistics.at("nodes").get<std::int64_t>();
  return {8 * (nodes - static_cast<std::int64_t>(read.size())), 8 * nodes};
}

TEST(OctreePrune, DropsNineTenthsOfTheNodesThatAreHidden) {
  for (const Filter filter : find_encoding("octree").filters())
    expect_drops_what_is_hidden(default_case(find_encoding("octree"), filter), hidden_nodes);
}

TEST(Octree, NearestVolumesHoldValuesNodesAndStartGridAndFivePercent) {
  expect_nearest_holds_little_more("octree", [](const AmrHierarchy&, const EncodedField& f) {
    // eight values and a word of children a node, an entry of the start grid
    return counted(f, "nodes") * (8 * 4 + 4) + counted(f, "start_grid_cells") * 4;
  });
}

}  // namespace
}  // namespace amrtex
