// Values, offsets, lengths and aspects of any scale: closed forms that hold at each, for every encoding.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "bench/measure/scene_data.hpp"
#include "bench/measure/value_resolution.hpp"
#include "bench/numbers/image_error.hpp"
#include "bench/settings/experiment.hpp"
#include "bench/verify/thin_cells.hpp"
#include "renderers/bindings/finest_camera.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/stored_units.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;

// ---- values ----

/// f = offset + scale x over the unit cube.
struct Ramp {
  double offset, scale;

  static constexpr int kCells = 16;
  double of(double x) const { return offset + scale * x; }
  /// Of 16 x 4 x 4 cells: every filter is the line between the outer centres, and constant beyond them.
  AmrHierarchy mesh() const {
    return MeshBuilder({kCells, 4, 4}).root([*this](const Vec3d& p) { return of(p.x); }).hierarchy();
  }
  /// The x whose value stands at x: the cell's centre; no further than the outer centres; or with vertices half as fast beyond
  /// the outer ones, whose value is their only cell's.
  static double place(Filter filter, double x) {
    constexpr double kWidth = 1.0 / kCells;
    if (filter == Filter::nearest) return (std::floor(x * kCells) + 0.5) * kWidth;
    if (filter != Filter::linear_vertex) return std::clamp(x, 0.5 * kWidth, 1 - 0.5 * kWidth);
    return x < kWidth ? (x + kWidth) / 2 : x > 1 - kWidth ? (x + 1 - kWidth) / 2 : x;
  }
  /// What doubles of cells may be off by, in parts of the scale.
  double rounding() const { return std::abs(offset) / scale * 0x1p-52; }
};

constexpr Ramp kPlain{0, 1};
constexpr std::array kRamps{kPlain,          Ramp{0, 1e-40},   Ramp{0, 1e-300}, Ramp{0, 1e35},      Ramp{0, 1e300},
                            Ramp{1e8, 1e-3}, Ramp{-1e8, 1e-3}, Ramp{1e15, 64},  Ramp{3e-30, 1e-36}, Ramp{-2e200, 1e190}};

std::string name_of(const Ramp& ramp) { return fmt::format("{} + {} x", ramp.offset, ramp.scale); }

/// Rays along y over columns of x: each sees one value over a length of 1.
Scene columns(Mode mode, int pixels = 16) {
  Scene scene = small_scene(mode, orthographic(Vec3d(0.5), {0, 1, 0}, 1), Sampling::lattice, pixels);
  scene.settings.height = 2;
  scene.view.height = 2.0 / pixels;
  scene.settings.step = 0.5;
  return scene;
}

/// Extinction from 0 to 4 over the ramp.
TransferFunction ramp_light(const Ramp& ramp) {
  TransferFunction tf;
  tf.extinction = {{ramp.offset, 0}, {ramp.of(1), 4}};
  tf.color = {{ramp.offset, Vec3d(1)}};
  return tf;
}

Scene light_scene(const Ramp& ramp) {
  Scene scene = columns(Mode::dvr);
  scene.transfer_function = ramp_light(ramp);
  return scene;
}

/// Largest difference to `expected(x)`, x from 0 to 1 over the columns from the left, which is told in parts of `unit`.
template <class Expected>
double worst(const Picture& picture, int channel, const Expected& expected, double unit = 1) {
  double largest = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double off = std::abs(picture.pixel(x, y)[channel] - expected((x + 0.5) / picture.width)) / unit;
      largest = std::max(largest, std::isnan(off) ? kInf : off);
    }
  return largest;
}

/// Opacity of a column: the curve goes from 0 to 4 over a length of 1.
double ramp_opacity(Filter filter, double x) { return -std::expm1(-4 * Ramp::place(filter, x)); }

/// In parts of the range: 2^-20 that floats may lose, and float sums; half a quantum by which samples are off, 2^-13 of a cell;
/// the doubles of the file.
double tolerance_of(const Ramp& ramp) { return 4e-6 + 0x1p-13 / Ramp::kCells + 4 * ramp.rounding(); }

