// A lamp in the volume: secondary rays against closed forms, against the double reference, and between
// encodings. Every encoding with every filter.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "renderers/bindings/scene_bindings.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 10;
const Vec3d kMiddle(0.5);
const Vec3d kColor(0.75, 0.5, 0.25);  // of constant_light

Scene lit_scene(const View& view, const Vec3d& lamp, double extinction, double ambient = 0.2) {
  Scene scene;
  scene.view = view;
  scene.transfer_function = constant_light(extinction);
  scene.settings.width = scene.settings.height = kPixels;
  scene.settings.point_light = PointLight{lamp, ambient, 1};
  return scene;
}

// ---- closed forms: a medium of one extinction in a box ----

struct Medium {
  Vec3d lower{0}, upper{1};
  double extinction = 3;
};

/// From where to where the ray is in the box, between 0 and `end`; equal where it is not.
std::pair<double, double> stretch(const Medium& m, const Vec3d& origin, const Vec3d& direction, double end) {
  double from = 0;
  double to = end;
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) {
      if (origin[a] < m.lower[a] || origin[a] > m.upper[a]) return {0, 0};
      continue;
    }
    const double t0 = (m.lower[a] - origin[a]) / direction[a];
    const double t1 = (m.upper[a] - origin[a]) / direction[a];
    from = std::max(from, std::min(t0, t1));
    to = std::min(to, std::max(t0, t1));
  }
  return {from, std::max(from, to)};
}

/// ambient + (1 - ambient) exp(-k d), d the way through the medium from p to the lamp.
double light_at(const Medium& m, const PointLight& lamp, const Vec3d& p) {
  const Vec3d way = lamp.position - p;
  const double distance = glm::length(way);
  const auto [from, to] = stretch(m, p, way / distance, distance);
  return lamp.ambient + (1 - lamp.ambient) * std::exp(-m.extinction * (to - from));
}

/// C / c = integral of exp(-k s) k light(s) ds over the ray's way through the medium, by the midpoint rule in 4000 parts: the
/// lengths in it are closed forms, and its own error is below 1e-6.
double light_of_ray(const Medium& m, const Scene& scene, int x, int y, double end = kInf) {
  const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
  const auto [from, to] = stretch(m, ray.origin, ray.direction, end);
  constexpr int kParts = 4000;
  const double h = (to - from) / kParts;
  double sum = 0;
  for (int i = 0; i < kParts && h > 0; ++i) {
    const double s = (i + 0.5) * h;
    sum += std::exp(-m.extinction * s) * m.extinction * h *
           light_at(m, *scene.settings.point_light, ray.origin + (from + s) * ray.direction);
  }
  return sum;
}

/// The picture of that integral, alpha left out.
Picture closed_form(const Medium& m, const Scene& scene) {
  Picture picture(kPixels, kPixels, 4);
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x) {
      const double light = light_of_ray(m, scene, x, y);
      for (int c = 0; c < 3; ++c) picture.pixel(x, y)[c] = light * kColor[c];
    }
  return picture;
}

/// Largest difference of colours.
double off(const Picture& picture, const Picture& expected) {
  double worst = 0;
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x)
      for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(picture.pixel(x, y)[c] - expected.pixel(x, y)[c]));
  return worst;
}

struct Lamp {
  const char* where;
  Vec3d position;
};
const std::vector<Lamp> kLamps{{"outside", {2, 1.5, 1.2}},
                               {"inside", {0.3, 0.62, 0.45}},
                               {"at the centre", kMiddle},
                               {"a thousand domains away", {-700, 400, 600}},
                               {"on a face", {1, 0.4, 0.6}}};

