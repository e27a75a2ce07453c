// The table of settings: what each row promises, and what follows from the rows.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "bench/records/record.hpp"
#include "bench/settings/settings_table.hpp"
#include "bench/settings/settings_text.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

// --- what a row says ---

template <class K>
concept SilentAboutReferences = requires {
  K{.name = "step", .type = number_type()};
};
template <class K>
concept OutspokenAboutReferences = requires {
  K{.name = "step", .type = number_type(), .reference = AffectsReference::no};
};
static_assert(!SilentAboutReferences<Key> && OutspokenAboutReferences<Key>);

TEST(Settings, EachKeyHasAHelpTextAndADefaultThatItAccepts) {
  for (const Section& section : all_sections()) {
    if (section.name == "generate") continue;  // docs/generate.md has these
    std::set<std::string> names;
    for (const Key* key : section.keys) {
      const std::string place = section.name + "." + key->name;
      EXPECT_FALSE(key->help.empty()) << place;
      EXPECT_TRUE(names.insert(key->name).second) << place << " stands there twice";
      if (key->required || key->default_value.is_null() || !key->default_text.empty()) continue;
      const auto problem = value_problem(key->default_value, key->type);
      EXPECT_FALSE(problem) << place << ": " << problem->text;
    }
  }
}

TEST(Settings, KeysGoWithKeysOfTheirOwnTableAndSayWhy) {
  for (const Setting<Scene>& row : scene_settings().rows())
    for (const Condition& c : row.key.takes) {
      ASSERT_NE(scene_settings().find(c.with), nullptr) << row.key.name << " with " << c.with;
      const Key& other = scene_settings().find(c.with)->key;
      for (const Json& value : c.accepted) EXPECT_FALSE(value_problem(value, other.type)) << row.key.name << " with " << c.with;
      const bool explained = c.otherwise == Otherwise::refused || c.otherwise == Otherwise::unsupported;
      EXPECT_EQ(explained, !c.why.empty()) << row.key.name << " with " << c.with;
    }
}

// --- types ---

std::string problem_of(const char* json, const ValueType& type) {
  const auto problem = value_problem(Json::parse(json), type);
  return problem ? problem->place + ": " + problem->text : "accepted";
}

TEST(ValueTypes, NameThePlaceAndWhatIsAccepted) {
  EXPECT_EQ(problem_of("0", number_above(0, 1)), ": a number above 0, in (0, 1] is expected, not 0");
  EXPECT_EQ(problem_of("1", number_above(0, 1)), "accepted");
  EXPECT_EQ(problem_of("1.5", integer_type(1, 3)), ": an integer from 1 to 3 is expected, not 1.5");
  EXPECT_EQ(problem_of("null", integer_type(1, 3).or_null()), "accepted");
  EXPECT_EQ(problem_of("[1, 2]", list_of(number_type(), 3, "[x, y, z]")), ": accepted: [x, y, z]");
  EXPECT_EQ(problem_of("[1, 2, \"x\"]", list_of(number_type(), 3, "[x, y, z]")), "[2]: a number is expected, not \"x\"");
  EXPECT_EQ(problem_of("1", list_of(number_type(), 0, "numbers")), "accepted") << "one element stands for a list of it";
  EXPECT_EQ(problem_of("[]", list_of(number_type(), 0, "numbers")), ": an empty list gives no value");
  EXPECT_EQ(problem_of("[[1, 2], [3]]", lists_of(number_type(), 2, "[a, b]")), "[1]: accepted: [a, b]");
  EXPECT_THAT(problem_of("\"rad\"", choice_type({"red", "blue"})), HasSubstr("did you mean 'red'?"));
  const ValueType object =
      object_type({{.name = "radius", .type = number_above(0), .reference = AffectsReference::yes, .required = true},
                   {.name = "rays", .type = integer_type(1, 8), .reference = AffectsReference::no}});
  EXPECT_EQ(problem_of("{}", object), ": the key 'radius' is missing");
  EXPECT_EQ(problem_of(R"({"radius": 1, "rays": 9})", object), ".rays: an integer from 1 to 8 is expected, not 9");
  EXPECT_THAT(problem_of(R"({"radiu": 1})", object),
              AllOf(StartsWith(".radiu: unknown key"), HasSubstr("did you mean 'radius'?")));
}

