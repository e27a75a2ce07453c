// Deep, steep, large and small meshes; values of any size and none; very many steps.
#include <limits>

#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex::verify {
namespace {

constexpr double kFloatMax = std::numeric_limits<float>::max();

/// A value in [0, 1) for each place, unlike its neighbours' on every level.
double noise(const Vec3d& p) {
  const double s = std::sin(p.x * 127.1 + p.y * 311.7 + p.z * 74.7) * 43758.5453;
  return s - std::floor(s);
}

/// `levels` levels of ratio 2: on each the 2 x 2 x 2 cells around a point of the face x = 1/2 (on its left side) are
/// refined, so leaves of the finest level touch those of level 0 across the face. Values are noise of the cell's index.
AmrHierarchy deep_mesh(int levels) {
  MeshBuilder mesh({4, 2, 2}, std::vector<int>(static_cast<std::size_t>(levels - 1), 2), Vec3d(0), {2, 1, 1});
  // cells of their own value: a function of the index, not of the place, which a double cannot tell apart at depth
  const auto values = [](int level, const Box& box) {
    std::vector<double> v;
    for_each_cell(box, [&](const Vec3i& c) {
      const Vec3d place(Vec3i(c.x & 63, c.y & 63, c.z & 63));
      v.push_back(noise(place * 0.173 + static_cast<double>(level)));
    });
    return v;
  };
  Box box{Vec3i(0), {4, 2, 2}};
  mesh.patch(0, box, values(0, box));
  Vec3i corner(1, 0, 1);  // the cell that is refined next: its right face lies on x = 1
  for (int level = 1; level < levels; ++level) {
    box = Box{corner, corner + Vec3i(1)}.refined(2);
    mesh.patch(level, box, values(level, box));
    corner = {box.upper.x - 1, level % 3 == 0 ? box.lower.y : box.upper.y - 1, level % 2 == 0 ? box.lower.z : box.upper.z - 1};
  }
  return mesh.hierarchy();
}

/// The last patch of the finest level, in finest cells.
Box deepest(const AmrHierarchy& h) { return h.patches(h.finest_level()).back().box; }

std::vector<FinestPosition> deep_positions(const AmrHierarchy& h) {
  std::vector<FinestPosition> at = probe_positions(h, 16, 11);
  const Box around = intersection(deepest(h).grown(3), h.domain(h.finest_level()));
  for_each_cell(around, [&](const Vec3i& cell) {
    for (const double f : {0.0, 0.25, 0.503, 0.875, kBelowOne}) at.push_back({cell, {f, 1 - f == 1 ? 0.5 : 1 - f, f * f}});
  });
  return at;
}

/// Positions to less than a thousandth of a cell: the same value up to that part of the local difference.
Check same_values(const AmrHierarchy& h, const EncodedField& field, std::span<const FinestPosition> at,
                  std::span<const ProbeResult> got, double cells) {
  const Comparison c = compare(at, reference_values(h, field.definition, at), got, cells * value_range(h));
  return {fmt::format("{} points, <= {} of the range", c.compared, format_number(cells)),
          c.failed == 0 ? fmt::format("worst {}", format_number(c.worst / value_range(h)))
                        : fmt::format("{} differ by {} at most; {}", c.failed, format_number(c.worst), c.first),
          static_cast<bool>(c)};
}

void probe_mesh(VerifyContext& v, const std::string& name, const AmrHierarchy& h, std::span<const FinestPosition> at) {
  v.for_each_filter(name + ", double", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    return same_values(h, field, at, probe_on_cpu(h, field, Precision::double_precision, at), 1e-9);
  });
  v.for_each_filter(name + ", GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    return same_values(h, field, at, probe_on_gl(v.gl(), h, Structure(v.gl(), field), at), 1e-5);
  });
}

// ---- depth ----

/// The deepest cells from outside: rays pass the large cells before they reach those, 8 finest cells high.
Scene deep_scene(const AmrHierarchy& h, const Vec3d& direction, double finest_cells) {
  const Vec3d finest = h.spacing(h.finest_level());
  const Vec3d at = h.domain_lower() + (Vec3d(deepest(h).upper) - Vec3d(0.6, 0.9, 1.1)) * finest;
  Scene s = small_scene(Mode::projection, orthographic(at, direction, finest_cells * finest.x), Sampling::adaptive);
  s.settings.step = 1.0 / 16;
  return s;
}

