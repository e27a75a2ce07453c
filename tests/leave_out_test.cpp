// What a scene does not need is absent, what it needs is there, and the picture is the same to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <filesystem>
#include <map>
#include <set>
#include <thread>

#include "bench/measure/left_out_time.hpp"
#include "bench/measure/runner.hpp"
#include "bench/records/record.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/kd_tree/kd_tree_layout.h"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

Scene volume(Sampling sampling = Sampling::lattice, bool skip = true) {
  Scene scene;
  scene.view = perspective({2.3, 1.9, 1.5}, Vec3d(0.5));
  scene.settings.sampling = sampling;
  scene.settings.skip = skip;
  scene.settings.width = scene.settings.height = 32;
  scene.transfer_function.extinction = {{0.05, 0}, {0.8, 10}, {1.4, 40}};
  scene.transfer_function.color = {{0, {0, 0, 0.3}}, {0.6, {0.9, 0.9, 0.9}}, {1.4, {0.8, 0, 0}}};
  return scene;
}

/// Blobs and a shell in a volume of which most is invisible.
const AmrHierarchy& blobs() {
  static const AmrHierarchy h(generate_mesh(Json::parse(R"({"field": "blobs_shell", "levels": 3, "root": 16, "patch": 4})")));
  return h;
}

int define(const EncodedField& field, std::string_view name) {
  for (const auto& [key, value] : field.shader.defines)
    if (key == name) return value;
  return -1;
}

bool has_texture(const EncodedField& field, std::string_view part) {
  return std::any_of(field.textures.begin(), field.textures.end(),
                     [&](const HostTexture& t) { return t.name.find(part) != std::string::npos; });
}

std::int64_t left_out_bytes(const EncodedField& field, std::string_view what) {
  for (const LeftOut& l : field.left_out)
    if (l.what == what) return l.bytes;
  return 0;
}

std::int64_t total(const EncodedField& field) { return field.memory().total(); }

// ---- parts of a structure: absent where the scene does not need them, present where it does

/// A part of one encoding: what its README tells under "What is left out when".
struct PartRow {
  std::string encoding;
  std::string what;             ///< as `left_out` names it
  std::vector<Filter> filters;  ///< under which it may go
  std::string texture;          ///< that holds it; empty: a part of another texture
  std::string define;           ///< 1 with it, 0 without; empty: none
  BuildOptions without, with;
  Json parameters = Json::object();
};

std::vector<PartRow> part_rows() {
  using enum Filter;
  const BuildOptions needed, unskipped{.value_ranges = false}, validity{.validity = true}, border{.border = true},
      detail{.level_of_detail = true};
  const std::vector<Filter> all{all_filters().begin(), all_filters().end()};
  return {
      {"uniform", "validity bits", all, "dense_validity", "AMRTEX_VALIDITY", needed, validity},
      {"uniform", "value ranges", all, "dense_ranges", "AMRTEX_VALUE_RANGES", unskipped, needed},
      {"uniform", "border layer", {linear_page}, "", "AMRTEX_DENSE_BORDER", needed, border},
      {"page_table", "validity bits", all, "page_validity", "AMRTEX_VALIDITY", needed, validity},
      {"page_table", "second channel of the table", all, "", "AMRTEX_VALUE_RANGES", unskipped, needed},
      {"page_table", "border layer", {nearest}, "", "", needed, border},
      {"octree", "validity bits", all, "octree_validity", "AMRTEX_VALIDITY", needed, validity},
      {"octree", "value ranges", {linear_lod}, "octree_ranges", "AMRTEX_VALUE_RANGES", unskipped, needed},
      {"octree", "LOD texture", {nearest}, "tex_octree_lod", "AMRTEX_OCTREE_LOD", needed, detail, {{"traversal", "paper"}}},
      {"octree",
       "gradients",
       {nearest, linear_lod},
       "",
       "AMRTEX_OCTREE_GRADIENTS",
       {.storage = Storage::r8},
       {.storage = Storage::r8, .gradients = true},
       {{"layout", "rgba8"}}},
      {"kd_tree", "validity bits", all, "kd_validity", "AMRTEX_VALIDITY", needed, validity},
      {"kd_tree", "value ranges", all, "", "AMRTEX_VALUE_RANGES", unskipped, needed},
      {"kd_tree", "border layer", {nearest, basis}, "", "", needed, border},
      {"exabricks", "validity bits", all, "exa_validity", "AMRTEX_EXA_MISSING", needed, validity},
      {"exabricks", "value ranges", all, "exa_ranges", "AMRTEX_VALUE_RANGES", unskipped, needed},
      {"exabricks", "border layer", {nearest}, "", "", needed, border},
      {"kd_tree",
       "refined parts of subgrids",
       {nearest, linear_lod, linear_vertex},
       "kd_detail",
       "AMRTEX_LEVEL_OF_DETAIL",
       needed,
       detail},
  };
}

