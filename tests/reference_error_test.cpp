// How far the double reference itself may be off: against closed forms in stiff media, against sums of another kind, and what it
// says of itself.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

#include "bench/measure/reference_cache.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/settings/experiment.hpp"
#include "bench/verify/pictures.hpp"
#include "bench/verify/stiff_media.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/reference/nested_rule.hpp"
#include "renderers/reference/piece_function.hpp"
#include "structures/generators/random_mesh.hpp"
#include "tests/optional_data.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;
namespace fs = std::filesystem;

constexpr double kAsked = ReferenceTolerance{}.value;

// ---- quadrature ----

template <std::size_t N>
void expect_exact_to(int degree) {
  const NestedRule<N>& rule = kNestedRule<N>;
  for (int k = 0; k <= degree; ++k) {
    double sum = 0;
    for (std::size_t i = 0; i < N; ++i) sum += rule.weight[i] * std::pow(rule.place[i], k);
    EXPECT_NEAR(sum, 1.0 / (k + 1), 1e-15) << N << " places, degree " << k;
  }
  for (int k = 0; k < static_cast<int>(N); ++k)
    for (std::size_t i = 0; i < N; ++i) {
      double sum = 0;
      for (std::size_t j = 0; j < N; ++j) sum += rule.before[i][j] * std::pow(rule.place[j], k);
      EXPECT_NEAR(sum, std::pow(rule.place[i], k + 1) / (k + 1), 1e-14) << N << " places, degree " << k << ", place " << i;
    }
}

TEST(NestedRules, IntegratePolynomialsExactly) {
  // the integral of s^k over [0, 1] is 1 / (k + 1); up to s_i it is s_i^(k + 1) / (k + 1)
  expect_exact_to<3>(5);
  expect_exact_to<7>(11);
  expect_exact_to<15>(23);
}

TEST(NestedRules, LieWithinEachOther) {
  for (std::size_t k = 0; k < 7; ++k) EXPECT_EQ(kNestedRule<7>.place[k], kNestedRule<15>.place[2 * k + 1]);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(kNestedRule<3>.place[k], kNestedRule<15>.place[4 * k + 3]);
}

// ---- pieces ----

TEST(Pieces, RootsNearTheEndsKeepTheirDigits) {
  for (const double root : {1e-3, 1e-12, 1e-20, 1e-100}) {
    std::array<double, 3> found{};
    ASSERT_EQ(roots_in_unit(Cubic{{-root, 1, 0, 0}}, found), 1) << root;
    EXPECT_NEAR(found[0], root, 1e-15 * root);
    // (s - root)(s^2 + 1) = -root + s - root s^2 + s^3
    ASSERT_EQ(roots_in_unit(Cubic{{-root, 1, -root, 1}}, found), 1) << root;
    EXPECT_NEAR(found[0], root, 1e-14 * root);
  }
}

TEST(Pieces, ExtremaAtAnyScale) {
  // s (1 - s) has its maximum 1/4 at 1/2
  for (const double scale : {1e-300, 1e-200, 1.0, 1e200, 1e300}) {
    std::array<double, 2> found{};
    ASSERT_EQ(extrema_in_unit(Cubic{{0, scale, -scale, 0}}, found), 1) << scale;
    EXPECT_DOUBLE_EQ(found[0], 0.5);
    PieceFunction f;
    f.numerator = {{0, scale, -scale, 0}};
    f.upper = scale;
    EXPECT_DOUBLE_EQ(maximum(f), scale / 4);
  }
}

TEST(Pieces, MeanOfAQuotientInClosedForm) {
  // the mean of s / (d + s) over [0, 1] is 1 - d ln(1 + 1 / d)
  for (const double d : {1.0, 0.1, 1e-3}) {
    PieceFunction f;
    f.rational = true;
    f.numerator = {{0, 1, 0, 0}};
    f.denominator = {{d, 1, 0, 0}};
    f.upper = 1;
    const Mean m = mean_within(f, kLineTolerance);
    EXPECT_NEAR(m.value, 1 - d * std::log1p(1 / d), m.error) << d;
    EXPECT_LE(m.error, 2e-12) << d;
  }
}

