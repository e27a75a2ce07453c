// Encodings against the reference, each other, the GL context and what GL was asked for.
#include <unistd.h>

#include <filesystem>
#include <map>

#include "bench/verify/pictures.hpp"
#include "bench/verify/probing.hpp"
#include "bench/verify/verify.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "structures/generators/random_mesh.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/write_mesh.hpp"

namespace amrtex::verify {
namespace {

Check compared(const Comparison& c, const std::string& bound) {
  return {fmt::format("{} points, {}", c.compared, bound),
          c.failed == 0 ? fmt::format("worst {}", format_number(c.worst)) : fmt::format("{} differ; {}", c.failed, c.first),
          static_cast<bool>(c)};
}

struct Mesh {
  std::string name;
  AmrHierarchy hierarchy;
};

std::vector<Mesh> meshes() {
  std::vector<Mesh> all;
  all.push_back({"one anisotropic level", single_level(waves).hierarchy()});
  all.push_back({"ratio 2", nested(waves).hierarchy()});
  all.push_back({"ratios 3 and 2", nested(waves, {3, 2}).hierarchy()});
  all.push_back({"jump of two levels", jump_of_two(waves).hierarchy()});
  all.push_back({"holes and NaN", holes_and_missing(waves).hierarchy()});
  return all;
}

// ---- values ----

void points_in_double(VerifyContext& v) {
  for (const Mesh& m : meshes()) {
    const auto at = probe_positions(m.hierarchy, v.size<std::size_t>(20, 200));
    v.for_each("11 every kind of place, double, " + m.name, v.size(std::span(v.filters()), std::span(v.variants())),
               [&](const EncodingCase& c) {
                 return compared(compare_double(m.hierarchy, v.build(m.hierarchy, c, {.storage = Storage::r64f}), at),
                                 "<= 1e-12 of the range");
               });
  }
}

Comparison on_gl(VerifyContext& v, const AmrHierarchy& h, const EncodedField& field, std::span<const FinestPosition> at) {
  const auto got = probe_on_gl(v.gl(), h, Structure(v.gl(), field), at);
  const bool hardware = field.filtering == Filtering::hardware;
  const bool nearest = field.definition.filter == Filter::nearest;
  Values expected = reference_values(h, field.definition, at);
  if (nearest)  // to the bit
    for (auto& e : expected)
      if (e) e = static_cast<double>(static_cast<float>(*e));
  return compare(at, expected, got, [&](std::size_t i) {
    // the texture's normalised coordinate, or a fixed-point weight of 8 bits on each axis
    const double coordinate = v.gl().info().software ? 0x1p-12 : 3 * 0x1p-8;
    return nearest ? 0 : 1e-6 * value_range(h) + (hardware ? coordinate * local_range(h, got[i].level, at[i]) : 0);
  });
}

void points_on_gl(VerifyContext& v) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const auto at = probe_positions(h, v.size<std::size_t>(40, 300));
  v.for_each("11 every kind of place, GL, manual filter", v.size(std::span(v.filters()), std::span(v.variants())),
             [&](const EncodingCase& c) {
               return compared(on_gl(v, h, v.build(h, c), at),
                               c.filter == Filter::nearest ? "equal to the bit" : "<= 1e-6 of the range");
             });
  v.for_each_filter("11 every kind of place, GL, texture filter", [&](const EncodingCase& c) -> Verdict {
    if (!interpolates(c.filter)) return NotAsked{"no texture filter takes part"};
    return compared(on_gl(v, h, v.build(h, c, {.filtering = Filtering::hardware}), at), "<= 2^-12 of the local range");
  });
  v.for_each_filter("11 control: values two per cent off", [&](const EncodingCase& c) {
    const AmrHierarchy other = holes_and_missing([](const Vec3d& p) { return waves(p) * 1.02; }).hierarchy();
    const EncodedField field = v.build(other, c, {.storage = Storage::r64f});
    const Comparison wrong = compare(at, reference_values(h, field.definition, at),
                                     probe_on_cpu(h, field, Precision::double_precision, at), 1e-6 * value_range(h));
    return holds(wrong.failed > wrong.compared / 2, "more than half of the points differ",
                 fmt::format("{} of {} differ", wrong.failed, wrong.compared));
  });
}

void random_meshes(VerifyContext& v) {
  RandomMeshOptions options;
  options.max_finest_cells = 1 << 15;
  std::vector<Mesh> all;
  for (std::uint64_t seed = 500; seed < 500 + v.size<std::uint64_t>(10, 200); ++seed)
    all.push_back({fmt::format("seed {}", seed), AmrHierarchy(random_mesh(seed, options))});
  v.for_each("11 random meshes, double", v.variants(), [&](const EncodingCase& c) {
    Comparison sum;
    int refused = 0;
    for (const Mesh& m : all) try {
        const EncodedField field = v.build(m.hierarchy, c, {.storage = Storage::r64f});
        const Comparison one = compare_double(m.hierarchy, field, probe_positions(m.hierarchy, 16, 3));
        if (sum.failed == 0 && one.failed > 0) sum.first = m.name + ", " + one.first;
        sum.compared += one.compared;
        sum.failed += one.failed;
        sum.worst = std::max(sum.worst, one.worst / value_range(m.hierarchy));
      } catch (const UnsupportedError& e) {
        v.skip("11 random meshes, double, " + m.name, &c, e.what());
        ++refused;
      }
    return compared(sum, fmt::format("<= 1e-12 of the range, on {} meshes", all.size() - static_cast<std::size_t>(refused)));
  });
}

void ownership(VerifyContext& v) {
  const AmrHierarchy h = nested(waves, {4, 2}).hierarchy();
  std::mt19937_64 random(5);
  const Box domain = h.domain(h.finest_level());
  std::vector<FinestPosition> at;
  Values expected;
  for (const LeafCell& leaf : some_leaves(h, v.size<std::size_t>(60, 600), random)) {
    const Vec3i lower = leaf.cell * h.cell_width(leaf.level);
    // its lower corner, edges and faces are its own
    for (const Vec3d& fraction : {Vec3d(0), Vec3d(0.5, 0, 0), Vec3d(0, 0.5, 0), Vec3d(0.25, 0.75, 0), Vec3d(0, 0.5, 0.5)}) {
      at.push_back({lower, fraction});
      expected.emplace_back(h.value(leaf, 0));
    }
  }
  // the domain's last face belongs to its last cell; beyond it there is nothing
  for (const Vec3d& p : {Vec3d(1), Vec3d(1, 0.3, 0.6), Vec3d(0.3, 1, 0.6), Vec3d(0.3, 0.6, 1), Vec3d(0)}) {
    const auto position = finest_position(h, p);
    at.push_back(position.value());
    expected.emplace_back(h.value(h.find_leaf(position->cell).value(), 0));
  }
  const Vec3i last = domain.upper - Vec3i(1);
  for (const Vec3i& cell : {Vec3i(-1, 0, 0), Vec3i(0, -1, 0), Vec3i(0, 0, -7), last + Vec3i(1, 0, 0), last + Vec3i(0, 0, 1)}) {
    at.push_back({cell, Vec3d(0.5)});
    expected.emplace_back(std::nullopt);
  }
  v.for_each("12 faces belong to one cell, the last face to the last", v.variants(), [&](const EncodingCase& c) -> Verdict {
    if (c.filter != Filter::nearest)
      return NotAsked{"cells show in nearest alone; the leaf under a point is the same for all filters"};
    const EncodedField field = v.build(h, c, {.storage = Storage::r64f});
    return compared(compare(at, expected, probe_on_cpu(h, field, Precision::double_precision, at), 0.0), "exactly");
  });
  v.once("12 one ulp outside of the domain is outside", [&] {
    int outside = 0;
    for (int a = 0; a < 3; ++a)
      for (const double face : {0.0, 1.0}) {
        Vec3d p(0.4);
        p[a] = std::nextafter(face, face == 0 ? -1 : 2);
        outside += finest_position(h, p) ? 0 : 1;
      }
    return holds(outside == 6, "6 of 6", fmt::format("{} of 6", outside));
  });
}

// ---- pictures ----

Scene wave_scene(Mode mode, Sampling sampling = Sampling::lattice) {
  Scene s = small_scene(mode, perspective({2.2, -2, 1.3}, Vec3d(0.5)), sampling);
  s.transfer_function = peaks();
  s.settings.step = 0.7;
  return s;
}

/// `bits`: one order of the arithmetic, whatever the structure. The mean of `basis` runs over bricks, in the structure's order.
Verdict same_picture(const Picture& p, const Picture& first, bool bits) {
  const double d = difference(p, first);
  return holds((bits ? d == 0 : d <= 1e-6) && largest(p) > 0.1, bits ? "equal to the bit" : "<= 1.00e-06", format_number(d));
}

void phase(VerifyContext& v) {
  // one definition of the field: any page size, brick size and order gives one picture
  const AmrHierarchy h = MeshBuilder({9, 8, 11}).root(waves).hierarchy();
  const Scene s = wave_scene(Mode::dvr);
  std::map<Filter, Picture> first;
  v.for_each("15 one picture for any pages, bricks and trees, GL", v.variants(), [&](const EncodingCase& c) {
    const Picture p = draw(v.gl(), h, v.build(h, c), s);
    // on one level these two are one field
    const Filter field = c.filter == Filter::linear_lod ? Filter::linear_page : c.filter;
    return same_picture(p, first.emplace(field, p).first->second, c.filter != Filter::basis);
  });
  v.once("15 control: pictures of different filters", [&] {
    if (first.size() < 2) return holds(false, "two filters", fmt::format("{}", first.size()));
    return above(difference(first.begin()->second, std::next(first.begin())->second), 1e-4);
  });
  // several levels: where definitions do not depend on pages
  const AmrHierarchy levels = holes_and_missing(waves).hierarchy();
  std::map<Filter, Picture> of_levels;
  v.for_each("15 one picture for any pages, bricks and trees, holes and levels, CPU float", v.variants(),
             [&](const EncodingCase& c) -> Verdict {
               if (c.filter == Filter::linear_page)
                 return NotAsked{"on several levels each page size defines a field of its own"};
               const Picture p = render_on_cpu(levels, v.build(levels, c), s, false);
               // vertices of pages that are finer than their leaves are interpolated before they are stored
               const bool bits = c.filter != Filter::linear_vertex && c.filter != Filter::basis;
               return same_picture(p, of_levels.emplace(c.filter, p).first->second, bits);
             });
}

/// Visible between a and b alone.
TransferFunction band(double a, double b) {
  TransferFunction tf;
  const double edge = (b - a) * 1e-3;
  tf.extinction = {{a, 0}, {a + edge, 40}, {b - edge, 40}, {b, 0}};
  tf.color = {{a, {1, 0.2, 0}}, {b, {0, 0.3, 1}}};
  return tf;
}

void skipping(VerifyContext& v) {
  // more than half of it is invisible, in pieces larger than any encoding's
  const auto f = [](const Vec3d& p) { return p.x < 2.2 ? 0.1 : waves(p); };
  const AmrHierarchy h = MeshBuilder({32, 8, 8}, {2}, Vec3d(0), {4, 1, 1})
                             .patch(0, {{0, 0, 0}, {30, 8, 8}}, f)
                             .patch(1, {{40, 4, 4}, {52, 12, 14}}, f)
                             .hierarchy();
  const auto scene = [](Sampling sampling) {
    Scene s = wave_scene(Mode::dvr, sampling);
    s.view = perspective({5.5, -3, 2}, {2, 0.5, 0.5});
    return s;
  };
  v.for_each_filter("16 skipping changes nothing, GL", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    Scene s = scene(Sampling::lattice);
    const Picture without = draw(v.gl(), h, field, s);
    s.settings.skip = true;
    WorkCounts counts;
    const double d = difference(draw(v.gl(), h, field, s, &counts), without);
    return holds(d == 0 && counts.regions_skipped > 0 && largest(without) > 0.1, "equal to the bit, regions skipped",
                 fmt::format("{}, {} of {} skipped", format_number(d), counts.regions_skipped, counts.regions));
  });
  v.for_each_filter("16 early end loses less than it may, CPU float", [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    Scene s = scene(Sampling::lattice);
    const Picture full = render_on_cpu(h, field, s, false);
    s.settings.early_end = 0.6;
    const Picture early = render_on_cpu(h, field, s, false);
    double most = 0;
    for (std::size_t i = 0; i < full.values.size(); ++i)
      most = std::max(most, full.values[i] >= early.values[i] ? full.values[i] - early.values[i] : kInf);
    return holds(most > 0 && most <= 0.4, "> 0, <= 0.4", format_number(most));
  });
  const AmrHierarchy gaps = holes_and_missing(waves).hierarchy();
  v.for_each("17 ranges hold every sample: narrow bands of values, CPU float", v.variants(), [&](const EncodingCase& c) {
    const int bands = v.size(16, 64);
    const EncodedField field = v.build(gaps, c);
    const FieldStatistics& range = gaps.statistics(0);
    double worst = 0;
    double seen = 0;
    for (int i = 0; i < bands; ++i)
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        Scene s = wave_scene(Mode::dvr, sampling);
        s.settings.width = s.settings.height = 12;
        const double width = (range.max - range.min) / bands;
        s.transfer_function = band(range.min + width * i, range.min + width * (i + 1.5));
        const Picture without = render_on_cpu(gaps, field, s, false);
        s.settings.skip = true;
        worst = std::max(worst, difference(render_on_cpu(gaps, field, s, false), without));
        seen = std::max(seen, largest(without));
      }
    return holds(worst == 0 && seen > 0.1, "equal to the bit", format_number(worst));
  });
}

