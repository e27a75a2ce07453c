// The integrators against the reference: observed orders of convergence, stiff light, errors that were asked for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "bench/numbers/image_error.hpp"
#include "structures/generators/synthetic.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr std::array kFixed{Integrator::exponential_midpoint, Integrator::euler, Integrator::left, Integrator::preintegrated};
constexpr std::array kAll{Integrator::exponential_midpoint, Integrator::euler, Integrator::left, Integrator::preintegrated,
                          Integrator::tolerance};

Scene scene_of(Integrator integrator, const View& view, Sampling sampling = Sampling::adaptive, int pixels = 12) {
  Scene scene;
  scene.view = view;
  scene.settings.integrator = integrator;
  scene.settings.sampling = sampling;
  scene.settings.width = scene.settings.height = pixels;
  return scene;
}

/// The first case of an encoding that is there for a filter.
EncodingCase a_case(std::string_view encoding, Filter filter) {
  for (const EncodingCase& c : encoding_cases())
    if (c.encoding->name() == encoding && c.filter == filter) return c;
  throw Error(fmt::format("no case of {} with {}", encoding, filter_name(filter)));
}

/// Mean over the picture of each pixel's largest difference: single pixels may be right by chance.
double mean_error(const Picture& picture, const Picture& reference) {
  double sum = 0;
  const std::vector<double> errors = pixel_errors(picture, reference);
  for (const double e : errors) sum += e;
  return sum / static_cast<double>(errors.size());
}

/// Slope of log(error) over log(step), least squares.
double slope(const std::vector<double>& steps, const std::vector<double>& errors) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double x = std::log2(steps[i]), y = std::log2(errors[i]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double n = static_cast<double>(steps.size());
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

/// Errors of pictures in double, against the reference.
std::vector<double> errors_of(const AmrHierarchy& h, const EncodedField& field, Scene scene, const std::vector<double>& steps) {
  const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 1.0 / 128);
  std::vector<double> errors;
  for (const double step : steps) {
    scene.settings.step = step;
    errors.push_back(mean_error(render_on_cpu(h, field, scene, true), reference));
  }
  return errors;
}

/// Steps that divide the same length 2^i times; not quite, so that rounding makes no further interval.
std::vector<double> halved(double first, int count) {
  std::vector<double> steps;
  for (int i = 0; i < count; ++i) steps.push_back(first / (1 << i));
  return steps;
}

// ---- orders ----

/// Two cells an edge: between their centres f is one polynomial of degree 3 along any ray.
struct SmoothCase {
  AmrHierarchy mesh =
      MeshBuilder(Vec3i(2)).root([](const Vec3d& p) { return 0.1 + 0.7 * p.x + 0.45 * p.y * p.z + 0.4 * p.x * p.z; }).hierarchy();
  EncodedField field = build(mesh, a_case("uniform", Filter::linear_page), {.storage = Storage::r64f});
  Scene scene(Integrator integrator) const {
    Scene s = scene_of(integrator, orthographic(Vec3d(0.5), {1, 0.35, 0.55}, 0.25));
    s.region = {Vec3d(0.25), Vec3d(0.75)};
    return s;
  }
};

TransferFunction smooth_light() {
  TransferFunction tf;
  tf.extinction = {{0, 0}, {2, 16}};
  tf.color = {{0, {0, 0.2, 1}}, {2, {1, 0.6, 0}}};
  return tf;
}

TEST(Order, OnASmoothFieldIsThatOfTheRule) {
  const SmoothCase c;
  const std::vector<double> steps = halved(0.125, 4);  // below, the reference's own 5e-8 shows
  const std::map<Integrator, double> expected{
      {Integrator::exponential_midpoint, 2}, {Integrator::euler, 1}, {Integrator::left, 1}, {Integrator::preintegrated, 2}};
  for (const auto& [integrator, order] : expected) {
    Scene scene = c.scene(integrator);
    scene.transfer_function = smooth_light();
    EXPECT_NEAR(slope(steps, errors_of(c.mesh, c.field, scene, steps)), order, 0.1) << integrator_name(integrator);
  }
}