void expect_opacities(const Picture& picture, Filter filter, const Ramp& ramp) {
  EXPECT_LE(worst(picture, 3, [&](double x) { return ramp_opacity(filter, x); }), 4 * tolerance_of(ramp));
}

void expect_values(const Picture& picture, Filter filter, const Ramp& ramp) {
  EXPECT_LE(worst(
                picture, 0, [&](double x) { return ramp.of(Ramp::place(filter, x)); }, ramp.scale),
            tolerance_of(ramp));
}

TEST(Units, ArePlainForOrdinaryFieldsAndFollowFromValuesAlone) {
  // b is a power of two, and numbers are normal floats
  for (const auto& [min, max, least] :
       {std::array{0.0, 1.0, 1e-30}, std::array{-20.0, 40.0, 1e-3}, std::array{0.7, 0.7, 0.7}, std::array{1000.0, 1100.0, 1000.0},
        std::array{0.0, 1.0, 1e-300}, std::array{1e-30, 1e30, 1e-30}, std::array{0.0, 0.0, 0.0}}) {
    FieldStatistics s;
    s.min = min;
    s.max = max;
    s.least_magnitude = least;
    EXPECT_TRUE(value_units(s).plain()) << min << " " << max << " " << least;
  }
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    const FieldStatistics& s = h.statistics(0);
    const ValueUnits units = value_units(s);
    EXPECT_EQ(std::exp2(std::ilogb(units.scale)), units.scale) << name_of(ramp);
    EXPECT_EQ(units.plain(), ramp.offset == 0 && ramp.scale == 1) << name_of(ramp);
    for (const double v : {s.min, s.max, ramp.of(0.34375)}) {
      EXPECT_EQ(units.value(units.number(v)), v) << name_of(ramp);
      EXPECT_LE(std::abs(units.number(v)), kMostNumber);
    }
    EXPECT_GE(units.number(s.max) - units.number(s.min), 0.1);
  }
}

TEST(Units, AreTheSameForAllEncodingsAndFilters) {
  for (const Ramp& ramp : {kRamps[1], kRamps[5]}) {
    const AmrHierarchy h = ramp.mesh();
    for_each_filter([&](const EncodingCase& c) { EXPECT_EQ(build(h, c).scale.units, value_units(h.statistics(0))); });
  }
}

TEST(Values, OfAnyScaleGiveTheLightOfTheirClosedForm) {
  // kappa = 4 (f - offset) / scale over a length of 1: opacity 1 - exp(-kappa)
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    const Scene scene = light_scene(ramp);
    SCOPED_TRACE(name_of(ramp));
    for_each_filter([&](const EncodingCase& c) {
      expect_opacities(render_on_cpu(h, build(h, c), scene, false), c.filter, ramp);
      expect_opacities(render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true), c.filter, ramp);
    });
    for (const Filter filter : {Filter::nearest, Filter::linear_vertex, Filter::basis})
      expect_opacities(HierarchyReference(h, 0, {filter}).render(scene, 1.0 / 16), filter, ramp);
  }
}

TEST(Values, OfAnyScaleGiveTheirProjectionsAndMaxima) {
  // over a length of 1 both are f itself
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    SCOPED_TRACE(name_of(ramp));
    for (const Mode mode : {Mode::projection, Mode::mip}) {
      const Scene scene = columns(mode);
      SCOPED_TRACE(mode_name(mode));
      for_each_filter([&](const EncodingCase& c) {
        expect_values(render_on_cpu(h, build(h, c), scene, false), c.filter, ramp);
        expect_values(render_on_cpu(h, build(h, c, {.storage = Storage::r64f}), scene, true), c.filter, ramp);
      });
      for (const Filter filter : {Filter::nearest, Filter::linear_vertex, Filter::basis})
        expect_values(HierarchyReference(h, 0, {filter}).render(scene, 1.0 / 16), filter, ramp);
    }
  }
}