TEST(Lamp, InAConstantMediumIsItsIntegral) {
  // the secondary ray is exact there whatever its step; what is left is the primary ray's midpoint rule at steps of 1/64
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const std::vector<View> views{orthographic(kMiddle, {-1, 0.7, 0.4}, 1.5), perspective({0.4, 0.55, 0.3}, {1, 0.2, 0.8})};
  const GlPairs on_gl(2);
  for (std::size_t l = 0; l < kLamps.size(); ++l) {
    const View& view = views[l % views.size()];
    std::optional<Picture> first;
    Scene scene = lit_scene(view, kLamps[l].position, 3);
    scene.settings.step = 0.5;
    scene.settings.sampling = Sampling::lattice;
    const Picture expected = closed_form({}, scene);
    for_each_filter([&](const EncodingCase& c) {
      SCOPED_TRACE(kLamps[l].where);
      const Picture in_double = render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true);
      EXPECT_LE(off(in_double, expected), 4e-4);
      if (!first) first = in_double;
      EXPECT_LE(difference(in_double, *first), 1e-12) << "regions do not matter to an exact secondary ray";
      if (l < 2 && on_gl.has(c)) {
        EXPECT_LE(difference(draw(context(ContextKind::egl), h, build(h, c), scene), in_double), 1e-5);
      }
    });
    EXPECT_GT(largest(*first), 0.3);
  }
}

TEST(Lamp, ConvergesWithOrderTwo) {
  // one level, along x through 16 cells: intervals of 1, 1/2 and 1/4 cell
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(constant(1)).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    std::vector<double> errors;
    for (const double step : {1.0, 0.5, 0.25}) {
      Scene scene = lit_scene(orthographic({0.5, 0.47, 0.52}, {1, 0, 0}, 0.1), {0.4, 1.5, 0.9}, 5);
      scene.settings.step = step;
      errors.push_back(std::abs(render_on_cpu(h, field, scene, true).pixel(5, 5)[0] -
                                kColor[0] * light_of_ray({{}, Vec3d(1), 5}, scene, 5, 5)));
    }
    EXPECT_LT(errors[0], 1e-3);
    for (std::size_t i = 1; i < errors.size(); ++i) EXPECT_NEAR(std::log2(errors[i - 1] / errors[i]), 2, 0.1);
  });
}

/// Values 1 from x = 0.5 to 0.75, else 0; extinction k where the value is 1.
Scene plate_scene(const View& view, const Vec3d& lamp, double extinction) {
  Scene scene = lit_scene(view, lamp, extinction);
  scene.transfer_function.extinction = {{0, 0}, {0.5, 0}, {1, extinction}};
  return scene;
}

TEST(Lamp, InADarkPlaceLightsThePlateBeside) {
  // the way of light through the plate alone: a lamp before it, behind it and in it
  const Medium plate{{0.5, 0, 0}, {0.75, 1, 1}, 6};
  const AmrHierarchy h =
      MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.x > 0.5 && p.x < 0.75 ? 1.0 : 0.0; }).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    if (c.filter != Filter::nearest) return;  // others do not have the plate's edges
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    for (const Vec3d& lamp : {Vec3d(0.2, 0.4, 0.6), Vec3d(0.9, 0.4, 0.6), Vec3d(0.6, 0.4, 0.6)})
      for (const bool skip : {true, false}) {
        Scene scene = plate_scene(orthographic(kMiddle, {1, 0.3, 0.2}, 0.8), lamp, 6);
        scene.settings.step = 0.25;
        scene.settings.sampling = Sampling::lattice;
        scene.settings.point_light->shadow_step =
            1.0 / 16;  // regions may hold many cells: half an interval at each face of the plate
        scene.settings.skip = skip;
        EXPECT_LE(off(render_on_cpu(h, field, scene, true), closed_form(plate, scene)), 1.5e-2);
      }
  });
}

