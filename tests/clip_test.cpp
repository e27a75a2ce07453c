// Planes that cut what is drawn: closed forms, bits that must stay, the double reference. Every encoding with every filter.
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

constexpr int kPixels = 9;
const Vec3d kMiddle(0.5);
const ClipPlane kOblique{{1, 2, -0.5}, 1.3};

Scene clip_scene(Mode mode, Sampling sampling, const std::vector<ClipPlane>& planes) {
  Scene scene = small_scene(mode, orthographic(kMiddle, {-1, 0.7, 0.4}, 1.2), sampling, kPixels);
  scene.settings.step = 0.6;
  scene.settings.clip_planes = planes;
  return scene;
}

/// World length of the pixel's ray in [0, 1]^3 on the kept sides of the planes.
double kept_chord(const Scene& scene, int x, int y) {
  const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
  double from = 0;
  double to = kInf;
  std::vector<ClipPlane> sides = scene.settings.clip_planes;
  for (int a = 0; a < 3; ++a)
    for (const double sense : {1.0, -1.0}) {
      ClipPlane& side = sides.emplace_back(ClipPlane{Vec3d(0), sense < 0 ? -1.0 : 0.0});
      side.normal[a] = sense;
    }
  for (const ClipPlane& side : sides) {
    const double rise = glm::dot(side.normal, ray.direction);
    const double t = (side.distance - glm::dot(side.normal, ray.origin)) / rise;
    if (rise > 0) from = std::max(from, t);
    if (rise < 0) to = std::min(to, t);
  }
  return std::max(to - from, 0.0);
}

/// Largest difference between alpha and 1 - exp(-k chord).
double off_closed_form(const Picture& picture, const Scene& scene, double extinction) {
  double worst = 0;
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x)
      worst = std::max(worst, std::abs(picture.pixel(x, y)[3] - (1 - std::exp(-extinction * kept_chord(scene, x, y)))));
  return worst;
}

Picture draw_boxes(const AmrHierarchy& h, const EncodingCase& c, const Scene& scene) {
  Context& gl = context(ContextKind::egl);
  const EncodedField field = build(h, c, {.draw_boxes = true});
  const Structure structure(gl, field);
  BoxConsumer consumer(gl, h, structure, scene);
  consumer.draw();
  return consumer.read();
}

// ---- closed forms ----

TEST(Clip, OfAConstantMediumInHalfHalvesItsWay) {
  // along x through the unit cube, cut at x = 1/2: T = exp(-k/2) from either side
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const double k = 3;
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const double side : {1.0, -1.0})
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        Scene scene = clip_scene(Mode::dvr, sampling, {{{side, 0, 0}, side * 0.5}});
        scene.view = orthographic(kMiddle, {1, 0, 0}, 0.8);
        scene.transfer_function = constant_light(k);
        const Picture in_double = render_on_cpu(h, field, scene, true);
        for (int i = 0; i < kPixels; ++i) EXPECT_NEAR(in_double.pixel(i, i)[3], 1 - std::exp(-k / 2), 1e-12);
      }
  });
}

TEST(Clip, ByObliquePlanesLeavesTheChordBetweenThem) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const double k = 3;
  const std::vector<ClipPlane> planes{kOblique, {{-1, 0.2, 0.3}, -0.5}, {{0, 0, 7}, 0.7}};
  const GlPairs on_gl(2), by_box(2, [&](const EncodingCase&c) { return gives_boxes(h, c); });
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      Scene scene = clip_scene(Mode::dvr, sampling, planes);
      scene.transfer_function = constant_light(k);
      EXPECT_LE(off_closed_form(render_on_cpu(h, field, scene, true), scene, k), 1e-12);
      if (on_gl.has(c)) {
        EXPECT_LE(off_closed_form(draw(context(ContextKind::egl), h, field, scene), scene, k), 3e-6);
      }
      EXPECT_GT(kept_chord(scene, 4, 4), 0.1);
      if (!by_box.has(c)) continue;
      scene.settings.consumer = ConsumerKind::multipass;
      EXPECT_LE(off_closed_form(draw_boxes(h, c, scene), scene, k), 3e-6);
      // slices: half a distance at each end of the ray
      const double half_a_distance = k * 0.6 / h.cells(h.finest_level()).x;
      for (const ConsumerKind slices : {ConsumerKind::slices, ConsumerKind::stencil_slices}) {
        if (sampling != Sampling::lattice) continue;
        scene.settings.consumer = slices;
        EXPECT_LE(off_closed_form(draw_boxes(h, c, scene), scene, k), half_a_distance);
      }
    }
  });
}

