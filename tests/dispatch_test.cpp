// Rays started by fragments and by a compute shader (`render.dispatch`) give one picture and one count of work.
#include <gtest/gtest.h>

#include "renderers/scene/triangle_mesh.hpp"
#include "tests/pictures.hpp"

namespace amrtex::test {
namespace {

Vec3d size_of(const AmrHierarchy& h) { return h.domain_upper() - h.domain_lower(); }

/// Odd sizes: the last tiles of 8 x 8 pixels hang over the picture.
Scene scene_of(const AmrHierarchy& h, Mode mode, Sampling sampling, Dispatch dispatch) {
  const Vec3d middle = h.domain_lower() + size_of(h) * 0.5;
  Scene scene = small_scene(mode, perspective(h.domain_lower() + size_of(h) * Vec3d(1.9, 2.3, 1.7), middle), sampling, 19);
  scene.transfer_function = peaks();
  scene.settings.height = 13;
  scene.settings.dispatch = dispatch;
  if (scene.settings.draws_surfaces()) scene.settings.isosurfaces.values = {0.1, 0.4};
  return scene;
}

struct Drawn {
  Picture picture;
  WorkCounts work;
};

Drawn drawn(const AmrHierarchy& h, const EncodedField& field, const Scene& scene) {
  Drawn result;
  result.picture = draw(context(ContextKind::egl), h, field, scene, &result.work);
  return result;
}

void expect_same_work(const WorkCounts& a, const WorkCounts& b) {
  EXPECT_EQ(a.rays, b.rays);
  EXPECT_EQ(a.samples, b.samples);
  EXPECT_EQ(a.regions, b.regions);
  EXPECT_EQ(a.regions_skipped, b.regions_skipped);
}

// Positions, indices and compositing are `precise`, and manual filters are sums of them: the two kinds of shader have the same bits.
TEST(Dispatch, ComputeHasTheBitsOfFragmentsOnTheLattice) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c, std::size_t turn) {
    const EncodedField field = build(h, c);
    const std::array modes{Mode::dvr, Mode::projection, Mode::mip};
    const Mode mode = modes[turn % modes.size()];
    const Drawn fragments = drawn(h, field, scene_of(h, mode, Sampling::lattice, Dispatch::fragment));
    const Drawn tiles = drawn(h, field, scene_of(h, mode, Sampling::lattice, Dispatch::compute));
    EXPECT_EQ(tiles.picture.values, fragments.picture.values);
    EXPECT_GT(largest(fragments.picture), 0.01);
    expect_same_work(tiles.work, fragments.work);
  });
}

TEST(Dispatch, ComputeHasTheBitsOfFragmentsUnderNearest) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2, [](const EncodingCase& c) { return c.filter == Filter::nearest; }).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const Drawn fragments = drawn(h, field, scene_of(h, Mode::dvr, Sampling::lattice, Dispatch::fragment));
    const Drawn tiles = drawn(h, field, scene_of(h, Mode::dvr, Sampling::lattice, Dispatch::compute));
    EXPECT_EQ(tiles.picture.values, fragments.picture.values);
    expect_same_work(tiles.work, fragments.work);
  });
}

// The texture unit's filter is one for all stages; steps that follow from roots and quotients may round differently.
TEST(Dispatch, ComputeIsWithinRoundingOfFragmentsElsewhere) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1, [](const EncodingCase& c) { return c.filterings().size() > 1; }).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.filtering = Filtering::hardware});
    for (const Mode mode : {Mode::dvr, Mode::dvr_iso}) {
      const Picture fragments =
          draw(context(ContextKind::egl), h, field, scene_of(h, mode, Sampling::adaptive, Dispatch::fragment));
      const Picture tiles = draw(context(ContextKind::egl), h, field, scene_of(h, mode, Sampling::adaptive, Dispatch::compute));
      EXPECT_LE(difference(tiles, fragments), 1e-5);
    }
  });
}

// A group of tiles reads the same buffers: with objects of triangles in the scene the entry takes their buffer as well.
TEST(Dispatch, TrianglesEndRaysOfComputeShadersToo) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const Vec3d low = h.domain_lower() + size_of(h) * 0.25;
  const Vec3d high = h.domain_lower() + size_of(h) * 0.75;
  TriangleObject object;
  object.mesh = std::make_shared<const TriangleMesh>(
      std::vector<Triangle>{{{Vec3d(low.x, low.y, high.z), Vec3d(high.x, low.y, high.z), Vec3d(high.x, high.y, low.z)}}});
  GlPairs(1).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    std::array<Picture, 2> pictures;
    for (const Dispatch dispatch : {Dispatch::fragment, Dispatch::compute}) {
      Scene scene = scene_of(h, Mode::dvr, Sampling::lattice, dispatch);
      scene.settings.triangles = {object};
      pictures[dispatch == Dispatch::compute ? 1 : 0] = draw(context(ContextKind::egl), h, field, scene);
    }
    EXPECT_EQ(pictures[1].values, pictures[0].values);
  });
}

}  // namespace
}  // namespace amrtex::test
