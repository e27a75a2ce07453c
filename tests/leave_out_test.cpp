// What a scene does not need is absent, what it needs is there, and the picture is the same to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <thread>

#include "bench/measure/left_out_time.hpp"
#include "bench/measure/runner.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "structures/common/build_tools.hpp"
#include "tests/leave_out_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::HasSubstr;

bool has_texture(const EncodedField& field, std::string_view part) {
  return std::any_of(field.textures.begin(), field.textures.end(),
                     [&](const HostTexture& t) { return t.name.find(part) != std::string::npos; });
}

// ---- parts of a structure: absent where the scene does not need them, present where it does

/// Something that a build leaves out and that a need of a scene brings back.
struct Absence {
  EncodingCase c;
  BuildRequest request;
  LeftOut entry;

  std::string name() const { return fmt::format("{}: {}", c.name(), entry.what); }
  BuildRequest with() const {
    BuildRequest other = request;
    other.needs = with_need(request.needs, entry.need);
    return other;
  }
  EncodedField built(const BuildRequest& other) const { return c.encoding->build(blobs(), other); }
};

/// The defaults, and each value that an encoding tells of each parameter.
std::vector<EncodingCase> cases_of(const Encoding& encoding, Filter filter) {
  std::vector<EncodingCase> cases{default_case(encoding, filter, handle_limits(ContextKind::egl))};
  for (const ParameterInfo& p : encoding.parameters())
    for (const Json& value : p.accepted.examples()) {
      EncodingCase c = cases.front();
      c.parameters[p.name] = value;
      cases.push_back(std::move(c));
    }
  return cases;
}

/// Nothing where the encoding refuses.
std::vector<LeftOut> left_out_of(const EncodingCase& c, const BuildOptions& options) {
  try {
    return build(blobs(), c, options).left_out;
  } catch (const UnsupportedError&) {
    return {};
  }
}

/// What any encoding leaves out under any filter, each with the first build that does. Some parts belong to a layout of 8-bit
/// samples.
const std::vector<Absence>& absences() {
  static const std::vector<Absence> all = [] {
    std::vector<Absence> found;
    std::set<std::string> known;
    for (const Encoding* encoding : all_encodings())
      for (const Filter filter : encoding->filters())
        for (const EncodingCase& c : cases_of(*encoding, filter))
          for (const BuildOptions& options :
               {BuildOptions{}, BuildOptions{.value_ranges = false}, BuildOptions{.storage = Storage::r8}})
            for (const LeftOut& entry : left_out_of(c, options))
              if (entry.need != Need::none &&
                  known.insert(fmt::format("{} {} {}", encoding->name(), filter_name(filter), entry.what)).second)
                found.push_back({c, build_request(c, options), entry});
    return found;
  }();
  return all;
}

template <class F>
void for_each_absence(F&& f) {
  for (const Absence& a : absences()) {
    SCOPED_TRACE(a.name());
    f(a);
  }
}

const LeftOut* find_left_out(const EncodedField& field, std::string_view what) {
  const auto it = std::find_if(field.left_out.begin(), field.left_out.end(), [&](const LeftOut& l) { return l.what == what; });
  return it == field.left_out.end() ? nullptr : &*it;
}

std::set<std::string> left_out_names(const EncodedField& field) {
  std::set<std::string> names;
  for (const LeftOut& l : field.left_out) names.insert(l.what);
  return names;
}

TEST(LeaveOut, EveryEncodingCanDoWithoutValidityBitsAndRanges) {
  std::set<Need> of_all;
  for (const Encoding* encoding : all_encodings()) {
    std::set<Need> needs;
    for (const Absence& a : absences())
      if (a.c.encoding == encoding) needs.insert(a.entry.need);
    EXPECT_THAT(needs, testing::IsSupersetOf({Need::validity, Need::value_ranges})) << encoding->name();
    of_all.insert(needs.begin(), needs.end());
  }
  EXPECT_THAT(of_all, testing::IsSupersetOf({Need::border, Need::gradients})) << "these tests see all kinds";
}