TEST(Order, OnAKinkAndAcrossLevelsIsKeptWhereRegionsSplitTheRay) {
  // cells' centres are kinks of f, and faces between levels are jumps
  const AmrHierarchy h = nested(waves).hierarchy();
  const std::map<Integrator, double> expected{
      {Integrator::exponential_midpoint, 2}, {Integrator::euler, 1}, {Integrator::left, 1}, {Integrator::preintegrated, 2}};
  for (const auto& [c, first] :
       {std::pair{a_case("page_table", Filter::linear_page), 0.65}, std::pair{a_case("octree", Filter::linear_lod), 0.12}}) {
    // regions of one cell have one interval whatever the step, until it is short
    const std::vector<double> steps = halved(first, 4);
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    for (const auto& [integrator, order] : expected) {
      Scene scene = scene_of(integrator, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::adaptive, 24);
      scene.transfer_function = smooth_light();
      EXPECT_NEAR(slope(steps, errors_of(h, field, scene, steps)), order, 0.1) << c.name() << " " << integrator_name(integrator);
    }
  }
}

TEST(Order, AcrossLevelsIsLostWhereIntervalsStraddleTheFace) {
  // the control: the lattice knows no faces, here between 0.3 and 1.2
  const AmrHierarchy h =
      MeshBuilder(Vec3i(8), {2}).root(constant(0.3)).patch(1, {{4, 4, 4}, {10, 12, 12}}, constant(1.2)).hierarchy();
  const EncodedField field = build(h, a_case("octree", Filter::linear_lod), {.storage = Storage::r64f});
  Scene scene = scene_of(Integrator::exponential_midpoint, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::lattice, 24);
  scene.transfer_function = smooth_light();
  const std::vector<double> steps = halved(0.3, 4);
  EXPECT_LT(slope(steps, errors_of(h, field, scene, steps)), 1.25);
  scene.settings.sampling = Sampling::adaptive;
  EXPECT_NEAR(slope(steps, errors_of(h, field, scene, steps)), 2, 0.1);
}

TEST(Order, OnAStepOfTheTransferFunctionIsTwoIfItIsPreintegratedAndOneElse) {
  const SmoothCase c;
  const std::vector<double> steps = halved(0.0625, 6);
  for (const auto& [integrator, least, most] :
       {std::tuple{Integrator::exponential_midpoint, 0.75, 1.25}, std::tuple{Integrator::preintegrated, 1.9, 2.1}}) {
    Scene scene = c.scene(integrator);
    scene.transfer_function.extinction = {{0.75, 0}, {0.75 + 1e-7, 12}};
    scene.transfer_function.color = {{0, {1, 0.5, 0.25}}};
    const double order = slope(steps, errors_of(c.mesh, c.field, scene, steps));
    EXPECT_GE(order, least) << integrator_name(integrator);
    EXPECT_LE(order, most) << integrator_name(integrator);
  }
}

TEST(Order, OnANarrowPeakIsFoundAtSixteenIntervals) {
  // a peak of 0.02 of the values along the ray: 0.3 of an interval
  const AmrHierarchy h =
      MeshBuilder(Vec3i(2)).root([](const Vec3d& p) { return 2 * (p.x - 0.25) + 0.1 * p.x * p.y + 0.05 * p.z; }).hierarchy();
  const EncodedField field = build(h, a_case("uniform", Filter::linear_page), {.storage = Storage::r64f});
  Scene scene = scene_of(Integrator::preintegrated, orthographic(Vec3d(0.5), {1, 0.2, 0.1}, 0.2));
  scene.region = {Vec3d(0.25), Vec3d(0.75)};
  scene.transfer_function.extinction = {{0.54, 0}, {0.55, 200}, {0.56, 0}};
  scene.transfer_function.color = {{0, {1, 0.5, 0.25}}};
  const double length = 1 / (1 / std::sqrt(1 + 0.04 + 0.01));  // of a ray from face to face, in cells
  const auto errors_at = [&](std::vector<int> counts) {
    std::vector<double> steps;
    for (const int n : counts) steps.push_back(length / n);
    return errors_of(h, field, scene, steps);
  };
  EXPECT_LE(errors_at({16})[0], 1e-3);
  scene.settings.integrator = Integrator::exponential_midpoint;
  EXPECT_GT(errors_at({16})[0], 0.1) << "the control: samples beside the peak";
  scene.settings.integrator = Integrator::preintegrated;
  const std::vector<double> fine = errors_at({256, 512, 1024, 2048});
  EXPECT_GE(slope({8, 4, 2, 1}, fine), 1.9);
}