// --- references and names of records ---

AmrHierarchy mesh() {
  return AmrHierarchy(
      generate_mesh(Json::parse(R"({"field": "linear", "levels": 2, "root": 8, "patch": 4, "more_fields": ["blobs_shell"]})")));
}

/// A picture small enough to be drawn many times.
Scene small_scene(Mode mode) {
  Scene scene;
  scene.view.eye = Vec3d(2.3, 1.9, 1.5);
  scene.view.at = Vec3d(0.5);
  scene.transfer_function.extinction = {{0.05, 0}, {0.8, 10}, {1.4, 40}};
  scene.transfer_function.color = {{0, {0, 0, 0.3}}, {1.4, {0.8, 0, 0}}};
  scene.settings.mode = mode;
  scene.settings.width = scene.settings.height = 8;
  if (scene.settings.draws_surfaces()) scene.settings.isosurfaces.values = {0.4, 0.6};
  return scene;
}

/// Another value of each key, and the scene in which it means something.
struct Change {
  const char* key;
  const char* value;
  Mode mode = Mode::dvr;
  const char* with = "{}";  ///< other keys that it needs
};

const std::vector<Change>& changes() {
  static const std::vector<Change> all = {
      {"consumer", R"("multipass")"},
      {"slice_target", R"("rgba8")", Mode::dvr, R"({"consumer": "slices"})"},
      {"dispatch", R"("compute")"},
      {"mode", R"("mip")"},
      {"sampling", R"("lattice")"},
      {"step", "0.5"},
      {"budget", "0.02", Mode::dvr, R"({"sampling": "planned"})"},
      {"tolerance", "0.01", Mode::dvr, R"({"integrator": "tolerance"})"},
      {"integrator", R"("euler")"},
      {"width", "9"},
      {"height", "9"},
      {"skip", "false"},
      {"leap", "\"off\""},
      {"level_of_detail", "2"},
      {"max_level", "0"},
      {"isovalues", "[0.5, 0.7]", Mode::iso},
      {"iso_opacity", "[0.5, 0.7]", Mode::iso},
      {"surface_color", "[[0, 1, 1, 0]]", Mode::iso},
      {"color_field", R"("blobs_shell")", Mode::iso},
      {"iso_tolerance", "0.5", Mode::iso},
      {"shading", R"("none")", Mode::iso},
      {"output", R"("depth")", Mode::iso},
      {"ambient_occlusion", R"({"radius": 0.3})", Mode::iso},
      {"ray_offset", "true"},
      {"point_light", "[2, 2, 2]"},
      {"ambient", "0.5", Mode::dvr, R"({"point_light": [2, 2, 2]})"},
      {"shadow_step", "0.5", Mode::dvr, R"({"point_light": [2, 2, 2]})"},
      {"needs", R"("all")"},
      {"prune", "true"},
      {"early_end", "0.9"},
      {"clip_planes", "[[1, 0, 0, 0.5]]"},
      {"mirror", R"("+x")"},
      {"triangles", R"([{"file": "x.obj"}])"},
      {"transfer_functions", R"([{"field": "blobs_shell", "extinction": [[0, 3], [1, 9]], "color": [[0, 0, 1, 0]]}])"},
      {"region", R"({"lower": [0, 0, 0], "upper": [0.5, 1, 1]})"}};
  return all;
}

void set(Scene& scene, const char* key, const Json& value) {
  scene_settings().find(key)->set(scene, value);
  if (std::string_view(key) == "triangles")
    scene.settings.triangles.front().mesh =
        std::make_shared<const TriangleMesh>(std::vector<Triangle>{{{Vec3d(1, 0, 0), Vec3d(1, 1, 0), Vec3d(1, 0, 1)}}});
}

