// The mirror image of what is drawn: closed forms, the same picture as of data that hold both halves, the double reference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/consumers/box_consumer.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 10;
constexpr std::array kSamplings{Sampling::lattice, Sampling::adaptive};
constexpr std::array kModes{Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso};

Scene mirror_scene(Mode mode, Sampling sampling, const std::optional<Mirror>& mirror, const View& view) {
  Scene scene = small_scene(mode, view, sampling, kPixels);
  scene.settings.step = 0.6;
  scene.settings.mirror = mirror;
  scene.transfer_function = peaks();
  scene.transfer_function.length_unit = TransferFunction::LengthUnit::world;
  scene.settings.isosurfaces.values = {0.45, 0.6};
  scene.settings.isosurfaces.opacity = {0.5, 0.7};
  return scene;
}

std::vector<Mirror> all_faces() {
  std::vector<Mirror> faces;
  for (const int axis : {0, 1, 2})
    for (const bool upper : {false, true}) faces.push_back({axis, upper});
  return faces;
}

/// Both halves of [0, 1]^3 and its image.
std::array<Vec3d, 2> both(const Mirror& m) {
  std::array<Vec3d, 2> box{Vec3d(0), Vec3d(1)};
  (m.upper ? box[1] : box[0])[m.axis] += m.upper ? 1 : -1;
  return box;
}

TEST(Mirror, OfAConstantMediumHasTheChordThroughBothHalves) {
  // alpha = 1 - exp(-k L), L the chord of the box twice as long
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mirror& face : all_faces())
      for (const Sampling sampling : kSamplings)
        for (const bool from_inside : {false, true}) {
          const auto [lower, upper] = both(face);
          View view = perspective((lower + upper) * 0.5 + Vec3d(2.1, -1.7, 1.4), (lower + upper) * 0.5);
          if (from_inside) view.eye = lower + (upper - lower) * Vec3d(0.2, 0.3, 0.8);
          Scene scene = mirror_scene(Mode::dvr, sampling, face, view);
          scene.transfer_function = constant_light(1.5);
          const Picture picture = render_on_cpu(h, field, scene, true);
          double worst = 0;
          for (int y = 0; y < kPixels; ++y)
            for (int x = 0; x < kPixels; ++x)
              worst = std::max(worst, std::abs(picture.pixel(x, y)[3] - (1 - std::exp(-1.5 * chord(scene, x, y, lower, upper)))));
          EXPECT_LE(worst, 1e-12) << mirror_name(face);
        }
  });
}

TEST(Mirror, AlongAnAxisDoublesTheLineIntegral) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mirror& face : all_faces()) {
      Vec3d along(0);
      along[face.axis] = 1;
      Scene scene = mirror_scene(Mode::projection, Sampling::adaptive, std::nullopt, orthographic(Vec3d(0.5), along, 0.9));
      Picture once = render_on_cpu(h, field, scene, true);
      scene.settings.mirror = face;
      for (double& v : once.values) v *= 2;
      EXPECT_LE(difference(render_on_cpu(h, field, scene, true), once), 1e-9);
      EXPECT_GT(largest(once), 0.5);
    }
  });
}

/// f(2 - x) = f(x).
double symmetric(const Vec3d& p) { return waves({std::min(p.x, 2 - p.x), p.y, p.z}); }

TEST(Mirror, ShowsWhatDataOfBothHalvesShow) {
  // linear_page would need pages that are mirrored too; basis weighs the hats of both halves at the mirror
  const Box patch{{8, 4, 4}, {16, 12, 14}};
  const Box image{{16, 4, 4}, {24, 12, 14}};
  const AmrHierarchy half = MeshBuilder(Vec3i(8), {2}).root(symmetric).patch(1, patch, symmetric).hierarchy();
  const AmrHierarchy whole = MeshBuilder({16, 8, 8}, {2}, Vec3d(0), {2, 1, 1})
                                 .root(symmetric)
                                 .patch(1, patch, symmetric)
                                 .patch(1, image, symmetric)
                                 .hierarchy();
  const View view = perspective({2.9, -1.9, 1.6}, {1, 0.5, 0.5});
  for (const Filter filter : {Filter::nearest, Filter::linear_lod, Filter::linear_vertex})
    for (const Mode mode : kModes) {
      SCOPED_TRACE(fmt::format("{} {}", filter_name(filter), mode_name(mode)));
      const auto drawn = [&](const AmrHierarchy& h, const std::optional<Mirror>& mirror) {
        Scene scene = mirror_scene(mode, Sampling::adaptive, mirror, view);
        scene.settings.isosurfaces.shading = Shading::none;  // a gradient within a cell of the mirror is one-sided
        return HierarchyReference(h, 0, {filter}).render(scene, 0.5);
      };
      const Picture mirrored = drawn(half, Mirror{0, true});
      const Picture expected = drawn(whole, std::nullopt);
      // pieces end on the mirror, and parts of the integral with them
      EXPECT_LE(difference(mirrored, expected), 1e-5 * std::max(1.0, largest(expected)));
      EXPECT_GT(largest(expected), 0.1);
    }
}

