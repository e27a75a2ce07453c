// Refined cells drawn in place of what lies below them: what every encoding that has a level of detail must do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <filesystem>
#include <functional>

#include "bench/measure/runner.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/cpu/cpu_field.hpp"
#include "structures/generators/random_mesh.hpp"
#include "tests/gl_probe.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

/// The default case of each encoding that has it and of each of its filters that it has it for.
const std::vector<EncodingCase>& cases() {
  static const std::vector<EncodingCase> all = [] {
    std::vector<EncodingCase> list;
    for (const Encoding* e : all_encodings())
      if (e->level_of_detail().ok)
        for (const Filter filter : e->filters())
          if (const EncodingCase c = default_case(*e, filter); accepted(c, {.level_of_detail = true})) list.push_back(c);
    return list;
  }();
  return all;
}

/// The same with every traversal that the encoding has.
std::vector<EncodingCase> all_cases() {
  std::vector<EncodingCase> list;
  for (const EncodingCase& c : cases())
    for (const EncodingCase& v : variants(*c.encoding, c.filter))
      if (accepted(v, {.level_of_detail = true})) list.push_back(v);
  return list;
}

/// Pixels: no cell is as small, and the square of it is 0 in floats.
constexpr double kNoThreshold = 1e-30;

Scene scene_of(const AmrHierarchy& h, std::optional<double> threshold, std::optional<int> max_level = std::nullopt) {
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  Scene scene;
  scene.view = perspective(middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8), middle);
  scene.transfer_function.extinction = {{0.3, 0}, {0.5, 2}, {1, 20}};
  scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  scene.settings.width = 48;
  scene.settings.height = 40;
  scene.settings.level_of_detail = threshold;
  scene.settings.max_level = max_level;
  return scene;
}

/// The field as a scene's eye sees it.
std::vector<ProbeResult> probe(const AmrHierarchy& h, const EncodedField& field, const Scene& scene,
                               std::span<const FinestPosition> positions, Precision precision = Precision::double_precision,
                               int number = 0) {
  const SceneBindings bindings = bind_scene(h, field, scene);
  const auto cpu = make_cpu_field(field.encoding, precision);
  std::vector<const HostTexture*> textures;
  for (const HostTexture& t : field.textures) textures.push_back(&t);
  for (const HostTexture& t : bindings.buffers) textures.push_back(&t);
  cpu->set(probe_key(field, number), bindings.uniforms, textures);
  std::vector<ProbeResult> results;
  for (const FinestPosition& p : positions) results.push_back(cpu->sample(p.cell, p.fraction, number));
  return results;
}

std::vector<NamedMesh> meshes() {
  std::vector<NamedMesh> list = conformance_meshes();
  for (std::uint64_t seed = 0; seed < 12; ++seed)
    list.push_back({fmt::format("random {}", seed), AmrHierarchy(random_mesh(seed, {.power_of_two_ratios = seed % 2 == 0}))});
  return list;
}

bool takes(const AmrHierarchy& h, const EncodingCase& c) { return accepted(h, c, {.level_of_detail = true}); }

/// The mesh without what is finer than `level`. Throws Error where what is left is no mesh.
AmrHierarchy cut_off(const AmrHierarchy& h, int level) {
  MeshDescription mesh;
  mesh.name = "cut off";
  mesh.domain_lower = h.domain_lower();
  mesh.domain_upper = h.domain_upper();
  mesh.root_cells = h.cells(0);
  mesh.fields = h.fields();
  for (int l = 0; l <= level; ++l) {
    mesh.levels.emplace_back(h.patches(l).begin(), h.patches(l).end());
    if (l < level) mesh.ratios.push_back(h.ratio_to_finer(l));
  }
  return AmrHierarchy(mesh);
}

/// The same place in a mesh whose finest cells are `width` finest cells of this one wide.
FinestPosition coarsened(const FinestPosition& p, int width) {
  const Vec3i cell = p.cell / width;
  return {cell, (Vec3d(p.cell - cell * width) + p.fraction) / static_cast<double>(width)};
}

