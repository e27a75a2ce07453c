// Pictures against closed forms, and pictures that must be the same to the bit: between page sizes,
// encodings, contexts, and with and without skipping. Every encoding with every filter.
#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr int kPixels = 20;

Scene scene_of(Mode mode, const View& view, Sampling sampling = Sampling::lattice) {
  return small_scene(mode, view, sampling, kPixels);
}

// ---- light ----

void expect_slab(const Picture& picture, const Scene& scene, const AmrHierarchy& h, double extinction, double tolerance) {
  double worst = 0;
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x) {
      const double opacity = -std::expm1(-extinction * chord(scene, x, y, h.domain_lower(), h.domain_upper()));
      const double* pixel = picture.pixel(x, y);
      for (const double d : {pixel[3] - opacity, pixel[0] - 0.75 * opacity, pixel[2] - 0.25 * opacity})
        worst = std::max(worst, std::abs(d));
    }
  EXPECT_LE(worst, tolerance);
  EXPECT_GT(largest(picture), 0.3) << "the slab is in the picture";
}

TEST(Slab, IsItsClosedFormFaceOnObliqueInPerspectiveAndFromInside) {
  // T = exp(-k L), C = c (1 - T) whatever the values, the step and the sampling
  const AmrHierarchy h = nested(waves).hierarchy();
  const Vec3d middle(0.5);
  const std::vector<View> views{orthographic(middle, {1, 0, 0}, 1.5), orthographic(middle, {-1, 0.7, 0.4}, 1.5),
                                perspective({2, -1.5, 1.2}, middle), perspective({0.4, 0.55, 0.3}, {1, 0.2, 0.8})};
  std::size_t turn = 0;
  for_each_case([&](const EncodingCase& c) {  // on GL half of the cases, each with one of the samplings
    const EncodedField floats = build(h, c, {.value_ranges = false});
    const EncodedField doubles = build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    const bool on_osmesa = accepted(h, c, {.limits = handle_limits(ContextKind::osmesa)});
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (std::size_t v = 0; v < views.size(); ++v) {
        Scene scene = scene_of(Mode::dvr, views[v], sampling);
        scene.transfer_function = constant_light(3);
        scene.settings.step = v % 2 == 0 ? 1 : 0.37;
        SCOPED_TRACE(fmt::format("{} view {}", sampling_name(sampling), v));
        expect_slab(render_on_cpu(h, doubles, scene, true), scene, h, 3, 1e-12);
        const ContextKind kind = ++turn % 4 == 0 && on_osmesa ? ContextKind::osmesa : ContextKind::egl;
        if (!chosen(sampling == Sampling::lattice ? 0 : 1, number_of(c), 4)) continue;
        if (v == turn % views.size() || v == 3) expect_slab(draw(context(kind), h, floats, scene), scene, h, 3, 1e-5);
      }
  });
}

TEST(Slab, OfAnisotropicCellsCountsWorldLengths) {
  // extinction is per longest edge, 2: T = exp(-3 L / 2); in world units T = exp(-3 L)
  const AmrHierarchy h =
      MeshBuilder({8, 8, 8}, {2}, {-1, 0, 0}, {1, 1, 0.5}).root(waves).patch(1, {{4, 4, 4}, {12, 8, 16}}, waves).hierarchy();
  const Vec3d middle(0, 0.5, 0.25);
  const GlPairs on_gl(2);
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField floats = build(h, c);
    const EncodedField doubles = build(h, c, {.storage = Storage::r64f});
    for (const Vec3d& direction : {Vec3d(0, 0, -1), Vec3d(1, 0.5, 0.25)})
      for (const bool world : {false, true}) {
        Scene scene = scene_of(Mode::dvr, orthographic(middle, direction, 1), Sampling::adaptive);
        scene.transfer_function = constant_light(3);
        if (world) scene.transfer_function.length_unit = TransferFunction::LengthUnit::world;
        expect_slab(render_on_cpu(h, doubles, scene, true), scene, h, world ? 3 : 1.5, 1e-12);
        if (world && on_gl.has(c)) expect_slab(draw(context(ContextKind::egl), h, floats, scene), scene, h, 3, 1e-5);
      }
  });
}

