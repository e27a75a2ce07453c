// Extinction from nothing to infinity, transfer functions with steps and spikes, shells thinner than a cell.
#include "bench/verify/pictures.hpp"
#include "bench/verify/verify.hpp"
#include "renderers/reference/hierarchy_reference.hpp"

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
}

/// The integrators but the default one, and the control: what they make of light that is stiff.
void stiff_integrators(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(constant(1)).hierarchy();
  const auto opacity = [&](const EncodedField& field, Integrator integrator, Sampling sampling, double extinction) {
    Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0, 0}, 0.5), sampling, 2);
    s.settings.integrator = integrator;
    s.transfer_function = constant_light(extinction);
    const Picture p = render_on_cpu(h, field, s, true);
    return integrator == Integrator::euler || sound(p) ? p.pixel(0, 0)[3] : kNan;
  };
  for (const Integrator integrator : {Integrator::left, Integrator::preintegrated, Integrator::tolerance})
    v.for_each_filter(fmt::format("6 extinction times length from 0 to infinity, {}, double", integrator_name(integrator)),
                      [&](const EncodingCase& c) -> Verdict {
                        if (integrator == Integrator::tolerance && !interpolates(c.filter))
                          return NotAsked{"tolerance follows fields that are not constant in cells"};
                        const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
                        double worst = 0;
                        double before = 0;
                        for (const Sampling sampling : {Sampling::adaptive, Sampling::lattice}) {
                          if (integrator == Integrator::tolerance && sampling == Sampling::lattice) continue;
                          before = 0;
                          for (const double k : {0.0, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6, 1e30, kInf}) {
                            const double a = opacity(field, integrator, sampling, k);
                            if (a < before) return holds(false, "monotone", fmt::format("{} after {} at {}", a, before, k));
                            worst = std::isnan(a) ? kInf : std::max(worst, std::abs(a + std::expm1(-k)));
                            before = a;
                          }
                        }
                        return at_most(worst, 1e-12);
                      });
  // (1 - k / 4)^4 for k = 10 in 4 steps: 5.0625; k = 1000: 3.8e9
  v.for_each_filter("6 control: extinction 1000 in 4 steps, euler: transmittance outside of [0, 1]", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f, .value_ranges = false});
    return above(std::abs(1 - opacity(field, Integrator::euler, Sampling::lattice, 1000)), 1);
  });
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
  const auto scene = [](const TransferFunction& tf, Integrator integrator, double step) {
    Scene s = small_scene(Mode::dvr, perspective({2.1, -1.7, 1.3}, Vec3d(0.5)), Sampling::adaptive, 10);
    s.transfer_function = tf;
    s.settings.integrator = integrator;
    s.settings.step = step;
    return s;
  };
  // rms of the picture with small steps: what is left where a step of the curve lies inside an interval
  const std::array<std::pair<Integrator, double>, 3> rules{
      {{Integrator::exponential_midpoint, 0.01}, {Integrator::left, 0.02}, {Integrator::preintegrated, 1e-3}}};
  for (const auto& [name, tf] :
       {std::pair{"step", step_function()}, std::pair{"spike of 0.02 of the range", spike(0.55, 0.02 * range, 400)}})
    for (const auto& [integrator, bound] : rules)
      v.for_each_filter(
          fmt::format("6 {}, {}: sound, and right with steps of 1/128; missed with steps 1, 1/4", name,
                      integrator_name(integrator)),
          [&, tf = tf, integrator = integrator, bound = bound](const EncodingCase& c) {
            const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
            const Picture exact = HierarchyReference(h, 0, field.definition).render(scene(tf, integrator, 1), 1.0 / 64);
            const auto error = [&](double step) {
              const Picture p = render_on_cpu(h, field, scene(tf, integrator, step), true);
              return sound(p) ? rms_difference(p, exact) : kInf;
            };
            // half an interval at each face of a cell has the light of values between both sides: order 1
            const bool jumps = !interpolates(c.filter) && integrator != Integrator::exponential_midpoint;
            const double most = jumps ? 0.03 : bound;
            const double one = error(1), quarter = error(0.25), fine = error(1.0 / 128);
            return holds(fine <= most && std::isfinite(one) && std::isfinite(quarter),
                         fmt::format("rms <= {} at step 1/128", format_number(most)),
                         fmt::format("{}; {}, {} missed", format_number(fine), format_number(one), format_number(quarter)));
          });
}