// ---- nothing is pruned

TEST(LevelOfDetail, AThresholdOfNothingGivesTheBitsOfTheStructureWithoutIt) {
  for (const NamedMesh& mesh : meshes())
    for (const EncodingCase& c : all_cases()) {
      SCOPED_TRACE(c.name() + ", " + mesh.name);
      const AmrHierarchy& h = mesh.hierarchy;
      if (!takes(h, c)) continue;
      const auto positions = probe_positions(h, 6);
      const auto expected = probe_on_cpu(h, build(h, c), Precision::single_precision, positions);
      const EncodedField field = build(h, c, {.level_of_detail = true});
      for (const double threshold : {kNoThreshold, 1e-12}) {
        const Comparison same = compare(positions, values_of(expected),
                                        probe(h, field, scene_of(h, threshold), positions, Precision::single_precision), 0.0);
        EXPECT_TRUE(same) << same;
      }
      const Comparison probed =
          compare(positions, values_of(expected), probe_on_cpu(h, field, Precision::single_precision, positions), 0.0);
      EXPECT_TRUE(probed) << "without a scene: " << probed;
    }
}

TEST(LevelOfDetail, WithoutItNothingOfItIsStored) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const EncodingCase& c : cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField without = build(h, c);
    const EncodedField with = build(h, c, {.level_of_detail = true});
    EXPECT_LT(without.memory().topology + without.memory().duplicated, with.memory().topology + with.memory().duplicated + 1);
    EXPECT_EQ(without.memory().payload, with.memory().payload);
    EXPECT_EQ(without.find("kd_detail"), nullptr);
  }
}

// ---- everything is pruned

TEST(LevelOfDetail, AHugeThresholdDrawsLevelZeroAlone) {
  // closed form under nearest: the level value of the level-0 cell that holds p
  for (const NamedMesh& mesh : meshes()) {
    const AmrHierarchy& h = mesh.hierarchy;
    const std::int64_t domain = std::int64_t{h.cells(0).x} * h.cells(0).y * h.cells(0).z;
    if (h.stored_cells(0) != domain) continue;
    for (const EncodingCase& c : all_cases()) {
      SCOPED_TRACE(c.name() + ", " + mesh.name);
      if (c.filter != Filter::nearest || !takes(h, c)) continue;
      const auto positions = probe_positions(h, 10);
      Values expected;
      for (const FinestPosition& p : positions) {
        const double v = h.level_value(0, p.cell / h.cell_width(0), 0);
        expected.push_back(std::isnan(v) ? std::nullopt : std::optional(v));
      }
      const EncodedField field = build(h, c, {.storage = Storage::r64f, .level_of_detail = true});
      const auto got = probe(h, field, scene_of(h, 1e30), positions);
      const Comparison same = compare(positions, expected, got, 1e-12 * value_range(h));
      EXPECT_TRUE(same) << same;
      EXPECT_TRUE(std::all_of(got.begin(), got.end(), [](const ProbeResult& r) { return !r.found || r.level == 0; }));
    }
  }
}

