// Closed forms: constant and varying media, constants, bounds, continuity.
#include <numbers>

#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex::verify {
namespace {

constexpr const char* kCellwise = "constant in each cell: it does not hold f = x";

/// Largest error of a slab of constant light: T = exp(-k L), C = c (1 - T).
double slab_error(const Picture& picture, const Scene& scene, const AmrHierarchy& h, double extinction) {
  double worst = largest(picture) > 0.3 ? 0 : kInf;  // it must be in the picture
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double opacity = -std::expm1(-extinction * chord(scene, x, y, h.domain_lower(), h.domain_upper()));
      const double* p = picture.pixel(x, y);
      for (const double d : {p[3] - opacity, p[0] - 0.75 * opacity, p[1] - 0.5 * opacity, p[2] - 0.25 * opacity})
        worst = std::isnan(d) ? kInf : std::max(worst, std::abs(d));
    }
  return worst;
}

std::vector<Scene> slab_scenes() {
  const Vec3d middle(0.5);
  const std::vector<View> views{orthographic(middle, {1, 0, 0}, 1.5), orthographic(middle, {-1, 0.7, 0.4}, 1.5),
                                perspective({2, -1.5, 1.2}, middle), perspective({0.4, 0.55, 0.3}, {1, 0.2, 0.8})};
  std::vector<Scene> scenes;
  for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
    for (const View& view : views)
      for (const double step : {1.0, 0.37}) {
        scenes.push_back(small_scene(Mode::dvr, view, sampling));
        scenes.back().transfer_function = constant_light(3);
        scenes.back().settings.step = step;
      }
  return scenes;
}

void constant_medium(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const std::vector<Scene> scenes = slab_scenes();
  v.for_each("1 constant medium, double", v.size(std::span(v.filters()), std::span(v.variants())), [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    double worst = 0;
    for (const Scene& s : scenes) worst = std::max(worst, slab_error(render_on_cpu(h, field, s, true), s, h, 3));
    return at_most(worst, 1e-12);
  });
  std::size_t turn = 0;
  v.for_each_filter("1 constant medium, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.value_ranges = false});
    double worst = 0;
    for (int i = 0; i < v.size(1, 8); ++i) {
      const Scene& s = scenes[(5 * turn++ + 1) % scenes.size()];
      worst = std::max(worst, slab_error(draw(v.gl(), h, field, s), s, h, 3));
    }
    return at_most(worst, 1e-5);
  });
  v.once("1 control: opacity k ds in place of 1 - exp(-k ds)", [&] {
    // 16 steps of k ds = 3 / 16 over a length of 1
    return above(std::abs(std::pow(1 - 3.0 / 16, 16) - std::exp(-3.0)), 1e-5);
  });
}

void anisotropic_medium(VerifyContext& v) {
  const AmrHierarchy h =
      MeshBuilder({8, 8, 8}, {2}, {-1, 0, 0}, {1, 1, 0.5}).root(waves).patch(1, {{4, 4, 4}, {12, 8, 16}}, waves).hierarchy();
  v.for_each_filter("1 constant medium, anisotropic cells, double", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    double worst = 0;
    for (const Vec3d& direction : {Vec3d(0, 0, -1), Vec3d(1, 0.5, 0.25)})
      for (const bool world : {false, true}) {
        Scene s = small_scene(Mode::dvr, orthographic({0, 0.5, 0.25}, direction, 1), Sampling::adaptive);
        s.transfer_function = constant_light(3);
        if (world) s.transfer_function.length_unit = TransferFunction::LengthUnit::world;
        worst = std::max(worst, slab_error(render_on_cpu(h, field, s, true), s, h, world ? 3 : 1.5));
      }
    return at_most(worst, 1e-12);
  });
}

/// f = x, k = a x, c = x on [x0, x1]; from inside the outer cells' centres.
struct LinearMedium {
  static constexpr double a = 8, x0 = 0.25, x1 = 0.75;
  static double transmittance() { return std::exp(-a * (x1 * x1 - x0 * x0) / 2); }
  /// C = x0 - x1 T + e^(a x0^2 / 2) sqrt(pi / 2a) (erf(x1 sqrt(a/2)) - erf(x0 sqrt(a/2)))
  static double light() {
    return x0 - x1 * transmittance() +
           std::exp(a * x0 * x0 / 2) * std::sqrt(std::numbers::pi / (2 * a)) *
               (std::erf(x1 * std::sqrt(a / 2)) - std::erf(x0 * std::sqrt(a / 2)));
  }
  static Scene scene(double step) {
    Scene s = small_scene(Mode::dvr, orthographic({0.5, 0.47, 0.52}, {1, 0, 0}, 0.1), Sampling::adaptive, 4);
    s.transfer_function.extinction = {{0, 0}, {1, a}};
    s.transfer_function.color = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
    s.region = {Vec3d(x0, 0, 0), Vec3d(x1, 1, 1)};
    s.settings.step = step;
    return s;
  }
};