/// Cases of a row's encoding and parameters, one a filter.
std::vector<EncodingCase> cases_of(const PartRow& row) {
  std::vector<EncodingCase> cases;
  const Encoding& encoding = find_encoding(row.encoding);
  for (const Filter filter : encoding.filters()) {
    if (std::find(row.filters.begin(), row.filters.end(), filter) == row.filters.end()) continue;
    EncodingCase c = default_case(encoding, filter);
    c.parameters.update(row.parameters);
    cases.push_back(std::move(c));
  }
  return cases;
}

template <class F>
void for_each_part(F&& f) {
  for (const PartRow& row : part_rows())
    for (const EncodingCase& c : cases_of(row)) {
      SCOPED_TRACE(fmt::format("{}: {}", c.name(), row.what));
      f(row, c);
    }
}

const LeftOut* find_left_out(const EncodedField& field, std::string_view what) {
  const auto it = std::find_if(field.left_out.begin(), field.left_out.end(), [&](const LeftOut& l) { return l.what == what; });
  return it == field.left_out.end() ? nullptr : &*it;
}

TEST(LeaveOut, APartIsAbsentWithoutNeedAndThereWithIt) {
  const AmrHierarchy& h = blobs();
  for_each_part([&](const PartRow& row, const EncodingCase& c) {
    const EncodedField without = build(h, c, row.without);
    const EncodedField with = build(h, c, row.with);
    EXPECT_EQ(find_left_out(with, row.what), nullptr);
    const LeftOut* entry = find_left_out(without, row.what);
    ASSERT_NE(entry, nullptr);
    EXPECT_FALSE(entry->why.empty());
    EXPECT_FALSE(entry->seconds.has_value()) << "nobody has measured them";
    if (!row.define.empty()) {
      EXPECT_EQ(define(without, row.define), 0);
      EXPECT_EQ(define(with, row.define), 1);
    }
    if (!row.texture.empty()) {
      EXPECT_EQ(without.find(row.texture), nullptr);
      EXPECT_NE(with.find(row.texture), nullptr);
    }
    EXPECT_LT(total(without), total(with) + (entry->bytes == 0 ? 1 : 0));
    if (row.with.level_of_detail) return;  // that stores more than this part, and packs anew
    // pools are packed anew with larger bricks: that may waste more or less
    const auto saved = static_cast<double>(total(with) - total(without));
    EXPECT_NEAR(static_cast<double>(entry->bytes), saved, row.define.empty() ? 0.25 * saved : 0.02 * saved + 64);
  });
}

TEST(LeaveOut, APartThatIsNotNeededDoesNotChangeThePicture) {
  const AmrHierarchy& h = blobs();
  Context& gl = context(ContextKind::egl);
  for_each_part([&](const PartRow& row, const EncodingCase& c) {
    const auto picture = [&](const BuildOptions& options) {
      Scene scene = volume(Sampling::lattice, options.value_ranges);       // regions may differ, and with them places of adaptive
      if (options.level_of_detail) scene.settings.level_of_detail = 1e-9;  // no cell is as small
      const EncodedField field = build(h, c, options);
      // on the context once a row: compiling shaders is what this test takes its time for
      if (c.filter != cases_of(row).front().filter) return render_on_cpu(h, field, scene, false);
      const Structure structure(gl, field);  // throws where the shader and what is bound do not agree
      Raycaster raycaster(gl, h, structure, scene);
      EXPECT_THAT(structure.gpu.unused(raycaster.program()), testing::IsEmpty());
      raycaster.draw();
      return raycaster.read();
    };
    const Picture with = picture(row.with);
    EXPECT_GT(largest(with), 0.1);
    EXPECT_EQ(difference(with, picture(row.without)), 0);
  });
}