TEST(LevelOfDetail, AMaximalLevelEqualsTheMeshCutOffThere) {
  std::vector<NamedMesh> list = conformance_meshes();
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    list.push_back({fmt::format("random {}", seed), AmrHierarchy(random_mesh(seed, {.holes = false, .empty_levels = false}))});
  int compared = 0;
  for (const NamedMesh& mesh : list)
    for (int level = 0; level < mesh.hierarchy.level_count(); ++level) {
      const AmrHierarchy& h = mesh.hierarchy;
      std::optional<AmrHierarchy> cut;
      try {
        cut.emplace(cut_off(h, level));
      } catch (const Error&) {
        continue;  // level 0 is no mesh of its own, or a patch that is left ends inside of a coarser cell
      }
      if (cut->has_holes()) continue;  // what lies in a hole has nothing to be drawn in its place
      for (const EncodingCase& c : cases()) {
        SCOPED_TRACE(fmt::format("{}, {}, level {}", c.name(), mesh.name, level));
        // where levels are left out, level values beside such a place are not those of the mesh cut off, and an octree
        // has cells of every level between two
        const bool jumps = mesh.name.starts_with("random") || mesh.name.starts_with("jump");
        if (jumps && (c.filter != Filter::nearest || c.encoding->name() == "octree")) continue;
        if (!takes(h, c)) continue;
        const auto positions = probe_positions(h, 8);
        std::vector<FinestPosition> there;
        for (const FinestPosition& p : positions) there.push_back(coarsened(p, h.cell_width(level)));
        const EncodedField field = build(h, c, {.storage = Storage::r64f, .level_of_detail = true});
        const Comparison same = compare(positions, reference_values(*cut, field.definition, there),
                                        probe(h, field, scene_of(h, std::nullopt, level), positions), 1e-9 * value_range(h));
        EXPECT_TRUE(same) << same;
        ++compared;
      }
    }
  EXPECT_GT(compared, 60);
}

TEST(LevelOfDetail, FurtherFieldsAreThoseOfTheSameLevel) {
  const AmrHierarchy h = nested(waves).also("g", slopes).hierarchy();
  for (const EncodingCase& c : cases()) {
    SCOPED_TRACE(c.name());
    const auto positions = probe_positions(h, 20);
    const EncodedField both = build(h, c, {.more_fields = {1}, .level_of_detail = true});
    const EncodedField alone = build(h, c, {.field = 1, .level_of_detail = true});
    const Scene scene = scene_of(h, std::nullopt, 1);
    const Comparison same = compare(positions, values_of(probe(h, alone, scene, positions)),
                                    probe(h, both, scene, positions, Precision::double_precision, 1), 0.0);
    EXPECT_TRUE(same) << same;
  }
}

// ---- the test itself

/// 2 x 2 x 2 cells, all refined by 4.
AmrHierarchy all_refined(const Vec3d& lower, const Vec3d& upper) {
  return MeshBuilder(Vec3i(2), {4}, lower, upper).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).hierarchy();
}

int level_at(const AmrHierarchy& h, const EncodedField& field, const Scene& scene, const Vec3i& cell) {
  return probe(h, field, scene, std::vector<FinestPosition>{{cell, Vec3d(0.25)}}).front().level;
}

TEST(LevelOfDetail, OrthographicCellsSufficeBelowTheirDiagonalInPixels) {
  // anisotropic: cells of 1 x 0.5 x 2 (level 0); the picture has 40 pixels on a height of 5
  const AmrHierarchy h = all_refined({-1, 3, 0}, {1, 4, 4});
  const double pixels = std::sqrt(1 + 0.25 + 4) * 40 / 5;
  for (const EncodingCase& c : cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField field = build(h, c, {.level_of_detail = true});
    for (const auto& [threshold, level] : {std::pair(pixels * 1.001, 0), std::pair(pixels * 0.999, 1)}) {
      Scene scene = scene_of(h, threshold);
      scene.view = orthographic({0, 3.5, 2}, {1, 2, 3}, 5);
      EXPECT_EQ(level_at(h, field, scene, {1, 6, 3}), level) << threshold;
    }
  }
}

TEST(LevelOfDetail, PerspectiveCellsSufficeByTheirNearestPoint) {
  const AmrHierarchy h = all_refined(Vec3d(0), {2, 1, 4});
  const double diagonal = std::sqrt(1 + 0.25 + 4);  // of a cell of level 0
  for (const EncodingCase& c : cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField field = build(h, c, {.level_of_detail = true});
    Scene scene = scene_of(h, 1);
    scene.view = perspective({-3, -2, -4}, {1, 0.5, 2});
    const double at_distance_1 = 20 / std::tan(glm::radians(scene.view.fov_y) / 2);  // pixels a world unit; half the height is 20
    const double nearest = std::sqrt(9.0 + 4 + 16);                                  // to the corner at the origin
    for (const auto& [factor, level] : {std::pair(1.001, 0), std::pair(0.999, 1)}) {
      scene.settings.level_of_detail = diagonal * at_distance_1 / nearest * factor;
      EXPECT_EQ(level_at(h, field, scene, {0, 0, 0}), level) << factor;
    }
    // the eye in a cell: no finite threshold makes that one coarse
    scene.view = perspective({0.6, 0.3, 0.5}, {1, 0.5, 2});
    scene.settings.level_of_detail = 1e6;
    EXPECT_EQ(level_at(h, field, scene, {0, 0, 0}), 1);
  }
}