TEST(Slab, OfALogarithmicTransferFunction) {
  // from 1 at 0.01 to 5 at 100 over log10(value): 3 at value 1
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const GlPairs on_gl(2);
  for_each_filter([&](const EncodingCase& c) {
    Scene scene = scene_of(Mode::dvr, orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 1.5));
    scene.transfer_function = constant_light(0);
    scene.transfer_function.color[0].value = 1;
    scene.transfer_function.extinction = {{0.01, 1}, {100, 5}};
    scene.transfer_function.logarithmic = true;
    expect_slab(render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true), scene, h, 3, 1e-6);
    if (on_gl.has(c)) expect_slab(draw(context(ContextKind::egl), h, build(h, c), scene), scene, h, 3, 1e-5);
  });
}

TEST(Light, OfALinearFieldConvergesWithOrderTwo) {
  // f = x, k = a x, c = x on [x0, x1]: C = x0 - x1 T + e^(a x0^2 / 2) sqrt(pi / 2a) (erf(x1 sqrt(a/2)) - erf(x0 sqrt(a/2)))
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.x; }).hierarchy();
  const double a = 8;
  const double x0 = 0.25;
  const double x1 = 0.75;
  const double t = std::exp(-a * (x1 * x1 - x0 * x0) / 2);
  const double light = x0 - x1 * t +
                       std::exp(a * x0 * x0 / 2) * std::sqrt(std::numbers::pi / (2 * a)) *
                           (std::erf(x1 * std::sqrt(a / 2)) - std::erf(x0 * std::sqrt(a / 2)));
  const GlPairs drawn(2, interpolating);
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;  // of order one
    const EncodedField floats = build(h, c, {.value_ranges = false});
    const EncodedField doubles = build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    std::vector<double> errors;
    for (const double step : {1.0, 0.5, 0.25}) {
      Scene scene = scene_of(Mode::dvr, orthographic({0.5, 0.47, 0.52}, {1, 0, 0}, 0.1), Sampling::adaptive);
      scene.transfer_function.extinction = {{0, 0}, {1, a}};
      scene.transfer_function.color = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
      scene.region = {Vec3d(x0, 0, 0), Vec3d(x1, 1, 1)};
      scene.settings.step = step;
      const Picture in_double = render_on_cpu(h, doubles, scene, true);
      EXPECT_NEAR(in_double.pixel(10, 10)[3], 1 - t, 1e-12) << "the midpoint rule is exact for the optical depth";
      errors.push_back(std::abs(in_double.pixel(10, 10)[0] - light));
      if (!drawn.has(c)) continue;
      const Picture on_gl = draw(context(ContextKind::egl), h, floats, scene);
      EXPECT_LE(difference(on_gl, in_double), 2e-6);
    }
    EXPECT_LT(errors[0], 1e-3);
    for (std::size_t i = 1; i < errors.size(); ++i) EXPECT_NEAR(std::log2(errors[i - 1] / errors[i]), 2, 0.1);
  });
}

TEST(Light, EarlyEndLosesLessThanTheOpacityThatWasAskedFor) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField field = build(h, c);
    Scene scene = scene_of(Mode::dvr, perspective({2, -1.5, 1.2}, Vec3d(0.5)));
    scene.transfer_function = constant_light(0);
    scene.transfer_function.extinction = {{0.2, 0}, {1, 12}};
    const Picture full = draw_on(gl, h, field, scene);
    const double opacity = 0.6;
    scene.settings.early_end = opacity;
    const Picture early = draw_on(gl, h, field, scene);
    int ended = 0;
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x) {
        const double* f = full.pixel(x, y);
        const double* e = early.pixel(x, y);
        for (int k = 0; k < 4; ++k) {
          EXPECT_TRUE(f[3] >= opacity || e[k] == f[k]);
          EXPECT_TRUE(f[k] - e[k] >= 0 && f[k] - e[k] <= 1 - opacity) << f[k] << " " << e[k];
        }
        if (f[3] >= opacity) {
          EXPECT_GE(e[3], opacity - 1e-6);
          ended += e[3] < f[3] ? 1 : 0;
        }
      }
    EXPECT_GT(ended, 20);
  });
}

// ---- line integrals and maxima ----