std::pair<Scene, Scene> before_and_after(const Change& change) {
  Scene before = small_scene(change.mode);
  const Json others = Json::parse(change.with);
  for (const auto& [key, value] : others.items()) set(before, key.c_str(), value);
  Scene after = before;
  set(after, change.key, Json::parse(change.value));
  return {before, after};
}

TEST(SceneKeys, EachHasASecondValueInTheseTests) {
  std::set<std::string> tested;
  for (const Change& change : changes()) tested.insert(change.key);
  for (const Key* key : scene_settings().keys()) EXPECT_TRUE(tested.contains(key->name)) << key->name;
}

TEST(SceneKeys, EachChangesTheConfigurationAndThoseThatSaySoTheReference) {
  for (const Change& change : changes()) {
    const auto [before, after] = before_and_after(change);
    const Key& key = scene_settings().find(change.key)->key;
    EXPECT_NO_THROW(validate(after)) << change.key;
    EXPECT_NE(scene_configuration(before), scene_configuration(after)) << change.key;
    EXPECT_EQ(scene_reference(before) != scene_reference(after), static_cast<bool>(key.reference)) << change.key;
  }
}

TEST(SceneKeys, ThatChangeAReferencePictureChangeTheNameOfItsCache) {
  const AmrHierarchy hierarchy = mesh();
  HierarchyReference reference(hierarchy, 0, {Filter::linear_vertex});
  int changed = 0;
  for (const Change& change : changes()) {
    const auto [before, after] = before_and_after(change);
    const Picture first = reference.render(before, 0.5), second = reference.render(after, 0.5);
    if (first.values == second.values) continue;
    ++changed;
    EXPECT_NE(configuration_hash(scene_reference(before)), configuration_hash(scene_reference(after))) << change.key;
  }
  EXPECT_GE(changed, 15) << "the changes are seen at all";
}

TEST(SceneKeys, ThatRecordsHoldAreColumns) {
  // else rows that differ in such a key alone read alike
  std::vector<std::string> without;
  for (const Key* key : scene_settings().keys())
    if (key->recorded != Recorded::never && key->column.label.empty()) without.push_back(key->name);
  EXPECT_THAT(without, testing::UnorderedElementsAre("width", "height")) << "the column `picture` has both";
}

TEST(SceneKeys, OfViewAndTransferFunctionNameAReferenceToo) {
  const Scene scene = small_scene(Mode::dvr);
  Scene other = scene;
  other.view.fov_y = 40;
  EXPECT_NE(scene_reference(scene), scene_reference(other));
  other = scene;
  other.transfer_function.extinction[1].extinction = 11;
  EXPECT_NE(scene_reference(scene), scene_reference(other));
  other.settings.mode = Mode::mip;
  Scene mip = scene;
  mip.settings.mode = Mode::mip;
  EXPECT_EQ(scene_reference(mip), scene_reference(other)) << "mip has no transfer function";
}

TEST(SceneKeys, ThatAreAddedLaterRenameNoRecordAndNoReference) {
  std::vector<Setting<Scene>> rows(scene_settings().rows().begin(), scene_settings().rows().end());
  rows.push_back(
      {{.name = "later", .type = integer_type(1, 100000), .reference = AffectsReference::yes, .help = "a key of tomorrow"},
       [](const Scene& s) -> Json { return s.settings.width == 9 ? 2 : 1; },
       [](Scene&, const Json&) {}});
  const SettingTable<Scene> later("render", rows);
  Scene scene = small_scene(Mode::dvr);
  EXPECT_EQ(configuration_hash(scene_configuration(scene, later)), configuration_hash(scene_configuration(scene)));
  EXPECT_EQ(configuration_hash(scene_reference(scene, later)), configuration_hash(scene_reference(scene)));
  EXPECT_EQ(later.record(scene)["later"], 1);
  scene.settings.width = 9;
  EXPECT_NE(configuration_hash(scene_configuration(scene, later)), configuration_hash(scene_configuration(scene)));
  EXPECT_NE(configuration_hash(scene_reference(scene, later)), configuration_hash(scene_reference(scene)));
}