/// Sixteen intervals through a spike of 0.02 of the values along the ray, between the centres of two cells: f goes from 0 to 1
/// there, and samples at multiples of 1/32 do not see the spike (of vertices, from 1/4 to 3/4: samples see it or not).
void spike_in_sixteen(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(2)).root([](const Vec3d& p) { return p.x < 0.5 ? 0.0 : 1.0; }).hierarchy();
  const auto scene = [](Integrator integrator) {
    Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5, 0.47, 0.52), {1, 0, 0}, 0.1), Sampling::adaptive, 2);
    s.region = {Vec3d(0.25, 0, 0), Vec3d(0.75, 1, 1)};
    // an optical depth of 0.478 along x, an opacity of 0.38
    s.transfer_function = spike(0.5156, 0.02, 95.6);
    s.settings.integrator = integrator;
    s.settings.step = 1.0 / 16;
    return s;
  };
  const auto error = [&](const EncodingCase& c, Integrator integrator) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    const Scene s = scene(integrator);
    return difference(render_on_cpu(h, field, s, true), HierarchyReference(h, 0, field.definition).render(s, 1.0 / 64));
  };
  for (const Integrator integrator : {Integrator::preintegrated, Integrator::tolerance})
    v.for_each_filter(fmt::format("5 spike of 0.02 of the range in 16 intervals, {}: found", integrator_name(integrator)),
                      [&](const EncodingCase& c) -> Verdict {
                        if (!interpolates(c.filter)) return NotAsked{"its values jump over the spike"};
                        return at_most(error(c, integrator), 1e-3);
                      });
  for (const Integrator integrator : {Integrator::exponential_midpoint, Integrator::euler, Integrator::left})
    v.for_each_filter(fmt::format("5 control: spike of 0.02 of the range in 16 intervals, {}: off", integrator_name(integrator)),
                      [&](const EncodingCase& c) -> Verdict {
                        if (!interpolates(c.filter)) return NotAsked{"its values jump over the spike"};
                        return above(error(c, integrator), 0.1);
                      });
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
  const auto fraction = [&](const EncodedField& field, double cells, Integrator integrator, double step) {
    Scene s = small_scene(Mode::dvr, orthographic(middle, {1, 0.2, 0.1}, 0.3), Sampling::lattice, 12);
    const double half = cells * finest / 2;
    s.transfer_function.extinction = {{0.33 - half, 0}, {0.33 - 0.999 * half, 1e5}, {0.33 + 0.999 * half, 1e5}, {0.33 + half, 0}};
    s.transfer_function.color = {{0, {1, 1, 1}}};
    s.settings.step = step;
    s.settings.integrator = integrator;
    const Picture p = render_on_cpu(h, field, s, true);
    int met = 0;
    for (int y = 0; y < 12; ++y)
      for (int x = 0; x < 12; ++x) met += p.pixel(x, y)[3] > 0.5 ? 1 : 0;
    return met / 144.0;
  };
  constexpr const char* kStairs = "its shell is made of whole cells";
  for (const double cells : {2.0, 1.0, 0.5, 0.25}) {
    for (const Integrator integrator : {Integrator::exponential_midpoint, Integrator::left})
      v.for_each_filter(
          fmt::format("20 shell of {} finest cells, {}: met by every ray when step <= {}; fraction met with steps 2, 1", cells,
                      integrator_name(integrator), cells / 2),
          [&](const EncodingCase& c) -> Verdict {
            if (!interpolates(c.filter)) return NotAsked{kStairs};
            const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
            const double bound = fraction(field, cells, integrator, cells / 2);
            return holds(bound == 1, "1",
                         fmt::format("{}; {}, {}", format_number(bound), format_number(fraction(field, cells, integrator, 2)),
                                     format_number(fraction(field, cells, integrator, 1))));
          });
    v.for_each_filter(fmt::format("20 shell of {} finest cells, preintegrated: met by every ray with step 2", cells),
                      [&](const EncodingCase& c) -> Verdict {
                        if (!interpolates(c.filter)) return NotAsked{kStairs};
                        const double met =
                            fraction(v.build(h, c, {.storage = Storage::r64f}), cells, Integrator::preintegrated, 2);
                        return holds(met == 1, "1", format_number(met));
                      });
  }
  v.for_each_filter(
      "20 control: shell of 1/4 finest cell, midpoints with step 2: missed by some rays", [&](const EncodingCase& c) -> Verdict {
        if (!interpolates(c.filter)) return NotAsked{kStairs};
        const double met = fraction(v.build(h, c, {.storage = Storage::r64f}), 0.25, Integrator::exponential_midpoint, 2);
        return holds(met < 1, "< 1", format_number(met));
      });
}

}  // namespace

void stiff_suite(VerifyContext& v) {
  constant_extinction(v);
  stiff_integrators(v);
  steps_and_spikes(v);
  spike_in_sixteen(v);
  opacity_correction(v);
  thin_shells(v);
}

}  // namespace amrtex::verify
