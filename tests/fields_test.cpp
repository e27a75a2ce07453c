// Several fields in one volume, each with its own transfer function: closed forms, symmetry, skipping, the double reference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/box_consumer.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "renderers/cpu/sampled_reference.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 10;
constexpr std::array kSamplings{Sampling::lattice, Sampling::adaptive};

/// Another field of values around 0.5, of which much is small.
double ridges(const Vec3d& p) { return std::pow(std::sin(4 * p.x + 3 * p.y * p.z), 2) * p.z; }

TransferFunction light_of_ridges() {
  TransferFunction tf;
  tf.extinction = {{0.3, 0}, {0.4, 0}, {0.9, 40}};
  tf.color = {{0.4, {0.9, 0.8, 0.1}}, {0.9, {0.2, 0.1, 1}}};
  return tf;
}

TransferFunction nothing() {
  TransferFunction tf = light_of_ridges();
  for (auto& point : tf.extinction) point.extinction = 0;
  return tf;
}

/// Two fields, `f` and `g`.
const AmrHierarchy& two_fields() {
  static const AmrHierarchy h = nested(waves).also("g", ridges).hierarchy();
  return h;
}

Scene fields_scene(Sampling sampling, const TransferFunction& first, const std::vector<FieldTransfer>& others) {
  Scene scene = small_scene(Mode::dvr, perspective({2.1, -1.2, 1.7}, Vec3d(0.5)), sampling, kPixels);
  scene.settings.step = 0.6;
  scene.transfer_function = first;
  scene.more_fields = others;
  return scene;
}

/// What the scene asks for and nothing else; fields by their index.
EncodedField build_for(const AmrHierarchy& h, const EncodingCase& c, const Scene& scene, int field = 0,
                       const std::vector<int>& others = {1}) {
  BuildRequest request = build_request(c, {.field = field, .more_fields = others});
  request.needs = scene_needs(scene, c.filter, Filtering::manual);
  return c.encoding->build(h, request);
}

/// Cases that take the mesh with so many fields. Some layouts hold one.
template <class F>
void for_each_taking(const AmrHierarchy& h, const std::vector<int>& others, F&& f) {
  int taken = 0;
  for_each_filter([&](const EncodingCase& c) {
    if (!accepted(h, c, {.more_fields = others})) return;
    ++taken;
    f(c);
  });
  EXPECT_GT(taken, 5);
}

/// Two of these cases: what the CPU asks of all of them, GL draws too.
GlPairs pairs_taking(const AmrHierarchy& h, const std::vector<int>& others, bool between_cells = false) {
  return {2, [&](const EncodingCase& c) {
            return (interpolates(c.filter) || !between_cells) && accepted(h, c, {.more_fields = others});
          }};
}

int define(const SceneBindings& b, std::string_view name) {
  for (const auto& [key, value] : b.defines)
    if (key == name) return value;
  return -1;
}

// ---- closed forms