void machines(VerifyContext& v) {
  const AmrHierarchy h = nested(waves).hierarchy();
  // Integrals of a value over the ray: a sample at a quantum's edge may take the next position of the lattice,
  // 2^-12 of a cell away; with nearest that may be another cell, of the range times one step.
  const Scene s = wave_scene(Mode::projection);
  const double step = 0.7 / h.cells(h.finest_level()).x;
  v.for_each_filter("26 GL against the same text in double, a pixel", [&](const EncodingCase& c) {
    const Picture exact = render_on_cpu(h, v.build(h, c, {.storage = Storage::r64f}), s, true);
    const Picture gl = draw(v.gl(), h, v.build(h, c), s);
    return at_most(difference(gl, exact), interpolates(c.filter) ? 1e-4 : 2 * value_range(h) * step);
  });
  v.for_each_filter("26 GL against the reference, a pixel, adaptive, step 1/16", [&](const EncodingCase& c) {
    Scene fine = wave_scene(Mode::projection, Sampling::adaptive);
    fine.settings.step = 1.0 / 16;
    const EncodedField field = v.build(h, c);
    const Picture gl = draw(v.gl(), h, field, fine);
    return at_most(difference(gl, HierarchyReference(h, 0, field.definition).render(fine, 1.0 / 16)), 5e-3);
  });
}

