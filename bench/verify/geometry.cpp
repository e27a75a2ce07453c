// Rays from anywhere in any direction: the line integral of 1 is the chord of the domain's box.
#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

struct NamedView {
  std::string name;
  View view;
  double tolerance = 1e-6;  ///< of the longest edge: what the eye's own coordinates cost, in double
};

View with_up(View view, const Vec3d& up) {
  view.up = up;
  return view;
}

/// One orthographic ray, through the middle of a picture of one pixel (or of an odd number along an edge).
View along(const Vec3d& through, const Vec3d& direction, double height) { return orthographic(through, direction, height); }

View far_away(const Vec3d& direction, double domains) {
  View view = perspective(Vec3d(0.5) - direction * domains, Vec3d(0.5));
  view.fov_y = glm::degrees(2 * std::atan(0.9 / domains / glm::length(direction)));
  return view;
}

/// The domain is the unit cube, its cells on levels 1/8 and 1/16 wide; pictures are 4 x 4.
std::vector<NamedView> views() {
  const Vec3d middle(0.5);
  std::vector<NamedView> all;
  const auto add = [&](const std::string& name, const View& view, double tolerance = 1e-6) {
    all.push_back({name, view, tolerance});
  };
  add("eye inside", perspective({0.41, 0.52, 0.33}, {0.9, 0.2, 0.6}));
  add("eye on a face", perspective({0, 0.5, 0.5}, {1, 0.6, 0.4}));
  add("eye on a face, along it", perspective({0, 0.5, 0.5}, {0, 1, 0.5}));
  add("eye on a corner", perspective({1, 1, 1}, {0, 0.1, 0.2}));
  add("eye on a corner, looking out", perspective({1, 1, 1}, {2, 2, 2.5}));
  add("eye on a cell's corner", perspective({0.5, 0.25, 0.75}, {1, 0.25, 0.75}));
  add("eye far away, 10 domains", far_away({1, 0.4, 0.3}, 10));
  add("eye far away, 1e6 domains", far_away({1, 0.4, 0.3}, 1e6));
  add("eye far away, 1e6 domains, along an axis", far_away({0, 1, 0}, 1e6));
  View parallel = along(middle, {1, 0.4, 0.3}, 1.4);
  parallel.eye = parallel.at - Vec3d(1, 0.4, 0.3) * 1e6;
  add("orthographic, 1e6 domains away", parallel);
  View inside = along(middle, {1, 0.4, 0.3}, 1);
  inside.eye = inside.at;
  inside.at += Vec3d(1, 0.4, 0.3);
  add("orthographic, eye inside", inside);
  for (int a = 0; a < 3; ++a)
    for (const double sign : {1.0, -1.0}) {
      Vec3d direction(0.0);  // zero components
      direction[a] = sign;
      add(fmt::format("along {}{}", sign > 0 ? "+" : "-", "xyz"[a]), along(middle, direction, 1));
      for (int b = 0; b < 3; ++b)
        if (b != a) direction[b] = -0.0;
      add(fmt::format("along {}{}, others -0", sign > 0 ? "+" : "-", "xyz"[a]), along(middle, direction, 1));
    }
  // 4 pixels of 1/4: rays at 0, 1/4, ... or 1/4, ... 1: in the domain's first and last faces and in those of cells
  add("in the domain's first faces, in cells' edges", along({0.5, 0.375, 0.375}, {1, 0, 0}, 1));
  add("in the domain's last faces, in cells' edges", along({0.5, 0.625, 0.625}, {-1, 0, 0}, 1));
  add("in faces from above", along({0.375, 0.625, 0.5}, {0, 0, -1}, 1));
  add("in faces along y", along({0.625, 0.5, 0.375}, {0, 1, 0}, 1));
  // pictures so small that all their rays are one
  add("through edges", along({0.5, 0.5, 0.4}, {1, 1, 0}, 1e-300));
  add("through edges, backwards", along({0.4, 0.5, 0.5}, {0, -1, 1}, 1e-300));
  add("through corners", along(middle, {1, 1, 1}, 1e-300));
  add("through corners, downwards", along(middle, {-1, 1, -1}, 1e-300));
  // pictures so small that all rays graze alike
  add("grazing an edge of the domain, inside", along({1 - 1e-4, 1 - 1e-4, 0.5}, {1, -1, 0}, 1e-6));
  add("grazing an edge of the domain, outside", along({1 + 1e-4, 1 + 1e-4, 0.5}, {1, -1, 0}, 1e-6));
  add("just inside of a face", along({0.5, 1e-5, 0.5}, {1, 0, 0}, 1e-7));
  add("just outside of a face", along({0.5, -1e-5, 0.5}, {1, 0, 0}, 1e-7));
  add("almost in a face, 1e-6 a length", along({0.5, 0.5, 0.5}, {1, 1e-6, 0}, 1e-9));
  add("almost along an axis, 1e-20", along({0.5, 0.43, 0.61}, {1, 1e-20, -1e-20}, 0.1));
  add("almost along an axis, 1e-40", along({0.5, 0.43, 0.61}, {1, 1e-40, -1e-40}, 0.1));
  add("almost along an axis, 1e-300", along({0.5, 0.43, 0.61}, {-1e-300, 1, 1e-300}, 0.1));
  add("field of view of 170 degrees", [] {
    View v = perspective({0.5, 0.5, -0.2}, {0.5, 0.5, 1});
    v.fov_y = 170;
    return with_up(v, {0, 1, 0});
  }());
  return all;
}