TEST(Projection, OfALinearFieldIsTheMidpointTimesTheLength) {
  // inside the outer cells' centres every filter but nearest holds the field itself
  const Vec3d lower(-1, 2, 0);
  const Vec3d upper(3, 6, 4);
  const auto f = [](const Vec3d& p) { return 1 + 0.5 * p.x - 0.25 * p.y + 0.125 * p.z; };
  const AmrHierarchy h = MeshBuilder(Vec3i(16), {}, lower, upper).root(f).hierarchy();
  const std::array<Vec3d, 2> region{Vec3d(0, 3, 1), Vec3d(2, 5, 3)};
  const GlPairs on_gl(2, interpolating);
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    Scene scene = scene_of(Mode::projection, orthographic({1, 4, 2}, {1, 0.4, -0.3}, 3), Sampling::adaptive);
    scene.region = region;
    scene.settings.step = 0.7;
    Picture expected(kPixels, kPixels, 1);
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x) {
        const double length = chord(scene, x, y, region[0], region[1]);
        const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
        double enter = 0;
        for (int a = 0; a < 3; ++a)
          enter = std::max(enter, std::min((region[0][a] - ray.origin[a]) / ray.direction[a],
                                           (region[1][a] - ray.origin[a]) / ray.direction[a]));
        *expected.pixel(x, y) = length > 0 ? length * f(ray.origin + (enter + length / 2) * ray.direction) : 0;
      }
    EXPECT_GT(largest(expected), 1);
    EXPECT_LE(difference(render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true), expected), 1e-6);
    if (!on_gl.has(c)) return;
    for (const Filtering filtering : c.filterings())
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, build(h, c, {.filtering = filtering}), scene), expected),
                filtering == Filtering::manual ? 2e-5 : 2e-4);
  });
}

TEST(Projection, AlongAnAxisIsTheSumOfTheCells) {
  // f depends on x alone; samples at the cells' centres: sum of v_i h with every filter, clamped at both ends
  const AmrHierarchy h =
      MeshBuilder({16, 4, 4}, {}, Vec3d(0), {4, 1, 1}).root([](const Vec3d& p) { return 2 + p.x * p.x; }).hierarchy();
  double sum = 0;
  for (int i = 0; i < 16; ++i) sum += 0.25 * h.level_value(0, {i, 0, 0}, 0);
  const GlPairs on_gl(2);
  for_each_filter([&](const EncodingCase& c) {
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      const Scene scene = scene_of(Mode::projection, orthographic({2, 0.5, 0.5}, {-1, 0, 0}, 0.5), sampling);
      const double quantum = sampling == Sampling::lattice ? 8 * 4 * 0.25 / 4096
                                                           : 1e-12;  // largest slope times length times half a quantum of a cell
      const Picture in_double = render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true);
      EXPECT_NEAR(*in_double.pixel(3, 5), sum, quantum);
      if (!on_gl.has(c)) continue;
      EXPECT_NEAR(*draw(context(ContextKind::egl), h, build(h, c), scene).pixel(3, 5), sum, quantum + 1e-5 * sum);
    }
  });
}

TEST(Maximum, OfAPlateauIsItsHeight) {
  // 1 in the middle, 0 at the outer cells, levels 0 and 1: rays through the plateau's core see exactly 1
  const auto plateau = [](const Vec3d& p) { return glm::all(glm::lessThan(glm::abs(p - 0.5), Vec3d(0.3))) ? 1.0 : 0.0; };
  const AmrHierarchy h = MeshBuilder(Vec3i(10), {2}).root(plateau).patch(1, {{6, 6, 6}, {10, 14, 14}}, plateau).hierarchy();
  GlPairs(2).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      Scene scene = scene_of(Mode::mip, orthographic(Vec3d(0.5), {0, 1, 0}, 2), sampling);
      scene.settings.skip = sampling == Sampling::adaptive;
      const Picture picture = draw_on(gl, h, build(h, c), scene);
      for (int y = 0; y < kPixels; ++y)
        for (int x = 0; x < kPixels; ++x) {
          const double off = std::max(std::abs((x + 0.5) / kPixels * 2 - 1), std::abs((y + 0.5) / kPixels * 2 - 1));
          const double v = *picture.pixel(x, y);
          if (off < 0.15) {
            EXPECT_EQ(v, 1);
          }
          if (off > 0.41) {
            EXPECT_EQ(v, 0) << "beside the plateau and beside the mesh";
          }
          EXPECT_TRUE(v >= 0 && v <= 1) << v;
        }
    }
  });
}

TEST(Maximum, OfNegativeValuesIsNegative) {
  const AmrHierarchy h = nested(constant(-2)).hierarchy();
  GlPairs(2).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const Scene scene = scene_of(Mode::mip, orthographic(Vec3d(0.5), {0, 1, 0}, 0.5));
    EXPECT_EQ(largest(draw_on(gl, h, build(h, c), scene)), -2);
  });
}

// ---- pictures that must be equal ----

Scene wave_scene(const AmrHierarchy& h, Mode mode) {
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  Scene scene = scene_of(
      mode, perspective(middle + Vec3d(1.6, -1.9, 0.8) * glm::length(h.domain_upper() - h.domain_lower()) * 0.6, middle));
  scene.transfer_function = peaks();
  scene.settings.step = 0.7;
  return scene;
}