// ---- regions

constexpr const char* kRegionProbe = R"(#include "portable_glsl.h"
#include "contract.glsl"
layout(local_size_x = 64) in;
layout(std430) readonly buffer cells_block { ivec4 cells[]; };
layout(std430) writeonly buffer results_block { ivec4 regions[]; };
uniform int u_count;
void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= u_count) return;
  Position p;
  p.cell = cells[i].xyz;
  p.fraction = vec3(0.5);
  Region r;
  bool inside = locate(p, r);
  regions[2 * i] = ivec4(r.lower, inside ? r.level : -1);
  regions[2 * i + 1] = ivec4(r.upper, r.width);
}
)";

struct FoundRegion {
  glm::ivec4 lower_level, upper_width;
};

std::vector<FoundRegion> regions_of(const AmrHierarchy& h, const EncodedField& field, const Scene& scene,
                                    const std::vector<glm::ivec4>& cells) {
  return run_probe<FoundRegion>(context(ContextKind::egl), field, bind_scene(h, field, scene).uniforms, kRegionProbe,
                                cells.size(), {{"cells_block", cells}});
}

TEST(LevelOfDetail, EveryCellLiesInOneDrawnRegion) {
  std::vector<NamedMesh> list = conformance_meshes();
  list.push_back({"not nested", MeshBuilder({16, 8, 8}, {2})
                                    .patch(0, {{0, 0, 0}, {8, 8, 8}}, waves)
                                    .patch(0, {{8, 0, 0}, {16, 8, 8}}, waves)
                                    .patch(1, {{12, 4, 4}, {20, 12, 12}}, waves)
                                    .hierarchy()});
  // each of three bars hides a part of the next: no order of whole subgrids is one of visibility
  list.push_back({"visibility cycle", MeshBuilder({6, 6, 6}, {2})
                                          .root(waves)
                                          .patch(1, {{0, 2, 4}, {8, 4, 6}}, waves)
                                          .patch(1, {{8, 0, 2}, {10, 8, 4}}, waves)
                                          .patch(1, {{4, 4, 4}, {6, 6, 12}}, waves)
                                          .hierarchy()});
  for (const NamedMesh& mesh : list)
    for (const EncodingCase& c : cases()) {
      const AmrHierarchy& h = mesh.hierarchy;
      if (c.filter != Filter::nearest || !takes(h, c)) continue;
      const EncodedField field = build(h, c, {.level_of_detail = true});
      const Box domain = h.domain(h.finest_level());
      std::vector<glm::ivec4> cells;
      for_each_cell(domain, [&](const Vec3i& p) { cells.emplace_back(p, 0); });
      for (const double threshold : {3.0, 8.0, 1e9}) {
        SCOPED_TRACE(fmt::format("{}, {}, {} pixels", c.name(), mesh.name, threshold));
        const auto regions = regions_of(h, field, scene_of(h, threshold), cells);
        std::size_t wrong = 0;
        std::vector<std::int64_t> cells_of(cells.size());  // of the region with this lower cell
        for (std::size_t i = 0; i < cells.size(); ++i) {
          const FoundRegion& r = regions[i];
          const Box box{Vec3i(r.lower_level), Vec3i(r.upper_width)};
          ASSERT_TRUE(box.contains(Vec3i(cells[i])) && domain.contains(box) && box.lower % r.upper_width.w == Vec3i(0));
          // the same region from each of its cells: no two overlap
          const FoundRegion& first = regions[domain.offset(box.lower)];
          wrong += first.lower_level != r.lower_level || first.upper_width != r.upper_width ? 1U : 0U;
          ++cells_of[domain.offset(box.lower)];
          // mesh is where the mesh is
          wrong += (r.lower_level.w >= 0) != h.find_leaf(Vec3i(cells[i])).has_value() && !h.has_missing(0) ? 1U : 0U;
        }
        for (std::size_t i = 0; i < cells.size(); ++i) {
          const Box box{Vec3i(regions[i].lower_level), Vec3i(regions[i].upper_width)};
          if (cells_of[i] > 0) wrong += cells_of[i] != box.cells() ? 1U : 0U;
        }
        EXPECT_EQ(wrong, 0U);
      }
    }
}