/// Lines of sight inside of cells, where a shift by a thousandth of a cell changes little: what the last cells before
/// the far large ones add must be right, so the sum counts in finest cells.
void deep_rays(VerifyContext& v, const std::string& name, const AmrHierarchy& h, bool on_gl) {
  const Vec3d finest = h.spacing(h.finest_level());
  v.for_each_filter(name, [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c, {.storage = on_gl ? Storage::r32f : Storage::r64f});
    const HierarchyReference reference(h, 0, field.definition);
    double worst = 0;
    for (const Vec3d& direction : {Vec3d(1, 0, 0), Vec3d(0.3, 1, -0.4)}) {
      Scene s = deep_scene(h, direction, 8);
      // a box of 4 cells around the place, entered from afar: what is drawn is local, the way to it is not
      const Vec3d middle = s.view.at;
      s.region = {middle - 16.0 * finest, middle + 16.0 * finest};
      // an interval over cells' faces has the value of one side: shorter ones where values jump at all of them
      if (!interpolates(c.filter)) s.settings.step = 1.0 / 128;
      const Picture got = on_gl ? draw(v.gl(), h, field, s) : render_on_cpu(h, field, s, true);
      worst = std::max(worst, rms_difference(got, reference.render(s, 1.0 / 32)) / finest.x);
    }
    // 32 cells of values in [0, 1), to a thousandth of a cell each
    return at_most(worst, 0.032);
  });
}

/// A ray through large cells into the deepest one, and the colour of that one alone.
void deep_hits(VerifyContext& v, const std::string& name, const AmrHierarchy& h) {
  // every leaf of the finest level opaque, all else invisible: value 1 there, 0 elsewhere
  const int finest_level = h.finest_level();
  MeshDescription marked;
  marked.name = "marked";
  marked.domain_lower = h.domain_lower();
  marked.domain_upper = h.domain_upper();
  marked.root_cells = h.cells(0);
  for (int l = 0; l < finest_level; ++l) marked.ratios.push_back(h.ratio_to_finer(l));
  marked.fields = {"f"};
  for (int l = 0; l <= finest_level; ++l) {
    marked.levels.emplace_back();
    for (const Patch& p : h.patches(l)) {
      const double value = l == finest_level ? 1 : 0;
      marked.levels.back().push_back({p.box, {CellValues(std::vector<double>(static_cast<std::size_t>(p.box.cells()), value))}});
    }
  }
  const AmrHierarchy mesh(marked);
  const Vec3d finest = mesh.spacing(finest_level);
  v.for_each_filter(name, [&](const EncodingCase& c) -> Verdict {
    if (c.filter != Filter::nearest) return NotAsked{"only nearest holds the value 1 in these cells and 0 beside them"};
    const EncodedField field = v.build(mesh, c);
    const HierarchyReference reference(mesh, 0, field.definition);
    double worst = 0;
    for (const Vec3d& direction : {Vec3d(-1, 0, 0), Vec3d(0.3, 1, -0.4), Vec3d(-0.7, -0.2, 0.6)}) {
      Scene s = deep_scene(mesh, direction, 3);
      s.settings.step = 1.0 / 4096;  // regions may be larger than the cells of value 1; those without any are skipped
      s.settings.skip = true;
      const Picture exact = reference.render(s, 1);
      const Picture gl = draw(v.gl(), mesh, field, s);
      // length inside the 2 x 2 x 2 finest cells, in finest cells
      worst = std::max(worst, difference(gl, exact) / finest.x);
      if (!(largest(exact) > finest.x)) worst = kInf;
    }
    return at_most(worst, 1e-3);
  });
}