TEST(Values, OfAnyScaleHaveTheirIsosurfaceWhereTheyAre) {
  // f = offset + 0.34 scale lies at x = 0.34
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    Scene scene = small_scene(Mode::iso, orthographic(Vec3d(0.5), {1, 0, 0}, 0.5), Sampling::lattice, 4);
    scene.settings.isosurfaces.values = {ramp.of(0.34)};
    scene.settings.isosurfaces.output = Output::depth;
    const double depth = 2.5 + 0.34;  // the eye stands at x = -2.5
    SCOPED_TRACE(name_of(ramp));
    for_each_filter([&](const EncodingCase& c) {
      if (c.filter == Filter::nearest) return;
      const Picture picture = render_on_cpu(h, build(h, c), scene, false);
      EXPECT_LE(worst(picture, 0, [&](double) { return depth; }), 1e-3 / Ramp::kCells + 4 * ramp.rounding());
    });
    const Picture reference = HierarchyReference(h, 0, {Filter::linear_vertex}).render(scene, 1.0 / 16);
    EXPECT_LE(worst(reference, 0, [&](double) { return depth; }), 1e-12 + 4 * ramp.rounding());
  }
}

TEST(Values, OfAnyScaleAreDrawnOnGl) {
  Context& gl = context(ContextKind::egl);
  for (const Ramp& ramp : {kRamps[1], kRamps[4], kRamps[5]}) {
    const AmrHierarchy h = ramp.mesh();
    SCOPED_TRACE(name_of(ramp));
    GlPairs(2).for_each([&](const EncodingCase& c) {
      const EncodedField field = build(h, c);
      expect_opacities(draw(gl, h, field, light_scene(ramp)), c.filter, ramp);
      expect_values(draw(gl, h, field, columns(Mode::mip)), c.filter, ramp);
      expect_values(draw(gl, h, field, columns(Mode::projection)), c.filter, ramp);
    });
  }
}

TEST(Values, OfAnyScaleAreSkippedWhereTheyAreHidden) {
  // a picture with skipping is that without, and something is skipped
  Context& gl = context(ContextKind::egl);
  for (const Ramp& ramp : {kRamps[1], kRamps[5]}) {
    const AmrHierarchy h = ramp.mesh();
    Scene scene = light_scene(ramp);
    scene.transfer_function.extinction.insert(scene.transfer_function.extinction.begin() + 1, {ramp.of(0.5), 0});
    const EncodedField field = build(h, {&find_encoding("page_table"), Filter::nearest, Json{{"page_size", 4}}});
    const Picture full = draw(gl, h, field, scene);
    scene.settings.skip = true;
    WorkCounts some;
    EXPECT_EQ(difference(draw(gl, h, field, scene, &some), full), 0) << name_of(ramp);
    EXPECT_GT(some.regions_skipped, 0) << name_of(ramp);
  }
}

TEST(Values, InOtherStoragesKeepTheirResolutionAtAnyScale) {
  // half of one of 65535 levels of the range
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    const EncodingCase c = default_case(find_encoding("uniform"), Filter::nearest);
    const Picture picture = render_on_cpu(h, build(h, c, {.storage = Storage::r16}), light_scene(ramp), false);
    const auto expected = [&](double x) { return ramp_opacity(Filter::nearest, x); };
    EXPECT_LE(worst(picture, 3, expected), 4.0 / 131070 + 4 * tolerance_of(ramp)) << name_of(ramp);
  }
}

TEST(Values, AsPlainFloatsWouldDrawNothing) {
  // the control: opacities of 0.86 and more at the right
  for (const Ramp& ramp : {kRamps[1], kRamps[5]}) {
    const AmrHierarchy h = ramp.mesh();
    const EncodingCase c = default_case(find_encoding("uniform"), Filter::nearest);
    const Picture picture = render_on_cpu(h, as_plain_floats(build(h, c)), light_scene(ramp), false);
    EXPECT_GT(worst(picture, 3, [](double x) { return ramp_opacity(Filter::nearest, x); }), 0.5) << name_of(ramp);
  }
}

