// Extinction from nothing to infinity, transfer functions with steps and spikes, shells thinner than a cell.
#include "bench/verify/pictures.hpp"
#include "bench/verify/verify.hpp"
#include "renderers/hierarchy_reference.hpp"

namespace amrtex::verify {
namespace {

Scene medium(double extinction, Sampling sampling, double step) {
  Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 1.4), sampling, 8);
  s.transfer_function = constant_light(extinction);
  s.settings.step = step;
  return s;
}

/// Is every opacity in [0, 1], and every colour, up to what its sum rounds, too? NaN is not.
bool sound(const Picture& p) {
  for (std::size_t i = 0; i < p.values.size(); ++i)
    if (!(p.values[i] >= 0 && p.values[i] <= (i % 4 == 3 ? 1 : 1 + 1e-6))) return false;
  return true;
}

void constant_extinction(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const double cell = 1.0 / h.cells(h.finest_level()).x;
  // extinction times step, per finest cell
  const std::vector<double> products{0, 1e-6, 1e-3, 1, 10, 1e3, 1e6, 1e30, kInf};
  const auto check = [&](const std::function<Picture(const Scene&)>& render, std::span<const double> which, double bound) {
    double worst = 0;
    Picture before;
    for (const double product : which) {
      const double extinction = product / cell;
      const Scene s = medium(extinction, Sampling::adaptive, 1);
      const Picture p = render(s);
      if (!sound(p)) return holds(false, "0 <= T <= 1, monotone", fmt::format("unsound at {}", product));
      for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x) {
          const double length = chord(s, x, y, Vec3d(0), Vec3d(1));
          const double exact = length > 0 ? -std::expm1(-extinction * length) : 0;
          worst = std::max(worst, std::abs(p.pixel(x, y)[3] - exact));
          if (!before.values.empty() && p.pixel(x, y)[3] < before.pixel(x, y)[3])
            return holds(false, "0 <= T <= 1, monotone", "not monotone");
        }
      before = p;
    }
    return at_most(worst, bound);
  };
  v.for_each_filter("6 extinction times step from 0 to infinity: exact at every step, double", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    return check([&](const Scene& s) { return render_on_cpu(h, field, s, true); }, products, 1e-12);
  });
  v.for_each_filter("6 extinction times step from 0 to infinity, CPU float", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.value_ranges = false});
    return check([&](const Scene& s) { return render_on_cpu(h, field, s, false); }, products, 1e-5);
  });
  v.for_each_filter("6 extinction times step 1e-6, 10, infinity, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.value_ranges = false});
    return check([&](const Scene& s) { return draw(v.gl(), h, field, s); }, v.size(std::vector{1e-6, 10.0, kInf}, products),
                 1e-5);
  });
  v.once("6 control: Euler transmittance of extinction 10 in one step",
         [] { return holds(1 - 10.0 < 0, "outside [0, 1]", "-9"); });
}

TransferFunction step_function() {
  TransferFunction tf;
  tf.extinction = {{0.5, 0}, {0.5000001, 20}};
  tf.color = {{0.4, {1, 0.3, 0}}, {0.7, {0, 0.4, 1}}};
  return tf;
}

/// A spike at `value`, `width` wide in all.
TransferFunction spike(double value, double width, double height) {
  TransferFunction tf;
  tf.extinction = {{value - width / 2, 0}, {value, height}, {value + width / 2, 0}};
  tf.color = {{value, {1, 0.6, 0.2}}};
  return tf;
}