void depth(VerifyContext& v) {
  for (const int levels : v.size(std::vector{13, 24}, std::vector{10, 13, 16, 20, 24, 28})) {
    const AmrHierarchy h = deep_mesh(levels);
    const std::string name = fmt::format("19 {} levels, neighbours 1 : {}", levels, 1LL << (levels - 1));
    const auto at = deep_positions(h);
    probe_mesh(v, name + ", values", h, at);
    deep_rays(v, name + ", rays, double", h, false);
    deep_rays(v, name + ", rays, GL", h, true);
    deep_hits(v, name + ", chord of the finest cells from afar, finest cells, GL", h);
  }
}

// ---- shapes ----

void shapes(VerifyContext& v) {
  const auto probe = [&](const std::string& name, const AmrHierarchy& h) {
    probe_mesh(v, "18 " + name, h, probe_positions(h, v.size<std::size_t>(25, 200), 3));
  };
  probe("ratios 2, 4, 8 mixed", MeshBuilder({4, 4, 4}, {2, 4, 8})
                                    .root(waves)
                                    .patch(1, {{2, 2, 2}, {6, 6, 6}}, waves)
                                    .patch(2, {{12, 12, 12}, {16, 20, 16}}, waves)
                                    .patch(3, {{96, 96, 96}, {112, 104, 104}}, waves)
                                    .hierarchy());
  probe("empty levels, a jump of 8",
        MeshBuilder({5, 4, 4}, {2, 2, 2}).root(waves).patch(3, {{8, 8, 8}, {24, 16, 32}}, waves).hierarchy());
  probe("not nested: 8 : 1 in a hole", MeshBuilder({6, 6, 6}, {4, 2})
                                           .patch(0, {{0, 0, 0}, {6, 6, 3}}, waves)
                                           .patch(2, {{8, 8, 32}, {24, 24, 40}}, waves)
                                           .hierarchy());
  probe("level 0 empty", MeshBuilder({6, 6, 6}, {2}).patch(1, {{2, 0, 4}, {8, 12, 12}}, waves).hierarchy());
  probe("anisotropic cells 1 : 1000 : 1e-3",
        MeshBuilder({6, 5, 7}, {2}, Vec3d(0), {1, 1000, 1e-3})
            .root([](const Vec3d& p) { return waves(p * Vec3d(1, 1e-3, 1e3)); })
            .patch(1, {{2, 2, 4}, {8, 6, 10}}, [](const Vec3d& p) { return waves(p * Vec3d(1, 1e-3, 1e3)); })
            .hierarchy());
  probe("one cell", MeshBuilder({1, 1, 1}).root(constant(0.7)).hierarchy());
  probe("a thread of cells", MeshBuilder({300, 1, 1}).root(waves).hierarchy());
  probe("one patch in a large hole", MeshBuilder({40, 40, 40}).patch(0, {{17, 20, 30}, {19, 23, 31}}, waves).hierarchy());
  const int edge = v.size(24, 47);
  MeshBuilder cells(Vec3i(edge), {2});
  for_each_cell({Vec3i(0), Vec3i(edge)}, [&](const Vec3i& c) { cells.patch(0, {c, c + Vec3i(1)}, waves); });
  probe(fmt::format("{} patches of one cell", edge * edge * edge), cells.hierarchy());
}

// ---- scales of space ----