constexpr int kPixels = 4;

Scene scene_of(const View& view, Sampling sampling, double step) {
  Scene s = small_scene(Mode::projection, view, sampling, kPixels);
  s.settings.step = step;
  return s;
}

Picture chords(const Scene& scene, const AmrHierarchy& h) {
  Picture p(kPixels, kPixels, 1);
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x) *p.pixel(x, y) = chord(scene, x, y, h.domain_lower(), h.domain_upper());
  return p;
}

void check_chords(VerifyContext& v) {
  const AmrHierarchy ones = nested(constant(1)).hierarchy();
  const AmrHierarchy h = MeshBuilder(Vec3i(8), {2}).root(constant(1)).patch(1, {{4, 4, 4}, {10, 8, 12}}, constant(1)).hierarchy();
  const std::vector<NamedView> all = views();
  for (const auto& [mesh, mesh_name] : {std::pair{&h, "2 levels"}, std::pair{&ones, "3 levels, no cubes"}}) {
    if (mesh == &ones && !v.full()) continue;
    for (const NamedView& view : all)
      v.for_each_filter(fmt::format("14 segments sum to the chord: {}, {}, CPU", view.name, mesh_name),
                        [&, m = mesh](const EncodingCase& c) {
                          const EncodedField doubles = v.build(*m, c, {.storage = Storage::r64f, .value_ranges = false});
                          const EncodedField floats = v.build(*m, c, {.value_ranges = false});
                          double worst = 0;
                          for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
                            const Scene s = scene_of(view.view, sampling, 0.7);
                            const Picture expected = chords(s, *m);
                            worst = std::max(worst, difference(render_on_cpu(*m, doubles, s, true), expected));
                            worst = std::max(worst, difference(render_on_cpu(*m, floats, s, false), expected));
                          }
                          return at_most(worst, view.tolerance);
                        });
  }
  // each draw compiles a shader: the views take turns with the encodings, all of them with --full
  std::size_t turn = 0;
  v.for_each_filter("14 segments sum to the chord, views in turn, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.value_ranges = false});
    Check worst = at_most(0, 4e-6);
    for (int i = 0; i < v.size(4, static_cast<int>(all.size())); ++i) {
      const NamedView& view = all[turn++ % all.size()];
      const Scene s = scene_of(view.view, i % 2 == 0 ? Sampling::adaptive : Sampling::lattice, 0.7);
      const double d = difference(draw(v.gl(), h, field, s), chords(s, h));
      if (!(d <= 4e-6))
        worst = holds(false, "<= 4.00e-06", fmt::format("{}: {}", view.name, format_number(d)));
      else if (worst.pass)
        worst = at_most(std::max(d, std::stod(worst.observed)), 4e-6);
    }
    return worst;
  });
}

/// Where a ray is, and not only how long: the integral of a field that is linear in the cells it passes.
void check_places(VerifyContext& v) {
  const auto f = [](const Vec3d& p) { return 1 + 0.5 * p.x - 0.25 * p.y + 0.125 * p.z; };
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(f).hierarchy();
  const std::vector<NamedView> all = views();
  v.for_each_filter("14 integrals of a linear field against the reference, all views, adaptive, CPU float",
                    [&](const EncodingCase& c) -> Verdict {
                      const EncodedField field = v.build(h, c);
                      const HierarchyReference reference(h, 0, field.definition);
                      Check result = at_most(0, 1e-3);
                      for (const NamedView& view : all) {
                        const Scene s = scene_of(view.view, Sampling::adaptive, 1.0 / 32);
                        // in a face the value of nearest is that of either side
                        if (!interpolates(c.filter) &&
                            (view.name.starts_with("in ") || view.name.starts_with("through") || view.name.starts_with("just") ||
                             view.name.starts_with("almost") || view.name.starts_with("eye on")))
                          continue;
                        const double d = difference(render_on_cpu(h, field, s, false), reference.render(s, 1.0 / 8));
                        if (!(d <= 1e-3)) return holds(false, "<= 0.001", fmt::format("{}: {}", view.name, format_number(d)));
                        result = at_most(std::max(d, std::stod(result.observed)), 1e-3);
                      }
                      return result;
                    });
}

/// Each region once: an axis-parallel ray through n cells takes n samples of one cell each, in as many regions as it meets.
void check_counts(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder({16, 4, 4}, {}, Vec3d(0), {4, 1, 1}).root(waves).hierarchy();
  v.for_each_filter("14 no segment twice, none negative: samples of an axis-parallel ray, GL", [&](const EncodingCase& c) {
    Scene s = small_scene(Mode::projection, orthographic({2, 0.5, 0.5}, {-1, 0, 0}, 0.5), Sampling::adaptive, 4);
    s.settings.step = 1.0 / 3;
    WorkCounts counts;
    draw(v.gl(), h, v.build(h, c), s, &counts);
    return holds(counts.rays == 16 && counts.samples == 16 * 16 * 3, "16 rays of 48 samples",
                 fmt::format("{} rays, {} samples", counts.rays, counts.samples));
  });
}

}  // namespace

void geometry_suite(VerifyContext& v) {
  check_chords(v);
  check_places(v);
  check_counts(v);
  v.once("14 control: a chord without its last part of a step", [] {
    // a step of 0.7 finest cells of 1/16 over a length of 1 leaves 0.6 of a step
    const double step = 0.7 / 16;
    return above(1 - std::floor(1 / step) * step, 1e-6);
  });
}

}  // namespace amrtex::verify
