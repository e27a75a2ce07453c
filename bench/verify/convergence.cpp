// Observed orders: in the step, in the cells, in pixels, of isosurfaces. Each order is a least-squares slope
// over errors against the reference or a closed form; each has a control of a lower order.
#include <numbers>

#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

std::string errors_text(std::span<const double> errors) {
  return fmt::format("{} ({} to {})", format_number(observed_order(errors)), format_number(errors.front()),
                     format_number(errors.back()));
}

Check order_near(std::span<const double> errors, double order, double tolerance) {
  const double got = observed_order(errors);
  return {fmt::format("{} ± {}", format_number(order), format_number(tolerance)), errors_text(errors),
          std::abs(got - order) <= tolerance};
}
Check order_at_least(std::span<const double> errors, double order) {
  return {fmt::format(">= {}", format_number(order)), errors_text(errors), observed_order(errors) >= order};
}
Check order_below(std::span<const double> errors, double order) {
  return {fmt::format("< {}", format_number(order)), errors_text(errors), observed_order(errors) < order};
}

double smooth(const Vec3d& p) {
  return 0.5 + 0.2 * std::sin(3 * p.x + 1) * std::cos(2 * p.y) + 0.2 * p.z * std::sin(2 * p.x + p.z);
}

/// Extinction and colour without a corner between values that occur.
TransferFunction gentle() {
  TransferFunction tf;
  tf.extinction = {{-1, 0}, {2, 15}};
  tf.color = {{-1, {0, 0.2, 1}}, {2, {1, 0.8, 0}}};
  return tf;
}

Scene smooth_scene(Mode mode, Sampling sampling, double step) {
  Scene s = small_scene(mode, perspective({2.1, -1.7, 1.3}, Vec3d(0.5)), sampling, 12);
  s.transfer_function = gentle();
  s.settings.step = step;
  return s;
}

/// Well below a cell: where regions are single cells, equal intervals are shorter than the step that was asked for,
/// the more so the larger it is, which hides the order.
std::vector<double> steps(const VerifyContext& v) {
  return v.size(std::vector{0.25, 0.125, 0.0625, 0.03125}, std::vector{0.25, 0.125, 0.0625, 0.03125, 0.015625});
}

std::vector<double> step_errors(VerifyContext& v, const AmrHierarchy& h, const EncodingCase& c, Mode mode, Sampling sampling) {
  const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
  const Picture exact = HierarchyReference(h, 0, field.definition).render(smooth_scene(mode, sampling, 1), 1.0 / 16);
  std::vector<double> errors;
  for (const double step : steps(v))
    errors.push_back(rms_difference(render_on_cpu(h, field, smooth_scene(mode, sampling, step), true), exact));
  return errors;
}

/// The same light with opacity k ds for 1 - exp(-k ds), by hand, along one axis-parallel ray of a field f = x.
double euler_light(int n) {
  double t = 1, c = 0;
  for (int i = 0; i < n; ++i) {
    const double x = (i + 0.5) / n;
    const double alpha = 4 * x / n;
    c += t * alpha * x;
    t *= 1 - alpha;
  }
  return c;
}

void step_refinement(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root(smooth).hierarchy();
  v.for_each_filter("3 step refinement, exponential midpoint", [&](const EncodingCase& c) -> std::optional<Check> {
    if (c.filter == Filter::nearest) return std::nullopt;  // jumps at every cell
    return order_near(step_errors(v, h, c, Mode::dvr, Sampling::adaptive), 2, 0.2);
  });
  v.once("3 control: step refinement, Euler opacity k ds", [] {
    // C of k = 4 x, c = x on [0, 1]: sqrt(pi / 8) erf(sqrt 2) - exp(-2)
    const double exact = std::sqrt(std::numbers::pi / 8) * std::erf(std::numbers::sqrt2) - std::exp(-2.0);
    std::vector<double> errors;
    for (const int n : {16, 32, 64, 128, 256}) errors.push_back(std::abs(euler_light(n) - exact));
    return order_near(errors, 1, 0.1);
  });
  // To be switched on with the render key `integrator`: left point and Euler of order 1, preintegrated of order 2.
  for (const char* integrator : {"euler", "left", "preintegrated"})
    v.skip(fmt::format("3 step refinement, integrator {}", integrator), nullptr, "not available in this version");
  for (const char* transfer : {"step", "peak of width 0.02"})
    v.skip(fmt::format("5 {} transfer function, preintegrated: order 2", transfer), nullptr, "not available in this version");
}

