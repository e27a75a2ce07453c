// Observed orders: in the step, in the cells, in pixels, of isosurfaces. Each order is a least-squares slope
// over errors against the reference or a closed form, in a range where it is one; controls have a lower order.
#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

std::string errors_text(std::span<const double> errors) {
  return fmt::format("{} ({} to {})", format_number(observed_order(errors)), format_number(errors.front()),
                     format_number(errors.back()));
}

Check order_near(std::span<const double> errors, double order, double tolerance = 0.1) {
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

constexpr const char* kJumpsAtCells = "constant in each cell: its errors are those of the cells met, without an order";

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

Scene gentle_scene(Integrator integrator, Sampling sampling = Sampling::adaptive) {
  Scene s = small_scene(Mode::dvr, perspective({2.1, -1.7, 1.3}, Vec3d(0.5)), sampling, 16);
  s.transfer_function = gentle();
  s.settings.integrator = integrator;
  return s;
}

/// first, first / 2, ...
std::vector<double> halved(double first, int count) {
  std::vector<double> steps;
  for (int i = 0; i < count; ++i) steps.push_back(std::ldexp(first, -i));
  return steps;
}

/// In double, over the picture, against the reference.
std::vector<double> step_errors(VerifyContext& v, const AmrHierarchy& h, const EncodingCase& c, Scene scene,
                                std::span<const double> steps) {
  const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
  const Picture exact = HierarchyReference(h, 0, field.definition).render(scene, 1.0 / 128);  // good to some 1e-10
  std::vector<double> errors;
  for (const double step : steps) {
    scene.settings.step = step;
    errors.push_back(rms_difference(render_on_cpu(h, field, scene, true), exact));
  }
  return errors;
}

/// Integrators and the orders that they have on smooth light.
struct Rule {
  Integrator integrator;
  double order;
  std::string name() const {
    const bool control = integrator == Integrator::euler || integrator == Integrator::left;
    return fmt::format("{}{}", control ? "control: " : "", integrator_name(integrator));
  }
};
constexpr std::array<Rule, 4> kRules{
    {{Integrator::exponential_midpoint, 2}, {Integrator::preintegrated, 2}, {Integrator::euler, 1}, {Integrator::left, 1}}};

void step_refinement(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root(smooth).hierarchy();
  // Well below a cell: where regions are single cells, equal intervals are shorter than the step that was asked for,
  // the more so the larger it is, which hides the order.
  const std::vector<double> steps = halved(1.0 / 16, v.size(4, 5));
  for (const Rule& rule : kRules)
    v.for_each_filter("3 " + rule.name() + ": step refinement of a smooth field", [&](const EncodingCase& c) -> Verdict {
      if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
      return order_near(step_errors(v, h, c, gentle_scene(rule.integrator), steps), rule.order);
    });
}

void level_jump(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();  // coarse cells that do not resolve it: the filters jump visibly
  const std::vector<double> steps = halved(1.0 / 16, v.size(4, 5));
  for (const Rule& rule : kRules)
    v.for_each_filter("4 " + rule.name() + ": step refinement across level jumps, intervals split there",
                      [&](const EncodingCase& c) -> Verdict {
                        if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
                        return order_near(step_errors(v, h, c, gentle_scene(rule.integrator), steps), rule.order);
                      });
  // linear, so that each level alone has no error of order 1: all that there is to see are the jumps between levels
  const auto ramp = [](const Vec3d& p) { return 0.2 + 1.2 * p.x + 0.2 * p.y + 0.1 * p.z; };
  const AmrHierarchy ramps = MeshBuilder(Vec3i(16), {2}).root(ramp).patch(1, {Vec3i(16), Vec3i(32)}, ramp).hierarchy();
  v.for_each_filter("4 control: across level jumps, intervals of the lattice straddle them",
                    [&](const EncodingCase& c) -> Verdict {
                      if (v.build(ramps, c).definition.continuous_everywhere()) return NotAsked{"the filter is continuous"};
                      const Scene s = gentle_scene(Integrator::exponential_midpoint, Sampling::lattice);
                      return order_below(step_errors(v, ramps, c, s, halved(0.1, v.size(5, 6))), 1.5);
                    });
}

/// Two cells an edge, drawn between their centres: there f is one polynomial along any ray.
void transfer_steps(VerifyContext& v) {
  const AmrHierarchy h =
      MeshBuilder(Vec3i(2)).root([](const Vec3d& p) { return 0.1 + 0.7 * p.x + 0.45 * p.y * p.z + 0.4 * p.x * p.z; }).hierarchy();
  const auto scene = [](Integrator integrator, std::vector<TransferFunction::ExtinctionPoint> extinction) {
    Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0.35, 0.55}, 0.25), Sampling::adaptive, 16);
    s.region = {Vec3d(0.25), Vec3d(0.75)};
    s.settings.integrator = integrator;
    s.transfer_function.extinction = std::move(extinction);
    s.transfer_function.color = {{0, {1, 0.5, 0.25}}};
    return s;
  };
  const std::vector<TransferFunction::ExtinctionPoint> jump{{0.75, 0}, {0.75 + 1e-7, 12}};
  const std::vector<TransferFunction::ExtinctionPoint> peak{{0.74, 0}, {0.75, 80}, {0.76, 0}};
  v.for_each_filter("5 step of the transfer function, preintegrated", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
    return order_near(step_errors(v, h, c, scene(Integrator::preintegrated, jump), halved(1.0 / 16, v.size(5, 7))), 2);
  });
  // Once intervals resolve the peak; before, see the spike of the suite `stiff`. What its two sides are off cancels in part.
  v.for_each_filter("5 peak of width 0.02, preintegrated", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
    return order_at_least(step_errors(v, h, c, scene(Integrator::preintegrated, peak), halved(1.0 / 64, v.size(5, 6))), 1.9);
  });
  const std::vector<double> steps = halved(1.0 / 16, v.size(5, 7));
  v.for_each_filter("5 control: step of the transfer function, classified at samples", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
    return order_near(step_errors(v, h, c, scene(Integrator::exponential_midpoint, jump), steps), 1, 0.25);
  });
}

