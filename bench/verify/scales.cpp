// Scales that must not matter: cells of any aspect, values below, beside and above what floats hold, products beyond them, many
// levels; and the integrator `tolerance` where samples see nothing. The double reference in such cases: suite `reference`.
#include <array>
#include <cmath>

#include "bench/verify/pictures.hpp"
#include "bench/verify/thin_cells.hpp"
#include "bench/verify/verify.hpp"
#include "renderers/reference/hierarchy_reference.hpp"

namespace amrtex::verify {
namespace {

/// Largest difference of a channel to `exact(x, y)`, in parts of it.
template <class Exact>
double relative_error(const Picture& picture, int channel, Exact&& exact) {
  double largest = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double off = std::abs(picture.pixel(x, y)[channel] / exact(x, y) - 1);
      largest = std::max(largest, std::isnan(off) ? kInf : off);
    }
  return largest;
}

Picture on_cpu(VerifyContext& v, const AmrHierarchy& h, const EncodingCase& c, const Scene& scene) {
  return render_on_cpu(h, v.build(h, c), scene, false);
}

void thin_cells(VerifyContext& v) {
  for (const double aspect : {1e2, 1e4, 1e6}) {
    const AmrHierarchy h = thin_mesh(aspect);
    const Scene scene = thin_scene(aspect, Sampling::lattice);
    v.for_each_filter(fmt::format("19 cells {:.0e} times as wide as high: thickness", aspect),
                      [&](const EncodingCase& c) { return at_most(thin_error(on_cpu(v, h, c, scene), scene, h), 1e-5); });
  }
}

/// Rays along y through f = offset + scale * 3/4, of an extinction from 0 to 4 over the field's range.
Scene half_way_scene(double offset, double scale) {
  Scene scene = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {0, 1, 0}, 0.4), Sampling::lattice, 4);
  scene.transfer_function.extinction = {{offset, 0}, {offset + scale, 4}};
  scene.transfer_function.color = {{offset, Vec3d(1)}};
  scene.settings.step = 0.5;
  return scene;
}

AmrHierarchy two_values(double offset, double scale) {
  // the lower layer holds the range's other end, and no ray meets it
  return MeshBuilder(Vec3i(8)).root([=](const Vec3d& p) { return offset + scale * (p.z < 0.125 ? 0 : 0.75); }).hierarchy();
}

/// Opacity 1 - exp(-3): three quarters of the curve over a length of 1.
void values(VerifyContext& v) {
  struct Values {
    const char* name;
    double offset, scale;
  };
  constexpr std::array kValues{Values{"1e-40", 0, 1e-40}, Values{"1e-300", 0, 1e-300}, Values{"1e300", 0, 1e300},
                               Values{"1e8 and thousandths", 1e8, 1e-3}};
  const auto exact = [](int, int) { return -std::expm1(-3.0); };
  for (const Values& w : kValues) {
    const AmrHierarchy h = two_values(w.offset, w.scale);
    const Scene scene = half_way_scene(w.offset, w.scale);
    v.for_each_filter(fmt::format("21 values of {}: opacity", w.name), [&](const EncodingCase& c) {
      return at_most(relative_error(on_cpu(v, h, c, scene), 3, exact), 2e-4);  // 1e8 in doubles: 1.5e-5 of the range
    });
    if (w.scale > 1) continue;
    v.once(fmt::format("21 control: values of {} as plain floats", w.name), [&] {
      const EncodedField plain = as_plain_floats(v.build(h, v.filters().front()));
      return above(relative_error(render_on_cpu(h, plain, scene, false), 3, exact), 0.1);
    });
  }
}

/// A value times a length that no float holds.
void products(VerifyContext& v) {
  for (const auto& [value, edge] : {std::pair(1e30, 1e10), std::pair(2.0, 1e-38), std::pair(1e-30, 1e-20)}) {
    const AmrHierarchy h = MeshBuilder(Vec3i(4), {}, Vec3d(0), Vec3d(edge)).root(constant(value)).hierarchy();
    Scene scene = small_scene(Mode::projection, {}, Sampling::adaptive, 4);
    scene.view.at = Vec3d(0.5 * edge);
    scene.view.eye = scene.view.at - Vec3d(0, 3 * edge, 0);
    scene.view.up = {0, 0, 1};
    scene.view.orthographic = true;
    scene.view.height = 0.5 * edge;
    const double exact = value * edge;
    v.for_each_filter(fmt::format("19 projection of {:.0e} over {:.0e}", value, edge), [&](const EncodingCase& c) {
      return at_most(relative_error(on_cpu(v, h, c, scene), 0, [&](int, int) { return exact; }), 2e-6);
    });
  }
}

/// Twenty levels around a point cost what they hold.
void deep_corners(VerifyContext& v) {
  constexpr std::int64_t kMostBytes = std::int64_t{50} << 20;
  const AmrHierarchy h = deep_corner(20);
  v.for_each_filter("19 twenty levels, 1128 leaf cells: bytes of the structure and of its build", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    return at_most(static_cast<double>(std::max(field.memory().total(), field.host_peak_bytes)), kMostBytes);
  });
}

/// One cell of 5^3 is hot, and its light lies between samples.
void hot_cell(VerifyContext& v) {
  constexpr double kTolerance = 1e-3;
  const auto f = [](const Vec3d& p) { return Vec3i(p * 5.0) == Vec3i(2, 3, 1) ? 0.95 : 0.05; };
  const AmrHierarchy h = MeshBuilder(Vec3i(5)).root(f).hierarchy();
  Scene scene = small_scene(Mode::dvr, perspective({2.3, 1.9, 2.1}, Vec3d(0.5)), Sampling::adaptive, 20);
  scene.transfer_function.extinction = {{0.1, 0}, {0.5, 10}, {0.9, 40}};
  scene.transfer_function.color = {{0, {0, 0, 0.3}}, {0.5, {0.9, 0.9, 0.1}}, {1, {0.8, 0, 0}}};
  scene.settings.tolerance = kTolerance;
  const auto largest_error = [&](const EncodingCase& c, const Scene& drawn) {
    const EncodedField field = v.build(h, c);
    const Picture reference = HierarchyReference(h, 0, field.definition).render(scene);
    const Picture picture = render_on_cpu(h, field, drawn, false);
    double largest = 0;
    for (std::size_t i = 0; i < picture.values.size(); ++i)
      largest = std::max(largest, std::abs(picture.values[i] - reference.values[i]));
    return largest;
  };
  v.for_each_filter("6 one hot cell, integrator tolerance", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{"a filter that jumps is exact in each cell"};
    Scene asked = scene;
    asked.settings.integrator = Integrator::tolerance;
    return at_most(largest_error(c, asked), 1.6 * kTolerance);
  });
  v.for_each_filter("6 control: one hot cell, intervals of four cells judged by their middles",
                    [&](const EncodingCase& c) -> Verdict {
                      if (!interpolates(c.filter)) return NotAsked{"a filter that jumps is exact in each cell"};
                      Scene coarse = scene;
                      coarse.settings.sampling = Sampling::lattice;
                      coarse.settings.step = 4;
                      return above(largest_error(c, coarse), 10 * kTolerance);
                    });
}

}  // namespace

void scales_suite(VerifyContext& v) {
  thin_cells(v);
  values(v);
  products(v);
  deep_corners(v);
  hot_cell(v);
}

}  // namespace amrtex::verify