TEST(Lamp, BehindAnOpaqueSlabLeavesTheAmbientLight) {
  // a slab of extinction 4000 before the lamp's side of another; seen from the other side: C = ambient c A, with alpha A
  const AmrHierarchy h =
      MeshBuilder(Vec3i(16), {2})
          .root([](const Vec3d& p) { return p.x > 0.25 && p.x < 0.5      ? 2.0
                                            : p.x > 0.625 && p.x < 0.875 ? 1.0
                                                                         : 0.0; })
          .patch(1, {{16, 4, 4}, {32, 20, 20}}, [](const Vec3d& p) { return p.x > 0.625 && p.x < 0.875 ? 1.0 : 0.0; })
          .hierarchy();
  const GlPairs on_gl(1);
  for_each_filter([&](const EncodingCase& c) {
    Scene scene = lit_scene(orthographic(kMiddle, {-1, 0.2, 0.1}, 0.6), {-1, 0.5, 0.5}, 1, 0.3);
    scene.transfer_function.extinction = {{0, 0}, {0.25, 0}, {1, 4}, {2, 4000}};
    const EncodedField field = build(h, c);
    const auto worst = [](const Picture& picture, double ambient) {
      double off = 0;
      for (int i = 0; i < kPixels * kPixels; ++i) {
        const double* pixel = picture.pixel(i % kPixels, i / kPixels);
        EXPECT_GT(pixel[3], 0.5);
        for (int k = 0; k < 3; ++k) off = std::max(off, std::abs(pixel[k] - ambient * kColor[k] * pixel[3]));
      }
      return off;
    };
    if (on_gl.has(c)) {
      EXPECT_LE(worst(draw(context(ContextKind::egl), h, field, scene), 0.3), 1e-5);
    }
    EXPECT_LE(worst(render_on_cpu(h, field, scene, true), 0.3), 1e-5);
    scene.settings.point_light->position.x = 2;
    EXPECT_GT(worst(render_on_cpu(h, field, scene, true), 0.3), 0.1) << "control: the lamp on this side";
  });
}

TEST(Lamp, OfFullAmbientLightOrInThinAirIsNoLampAtAll) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField field = build(h, c);
    for (const auto& [ambient, extinction] : {std::pair(1.0, 4.0), std::pair(0.0, 1e-7)}) {
      Scene scene = lit_scene(orthographic(kMiddle, {-1, 0.7, 0.4}, 1.2), {0.3, 0.4, 1.5}, extinction, ambient);
      const Picture lit = draw_on(gl, h, field, scene);
      scene.settings.point_light.reset();
      const Picture plain = draw_on(gl, h, field, scene);
      EXPECT_LE(difference(lit, plain), 2e-6 * largest(plain));
      EXPECT_GT(largest(plain), 0);
    }
  });
}

TEST(Lamp, FarBeyondAnyFloatStillShines) {
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root(constant(1)).hierarchy();
  GlPairs(1).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField field = build(h, c);
    Scene scene = lit_scene(orthographic(kMiddle, {-1, 0.7, 0.4}, 1.2), Vec3d(1e9, -2e9, 3e9), 3);
    scene.settings.step = 0.25;
    const Picture near = draw_on(gl, h, field, scene);
    scene.settings.point_light->position *= 1e200;
    const Picture far = draw_on(gl, h, field, scene);
    EXPECT_LE(difference(near, far), 1e-5);
    EXPECT_LE(difference(far, HierarchyReference(h, 0, {c.filter}).render(scene, 0.25)), 5e-3);
  });
}

// ---- the double reference, and other encodings ----

TransferFunction hills() {
  TransferFunction tf;
  tf.extinction = {{0.3, 0}, {0.5, 0}, {0.65, 12}, {1.0, 25}};
  tf.color = {{0.4, {1, 0.2, 0}}, {0.7, {0, 1, 0.3}}, {0.9, {0.1, 0.2, 1}}};
  return tf;
}

