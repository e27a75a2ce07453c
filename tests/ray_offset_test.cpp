// A random offset of each ray's intervals: closed forms that it may not change, the same numbers everywhere, and what it is for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/consumers/box_consumer.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 12;
constexpr std::array kSamplings{Sampling::lattice, Sampling::adaptive};

Scene offset_scene(Mode mode, Sampling sampling, std::optional<std::uint32_t> seed, double step = 1.5) {
  Scene scene = small_scene(mode, perspective({2.1, -1.2, 1.7}, Vec3d(0.5)), sampling, kPixels);
  scene.settings.step = step;
  scene.settings.ray_offset = seed;
  scene.transfer_function = peaks();
  scene.settings.isosurfaces.values = {0.45, 0.6};
  scene.settings.isosurfaces.opacity = {0.5, 0.7};
  return scene;
}

TEST(RayOffset, LosesNoLengthOfARay) {
  // a medium of one extinction: the intervals' lengths add up to the chord, wherever they are divided
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const double k = 3;
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Sampling sampling : kSamplings)
      for (const double step : {0.7, 90.0})  // of many intervals, and longer than a ray
        for (const std::vector<ClipPlane>& planes : {std::vector<ClipPlane>{}, {ClipPlane{{1, 0, 0}, 0.5}}}) {
          Scene scene = offset_scene(Mode::dvr, sampling, 7, step);
          scene.transfer_function = constant_light(k);
          scene.settings.clip_planes = planes;
          const Picture picture = render_on_cpu(h, field, scene, true);
          double worst = 0;
          for (int y = 0; y < kPixels; ++y)
            for (int x = 0; x < kPixels; ++x) {
              const double length = chord(scene, x, y, {planes.empty() ? 0 : 0.5, 0, 0}, Vec3d(1));
              worst = std::max(worst, std::abs(picture.pixel(x, y)[3] - (1 - std::exp(-k * length))));
            }
          EXPECT_LE(worst, 1e-12);
        }
  });
}

TEST(RayOffset, IsTheSameNumberInDoubleAndOnGl) {
  // the number is computed before the encoding's text is entered
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Sampling sampling : kSamplings) {
      const Scene scene = offset_scene(Mode::projection, sampling, 3);
      const Picture on_gl = draw(context(ContextKind::egl), h, field, scene);
      EXPECT_EQ(on_gl.values, draw(context(ContextKind::egl), h, field, scene).values);
      const Picture in_double = render_on_cpu(h, field, scene, true);
      const double bound = interpolating(c) ? 1e-4 : 2e-2;  // nearest: a sample on a face may fall to either side
      EXPECT_LE(rms_difference(on_gl, in_double), bound);
      if (interpolating(c)) {
        // another seed is another picture, by far more than the same seed's rounding
        const Picture other = render_on_cpu(h, field, offset_scene(Mode::projection, sampling, 4), true);
        EXPECT_GT(rms_difference(in_double, other), 20 * rms_difference(on_gl, in_double));
      }
    }
  });
}

TEST(RayOffset, GivesEncodingsOfOneFilterTheSameBitsOnTheLattice) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Mode mode : {Mode::dvr, Mode::iso}) {
    std::map<Filter, Picture> first;
    for_each_filter([&](const EncodingCase& c) {
      if (c.filter == Filter::linear_page) return;  // each page size is a field of its own
      const Picture picture = render_on_cpu(h, build(h, c), offset_scene(mode, Sampling::lattice, 11), false);
      const auto [it, is_first] = first.emplace(c.filter, picture);
      const bool to_the_bit = c.filter == Filter::nearest || c.filter == Filter::linear_lod;  // others keep values of their own
      if (mode == Mode::dvr && to_the_bit) {
        EXPECT_EQ(picture.values, it->second.values);
      } else {
        EXPECT_LE(rms_difference(picture, it->second), 2e-2);  // normals are of each encoding's own
      }
    });
  }
}