TEST(LeaveOut, WhatBringsAPartBackIsNamedAndBringsNothingElse) {
  const AmrHierarchy& h = blobs();
  for_each_part([&](const PartRow& row, const EncodingCase& c) {
    const EncodedField without = build(h, c, row.without);
    const LeftOut* entry = find_left_out(without, row.what);
    ASSERT_NE(entry, nullptr);
    const Part part = entry->part;
    if (row.with.level_of_detail) {
      EXPECT_EQ(part, Part::none);  // coarser cells are another picture
      return;
    }
    ASSERT_NE(part, Part::none);
    BuildRequest request = build_request(c, row.without);
    request.needs = with_part(request.needs, part);
    EXPECT_EQ(c.encoding->build(h, request).content_hash(), build(h, c, row.with).content_hash());
  });
}

TEST(LeaveOut, EveryPartThatAnEncodingLeavesOutHasARow) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const std::vector<PartRow> rows = part_rows();
  const auto is_covered = [&](const EncodedField& field, const LeftOut& entry) {
    return std::any_of(rows.begin(), rows.end(),
                       [&](const PartRow& r) { return r.encoding == field.encoding && r.what == entry.what; });
  };
  for_each_case([&](const EncodingCase& c) {
    for (const BuildOptions& options : {BuildOptions{}, BuildOptions{.value_ranges = false}, BuildOptions{.draw_boxes = true}}) {
      if (!accepted(h, c, options)) continue;
      const EncodedField field = build(h, c, options);
      for (const LeftOut& entry : field.left_out) EXPECT_TRUE(is_covered(field, entry)) << entry.what;
    }
  });
}

// ---- seconds of what is left out

/// Takes 30 ms longer with validity bits, and has no border.
class Slow final : public Encoding {
 public:
  std::string_view name() const override { return "slow"; }
  std::span<const Filter> filters() const override { return all_filters(); }
  std::vector<ParameterInfo> parameters() const override { return {}; }
  void check_parameters(const Json&) const override {}
  Support supported(const ContextInfo&) const override { return {}; }
  EncodedField build(const AmrHierarchy&, const BuildRequest& request) const override {
    if (request.needs.keeps_border()) throw UnsupportedError("no border");
    if (request.needs.keeps_validity()) std::this_thread::sleep_for(std::chrono::milliseconds(30));
    EncodedField field;
    field.left_out = {{"bits", "", 1, Part::validity}, {"border", "", 1, Part::border}, {"texture", "", 1}};
    return field;
  }
};

TEST(LeftOutSeconds, AreWhatTheBuildTakesLongerWithThePartAlone) {
  const AmrHierarchy h = single_level(waves).hierarchy();
  const Slow encoding;
  EncodedField field = encoding.build(h, {});
  time_left_out(encoding, h, {}, field);
  ASSERT_TRUE(field.left_out[0].seconds.has_value());
  EXPECT_NEAR(*field.left_out[0].seconds, 0.03, 0.02);
  EXPECT_FALSE(field.left_out[1].seconds.has_value()) << "with it the structure is refused";
  EXPECT_FALSE(field.left_out[2].seconds.has_value()) << "no need brings it";
}

Json run_of(std::string_view keys) {
  Json json = Json::parse(R"({"name": "left_out",
    "datasets": [{"generate": {"field": "blobs_shell", "levels": 2, "root": 16, "patch": 4}}],
    "encodings": [{"name": "octree"}, {"name": "page_table", "page_size": 8}], "filters": ["nearest"],
    "render": [{"width": 16, "height": 16}, {"width": 16, "height": 16, "prune": true}],
    "views": [{"eye": [2, -2, 1.5], "at": [0.5, 0.5, 0.5]}],
    "transfer_function": {"extinction": [[0.2, 0], [1, 20]], "color": [[0, 1, 0.5, 0]]},
    "frames": 1, "warm_up": 0, "reference": null})");
  json.update(Json::parse(keys));
  return json;
}

TEST(LeftOutSeconds, StandInRecordsWhereTheExperimentAsksForThem) {
  const std::filesystem::path folder = "leave_out_test_records";
  for (const bool asked : {false, true}) {
    std::filesystem::remove_all(folder);
    RunOptions options;
    options.folder = folder;
    const Json experiment = run_of(asked ? R"({"explain_left_out": true})" : "{}");
    EXPECT_EQ(run_experiment(parse_experiment(experiment.dump(), "left_out.json"), options).measured, 4);
    std::map<std::pair<std::string, bool>, std::int64_t> bytes;
    for (const Json& record : load_records(folder)) {
      bytes[{record.at("encoding"), record.at("render").at("prune")}] = record.at("memory").at("total_bytes");
      EXPECT_FALSE(record.at("left_out").empty());
      for (const Json& entry : record.at("left_out")) {
        const bool may_come = entry.at("what") != "LOD texture";
        EXPECT_EQ(entry.at("seconds").is_number(), asked && may_come) << entry.dump();
      }
    }
    // renders with and without pruning have a structure each
    EXPECT_LT((bytes[{"octree", true}]), (bytes[{"octree", false}]));
    EXPECT_LT((bytes[{"page_table", true}]), (bytes[{"page_table", false}]));
  }
  std::filesystem::remove_all(folder);
}