TEST(LeaveOut, APartIsAbsentWithoutNeedAndThereWithIt) {
  for_each_absence([&](const Absence& a) {
    const EncodedField without = a.built(a.request);
    const EncodedField with = a.built(a.with());
    EXPECT_EQ(find_left_out(with, a.entry.what), nullptr);
    EXPECT_FALSE(a.entry.why.empty());
    EXPECT_FALSE(a.entry.seconds.has_value()) << "nobody has measured them";
    EXPECT_NE(without.content_hash(), with.content_hash());
    for (const Part& part : without.parts) {
      if (part.what != a.entry.what) continue;
      EXPECT_FALSE(part.present);
      EXPECT_EQ(without.find(part.name), nullptr);
      EXPECT_NE(with.find(part.name), nullptr);
    }
    EXPECT_LT(total(without), total(with) + (a.entry.bytes == 0 ? 1 : 0));
    // pools are packed anew with larger bricks: that may waste more or less
    const auto saved = static_cast<double>(total(with) - total(without));
    EXPECT_NEAR(static_cast<double>(a.entry.bytes), saved, a.entry.need == Need::border ? 0.25 * saved : 0.02 * saved + 64);
  });
}

TEST(LeaveOut, WhatBringsAPartBackBringsNothingElse) {
  for_each_absence([&](const Absence& a) {
    std::set<std::string> expected = left_out_names(a.built(a.request));
    expected.erase(a.entry.what);
    EXPECT_EQ(left_out_names(a.built(a.with())), expected);
  });
}

/// On the context where asked: compiling shaders is what these tests take their time for.
Picture picture_of(const EncodedField& field, const Scene& scene, bool on_gl) {
  if (!on_gl) return render_on_cpu(blobs(), field, scene, false);
  Context& gl = context(ContextKind::egl);
  const Structure structure(gl, field);  // throws where the shader and what is bound do not agree
  Raycaster raycaster(gl, blobs(), structure, scene);
  EXPECT_THAT(structure.gpu.unused(raycaster.program()), testing::IsEmpty());
  raycaster.draw();
  return raycaster.read();
}

TEST(LeaveOut, APartThatIsNotNeededDoesNotChangeThePicture) {
  std::set<std::string> drawn;  // on the context a part once, of the first encoding that has it; in the full tier of each
  for_each_absence([&](const Absence& a) {
    const std::string part = full_tier() ? fmt::format("{} {}", a.c.encoding->name(), a.entry.what) : a.entry.what;
    const bool on_gl = drawn.insert(part).second;
    const auto picture = [&](const BuildRequest& request) {
      // regions may differ, and with them places of adaptive
      return picture_of(a.built(request), volume(Sampling::lattice, request.needs.value_ranges), on_gl);
    };
    const Picture with = picture(a.with());
    EXPECT_GT(largest(with), 0.1);
    EXPECT_EQ(difference(with, picture(a.request)), 0);
  });
}

TEST(LeaveOut, PartsOfALevelOfDetailAreThereForItAloneAndChangeNoPictureOfLeaves) {
  int parts = 0;
  for (const Encoding* encoding : all_encodings())
    for (const Filter filter : encoding->filters())
      for (const EncodingCase& c : cases_of(*encoding, filter)) {
        SCOPED_TRACE(c.name());
        if (!accepted(blobs(), c) || !accepted(blobs(), c, {.level_of_detail = true})) continue;
        const EncodedField leaves = build(blobs(), c);
        const EncodedField detail = build(blobs(), c, {.level_of_detail = true});
        EXPECT_EQ(define(leaves, "AMRTEX_LEVEL_OF_DETAIL"), 0);
        EXPECT_EQ(define(detail, "AMRTEX_LEVEL_OF_DETAIL"), 1);
        const auto comes = [&](const LeftOut& l) { return find_left_out(detail, l.what) == nullptr; };
        if (std::none_of(leaves.left_out.begin(), leaves.left_out.end(), comes)) continue;
        EXPECT_GT(total(detail), total(leaves));
        Scene scene = volume();
        const bool on_gl = ++parts == 1;
        const Picture expected = picture_of(leaves, scene, on_gl);
        scene.settings.level_of_detail = 1e-9;  // no cell is as small
        EXPECT_EQ(difference(expected, picture_of(detail, scene, on_gl)), 0);
      }
  EXPECT_GT(parts, 0) << "no encoding has any: this tests nothing";
}