TEST(Values, InPlainUnitsHaveThePicturesOfPlainFloatsToTheBit) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Scene scene = small_scene(Mode::dvr, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::adaptive);
  scene.transfer_function = peaks();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    EXPECT_EQ(field.scale.offset, 0);
    EXPECT_EQ(field.scale.scale, 1);
    EXPECT_EQ(difference(render_on_cpu(h, field, scene, false), render_on_cpu(h, as_plain_floats(field), scene, false)), 0);
  });
}

TEST(Values, TimesAPowerOfTwoHaveTheSamePictureToTheBit) {
  // units take the factor out again
  const double factor = std::ldexp(1.0, -200);
  Scene scene = small_scene(Mode::dvr, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::adaptive);
  scene.transfer_function = peaks();
  Scene small = scene;
  for (auto& p : small.transfer_function.extinction) p.value *= factor;
  for (auto& p : small.transfer_function.color) p.value *= factor;
  const AmrHierarchy h = nested(waves).hierarchy();
  const AmrHierarchy scaled = nested([=](const Vec3d& p) { return factor * waves(p); }).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const Picture expected = render_on_cpu(h, build(h, c), scene, false);
    EXPECT_EQ(difference(render_on_cpu(scaled, build(scaled, c), small, false), expected), 0);
  });
}

// ---- logarithmic axes ----

TEST(LogAxis, OfValuesBelowAndAboveFloatsGivesItsClosedForm) {
  // f = s 10^(4 x), kappa from 0 to 4 over log10 f from log10 s to log10 s + 4: opacity 1 - exp(-4 log10(f / s) / 4)
  for (const double s : {1e-42, 1e-300, 1e-2, 1e36, 1e290}) {
    const AmrHierarchy h =
        MeshBuilder({Ramp::kCells, 4, 4}).root([=](const Vec3d& p) { return s * std::pow(10, 4 * p.x); }).hierarchy();
    Scene scene = columns(Mode::dvr);
    scene.transfer_function.logarithmic = true;
    scene.transfer_function.extinction = {{s, 0}, {s * 1e4, 4}};
    scene.transfer_function.color = {{s, Vec3d(1)}};
    const auto expected = [](double x) { return ramp_opacity(Filter::nearest, x); };
    for (const Encoding* encoding : all_encodings()) {
      const EncodingCase c = default_case(*encoding, Filter::nearest);
      EXPECT_LE(worst(render_on_cpu(h, build(h, c), scene, false), 3, expected), 2e-5) << s << " " << encoding->name();
    }
    EXPECT_LE(worst(HierarchyReference(h, 0, {Filter::nearest}).render(scene, 1), 3, expected), 1e-9) << s;
  }
}

TEST(LogAxis, OfValuesWithAnOffsetGivesItsClosedForm) {
  // kappa = 4 log(f / offset) / log(1 + scale / offset)
  for (const Ramp& ramp : {Ramp{1e8, 1e-3}, Ramp{300, 4}, Ramp{20, 1}}) {
    const AmrHierarchy h = ramp.mesh();
    Scene scene = light_scene(ramp);
    scene.transfer_function.logarithmic = true;
    ASSERT_FALSE(value_units(h.statistics(0)).plain());
    const auto expected = [&](double x) {
      const double above = ramp.scale * Ramp::place(Filter::nearest, x) / ramp.offset;
      return -std::expm1(-4 * std::log1p(above) / std::log1p(ramp.scale / ramp.offset));
    };
    const EncodingCase c = default_case(find_encoding("uniform"), Filter::nearest);
    EXPECT_LE(worst(render_on_cpu(h, build(h, c), scene, false), 3, expected), 4 * tolerance_of(ramp) + 1e-5) << name_of(ramp);
    EXPECT_LE(worst(HierarchyReference(h, 0, {Filter::nearest}).render(scene, 1), 3, expected), 4 * tolerance_of(ramp));
  }
}