TEST(LeaveOut, SecondFieldIsAbsentUnlessItIsFetched) {
  const AmrHierarchy h = nested(waves).also("g", slopes).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const BuildOptions two{.more_fields = {1}};
    if (!accepted(h, c, two)) return;
    const EncodedField one = build(h, c);
    const EncodedField both = build(h, c, two);
    EXPECT_FALSE(has_texture(one, "[1]"));
    EXPECT_TRUE(has_texture(both, "[1]"));
    EXPECT_EQ(define(one, "AMRTEX_FIELDS"), 1);
    EXPECT_EQ(define(both, "AMRTEX_FIELDS"), 2);
  });
}

TEST(LeaveOut, GradientsAreStoredForLitSurfacesAlone) {
  Scene scene = volume();
  EXPECT_FALSE(scene_needs(scene, Filter::nearest, Filtering::manual).gradients);
  scene.settings.mode = Mode::iso;
  scene.settings.isosurfaces.values = {0.5};
  EXPECT_TRUE(scene_needs(scene, Filter::nearest, Filtering::manual).gradients);
  scene.settings.isosurfaces.shading = Shading::none;
  EXPECT_FALSE(scene_needs(scene, Filter::nearest, Filtering::manual).gradients);
  scene.settings.everything = true;
  EXPECT_TRUE(scene_needs(scene, Filter::nearest, Filtering::manual).gradients);
}

TEST(LeaveOut, ScenesWithoutIsovaluesBindNothingOfSurfaces) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodingCase c = default_case(find_encoding("page_table"), Filter::linear_page);
  const EncodedField field = build(h, c);
  const auto surface_inputs = [&](const Scene& scene) {
    int count = 0;
    const SceneBindings bindings = bind_scene(h, field, scene);
    for (const UniformValue& u : bindings.uniforms) count += u.name == "u_isovalues" || u.name == "u_surface_light" ? 1 : 0;
    for (const auto& [name, value] : bindings.defines)
      if (name == "AMRTEX_ISOVALUES") count += 10 * value;
    return count;
  };
  Scene scene = volume();
  EXPECT_EQ(surface_inputs(scene), 0);
  scene.settings.mode = Mode::dvr_iso;
  scene.settings.isosurfaces.values = {0.5};
  EXPECT_EQ(surface_inputs(scene), 12);
}

TEST(LeaveOut, EveryTextureOfAStructureIsReadByItsPicture) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Context& gl = context(ContextKind::egl);
  for_each_filter([&](const EncodingCase& c) {
    for (const bool skip : {true, false}) {
      const EncodedField field = build(h, c, {.value_ranges = skip});
      const Structure structure(gl, field);
      const Raycaster raycaster(gl, h, structure, volume(Sampling::lattice, skip));
      EXPECT_THAT(structure.gpu.unused(raycaster.program()), testing::IsEmpty()) << "skip " << skip;
    }
  });
}

/// What a structure of filter `nearest` with value ranges and no missing cells needs, from its own counts.
std::int64_t bytes_by_formula(const AmrHierarchy& h, const EncodedField& f) {
  const Json& s = f.statistics;
  const auto n = [&](const char* key) { return s.at(key).get<std::int64_t>(); };
  if (f.encoding == "uniform") return h.domain(h.finest_level()).cells() * 4 + n("blocks") * 4;
  if (f.encoding == "page_table") return n("pages") * n("page_texels") * 4 + n("table_entries") * 8;
  // eight values and a word of children a node, an entry of the start grid
  if (f.encoding == "octree") return n("nodes") * (8 * 4 + 4) + n("start_grid_cells") * 4;
  // two words a node, a position and a range a leaf, an entry and a node of the start grid
  if (f.encoding == "kd_tree")
    return h.leaf_cells() * 4 + n("nodes") * 8 + n("leaves") * 8 + f.find("kd_start")->bytes() +
           f.find("kd_start_nodes")->bytes();
  // eight words and a range a region, two words a node, an entry and a node of the start grid
  if (f.encoding == "exabricks")
    return h.leaf_cells() * 4 + n("regions") * 36 + n("nodes") * 8 + f.find("exa_start")->bytes() +
           f.find("exa_start_nodes")->bytes();
  throw Error(fmt::format("encoding {}: tell here by formula what it needs", f.encoding));
}