// ---- pictures

AmrHierarchy three_levels() {
  return MeshBuilder(Vec3i(12), {2, 2})
      .root(waves)
      .patch(1, {Vec3i(2), Vec3i(22)}, waves)
      .patch(2, {Vec3i(8), Vec3i(40)}, waves)
      .hierarchy();
}

TEST(LevelOfDetail, SkippingChangesNoPicture) {
  const AmrHierarchy h = three_levels();
  for (const EncodingCase& c : cases())
    for (const double threshold : {4.0, 1e9})
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        SCOPED_TRACE(c.name());
        Scene scene = scene_of(h, threshold);
        scene.settings.sampling = sampling;
        const Picture skipped = render_on_cpu(h, build(h, c, {.level_of_detail = true}), scene, false);
        scene.settings.skip = false;
        const Picture whole = render_on_cpu(h, build(h, c, {.value_ranges = false, .level_of_detail = true}), scene, false);
        EXPECT_EQ(skipped.values, whole.values);
        EXPECT_GT(largest(whole), 0);
      }
}

TEST(LevelOfDetail, ErrorFallsWithTheThresholdToNothing) {
  const AmrHierarchy h = three_levels();
  for (const EncodingCase& c : cases()) {
    SCOPED_TRACE(c.name());
    const EncodedField field = build(h, c, {.level_of_detail = true});
    const Picture whole = render_on_cpu(h, field, scene_of(h, std::nullopt), false);
    double before = kInf;
    for (const double threshold : {1000.0, 4.0, 2.5, 0.1}) {
      const double error = rms_difference(render_on_cpu(h, field, scene_of(h, threshold), false), whole);
      EXPECT_LE(error, before) << threshold;
      if (before == kInf) {
        EXPECT_GT(error, 1e-4);
      }
      before = error;
    }
    EXPECT_EQ(before, 0);
  }
}

TEST(LevelOfDetail, TheContextDrawsWhatTheTextComputesWithFewerSamples) {
  const AmrHierarchy h = three_levels();
  Context& gl = context(ContextKind::egl);
  GlPairs(2, [&](const EncodingCase& c) { return takes(h, c); }).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.level_of_detail = true});
    WorkCounts coarse, fine;
    const Scene pruned = scene_of(h, 4.0);
    const Picture picture = draw(gl, h, field, pruned, &coarse);
    // rays are floats here and doubles there. A ray through opposite faces of a region has samples in faces of its cells, which
    // nearest takes on either side
    const double bound = interpolating(c) ? 1e-4 : 3e-3;
    EXPECT_LT(rms_difference(picture, render_on_cpu(h, field, pruned, false)), bound);
    const Picture whole = draw(gl, h, field, scene_of(h, kNoThreshold), &fine);
    EXPECT_LT(coarse.samples, fine.samples);
    EXPECT_EQ(whole.values, draw(gl, h, build(h, c), scene_of(h, std::nullopt)).values) << "off and a threshold of nothing";
  });
}

// ---- records and refusals