TEST(Mirror, ConvergesToTheReferenceInEveryModeAndFilter) {
  const View view = perspective({-1.4, -1.7, 1.8}, {0.1, 0.5, 0.5});
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for_each_filter([&](const EncodingCase& c) {
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      for (const Mode mode : kModes)
        for (const Sampling sampling : kSamplings) {
          SCOPED_TRACE(mode_name(mode));
          Scene scene = mirror_scene(mode, sampling, Mirror{0, false}, view);
          scene.settings.isosurfaces.shading = Shading::none;
          scene.settings.step = 0.05;
          const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
          const Picture mirrored = render_on_cpu(h, field, scene, true);
          EXPECT_LE(rms_difference(mirrored, reference), scene.settings.draws_surfaces() ? 4e-2 : 2e-2);
          scene.settings.mirror.reset();
          EXPECT_GT(rms_difference(mirrored, render_on_cpu(h, field, scene, true)), 5e-2) << "control: without it";
        }
    });
}

TEST(Mirror, TurnsDepthsAndNormalsRoundWithTheSurface) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const View view = perspective({-1.4, -1.7, 1.8}, {0.1, 0.5, 0.5});
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    for (const Output output : {Output::depth, Output::normal}) {
      Scene scene = mirror_scene(Mode::iso, Sampling::lattice, Mirror{0, false}, view);
      scene.settings.step = 0.05;
      scene.settings.isosurfaces.output = output;
      const Picture picture = render_on_cpu(h, field, scene, true);
      const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
      // structures with regions finer than leaves take gradients over their own cells: normals are theirs, but turned the same
      // way
      const double bound = output == Output::depth ? 2e-2 : 0.4;
      int off = 0;
      for (std::size_t i = 0; i < picture.values.size(); ++i)
        off += std::abs(picture.values[i] - reference.values[i]) > bound ? 1 : 0;
      EXPECT_LE(off, static_cast<int>(picture.values.size() / 12)) << output_name(output);
    }
  });
}

TEST(Mirror, IsTheSameOnGl) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const View view = perspective({2.9, -1.9, 1.6}, {1, 0.5, 0.5});
  GlPairs(2).for_each([&](const EncodingCase& c, std::size_t pair) {  // each mode with another encoding
    const EncodedField field = build(h, c);
    for (const Mode mode : {Mode::dvr, Mode::dvr_iso}) {
      if (!in_turn(mode == Mode::dvr ? 0 : 1, pair, 2)) continue;
      const Scene scene = mirror_scene(mode, mode == Mode::dvr ? Sampling::lattice : Sampling::adaptive, Mirror{0, true}, view);
      EXPECT_LE(rms_difference(draw(context(ContextKind::egl), h, field, scene), render_on_cpu(h, field, scene, true)),
                !interpolating(c) || mode == Mode::dvr_iso ? 2e-2 : 1e-4);
    }
  });
}

TEST(Mirror, WithAPlaneOnItShowsTheFieldAlone) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const View view = perspective({2.9, -1.9, 1.6}, {1, 0.5, 0.5});
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    Scene scene = mirror_scene(Mode::dvr, Sampling::lattice, std::nullopt, view);
    const Picture alone = render_on_cpu(h, field, scene, true);
    scene.settings.mirror = Mirror{0, true};
    scene.settings.clip_planes = {{{-1, 0, 0}, -1}};
    EXPECT_LE(rms_difference(render_on_cpu(h, field, scene, true), alone), interpolating(c) ? 1e-9 : 1e-2);
  });
}

TEST(Mirror, IsLeftOutAndRefusedByName) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front(), {.draw_boxes = true});
  Scene scene = mirror_scene(Mode::dvr, Sampling::lattice, std::nullopt, perspective({2.9, -1.9, 1.6}, {1, 0.5, 0.5}));
  const auto define = [&] {
    for (const auto& [name, value] : bind_scene(h, field, scene).defines)
      if (name == "AMRTEX_MIRROR") return value;
    return -1;
  };
  EXPECT_EQ(define(), 0);
  scene.settings.mirror = Mirror{2, false};
  EXPECT_EQ(define(), 5);
  scene.settings.consumer = ConsumerKind::multipass;
  const Structure structure(context(ContextKind::egl), field);
  EXPECT_THROW(BoxConsumer(context(ContextKind::egl), h, structure, scene), UnsupportedError);
  scene.settings.point_light = PointLight{};
  try {
    bind_scene(h, field, scene);
    ADD_FAILURE();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("'mirror'"), HasSubstr("'point_light'"), HasSubstr("one of both")));
  }
  EXPECT_THROW(HierarchyReference(h, 0, {}).render(scene, 1), UsageError);
  EXPECT_THROW(parse_mirror("x"), UsageError);
  for (const Mirror& face : all_faces()) EXPECT_EQ(mirror_name(parse_mirror(mirror_name(face))), mirror_name(face));
}

}  // namespace
}  // namespace amrtex