// ---- memory, files ----

void memory(VerifyContext& v) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  v.for_each("28 bytes by role = bytes of textures = bytes asked of GL", v.variants(), [&](const EncodingCase& c) {
    const EncodedField field = v.build(h, c);
    std::int64_t bytes = 0;
    bool roles = true;
    for (const HostTexture& t : field.textures) {
      bytes += t.bytes();
      roles = roles && t.roles.total() == t.bytes() && static_cast<std::int64_t>(t.data.size()) == t.bytes();
    }
    const std::int64_t asked = GpuField(field, v.gl()).bytes();
    return holds(roles && field.memory().total() == bytes && asked == bytes, fmt::format("{} bytes", bytes),
                 fmt::format("{} by role, {} asked of GL", field.memory().total(), asked));
  });
}

/// The formats that `read_mesh` names where it finds none of them.
std::string formats_read() {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / fmt::format("amrtex_verify_no_mesh_{}", getpid());
  std::filesystem::create_directories(folder);
  std::string names;
  try {
    read_mesh(folder);
  } catch (const Error& e) {
    const std::string text = e.what();
    names = text.substr(text.rfind("read: ") + 6);
  }
  std::filesystem::remove_all(folder);
  return names;
}

/// Meshes with all that a plotfile holds, written under a name with this ending and read back.
Check written_and_read(int meshes, const std::string& ending) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / fmt::format("amrtex_verify_{}", getpid());
  fs::create_directories(folder);
  int same = 0;
  RandomMeshOptions options;
  options.power_of_two_ratios = true;
  options.empty_levels = false;
  for (int seed = 0; seed < meshes; ++seed) {
    const AmrHierarchy mesh(random_mesh(static_cast<std::uint64_t>(seed), options));
    const fs::path file = folder / (std::to_string(seed) + ending);
    write_mesh(mesh, file);
    same += AmrHierarchy(read_mesh(file)).content_hash(0) == mesh.content_hash(0) ? 1 : 0;
  }
  fs::remove_all(folder);
  return holds(same == meshes, fmt::format("{} of {} meshes", meshes, meshes), fmt::format("{}", same));
}