TEST(LevelOfDetail, ItsErrorStandsInTheRecord) {
  std::string name = std::filesystem::temp_directory_path() / "amrtex_detail_XXXXXX";
  ASSERT_NE(mkdtemp(name.data()), nullptr);
  const std::filesystem::path folder = name;
  const Experiment experiment = parse_experiment(R"({"name": "detail",
    "datasets": [{"generate": {"field": "blobs", "levels": 3, "root": 16, "patch": 4, "refine": {"criterion": "value", "threshold": 0.2}}}],
    "encodings": [{"name": "kd_tree"}, {"name": "uniform"}], "filters": ["nearest"],
    "render": [{"width": 24, "height": 24, "level_of_detail": [null, 1e-9, 1000]}, {"width": 24, "height": 24, "max_level": 1}],
    "views": [{"eye": [2, -2, 1.5], "at": [0.5, 0.5, 0.5]}],
    "transfer_function": {"extinction": [[0, 0], [1, 20]], "color": [[0, 1, 0.5, 0]]},
    "frames": 1, "warm_up": 0, "reference": {"step": 0.5}})",
                                                 "detail.json");
  RunOptions options;
  options.folder = folder;
  const RunSummary summary = run_experiment(experiment, options);
  EXPECT_EQ(summary.measured, 5);
  EXPECT_EQ(summary.unsupported, 3) << "uniform has no level of detail";
  int seen = 0;
  for (const Json& record : load_records(folder)) {
    if (record.at("status") != "ok") {
      EXPECT_THAT(record.at("reason").get<std::string>(), AllOf(HasSubstr("uniform"), HasSubstr("kd_tree")));
      continue;
    }
    const Json& render = record.at("render");
    const Json& split = record.at("error").at("split");
    if (!render.contains("level_of_detail") && !render.contains("max_level")) {
      EXPECT_TRUE(split.is_null());
      continue;
    }
    ++seen;
    const Json& cause = split.at("level_of_detail");
    if (render.value("level_of_detail", 0.0) == 1e-9) {
      EXPECT_EQ(cause.at("rmse"), 0.0) << "nothing was pruned";
      EXPECT_EQ(cause.at("max"), 0.0);
    } else {
      EXPECT_GT(cause.at("rmse").get<double>(), 0);
      EXPECT_GE(cause.at("max"), cause.at("rmse"));
    }
  }
  EXPECT_EQ(seen, 3);
  std::filesystem::remove_all(folder);
}

std::string refusal(const std::function<void()>& f) {
  try {
    f();
  } catch (const UnsupportedError& e) {
    return fmt::format("unsupported: {}", e.what());
  } catch (const Error& e) {
    return fmt::format("error: {}", e.what());
  }
  return "accepted";
}

TEST(LevelOfDetail, EncodingsWithoutItSayWhyAndNameThoseThatHaveIt) {
  const AmrHierarchy h = nested(waves).hierarchy();
  int without = 0;
  for (const Encoding* e : all_encodings()) {
    if (e->level_of_detail().ok) continue;
    ++without;
    const EncodingCase c = default_case(*e, e->filters().front());
    EXPECT_THAT(refusal([&] { build(h, c, {.level_of_detail = true}); }),
                AllOf(HasSubstr("unsupported: encoding"), HasSubstr(std::string(e->name())),
                      HasSubstr(e->level_of_detail().reason), HasSubstr("octree"), HasSubstr("kd_tree")));
  }
  EXPECT_GT(without, 0);
  EXPECT_THAT(refusal([&] {
                build(h, {&find_encoding("octree"), Filter::nearest, {{"layout", "rgba8"}}},
                      {.storage = Storage::r8, .level_of_detail = true});
              }),
              AllOf(HasSubstr("unsupported: encoding octree"), HasSubstr("layout wide")));
}

TEST(LevelOfDetail, AStructureWithoutItIsNotDrawnWithIt) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, cases().front());
  EXPECT_THAT(refusal([&] { bind_scene(h, field, scene_of(h, 2.0)); }), HasSubstr("built without it"));
}

}  // namespace
}  // namespace amrtex
