// Rays that leap over hidden blocks: the grid of ranges, and pictures with and without.
#include <gtest/gtest.h>

#include "bench/measure/scene_data.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/bindings/leap_bindings.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/generators/random_mesh.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

std::vector<AmrHierarchy> meshes() {
  std::vector<AmrHierarchy> all;
  all.push_back(nested(waves, {3, 2}).hierarchy());
  for (const std::uint64_t seed : {41, 42, 43}) {
    RandomMeshOptions options;
    options.max_finest_cells = 1 << 15;
    all.emplace_back(random_mesh(seed, options));
  }
  return all;
}

TEST(LeapGrid, HasTheSmallestBlocksOfWhichThereAreFewEnough) {
  const std::int64_t most = 64 * 64 * 64;
  EXPECT_EQ(LeapGrid::over({512, 512, 512}, most).shift, 3);
  EXPECT_EQ(LeapGrid::over({512, 512, 512}, most).blocks, Vec3i(64));
  EXPECT_EQ(LeapGrid::over({64, 64, 65}, most).shift, 1);
  EXPECT_EQ(LeapGrid::over({5, 3, 2}, most).blocks, Vec3i(5, 3, 2));
  EXPECT_EQ(LeapGrid::over({5, 3, 2}, 1).blocks, Vec3i(1));
  EXPECT_TRUE(LeapGrid::over({(1 << 30) + 1, 1, 1}, most).empty());
}

TEST(LeapGrid, HasABlockForSixteenLeafCellsAtMost) {
  for (const AmrHierarchy& h : meshes()) {
    const LeapGrid grid = LeapGrid::over(h);
    EXPECT_LE(16 * std::ssize(grid.ranges), std::max<std::int64_t>(16, h.leaf_cells()));
    EXPECT_GT(8 * 16 * std::ssize(grid.ranges), h.leaf_cells()) << "half of the edge would be allowed";
  }
}

TEST(LeapGrid, ABlockHasTheRangeOfAllThatReachesIntoIt) {
  LeapGrid grid = LeapGrid::over({128, 128, 128}, 64 * 64 * 64);
  ASSERT_EQ(grid.shift, 1);
  const auto code = [](double min, double max) { return encode_range({min, max}, 0, Storage::r32f, {}); };
  grid.cover({Vec3i(0), Vec3i(3)}, code(1, 2));
  grid.cover({Vec3i(3, 0, 0), Vec3i(4)}, code(0.5, 1));
  grid.cover({Vec3i(4), Vec3i(5)}, kNoRange);
  EXPECT_EQ(grid.ranges[0], code(1, 2));
  EXPECT_EQ(grid.ranges[1], code(0.5, 2));
  EXPECT_EQ(grid.ranges[2], kNoRange);
  EXPECT_EQ(grid.ranges[64], code(1, 2));
}

/// What lies below the middle of the values is hidden.
Scene half_hidden(const AmrHierarchy& h, Sampling sampling) {
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  Scene scene = small_scene(Mode::dvr, perspective(middle + Vec3d(1.3, -2.1, 0.9), middle), sampling, 24);
  const FieldStatistics& s = h.statistics(0);
  scene.transfer_function.extinction = {{s.min, 0}, {(s.min + s.max) * 0.5, 0}, {s.max, 30}};
  scene.transfer_function.color = {{s.min, {1, 0.2, 0}}, {s.max, {0, 0.5, 1}}};
  scene.settings.skip = true;
  scene.settings.step = 0.5;
  return scene;
}

Scene without_leaps(Scene scene) {
  scene.settings.leap = Leap::off;
  return scene;
}

// Samples of a lattice belong to the ray: what is hidden adds nothing, one region or many at a time.
TEST(Leaps, ChangeNoBitOfALattice) {
  for (const AmrHierarchy& h : meshes()) {
    const Scene scene = half_hidden(h, Sampling::lattice);
    GlPairs(2).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
      if (!accepted(h, c)) return;
      const EncodedField field = build(h, c);
      const Picture leaping = draw_on(gl, h, field, scene);
      EXPECT_EQ(leaping.values, draw_on(gl, h, field, without_leaps(scene)).values);
    });
  }
}