TEST(LogAxis, OfMoreThanAFloatHoldsIsRefused) {
  // f from 1e-200 to 1: no unit holds both
  const AmrHierarchy h = MeshBuilder({16, 4, 4}).root([](const Vec3d& p) { return std::pow(10, 200 * (p.x - 1)); }).hierarchy();
  const EncodedField field = build(h, default_case(find_encoding("uniform"), Filter::nearest));
  Scene scene = columns(Mode::dvr);
  scene.transfer_function.logarithmic = true;
  scene.transfer_function.extinction = {{1e-200, 0}, {1, 4}};
  scene.transfer_function.color = {{1, Vec3d(1)}};
  EXPECT_THROW(render_on_cpu(h, field, scene, false), UnsupportedError);
  scene.transfer_function.extinction = {{1e-30, 0}, {1, 4}};  // constant below what floats hold
  EXPECT_NO_THROW(render_on_cpu(h, field, scene, false));
}

TEST(LogAxis, TakesWhatIsNotAboveZeroForItsFirstPoint) {
  const AmrHierarchy h = MeshBuilder({4, 4, 4}).root(constant(0)).hierarchy();
  Scene scene = columns(Mode::dvr);
  scene.transfer_function.logarithmic = true;
  scene.transfer_function.extinction = {{1e-42, 2}, {1e-38, 0}};
  scene.transfer_function.color = {{1, Vec3d(1)}};
  const EncodedField field = build(h, default_case(find_encoding("uniform"), Filter::nearest));
  EXPECT_NEAR(render_on_cpu(h, field, scene, false).pixel(0, 0)[3], -std::expm1(-2.0), 1e-6);
}

// ---- what is stored too coarsely ----

TEST(Resolution, IsToldWhereACurveOrAnIsovalueAsksForMore) {
  // 0 beside 1e8 + 1e-3 x: half an ulp is 4
  const auto f = [](const Vec3d& p) { return p.z < 0.5 ? 0 : 1e8 + 1e-3 * p.x; };
  const AmrHierarchy h = MeshBuilder({16, 4, 4}).root(f).hierarchy();
  const EncodingCase c = default_case(find_encoding("uniform"), Filter::nearest);
  const EncodedField field = build(h, c);
  Scene scene = columns(Mode::dvr);
  scene.transfer_function = ramp_light({1e8, 1e-3});
  const ValueResolution curve = value_resolution(field, scene);
  ASSERT_TRUE(curve.extinction);
  EXPECT_EQ(*curve.extinction, 1);  // all of it
  EXPECT_EQ(curve.warnings().size(), 1U);
  scene.settings.mode = Mode::iso;
  scene.settings.isosurfaces.values = {1e8 + 3e-4};
  const ValueResolution isovalue = value_resolution(field, scene);
  ASSERT_TRUE(isovalue.isovalue);
  EXPECT_NEAR(*isovalue.isovalue, 1e8 * 0x1p-24, 1);
  EXPECT_FALSE(isovalue.extinction);
}

TEST(Resolution, IsFineForCurvesThatStoredValuesFollow) {
  for (const Ramp& ramp : kRamps) {
    const AmrHierarchy h = ramp.mesh();
    const EncodedField field = build(h, default_case(find_encoding("uniform"), Filter::nearest));
    EXPECT_TRUE(value_resolution(field, light_scene(ramp)).fine()) << name_of(ramp);
  }
}

// ---- thin cells ----