/// Largest difference from f at the corners and the middle of cells, where interpolation and cells' own values are worst;
/// of the cells of each level that hold points of `places`.
double field_error(VerifyContext& v, const AmrHierarchy& h, const EncodingCase& c, const Function& f,
                   std::span<const Vec3d> places) {
  std::vector<FinestPosition> at;
  std::vector<double> exact;
  const Vec3d finest = h.spacing(h.finest_level());
  for (const Vec3d& place : places) {
    const LeafCell leaf = h.find_leaf(finest_position(h, place).value().cell).value();
    const int w = h.cell_width(leaf.level);
    for (int corner = 0; corner < 9; ++corner) {
      FinestPosition p{leaf.cell * w, Vec3d(0)};
      for (int a = 0; a < 3; ++a) {
        const bool upper = (corner >> a & 1) != 0;
        if (corner == 8) {
          p.cell[a] += w / 2;
          p.fraction[a] = w % 2 == 0 ? 0 : 0.5;
        } else {
          p.cell[a] += upper ? w - 1 : 0;
          p.fraction[a] = upper ? kBelowOne : 0;
        }
      }
      at.push_back(p);
      exact.push_back(f(h.domain_lower() + (Vec3d(p.cell) + p.fraction) * finest));
    }
  }
  const auto got = probe_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), Precision::double_precision, at);
  double worst = 0;
  for (std::size_t i = 0; i < at.size(); ++i) worst = std::max(worst, got[i].found ? std::abs(got[i].value - exact[i]) : kInf);
  return worst;
}

/// At random in a box, seldom on a face.
std::vector<Vec3d> places_in(const Vec3d& lower, const Vec3d& upper) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Vec3d> places;
  for (int i = 0; i < 200; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    places.push_back(lower + Vec3d(x, y, z) * (upper - lower));
  }
  return places;
}

/// Refined from 1/4 to 1/2, along z to 3/4.
AmrHierarchy two_levels_of(int n, const Function& f) {
  return MeshBuilder(Vec3i(n), {2}).root(f).patch(1, Box{Vec3i(n / 2), {n, n, 3 * n / 2}}, f).hierarchy();
}
AmrHierarchy two_levels(int n) { return two_levels_of(n, smooth); }

/// The integral of `smooth` along each pixel's ray through the unit cube, by many small steps.
Picture line_integrals(const Scene& scene) {
  const int width = scene.settings.width, height = scene.settings.height;
  Picture exact(width, height, 1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const WorldRay ray = camera_ray(camera_frame(scene.view, width, height), x, y, width, height);
      double enter = 0;
      for (int a = 0; a < 3; ++a)
        if (ray.direction[a] != 0) enter = std::max(enter, ((ray.direction[a] > 0 ? 0 : 1) - ray.origin[a]) / ray.direction[a]);
      const double length = chord(scene, x, y, Vec3d(0), Vec3d(1));
      double sum = 0;
      constexpr int kParts = 4000;
      for (int i = 0; i < kParts; ++i) sum += smooth(ray.origin + (enter + length * (i + 0.5) / kParts) * ray.direction);
      *exact.pixel(x, y) = sum * length / kParts;
    }
  return exact;
}

