// Facts of `uniform` alone; what every encoding must do is in tests/.
#include "structures/uniform/uniform.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "structures/common/build_tools.hpp"
#include "structures/uniform/uniform_layout.h"
#include "tests/leave_out_cases.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

EncodedField uniform_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                           const BuildOptions& options = {}) {
  return build(h, {&find_encoding("uniform"), filter, parameters}, options);
}

TEST(Uniform, HasOneTexelAFinestCellAndOneRangeABlock) {
  // finest level: 80 x 8 x 8 cells of 4 bytes; 3 x 1 x 1 blocks of 32 cells
  const AmrHierarchy h = MeshBuilder({40, 4, 4}, {2}).root(waves).patch(1, {Vec3i(0), Vec3i(4)}, waves).hierarchy();
  const EncodedField field = uniform_field(h, Filter::linear_page);
  EXPECT_EQ(field.value_texels(), 80 * 8 * 8);
  EXPECT_EQ(field.find("dense_ranges")->texels(), 3);
  EXPECT_EQ(field.find("dense_validity"), nullptr);
  EXPECT_EQ(field.memory(), (MemoryByRole{80 * 8 * 8 * 4, 0, field.find("dense_ranges")->bytes(), 0}));
  EXPECT_EQ(field.build_parameters["level"], 1) << "null is the finest";
  ASSERT_EQ(field.left_out.size(), 2u);
  EXPECT_EQ(field.left_out[0].what, "validity bits");
  EXPECT_EQ(field.left_out[0].bytes, 80 * 8 * 8 / 8);
  EXPECT_EQ(field.left_out[1].what, "border layer");
  EXPECT_EQ(field.left_out[1].bytes, (82 * 10 * 10 - 80 * 8 * 8) * 4);
  EXPECT_EQ(uniform_field(h, Filter::linear_page, {}, {.storage = Storage::r8}).find("tex_dense")->bytes(), 80 * 8 * 8);
}

TEST(Uniform, ABlockHasNoMeshOnlyWhereNoFieldHasAValue) {
  // 64 x 16 x 16 finest cells, two blocks; the first field has no value in the lower one
  const AmrHierarchy h = fields_with_gaps().hierarchy();
  const EncodedField alone = uniform_field(h, Filter::nearest);
  const EncodedField both = uniform_field(h, Filter::nearest, {}, {.more_fields = {1}});
  const auto ranges = [](const EncodedField& f) { return f.find("dense_ranges")->as<std::uint32_t>(); };
  EXPECT_EQ(ranges(alone)[0], kNoRange);
  EXPECT_EQ(ranges(both)[0], kVacantRange);
  EXPECT_GT(kVacantRange << 16, kVacantRange & 0xffff0000U) << "bits of floats: the minimum is above the maximum";
  EXPECT_EQ(ranges(both)[1], ranges(alone)[1]) << "ranges are those of the first field";
  EXPECT_EQ(both.find("dense_validity")->texels(), 2 * 64 * 16 * 16 / 32);
  EXPECT_EQ(both.find("tex_dense[1]")->size, both.find("tex_dense")->size);
}

TEST(Uniform, LeavesRangesOutWhereNothingIsSkipped) {
  const AmrHierarchy h = MeshBuilder(Vec3i(33)).root(waves).hierarchy();
  const EncodedField field = uniform_field(h, Filter::nearest, {}, {.value_ranges = false});
  EXPECT_EQ(field.find("dense_ranges"), nullptr);
  EXPECT_EQ(field.memory().topology, 0);
  EXPECT_EQ(field.left_out.back().what, "value ranges");
  EXPECT_EQ(field.left_out.back().bytes, uniform_field(h, Filter::nearest).find("dense_ranges")->bytes());
}

TEST(Uniform, IsLinearPageOfAnyLevel) {
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), nested(waves, {3, 2}).hierarchy(), jump_of_two(waves).hierarchy()}) {
    const auto positions = probe_positions(h, 60);
    for (int level = 0; level < h.level_count(); ++level) {
      SCOPED_TRACE(level);
      const EncodedField field = uniform_field(h, Filter::linear_page, {{"level", level}}, {.storage = Storage::r64f});
      EXPECT_EQ(field.definition, (FilterDefinition{Filter::linear_page, 0, level}));
      EXPECT_EQ(field.find("tex_dense")->size, h.cells(level));
      const Comparison result = compare_double(h, field, positions);
      EXPECT_TRUE(result) << result;
      const EncodedField floats = uniform_field(h, Filter::linear_page, {{"level", level}});
      Context& gl = context(ContextKind::egl);
      const Comparison on_gl = compare(positions, reference_values(h, field.definition, positions),
                                       probe_on_gl(gl, h, Structure(gl, floats), positions), 1e-5 * value_range(h));
      EXPECT_TRUE(on_gl) << on_gl;
    }
  }
}