void spaces(VerifyContext& v) {
  struct Scale {
    std::string name;
    Vec3d lower;
    double edge;
  };
  const std::vector<Scale> scales{{"origin at 1e6", Vec3d(1e6, -1e6, 1e6), 1},
                                  {"cells of 1e-30", Vec3d(0), 16e-30},
                                  {"cells of 1e24, origin at -3e25", Vec3d(-3e25), 16e24}};
  const Vec3d eye(1.9, -1.4, 1.2);
  const auto mesh_of = [](const Vec3d& lower, double edge) {
    const auto f = [&](const Vec3d& p) { return waves((p - lower) / edge); };
    return MeshBuilder({8, 8, 8}, {2}, lower, lower + Vec3d(edge)).root(f).patch(1, {{4, 4, 4}, {12, 10, 8}}, f).hierarchy();
  };
  const auto scene_of = [&](const Scale& s, Sampling sampling) {
    Scene scene = small_scene(Mode::dvr, perspective(s.lower + eye * s.edge, s.lower + Vec3d(0.5 * s.edge)), sampling);
    scene.transfer_function = peaks();
    scene.settings.step = 0.5;
    return scene;
  };
  const Scale unit{"", Vec3d(0), 1};
  const AmrHierarchy plain = mesh_of(unit.lower, unit.edge);
  for (const Scale& s : scales) {
    const AmrHierarchy h = mesh_of(s.lower, s.edge);
    v.for_each_filter("19 " + s.name + ": the picture of the unit cube, double", [&](const EncodingCase& c) {
      const Picture expected =
          render_on_cpu(plain, v.build(plain, c, {.storage = Storage::r64f}), scene_of(unit, Sampling::adaptive), true);
      return at_most(
          difference(render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), scene_of(s, Sampling::adaptive), true),
                     expected),
          interpolates(c.filter) ? 1e-6 : 0.05);  // of nearest one sample may take the next cell
    });
    v.for_each_filter("19 " + s.name + ": the picture of the unit cube, GL", [&](const EncodingCase& c) -> Verdict {
      if (!interpolates(c.filter)) return NotAsked{"a ray an ulp away may cut other corners of cells"};
      const Picture expected = draw(v.gl(), plain, v.build(plain, c), scene_of(unit, Sampling::adaptive));
      return at_most(difference(draw(v.gl(), h, v.build(h, c), scene_of(s, Sampling::adaptive)), expected), 1e-4);
    });
    v.once("19 " + s.name + ": points of the world", [&] {
      double worst = 0;
      for (int i = 0; i < 100; ++i) {
        const Vec3d q(noise(Vec3d(i)), noise(Vec3d(i, 1, 2)), noise(Vec3d(3, i, 1)));
        const auto p = finest_position(h, s.lower + q * s.edge);
        if (!p) return holds(false, "inside", "outside");
        worst = std::max(worst, glm::length(Vec3d(p->cell) + p->fraction - q * 16.0));
      }
      return at_most(worst, 1e-3);
    });
  }
}

// ---- values ----

/// The field as GL and the CPU's float return it, against the reference, in parts of the range; or refused.
void value_case(VerifyContext& v, const std::string& name, const Function& f, double tolerance) {
  const AmrHierarchy h = nested(f).hierarchy();
  const auto at = probe_positions(h, 20);
  v.for_each_filter("21 " + name + ", GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    return same_values(h, field, at, probe_on_gl(v.gl(), h, Structure(v.gl(), field), at), tolerance);
  });
}

void values(VerifyContext& v) {
  value_case(
      v, "values up to FLT_MAX", [](const Vec3d& p) { return kFloatMax * waves(p) / 1.2; }, 1e-5);
  value_case(
      v, "values from -FLT_MAX to FLT_MAX", [](const Vec3d& p) { return kFloatMax * std::sin(17 * p.x + 9 * p.y * p.z); }, 1e-5);
  value_case(
      v, "values of 1e300", [](const Vec3d& p) { return 1e300 * waves(p); }, 1e-5);
  value_case(
      v, "values of 1e-30", [](const Vec3d& p) { return 1e-30 * waves(p); }, 1e-5);
  value_case(
      v, "values of 1e-30 to 1e30", [](const Vec3d& p) { return std::pow(10, 60 * p.x - 30); }, 1e-5);
  value_case(
      v, "zeros of both signs", [](const Vec3d& p) { return p.x < 0.5 ? -0.0 : 0.0; }, 0);
  // denormals may become zeros: the range is then wider than their error
  value_case(
      v, "denormals beside 1e-36", [](const Vec3d& p) { return p.x < 0.5 ? 1e-40 : 1e-36 * waves(p); }, 0.02);

  // maxima of large negative values
  for (const double value : {-2.0, -3.2e38, -kFloatMax}) {
    const AmrHierarchy h = nested(constant(value)).hierarchy();
    v.for_each_filter(fmt::format("21 largest of values {:.3g}, GL", value), [&](const EncodingCase& c) {
      const Scene s = small_scene(Mode::mip, orthographic(Vec3d(0.5), {0, 1, 0}, 0.5), Sampling::adaptive, 4);
      const Picture p = draw(v.gl(), h, v.build(h, c), s);
      const double exact = static_cast<double>(static_cast<float>(value));
      return holds(largest(p) == exact && *std::min_element(p.values.begin(), p.values.end()) == exact,
                   fmt::format("{:.9g}", exact), fmt::format("{:.9g}", largest(p)));
    });
  }

  const AmrHierarchy decades = nested([](const Vec3d& p) { return std::pow(10, 60 * p.x - 30); }).hierarchy();
  v.for_each_filter("21 values of 1e-30 to 1e30 over a log axis, GL against double", [&](const EncodingCase& c) {
    Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {0.1, 1, 0.2}, 1.4), Sampling::adaptive);
    s.transfer_function.logarithmic = true;
    s.transfer_function.extinction = {{1e-30, 0}, {1e-10, 3}, {1, 0.5}, {1e30, 8}};
    s.transfer_function.color = {{1e-30, {1, 0, 0}}, {1e-5, {0, 1, 0}}, {1e30, {0, 0, 1}}};
    s.settings.skip = true;
    s.settings.step = 0.5;
    const Picture gl = draw(v.gl(), decades, v.build(decades, c), s);
    const Picture exact = render_on_cpu(decades, v.build(decades, c, {.storage = Storage::r64f}), s, true);
    return holds(difference(gl, exact) <= 2e-3 && largest(exact) > 0.5, "<= 0.002", format_number(difference(gl, exact)));
  });
}