TEST(SamePicture, NearestInEveryEncodingAndPageSize) {
  std::size_t mesh = 0;
  for (const auto& h : {single_level(waves).hierarchy(), nested(waves).hierarchy(), nested(waves, {4, 2}).hierarchy(),
                        holes_and_missing(waves).hierarchy()}) {
    ++mesh;
    for (const Mode mode : {Mode::dvr, Mode::mip}) {
      if (mode == Mode::mip && !h.has_holes()) continue;
      std::optional<Picture> first, first_on_gl;
      for_each_case([&](const EncodingCase& c) {
        if (c.filter != Filter::nearest) return;
        const EncodedField field = build(h, c);
        for (const bool gl : {false, true}) {
          if (gl && !chosen(mesh, number_of(c), 4)) continue;  // each case on one of the meshes
          const Picture picture = draw_on(gl, h, field, wave_scene(h, mode));
          std::optional<Picture>& expected = gl ? first_on_gl : first;
          if (!expected) expected = picture;
          EXPECT_EQ(difference(picture, *expected), 0);
          EXPECT_GT(largest(picture), 0.1);
        }
      });
    }
  }
}

TEST(SamePicture, LinearFiltersWhereTheirDefinitionsCoincide) {
  // on one level pages of any size, one page of all, the leaves' own level, and hats define the same field
  const AmrHierarchy h = single_level(waves).hierarchy();
  for (const Mode mode : {Mode::dvr, Mode::projection}) {
    std::map<Filter, Picture> first;
    for_each_case([&](const EncodingCase& c) {
      if (case_slice().empty() && !chosen(mode == Mode::dvr ? 0 : 1, number_of(c), 2)) return;
      const Picture picture = draw(context(ContextKind::egl), h, build(h, c), wave_scene(h, mode));
      const bool alike = c.filter == Filter::linear_lod || c.filter == Filter::basis;
      const Filter field = alike ? Filter::linear_page : c.filter;
      const auto [it, is_first] = first.emplace(field, picture);
      EXPECT_EQ(difference(picture, it->second), 0) << c.name();
      EXPECT_GT(largest(picture), 0.1);
    });
    EXPECT_GT(first.size(), 1u);
    for (auto a = first.begin(); a != first.end(); ++a)
      for (auto b = first.begin(); b != a; ++b) EXPECT_GT(difference(a->second, b->second), 1e-4) << "two filters are two fields";
  }
}

TEST(SamePicture, WithAndWithoutSkipping) {
  // a small bright place in a large mesh of nothing; one of the patches holds nothing else
  const auto spot = [](const Vec3d& p) { return std::max(0.0, 1 - 4 * glm::length(p - Vec3d(0.3, 0.6, 0.55))); };
  const AmrHierarchy h = MeshBuilder(Vec3i(40), {2})
                             .patch(0, {{0, 0, 0}, {24, 40, 40}}, spot)
                             .patch(0, {{24, 0, 0}, {40, 40, 40}}, spot)
                             .patch(1, {{16, 40, 36}, {32, 56, 52}}, spot)
                             .hierarchy();
  constexpr std::array kModes{Mode::dvr, Mode::projection, Mode::mip};
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : kModes) {
      Scene scene = wave_scene(h, mode);
      const Picture without = render_on_cpu(h, field, scene, false);
      scene.settings.skip = true;
      EXPECT_EQ(difference(render_on_cpu(h, field, scene, false), without), 0) << mode_name(mode);
    }
  });
  // on GL each mode with another encoding
  GlPairs(kModes.size()).for_each([&](const EncodingCase& c, std::size_t pair) {
    for (const Filtering filtering : c.filterings())
      for (std::size_t i = 0; i < kModes.size(); ++i) {
        const Mode mode = kModes[i];
        if (!in_turn(i, pair, kModes.size()) || (filtering == Filtering::hardware && mode != Mode::dvr)) continue;
        SCOPED_TRACE(fmt::format("{} {}", mode_name(mode), filtering_name(filtering)));
        const EncodedField field = build(h, c, {.filtering = filtering});
        Scene scene = wave_scene(h, mode);
        const Picture without = draw(context(ContextKind::egl), h, field, scene);
        scene.settings.skip = true;
        WorkCounts counts;
        const Picture with = draw(context(ContextKind::egl), h, field, scene, &counts);
        EXPECT_EQ(difference(with, without), 0);
        EXPECT_GT(largest(with), 0.01);
        EXPECT_GT(counts.regions_skipped, 0);
        if (mode != Mode::dvr) continue;
        // what skipping needs left out: the same picture too
        scene.settings.skip = false;
        EXPECT_EQ(
            difference(draw(context(ContextKind::egl), h, build(h, c, {.filtering = filtering, .value_ranges = false}), scene),
                       without),
            0);
      }
  });
}

