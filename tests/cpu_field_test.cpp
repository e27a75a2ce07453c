// The C++ builds of shaders: what their text declares must be given, as for GLSL.
#include "renderers/cpu/cpu_field.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/probe.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

/// All that a CPU build is given for a picture, to be tampered with.
struct Given {
  explicit Given(const EncodedField& of, const SceneBindings& bindings)
      : field(&of), key(scene_key("raycast.frag", of, bindings, false)), uniforms(bindings.uniforms) {
    for (const HostTexture& t : of.textures) textures.push_back(&t);
    for (const HostTexture& t : bindings.buffers) textures.push_back(&t);
  }

  /// The message of the Error that setting throws; empty where it throws none.
  std::string error() const {
    try {
      make_cpu_field(field->encoding, Precision::single_precision)->set(key, uniforms, textures);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }

  const EncodedField* field;
  ShaderKey key;
  UniformValues uniforms;
  std::vector<const HostTexture*> textures;
};

/// Scenes that together use every part of the text.
std::vector<Scene> scenes(const AmrHierarchy& h) {
  Scene volume;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  volume.view = perspective(middle + Vec3d(1.6, -1.9, 0.8), middle);
  volume.transfer_function = constant_light(3);
  volume.settings.width = volume.settings.height = 4;
  std::vector<Scene> list(4, volume);
  list[1].settings.mode = Mode::projection;
  list[1].settings.ray_offset = 7;
  list[2].settings.mode = Mode::dvr_iso;
  list[2].settings.isosurfaces.values = {0.4, 0.6};
  list[2].settings.isosurfaces.ambient_occlusion = AmbientOcclusion{.rays = 4, .radius = 0.2};
  list[2].settings.point_light = PointLight{.position = middle + Vec3d(3, 1, 2)};
  list[3].settings.integrator = Integrator::tolerance;
  list[3].settings.sampling = Sampling::adaptive;
  return list;
}

/// Calls f with each encoding's default case that takes the scene, built for it.
template <class F>
void for_each_field(const AmrHierarchy& h, const Scene& scene, F&& f) {
  for_each_encoding([&](const EncodingCase& c) {
    BuildRequest request = build_request(c, {});
    request.needs = scene_needs(scene, c.filter, Filtering::manual);
    if (scene.settings.integrator == Integrator::tolerance && !interpolating(c)) return;
    const EncodedField field = c.encoding->build(h, request);
    f(field, Given(field, bind_scene(h, field, scene)));
  });
}

TEST(CpuField, TakesWhatTheSceneGives) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Scene& scene : scenes(h))
    for_each_field(h, scene, [](const EncodedField&, const Given& given) { EXPECT_EQ(given.error(), ""); });
}

TEST(CpuField, ADefineThatIsNotSetIsNamed) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Scene& scene : scenes(h))
    for_each_field(h, scene, [](const EncodedField&, const Given& given) {
      for (const auto& [name, text] : given.key.defines) {
        Given without = given;
        without.key.defines.erase(name);
        EXPECT_THAT(without.error(), HasSubstr(name + " is not defined"));
      }
    });
  for_each_field(h, scenes(h).front(), [](const EncodedField&, Given given) {
    given.key.defines.erase("AMRTEX_SKIP");
    EXPECT_THAT(given.error(),
                AllOf(HasSubstr("sample.glsl:"), HasSubstr("AMRTEX_SKIP is not defined: 1 where invisible regions")));
    given.key.defines["AMRTEX_SKIP"] = "yes";
    EXPECT_THAT(given.error(), HasSubstr("AMRTEX_SKIP is 'yes'; accepted: a whole number"));
  });
}

TEST(CpuField, AUniformThatIsNotSetIsNamed) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Scene& scene : scenes(h))
    for_each_field(h, scene, [](const EncodedField&, const Given& given) {
      for (const ShaderInput& input : assemble_shader(given.key).uniforms) {
        Given without = given;
        std::erase_if(without.uniforms, [&](const UniformValue& u) { return u.name == input.name; });
        EXPECT_THAT(without.error(), HasSubstr("uniform " + input.name + ", declared at " + input.place + ", is not set"));
      }
    });
}

TEST(CpuField, AUniformOfTooManyOrTooFewNumbersIsNamed) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_field(h, scenes(h).front(), [&](const EncodedField&, Given given) {
    const std::string levels = std::to_string(h.level_count());
    for (UniformValue& u : given.uniforms)
      if (u.name == "u_level_width") std::get<std::vector<int>>(u.numbers).push_back(1);
    EXPECT_THAT(given.error(), AllOf(HasSubstr("u_level_width"), HasSubstr("; " + levels + " are expected")));
    for (UniformValue& u : given.uniforms)
      if (u.name == "u_level_width") std::get<std::vector<int>>(u.numbers).assign(1000, 1);
    EXPECT_THAT(given.error(), AllOf(HasSubstr("has 1000 numbers"), HasSubstr("; " + levels + " are expected")));
  });
}

TEST(CpuField, ATextureOrBufferThatIsNotBoundIsNamed) {
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  for (const Scene& scene : scenes(h))
    for_each_field(h, scene, [](const EncodedField&, const Given& given) {
      const AssembledShader text = assemble_shader(given.key);
      EXPECT_FALSE(text.resources.empty());
      for (const ShaderInput& input : text.resources) {
        Given without = given;
        std::erase_if(without.textures, [&](const HostTexture* t) { return t->name == input.name; });
        EXPECT_THAT(without.error(),
                    HasSubstr("texture or buffer " + input.name + ", declared at " + input.place + ", is not bound"));
      }
    });
}

TEST(CpuField, PointsNeedNothingOfAScene) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_encoding([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const auto cpu = make_cpu_field(field.encoding, Precision::single_precision);
    std::vector<const HostTexture*> textures;
    for (const HostTexture& t : field.textures) textures.push_back(&t);
    EXPECT_NO_THROW(cpu->set(probe_key(field, 0), field_uniforms(h, field), textures));
    EXPECT_TRUE(cpu->sample({1, 1, 1}, Vec3d(0.5)).found);
  });
}

}  // namespace
}  // namespace amrtex