TEST(LeaveOut, NearestVolumesHoldWhatTheirEncodingNeedsAndFivePercent) {
  for (const Encoding* encoding : all_encodings()) {
    const auto filters = encoding->filters();
    if (std::find(filters.begin(), filters.end(), Filter::nearest) == filters.end()) continue;
    SCOPED_TRACE(encoding->name());
    const EncodedField field = build(blobs(), default_case(*encoding, Filter::nearest));
    const std::int64_t needed = bytes_by_formula(blobs(), field);
    EXPECT_LE(static_cast<double>(total(field)), 1.05 * static_cast<double>(needed));
    EXPECT_GE(total(field), needed);
  }
}

// ---- pruning

TEST(Hidden, IsARangeThatLiesInOneIntervalWithoutExtinction) {
  SceneNeeds needs;
  const auto is_hidden = [&](ValueRange range) { return hidden(needs, range, 0, Storage::r32f, {}); };
  EXPECT_FALSE(is_hidden({0, 0}));  // nothing is pruned unless intervals are given
  needs.invisible = {{-3e38, 1}, {2, 3}};
  EXPECT_TRUE(is_hidden({}));
  EXPECT_TRUE(is_hidden({0, 0.9}));
  EXPECT_TRUE(is_hidden({2.2, 2.8}));
  EXPECT_FALSE(is_hidden({0.5, 1.5}));
  EXPECT_FALSE(is_hidden({0.5, 2.5}));  // in two of them, and between
  EXPECT_FALSE(is_hidden({3.5, 4}));
}

std::vector<std::array<double, 2>> invisible_of(Scene scene) {
  scene.settings.prune = true;
  return scene_needs(scene, Filter::nearest, Filtering::manual).invisible;
}

/// Parts of the pool that the transfer function hides, from stored values alone.
struct BruteForce {
  std::int64_t hidden = 0, all = 0;  ///< texels
  double share() const { return static_cast<double>(hidden) / static_cast<double>(all); }
};

bool shows(const TransferFunction& tf, const EncodedField& f, const HostTexture& pool, const Box& texels) {
  ValueRange range;
  for_each_cell(texels, [&](const Vec3i& t) {
    range.add(load_value(pool.format, f.scale, pool.data.data(), Box{Vec3i(0), pool.size}.offset(t)));
  });
  return tf.max_extinction(range.min, range.max) > 0;
}

Vec3i uniform(const EncodedField& f, std::string_view name) {
  for (const auto& [key, value] : f.integer_uniforms)
    if (key == name) return value;
  return Vec3i(0);
}

BruteForce hidden_pages(const EncodedField& f, const TransferFunction& tf) {
  BruteForce count;
  const HostTexture& pool = *f.find("tex_pages");
  const int edge = define(f, "AMRTEX_PAGE_EDGE");
  const Vec3i shift = uniform(f, "u_pool_shift");
  for (int i = 0; i < f.statistics.at("pages").get<int>(); ++i) {
    const Vec3i at = Vec3i(i & ((1 << shift.x) - 1), (i >> shift.x) & ((1 << shift.y) - 1), i >> (shift.x + shift.y)) * edge;
    const Box texels{at, at + Vec3i(edge)};
    count.all += texels.cells();
    if (!shows(tf, f, pool, texels)) count.hidden += texels.cells();
  }
  return count;
}

/// A leaf of the kD-tree as its texture tells.
struct KdLeaf {
  Box cells;  ///< of its level
  int level;
  Vec3i texel;  ///< of its lower cell
};