void files(VerifyContext& v) {
  for (const auto& [format, ending] : {std::pair("AMReX plotfile", ""), std::pair(".cells", ".cells"), std::pair(".npz", ".npz"),
                                       std::pair("VTKHDF", ".vtkhdf")})
    v.once(fmt::format("27 {}, written and read: one content hash", format),
           [&] { return written_and_read(v.size(6, 60), ending); });
  // formats that nothing here writes: real files, and what other readers found in them, are with each reader's tests
  const std::string readable = formats_read();
  for (const std::string format : {"Chombo", "AMReX-HDF5", "Enzo", "FLASH"}) {
    const bool read = readable.find(format) != std::string::npos;
    v.skip(fmt::format("27 {}, read: the hash of the same mesh from AMReX", format), nullptr,
           read ? "nothing here writes this format; the tests of its reader compare hashes"
                : "no reader of this format; there are those of: " + readable);
  }
}

// ---- slices ----

Picture draw_slices(VerifyContext& v, const AmrHierarchy& h, const EncodedField& field, int slices, SliceTarget target) {
  Scene s = small_scene(Mode::dvr, orthographic(Vec3d(0.5), {1, 0, 0}, 0.9), Sampling::lattice, 8);
  s.transfer_function = constant_light(1);
  s.settings.consumer = ConsumerKind::slices;
  s.settings.slice_target = target;
  s.settings.step = static_cast<double>(h.cells(h.finest_level()).x) / slices;
  const Structure structure(v.gl(), field);
  const auto consumer = make_consumer(v.gl(), h, structure, s);
  consumer->draw();
  return consumer->read();
}