void grid_refinement(VerifyContext& v) {
  const std::vector<int> sizes = v.size(std::vector{16, 32, 64}, std::vector{16, 32, 64, 128});
  const auto errors_of = [&](const EncodingCase& c, AmrHierarchy (*mesh)(int), std::span<const Vec3d> places) {
    std::vector<double> errors;
    for (const int n : sizes) errors.push_back(field_error(v, mesh(n), c, smooth, places));
    return errors;
  };
  const auto inside = places_in(Vec3d(0.2), Vec3d(0.8));
  v.for_each_filter("8 grid refinement, one level, largest error inside", [&](const EncodingCase& c) {
    const auto one_level = [](int n) { return MeshBuilder(Vec3i(n)).root(smooth).hierarchy(); };
    return order_near(errors_of(c, one_level, inside), interpolates(c.filter) ? 2 : 1);
  });
  // just above and below the face x = 1/2 between both levels
  std::vector<Vec3d> boundary;
  for (const double x : {0.5 - 1e-6, 0.5 + 1e-6}) {
    const auto side = places_in({x, 0.35, 0.35}, {x, 0.45, 0.65});
    boundary.insert(boundary.end(), side.begin(), side.end());
  }
  v.for_each_filter("9 grid refinement, level boundary, largest error",
                    [&](const EncodingCase& c) { return order_at_least(errors_of(c, two_levels, boundary), 0.9); });
  v.for_each_filter(
      "9 grid refinement, level boundaries, line integrals across them of a field of x", [&](const EncodingCase& c) {
        const auto f = [](const Vec3d& p) { return smooth({p.x, 0.4, 0.6}); };
        Scene s = small_scene(Mode::projection, orthographic({0.5, 0.38, 0.57}, {1, 0, 0}, 0.1), Sampling::adaptive, 4);
        s.settings.step = 1.0 / 8;
        const double exact =
            *line_integrals(small_scene(Mode::projection, orthographic({0.5, 0.4, 0.6}, {1, 0, 0}, 1e-6), Sampling::adaptive, 1))
                 .pixel(0, 0);
        std::vector<double> errors;
        for (const int n : sizes) {
          const AmrHierarchy h = two_levels_of(n, f);
          Picture p = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
          for (double& value : p.values) value -= exact;
          errors.push_back(rms_difference(p, Picture(4, 4, 1)));
        }
        return order_near(errors, 2);
      });
  v.for_each_filter("9 grid refinement, level boundaries, line integrals of oblique rays", [&](const EncodingCase& c) {
    Scene s = small_scene(Mode::projection, orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 0.5), Sampling::adaptive, 12);
    s.settings.step = 0.25;
    const Picture exact = line_integrals(s);
    std::vector<double> errors;
    for (const int n : sizes) {
      const AmrHierarchy h = two_levels(n);
      errors.push_back(rms_difference(render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true), exact));
    }
    // the cells of nearest that an oblique ray meets are off by h of either sign: more than 1, less than 2
    return order_at_least(errors, interpolates(c.filter) ? 1.75 : 1.5);
  });
}

void pixel_refinement(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(smooth).hierarchy();
  v.for_each_filter("13 pixel refinement, successive pictures", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kJumpsAtCells};
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    const auto picture = [&](int pixels) {
      Scene s = small_scene(Mode::projection, orthographic(Vec3d(0.5), {1, 0.1, 0.2}, 0.4), Sampling::adaptive, pixels);
      s.settings.step = 0.5;
      return render_on_cpu(h, field, s, true);
    };
    std::vector<double> errors;
    Picture coarse = picture(8);
    for (const int pixels : v.size(std::vector{16, 32, 64, 128}, std::vector{16, 32, 64, 128, 256})) {
      const Picture fine = picture(pixels);
      double worst = 0;
      for (int y = 0; y < pixels; ++y)
        for (int x = 0; x < pixels; ++x) worst = std::max(worst, std::abs(*fine.pixel(x, y) - *coarse.pixel(x / 2, y / 2)));
      errors.push_back(worst);
      coarse = fine;
    }
    return order_near(errors, 1);
  });
}

/// A sphere of radius 0.3 in the unit cube: f = distance from its middle, looked at around a place on it.
struct Sphere {
  static constexpr double radius = 0.3;
  static constexpr int pixels = 17;
  Vec3d middle{0.51, 0.48, 0.5};
  double f(const Vec3d& p) const { return glm::length(p - middle); }

  Scene scene(Output output, const Vec3d& at, const Vec3d& direction, double height) const {
    Scene s = small_scene(Mode::iso, orthographic(at, direction, height), Sampling::adaptive, pixels);
    s.settings.isosurfaces.values = {radius};
    s.settings.isosurfaces.output = output;
    s.settings.isosurfaces.tolerance = 1e-6;
    s.settings.step = 0.25;
    return s;
  }
  /// Root of the mean square over the picture of the error of the depth, world, or of the normal.
  double error(const Scene& s, const Picture& p) const {
    double sum = 0;
    for (int y = 0; y < pixels; ++y)
      for (int x = 0; x < pixels; ++x) {
        const WorldRay ray = camera_ray(camera_frame(s.view, pixels, pixels), x, y, pixels, pixels);
        const Vec3d to = ray.origin - middle;
        const double b = glm::dot(to, ray.direction);
        const double t = -b - std::sqrt(b * b - glm::dot(to, to) + radius * radius);
        const double* got = p.pixel(x, y);
        const Vec3d normal = glm::normalize(ray.origin + t * ray.direction - middle);
        const double e = s.settings.isosurfaces.output == Output::depth ? std::abs(got[0] - t)
                                                                        : glm::length(Vec3d(got[0], got[1], got[2]) - normal);
        sum += e * e;
      }
    return std::sqrt(sum / (pixels * pixels));
  }
};