TEST(Fields, OfConstantsAddTheirExtinctionsAndMixTheirColours) {
  // alpha = 1 - exp(-sum k L), C = sum k c / sum k alpha
  const AmrHierarchy h = nested(constant(1)).also("g", constant(2)).also("h", constant(3)).also("i", constant(-4)).hierarchy();
  const auto light = [](double extinction, const Vec3d& rgb) {
    TransferFunction tf = constant_light(extinction);
    tf.color = {{0, rgb}};
    return tf;
  };
  std::vector<FieldTransfer> others{{"g", light(0.4, {0, 1, 0})}, {"h", light(1.1, {0, 0, 1})}, {"i", light(0.5, {0, 1, 1})}};
  others[1].transfer_function.length_unit = TransferFunction::LengthUnit::world;  // the same in a unit cube
  const GlPairs on_gl = pairs_taking(h, {1, 2, 3});
  for_each_taking(h, {1, 2, 3}, [&](const EncodingCase& c) {
    for (const Sampling sampling : kSamplings)
      for (const bool all : {false, true}) {
        Scene scene = fields_scene(sampling, light(1.5, {1, 0, 0}), others);
        if (!all) scene.more_fields.resize(1);
        const double k = all ? 3.5 : 1.9;
        const Vec3d rgb = (all ? Vec3d(1.5, 0.9, 1.6) : Vec3d(1.5, 0.4, 0)) / k;
        const EncodedField field = build_for(h, c, scene, 0, all ? std::vector{1, 2, 3} : std::vector{1});
        const auto worst = [&](const Picture& picture) {
          double off = 0;
          for (int y = 0; y < kPixels; ++y)
            for (int x = 0; x < kPixels; ++x) {
              const double alpha = 1 - std::exp(-k * chord(scene, x, y, Vec3d(0), Vec3d(1)));
              const double* pixel = picture.pixel(x, y);
              off = std::max({off, std::abs(pixel[3] - alpha), std::abs(pixel[0] - rgb.r * alpha),
                              std::abs(pixel[1] - rgb.g * alpha), std::abs(pixel[2] - rgb.b * alpha)});
            }
          return off;
        };
        EXPECT_LE(worst(render_on_cpu(h, field, scene, true)), 1e-12);
        EXPECT_LE(worst(HierarchyReference(h, 0, field.definition).render(scene, 1)), 1e-12);
        if (sampling != Sampling::lattice || !all || !on_gl.has(c)) continue;
        EXPECT_LE(worst(draw(context(ContextKind::egl), h, field, scene)), 3e-6);
      }
  });
}

TEST(Fields, WithALinearRampHaveItsIntegral) {
  // along x through the unit cube: kappa = 3 x of the field x, plus 2 of the other: alpha = 1 - exp(-(3 (b^2 - a^2) / 2 + 2 (b -
  // a))) between the first and the last cell centre, beyond which x is constant
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root([](const Vec3d& p) { return p.x; }).also("g", constant(7)).hierarchy();
  Scene scene = fields_scene(Sampling::lattice, constant_light(0), {{"g", constant_light(2)}});
  scene.view = orthographic(Vec3d(0.5), {1, 0, 0}, 0.5);
  scene.transfer_function.extinction = {{0, 0}, {1, 3}};
  const double a = 1.0 / 16;
  const double depth = 3 * (a * a + (1 - a) * a + ((1 - a) * (1 - a) - a * a) / 2) + 2;
  const Picture picture = HierarchyReference(h, 0, {Filter::linear_lod}).render(scene, 0.5);
  for (const double alpha : {picture.pixel(2, 3)[3], picture.pixel(7, 5)[3]}) EXPECT_NEAR(alpha, 1 - std::exp(-depth), 1e-12);
}

// ---- what may not change

TEST(Fields, WithNothingToSeeInTheOthersShowTheFirstAlone) {
  // kappa + 0 is kappa, and a mean of weight 1 is its colour: no bit may differ. The octree fetches eight values at a time for
  // one field, whose positions are rounded about another corner.
  const AmrHierarchy& h = two_fields();
  const GlPairs on_gl = pairs_taking(h, {1}, true);
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    for (const Sampling sampling : kSamplings) {
      const Scene scene = fields_scene(sampling, peaks(), {{"g", nothing()}});
      Scene alone = scene;
      alone.more_fields.clear();
      const EncodedField both = build_for(h, c, scene);
      const EncodedField one = build_for(h, c, alone, 0, {});
      const double bound = c.encoding->name() == "octree" && sampling == Sampling::adaptive ? 1e-6 : 0;
      EXPECT_LE(difference(render_on_cpu(h, both, scene, false), render_on_cpu(h, one, alone, false)), bound);
      EXPECT_GT(largest(render_on_cpu(h, one, alone, false)), 0.1);
      if (sampling != Sampling::lattice || !on_gl.has(c)) continue;
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, both, scene), draw(context(ContextKind::egl), h, one, alone)),
                bound);
    }
  });
}