TEST(Clip, BoxByBoxIsTheRaycastersPicture) {
  const AmrHierarchy h = nested(waves).hierarchy();
  int drawn = 0;
  GlPairs(2, [&](const EncodingCase& c) { return interpolating(c) && gives_boxes(h, c); }).for_each([&](const EncodingCase& c) {
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      Scene scene = clip_scene(Mode::dvr, sampling, {kOblique});
      scene.transfer_function = peaks();
      const Picture by_ray = draw(context(ContextKind::egl), h, build(h, c), scene);
      scene.settings.consumer = ConsumerKind::multipass;
      EXPECT_LE(difference(draw_boxes(h, c, scene), by_ray), 2e-6);
      EXPECT_GT(largest(by_ray), 0.5);
      ++drawn;
    }
  });
  EXPECT_GE(drawn, 4);
}

TEST(Clip, CutsInEveryIntegrator) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const double k = 2;
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (const Integrator integrator : {Integrator::left, Integrator::preintegrated, Integrator::tolerance}) {
        if (integrator == Integrator::tolerance && (sampling == Sampling::lattice || !interpolating(c))) continue;
        SCOPED_TRACE(integrator_name(integrator));
        Scene scene = clip_scene(Mode::dvr, sampling, {kOblique});
        scene.transfer_function = constant_light(k);
        scene.settings.integrator = integrator;
        EXPECT_LE(off_closed_form(render_on_cpu(h, field, scene, true), scene, k), 1e-9);
      }
  });
}

// ---- what must stay ----

void make_surfaces(Scene& scene) {
  scene.transfer_function = peaks();
  scene.settings.isosurfaces.values = {0.45, 0.6};
  scene.settings.isosurfaces.opacity = {0.5, 0.7};
}

constexpr std::array kModes{Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso};

TEST(Clip, ByAPlaneThroughNothingChangesNoBit) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const GlPairs on_gl(2);
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : kModes)
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        Scene scene = clip_scene(mode, sampling, {});
        make_surfaces(scene);
        const Picture whole = render_on_cpu(h, field, scene, false);
        const bool drawn = mode == Mode::dvr && sampling == Sampling::lattice && on_gl.has(c);
        const Picture by_gl = drawn ? draw(context(ContextKind::egl), h, field, scene) : Picture();
        scene.settings.clip_planes = {{{0.3, 1, 0.2}, -4}, {{0, -2, 0}, -2.5}};
        EXPECT_EQ(render_on_cpu(h, field, scene, false).values, whole.values);
        if (drawn) {
          EXPECT_EQ(draw(context(ContextKind::egl), h, field, scene).values, by_gl.values);
        }
      }
  });
}

TEST(Clip, ByTwoOppositePlanesLeavesNothing) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : kModes) {
      Scene scene = clip_scene(mode, Sampling::lattice, {kOblique, {-kOblique.normal, -kOblique.distance}});
      make_surfaces(scene);
      const Picture nothing = render_on_cpu(h, field, scene, false);
      EXPECT_EQ(largest(nothing), 0);
      EXPECT_EQ(nothing.values, HierarchyReference(h, 0, field.definition).render(scene, 1).values);
    }
  });
}