void linear_medium(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.x; }).hierarchy();
  v.for_each_filter("2 linear extinction, order of the light, double", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kCellwise};
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    std::vector<double> errors;
    double depth = 0;
    for (const double step : {1.0, 0.5, 0.25, 0.125}) {
      const Picture p = render_on_cpu(h, field, LinearMedium::scene(step), true);
      errors.push_back(std::abs(p.pixel(2, 2)[0] - LinearMedium::light()));
      depth = std::max(depth, std::abs(p.pixel(2, 2)[3] - (1 - LinearMedium::transmittance())));
    }
    return all_of(std::array{near(observed_order(errors), 2, 0.1), at_most(depth, 1e-12), at_most(errors[0], 1e-3)});
  });
  v.for_each_filter("2 linear extinction, GL", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{kCellwise};
    const Scene s = LinearMedium::scene(1.0 / 32);
    const Picture p = draw(v.gl(), h, v.build(h, c, {.value_ranges = false}), s);
    return at_most(std::abs(p.pixel(2, 2)[0] - LinearMedium::light()), 1e-5);
  });
}

/// f = x on [x0, x1] along +x and -x: its integral, its largest value.
void linear_field(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.x; }).hierarchy();
  constexpr double x0 = 0.25, x1 = 0.75, step = 0.5;  // of a cell of 1/16: intervals end at faces
  const auto pixel = [&](Mode mode, double direction, const auto& draw_scene) {
    Scene s = small_scene(mode, orthographic({0.5, 0.47, 0.52}, {direction, 0, 0}, 0.1), Sampling::adaptive, 4);
    s.region = {Vec3d(x0, 0, 0), Vec3d(x1, 1, 1)};
    s.settings.step = step;
    return *draw_scene(s).pixel(2, 2);
  };
  // a midpoint rule holds f = x exactly; the cells of nearest stand on either side of it alike
  constexpr double integral = (x1 * x1 - x0 * x0) / 2;
  const auto worst_of = [&](const EncodingCase& c, double rounding, const auto& draw_scene) {
    // samples stand in the middle of their intervals; of nearest, the middle of the last cell is seen
    const double greatest = interpolates(c.filter) ? x1 - step / 2 / 16 : x1 - 0.5 / 16;
    std::vector<Check> all;
    for (const double direction : {1.0, -1.0}) {
      all.push_back(at_most(std::abs(pixel(Mode::projection, direction, draw_scene) - integral), rounding));
      all.push_back(at_most(std::abs(pixel(Mode::mip, direction, draw_scene) - greatest), rounding));
    }
    return all_of(all);
  };
  v.for_each_filter("2 linear field, projection and mip, double", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    return worst_of(c, 1e-12, [&](const Scene& s) { return render_on_cpu(h, field, s, true); });
  });
  v.for_each_filter("2 linear field, projection and mip, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    return worst_of(c, 1e-5, [&](const Scene& s) { return draw(v.gl(), h, field, s); });
  });
}

/// Four slabs of 2 to 6 cells along x, values 0 to 3.
void slab_stack(VerifyContext& v) {
  const std::array<int, 5> faces{0, 2, 8, 11, 16};
  const auto f = [&](const Vec3d& p) {
    int slab = 0;
    while (p.x * 16 > faces[static_cast<std::size_t>(slab + 1)]) ++slab;
    return static_cast<double>(slab);
  };
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(f).hierarchy();
  Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0, 0}, 0.5), Sampling::adaptive, 4);
  s.transfer_function.extinction = {{0, 1}, {1, 5}, {2, 0}, {3, 9}};
  s.transfer_function.color = {{0, {1, 0, 0}}, {1, {0, 1, 0}}, {2, {1, 1, 1}}, {3, {0, 0, 1}}};
  // C of slab i = T before it (1 - exp(-k_i L_i)) of its own colour
  std::array<double, 4> light{};
  double t = 1;
  for (std::size_t i = 0; i < 4; ++i) {
    const double after = t * std::exp(-s.transfer_function.extinction[i].extinction * (faces[i + 1] - faces[i]) / 16.0);
    light[i] = t - after;
    t = after;
  }
  const auto error = [&](const Picture& p) {
    const double* c = p.pixel(1, 2);
    return std::max({std::abs(c[0] - light[0]), std::abs(c[1] - light[1]), std::abs(c[2] - light[3]), std::abs(c[3] - (1 - t))});
  };
  v.for_each_filter("2 stack of slabs, double", [&](const EncodingCase& c) -> Verdict {
    if (c.filter != Filter::nearest) return NotAsked{"slabs of constant values are those of nearest; of others see the control"};
    return at_most(error(render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true)), 1e-12);
  });
  v.for_each_filter("2 stack of slabs, GL", [&](const EncodingCase& c) -> Verdict {
    if (c.filter != Filter::nearest) return NotAsked{"slabs of constant values are those of nearest; of others see the control"};
    return at_most(error(draw(v.gl(), h, v.build(h, c), s)), 1e-5);
  });
  v.for_each_filter("2 control: stack of slabs, interpolated", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{"nothing is interpolated"};
    Scene between = s;  // samples at the cells' centres would see the slabs' own values
    between.settings.step = 0.5;
    return above(error(render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), between, true)), 1e-3);
  });
}