TEST(Pieces, ASmallRiseOnALargeBaseKeepsItsDigits) {
  PieceFunction f;
  f.base = 1e8;
  f.numerator = {{0, 1e-3, 0, 0}};
  EXPECT_DOUBLE_EQ(f.above(1e8, 0.3), 0.3e-3);
  EXPECT_DOUBLE_EQ(f.minus(1e8)(0.7), 0.7e-3);
}

// ---- stiff media in closed form ----

TEST(StiffReference, IsWithinItsToleranceOfClosedForms) {
  const AmrHierarchy h = column();
  for (const FilterDefinition& d : {FilterDefinition{Filter::linear_lod}, {Filter::linear_page, 4}, {Filter::basis}}) {
    const HierarchyReference reference(h, 0, d);
    for (const Medium& m : stiff_media()) {
      const ReferencePicture drawn = reference.draw(one_ray(m.tf));
      ASSERT_TRUE(drawn.error);
      EXPECT_LE(off(drawn, m), *drawn.error + 4e-15) << m.name << ", " << filter_name(d.filter);
      EXPECT_LE(*drawn.error, kAsked) << m.name << ", " << filter_name(d.filter);
    }
  }
}

TEST(StiffReference, KeepsTighterAndLooserTolerances) {
  const AmrHierarchy h = column();
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  for (const double tolerance : {1e-2, 1e-5, 1e-10})
    for (const Medium& m : stiff_media()) {
      const ReferencePicture drawn = reference.draw(one_ray(m.tf), ReferenceTolerance{tolerance});
      EXPECT_LE(off(drawn, m), *drawn.error + 4e-15) << m.name << ", " << tolerance;
      EXPECT_LE(*drawn.error, tolerance + 2e-8) << m.name << ", " << tolerance << ": places are rounded, too";
    }
}

TEST(StiffReference, FixedStepsAreOffThere) {
  const AmrHierarchy h = column();
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  double worst = 0;
  for (const Medium& m : stiff_media()) worst = std::max(worst, off(reference.draw(one_ray(m.tf), 1.0 / 16), m));
  EXPECT_GT(worst, 1e-3);
  EXPECT_FALSE(reference.draw(one_ray(ramp(1).tf), 1.0 / 16).error) << "it does not know its error";
}

TEST(StiffReference, TakesFewerEvaluationsThanTheFixedStepThatIsAsGood) {
  const AmrHierarchy h = column();
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  const auto [worst, taken] = over_stiff_media(reference, {});
  EXPECT_LE(worst, kAsked);
  EXPECT_LE(taken, 8 * over_stiff_media(reference, 1.0 / 16).second);
  double step = 1;
  while (over_stiff_media(reference, step).first > kAsked && step > 1e-5) step /= 2;
  EXPECT_LE(taken, over_stiff_media(reference, step).second) << "the step " << step;
}

TEST(StiffReference, SixtyDecadesOnALogarithmicAxis) {
  // f = u from 0; k = 40 (log10 u + 30) / 60, c = k / 40: tau(u) = 2/3 ((u ln u - u) / ln 10 + 30 u). The colour's integral is a
  // Simpson sum over ln u, in which all is smooth.
  const AmrHierarchy h = column([](const Vec3d& p) { return p.x - kFrom; });
  const TransferFunction tf = curve({{1e-30, 0}, {1e30, 40}}, 1e-30, 1e30, true);
  const auto depth = [](double u) { return 2.0 / 3 * ((u * std::log(u) - u) / std::numbers::ln10 + 30 * u); };
  const auto emitted = [&](double y) {
    const double u = std::exp(y);
    const double share = (std::log10(u) + 30) / 60;
    return 40 * share * share * std::exp(-depth(u)) * u;
  };
  const double first = std::log(1e-30), last = std::log(kWay);
  constexpr int kIntervals = 20000;
  double color = emitted(first) + emitted(last);
  for (int i = 1; i < kIntervals; ++i) color += (i % 2 == 0 ? 2 : 4) * emitted(first + (last - first) * i / kIntervals);
  color *= (last - first) / kIntervals / 3;
  const Medium m{"log", tf, color, -std::expm1(-depth(kWay))};
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  const ReferencePicture drawn = reference.draw(one_ray(tf));
  EXPECT_LE(off(drawn, m), *drawn.error + 1e-13);
  EXPECT_LE(*drawn.error, kAsked);
  EXPECT_LE(drawn.evaluations, 8 * reference.draw(one_ray(tf), 1.0 / 16).evaluations);
}