void level_jump(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();  // coarse cells that do not resolve it: the filters jump visibly
  const auto jumps = [](const EncodingCase& c, const FilterDefinition& d) {
    return c.filter == Filter::linear_lod || (c.filter == Filter::linear_page && d.page_size > 0);
  };
  v.for_each_filter("4 step refinement across level jumps, intervals split there",
                    [&](const EncodingCase& c) -> std::optional<Check> {
                      if (!jumps(c, v.build(h, c).definition)) return std::nullopt;
                      return order_at_least(step_errors(v, h, c, Mode::projection, Sampling::adaptive), 1.8);
                    });
  v.for_each_filter("4 control: the same across level jumps, lattice", [&](const EncodingCase& c) -> std::optional<Check> {
    if (c.filter != Filter::linear_lod) return std::nullopt;
    return order_below(step_errors(v, h, c, Mode::projection, Sampling::lattice), 1.7);
  });
}

/// Largest difference from f at places a tenth of the domain inside of it.
double field_error(VerifyContext& v, const AmrHierarchy& h, const EncodingCase& c, const Function& f) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0.2, 0.8);
  std::vector<FinestPosition> at;
  std::vector<double> exact;
  for (int i = 0; i < 400; ++i) {
    const Vec3d p(unit(random), unit(random), unit(random));
    at.push_back(finest_position(h, p).value());
    exact.push_back(f(p));
  }
  const auto got = probe_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), Precision::double_precision, at);
  double worst = 0;
  for (std::size_t i = 0; i < at.size(); ++i) worst = std::max(worst, got[i].found ? std::abs(got[i].value - exact[i]) : kInf);
  return worst;
}

AmrHierarchy two_levels(int n) {
  return MeshBuilder(Vec3i(n), {2}).root(smooth).patch(1, Box{Vec3i(n / 2), {n, n, 3 * n / 2}}, smooth).hierarchy();
}

void grid_refinement(VerifyContext& v) {
  const std::vector<int> sizes = v.size(std::vector{8, 16, 32}, std::vector{8, 16, 32, 64});
  v.for_each_filter("8 grid refinement, one level, largest error inside", [&](const EncodingCase& c) {
    std::vector<double> errors;
    for (const int n : sizes) errors.push_back(field_error(v, MeshBuilder(Vec3i(n)).root(smooth).hierarchy(), c, smooth));
    return order_near(errors, c.filter == Filter::nearest ? 1 : 2, 0.3);
  });
  v.for_each_filter("9 grid refinement, level boundary, largest error", [&](const EncodingCase& c) {
    std::vector<double> errors;
    for (const int n : sizes) errors.push_back(field_error(v, two_levels(n), c, smooth));
    return order_at_least(errors, 0.8);
  });
  v.for_each_filter("9 grid refinement, level boundary, line integrals", [&](const EncodingCase& c) {
    const auto picture = [&](int n, Storage storage) {
      const AmrHierarchy h = two_levels(n);
      Scene s = small_scene(Mode::projection, orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 0.5), Sampling::adaptive, 6);
      s.settings.step = 0.25;
      return render_on_cpu(h, v.build(h, c, {.storage = storage}), s, true);
    };
    // the exact line integral, by small steps
    Picture exact(6, 6, 1);
    const Scene s = small_scene(Mode::projection, orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 0.5), Sampling::adaptive, 6);
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < 6; ++x) {
        const WorldRay ray = camera_ray(camera_frame(s.view, 6, 6), x, y, 6, 6);
        double enter = 0;
        for (int a = 0; a < 3; ++a) enter = std::max(enter, ((ray.direction[a] > 0 ? 0 : 1) - ray.origin[a]) / ray.direction[a]);
        const double length = chord(s, x, y, Vec3d(0), Vec3d(1));
        double sum = 0;
        constexpr int kParts = 4000;
        for (int i = 0; i < kParts; ++i) sum += smooth(ray.origin + (enter + length * (i + 0.5) / kParts) * ray.direction);
        *exact.pixel(x, y) = sum * length / kParts;
      }
    std::vector<double> errors;
    for (const int n : sizes) errors.push_back(rms_difference(picture(n, Storage::r64f), exact));
    return order_at_least(errors, c.filter == Filter::nearest ? 1 : 1.6);
  });
}