void steps_and_spikes(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const double range = h.statistics(0).max - h.statistics(0).min;
  for (const auto& [name, tf] :
       {std::pair{"step", step_function()}, std::pair{"spike of 0.02 of the range", spike(0.55, 0.02 * range, 400)}})
    v.for_each_filter(fmt::format("6 {}, midpoint: sound, and right with small steps; missed with step 1, 1/4", name),
                      [&, tf = tf](const EncodingCase& c) {
                        const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
                        const auto scene = [&](double step) {
                          Scene s = small_scene(Mode::dvr, perspective({2.1, -1.7, 1.3}, Vec3d(0.5)), Sampling::adaptive, 10);
                          s.transfer_function = tf;
                          s.settings.step = step;
                          return s;
                        };
                        const Picture exact = HierarchyReference(h, 0, field.definition).render(scene(1), 1.0 / 64);
                        const auto error = [&](double step) {
                          const Picture p = render_on_cpu(h, field, scene(step), true);
                          return sound(p) ? rms_difference(p, exact) : kInf;
                        };
                        const double one = error(1);
                        const double quarter = error(0.25);
                        const double fine = error(1.0 / 128);
                        return holds(
                            fine <= 0.01 && std::isfinite(one) && std::isfinite(quarter), "rms <= 0.01 at step 1/128",
                            fmt::format("{}; {}, {} missed", format_number(fine), format_number(one), format_number(quarter)));
                      });
  // To be switched on with the render key `integrator`: it holds a spike with 16 steps a ray.
  v.skip("5 spike of 0.02 of the range, preintegrated: found with step 1", nullptr, "not available in this version");
}

void opacity_correction(VerifyContext& v) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const double length = 1;  // along x: 32 finest cells of 1/32
  const double reference_step = 1.0 / h.cells(h.finest_level()).x;
  v.for_each_filter("7 opacity a of one step, by steps of 1/16 to 16 of it", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.value_ranges = false});
    double worst = 0;
    for (const double opacity : {0.0, 0.25, 0.9, 1 - 0x1p-24, 1.0}) {
      // 1 - (1 - a)^(ds / ds0) = 1 - exp(-k ds) with k = -log(1 - a) / ds0
      const double extinction = -std::log1p(-opacity) / reference_step;
      const double exact = opacity == 0 ? 0 : opacity == 1 ? 1 : -std::expm1(std::log1p(-opacity) * length / reference_step);
      for (const double step : {1.0 / 16, 0.25, 1.0, 4.0, 16.0})
        for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
          Scene s = medium(extinction, sampling, step);
          s.view = orthographic(Vec3d(0.5), {1, 0, 0}, 0.5);
          const Picture p = render_on_cpu(h, field, s, false);
          worst = std::max(worst, sound(p) ? std::abs(p.pixel(3, 4)[3] - exact) : kInf);
        }
    }
    return at_most(worst, 1e-6);
  });
}

/// A shell of f = distance from the middle, `cells` finest cells thick, seen where it is met squarely.
void thin_shells(VerifyContext& v) {
  const int n = 16;
  const Vec3d middle(0.513, 0.487, 0.507);  // off-centre
  const auto f = [&](const Vec3d& p) { return glm::length(p - middle); };
  const AmrHierarchy h = MeshBuilder(Vec3i(n), {2}).root(f).patch(1, {{6, 4, 4}, {16, 28, 28}}, f).hierarchy();
  const double finest = 0.5 / n;
  for (const double cells : {2.0, 1.0, 0.5, 0.25})
    v.for_each_filter(
        fmt::format("20 shell of {} finest cells: met by every ray when step <= {}; fraction met with steps 2, 1", cells,
                    cells / 2),
        [&](const EncodingCase& c) -> std::optional<Check> {
          if (c.filter == Filter::nearest) return std::nullopt;  // its shell is made of cells
          const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
          const auto fraction = [&](double step) {
            Scene s = small_scene(Mode::dvr, orthographic(middle, {1, 0.2, 0.1}, 0.3), Sampling::lattice, 12);
            const double half = cells * finest / 2;
            s.transfer_function.extinction = {
                {0.33 - half, 0}, {0.33 - 0.999 * half, 1e5}, {0.33 + 0.999 * half, 1e5}, {0.33 + half, 0}};
            s.transfer_function.color = {{0, {1, 1, 1}}};
            s.settings.step = step;
            const Picture p = render_on_cpu(h, field, s, true);
            int met = 0;
            for (int y = 0; y < 12; ++y)
              for (int x = 0; x < 12; ++x) met += p.pixel(x, y)[3] > 0.5 ? 1 : 0;
            return met / 144.0;
          };
          const double bound = fraction(cells / 2);
          return holds(bound == 1, "1",
                       fmt::format("{}; {}, {}", format_number(bound), format_number(fraction(2)), format_number(fraction(1))));
        });
}

}  // namespace

void stiff_suite(VerifyContext& v) {
  constant_extinction(v);
  steps_and_spikes(v);
  opacity_correction(v);
  thin_shells(v);
}

}  // namespace amrtex::verify