void constant_fields(VerifyContext& v) {
  for (const double value : {0.0, 0.7, -1e30, 3e-30}) {
    const AmrHierarchy h = nested(constant(value)).hierarchy();
    const auto at = probe_positions(h, 4);
    v.for_each_filter(fmt::format("21 constant {}, every storage, CPU float", value), [&](const EncodingCase& c) {
      double worst = 0;
      for (const Storage storage : {Storage::r8, Storage::r16, Storage::r16f, Storage::r32f}) try {
          for (const ProbeResult& r : probe_on_cpu(h, v.build(h, c, {.storage = storage}), Precision::single_precision, at))
            worst = std::max(worst, r.found ? std::abs(r.value - static_cast<double>(static_cast<float>(value))) : kInf);
        } catch (const UnsupportedError&) {  // layouts of one format
        }
      return at_most(worst, 0);
    });
  }
}

/// What has no value is transparent, and is felt no further than two cells of its own level away.
void missing_values(VerifyContext& v) {
  const auto mesh_of = [](double odd) {
    return MeshBuilder({12, 12, 12}, {2})
        .root([=](const Vec3d& p) { return Vec3i(p * 12.0) == Vec3i(4, 5, 6) ? odd : waves(p); })
        .patch(1, {{14, 14, 14}, {20, 20, 20}}, waves)
        .hierarchy();
  };
  const AmrHierarchy plain = mesh_of(0.5);
  for (const auto& [name, odd] : {std::pair{"NaN", kNan}, std::pair{"infinity", kInf}, std::pair{"-infinity", -kInf}}) {
    const AmrHierarchy h = mesh_of(odd);
    std::vector<FinestPosition> far, in;
    for (const FinestPosition& p : probe_positions(h, 200)) {
      const Vec3i cell = p.cell / 2;
      if (cell == Vec3i(4, 5, 6)) in.push_back(p);
      if (!Box{Vec3i(4, 5, 6), Vec3i(5, 6, 7)}.grown(2).contains(cell)) far.push_back(p);
    }
    in.push_back({{8, 10, 12}, Vec3d(0.5)});
    v.for_each_filter(
        fmt::format("21 {} in one cell: none there, the same two cells away, CPU float", name), [&](const EncodingCase& c) {
          const EncodedField field = v.build(h, c);
          const auto expected = values_of(probe_on_cpu(plain, v.build(plain, c), Precision::single_precision, far));
          const Comparison same = compare(far, expected, probe_on_cpu(h, field, Precision::single_precision, far), 0.0);
          std::size_t found = 0;
          for (const ProbeResult& r : probe_on_cpu(h, field, Precision::single_precision, in)) found += r.found ? 1 : 0;
          return holds(same && found == 0, fmt::format("0 of {}, 0 of {}", in.size(), far.size()),
                       fmt::format("{} there, {} changed", found, same.failed));
        });
  }
  const AmrHierarchy none = nested(constant(kNan)).hierarchy();
  for (const Mode mode : {Mode::dvr, Mode::projection, Mode::mip})
    v.for_each_filter(fmt::format("21 nothing but NaN, {}, GL", mode_name(mode)), [&, mode = mode](const EncodingCase& c) {
      Scene s = small_scene(mode, orthographic(Vec3d(0.5), {0.2, 1, 0.3}, 1), Sampling::adaptive, 8);
      s.transfer_function = constant_light(3);
      const Picture p = draw(v.gl(), none, v.build(none, c), s);
      return at_most(difference(p, Picture(8, 8, p.channels)), 0);
    });
}

