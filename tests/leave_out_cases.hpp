// What tests of left-out parts share: a volume of which most is invisible, and what leaving that out must save.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string_view>

#include "renderers/bindings/scene_needs.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/generators/synthetic.hpp"
#include "tests/pictures.hpp"

namespace amrtex::test {

/// Values below 0.05 are invisible.
inline Scene volume(Sampling sampling = Sampling::lattice, bool skip = true) {
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
inline const AmrHierarchy& blobs() {
  static const AmrHierarchy h(generate_mesh(Json::parse(R"({"field": "blobs_shell", "levels": 3, "root": 16, "patch": 4})")));
  return h;
}

/// A ball in a corner, in patches of 4^3 cells; a part of it refined.
inline const AmrHierarchy& ball_in_patches() {
  static const AmrHierarchy h = [] {
    const auto ball = [](const Vec3d& p) { return std::max(0.0, 1.2 - 4 * glm::distance(p, Vec3d(0.2))); };
    MeshBuilder mesh(Vec3i(32), {2});
    for_each_cell({Vec3i(0), Vec3i(8)}, [&](const Vec3i& b) { mesh.patch(0, {b * 4, (b + 1) * 4}, ball); });
    mesh.patch(1, {Vec3i(8), Vec3i(16)}, ball);
    return mesh.hierarchy();
  }();
  return h;
}

/// Under `basis` what is hidden stays where visible cells read it: next to all of those of the blobs.
inline const AmrHierarchy& pruned_mesh(const EncodingCase& c) { return c.filter == Filter::basis ? ball_in_patches() : blobs(); }

inline std::vector<std::array<double, 2>> invisible_of(Scene scene) {
  scene.settings.prune = true;
  return scene_needs(scene, Filter::nearest, Filtering::manual).invisible;
}

inline int define(const EncodedField& field, std::string_view name) {
  for (const auto& [key, value] : field.shader.defines)
    if (key == name) return value;
  return -1;
}

inline Vec3i uniform(const EncodedField& field, std::string_view name) {
  for (const auto& [key, value] : field.integer_uniforms)
    if (key == name) return value;
  return Vec3i(0);
}

inline std::int64_t total(const EncodedField& field) { return field.memory().total(); }

inline std::int64_t value_bytes(const EncodedField& field) {
  std::int64_t bytes = 0;
  for (const HostTexture& t : field.textures)
    if (t.holds_values) bytes += t.bytes();
  return bytes;
}

/// Bytes of all that was left out for one need.
inline std::int64_t left_out_bytes(const EncodedField& field, Need need) {
  return std::accumulate(field.left_out.begin(), field.left_out.end(), std::int64_t{0},
                         [&](std::int64_t sum, const LeftOut& l) { return sum + (l.need == need ? l.bytes : 0); });
}

/// Texels that the transfer function hides, found without the encoding's own search.
struct HiddenTexels {
  std::int64_t hidden = 0, all = 0;
  double share() const { return static_cast<double>(hidden) / static_cast<double>(all); }
};

/// Can any of these texels be seen, as they are stored?
inline bool shows(const TransferFunction& tf, const EncodedField& f, const HostTexture& pool, const Box& texels) {
  ValueRange range;
  for_each_cell(texels, [&](const Vec3i& t) {
    range.add(load_value(pool.format, f.scale, pool.data.data(), Box{Vec3i(0), pool.size}.offset(t)));
  });
  return tf.max_extinction(range.min, range.max) > 0;
}

/// Pruning drops nine tenths of what is hidden at the encoding's granularity, nothing that can be seen, and tells the bytes.
/// `hidden_in(h, field, transfer_function)` gives HiddenTexels of a structure that was not pruned.
template <class HiddenIn>
void expect_drops_what_is_hidden(const EncodingCase& c, HiddenIn&& hidden_in) {
  const Scene scene = volume();
  const AmrHierarchy& h = pruned_mesh(c);
  for (const Storage storage : {Storage::r32f, Storage::r16}) {
    SCOPED_TRACE(fmt::format("{} {}", c.name(), format_name(storage)));
    const EncodedField whole = build(h, c, {.storage = storage});
    const EncodedField pruned = build(h, c, {.storage = storage, .invisible = invisible_of(scene)});
    const double share = hidden_in(h, whole, scene.transfer_function).share();
    const double saved = 1 - static_cast<double>(value_bytes(pruned)) / static_cast<double>(value_bytes(whole));
    EXPECT_GT(share, 0.1) << "little is hidden: this tests nothing";
    EXPECT_GE(saved, 0.9 * share);
    EXPECT_LE(saved, share + 0.02);  // but for what packing wastes
    EXPECT_EQ(left_out_bytes(whole, Need::hidden), 0);
    EXPECT_NEAR(static_cast<double>(left_out_bytes(pruned, Need::hidden)), static_cast<double>(total(whole) - total(pruned)),
                0.05 * static_cast<double>(total(whole)));
  }
}

/// Where what shows nothing stays in a region of its own, pruning drops what shaders skip and nothing else.
inline void expect_same_steps(const EncodingCase& c) {
  SCOPED_TRACE(c.name());
  Context& gl = context(ContextKind::egl);
  const Scene scene = volume(Sampling::adaptive);
  const AmrHierarchy& h = pruned_mesh(c);
  WorkCounts all, left;
  draw(gl, h, build(h, c), scene, &all);
  draw(gl, h, build(h, c, {.invisible = invisible_of(scene)}), scene, &left);
  EXPECT_EQ(left.samples, all.samples);
  EXPECT_EQ(left.regions, all.regions);
  EXPECT_EQ(left.regions_skipped, all.regions_skipped);
}

/// A structure of filter `nearest` with value ranges and no missing cells holds what it needs, told by its own counts, and five
/// percent.
template <class Needed>
void expect_nearest_holds_little_more(std::string_view encoding, Needed&& needed_bytes) {
  const EncodedField field = build(blobs(), default_case(find_encoding(encoding), Filter::nearest));
  const std::int64_t needed = needed_bytes(blobs(), field);
  EXPECT_LE(static_cast<double>(total(field)), 1.05 * static_cast<double>(needed));
  EXPECT_GE(total(field), needed);
}

/// Of a structure's own counts.
inline std::int64_t counted(const EncodedField& field, const char* key) { return field.statistics.at(key).get<std::int64_t>(); }

}  // namespace amrtex::test