TEST(Uniform, NearestOfACoarserLevelIsThatLevelsValue) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const auto positions = probe_positions(h, 40);
  Values expected;
  for (const FinestPosition& p : positions) expected.emplace_back(h.level_value(1, p.cell / h.cell_width(1), 0));
  const EncodedField field = uniform_field(h, Filter::nearest, {{"level", 1}}, {.storage = Storage::r64f});
  const Comparison result = compare(positions, expected, probe_on_cpu(h, field, Precision::double_precision, positions), 0.0);
  EXPECT_TRUE(result) << result;
}

TEST(Uniform, OfVerticesHasOneTexelMoreAlongEachAxis) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const EncodedField field = uniform_field(h, Filter::linear_vertex);
  EXPECT_EQ(field.find("tex_dense")->size, Vec3i(17));
  EXPECT_EQ(field.memory().payload, 4 * 16 * 16 * 16);
  EXPECT_EQ(field.memory().duplicated, 4 * (17 * 17 * 17 - 16 * 16 * 16));
}

TEST(Uniform, OfVerticesHasTheBitsOfOtherEncodingsWhereLeavesAreFinest) {
  // at positions of the lattice: the same 8 floats between the same fractions; in a coarser leaf its interpolant is
  // sampled at finer vertices first
  for (const auto& h : {nested(waves).hierarchy(), nested(waves, {4, 2}).hierarchy(), jump_of_two(waves).hierarchy(),
                        holes_and_missing(waves).hierarchy()}) {
    auto positions = probe_positions(h, 60);
    for (FinestPosition& p : positions) p.fraction = (glm::floor(p.fraction * 4096.0) + 0.5) / 4096.0;
    Context& gl = context(ContextKind::egl);
    const auto probe = [&](const EncodedField& f) { return probe_on_gl(gl, h, Structure(gl, f), positions); };
    const auto dense = probe(uniform_field(h, Filter::linear_vertex));
    const auto tree = probe(build(h, {&find_encoding("kd_tree"), Filter::linear_vertex, Json::object()}));
    const Comparison result = compare(positions, values_of(tree), dense, [&](std::size_t i) {
      const auto leaf = h.find_leaf(positions[i].cell);
      return leaf && leaf->level == h.finest_level() ? 0 : 1e-6 * value_range(h);
    });
    EXPECT_TRUE(result) << result;
    EXPECT_GT(result.worst, 0) << "leaves of coarser levels were probed";
  }
}

TEST(Uniform, OfVerticesOfACoarserLevelIsTheFilterOfTheMeshCutOffThere) {
  // levels 0 and 1 of the mesh, whose refined cells hold the means of what was cut off
  const AmrHierarchy h = nested(waves).hierarchy();
  MeshBuilder cut({8, 7, 8}, {2});
  for (int level = 0; level < 2; ++level)
    for (const Patch& patch : h.patches(level)) cut.patch(level, patch.box, patch.values[0].doubles());
  const AmrHierarchy coarse = cut.hierarchy();
  const auto positions = probe_positions(h, 60);
  const HierarchyReference reference(coarse, 0, {Filter::linear_vertex});
  Values expected;
  for (const FinestPosition& p : positions)
    expected.push_back(reference.sample(FinestPosition{p.cell / 2, (Vec3d(p.cell % 2) + p.fraction) / 2.0}));
  const EncodedField field = uniform_field(h, Filter::linear_vertex, {{"level", 1}}, {.storage = Storage::r64f});
  EXPECT_EQ(field.find("tex_dense")->size, h.cells(1) + Vec3i(1));
  const Comparison result = compare(positions, expected, probe_on_cpu(h, field, Precision::double_precision, positions), 1e-12);
  EXPECT_TRUE(result) << result;
}

TEST(Uniform, KeepsValidityBitsAndABorderOnlyWhereCellsAreMissing) {
  // 16^3 cells of the finest level: 4096 bits in 128 words; a layer round them where a linear filter sees fills
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const EncodedField linear = uniform_field(h, Filter::linear_page);
  EXPECT_EQ(linear.find("dense_validity")->texels(), 128);
  EXPECT_EQ(linear.find("tex_dense")->size, Vec3i(18));
  EXPECT_EQ(linear.memory().payload, 4 * 16 * 16 * 16);
  EXPECT_EQ(linear.memory().duplicated, 4 * (18 * 18 * 18 - 16 * 16 * 16));
  const EncodedField nearest = uniform_field(h, Filter::nearest);
  EXPECT_EQ(nearest.find("tex_dense")->size, Vec3i(16));
  EXPECT_EQ(nearest.memory().duplicated, 0);
  const auto* words = nearest.find("dense_validity")->as<std::uint32_t>();
  for_each_cell(h.domain(1), [&](const Vec3i& c) {
    const std::size_t bit = h.domain(1).offset(c);
    EXPECT_EQ((words[bit / 32] >> (bit % 32)) & 1U, std::isnan(h.level_value(1, c, 0)) ? 0U : 1U);
  });
}