TEST(ThinCells, HaveTheThicknessThatTheyHaveAtAnyAspect) {
  Context& gl = context(ContextKind::egl);
  for (const double aspect : {1.0, 30.0, 1e2, 1e3, 1e4, 1e5, 1e6})
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      const AmrHierarchy h = verify::thin_mesh(aspect);
      const Scene scene = verify::thin_scene(aspect, sampling);
      SCOPED_TRACE(fmt::format("aspect {} {}", aspect, sampling_name(sampling)));
      for_each_filter([&](const EncodingCase& c) {
        EXPECT_LE(verify::thin_error(render_on_cpu(h, build(h, c), scene, false), scene, h), 1e-5);
      });
      GlPairs(2).for_each([&](const EncodingCase& c) {
        if (aspect != 1e4 && aspect != 1e6) return;
        EXPECT_LE(verify::thin_error(draw(gl, h, build(h, c), scene), scene, h), 1e-5);
      });
      EXPECT_LE(verify::thin_error(HierarchyReference(h, 0, {Filter::nearest}).render(scene, 1), scene, h), 1e-9);
    }
}

TEST(ThinCells, NeedRaysInDouble) {
  EXPECT_FALSE(needs_double_rays(nested(waves).hierarchy(),
                                 small_scene(Mode::dvr, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::lattice)));
  for (const double aspect : {1e2, 1e4, 1e6})
    EXPECT_TRUE(needs_double_rays(verify::thin_mesh(aspect), verify::thin_scene(aspect, Sampling::lattice)));
  // cubic cells in a thin slab, and a thin box of a cube, are as thin
  const AmrHierarchy slab = MeshBuilder({512, 512, 1}, {}, Vec3d(0), {512, 512, 1}).root(constant(2)).hierarchy();
  EXPECT_TRUE(
      needs_double_rays(slab, small_scene(Mode::projection, perspective({256, -300, 500}, {256, 256, 0}), Sampling::lattice)));
}

// ---- lengths ----

struct Place {
  Vec3d lower;
  double edge;
};
constexpr double kEdges[] = {1e-100, 1e-38, 1e-20, 1, 1e25, 1e100};

Scene cube_scene(Mode mode, const Place& place, int pixels = 2) {
  const Vec3d at = place.lower + Vec3d(0.5 * place.edge);
  Scene scene = small_scene(mode, orthographic(at, Vec3d(0, place.edge, 0), 0.5 * place.edge), Sampling::adaptive, pixels);
  scene.settings.step = 0.5;
  return scene;
}

AmrHierarchy cube(const Place& place, const Function& f) {
  return MeshBuilder({4, 4, 4}, {}, place.lower, place.lower + Vec3d(place.edge)).root(f).hierarchy();
}

/// The pictures of the CPU in float, of the GL context and of the reference.
std::vector<Picture> pictures(const AmrHierarchy& h, const Scene& scene, Filter filter = Filter::nearest) {
  const EncodingCase c = default_case(find_encoding("kd_tree"), filter);
  const EncodedField field = build(h, c);
  return {render_on_cpu(h, field, scene, false), draw(context(ContextKind::egl), h, field, scene),
          HierarchyReference(h, 0, field.definition).render(scene, 0.25)};
}

void expect_all(const std::vector<Picture>& drawn, int channel, double exact, double tolerance = 2e-6) {
  for (const Picture& p : drawn)
    EXPECT_LE(worst(
                  p, channel, [&](double) { return exact; }, std::abs(exact)),
              tolerance);
}

