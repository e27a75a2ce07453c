// What a scene does not need is absent, what it needs is there, and the picture is the same to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <map>

#include "structures/build_tools.hpp"
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

struct Part {
  std::string what;     ///< as `left_out` names it
  std::string texture;  ///< in the name of what holds it; empty: a part of another texture
  std::string define;   ///< 0 without it
  BuildOptions without, with;
};

std::vector<Part> parts() {
  return {{"validity bits", "validity", "AMRTEX_VALIDITY", {}, {.everything = true}},
          {"value ranges", "ranges", "AMRTEX_VALUE_RANGES", {.value_ranges = false}, {}},
          {"second channel of the table", "", "AMRTEX_VALUE_RANGES", {.value_ranges = false}, {}},
          {"border layer", "", "", {}, {.everything = true}}};
}

TEST(LeaveOut, APartIsAbsentWithoutNeedAndThereWithItAndThePictureIsTheSame) {
  const AmrHierarchy h = nested(waves).hierarchy();
  std::map<std::string, int> seen;
  for_each_filter([&](const EncodingCase& c) {
    for (const Part& part : parts()) {
      SCOPED_TRACE(part.what);
      const EncodedField without = build(h, c, part.without);
      const EncodedField with = build(h, c, part.with);
      const std::int64_t bytes = left_out_bytes(without, part.what);
      if (bytes == 0) continue;  // no part of this encoding
      ++seen[part.what];
      EXPECT_EQ(left_out_bytes(with, part.what), 0);
      EXPECT_LT(total(without), total(with));
      if (!part.define.empty()) {
        EXPECT_EQ(define(without, part.define), 0);
        EXPECT_EQ(define(with, part.define), 1);
      }
      if (!part.texture.empty() && has_texture(with, part.texture)) {
        EXPECT_FALSE(has_texture(without, part.texture));
      }
      const Scene scene = volume(Sampling::lattice, false);  // regions may differ, and with them places of adaptive
      EXPECT_EQ(difference(draw(context(ContextKind::egl), h, with, scene), draw(context(ContextKind::egl), h, without, scene)),
                0);
    }
  });
  EXPECT_EQ(seen.size(), parts().size()) << "a part that no encoding leaves out";
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
      const GpuField gpu(field, gl);
      const Raycaster raycaster(gl, h, field, gpu, volume(Sampling::lattice, skip));
      EXPECT_THAT(gpu.unused(raycaster.program()), testing::IsEmpty()) << "skip " << skip;
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
  return 0;
}

TEST(LeaveOut, NearestVolumesHoldWhatTheirEncodingNeedsAndFivePercent) {
  for (const Encoding* encoding : all_encodings()) {
    const auto filters = encoding->filters();
    if (std::find(filters.begin(), filters.end(), Filter::nearest) == filters.end()) continue;
    SCOPED_TRACE(encoding->name());
    const EncodedField field = build(blobs(), default_case(*encoding, Filter::nearest));
    const std::int64_t needed = bytes_by_formula(blobs(), field);
    if (needed == 0) continue;
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
  for (const KdLeaf& leaf : kd_leaves(h, f)) {
    const std::pair brick(leaf.level, h.find_patch(leaf.level, leaf.cells.lower));
    around(all, brick, leaf.cells);
    const Box texels = texels_of(leaf.cells);
    const Vec3i shift = leaf.texel - leaf.cells.lower;
    if (shows(tf, f, *f.find("tex_kd_pool"), {texels.lower + shift, texels.upper + shift})) around(shown, brick, leaf.cells);
  }
  BruteForce count;
  for (const auto& [brick, box] : all) count.all += texels_of(box).cells();
  count.hidden = count.all;
  for (const auto& [brick, box] : shown) count.hidden -= texels_of(box).cells();
  return count;
}

BruteForce brute_force(const AmrHierarchy& h, const EncodedField& f, const TransferFunction& tf) {
  return f.encoding == "page_table" ? hidden_pages(f, tf) : hidden_bricks(h, f, tf);
}

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

TEST(Prune, DropsNineTenthsOfWhatIsHiddenAtTheEncodingsGranularity) {
  const Scene scene = volume();
  for_each_pruning_case([&](const EncodingCase& c) {
    for (const Storage storage : {Storage::r32f, Storage::r16}) {
      SCOPED_TRACE(format_name(storage));
      const EncodedField whole = build(blobs(), c, {.storage = storage});
      const EncodedField pruned = build(blobs(), c, {.storage = storage, .invisible = invisible_of(scene)});
      const double share = brute_force(blobs(), whole, scene.transfer_function).share();
      const double saved = 1 - static_cast<double>(value_bytes(pruned)) / static_cast<double>(value_bytes(whole));
      EXPECT_GT(share, 0.1) << "little is hidden: this tests nothing";
      EXPECT_GE(saved, 0.9 * share);
      EXPECT_LE(saved, share + 0.02);  // and nothing that could be seen, but for what packing wastes
      const char* what = c.encoding->name() == "page_table" ? "pages" : "leaves, and what they leave of bricks";
      EXPECT_EQ(left_out_bytes(whole, what), 0);
      EXPECT_NEAR(static_cast<double>(left_out_bytes(pruned, what)), static_cast<double>(total(whole) - total(pruned)),
                  0.05 * static_cast<double>(total(whole)));
    }
  });
}

// Regions keep their boxes, so places of samples are the same; what is hidden adds nothing. With hardware filtering
// the pool's size enters the normalised coordinate: that is not the same to the bit.
TEST(Prune, LeavesThePictureTheSameToTheBit) {
  Context& gl = context(ContextKind::egl);
  for_each_pruning_case([&](const EncodingCase& c) {
    const EncodedField whole = build(blobs(), c);
    const EncodedField pruned = build(blobs(), c, {.invisible = invisible_of(volume())});
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (const bool skip : {true, false}) {
        SCOPED_TRACE(fmt::format("{} skip {}", sampling_name(sampling), skip));
        const Scene scene = volume(sampling, skip);
        const Picture picture = draw(gl, blobs(), whole, scene);
        EXPECT_GT(largest(picture), 0.1);
        EXPECT_EQ(difference(picture, draw(gl, blobs(), pruned, scene)), 0);
      }
  });
}

TEST(Prune, DropsWhatShadersSkipAndNothingElse) {
  Context& gl = context(ContextKind::egl);
  const Scene scene = volume(Sampling::adaptive);
  for_each_pruning_case([&](const EncodingCase& c) {
    WorkCounts all, left;
    draw(gl, blobs(), build(blobs(), c), scene, &all);
    draw(gl, blobs(), build(blobs(), c, {.invisible = invisible_of(scene)}), scene, &left);
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
      EXPECT_THAT(e.what(), AllOf(HasSubstr(std::string(encoding->name())), HasSubstr("page_table"), HasSubstr("kd_tree")));
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