/// n slices of opacity 1 - exp(-1/n) each, blended: 1 - 1/e.
void slices(VerifyContext& v) {
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(constant(1)).hierarchy();
  const auto error = [&](const EncodingCase& c, int count, SliceTarget target) {
    const Picture p = draw_slices(v, h, v.build(h, c, {.draw_boxes = true}), count, target);
    double worst = 0;
    for (int y = 0; y < p.height; ++y)
      for (int x = 0; x < p.width; ++x) worst = std::max(worst, std::abs(p.pixel(x, y)[3] + std::expm1(-1.0)));
    return worst;
  };
  for (const int count : {256, 1024}) {
    // each slice's transmittance is a float near 1: a unit of 2^-24 a slice at most
    v.for_each_filter(fmt::format("22 {} slices, blended in RGBA32F, GL", count), [&](const EncodingCase& c) {
      return at_most(error(c, count, SliceTarget::rgba32f), count == 256 ? 2e-6 : count * 0x1p-24 * std::exp(-1.0) + 1e-6);
    });
    // opacities of 1/256 round to one of 255 steps, those of 1/1024 to none at all
    v.for_each_filter(fmt::format("22 control: {} slices, blended in RGBA8, GL", count), [&](const EncodingCase& c) {
      return above(error(c, count, SliceTarget::rgba8), count == 256 ? 0.03 : 0.3);
    });
  }
  v.once("22 a target of half floats is refused by name", [] {
    try {
      parse_slice_target("rgba16f");
    } catch (const UsageError& e) {
      return holds(true, "refused", e.what());
    }
    return holds(false, "refused", "taken");
  });
}

}  // namespace

void differential_suite(VerifyContext& v) {
  points_in_double(v);
  points_on_gl(v);
  random_meshes(v);
  ownership(v);
  phase(v);
  skipping(v);
  machines(v);
  memory(v);
  files(v);
  slices(v);
}

}  // namespace amrtex::verify
