// Meshes of many levels, and domains that are wide and nearly empty: they cost what they hold, in every encoding.
#include <gtest/gtest.h>

#include "tests/pictures.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr std::int64_t kMostBytes = std::int64_t{50} << 20;

/// Each case holds the field within kMostBytes, or refuses the mesh by its bounds.
void expect_little_or_refused(const AmrHierarchy& h, std::size_t leaves_a_level) {
  const auto positions = probe_positions(h, leaves_a_level);
  int held = 0;
  for_each_case([&](const EncodingCase& c) {
    const std::int64_t before = peak_bytes();
    try {
      const EncodedField doubles = build(h, c, {.storage = Storage::r64f});
      const EncodedField field = build(h, c);
      EXPECT_LE(field.memory().total(), kMostBytes);
      EXPECT_LE(field.host_peak_bytes, kMostBytes);
      EXPECT_LE(peak_bytes() - before, 4 * kMostBytes) << "two fields, and what threads need";
      const Comparison result = compare_double(h, doubles, positions);
      EXPECT_TRUE(result) << result;
      ++held;
    } catch (const UnsupportedError&) {
      EXPECT_LE(peak_bytes() - before, kMostBytes) << "refused before anything is made";
    }
  });
  EXPECT_GT(held, 0);
}

TEST(DeepMesh, OfTwentyLevelsCostsWhatItHolds) {
  const AmrHierarchy h = deep_corner(20);
  ASSERT_EQ(h.leaf_cells(), 1128);
  expect_little_or_refused(h, 4);
}

TEST(DeepMesh, OfTwoCellsInAWideDomainCostsWhatItHolds) { expect_little_or_refused(two_cells_far_apart(), 8); }

TEST(DeepMesh, IsDrawnAsTheReferenceDrawsIt) {
  // the finest cells are 2^-14 of the domain wide; a picture of them from nearby, another of the whole
  const AmrHierarchy h = deep_corner(13);
  for_each_filter([&](const EncodingCase& c) {
    try {
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      for (const double width : {1.5, 0x1p-11}) {
        Scene scene;
        scene.view = orthographic(Vec3d(0.5), {1, 0.4, -0.3}, width);
        scene.settings.mode = Mode::projection;
        scene.settings.sampling = Sampling::adaptive;
        scene.settings.step = 0.0625;
        scene.settings.width = scene.settings.height = 8;
        const Picture drawn = render_on_cpu(h, field, scene, true);
        const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.0625);
        for (std::size_t i = 0; i < drawn.values.size(); ++i)
          EXPECT_NEAR(drawn.values[i], reference.values[i], 0.02 * largest(reference)) << width;
      }
    } catch (const UnsupportedError&) {
    }
  });
}

}  // namespace
}  // namespace amrtex