std::vector<KdLeaf> kd_leaves(const AmrHierarchy& h, const EncodedField& f) {
  std::vector<KdLeaf> leaves;
  const auto* nodes = f.find("kd_nodes")->as<std::uint32_t>();
  const auto* data = f.find("kd_data")->as<std::uint32_t>();
  const int x_bits = define(f, "AMRTEX_KD_X_BITS"), y_bits = define(f, "AMRTEX_KD_Y_BITS");
  const auto visit = [&](auto&& self, std::uint32_t node, const Box& box) -> void {
    const std::uint32_t first = nodes[2 * node], second = nodes[2 * node + 1];
    const int level = static_cast<int>((first >> AMRTEX_KD_CHILD_BITS) & ((1U << AMRTEX_KD_LEVEL_BITS) - 1));
    const std::uint32_t child = first & ((1U << AMRTEX_KD_CHILD_BITS) - 1);
    const int width = h.cell_width(level);
    if (child != 0) {
      const int axis = static_cast<int>(first >> (AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS));
      Box below = box, above = box;
      below.upper[axis] = above.lower[axis] = box.lower[axis] + static_cast<int>(second >> AMRTEX_KD_DATA_BITS) * width;
      self(self, child, below);
      self(self, child + 1, above);
      return;
    }
    const std::uint32_t index = second & ((1U << AMRTEX_KD_DATA_BITS) - 1);
    if (index == AMRTEX_KD_NO_DATA) return;
    const std::uint32_t at = data[index * static_cast<std::uint32_t>(define(f, "AMRTEX_KD_DATA_WORDS"))];
    leaves.push_back({{box.lower / width, box.upper / width},
                      level,
                      {static_cast<int>(at & ((1U << x_bits) - 1)), static_cast<int>((at >> x_bits) & ((1U << y_bits) - 1)),
                       static_cast<int>(at >> (x_bits + y_bits))}});
  };
  visit(visit, 0, h.domain(h.finest_level()));
  return leaves;
}

/// Do hats of one leaf's cells reach into another leaf? They end half a cell beyond the cell.
bool reaches(const AmrHierarchy& h, const KdLeaf& from, const KdLeaf& to) {
  const int w = h.cell_width(from.level), v = h.cell_width(to.level);
  for (int a = 0; a < 3; ++a)
    if ((2 * from.cells.lower[a] - 1) * w >= 2 * to.cells.upper[a] * v ||
        (2 * from.cells.upper[a] + 1) * w <= 2 * to.cells.lower[a] * v)
      return false;
  return true;
}

/// Under `basis` a leaf shows something where the cells do whose hats reach in; and what it reads is needed.
std::vector<bool> needed_by_hats(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf,
                                 const std::vector<KdLeaf>& leaves) {
  std::vector<bool> needed(leaves.size());
  const HostTexture& pool = *f.find("tex_kd_pool");
  for (const KdLeaf& leaf : leaves) {
    ValueRange range;
    std::vector<std::size_t> read;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const KdLeaf& other = leaves[i];
      if (!reaches(h, other, leaf)) continue;
      read.push_back(i);
      for_each_cell(other.cells, [&](const Vec3i& c) {
        const KdLeaf one{{c, c + Vec3i(1)}, other.level, {}};
        if (!reaches(h, one, leaf)) return;
        const Vec3i texel = other.texel + c - other.cells.lower;
        range.add(load_value(pool.format, f.scale, pool.data.data(), Box{Vec3i(0), pool.size}.offset(texel)));
      });
    }
    if (tf.max_extinction(range.min, range.max) > 0)
      for (const std::size_t i : read) needed[i] = true;
  }
  return needed;
}

/// Of a subgrid is stored the box around its leaves, or around those that show something.
BruteForce hidden_bricks(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  const bool vertices = f.definition.filter == Filter::linear_vertex;
  const int border = f.definition.filter == Filter::linear_lod ? 1 : 0;
  const auto texels_of = [&](const Box& b) { return vertices ? Box{b.lower, b.upper + Vec3i(1)} : b.grown(border); };
  const auto around = [](std::map<std::pair<int, int>, Box>& boxes, const std::pair<int, int>& brick, const Box& box) {
    const auto [it, added] = boxes.try_emplace(brick, box);
    if (!added) it->second = {glm::min(it->second.lower, box.lower), glm::max(it->second.upper, box.upper)};
  };
  std::map<std::pair<int, int>, Box> all, shown;
  const std::vector<KdLeaf> leaves = kd_leaves(h, f);
  std::vector<bool> needed;
  if (f.definition.filter == Filter::basis) needed = needed_by_hats(h, f, tf, leaves);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const KdLeaf& leaf = leaves[i];
    const std::pair brick(leaf.level, h.find_patch(leaf.level, leaf.cells.lower));
    around(all, brick, leaf.cells);
    const Box texels = texels_of(leaf.cells);
    const Vec3i shift = leaf.texel - leaf.cells.lower;
    const bool read =
        needed.empty() ? shows(tf, f, *f.find("tex_kd_pool"), {texels.lower + shift, texels.upper + shift}) : needed[i];
    if (read) around(shown, brick, leaf.cells);
  }
  BruteForce count;
  for (const auto& [brick, box] : all) count.all += texels_of(box).cells();
  count.hidden = count.all;
  for (const auto& [brick, box] : shown) count.hidden -= texels_of(box).cells();
  return count;
}