TEST(Order, OfAnIntervalIsTheSameWithManyPoints) {
  // knots in a buffer: the same curve with 40 points more is the same picture
  const SmoothCase c;
  for (const Integrator integrator : {Integrator::preintegrated, Integrator::tolerance}) {
    Scene scene = c.scene(integrator);
    scene.transfer_function = smooth_light();
    scene.settings.step = 0.25;
    const Picture few = render_on_cpu(c.mesh, c.field, scene, true);
    const TransferFunction curve = scene.transfer_function;
    for (int i = 1; i <= 40; ++i) {
      const double v = i / 20.5;
      scene.transfer_function.extinction.insert(scene.transfer_function.extinction.end() - 1, {v, curve.extinction_at(v)});
    }
    EXPECT_LE(difference(render_on_cpu(c.mesh, c.field, scene, true), few), integrator == Integrator::tolerance ? 1e-3 : 2e-4);
  }
}

// ---- stiff light ----

TEST(Stiff, LightIsExactAndMonotoneForTheExponentialRules) {
  // T = exp(-k L) for any step; k L from 1e-6 to 1e6, 0 and infinite
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(constant(1)).hierarchy();
  const std::vector<double> extinctions{0, 1e-6, 1e-3, 0.1, 1, 10, 1e2, 1e3, 1e6, kInf};
  for (const Filter filter : {Filter::nearest, Filter::linear_page})
    for (const Integrator integrator : kAll) {
      if (integrator == Integrator::tolerance && !interpolates(filter)) continue;
      const EncodedField field = build(h, a_case("page_table", filter), {.storage = Storage::r64f, .value_ranges = false});
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        if (integrator == Integrator::tolerance && sampling == Sampling::lattice) continue;
        SCOPED_TRACE(fmt::format("{} {} {}", integrator_name(integrator), filter_name(filter), sampling_name(sampling)));
        double before = -1;
        for (const double k : extinctions) {
          Scene scene = scene_of(integrator, orthographic(Vec3d(0.5), {1, 0, 0}, 0.5), sampling, 2);
          scene.transfer_function = constant_light(k);
          scene.settings.step = 0.5;
          const Picture picture = render_on_cpu(h, field, scene, true);
          const double opacity = picture.pixel(0, 0)[3];
          for (const double v : picture.values) EXPECT_FALSE(std::isnan(v)) << k;
          if (integrator == Integrator::euler) {  // the control: (1 - k h)^8, below 0 or beyond 1 where k h > 1
            const double t = std::pow(1 - std::min(k, 8e4) / 8, 8);
            if (k <= 1e3) {
              EXPECT_NEAR((1 - opacity) / std::max(1.0, std::abs(t)), t / std::max(1.0, std::abs(t)), 1e-12) << k;
            }
            continue;
          }
          // by tolerance a ray may end, between two cells, where a tenth of the tolerance is left
          const double least = integrator == Integrator::tolerance ? 0.1 * scene.settings.tolerance : 0;
          const double left = std::exp(-k) < least ? least : 0;
          EXPECT_NEAR(opacity, -std::expm1(-k), 1e-12 + left) << k;
          EXPECT_NEAR(picture.pixel(0, 0)[0], -0.75 * std::expm1(-k), 1e-12 + left) << k;
          EXPECT_GE(opacity, before);
          EXPECT_LE(opacity, 1);
          before = opacity;
        }
      }
    }
}