TEST(RayOffset, IsTheSameBoxByBox) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Context& gl = context(ContextKind::egl);
  int drawn = 0;
  GlPairs(2, [&](const EncodingCase& c) { return interpolating(c) && gives_boxes(h, c); }).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.draw_boxes = true});
    for (const Sampling sampling : kSamplings) {
      Scene scene = offset_scene(Mode::dvr, sampling, 5);
      const Picture by_ray = draw(gl, h, field, scene);
      scene.settings.consumer = ConsumerKind::multipass;
      const Structure structure(gl, field);
      BoxConsumer consumer(gl, h, structure, scene);
      consumer.draw();
      EXPECT_LE(difference(consumer.read(), by_ray), 2e-5);
      ++drawn;
    }
    Scene slices = offset_scene(Mode::dvr, Sampling::lattice, 5);
    slices.settings.consumer = ConsumerKind::slices;
    const Structure structure(gl, field);
    EXPECT_THROW(BoxConsumer(gl, h, structure, slices), UnsupportedError);
  });
  EXPECT_GT(drawn, 3);
}

TEST(RayOffset, TurnsBandsIntoNoiseThatVanishesInTheMean) {
  // a shell a cell thick, intervals of eight cells: whether it is met depends on how far from the entry it lies, so neighbouring
  // rays are wrong together. Over all offsets the mean is the integral; over 24 seeds less than half of one picture's error is
  // left
  const AmrHierarchy h = MeshBuilder(Vec3i(32))
                             .root([](const Vec3d& p) {
                               const double d = (glm::length(p - Vec3d(0.5)) - 0.3) / 0.03;
                               return std::exp(-d * d);
                             })
                             .hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    const auto drawn = [&](std::optional<std::uint32_t> seed) {
      return render_on_cpu(h, field, offset_scene(Mode::projection, Sampling::lattice, seed, 8), true);
    };
    const Picture reference =
        HierarchyReference(h, 0, field.definition).render(offset_scene(Mode::projection, Sampling::lattice, {}), 0.5);
    Picture mean = drawn(0);
    double one = rms_difference(mean, reference);
    constexpr int kSeeds = 24;
    for (std::uint32_t seed = 1; seed < kSeeds; ++seed) {
      const Picture picture = drawn(seed);
      one = std::min(one, rms_difference(picture, reference));
      for (std::size_t i = 0; i < mean.values.size(); ++i) mean.values[i] += picture.values[i];
    }
    for (double& v : mean.values) v /= kSeeds;
    EXPECT_LT(rms_difference(mean, reference), 0.5 * one);
    EXPECT_LT(rms_difference(mean, reference), 0.5 * rms_difference(drawn(std::nullopt), reference));
  });
}

TEST(RayOffset, ConvergesToTheReferenceInEveryMode) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso})
      for (const Sampling sampling : kSamplings) {
        SCOPED_TRACE(mode_name(mode));
        Scene scene = offset_scene(mode, sampling, 2, 0.05);
        scene.settings.isosurfaces.shading = Shading::none;
        const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
        EXPECT_LE(rms_difference(render_on_cpu(h, field, scene, true), reference), scene.settings.draws_surfaces() ? 4e-2 : 1e-2);
      }
  });
}

TEST(RayOffset, IsLeftOutWhereItIsOffAndRefusedWhereSamplesAreNoMiddles) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front());
  const auto bound = [&](const Scene& scene) {
    const SceneBindings b = bind_scene(h, field, scene);
    const auto define =
        std::find_if(b.defines.begin(), b.defines.end(), [](const auto& d) { return d.first == "AMRTEX_RAY_OFFSET"; });
    const bool uniforms = std::any_of(b.uniforms.begin(), b.uniforms.end(), [](const auto& u) { return u.name == "u_ray_seed"; });
    EXPECT_EQ(uniforms, define->second == 1);
    return define->second;
  };
  EXPECT_EQ(bound(offset_scene(Mode::dvr, Sampling::lattice, std::nullopt)), 0);
  EXPECT_EQ(bound(offset_scene(Mode::dvr, Sampling::lattice, 0)), 1);
  for (const Integrator integrator : {Integrator::left, Integrator::preintegrated, Integrator::tolerance}) {
    Scene scene = offset_scene(Mode::dvr, Sampling::adaptive, 0);
    scene.settings.integrator = integrator;
    try {
      bind_scene(h, field, scene);
      ADD_FAILURE() << integrator_name(integrator);
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), AllOf(HasSubstr("'ray_offset'"), HasSubstr("exponential_midpoint and euler")));
    }
  }
}

}  // namespace
}  // namespace amrtex