/// Nodes of the octree of which no value is read for a leaf that shows something, from the mesh alone. A node is the
/// parent of eight cells: of 2^depth finest cells, at a multiple of its width.
BruteForce hidden_nodes(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  const int reach = f.definition.filter == Filter::nearest ? 0 : 1;
  const int root = f.statistics.at("depths").get<int>();
  std::set<std::array<int, 4>> read;
  const auto read_cell = [&](int level, const Vec3i& cell) {  // it stands in its leaf's node where the leaf is wider
    const int width = std::max(h.cell_width(level), h.cell_width(h.find_leaf(cell * h.cell_width(level))->level));
    for (int depth = std::countr_zero(static_cast<unsigned>(width)) + 1; depth <= root; ++depth) {
      const Vec3i at = (cell * h.cell_width(level)) >> depth;
      if (!read.insert({depth, at.x, at.y, at.z}).second) return;
    }
  };
  for (int level = 0; level < h.level_count(); ++level)
    for_each_cell(h.domain(level), [&](const Vec3i& c) {
      const std::optional<LeafCell> leaf = h.find_leaf(c * h.cell_width(level));
      if (leaf->level != level) return;
      const Box about = intersection({c - Vec3i(reach), c + Vec3i(1 + reach)}, h.domain(level));
      ValueRange range;
      for_each_cell(about, [&](const Vec3i& i) { range.add(h.level_value(level, i, 0)); });
      if (tf.max_extinction(range.min, range.max) > 0) for_each_cell(about, [&](const Vec3i& i) { read_cell(level, i); });
    });
  const auto nodes = f.statistics.at("nodes").get<std::int64_t>();
  return {8 * (nodes - static_cast<std::int64_t>(read.size())), 8 * nodes};
}

BruteForce brute_force(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  if (f.encoding == "octree") return hidden_nodes(h, f, tf);
  return f.encoding == "page_table" ? hidden_pages(f, tf) : hidden_bricks(h, f, tf);
}

/// What `left_out` calls the parts that pruning drops.
const char* pruned_parts(const EncodingCase& c) {
  if (c.encoding->name() == "octree") return "nodes";
  return c.encoding->name() == "page_table" ? "pages" : "leaves, and what they leave of bricks";
}

/// Does a place that shows nothing stay in a region of its own? Else pruning joins such places: fewer regions are counted.
bool keeps_regions(const EncodingCase& c) { return c.encoding->name() != "octree"; }

std::int64_t value_bytes(const EncodedField& f) {
  std::int64_t bytes = 0;
  for (const HostTexture& t : f.textures)
    if (t.holds_values) bytes += t.bytes();
  return bytes;
}

template <class F>
void for_each_pruning_case(F&& f) {
  for_each_filter([&](const EncodingCase& c) {
    if (c.encoding->prunes()) f(c);
  });
}

/// A ball in a corner, in patches of 4^3 cells; a part of it refined.
const AmrHierarchy& ball_in_patches() {
  static const AmrHierarchy h = [] {
    const auto ball = [](const Vec3d& p) { return std::max(0.0, 1.2 - 4 * glm::distance(p, Vec3d(0.2))); };
    MeshBuilder mesh(Vec3i(32), {2});
    for_each_cell({Vec3i(0), Vec3i(8)}, [&](const Vec3i& b) { mesh.patch(0, {b * 4, (b + 1) * 4}, ball); });
    mesh.patch(1, {Vec3i(8), Vec3i(16)}, ball);
    return mesh.hierarchy();
  }();
  return h;
}

/// Under `basis` hidden leaves stay where visible ones read them: next to all of those of the blobs.
const AmrHierarchy& pruned_mesh(const EncodingCase& c) { return c.filter == Filter::basis ? ball_in_patches() : blobs(); }