TEST(StiffReference, ValuesThatDifferInTheirLastDigits) {
  // f = 1e8 + 1e-3 x as doubles hold it at the centres; k = 4000 (f - 1e8): its integral is that of a polygon
  const AmrHierarchy h = column([](const Vec3d& p) { return 1e8 + 1e-3 * p.x; });
  double depth = 0;
  for (int i = 0; i < 3; ++i)
    depth += 0.25 * 4000 * (((1e8 + 1e-3 * (0.125 + 0.25 * i)) - 1e8) + ((1e8 + 1e-3 * (0.375 + 0.25 * i)) - 1e8)) / 2;
  TransferFunction tf;
  tf.extinction = {{1e8, 0}, {1e8 + 1e-3, 4000 * ((1e8 + 1e-3) - 1e8)}};
  tf.color = {{0, Vec3d(1)}};
  for (const Filter filter : {Filter::linear_lod, Filter::basis})
    EXPECT_NEAR(HierarchyReference(h, 0, {filter}).render(one_ray(tf)).pixel(0, 0)[3], -std::expm1(-depth), 1e-13)
        << filter_name(filter);
}

TEST(StiffReference, ExtremeExtinctionsStayColours) {
  const AmrHierarchy h = column();
  const HierarchyReference reference(h, 0, {Filter::linear_lod});
  for (const double k : {1e9, 1e30, 1e300, kInf}) {
    // all light comes from where the medium begins: at kFrom, of colour 0, or at 0.5, of colour 1/2
    const ReferencePicture rising = reference.draw(one_ray(curve({{kFrom, 0}, {kTo, k}}, kFrom, kTo)));
    EXPECT_NEAR(rising.picture.pixel(0, 0)[0], 0, 1e-4) << k;
    EXPECT_NEAR(rising.picture.pixel(0, 0)[3], 1, 1e-9) << k;
    const ReferencePicture wall = reference.draw(one_ray(curve({{0.5, 0}, {std::nextafter(0.5, 1.0), k}}, kFrom, kTo)));
    EXPECT_NEAR(wall.picture.pixel(0, 0)[0], 0.5, 1e-8) << k;
    EXPECT_NEAR(wall.picture.pixel(0, 0)[3], 1, 1e-9) << k;
    EXPECT_LE(*wall.error, 1e-6) << k << ": a layer as thin as the rounding of a place takes 1e-7 of the light";
  }
}

// ---- what it says of itself ----

/// Curves from faint to stiff, on either axis, of one and of several colours.
TransferFunction random_curve(const FieldStatistics& range, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  TransferFunction tf;
  tf.logarithmic = range.max > 0 && unit(random) < 0.4;
  const double most = std::pow(10.0, 5 * unit(random));
  const double low = tf.logarithmic ? std::max(range.min, range.max * 1e-12) : range.min;
  std::vector<double> values;
  for (int k = 0; k < 4; ++k) values.push_back(low + unit(random) * (range.max - low));
  if (tf.logarithmic) values[0] = low;
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  for (const double v : values) tf.extinction.push_back({v, unit(random) < 0.3 ? 0 : most * unit(random)});
  tf.color = {{values.front(), Vec3d(0.2, 0.9, 0)}};
  if (values.size() > 1 && unit(random) < 0.8) tf.color.push_back({values.back(), Vec3d(unit(random), 0, 1)});
  return tf;
}