TEST(SceneKeys, ThatMeanNothingInAModeTellNoTwoScenesApart) {
  Scene scene = small_scene(Mode::mip), other = scene;
  other.settings.isosurfaces.values = {1, 2};
  other.settings.early_end = 0.5;
  other.settings.tolerance = 0.5;
  EXPECT_EQ(scene_configuration(scene), scene_configuration(other));
  scene_settings().reset_idle(other);
  EXPECT_FALSE(other.settings.early_end);
  EXPECT_TRUE(other.settings.isosurfaces.values.empty());
}

// --- what is refused ---

std::string complaint_of(const Scene& scene) {
  try {
    validate(scene);
  } catch (const UsageError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(SceneChecks, NameTheKeyWhatItGoesWithAndWhy) {
  Scene scene = small_scene(Mode::projection);
  scene.settings.point_light.emplace();
  EXPECT_EQ(complaint_of(scene), "'point_light': it lights a volume: it accepts the modes dvr and dvr_iso, not projection");
  scene = small_scene(Mode::dvr);
  scene.settings.integrator = Integrator::tolerance;
  scene.settings.sampling = Sampling::lattice;
  EXPECT_EQ(complaint_of(scene), "'integrator': it chooses its intervals itself: it accepts the sampling adaptive, not lattice");
  scene.settings.integrator = Integrator::euler;
  EXPECT_EQ(complaint_of(scene), "accepted");
  scene = small_scene(Mode::iso);
  scene.settings.isosurfaces.values.clear();
  EXPECT_THAT(complaint_of(scene), StartsWith("'isovalues': 'isovalues' is missing; accepted: a list of field values"));
}

TEST(SceneChecks, ConsumersRefuseWhatTheRowsSay) {
  Scene scene = small_scene(Mode::dvr);
  scene.settings.consumer = ConsumerKind::slices;
  EXPECT_NO_THROW(require_consumer(scene));
  scene.settings.ray_offset = 1;
  try {
    require_consumer(scene);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(),
                AllOf(StartsWith("consumer slices: 'ray_offset' is not available"), HasSubstr("raycast and multipass")));
  }
}

// --- text ---

TEST(SettingsText, ListsEveryKeyForPeopleAndPrograms) {
  const std::string text = settings_text();
  const Json json = settings_json();
  std::size_t keys = 0;
  for (const Section& section : all_sections()) keys += section.keys.size();
  EXPECT_EQ(json.size(), keys);
  for (const Json& row : json) {
    if (row["section"] == "generate") continue;  // docs/generate.md has these
    EXPECT_THAT(text, HasSubstr("\n  " + row["key"].get<std::string>() + " "));
    for (const char* key : {"type", "accepted", "default", "reference", "axis_depth", "takes", "help"})
      EXPECT_TRUE(row.contains(key));
  }
}

TEST(SettingsText, TablesOfTheDocumentationAreThoseOfTheRows) {
  std::ifstream file(AMRTEX_SOURCE_DIR "/docs/experiments.md");
  std::ostringstream text;
  text << file.rdbuf();
  for (const char* section :
       {"top", "datasets", "encodings", "parameters", "render", "views", "orbit", "transfer_function", "reference"})
    EXPECT_THAT(text.str(), HasSubstr(fmt::format("<!-- settings:{} -->", section)));
  EXPECT_TRUE(with_settings(text.str()) == text.str()) << "run `amrtex settings --write docs/experiments.md`";
}

TEST(SettingsText, TablesOfFiguresAreThoseOfTheRows) {
  std::ifstream file(AMRTEX_SOURCE_DIR "/docs/figures.md");
  std::ostringstream text;
  text << file.rdbuf();
  for (const char* section : {"figure", "panels", "overlays", "rays", "insets"})
    EXPECT_THAT(text.str(), HasSubstr(fmt::format("<!-- settings:{} -->", section)));
  EXPECT_TRUE(with_settings(text.str()) == text.str()) << "run `amrtex settings --write docs/figures.md`";
}

TEST(SettingsText, BuildParametersOfAllEncodingsStandInTheirTable) {
  const std::string table = settings_markdown("parameters");
  for (const Encoding* e : all_encodings())
    for (const ParameterInfo& p : e->parameters())
      EXPECT_THAT(table, HasSubstr(fmt::format("| `{}` | `{}` |", e->name(), p.name)));
}

TEST(SettingsText, ReplacesWhatStandsBetweenMarkersAndNothingElse) {
  const std::string text = with_settings("a\n<!-- settings:reference -->\nold\n<!-- /settings:reference -->\nb\n");
  EXPECT_THAT(text, AllOf(StartsWith("a\n<!-- settings:reference -->\n| key |"), HasSubstr("\n<!-- /settings:reference -->\nb\n"),
                          Not(HasSubstr("old"))));
  EXPECT_EQ(with_settings("no marker\n"), "no marker\n");
  EXPECT_THROW(with_settings("<!-- settings:reference -->\n"), UsageError);
  EXPECT_THROW(with_settings("<!-- settings:refrence -->\n<!-- /settings:refrence -->\n"), UsageError);
}

// --- values of the command line ---

constexpr const char* kFile = R"({
  "name": "small",
  "datasets": {"generate": {"field": "blobs_shell", "levels": 2}},
  "encodings": [{"name": "uniform"}, {"name": "page_table"}, {"name": "page_table", "page_size": 32}],
  "render": {"mode": "dvr", "step": 2},
  "views": [{"eye": [3, 0, 0], "at": [0, 0, 0]}, {"eye": [0, 3, 0], "at": [0, 0, 0]}],
  "transfer_function": {"extinction": [[0, 0], [1, 5]], "color": [[0, 1, 1, 1]]}
})";