TEST(Clip, KeepsTheLatticesPlaces) {
  // surfaces behind the plane are hit where they were: depths of rays whose first hit is kept are equal to the bit
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    Scene scene = clip_scene(Mode::iso, Sampling::lattice, {});
    make_surfaces(scene);
    scene.settings.isosurfaces.output = Output::depth;
    const Picture whole = render_on_cpu(h, field, scene, false);
    scene.settings.clip_planes = {{{-1, 0.7, 0.4}, -0.25}};  // across the rays
    const Picture cut = render_on_cpu(h, field, scene, false);
    const double plane = 3 * glm::length(Vec3d(-1, 0.7, 0.4)) + (-0.25 - 0.05) / glm::length(Vec3d(-1, 0.7, 0.4));
    const double step = scene.settings.step / h.cells(h.finest_level()).x;
    int kept = 0;
    int gone = 0;
    for (std::size_t i = 0; i < whole.values.size(); ++i) {
      if (whole.values[i] > plane + 2 * step) {
        EXPECT_EQ(cut.values[i], whole.values[i]);
        ++kept;
      } else if (whole.values[i] > 0) {
        EXPECT_TRUE(cut.values[i] == 0 || cut.values[i] >= plane - 1e-6) << "nothing is hit before the plane, nor on it";
        ++gone;
      }
    }
    EXPECT_GT(kept, 5);
    EXPECT_GT(gone, 5);
  });
}

TEST(Clip, IntoTwoHalvesLosesNothingOfALineIntegral) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    Scene scene = clip_scene(Mode::projection, Sampling::lattice, {});
    const Picture whole = render_on_cpu(h, field, scene, true);
    scene.settings.clip_planes = {kOblique};
    Picture sum = render_on_cpu(h, field, scene, true);
    scene.settings.clip_planes = {{-kOblique.normal, -kOblique.distance}};
    const Picture other = render_on_cpu(h, field, scene, true);
    for (std::size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += other.values[i];
    // one interval of the ray has two samples instead of one: what is left is how far f goes along it, at most a step of 1
    EXPECT_LE(difference(sum, whole), 0.6 / h.cells(h.finest_level()).x);
    EXPECT_GT(difference(other, whole), 0.1);
  });
}

TEST(Clip, MakesNoSurface) {
  // inside of a body of 1 the value never changes: a cut through it is no isosurface
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    Scene scene = clip_scene(Mode::iso, Sampling::lattice, {kOblique});
    scene.settings.isosurfaces.values = {0.5};
    EXPECT_EQ(largest(render_on_cpu(h, build(h, c), scene, true)), 0);
  });
}

// ---- the double reference ----

TEST(Clip, ConvergesToTheReferenceInEveryModeAndFilter) {
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for_each_filter([&](const EncodingCase& c) {
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      for (const Mode mode : kModes) {
        SCOPED_TRACE(mode_name(mode));
        Scene scene = clip_scene(mode, Sampling::adaptive, {kOblique, {{0, 0, -1}, -0.8}});
        make_surfaces(scene);
        scene.settings.isosurfaces.shading = Shading::none;
        const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
        scene.settings.step = 0.05;
        const Picture cut = render_on_cpu(h, field, scene, true);
        // a ray that grazes a surface meets it or does not; in mip of nearest, a cell that it crosses within one step
        const bool may_miss = mode == Mode::mip && !interpolating(c);
        EXPECT_LE(rms_difference(cut, reference), scene.settings.draws_surfaces() ? 4e-2 : may_miss ? 2e-2 : 5e-3);
        scene.settings.clip_planes.pop_back();
        EXPECT_GT(difference(render_on_cpu(h, field, scene, true), reference), 2e-2) << "control: one plane less";
      }
    });
}

TEST(Clip, TakesTheShadowsOfWhatItCutsAway) {
  // cut at x = 1/2, or a box that begins there: the same light, in the reference too
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    Scene scene = clip_scene(Mode::dvr, Sampling::adaptive, {{{1, 0, 0}, 0.5}});
    scene.transfer_function = peaks();
    scene.settings.step = 0.1;
    scene.settings.point_light = PointLight{{-0.5, 0.6, 0.4}, 0.1, 0.2};
    const Picture cut = render_on_cpu(h, field, scene, true);
    EXPECT_LE(difference(cut, HierarchyReference(h, 0, field.definition).render(scene, 0.25)), interpolating(c) ? 3e-2 : 6e-2);
    scene.settings.clip_planes.clear();
    scene.region = {{Vec3d(0.5, 0, 0), Vec3d(1)}};
    EXPECT_LE(difference(cut, render_on_cpu(h, field, scene, true)), 1e-2);
    scene.region.reset();
    EXPECT_GT(difference(cut, render_on_cpu(h, field, scene, true)), 0.1) << "control: not cut";
  });
}