/// Towards the middle of the domain, from aside.
Scene oblique(const AmrHierarchy& h, TransferFunction tf, int pixels = 6) {
  Scene scene;
  scene.settings.width = scene.settings.height = pixels;
  const Vec3d size = h.domain_upper() - h.domain_lower();
  scene.view.at = h.domain_lower() + size * Vec3d(0.5, 0.48, 0.52);
  scene.view.eye = scene.view.at + size * Vec3d(1.3, 1.1, 0.9);
  scene.view.up = {0, 0, 1};
  scene.transfer_function = std::move(tf);
  return scene;
}

std::vector<FilterDefinition> all_definitions() {
  return {{Filter::nearest}, {Filter::linear_lod}, {Filter::linear_page, 4}, {Filter::linear_vertex}, {Filter::basis}};
}

TEST(ReferenceError, IsNotUnderestimatedOnRandomScenes) {
  int scenes = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    if (!(h.statistics(0).max > h.statistics(0).min)) continue;
    std::mt19937_64 random(seed);
    const Scene scene = oblique(h, random_curve(h.statistics(0), random));
    for (const FilterDefinition& d : all_definitions()) {
      const HierarchyReference reference(h, 0, d);
      const ReferencePicture tight = reference.draw(scene, ReferenceTolerance{1e-11});
      EXPECT_LE(*tight.error, 1e-9) << "seed " << seed << ", " << filter_name(d.filter);
      for (const double tolerance : {1e-2, 1e-4, 1e-7}) {
        const ReferencePicture loose = reference.draw(scene, ReferenceTolerance{tolerance});
        const double off = difference(loose.picture, tight.picture);
        EXPECT_LE(off, *loose.error + *tight.error) << "seed " << seed << ", " << filter_name(d.filter) << ", " << tolerance;
        EXPECT_LE(*loose.error, tolerance + 1e-9) << "seed " << seed << ", " << filter_name(d.filter) << ", " << tolerance;
        ++scenes;
      }
    }
  }
  EXPECT_GT(scenes, 300);
}

TEST(ReferenceError, OfSeveralFields) {
  const AmrHierarchy h = fields_with_gaps().hierarchy();
  Scene scene = oblique(h, peaks(), 12);
  FieldTransfer other;
  other.field = "g";
  other.transfer_function.extinction = {{-50, 0}, {-20, 2000}, {0, 3}};
  other.transfer_function.color = {{-40, Vec3d(1, 0, 0)}, {-5, Vec3d(0, 1, 1)}};
  scene.more_fields = {other};
  for (const Filter filter : {Filter::linear_vertex, Filter::basis}) {
    const HierarchyReference reference(h, 0, {filter});
    const ReferencePicture tight = reference.draw(scene, ReferenceTolerance{1e-11});
    const ReferencePicture usual = reference.draw(scene);
    EXPECT_LE(difference(usual.picture, tight.picture), *usual.error + *tight.error);
    EXPECT_LE(*usual.error, kAsked);
    EXPECT_LE(difference(reference.render(scene, 1.0 / 512), tight.picture), 1e-5) << "the fixed rule goes there";
  }
}

TEST(ReferenceError, OfTheLightOfALamp) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Scene scene = oblique(h, peaks(), 3);
  scene.settings.point_light = PointLight{};
  scene.settings.point_light->position = {1.4, -0.3, 1.6};
  const HierarchyReference reference(h, 0, {Filter::linear_vertex});
  const ReferencePicture tight = reference.draw(scene, ReferenceTolerance{1e-7});
  const ReferencePicture loose = reference.draw(scene, ReferenceTolerance{1e-4});
  EXPECT_LE(difference(loose.picture, tight.picture), *loose.error + *tight.error);
  EXPECT_LE(*loose.error, 1e-4);
  EXPECT_LE(*tight.error, 1e-6);
  EXPECT_LE(difference(reference.render(scene, 1.0 / 16), tight.picture), 1e-4) << "the fixed rule goes there";
}