TEST(Stiff, ClampedEulerOfStiffLightIsNoPictureOfIt) {
  // k h = 2.5: T = (1 - 2.5)^4 = 5.0625 (k = 10, n = 4)
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(constant(1)).hierarchy();
  const EncodedField field = build(h, a_case("uniform", Filter::nearest), {.storage = Storage::r64f});
  Scene scene = scene_of(Integrator::euler, orthographic(Vec3d(0.5), {1, 0, 0}, 0.5));
  scene.transfer_function = constant_light(10);
  EXPECT_NEAR(1 - render_on_cpu(h, field, scene, true).pixel(3, 3)[3], 5.0625, 1e-12);
}

// ---- the same picture ----

Scene wave_scene(Integrator integrator, Sampling sampling) {
  Scene scene = scene_of(integrator, perspective({2, -1.5, 1.2}, Vec3d(0.5)), sampling, 20);
  scene.transfer_function.extinction = {{0.3, 0}, {0.4, 20}, {0.45, 0}, {0.6, 0}, {1, 15}};
  scene.transfer_function.color = {{0.3, {0.1, 0.2, 0.9}}, {0.5, {0.9, 0.4, 0.1}}, {1, {1, 1, 0.5}}};
  return scene;
}

TEST(SamePicture, FromTheLatticeWithEveryEncodingAndIntegrator) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Integrator integrator : kFixed)
    for (const Filter filter : {Filter::nearest, Filter::linear_lod}) {
      std::optional<Picture> first;
      for_each_case([&](const EncodingCase& c) {
        if (c.filter != filter) return;
        const Picture picture = render_on_cpu(h, build(h, c), wave_scene(integrator, Sampling::lattice), false);
        if (!first) first = picture;
        EXPECT_EQ(difference(picture, *first), 0) << integrator_name(integrator);
        EXPECT_GT(largest(picture), 0.1);
      });
    }
}

TEST(SamePicture, WithAndWithoutSkipping) {
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for (const Integrator integrator : kAll)
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
        for_each_filter([&](const EncodingCase& c) {
          if (integrator == Integrator::tolerance && (sampling == Sampling::lattice || !interpolating(c))) return;
          SCOPED_TRACE(fmt::format("{} {}", integrator_name(integrator), sampling_name(sampling)));
          const EncodedField field = build(h, c);
          Scene scene = wave_scene(integrator, sampling);
          const Picture with = render_on_cpu(h, field, scene, false);
          scene.settings.skip = false;
          // intervals by tolerance follow each other: what was skipped changes where later ones lie
          EXPECT_LE(difference(render_on_cpu(h, field, scene, false), with), integrator == Integrator::tolerance ? 1e-2 : 0);
          EXPECT_GT(largest(with), 0.1);
        });
}

TEST(SamePicture, OnGlAndOnTheCpuUpToFloats) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Integrator integrator : kAll)
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      if (integrator == Integrator::tolerance && sampling == Sampling::lattice) continue;
      SCOPED_TRACE(fmt::format("{} {}", integrator_name(integrator), sampling_name(sampling)));
      const EncodedField field = build(h, a_case("page_table", Filter::linear_page));
      const Scene scene = wave_scene(integrator, sampling);
      // lattice samples may take the neighbouring quantum, an interval by tolerance the other side of its bound
      const double bound = integrator == Integrator::tolerance ? 1e-3 : 2e-4;
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, field, scene), render_on_cpu(h, field, scene, false)), bound);
    }
}

TEST(SamePicture, TwiceByTolerance) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const EncodedField field = build(h, a_case("page_table", Filter::linear_vertex));
  const Scene scene = wave_scene(Integrator::tolerance, Sampling::adaptive);
  const Picture first = draw(context(ContextKind::egl), h, field, scene);
  EXPECT_EQ(difference(draw(context(ContextKind::egl), h, field, scene), first), 0);
  EXPECT_GT(largest(first), 0.1);
}