Scene hill_scene(Mode mode = Mode::dvr) {
  Scene scene = lit_scene(perspective({2.2, -1.4, 1.6}, kMiddle), {0.2, 0.3, 1.4}, 1, 0.1);
  scene.transfer_function = hills();
  scene.settings.mode = mode;
  if (mode == Mode::dvr_iso) {
    scene.settings.isosurfaces.values = {0.45, 0.6};
    scene.settings.isosurfaces.opacity = {0.5, 0.8};
    scene.settings.isosurfaces.shading = Shading::none;
  }
  return scene;
}

/// Pixels of which a channel differs by more than `bound`.
int pixels_off(const Picture& a, const Picture& b, double bound) {
  int count = 0;
  for (int i = 0; i < kPixels * kPixels; ++i) {
    const double* p = a.pixel(i % kPixels, i / kPixels);
    const double* q = b.pixel(i % kPixels, i / kPixels);
    bool is_off = false;
    for (int c = 0; c < 4; ++c) is_off = is_off || !(std::abs(p[c] - q[c]) <= bound);
    count += is_off ? 1 : 0;
  }
  return count;
}

TEST(Lamp, ConvergesToTheReferenceInEveryFilter) {
  // a ray that grazes a surface meets it or does not: one or two of 100 pixels. Jumps of f between cells (nearest) make the error
  // of order one, half an interval at each face
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for (const Mode mode : {Mode::dvr, Mode::dvr_iso}) {
      std::map<std::string, Picture> references;
      for_each_filter([&](const EncodingCase& c) {
        SCOPED_TRACE(mode_name(mode));
        const EncodedField field = build(h, c, {.storage = Storage::r64f});
        Scene scene = hill_scene(mode);
        const std::string key = fmt::format("{} {} {}", filter_name(field.definition.filter), field.definition.page_size,
                                            field.definition.page_level);
        if (!references.contains(key)) references.emplace(key, HierarchyReference(h, 0, field.definition).render(scene, 0.5));
        std::vector<double> errors;
        Picture drawn;
        for (const double step : {1.0, interpolating(c) ? 0.1 : 0.05}) {
          scene.settings.step = scene.settings.point_light->shadow_step = step;
          drawn = render_on_cpu(h, field, scene, true);
          errors.push_back(rms_difference(drawn, references.at(key)));
        }
        const bool surfaces = mode == Mode::dvr_iso;
        EXPECT_LE(errors[1], surfaces ? 2e-2 : 3e-3);
        EXPECT_LE(pixels_off(drawn, references.at(key), 3e-2), surfaces ? 2 : 0);
        EXPECT_LT(errors[1], errors[0]);
        scene.settings.point_light->position = {0.8, 0.7, -0.4};
        EXPECT_GT(rms_difference(render_on_cpu(h, field, scene, true), references.at(key)), 4 * errors[1])
            << "control: the lamp elsewhere";
      });
    }
}

TEST(Lamp, InEncodingsOfOneFilterDiffersByTheSecondaryRaysRegionsAlone) {
  // the primary ray is on the lattice: opacity is equal to the bit. Secondary rays are adaptive in each encoding's regions; with
  // intervals of 1/4 cell pictures differ by at most 2e-2, of cell regions of nearest (exact) and large ones too
  const AmrHierarchy h = nested(waves).hierarchy();
  std::map<Filter, Picture> first;
  const auto is_one_field = [](const EncodingCase& c) { return c.filter != Filter::linear_page; };  // there a page size is
  GlPairs(2, is_one_field).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField field = build(h, c);
    Scene scene = hill_scene();
    scene.settings.sampling = Sampling::lattice;
    scene.settings.step = 0.7;
    scene.settings.point_light->shadow_step = 0.25;
    const Picture picture = draw_on(gl, h, field, scene);
    const auto [it, is_first] = first.emplace(c.filter, picture);
    EXPECT_LE(difference(picture, it->second), 2e-2);
    scene.settings.point_light.reset();
    const Picture plain = draw_on(gl, h, field, scene);
    for (int i = 0; i < kPixels * kPixels; ++i)
      EXPECT_EQ(picture.pixel(i % kPixels, i / kPixels)[3], plain.pixel(i % kPixels, i / kPixels)[3]) << "light is no opacity";
    EXPECT_GT(difference(picture, plain), 0.1);
  });
}