// A region is entered at its own face, whatever lies before it; the other two coordinates are rounded once.
TEST(Leaps, ChangeARegionsIntervalsByRoundingAlone) {
  for (const AmrHierarchy& h : meshes()) {
    const Scene scene = half_hidden(h, Sampling::adaptive);
    for_each_case([&](const EncodingCase& c) {
      if (!accepted(h, c)) return;
      const EncodedField field = build(h, c);
      EXPECT_LE(difference(draw_on(false, h, field, scene), draw_on(false, h, field, without_leaps(scene))), 1e-4);
    });
  }
}

TEST(Leaps, PassFewerRegionsAndTakeTheSameSamples) {
  // one small spot that can be seen in a large empty domain
  const auto spot = [](const Vec3d& p) { return glm::length(p - Vec3d(0.2)) < 0.1 ? 1.0 : 0.0; };
  const AmrHierarchy h = nested(spot, {2, 2}).hierarchy();
  Scene scene = half_hidden(h, Sampling::adaptive);
  GlPairs(2).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    WorkCounts leaping, passing;
    draw(context(ContextKind::egl), h, field, scene, &leaping);
    draw(context(ContextKind::egl), h, field, without_leaps(scene), &passing);
    EXPECT_EQ(leaping.samples, passing.samples);
    EXPECT_LE(leaping.regions, passing.regions + 2 * passing.rays) << "a leap ends beside what can be seen";
  });
}

// A ray of this picture meets the face of a leap and that of a region at one place, as far as floats tell. Rounding puts it back behind the
// one face whenever it passes the other: once leaps reached behind a ray, it went to and fro for ever.
TEST(Leaps, LetNoRayGoToAndFro) {
  const Experiment experiment = parse_scene(R"({
    "name": "edge", "encodings": [{"name": "exabricks"}], "filters": "basis",
    "datasets": [{"generate": {"field": {"type": "blobs_shell", "count": 16, "seed": 7}, "levels": 4, "root": 64, "patch": 8,
                               "refine": {"criterion": "gradient", "threshold": 0.12}}}],
    "render": {"step": 0.5, "early_end": 0.98, "width": 256, "height": 256},
    "views": {"eye": [0.52, 0.515, 0.51], "at": [0.5, 0.5, 0.5], "fov_y": 60},
    "transfer_function": {
      "extinction": [[0, 0], [0.1, 0], [0.4, 8], [0.8, 30], [1.2, 300], [1.6, 3000], [2.0, 10000]],
      "color": [[0, 0, 0, 0.3], [0.25, 0.1, 0.4, 1], [0.5, 0.9, 0.9, 0.9], [0.8, 1, 0.5, 0.1], [2.0, 0.9, 0.9, 0.1]]}})",
                                            "edge.json", {});
  const AmrHierarchy h = load_dataset(experiment, experiment.datasets.front());
  const Scene scene = amrtex::scene_of(experiment, experiment.renders.front());
  const EncodedField field = build(h, {&find_encoding("exabricks"), Filter::basis, {}});
  const Picture passing = draw(context(ContextKind::egl), h, field, without_leaps(scene));
  EXPECT_LE(difference(draw(context(ContextKind::egl), h, field, scene), passing), 1e-4);
}

int leaps_define(const AmrHierarchy& h, const EncodedField& field, const Scene& scene) {
  const SceneBindings b = bind_scene(h, field, scene);
  for (const auto& [name, value] : b.defines)
    if (name == "AMRTEX_LEAPS") return value;
  return -1;
}

TEST(Leaps, AreLeftOutWhereNothingIsHiddenAndWhereTheRayDecides) {
  const AmrHierarchy h = nested(waves, {2, 2}).hierarchy();
  for_each_encoding([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    Scene scene = half_hidden(h, Sampling::adaptive);
    EXPECT_EQ(leaps_define(h, field, without_leaps(scene)), 0);
    Scene all_seen = scene;
    all_seen.transfer_function.extinction = {{0, 1}};
    EXPECT_EQ(leaps_define(h, field, all_seen), 0);
    Scene all_hidden = scene;
    all_hidden.transfer_function.extinction = {{0, 0}};
    EXPECT_EQ(leaps_define(h, field, all_hidden), field.leaps.empty() ? 0 : 2);
    for (const Mode mode : {Mode::mip, Mode::iso}) {
      Scene other = all_hidden;
      other.settings.mode = mode;
      other.settings.isosurfaces.values = {0.5};
      EXPECT_EQ(leaps_define(h, field, other), 0);
    }
  });
}

}  // namespace
}  // namespace amrtex
