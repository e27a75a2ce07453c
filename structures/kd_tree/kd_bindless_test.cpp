// Bindless: a texture a brick.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>

#include "renderers/consumers/raycaster.hpp"
#include "structures/common/texture_handles.hpp"
#include "structures/kd_tree/kd_partition.hpp"
#include "structures/kd_tree/kd_test_tools.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

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
  std::size_t mesh = 0;
  for (const AmrHierarchy& h : {many_subgrids(), holes_and_missing(waves, 3).hierarchy()}) {
    const Scene scene = oblique_scene(h, 80, 60);
    std::size_t way = 2 * mesh++;  // a third of the ways on either mesh: each filter, and hardware filtering of some
    for (const Filter filter : kd_filters())
      for (const Filtering filtering : {Filtering::manual, Filtering::hardware}) {
        if (!chosen(way++, 0, 3)) continue;
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