Experiment with(std::vector<std::string> set) { return parse_experiment(kFile, "e.json", {.set = std::move(set)}); }

std::string complaint(std::vector<std::string> set) {
  try {
    with(std::move(set));
  } catch (const UsageError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(SetOption, ReplacesAndAddsValues) {
  EXPECT_EQ(with({"render.step=0.5"}).renders[0].settings.step, 0.5);
  EXPECT_EQ(with({"step=0.5"}).renders[0].settings.step, 0.5) << "a key of `render` may stand alone";
  EXPECT_EQ(with({"step=[1, 0.5]"}).renders.size(), 4u) << "a list is an axis";
  EXPECT_EQ(with({"mode=mip"}).renders[0].settings.mode, Mode::mip) << "text needs no quotes";
  EXPECT_EQ(with({"seed=7", "seed=8"}).seed, 8u) << "the last one holds";
  EXPECT_EQ(with({"reference.step=0.5"}).reference->step, 0.5) << "an object that the file does not have";
  EXPECT_EQ(with({"reference.tolerance=1e-9"}).reference->tolerance, 1e-9);
  EXPECT_FALSE(with({"reference=null"}).reference);
  EXPECT_EQ(with({"ambient_occlusion.radius=0.25", "mode=iso", "isovalues=[1]"})
                .renders[0]
                .settings.isosurfaces.ambient_occlusion->radius,
            0.25);
}

TEST(SetOption, OfAListOfObjectsMeansEachOrTheOneThatItNames) {
  for (const RenderPoint& render : with({"fov_y=20"}).renders) EXPECT_EQ(render.view.fov_y, 20);
  const Experiment one = with({"views[1].fov_y=20"});
  EXPECT_EQ(one.renders[0].view.fov_y, View{}.fov_y);
  EXPECT_EQ(one.renders[1].view.fov_y, 20);
  const Experiment paged = with({"page_size=8"});
  ASSERT_EQ(paged.builds.size(), 2u) << "both page tables are alike now; uniform has no pages";
  EXPECT_EQ(paged.builds[1].parameters["page_size"], 8);
}

TEST(SetOption, IsRefusedByItsOwnName) {
  EXPECT_THAT(complaint({"render.step=0"}), StartsWith("--set render.step=0: render.step: a number above 0"));
  EXPECT_THAT(complaint({"render.stpe=1"}),
              AllOf(StartsWith("--set render.stpe=1: render.stpe: unknown key"), HasSubstr("'step'?")));
  EXPECT_THAT(complaint({"stpe=1"}), AllOf(StartsWith("--set stpe=1: no key 'stpe'"), HasSubstr("did you mean 'step'?")));
  EXPECT_THAT(complaint({"step"}), AllOf(StartsWith("--set step:"), HasSubstr("key=value")));
  EXPECT_THAT(complaint({"at=[1,2,3]"}), AllOf(HasSubstr("several objects"), HasSubstr("views.at"), HasSubstr("orbit.at")));
  EXPECT_THAT(complaint({"views[2].fov_y=20"}), AllOf(StartsWith("--set views[2].fov_y=20"), HasSubstr("no element [2]")));
  EXPECT_THAT(complaint({"storage_kind=pool"}), HasSubstr("no encoding of this file has the parameter 'storage_kind'"));
  EXPECT_THAT(complaint({"name.x=1"}), AllOf(StartsWith("--set"), HasSubstr("'x' has no place")));
}

// --- how many points ---

TEST(PointCount, IsSaidBeforeAnyPointIsMade) {
  Json json = Json::parse(kFile);
  json["render"]["step"] = Json::array();
  for (const char* key : {"width", "height", "step", "early_end", "iso_tolerance", "level_of_detail"})
    for (int i = 1; i <= 30; ++i) json["render"][key].push_back(i / 32.0);
  const auto refusal = [&](const ReadOptions& options) {
    try {
      parse_experiment(json.dump(), "e.json", options);
    } catch (const UsageError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  // 3 builds with 2 views and 30^6 settings
  EXPECT_THAT(refusal({}), AllOf(StartsWith("e.json:1: 4374000000 points, 3 builds with 1458000000 pictures each"),
                                 HasSubstr("at most 1000000"), HasSubstr("--max-points")));
  json["render"] = {{"step", {1, 2}}};
  EXPECT_EQ(refusal({.most_points = 12}), "accepted");
  EXPECT_THAT(refusal({.most_points = 11}), StartsWith("e.json:1: 12 points"));
}

/// 2 kB that stand for a billion settings; optional data.
TEST(PointCount, OfASmallFileMayBeLarge) {
  AMRTEX_NEEDS(test::kFailingInputs, "explode.json");
  try {
    read_experiment(test::kFailingInputs / "explode.json");
    ADD_FAILURE();
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), HasSubstr("8748000006 points, 6 builds with 1458000001 pictures each"));
  }
}

TEST(PointCount, CountsOrbitsListsOfObjectsAndFrames) {
  Json json = Json::parse(kFile);
  json["views"] = Json::parse(
      R"([{"orbit": {"at": [0, 0, 0], "radius": 2, "count": 5}, "fov_y": [20, 30]}, {"eye": [3, 0, 0], "at": [0, 0, 0]}])");
  json["frames"] = {1, 2};
  json["filters"] = {"nearest", "linear_vertex"};
  json["encodings"][0]["filters"] = {"nearest"};
  json["datasets"]["generate"]["root"] = {8, 8, 8};
  json["datasets"]["generate"]["levels"] = {2, 3};
  // (1 + 2 + 2) structures of 2 meshes; (5 x 2 + 1) views with 2 numbers of frames
  const auto points = parse_experiment(json.dump(), "e.json", {.most_points = 220}).points();
  EXPECT_EQ(points, 220u);
  EXPECT_THROW(parse_experiment(json.dump(), "e.json", {.most_points = 219}), UsageError);
}

}  // namespace
}  // namespace amrtex