void isosurfaces(VerifyContext& v) {
  const Sphere sphere;
  const auto f = [&](const Vec3d& p) { return sphere.f(p); };
  const std::vector<int> sizes = v.size(std::vector{16, 32, 64}, std::vector{16, 32, 64, 128});
  const auto inside = [&](const EncodingCase& c, Output output) {
    std::vector<double> errors;
    for (const int n : sizes) {
      const AmrHierarchy h = MeshBuilder(Vec3i(n)).root(f).hierarchy();
      const Scene s = sphere.scene(output, sphere.middle, {1, 0.3, -0.2}, 0.36);
      errors.push_back(sphere.error(s, render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true)));
    }
    return errors;
  };
  // where the sphere meets the face z = 1/2 between both levels: two coarse cells to each side of it
  const auto at_boundary = [&](const EncodingCase& c, Output output) {
    std::vector<double> errors;
    for (const int n : sizes) {
      const AmrHierarchy h = MeshBuilder(Vec3i(n), {2}).root(f).patch(1, {Vec3i(0), {2 * n, 2 * n, n}}, f).hierarchy();
      const Vec3d at = sphere.middle + Sphere::radius * Vec3d(-0.8, -0.6, 0);
      const Scene s = sphere.scene(output, at, {0.8, 0.6, 0}, 4.0 / n);
      errors.push_back(sphere.error(s, render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true)));
    }
    return errors;
  };
  constexpr const char* kStairs = "its surface is made of cells' faces";
  v.for_each_filter("25 isosurface, position", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kStairs};
    return order_near(inside(c, Output::depth), 2);
  });
  v.for_each_filter("25 isosurface, normal, at least 1", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kStairs};
    return order_at_least(inside(c, Output::normal), 1);
  });
  v.for_each_filter("25 isosurface at a level boundary, position", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kStairs};
    return order_at_least(at_boundary(c, Output::depth), 0.9);
  });
  v.for_each_filter("24 gradient inside, direction", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kStairs};
    return order_near(inside(c, Output::normal), 2);
  });
  // a filter whose values jump at a boundary has no order left for their differences
  const auto is_continuous = [](const EncodingCase& c) { return filter_info(c.filter).continuity == Continuity::everywhere; };
  v.for_each_filter("24 gradient at a level boundary, direction", [&](const EncodingCase& c) -> Verdict {
    if (!is_continuous(c)) return NotAsked{"its values jump at level boundaries, see the control"};
    return order_at_least(at_boundary(c, Output::normal), 1);
  });
  v.for_each_filter("24 control: gradient at a level boundary, filters whose values jump there",
                    [&](const EncodingCase& c) -> Verdict {
                      if (!interpolates(c.filter)) return NotAsked{kStairs};
                      if (is_continuous(c)) return NotAsked{"its values do not jump"};
                      return order_below(at_boundary(c, Output::normal), 0.9);
                    });
  v.for_each_filter("25 control: isosurface of nearest, position", [&](const EncodingCase& c) -> Verdict {
    if (c.filter != Filter::nearest) return NotAsked{"a control of nearest"};
    return order_below(inside(c, Output::depth), 1.5);
  });
  v.for_each_filter("24 a gradient of zero gives no NaN", [&](const EncodingCase& c) {
    // a plateau at the isovalue: f is 0.3 all around
    const AmrHierarchy h = MeshBuilder(Vec3i(8)).root([](const Vec3d& p) { return p.x < 0.5 ? 0.3 - 1e-12 : 0.3; }).hierarchy();
    bool finite = true;
    for (const Output output : {Output::color, Output::normal})
      for (const double value :
           render_on_cpu(h, v.build(h, c), sphere.scene(output, sphere.middle, {1, 0.3, -0.2}, 0.36), false).values)
        finite = finite && std::isfinite(value);
    return holds(finite, "finite", finite ? "finite" : "NaN");
  });
}

}  // namespace

void convergence_suite(VerifyContext& v) {
  step_refinement(v);
  level_jump(v);
  transfer_steps(v);
  grid_refinement(v);
  pixel_refinement(v);
  isosurfaces(v);
}

}  // namespace amrtex::verify