TEST(Fields, AreSkippedOnlyWhereNoneCanBeSeen) {
  const AmrHierarchy& h = two_fields();
  const GlPairs drawn = pairs_taking(h, {1}, true);
  std::int64_t skipped = 0;
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    for (const Sampling sampling : kSamplings) {
      Scene scene = fields_scene(sampling, peaks(), {{"g", light_of_ridges()}});
      const Picture all = render_on_cpu(h, build_for(h, c, scene), scene, false);
      scene.settings.skip = true;
      const EncodedField field = build_for(h, c, scene);
      EXPECT_EQ(all.values, render_on_cpu(h, field, scene, false).values);
      if (sampling == Sampling::lattice || !drawn.has(c)) continue;
      WorkCounts counts;
      const Picture on_gl = draw(context(ContextKind::egl), h, field, scene, &counts);
      skipped += counts.regions_skipped;
      EXPECT_LE(counts.regions_skipped, counts.regions);
      scene.settings.skip = false;
      EXPECT_EQ(on_gl.values, draw(context(ContextKind::egl), h, build_for(h, c, scene), scene).values);
    }
  });
  EXPECT_GT(skipped, 0);
}

TEST(Fields, OfWhichTheFirstIsHiddenEverywhereAreSeenAllTheSame) {
  // control of skipping: the first field's ranges hide everything, the second's nothing
  const AmrHierarchy& h = two_fields();
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    Scene scene = fields_scene(Sampling::adaptive, nothing(), {{"g", light_of_ridges()}});
    scene.settings.skip = true;
    const Picture behind = render_on_cpu(h, build_for(h, c, scene), scene, false);
    Scene alone = scene;
    alone.transfer_function = light_of_ridges();
    alone.more_fields.clear();
    EXPECT_GT(largest(behind), 0.1);
    EXPECT_LE(difference(behind, render_on_cpu(h, build_for(h, c, alone, 1, {}), alone, false)), 1e-6);
  });
}

TEST(Fields, MayBeNamedInAnyOrder) {
  const AmrHierarchy& h = two_fields();
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    for (const Sampling sampling : kSamplings) {
      Scene scene = fields_scene(sampling, peaks(), {{"g", light_of_ridges()}});
      scene.settings.skip = true;
      Scene turned = fields_scene(sampling, light_of_ridges(), {{"f", peaks()}});
      turned.settings.skip = true;
      const Picture picture = render_on_cpu(h, build_for(h, c, scene), scene, true);
      EXPECT_LE(difference(picture, render_on_cpu(h, build_for(h, c, turned, 1, {0}), turned, true)), 1e-6);
      const FilterDefinition definition = build_for(h, c, scene).definition;
      EXPECT_LE(difference(HierarchyReference(h, 0, definition).render(scene, 0.5),
                           HierarchyReference(h, 1, definition).render(turned, 0.5)),
                1e-12);
    }
  });
}

// ---- the reference

TEST(Fields, ConvergeToTheReference) {
  // the second mesh misses values of either field alone, where the other is still seen
  for (const AmrHierarchy& h : {nested(waves).also("g", ridges).hierarchy(), fields_with_gaps().hierarchy()}) {
    TransferFunction other = light_of_ridges();
    if (h.has_missing(0)) other.extinction = {{-45, 0}, {-20, 4}, {0, 30}};  // of `slopes`
    for_each_filter([&](const EncodingCase& c) {
      if (!accepted(h, c, {.more_fields = {1}})) return;
      for (const Sampling sampling : kSamplings) {
        Scene scene = fields_scene(sampling, peaks(), {{"g", other}});
        scene.settings.skip = true;
        const auto off = [&](double step) {
          scene.settings.step = step;
          const EncodedField field = build_for(h, c, scene);
          const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
          EXPECT_GT(largest(reference), 0.2);
          return rms_difference(render_on_cpu(h, field, scene, true), reference);
        };
        const double coarse = off(1);
        const double fine = off(0.05);
        EXPECT_LE(fine, 2e-2);
        EXPECT_LT(fine, std::max(coarse / 2, 1e-6)) << "exact from the start where every cell is a region";
      }
    });
  }
}