TEST(ReferenceError, OfLinesIsRelativeToThem) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const double length = glm::length(h.domain_upper() - h.domain_lower());
    const double most = std::max(std::abs(h.statistics(0).min), std::abs(h.statistics(0).max));
    for (const FilterDefinition& d : all_definitions())
      for (const Mode mode : {Mode::projection, Mode::mip}) {
        Scene scene = oblique(h, {});
        scene.settings.mode = mode;
        const ReferencePicture drawn = HierarchyReference(h, 0, d).draw(scene);
        ASSERT_TRUE(drawn.error);
        EXPECT_LE(*drawn.error, 2 * kLineTolerance * most * (mode == Mode::projection ? length : 1)) << filter_name(d.filter);
        EXPECT_LE(difference(drawn.picture, HierarchyReference(h, 0, d).render(scene, 1.0 / 64)),
                  *drawn.error + 1e-9 * most * length)
            << filter_name(d.filter);
      }
  }
}

TEST(ReferenceError, IsUnknownWhereSurfacesAreHit) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Scene scene = oblique(h, peaks());
  scene.settings.mode = Mode::iso;
  scene.settings.isosurfaces.values = {0.5};
  const HierarchyReference reference(h, 0, {Filter::linear_vertex});
  EXPECT_FALSE(reference.draw(scene).error) << "hits have no integral";
  scene.settings.mode = Mode::dvr_iso;
  const ReferencePicture both = reference.draw(scene);
  ASSERT_TRUE(both.error) << "that of the volume between them";
  EXPECT_LE(*both.error, kAsked);
  EXPECT_LE(difference(both.picture, reference.render(scene, 1.0 / 64)), 1e-6);
  scene.settings.isosurfaces.ambient_occlusion = AmbientOcclusion{.radius = 0.1};
  EXPECT_FALSE(reference.draw(scene).error) << "a fixed number of rays";
}

TEST(ReferenceError, RefusesTolerancesThatDoublesCannotKeep) {
  const AmrHierarchy h = column();
  for (const double tolerance : {0.0, -1.0, 1e-14, 2.0, kNan})
    EXPECT_THROW(HierarchyReference(h, 0, {}).draw(one_ray(ramp(1).tf), ReferenceTolerance{tolerance}), Error) << tolerance;
}

TEST(ReferenceCost, IsNoMoreThanThatOfTheStepThatWasTheDefault) {
  // the scene of experiments/work_precision, a level less and fewer pixels
  const AmrHierarchy h(generate_mesh({{"field", "blobs_shell"}, {"levels", 2}}));
  Scene scene;
  scene.settings.width = scene.settings.height = 32;
  scene.view = perspective({2.32, 1.87, 1.53}, Vec3d(0.5));
  scene.transfer_function.extinction = {{0, 0}, {0.05, 0}, {0.3, 2}, {0.8, 10}, {1.4, 40}};
  scene.transfer_function.color = {
      {0, {0, 0, 0.3}}, {0.25, {0.1, 0.4, 1}}, {0.6, {0.9, 0.9, 0.9}}, {1.0, {1, 0.5, 0.1}}, {1.4, {0.8, 0, 0}}};
  for (const FilterDefinition& d : all_definitions()) {
    const HierarchyReference reference(h, 0, d);
    const ReferencePicture drawn = reference.draw(scene);
    const ReferencePicture fixed = reference.draw(scene, 1.0 / 16);
    EXPECT_LE(*drawn.error, kAsked) << filter_name(d.filter);
    EXPECT_LE(drawn.evaluations, fixed.evaluations) << filter_name(d.filter);
    EXPECT_GT(drawn.evaluations, 0);
    EXPECT_LE(difference(drawn.picture, fixed.picture), 1e-6) << filter_name(d.filter);
  }
}

// ---- the failing input, where it is at hand ----

