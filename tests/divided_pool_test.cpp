// Pools that no texture of the context holds lie in several, and give the picture of one. Contexts with small limits stand for
// large pools.
#include <gtest/gtest.h>

#include <set>

#include "tests/pictures.hpp"

namespace amrtex::test {
namespace {

int textures_of_values(const EncodedField& field) {
  return static_cast<int>(
      std::count_if(field.textures.begin(), field.textures.end(), [](const HostTexture& t) { return t.holds_values; }));
}

std::int64_t largest_texture_of_values(const EncodedField& field) {
  std::int64_t bytes = 0;
  for (const HostTexture& t : field.textures)
    if (t.holds_values) bytes = std::max(bytes, t.bytes());
  return bytes;
}

/// The same values under a limit of a third of the largest texture; none where the encoding refuses that.
std::optional<EncodedField> divided(const AmrHierarchy& h, const EncodingCase& c, BuildOptions options,
                                    const EncodedField& whole) {
  options.limits = c.limits;
  options.limits->max_texture_bytes = std::max<std::int64_t>(largest_texture_of_values(whole) / 3, 4096);
  try {
    return build(h, c, options);
  } catch (const UnsupportedError&) {
    return std::nullopt;
  }
}

/// Calls f(case, whole field, divided field) for the encodings and filters that divide their pool; how many encodings there were.
template <class F>
std::size_t for_each_divided(const AmrHierarchy& h, const BuildOptions& options, F&& f) {
  std::set<const Encoding*> encodings;
  for_each_filter([&](const EncodingCase& c) {
    if (!accepted(h, c, options)) return;
    const EncodedField whole = build(h, c, options);
    const std::optional<EncodedField> parts = divided(h, c, options, whole);
    if (!parts || textures_of_values(*parts) == textures_of_values(whole)) return;
    encodings.insert(c.encoding);
    f(c, whole, *parts);
  });
  return encodings.size();
}

Scene scene_of(Mode mode, Sampling sampling) {
  Scene scene = small_scene(mode, perspective({1.9, 2.3, 1.7}, Vec3d(0.5)), sampling, 16);
  scene.transfer_function = peaks();
  return scene;
}

// Texels are the same, and so are the eight that a position lies between.
TEST(DividedPool, HasTheSameBits) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  const std::size_t encodings =
      for_each_divided(h, {}, [&](const EncodingCase&, const EncodedField& whole, const EncodedField& parts) {
        for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
          const Scene scene = scene_of(Mode::dvr, sampling);
          Context& gl = context(ContextKind::egl);
          const Picture one = draw(gl, h, whole, scene);
          EXPECT_EQ(draw(gl, h, parts, scene).values, one.values);
          EXPECT_GT(largest(one), 0.01);
        }
      });
  EXPECT_GE(encodings, 2);
}

// The texture unit's coordinate is a share of the texture's edge, and so is what a float rounds off it.
TEST(DividedPool, IsFilteredTheSame) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const std::size_t encodings = for_each_divided(
      h, {.filtering = Filtering::hardware}, [&](const EncodingCase& c, const EncodedField& whole, const EncodedField& parts) {
        if (!interpolates(c.filter)) return;
        const Scene scene = scene_of(Mode::projection, Sampling::adaptive);
        Context& gl = context(ContextKind::egl);
        const Picture one = draw(gl, h, whole, scene);
        EXPECT_LT(difference(draw(gl, h, parts, scene), one), 1e-4 * largest(one));
      });
  EXPECT_GE(encodings, 2);
}

// Two fields: each has as many textures.
TEST(DividedPool, HoldsSeveralFields) {
  const AmrHierarchy h = nested(waves).also("g", [](const Vec3d& p) { return p.x + 2 * p.y * p.z; }).hierarchy();
  const std::size_t encodings =
      for_each_divided(h, {.more_fields = {1}}, [&](const EncodingCase&, const EncodedField& whole, const EncodedField& parts) {
        EXPECT_EQ(textures_of_values(parts) % 2, 0);
        Scene scene = scene_of(Mode::dvr, Sampling::adaptive);
        scene.more_fields = {{.field = "g", .transfer_function = peaks()}};
        Context& gl = context(ContextKind::egl);
        EXPECT_EQ(draw(gl, h, parts, scene).values, draw(gl, h, whole, scene).values);
      });
  EXPECT_GE(encodings, 2);
}

}  // namespace
}  // namespace amrtex::test