TEST(Fields, OfTheReferenceAtAnEncodingsPlacesAreItsPictureInDouble) {
  const AmrHierarchy& h = two_fields();
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    const Scene scene = fields_scene(Sampling::lattice, peaks(), {{"g", light_of_ridges()}});
    BuildRequest request = build_request(c, {.storage = Storage::r64f, .more_fields = {1}});
    request.needs = scene_needs(scene, c.filter, Filtering::manual);
    if (!accepted(h, c, {.storage = Storage::r64f, .more_fields = {1}})) return;
    const EncodedField field = c.encoding->build(h, request);
    const HierarchyReference f(h, 0, field.definition);
    const HierarchyReference g(h, 1, field.definition);
    const FieldValues values = [&](const FinestPosition& p, int number) { return (number == 0 ? f : g).sample(p); };
    EXPECT_LE(difference(render_sampled(h, field, scene, values), render_on_cpu(h, field, scene, true)), 1e-9);
  });
}

TEST(Fields, AreTheSameOnGl) {
  const AmrHierarchy& h = two_fields();
  pairs_taking(h, {1}).for_each([&](const EncodingCase& c) {
    Scene scene = fields_scene(Sampling::lattice, peaks(), {{"g", light_of_ridges()}});
    scene.settings.skip = true;
    const EncodedField field = build_for(h, c, scene);
    EXPECT_LE(rms_difference(draw(context(ContextKind::egl), h, field, scene), render_on_cpu(h, field, scene, true)),
              interpolating(c) ? 1e-4 : 2e-2);
  });
}

TEST(Fields, EndEarlyAndTakeOtherIntegrators) {
  const AmrHierarchy& h = two_fields();
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    Scene scene = fields_scene(Sampling::adaptive, peaks(), {{"g", light_of_ridges()}});
    scene.settings.step = 0.1;
    const EncodedField field = build_for(h, c, scene);
    const Picture midpoint = render_on_cpu(h, field, scene, true);
    scene.settings.early_end = 0.9;
    EXPECT_LE(difference(render_on_cpu(h, field, scene, true), midpoint), 0.1);
    scene.settings.early_end.reset();
    for (const Integrator integrator : {Integrator::euler, Integrator::left}) {
      scene.settings.integrator = integrator;
      EXPECT_LE(rms_difference(render_on_cpu(h, field, scene, true), midpoint), 0.05) << integrator_name(integrator);
    }
  });
}

// ---- leaving out, and bad input

TEST(Fields, AreLeftOutOfScenesWithOne) {
  const AmrHierarchy& h = two_fields();
  for_each_taking(h, {1}, [&](const EncodingCase& c) {
    Scene scene = fields_scene(Sampling::lattice, peaks(), {{"g", light_of_ridges()}});
    scene.settings.skip = true;
    const auto more = [&](const Scene& s, const std::vector<int>& others) {
      const EncodedField field = build_for(h, c, s, 0, others);
      const SceneBindings b = bind_scene(h, field, s);
      const auto is_more = [](const auto& u) { return u.name.ends_with("_1") || u.name.find("more_") != std::string::npos; };
      const auto textures = std::count_if(field.textures.begin(), field.textures.end(), is_more);
      EXPECT_EQ(define(b, "AMRTEX_TRANSFERS"), 1 + static_cast<int>(s.more_fields.size()));
      EXPECT_TRUE(b.buffers.empty());
      return textures + std::count_if(b.uniforms.begin(), b.uniforms.end(), is_more);
    };
    EXPECT_GE(more(scene, {1}), 3);
    scene.more_fields.clear();
    EXPECT_EQ(more(scene, {}), 0);
    EXPECT_EQ(more(scene, {1}), 0) << "a field that colours surfaces has no ranges";
  });
}

std::string complaint_of(const Scene& scene, const EncodedField& field) {
  try {
    bind_scene(two_fields(), field, scene);
  } catch (const Error& e) {
    return e.what();
  }
  return "accepted";
}