TEST(Uniform, FillsOutsideTheDomainNeverUseOtherFills) {
  // cell (0, 1, 0) is missing: its fill is the mean of its neighbours (1 + 3 + 5) / 3, that of (-1, 1, 0) the mean of edge
  // neighbours (1 + 5) / 2
  const AmrHierarchy h = MeshBuilder({2, 3, 1}, {}, Vec3d(0), {2, 3, 1})
                             .patch(0, {Vec3i(0), {2, 3, 1}}, std::vector<double>{1, 2, kNan, 3, 5, 4})
                             .hierarchy();
  const EncodedField field = uniform_field(h, Filter::linear_page, {}, {.storage = Storage::r64f});
  const double* texels = field.find("tex_dense")->as<double>();
  const Box box{{-1, -1, -1}, {3, 4, 2}};
  EXPECT_DOUBLE_EQ(texels[box.offset({0, 1, 0})], 3);
  EXPECT_DOUBLE_EQ(texels[box.offset({-1, 1, 0})], 3);
  EXPECT_DOUBLE_EQ(texels[box.offset({-1, 0, 0})], 1);
  EXPECT_DOUBLE_EQ(texels[box.offset({0, 1, 1})], 3) << "(1 + 3 + 5) / 3 by edges";
  EXPECT_DOUBLE_EQ(texels[box.offset({2, 1, 0})], 3);
  const Comparison result = compare_double(h, field, probe_positions(h, 6));
  EXPECT_TRUE(result) << result;
}

TEST(Uniform, RegionsAreBlocksOfTheLayoutsEdge) {
  // counted by the probes' own regions: a range changes from one block to the next
  const AmrHierarchy h = MeshBuilder({2 * AMRTEX_DENSE_BLOCK, 2, 2})
                             .root([](const Vec3d& p) { return p.x < 0.5 ? 0.25 + 0.01 * p.y : 2.0; })
                             .hierarchy();
  const EncodedField field = uniform_field(h, Filter::nearest);
  const auto* codes = field.find("dense_ranges")->as<std::uint32_t>();
  EXPECT_EQ(field.statistics["blocks"], 2);
  EXPECT_NE(codes[0], codes[1]);
}

TEST(Uniform, RefusesBadLevelsWithWhatIsAccepted) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Json& bad : {Json(3), Json(-1), Json("finest"), Json(0.5), Json(true)}) {
    try {
      uniform_field(h, Filter::nearest, {{"level", bad}});
      ADD_FAILURE() << bad.dump();
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), AllOf(HasSubstr("encoding uniform"), HasSubstr("level"), HasSubstr("accepted: "), HasSubstr("null")));
    }
  }
}

TEST(Uniform, NamesTheLimitThatItWouldPass) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4), {2, 2, 2, 2, 2}).root(waves).hierarchy();  // 128^3 at the finest level
  BuildRequest request;
  request.context.max_3d_texture_size = 127;
  try {
    find_encoding("uniform").build(h, request);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("128 x 128 x 128"), HasSubstr("at most 127")));
  }
  request.context.max_3d_texture_size = 2048;
  request.memory_limit = 1 << 20;
  try {
    find_encoding("uniform").build(h, request);
    ADD_FAILURE();
  } catch (const BudgetError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("1048576 bytes"), HasSubstr(std::to_string(4 * 128 * 128 * 128 + 4 * 64))));
  }
  // 1024^3 cells of 4 bytes, for which nothing is made
  const AmrHierarchy large = MeshBuilder(Vec3i(16), std::vector<int>(6, 2)).root(waves).hierarchy();
  request.memory_limit = std::numeric_limits<std::int64_t>::max();
  request.context.max_texture_bytes = std::int64_t{1} << 31;
  const std::int64_t before = peak_bytes();
  try {
    find_encoding("uniform").build(large, request);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("1024 x 1024 x 1024 texels (4294967296 bytes)"), HasSubstr("and 2147483648 bytes")));
  }
  EXPECT_LE(peak_bytes() - before, 16 << 20);
  // (4 * 2^24)^3 cells of 4 bytes: 2^80, more than 64 bits count
  const AmrHierarchy deep = MeshBuilder(Vec3i(4), std::vector<int>(24, 2)).root(waves).hierarchy();
  try {
    uniform_field(deep, Filter::nearest);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), HasSubstr("about 1.2e+24 bytes"));
  }
}

TEST(Uniform, NearestVolumesHoldCellsAndRangesAndFivePercent) {
  expect_nearest_holds_little_more("uniform", [](const AmrHierarchy& h, const EncodedField& f) {
    return h.domain(h.finest_level()).cells() * 4 + counted(f, "blocks") * 4;
  });
}

}  // namespace
}  // namespace amrtex