TEST(Lamp, IsTheSameToTheBitWithAndWithoutSkipping) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  GlPairs(2).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField field = build(h, c);
    Scene scene = hill_scene();
    scene.settings.skip = true;
    const Picture with = draw_on(gl, h, field, scene);
    scene.settings.skip = false;
    EXPECT_EQ(difference(draw_on(gl, h, field, scene), with), 0);
    EXPECT_GT(largest(with), 0.05);
  });
}

TEST(Lamp, SamplesOfSecondaryRaysCountAndTheRaysDoNot) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1).for_each([&](const EncodingCase& c) {  // the counters stand in the marching loop, which knows no encoding
    const EncodedField field = build(h, c);
    Scene scene = hill_scene();
    WorkCounts lit, plain;
    draw(context(ContextKind::egl), h, field, scene, &lit);
    scene.settings.point_light.reset();
    draw(context(ContextKind::egl), h, field, scene, &plain);
    EXPECT_GT(lit.samples, 2 * plain.samples);
    EXPECT_GT(lit.regions, plain.regions);
    EXPECT_EQ(lit.rays, plain.rays) << "a ray is a pixel's";
  });
}

TEST(Lamp, OnGlAndOnTheCpuUpToFloats) {
  const AmrHierarchy h = nested(waves, {4, 2}).hierarchy();
  // without values between cells a sample at a face may take either
  GlPairs(2, interpolating).for_each([&](const EncodingCase& c) {
    // linear_lod and linear_page jump between levels
    const double tolerance = c.filter == Filter::linear_vertex ? 2e-4 : 3e-2;
    const EncodedField field = build(h, c);
    EXPECT_LE(difference(draw(context(ContextKind::egl), h, field, hill_scene()), render_on_cpu(h, field, hill_scene(), true)),
              tolerance);
  });
}

TEST(Lamp, LightsASurfaceInTheVolume) {
  // f = x, an opaque surface at x = 1/2 that the rays meet: C = c (integral up to it) + T c_s light(hit)
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.x; }).hierarchy();
  const GlPairs on_gl(2, interpolating);
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;  // its surface is a face beside
    Scene scene = lit_scene(orthographic({0.5, 0.5, 0.5}, {1, 0.3, 0.2}, 0.4), {-0.4, 0.8, 0.9}, 2);
    scene.settings.mode = Mode::dvr_iso;
    scene.settings.step = 0.25;
    scene.settings.isosurfaces.values = {0.5};
    scene.settings.isosurfaces.color = {{0, {0.2, 0.9, 0.4}}};
    scene.settings.isosurfaces.shading = Shading::none;
    const Medium medium{Vec3d(0), Vec3d(1), 2};
    const Picture in_double = render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true);
    const Picture reference = HierarchyReference(h, 0, {c.filter, 0, 0}).render(scene, 0.25);
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x) {
        const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
        const double hit = (0.5 - ray.origin.x) / ray.direction.x;
        const auto [from, to] = stretch(medium, ray.origin, ray.direction, hit);
        const double surface =
            std::exp(-2 * (to - from)) * light_at(medium, *scene.settings.point_light, ray.origin + hit * ray.direction);
        const double expected = kColor.g * light_of_ray(medium, scene, x, y, hit) + 0.9 * surface;
        EXPECT_NEAR(in_double.pixel(x, y)[1], expected, 1e-4);
        EXPECT_NEAR(reference.pixel(x, y)[1], expected, 1e-6);
      }
    if (on_gl.has(c)) {
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, build(h, c), scene), in_double), 1e-4);
    }
  });
}