TEST(Lengths, OfAnyScaleGiveLightProjectionAndDepth) {
  for (const double edge : kEdges) {
    SCOPED_TRACE(edge);
    const Place place{Vec3d(0), edge};
    // kappa = 2 per longest edge, or 2 / edge per world length: opacity 1 - exp(-2)
    const AmrHierarchy h = cube(place, constant(2));
    Scene scene = cube_scene(Mode::dvr, place);
    scene.transfer_function = constant_light(2);
    expect_all(pictures(h, scene), 3, -std::expm1(-2.0));
    scene.transfer_function = constant_light(2 / edge);
    scene.transfer_function.length_unit = TransferFunction::LengthUnit::world;
    expect_all(pictures(h, scene), 3, -std::expm1(-2.0));
    // half of it behind a plane, and in a box
    Scene half = scene;
    half.settings.clip_planes = {{{0, 1 / edge, 0}, 0.5}};
    expect_all(pictures(h, half), 3, -std::expm1(-1.0));
    half = scene;
    half.region = {Vec3d(0), Vec3d(edge, 0.5 * edge, edge)};
    expect_all(pictures(h, half), 3, -std::expm1(-1.0));
    // 2 over a length of `edge`
    expect_all(pictures(h, cube_scene(Mode::projection, place)), 0, 2 * edge);
    // f = y in the middle: the eye stands 2.5 edges before the lower face
    const AmrHierarchy rising = cube(place, [=](const Vec3d& p) { return p.y / edge; });
    Scene depth = cube_scene(Mode::iso, place);
    depth.settings.isosurfaces.values = {0.375};
    depth.settings.isosurfaces.output = Output::depth;
    expect_all(pictures(rising, depth, Filter::linear_lod), 0, (2.5 + 0.375) * edge, 1e-4);
  }
}

TEST(Lengths, AtAFarOriginAreThoseOfTheFilesDoubles) {
  // 1e-3 at 1e9: what the doubles of both corners leave of it
  const Place place{Vec3d(1e9), 1e-3};
  const AmrHierarchy h = cube(place, constant(2));
  const double length = h.domain_upper().y - h.domain_lower().y;
  Scene scene = cube_scene(Mode::projection, place);
  scene.view.eye = {0.5 * (h.domain_lower().x + h.domain_upper().x), h.domain_lower().y - 2e-3,
                    0.5 * (h.domain_lower().z + h.domain_upper().z)};
  scene.view.at = scene.view.eye + Vec3d(0, 1e-3, 0);
  expect_all(pictures(h, scene), 0, 2 * length);
}

TEST(Lengths, ThatDoublesDoNotTellApartAreRefused) {
  const Place place{Vec3d(0), 1};
  const AmrHierarchy h = cube(place, constant(2));
  const EncodedField field = build(h, default_case(find_encoding("uniform"), Filter::nearest));
  Scene scene = cube_scene(Mode::projection, place);
  scene.view.eye.y = -1e15;
  EXPECT_THROW(render_on_cpu(h, field, scene, false), UnsupportedError);
  EXPECT_THROW(HierarchyReference(h, 0, {Filter::nearest}).render(scene, 1), UnsupportedError);
  const Place vast{Vec3d(0), 1e200};
  const AmrHierarchy too_large = cube(vast, constant(2));
  EXPECT_THROW(render_on_cpu(too_large, build(too_large, default_case(find_encoding("uniform"), Filter::nearest)),
                             cube_scene(Mode::projection, vast), false),
               UnsupportedError);
}

TEST(Products, OfValuesAndLengthsAreDoubles) {
  // value times length: 1e30 over 1e10, 2 over 1e-38, and what neither float nor its exponent holds
  for (const auto& [value, edge] : {std::pair{1e30, 1e10}, std::pair{2.0, 1e-38}, std::pair{3e38, 1e4}, std::pair{1e-30, 1e-30},
                                    std::pair{1e150, 1e100}, std::pair{1e-150, 1e-100}, std::pair{-1e300, 1e-100}}) {
    const Place place{Vec3d(0), edge};
    const AmrHierarchy h = cube(place, constant(value));
    SCOPED_TRACE(fmt::format("{} over {}", value, edge));
    expect_all(pictures(h, cube_scene(Mode::projection, place)), 0, value * edge);
  }
  const Place place{Vec3d(0), 1e100};
  const AmrHierarchy h = cube(place, constant(1e250));
  EXPECT_THROW(render_on_cpu(h, build(h, default_case(find_encoding("uniform"), Filter::nearest)),
                             cube_scene(Mode::projection, place), false),
               UnsupportedError);
}