/// Optical depth of k(x) on n, 2n, 4n cells: every filter's line integral is of order 2.
void profile(VerifyContext& v, const std::string& name, const std::function<double(double)>& k, double depth) {
  v.for_each_filter("2 " + name + " profile, order in cells, double", [&](const EncodingCase& c) {
    std::vector<double> errors;
    for (const int n : {16, 32, 64}) {
      const AmrHierarchy h =
          MeshBuilder({n, 4, 4}, {}, Vec3d(0), {1, 4.0 / n, 4.0 / n}).root([&](const Vec3d& p) { return k(p.x); }).hierarchy();
      Scene s = small_scene(Mode::dvr, orthographic(h.domain_upper() * Vec3d(0.5, 0.4, 0.6), {1, 0, 0}, 0.5 / n),
                            Sampling::adaptive, 2);
      s.transfer_function = constant_light(0);
      s.transfer_function.extinction = {{0, 0}, {10, 10}};
      s.settings.step = 0.25;
      const Picture p = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
      errors.push_back(std::abs(p.pixel(1, 1)[3] + std::expm1(-depth)));
    }
    return all_of(std::array{near(observed_order(errors), 2, 0.25), at_most(errors[0], 0.01)});
  });
}

void profiles(VerifyContext& v) {
  // integral of 4 exp(-3 x) over [0, 1]
  profile(
      v, "exponential", [](double x) { return 4 * std::exp(-3 * x); }, 4 * (1 - std::exp(-3.0)) / 3);
  // integral of 8 exp(-(x - 0.45)^2 / (2 0.15^2)) over [0, 1]
  const double w = 0.15 * std::numbers::sqrt2;
  profile(
      v, "Gaussian", [](double x) { return 8 * std::exp(-(x - 0.45) * (x - 0.45) / (2 * 0.15 * 0.15)); },
      8 * w * std::sqrt(std::numbers::pi) / 2 * (std::erf(0.55 / w) + std::erf(0.45 / w)));
}

// ---- values ----

void constants(VerifyContext& v) {
  const double value = 0.7;
  std::vector<AmrHierarchy> meshes;
  meshes.push_back(nested(constant(value), {4, 2}).hierarchy());
  meshes.push_back(jump_of_two(constant(value)).hierarchy());
  meshes.push_back(holes_and_missing(constant(value)).hierarchy());
  const auto worst_ulps = [&](const AmrHierarchy& h, std::span<const ProbeResult> got, std::span<const FinestPosition> at,
                              double exact, double ulp) {
    double worst = 0;
    for (std::size_t i = 0; i < at.size(); ++i) {
      const auto leaf = h.find_leaf(at[i].cell);
      const bool has = leaf && std::isfinite(h.value(*leaf, 0));
      if (got[i].found != has) return kInf;
      if (has) worst = std::max(worst, std::abs(got[i].value - exact) / ulp);
    }
    return worst;
  };
  v.for_each("9 constants are kept, ulps of double", v.variants(), [&](const EncodingCase& c) {
    double worst = 0;
    for (const AmrHierarchy& h : meshes) {
      const auto at = probe_positions(h, 20);
      const auto got = probe_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), Precision::double_precision, at);
      worst = std::max(worst, worst_ulps(h, got, at, value, 0x1p-53));
    }
    return at_most(worst, 2);
  });
  v.for_each_filter("9 constants are kept, ulps of float, GL", [&](const EncodingCase& c) {
    const AmrHierarchy& h = meshes.back();
    const auto at = probe_positions(h, 20);
    const EncodedField field = v.build(h, c);
    const auto got = probe_on_gl(v.gl(), h, Structure(v.gl(), field), at);
    return at_most(worst_ulps(h, got, at, static_cast<double>(static_cast<float>(value)), 0x1p-24), 2);
  });
}