TEST(Fields, AreRefusedByNameWhereTheyCannotBeDrawn) {
  const AmrHierarchy& h = two_fields();
  const EncodingCase c = default_case(find_encoding("uniform"), Filter::nearest);
  const Scene good = fields_scene(Sampling::adaptive, peaks(), {{"g", light_of_ridges()}});
  const EncodedField field = build_for(h, c, good);
  EXPECT_EQ(complaint_of(good, field), "accepted");
  const auto refused = [&](auto&& change) {
    Scene scene = good;
    change(scene);
    EXPECT_THROW(HierarchyReference(h, 0, {}).render(scene, 1), UsageError);
    return complaint_of(scene, field);
  };
  EXPECT_THAT(refused([](Scene& s) { s.settings.integrator = Integrator::preintegrated; }),
              AllOf(HasSubstr("not preintegrated"), HasSubstr("euler")));
  EXPECT_THAT(refused([](Scene& s) { s.settings.integrator = Integrator::tolerance; }), HasSubstr("tolerance"));
  EXPECT_THAT(refused([](Scene& s) { s.settings.prune = true; }), AllOf(HasSubstr("'prune'"), HasSubstr("one of both")));
  EXPECT_THAT(refused([](Scene& s) { s.settings.point_light = PointLight{}; }), HasSubstr("'point_light'"));
  EXPECT_THAT(refused([](Scene& s) { s.settings.mode = Mode::mip; }), HasSubstr("the mode dvr, not mip"));
  EXPECT_THAT(refused([](Scene& s) {
                for (int i = 0; i < 20; ++i) s.more_fields[0].transfer_function.extinction.push_back({2.0 + i, 1});
              }),
              AllOf(HasSubstr("'extinction' of g has 23 points"), HasSubstr("at most 16")));
  const EncodedField one = build_for(h, c, good, 0, {});
  EXPECT_THAT(complaint_of(good, one), AllOf(HasSubstr("uniform: 2 fields"), HasSubstr("built with 1")));
  Scene many = good;
  for (int i = 0; i < 4; ++i) many.more_fields.push_back(good.more_fields[0]);
  try {
    build_for(h, c, many, 0, {1, 0, 1, 0, 1});
    ADD_FAILURE();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("encoding uniform: 6 fields"), HasSubstr("at most 4")));
  }
  Scene boxes = good;
  boxes.settings.consumer = ConsumerKind::multipass;
  const Structure structure(context(ContextKind::egl), field);
  EXPECT_THROW(make_consumer(context(ContextKind::egl), h, structure, boxes), UnsupportedError);
  try {
    HierarchyReference(h, 0, {}).render(fields_scene(Sampling::adaptive, peaks(), {{"rho", peaks()}}), 1);
    ADD_FAILURE();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("'rho'"), HasSubstr("f, g")));
  }
}

// ---- pruned structures

TEST(Prune, IsForOneTransferFunctionAlone) {
  const AmrHierarchy& h = two_fields();
  int pruned = 0;
  for_each_filter([&](const EncodingCase& c) {
    if (!c.encoding->prunes()) return;
    ++pruned;
    Scene scene = fields_scene(Sampling::adaptive, peaks(), {});
    scene.settings.prune = true;
    const EncodedField field = build_for(h, c, scene, 0, {});
    EXPECT_EQ(complaint_of(scene, field), "accepted");
    scene.settings.prune = false;  // as the scene says it is drawn does not matter
    EXPECT_EQ(complaint_of(scene, field), "accepted");
    Scene other = scene;
    other.transfer_function.color = {{0, Vec3d(1)}};
    EXPECT_EQ(complaint_of(other, field), "accepted") << "colours hide nothing";
    other.transfer_function.extinction = {{0.1, 0}, {0.2, 5}};
    EXPECT_THAT(complaint_of(other, field), AllOf(HasSubstr("pruned for a transfer function"), HasSubstr("without --prune")));
    other = scene;
    other.settings.mode = Mode::mip;
    EXPECT_THAT(complaint_of(other, field), HasSubstr("the mode dvr, not mip"));
  });
  EXPECT_GT(pruned, 2);
}

}  // namespace
}  // namespace amrtex