TEST(SamePicture, OnEglAndOsmesa) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c) {
    for (const Filtering filtering : c.filterings()) {
      const EncodedField field = build(h, c, {.filtering = filtering});
      Scene scene = wave_scene(h, Mode::dvr);
      scene.settings.sampling = filtering == Filtering::manual ? Sampling::lattice : Sampling::adaptive;
      const Picture egl = draw(context(ContextKind::egl), h, field, scene);
      EXPECT_EQ(difference(draw(context(ContextKind::osmesa), h, field, scene), egl), 0);
      EXPECT_GT(largest(egl), 0.1);
    }
  });
}

TEST(SamePicture, OnGlAndOnTheCpuUpToFloats) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(all_encodings().size()).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const Picture gl = draw(context(ContextKind::egl), h, field, wave_scene(h, Mode::projection));
    const Picture cpu = render_on_cpu(h, field, wave_scene(h, Mode::projection), false);
    // samples at the quantum's edges may take the neighbouring position of the lattice: 2^-12 of a cell
    EXPECT_LE(difference(gl, cpu), interpolating(c) ? 1e-4 : 0.05);
  });
}

TEST(SamePicture, OfAFilterConvergesToTheReference) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    Scene scene = wave_scene(h, Mode::projection);
    scene.settings.sampling = Sampling::adaptive;
    scene.settings.step = 0.03;
    const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 1.0 / 16);
    const Picture drawn = render_on_cpu(h, field, scene, true);
    EXPECT_LE(difference(drawn, reference), 2e-3);
    EXPECT_GT(difference(render_on_cpu(nested([](const Vec3d& p) { return waves(p) * 1.02; }).hierarchy(),
                                       build(nested([](const Vec3d& p) { return waves(p) * 1.02; }).hierarchy(), c,
                                             {.storage = Storage::r64f}),
                                       scene, true),
                         reference),
              5e-3)
        << "control: values two per cent off";
  });
}

// ---- counting ----

TEST(Counts, OfAnAxisParallelRayAreTheIntervalsOfItsLength) {
  // 16 finest cells a ray: ceil(16 / step) samples
  const AmrHierarchy h =
      MeshBuilder({8, 4, 4}, {2}, Vec3d(0), {2, 1, 1}).root(waves).patch(1, {{4, 0, 0}, {12, 8, 8}}, waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c) {  // the counters stand in the marching loop, which knows no encoding
    for (const double step : {1.0, 0.5, 0.75}) {
      Scene scene = scene_of(Mode::projection, orthographic({1, 0.5, 0.5}, {1, 0, 0}, 2));
      scene.settings.step = step;
      const EncodedField field = build(h, c, {.value_ranges = false});
      const Structure structure(context(ContextKind::egl), field);
      const WorkCounts counts = Raycaster(context(ContextKind::egl), h, structure, scene).count();
      EXPECT_EQ(counts.rays, kPixels * kPixels / 4) << "the mesh is half of the picture high and wide";
      EXPECT_EQ(counts.samples, counts.rays * static_cast<std::int64_t>(std::ceil(16 / step)));
      EXPECT_GE(counts.regions, counts.rays);
      EXPECT_EQ(counts.regions_skipped, 0);
    }
  });
}

TEST(Counts, OfAdaptiveRaysOnOneLevelAreTheCells) {
  // faces of regions are faces of cells: one sample a cell with step 1, three with step 1/3
  const AmrHierarchy h = MeshBuilder({16, 4, 4}, {}, Vec3d(0), {4, 1, 1}).root(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c) {
    for (const int samples : {1, 3}) {
      Scene scene = scene_of(Mode::projection, orthographic({2, 0.5, 0.5}, {-1, 0, 0}, 0.5), Sampling::adaptive);
      scene.settings.step = 1.0 / samples;
      const EncodedField field = build(h, c);
      const Structure structure(context(ContextKind::egl), field);
      const WorkCounts counts = Raycaster(context(ContextKind::egl), h, structure, scene).count();
      EXPECT_EQ(counts.samples, counts.rays * 16 * samples);
    }
  });
}

}  // namespace
}  // namespace amrtex