TEST(NoValue, HalfOfAnIntervalBesideItHasTheOtherEndsLight) {
  // opacity of constant light beside holes: off by at most half an interval at each of their faces
  const AmrHierarchy h = holes_and_missing(constant(0.7)).hierarchy();
  for (const auto& [integrator, bound] : {std::pair{Integrator::preintegrated, 0.2}, std::pair{Integrator::tolerance, 0.01}})
    for (const Filter filter : {Filter::linear_page, Filter::linear_vertex}) {
      const EncodedField field = build(h, a_case("page_table", filter), {.storage = Storage::r64f});
      Scene scene = scene_of(integrator, perspective({2, -1.5, 1.2}, Vec3d(0.5)));
      scene.transfer_function = constant_light(3);
      scene.settings.step = 0.5;
      const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 1.0 / 16);
      EXPECT_LE(difference(render_on_cpu(h, field, scene, true), reference), bound) << integrator_name(integrator);
    }
}

// ---- errors that were asked for ----

/// A wide one, and one of narrow peaks.
struct Curve {
  const char* name;
  TransferFunction light;
};

std::vector<Curve> curves() {
  Curve ramp{"ramp", {}};
  ramp.light.extinction = {{0, 0}, {0.05, 0}, {0.3, 2}, {0.8, 10}, {1.4, 40}};
  ramp.light.color = {{0, {0, 0, 0.3}}, {0.25, {0.1, 0.4, 1}}, {0.6, {0.9, 0.9, 0.9}}, {1, {1, 0.5, 0.1}}, {1.4, {0.8, 0, 0}}};
  Curve shells{"shells", {}};
  shells.light.extinction = {{0.17, 0}, {0.2, 60}, {0.23, 0}, {0.57, 0}, {0.6, 120}, {0.63, 0}};
  shells.light.color = {{0, {0, 0, 0.3}}, {0.3, {0.9, 0.2, 0.1}}, {0.6, {0.2, 0.8, 0.9}}};
  return {ramp, shells};
}

/// What a picture of blobs and shell costs on GL, and how far it is from the reference.
class MeasuredOnGl {
 public:
  explicit MeasuredOnGl(const Curve& curve) {
    scene.transfer_function = curve.light;
    reference_ = HierarchyReference(mesh_, 0, structure_.field.definition).render(scene, 1.0 / 8);
  }

  /// Samples; `p95` receives the error that 95 % of the pixels keep.
  std::int64_t measure(double& p95) const {
    Raycaster raycaster(context(ContextKind::egl), mesh_, structure_, scene);
    raycaster.draw();
    p95 = percentile(pixel_errors(raycaster.read(), reference_), 0.95);
    return raycaster.count().samples;
  }

  Scene scene = scene_of(Integrator::tolerance, perspective({2.32, 1.87, 1.53}, Vec3d(0.5)), Sampling::adaptive, 64);

 private:
  AmrHierarchy mesh_{generate_mesh(Json::parse(R"({"field": "blobs_shell", "levels": 2})"))};
  Structure structure_{context(ContextKind::egl), build(mesh_, a_case("page_table", Filter::linear_page))};
  Picture reference_;
};

TEST(Tolerance, IsReachedByNinetyFivePixelsOfAHundredWithFewerSamplesThanStepsFromAThousandthOn) {
  MeasuredOnGl gl(curves().back());
  Scene& scene = gl.scene;
  std::vector<std::pair<double, std::int64_t>> fixed;  // 95th percentile, samples; from coarse to fine
  scene.settings.integrator = Integrator::exponential_midpoint;
  for (const double step : halved(2, 7)) {
    scene.settings.step = step;
    double p95 = 0;
    const std::int64_t samples = gl.measure(p95);
    fixed.emplace_back(p95, samples);
  }
  scene.settings.integrator = Integrator::tolerance;
  for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
    scene.settings.tolerance = tolerance;
    double p95 = 0;
    const std::int64_t samples = gl.measure(p95);
    EXPECT_LE(p95, tolerance);
    const auto best = std::find_if(fixed.begin(), fixed.end(), [&](const auto& f) { return f.first <= tolerance; });
    if (best != fixed.end()) {
      // at a hundredth the step is a quarter of a cell, and every cell on the way is told by three values: 1.32 times
      const double most = tolerance > 5e-3 ? 1.4 : 0.7;
      EXPECT_LE(static_cast<double>(samples), most * static_cast<double>(best->second)) << tolerance;
    }
  }
}