TEST(Lamp, CastsShadowsOfWhatIsDrawnAlone) {
  // the region leaves out what lies between the lamp and the rest: the light is that of the medium in the region
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(constant(1)).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    Scene scene = lit_scene(orthographic(kMiddle, {0.2, 1, 0.1}, 1), {2, 0.5, 0.5}, 3);
    scene.region = {Vec3d(0.1, 0.2, 0.3), Vec3d(0.6, 0.7, 0.8)};
    scene.settings.step = 0.25;
    const Medium medium{(*scene.region)[0], (*scene.region)[1], 3};
    const Picture expected = closed_form(medium, scene);
    EXPECT_LE(off(render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true), expected), 1e-4);
    if (c.filter != Filter::nearest) return;
    EXPECT_LE(off(HierarchyReference(h, 0, {c.filter}).render(scene, 0.25), expected), 1e-6);
  });
}

// ---- what is left out, and what is refused ----

TEST(Lamp, LeavesNothingInPicturesWithoutOne) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    Scene scene = hill_scene();
    const auto bound = [&] {
      const SceneBindings b = bind_scene(h, field, scene);
      const auto define =
          std::find_if(b.defines.begin(), b.defines.end(), [](const auto& d) { return d.first == "AMRTEX_SHADOWS"; });
      EXPECT_NE(define, b.defines.end());
      const bool uniforms =
          std::any_of(b.uniforms.begin(), b.uniforms.end(), [](const UniformValue& u) { return u.name == "u_lamp"; });
      EXPECT_EQ(uniforms, define->second == 1);
      return define->second;
    };
    EXPECT_EQ(bound(), 1);
    scene.settings.point_light.reset();
    EXPECT_EQ(bound(), 0);
  });
}

TEST(Lamp, IsRefusedByNameWithWhatIsAccepted) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(waves).hierarchy();
  const EncodingCase& c = encoding_cases().front();
  const auto complaint = [&](const std::function<void(RenderSettings&)>& spoil) {
    Scene scene = hill_scene();
    spoil(scene.settings);
    std::string on_gl, reference;
    try {
      bind_scene(h, build(h, c), scene);
    } catch (const UsageError& e) {
      on_gl = e.what();
    }
    try {
      HierarchyReference(h, 0, {c.filter}).render(scene, 1);
    } catch (const UsageError& e) {
      reference = e.what();
    }
    EXPECT_EQ(on_gl, reference);
    return on_gl;
  };
  for (const double bad : {kNan, kInf})
    EXPECT_THAT(complaint([&](RenderSettings& s) { s.point_light->position.y = bad; }),
                AllOf(HasSubstr("'point_light'"), HasSubstr("a number is expected")));
  for (const double bad : {-0.1, 1.1, kNan})
    EXPECT_THAT(complaint([&](RenderSettings& s) { s.point_light->ambient = bad; }),
                AllOf(HasSubstr("'ambient'"), HasSubstr("from 0 to 1")));
  for (const double bad : {0.0, -1.0, kNan, kInf})
    EXPECT_THAT(complaint([&](RenderSettings& s) { s.point_light->shadow_step = bad; }),
                AllOf(HasSubstr("'shadow_step'"), HasSubstr("above 0")));
  for (const Mode mode : {Mode::projection, Mode::mip, Mode::iso})
    EXPECT_THAT(complaint([&](RenderSettings& s) {
                  s.mode = mode;
                  s.isosurfaces.values = {0.5};
                }),
                AllOf(HasSubstr("'point_light'"), HasSubstr("dvr and dvr_iso"), HasSubstr(std::string(mode_name(mode)))));
  EXPECT_THAT(complaint([](RenderSettings& s) {
                s.mode = Mode::dvr_iso;
                s.isosurfaces.values = {0.5};
                s.isosurfaces.output = Output::depth;
              }),
              AllOf(HasSubstr("output color"), HasSubstr("depth")));
}

}  // namespace
}  // namespace amrtex