// ---- seconds of what is left out

/// Takes 30 ms longer with validity bits, and has no border.
class Slow final : public Encoding {
 public:
  std::string_view name() const override { return "slow"; }
  std::span<const Filter> filters() const override { return all_filters(); }
  EncodedField build(const AmrHierarchy&, const BuildRequest& request) const override {
    if (request.needs.keeps_border()) throw UnsupportedError("no border");
    if (request.needs.keeps_validity()) std::this_thread::sleep_for(std::chrono::milliseconds(30));
    EncodedField field;
    field.left_out = {{"bits", "", 1, Need::validity}, {"border", "", 1, Need::border}, {"texture", "", 1}};
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
  GlPairs(all_encodings().size()).for_each([&](const EncodingCase& c) {
    for (const bool skip : {true, false}) {
      const EncodedField field = build(h, c, {.value_ranges = skip});
      const Structure structure(gl, field);
      const Raycaster raycaster(gl, h, structure, volume(Sampling::lattice, skip));
      EXPECT_THAT(structure.gpu.unused(raycaster.program()), testing::IsEmpty()) << "skip " << skip;
    }
  });
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

bool prunes(const EncodingCase& c) { return c.encoding->prunes(); }

// Where a ray enters a region that can be seen does not depend on regions before it; what is hidden adds nothing. With hardware
// filtering the pool's size enters the normalised coordinate: that is not the same to the bit.
TEST(Prune, LeavesThePictureTheSameToTheBit) {
  GlPairs(2, prunes).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const AmrHierarchy& h = pruned_mesh(c);
    const EncodedField whole = build(h, c);
    const EncodedField pruned = build(h, c, {.invisible = invisible_of(volume())});
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (const bool skip : {true, false}) {
        SCOPED_TRACE(fmt::format("{} skip {}", sampling_name(sampling), skip));
        const Scene scene = volume(sampling, skip);
        const Picture picture = draw_on(gl, h, whole, scene);
        EXPECT_GT(largest(picture), 0.1);
        EXPECT_EQ(difference(picture, draw_on(gl, h, pruned, scene)), 0);
      }
  });
}

TEST(Prune, TakesNoMoreStepsThroughWhatIsHidden) {
  Context& gl = context(ContextKind::egl);
  const Scene scene = volume(Sampling::adaptive);
  // the tests of encodings count with each of their filters
  GlPairs(2, prunes).for_each([&](const EncodingCase& c) {
    WorkCounts all, left;
    const AmrHierarchy& h = pruned_mesh(c);
    draw(gl, h, build(h, c), scene, &all);
    draw(gl, h, build(h, c, {.invisible = invisible_of(scene)}), scene, &left);
    EXPECT_LE(left.samples, all.samples);
    EXPECT_LE(left.regions, all.regions);
    EXPECT_LE(left.regions_skipped, all.regions_skipped);
  });
}

TEST(Prune, LeavesATreeWithoutDataWhereNothingCanBeSeen) {
  Scene scene = volume();
  scene.transfer_function.extinction = {{100, 0}, {101, 5}};  // above all values
  GlPairs(1, prunes).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const EncodedField pruned = build(blobs(), c, {.invisible = invisible_of(scene)});
    EXPECT_EQ(largest(draw_on(gl, blobs(), pruned, scene)), 0);
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
      EXPECT_THAT(e.what(), HasSubstr(std::string(encoding->name())));
      for (const Encoding* other : all_encodings()) {
        if (!other->prunes()) continue;
        EXPECT_THAT(e.what(), HasSubstr(std::string(other->name())));
      }
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