/// Smallest and largest leaf that any filter may see from p: within two cells of level 0.
ValueRange contributing(const AmrHierarchy& h, std::span<const LeafCell> leaves, const FinestPosition& p) {
  const int reach = 2 * h.cell_width(0);
  const Box near_by{p.cell - Vec3i(reach), p.cell + Vec3i(reach + 1)};
  ValueRange range;
  for (const LeafCell& leaf : leaves) {
    const int w = h.cell_width(leaf.level);
    if (overlap(near_by, {leaf.cell * w, (leaf.cell + Vec3i(1)) * w}) && std::isfinite(h.value(leaf, 0)))
      range.add(h.value(leaf, 0));
  }
  return range;
}

void bounds(VerifyContext& v) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const auto at = probe_positions(h, v.size<std::size_t>(10, 100));
  std::mt19937_64 random(1);
  const auto leaves = some_leaves(h, std::size_t{1} << 30, random);
  std::vector<ValueRange> ranges;
  for (const FinestPosition& p : at) ranges.push_back(contributing(h, leaves, p));
  v.for_each("9 values stay within their cells'", v.variants(), [&](const EncodingCase& c) {
    const auto got = probe_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), Precision::double_precision, at);
    double out = 0;
    for (std::size_t i = 0; i < at.size(); ++i)
      if (got[i].found) out = std::max({out, ranges[i].min - got[i].value, got[i].value - ranges[i].max});
    return at_most(out, 1e-15);
  });
}

/// Largest jump of f over faces, edges and corners of leaves, at a distance of 2^-20 finest cells to either side.
double largest_jump(const AmrHierarchy& h, const EncodedField& field) {
  constexpr double kDelta = 0x1p-20;
  std::vector<FinestPosition> below, above;
  const Box domain = h.domain(h.finest_level());
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const LeafCell& leaf : some_leaves(h, 150, random)) {
    const int w = h.cell_width(leaf.level);
    for (int across = 1; across < 8; ++across) {  // bit a: through the lower face along axis a
      FinestPosition high{leaf.cell * w, Vec3d(kDelta)};
      FinestPosition low = high;
      for (int a = 0; a < 3; ++a) {
        if ((across >> a & 1) != 0) {
          low.cell[a] -= 1;
          low.fraction[a] = 1 - kDelta;
          continue;
        }
        low.cell[a] = high.cell[a] += static_cast<int>(unit(random) * w);
        low.fraction[a] = high.fraction[a] = unit(random);
      }
      if (!domain.contains(low.cell)) continue;
      below.push_back(low);
      above.push_back(high);
    }
  }
  const auto a = probe_on_cpu(h, field, Precision::double_precision, below);
  const auto b = probe_on_cpu(h, field, Precision::double_precision, above);
  double jump = a.empty() ? kInf : 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (a[i].found && b[i].found) jump = std::max(jump, std::abs(a[i].value - b[i].value));
  return jump;
}

void continuity(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();  // a corner where levels 0, 1 and 2 meet
  // range times at most 3 axes times two sides of a finest cell: Lipschitz times distance
  const double bound = 8 * value_range(h) * 0x1p-19;
  const auto is_continuous = [&](const EncodingCase& c) {
    return v.build(h, c, {.storage = Storage::r64f}).definition.continuous_everywhere();
  };
  v.for_each("10 continuous across faces, edges and corners", v.variants(), [&](const EncodingCase& c) -> Verdict {
    if (!is_continuous(c)) return NotAsked{"the filter jumps by its definition"};
    return at_most(largest_jump(h, v.build(h, c, {.storage = Storage::r64f})), bound);
  });
  v.for_each_filter("10 control: filters that jump", [&](const EncodingCase& c) -> Verdict {
    if (is_continuous(c)) return NotAsked{"continuous by its definition"};
    return above(largest_jump(h, v.build(h, c, {.storage = Storage::r64f})), 1e-3);
  });
}

}  // namespace

void analytic_suite(VerifyContext& v) {
  constant_medium(v);
  anisotropic_medium(v);
  linear_medium(v);
  linear_field(v);
  slab_stack(v);
  profiles(v);
  constants(v);
  bounds(v);
  continuity(v);
}

}  // namespace amrtex::verify