void pixel_refinement(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(smooth).hierarchy();
  v.for_each_filter("13 pixel refinement, successive pictures", [&](const EncodingCase& c) -> std::optional<Check> {
    if (c.filter == Filter::nearest) return std::nullopt;
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    const auto picture = [&](int pixels) {
      Scene s = small_scene(Mode::projection, orthographic(Vec3d(0.5), {1, 0.1, 0.2}, 0.4), Sampling::adaptive, pixels);
      s.settings.step = 0.5;
      return render_on_cpu(h, field, s, true);
    };
    std::vector<double> errors;
    Picture coarse = picture(8);
    for (const int pixels : {16, 32, 64}) {
      const Picture fine = picture(pixels);
      double worst = 0;
      for (int y = 0; y < pixels; ++y)
        for (int x = 0; x < pixels; ++x) worst = std::max(worst, std::abs(*fine.pixel(x, y) - *coarse.pixel(x / 2, y / 2)));
      errors.push_back(worst);
      coarse = fine;
    }
    return order_near(errors, 1, 0.2);
  });
}

/// A sphere of radius 0.3 in the unit cube: f = distance from its middle.
void isosurfaces(VerifyContext& v) {
  const Vec3d middle(0.51, 0.48, 0.5);
  const auto f = [&](const Vec3d& p) { return glm::length(p - middle); };
  const double radius = 0.3;
  const auto scene = [&](Output output) {
    Scene s = small_scene(Mode::iso, orthographic(middle, {1, 0.3, -0.2}, 0.36), Sampling::adaptive, 9);
    s.settings.isosurfaces.values = {radius};
    s.settings.isosurfaces.output = output;
    s.settings.isosurfaces.tolerance = 1e-6;
    s.settings.step = 0.25;
    return s;
  };
  const auto errors_of = [&](const EncodingCase& c, Output output) {
    std::vector<double> errors;
    for (const int n : v.size(std::vector{8, 16, 32}, std::vector{8, 16, 32, 64})) {
      const AmrHierarchy h = MeshBuilder(Vec3i(n)).root(f).hierarchy();
      const Scene s = scene(output);
      const Picture p = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
      double worst = 0;
      for (int y = 0; y < 9; ++y)
        for (int x = 0; x < 9; ++x) {
          const WorldRay ray = camera_ray(camera_frame(s.view, 9, 9), x, y, 9, 9);
          const Vec3d to = ray.origin - middle;
          const double b = glm::dot(to, ray.direction);
          const double t = -b - std::sqrt(b * b - glm::dot(to, to) + radius * radius);
          const double* got = p.pixel(x, y);
          const Vec3d normal = glm::normalize(ray.origin + t * ray.direction - middle);
          const double error =
              output == Output::depth ? std::abs(got[0] - t) : glm::length(Vec3d(got[0], got[1], got[2]) - normal);
          worst = std::max(worst, error);
        }
      errors.push_back(worst);
    }
    return errors;
  };
  v.for_each_filter("25 isosurface, position", [&](const EncodingCase& c) -> std::optional<Check> {
    if (c.filter == Filter::nearest) return std::nullopt;
    return order_near(errors_of(c, Output::depth), 2, 0.4);
  });
  v.for_each_filter("24 gradient at the surface, central differences: direction",
                    [&](const EncodingCase& c) -> std::optional<Check> {
                      if (c.filter == Filter::nearest) return std::nullopt;
                      return order_at_least(errors_of(c, Output::normal), 0.9);
                    });
  v.for_each_filter("25 control: isosurface of nearest, position", [&](const EncodingCase& c) -> std::optional<Check> {
    if (c.filter != Filter::nearest) return std::nullopt;
    return order_below(errors_of(c, Output::depth), 1.5);
  });
  v.for_each_filter("24 a gradient of zero gives no NaN", [&](const EncodingCase& c) {
    // a plateau at the isovalue: f is 0.3 all around
    const AmrHierarchy h = MeshBuilder(Vec3i(8)).root([](const Vec3d& p) { return p.x < 0.5 ? 0.3 - 1e-12 : 0.3; }).hierarchy();
    bool finite = true;
    for (const Output output : {Output::color, Output::normal})
      for (const double value : render_on_cpu(h, v.build(h, c), scene(output), false).values)
        finite = finite && std::isfinite(value);
    return holds(finite, "finite", finite ? "finite" : "NaN");
  });
}

}  // namespace

void convergence_suite(VerifyContext& v) {
  step_refinement(v);
  level_jump(v);
  grid_refinement(v);
  pixel_refinement(v);
  isosurfaces(v);
}

}  // namespace amrtex::verify