void bad_scenes(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const auto refused = [&](const std::string& name, const std::function<void(Scene&)>& change) {
    v.for_each("21 refused: " + name, std::span(v.filters()).first(1), [&](const EncodingCase& c) {
      Scene s = small_scene(Mode::dvr, perspective({2, -1.5, 1.2}, Vec3d(0.5)), Sampling::adaptive, 4);
      s.transfer_function = constant_light(3);
      change(s);
      try {
        render_on_cpu(h, verify::build(h, c), s, true);
      } catch (const Error& e) {
        return holds(true, "an error", e.what());
      }
      return holds(false, "an error", "a picture");
    });
  };
  refused("an eye that is NaN", [](Scene& s) { s.view.eye.x = kNan; });
  refused("an eye at infinity", [](Scene& s) { s.view.eye.x = kInf; });
  refused("an eye at its target", [](Scene& s) { s.view.at = s.view.eye; });
  refused("a field of view that is NaN", [](Scene& s) { s.view.fov_y = kNan; });
  refused("a step of 0", [](Scene& s) { s.settings.step = 0; });
  refused("a step that is NaN", [](Scene& s) { s.settings.step = kNan; });
  refused("more steps than 31 bits count", [](Scene& s) {
    s.settings.step = 1e-9;
    s.settings.sampling = Sampling::lattice;
  });
  refused("more steps in a region than floats count", [](Scene& s) { s.settings.step = 1e-8; });
  refused("a box to draw that is NaN", [](Scene& s) { s.region = {Vec3d(kNan), Vec3d(1)}; });
}

// ---- very many steps ----

void long_rays(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root(constant(1)).hierarchy();
  const double steps = v.size(1e5, 1e6);
  const auto scene = [&](Sampling sampling, double count) {
    Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0, 0}, 1), sampling, 1);
    s.transfer_function = constant_light(2);
    s.settings.step = 8 / count;
    return s;
  };
  for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
    v.for_each_filter(fmt::format("19 1e6 steps a ray, {}, CPU float: drift of T", sampling_name(sampling)),
                      [&](const EncodingCase& c) {
                        const Scene s = scene(sampling, 1e6);
                        const Picture p = render_on_cpu(h, v.build(h, c, {.value_ranges = false}), s, false);
                        return at_most(std::abs(1 - p.pixel(0, 0)[3] - std::exp(-2.0)), 1e-5);
                      });
    v.for_each_filter(fmt::format("19 {:.0e} steps a ray, {}, GL: drift of T", steps, sampling_name(sampling)),
                      [&](const EncodingCase& c) {
                        const Scene s = scene(sampling, steps);
                        const Picture p = draw(v.gl(), h, v.build(h, c, {.value_ranges = false}), s);
                        return at_most(std::abs(1 - p.pixel(0, 0)[3] - std::exp(-2.0)), 1e-5);
                      });
  }
  v.once("19 control: a product of 1e6 float transmittances", [] {
    float t = 1;
    const float one = std::exp(-2e-6F);
    for (int i = 0; i < 1000000; ++i) t *= one;
    return above(std::abs(static_cast<double>(t) - std::exp(-2.0)), 1e-4);
  });
}

}  // namespace

void extreme_suite(VerifyContext& v) {
  depth(v);
  shapes(v);
  spaces(v);
  values(v);
  constant_fields(v);
  missing_values(v);
  bad_scenes(v);
  long_rays(v);
}

}  // namespace amrtex::verify