TEST(Products, AreWrittenInDoubleWhereFloatsDoNotHoldThem) {
  const fs::path path = fs::temp_directory_path() / fmt::format("amrtex_scales_{}.npy", ::getpid());
  for (const auto& values :
       {std::vector<double>{1e40, 2e40}, std::vector<double>{2e-45, 0}, std::vector<double>{1e8 + 0.25, 1e8}}) {
    Picture picture(2, 1, 1);
    picture.values = values;
    write_npy(picture, path, false);
    EXPECT_EQ(read_npy(path).values, values);
  }
  Picture ordinary(2, 1, 1);
  ordinary.values = {0.1, 0.7};
  write_npy(ordinary, path, false);
  EXPECT_EQ(read_npy(path).values[0], static_cast<double>(0.1F));
  fs::remove(path);
}

TEST(Products, HaveErrorsOfTheirOwnScale) {
  for (const double scale : {1e-200, 1.0, 1e200}) {
    Picture a(2, 1, 1), b(2, 1, 1);
    a.values = {1 * scale, 3 * scale};
    b.values = {1 * scale, 2 * scale};
    const ErrorMetrics error = compare(a, b);
    EXPECT_DOUBLE_EQ(error.rmse / scale, std::sqrt(0.5));
    EXPECT_DOUBLE_EQ(error.max / scale, 1);
    ASSERT_TRUE(error.psnr_db);
    EXPECT_NEAR(*error.psnr_db, 20 * std::log10(std::sqrt(2.0)), 1e-9);
  }
}

// ---- optional data: inputs that once failed ----

struct Drawn {
  Scene scene;
  std::vector<Picture> pictures;  ///< CPU in float, GL, reference
};

Drawn draw_case(const char* file) {
  const Experiment scene = read_scene(kFailingInputs / file);
  const BuildPoint& point = scene.builds.front();
  const AmrHierarchy h = load_dataset(scene, scene.datasets[point.dataset]);
  const Scene drawn = scene_of(scene, scene.renders.front());
  const EncodedField field = build(h, {&find_encoding(point.encoding), point.filter, point.parameters});
  return {drawn,
          {render_on_cpu(h, field, drawn, false), draw(context(ContextKind::egl), h, field, drawn),
           HierarchyReference(h, 0, field.definition).render(drawn, 1.0 / 16)}};
}

TEST(Cases, ThinAspectOf1e4) {
  AMRTEX_NEEDS(kFailingInputs, "thin_aspect_1e4.json");
  const Drawn drawn = draw_case("thin_aspect_1e4.json");
  // 2 over a thickness of 1, seen 3e-6 off 45 degrees
  for (const Picture& p : drawn.pictures)
    EXPECT_LE(worst(
                  p, 0, [](double) { return 2.828436; }, 2.828436),
              1e-5);
}

TEST(Cases, ValuesOf1em40) {
  AMRTEX_NEEDS(kFailingInputs, "values_1e-40.json");
  const Drawn drawn = draw_case("values_1e-40.json");
  for (const Picture& p : drawn.pictures) EXPECT_LE(worst(p, 3, [](double) { return -std::expm1(-2.0); }), 1e-5);
}

TEST(Cases, OffsetOf1e8) {
  AMRTEX_NEEDS(kFailingInputs, "offset_1e8.json");
  const Drawn drawn = draw_case("offset_1e8.json");
  for (const Picture& p : drawn.pictures) {
    std::vector<double> row;
    for (int x = 0; x < p.width; ++x) row.push_back(p.pixel(x, 0)[3]);
    if (row.front() > row.back()) std::reverse(row.begin(), row.end());
    EXPECT_TRUE(std::is_sorted(row.begin(), row.end()));
    EXPECT_NEAR(row.front(), 0.221, 1e-3);
    EXPECT_NEAR(row.back(), 0.976, 1e-3);
    EXPECT_LE(difference(p, drawn.pictures.back()), 1e-4);
  }
}

}  // namespace
}  // namespace amrtex