TEST(Prune, DropsNineTenthsOfWhatIsHiddenAtTheEncodingsGranularity) {
  const Scene scene = volume();
  for_each_pruning_case([&](const EncodingCase& c) {
    for (const Storage storage : {Storage::r32f, Storage::r16}) {
      SCOPED_TRACE(format_name(storage));
      const AmrHierarchy& h = pruned_mesh(c);
      const EncodedField whole = build(h, c, {.storage = storage});
      const EncodedField pruned = build(h, c, {.storage = storage, .invisible = invisible_of(scene)});
      const double share = brute_force(h, whole, scene.transfer_function).share();
      const double saved = 1 - static_cast<double>(value_bytes(pruned)) / static_cast<double>(value_bytes(whole));
      EXPECT_GT(share, 0.1) << "little is hidden: this tests nothing";
      EXPECT_GE(saved, 0.9 * share);
      EXPECT_LE(saved, share + 0.02);  // and nothing that could be seen, but for what packing wastes
      const char* what = pruned_parts(c);
      EXPECT_EQ(left_out_bytes(whole, what), 0);
      EXPECT_NEAR(static_cast<double>(left_out_bytes(pruned, what)), static_cast<double>(total(whole) - total(pruned)),
                  0.05 * static_cast<double>(total(whole)));
    }
  });
}

// Where a ray enters a region that can be seen does not depend on regions before it; what is hidden adds nothing. With hardware
// filtering the pool's size enters the normalised coordinate: that is not the same to the bit.
TEST(Prune, LeavesThePictureTheSameToTheBit) {
  Context& gl = context(ContextKind::egl);
  for_each_pruning_case([&](const EncodingCase& c) {
    const AmrHierarchy& h = pruned_mesh(c);
    const EncodedField whole = build(h, c);
    const EncodedField pruned = build(h, c, {.invisible = invisible_of(volume())});
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (const bool skip : {true, false}) {
        SCOPED_TRACE(fmt::format("{} skip {}", sampling_name(sampling), skip));
        const Scene scene = volume(sampling, skip);
        const Picture picture = draw(gl, h, whole, scene);
        EXPECT_GT(largest(picture), 0.1);
        EXPECT_EQ(difference(picture, draw(gl, h, pruned, scene)), 0);
      }
  });
}

TEST(Prune, DropsWhatShadersSkipAndNothingElse) {
  Context& gl = context(ContextKind::egl);
  const Scene scene = volume(Sampling::adaptive);
  for_each_pruning_case([&](const EncodingCase& c) {
    WorkCounts all, left;
    const AmrHierarchy& h = pruned_mesh(c);
    draw(gl, h, build(h, c), scene, &all);
    draw(gl, h, build(h, c, {.invisible = invisible_of(scene)}), scene, &left);
    if (!keeps_regions(c)) {  // fewer steps through what is hidden
      EXPECT_LE(left.samples, all.samples);
      EXPECT_LT(left.regions, all.regions);
      EXPECT_LT(left.regions_skipped, all.regions_skipped);
      return;
    }
    EXPECT_EQ(left.samples, all.samples);
    EXPECT_EQ(left.regions, all.regions);
    EXPECT_EQ(left.regions_skipped, all.regions_skipped);
  });
}

TEST(Prune, LeavesATreeWithoutDataWhereNothingCanBeSeen) {
  Scene scene = volume();
  scene.transfer_function.extinction = {{100, 0}, {101, 5}};  // above all values
  for_each_pruning_case([&](const EncodingCase& c) {
    const EncodedField pruned = build(blobs(), c, {.invisible = invisible_of(scene)});
    EXPECT_EQ(largest(draw(context(ContextKind::egl), blobs(), pruned, scene)), 0);
    EXPECT_LT(value_bytes(pruned), 1 << 16);
  });
}

TEST(Prune, IsRefusedByEncodingsThatHaveNoPartsAndByOtherModes) {
  for (const Encoding* encoding : all_encodings()) {
    if (encoding->prunes()) continue;
    try {
      build(blobs(), {encoding, Filter::nearest, Json::object()}, {.invisible = invisible_of(volume())});
      ADD_FAILURE() << encoding->name();
    } catch (const UnsupportedError& e) {
      EXPECT_THAT(e.what(), AllOf(HasSubstr(std::string(encoding->name())), HasSubstr("page_table"), HasSubstr("octree"),
                                  HasSubstr("kd_tree")));
    }
  }
  for (const Mode mode : {Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso}) {
    Scene scene = volume();
    scene.settings.mode = mode;
    scene.settings.prune = true;
    EXPECT_THROW(scene_needs(scene, Filter::nearest, Filtering::manual), UsageError) << mode_name(mode);
  }
}

}  // namespace
}  // namespace amrtex