/// Each tolerance is reached by 95 pixels of a hundred, and a smaller one gives a smaller error.
void expect_reached(const AmrHierarchy& h, const EncodedField& field, Scene scene, const Picture& reference) {
  double before = kInf;
  for (const double tolerance : {1e-2, 1e-3, 1e-4}) {
    scene.settings.tolerance = tolerance;
    const double p95 = percentile(pixel_errors(render_on_cpu(h, field, scene, false), reference), 0.95);
    EXPECT_LE(p95, tolerance);
    EXPECT_LE(p95, before) << "asked " << tolerance;
    before = p95;
  }
}

TEST(Tolerance, IsReachedByEveryStructureWithWideAndNarrowCurves) {
  // the second mesh, field and view are of no scene that the rule was calibrated with
  struct Case {
    const char* mesh;
    View view;
  };
  for (const Case& scene_case :
       {Case{R"({"field": "blobs_shell", "levels": 2})", perspective({2.32, 1.87, 1.53}, Vec3d(0.5))},
        Case{R"({"field": {"type": "blobs", "count": 9, "seed": 3}, "levels": 2})", perspective({-0.7, 0.3, 1.6}, Vec3d(0.5))}}) {
    const AmrHierarchy h(generate_mesh(Json::parse(scene_case.mesh)));
    for (const auto& [encoding, filter] :
         {std::pair{"page_table", Filter::linear_page}, std::pair{"kd_tree", Filter::linear_vertex},
          std::pair{"octree", Filter::linear_lod}, std::pair{"uniform", Filter::linear_page}}) {
      const EncodedField field = build(h, a_case(encoding, filter));
      for (const Curve& curve : curves()) {
        SCOPED_TRACE(fmt::format("{} {} {}", scene_case.mesh, encoding, curve.name));
        Scene scene = scene_of(Integrator::tolerance, scene_case.view, Sampling::adaptive, 32);
        scene.transfer_function = curve.light;
        expect_reached(h, field, scene, HierarchyReference(h, 0, field.definition).render(scene, 1.0 / 8));
      }
    }
  }
}

TEST(Tolerance, OfAWideCurveTakesAtMostFourTenthsMoreSamplesThanTheStepThatReachesIt) {
  MeasuredOnGl gl(curves().front());
  Scene& scene = gl.scene;
  scene.settings.tolerance = 1e-4;
  double reached = 0;
  const std::int64_t samples = gl.measure(reached);
  EXPECT_LE(reached, 1e-4);
  scene.settings.integrator = Integrator::exponential_midpoint;
  for (const double step : halved(8, 6)) {
    scene.settings.step = step;
    double p95 = 0;
    const std::int64_t fixed = gl.measure(p95);
    if (p95 > 1e-4) continue;
    // every cell on the way is told by three values, however smooth it turns out to be: 1.33 times
    EXPECT_LE(static_cast<double>(samples), 1.4 * static_cast<double>(fixed)) << "step " << step;
    break;
  }
}

TEST(Tolerance, RefusesWhatItCannotFollow) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const auto complaint = [&](Filter filter, auto&& change) -> std::string {
    Scene scene = wave_scene(Integrator::tolerance, Sampling::adaptive);
    change(scene.settings);
    try {
      render_on_cpu(h, build(h, a_case("page_table", filter)), scene, false);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(complaint(Filter::nearest, [](auto&) {}), testing::HasSubstr("linear_lod, linear_page, linear_vertex, basis"));
  EXPECT_THAT(complaint(Filter::linear_page, [](auto& s) { s.sampling = Sampling::lattice; }), testing::HasSubstr("adaptive"));
  EXPECT_THAT(complaint(Filter::linear_page, [](auto& s) { s.mode = Mode::projection; }), testing::HasSubstr("mode dvr"));
  for (const double bad : {0.0, -1.0, kNan, kInf})
    EXPECT_THAT(complaint(Filter::linear_page, [&](auto& s) { s.tolerance = bad; }), testing::HasSubstr("(0, 1]"));
}

}  // namespace
}  // namespace amrtex