TEST(Clip, CutsRaysInDouble) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  Scene scene = clip_scene(Mode::dvr, Sampling::lattice, {kOblique});
  scene.view = perspective({30.1, -41.2, 21.7}, kMiddle);  // beyond 16 diagonals
  scene.view.fov_y = 1.5;
  scene.transfer_function = constant_light(3);
  const EncodingCase& c = encoding_cases().front();
  EXPECT_LE(off_closed_form(draw(context(ContextKind::egl), h, build(h, c), scene), scene, 3), 3e-6);
}

TEST(Clip, TakesNormalsOfAnyLength) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const ClipPlane near = in_finest_cells(h, {{1, 2, -0.5}, 1.3});
  for (const double scale : {1e-200, 1e200}) {
    const ClipPlane far = in_finest_cells(h, {Vec3d(1, 2, -0.5) * scale, 1.3 * scale});
    EXPECT_LE(glm::length(far.normal - near.normal), 1e-15);
    EXPECT_NEAR(far.distance, near.distance, 1e-12);
  }
}

// ---- leaving out, and bad input ----

TEST(Clip, IsLeftOutOfScenesWithoutPlanes) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front());
  const auto bound = [&](const Scene& scene) {
    const SceneBindings b = bind_scene(h, field, scene);
    const auto define =
        std::find_if(b.defines.begin(), b.defines.end(), [](const auto& d) { return d.first == "AMRTEX_CLIP_PLANES"; });
    const bool uniforms =
        std::any_of(b.uniforms.begin(), b.uniforms.end(), [](const auto& u) { return u.name == "u_clip_planes"; });
    EXPECT_EQ(uniforms, define->second > 0);
    return define->second;
  };
  Scene scene = clip_scene(Mode::mip, Sampling::lattice, {});
  EXPECT_EQ(bound(scene), 0);
  scene.settings.clip_planes = {kOblique, kOblique};
  EXPECT_EQ(bound(scene), 2);
}

TEST(Clip, IsRefusedByThePlanesNumber) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(waves).hierarchy();
  const EncodingCase& c = encoding_cases().front();
  const auto complaint = [&](const std::vector<ClipPlane>& planes) {
    const Scene scene = clip_scene(Mode::mip, Sampling::lattice, planes);
    std::string by_shader, by_reference;
    try {
      bind_scene(h, build(h, c), scene);
    } catch (const UsageError& e) {
      by_shader = e.what();
    }
    try {
      HierarchyReference(h, 0, {c.filter}).render(scene, 1);
    } catch (const UsageError& e) {
      by_reference = e.what();
    }
    EXPECT_EQ(by_shader, by_reference);
    return by_shader;
  };
  EXPECT_THAT(complaint({kOblique, {{0, 0, 0}, 1}}), AllOf(HasSubstr("'clip_planes': plane 1"), HasSubstr("no direction")));
  for (const double bad : {kNan, kInf}) {
    EXPECT_THAT(complaint({{{1, bad, 0}, 1}}), AllOf(HasSubstr("'clip_planes'[0]"), HasSubstr("a number is expected")));
    EXPECT_THAT(complaint({kOblique, kOblique, {{1, 0, 0}, bad}}),
                AllOf(HasSubstr("'clip_planes'[2]"), HasSubstr("a number is expected")));
  }
  EXPECT_THAT(complaint(std::vector<ClipPlane>(9, kOblique)), AllOf(HasSubstr("9 values"), HasSubstr("at most 8")));
}

}  // namespace
}  // namespace amrtex