TEST(FailingInputs, StiffMediumOnAFile) {
  AMRTEX_NEEDS(test::kFailingInputs, "");
  const fs::path folder = test::kFailingInputs.path();
  const Experiment experiment = read_scene(folder / "stiff_1e6.json");
  const AmrHierarchy h = load_dataset(experiment, experiment.datasets.front());
  const Scene scene = scene_of(experiment, experiment.renders.front());
  const Picture expected = read_npy(folder / "stiff_1e6.expected.npy");
  const HierarchyReference reference(h, 0, {Filter::linear_page, 4});
  const ReferencePicture drawn = reference.draw(scene);
  EXPECT_LE(difference(drawn.picture, expected), 5e-7 + *drawn.error) << "what was expected is good to 5e-7";
  EXPECT_LE(*drawn.error, kAsked);
  EXPECT_GT(difference(reference.render(scene, 1.0 / 16), expected), 1e-2) << "the rule of fixed steps";
}

// ---- the cache ----

class ReferenceCacheTest : public testing::Test {
 protected:
  ~ReferenceCacheTest() override { fs::remove_all(folder_); }
  ReferencePicture ask(const ReferenceRule& rule, std::string& hash) const {
    const ReferenceRequest request{h_, "data", {Filter::linear_vertex}, scene_, rule};
    hash = reference_name(request);
    return cached_reference(request, folder_);
  }

  fs::path folder_ = fs::temp_directory_path() / fmt::format("amrtex_reference_cache_{}", ::getpid());
  AmrHierarchy h_ = column();
  Scene scene_ = one_ray(ramp(1e4).tf);
};

TEST_F(ReferenceCacheTest, KeepsTheErrorBesideThePicture) {
  std::string first, second;
  const ReferencePicture drawn = ask({}, first);
  const ReferencePicture read = ask({}, second);
  EXPECT_EQ(first, second);
  EXPECT_EQ(read.picture.values, drawn.picture.values);
  ASSERT_TRUE(read.error);
  EXPECT_EQ(*read.error, *drawn.error);
  EXPECT_EQ(read.evaluations, drawn.evaluations);
}

TEST_F(ReferenceCacheTest, TellsRulesApart) {
  std::string hash, by_tolerance, by_step;
  const ReferencePicture usual = ask({}, hash);
  const ReferencePicture loose = ask(ReferenceTolerance{1e-2}, by_tolerance);
  const ReferencePicture fixed = ask(0.5, by_step);
  EXPECT_NE(hash, by_tolerance);
  EXPECT_NE(hash, by_step);
  EXPECT_NE(by_tolerance, by_step);
  EXPECT_FALSE(fixed.error);
  EXPECT_FALSE(ask(0.5, by_step).error) << "nor when it is read";
  EXPECT_NE(fixed.picture.values, usual.picture.values);
}

TEST_F(ReferenceCacheTest, DrawsAgainWhatLostItsFacts) {
  std::string hash;
  const ReferencePicture drawn = ask({}, hash);
  std::ofstream(folder_ / (hash + ".json")) << "{";
  EXPECT_EQ(ask({}, hash).error, drawn.error);
}

TEST(ReferenceRecord, SaysWhereTheReferenceLimitsTheError) {
  ReferencePicture reference;
  Json error;
  ErrorMetrics metrics;
  metrics.max = 5e-7;
  add_reference_error(error, reference, metrics);
  EXPECT_TRUE(error.at("reference_error").is_null());
  EXPECT_TRUE(error.at("limited_by_reference").is_null());
  reference.error = 4e-8;
  add_reference_error(error, reference, metrics);
  EXPECT_EQ(error.at("reference_error"), 4e-8);
  EXPECT_EQ(error.at("limited_by_reference"), false) << "12 times";
  reference.error = 6e-8;
  add_reference_error(error, reference, metrics);
  EXPECT_EQ(error.at("limited_by_reference"), true) << "8 times";
}

}  // namespace
}  // namespace amrtex
