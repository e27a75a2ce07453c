#include "bench/settings/experiment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <set>

#include "bench/measure/scene_data.hpp"
#include "bench/records/record.hpp"
#include "bench/settings/json_file.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/suggestion.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kSmall = R"({
  "name": "small",
  "datasets": [{"generate": {"field": "blobs_shell", "levels": 2}}],
  "encodings": [{"name": "uniform"}],
  "filters": ["nearest"],
  "render": {"mode": "dvr", "step": 1},
  "views": [{"eye": [3, 0, 0], "at": [0, 0, 0], "up": [0, 0, 1], "fov_y": 35}],
  "transfer_function": {"extinction": [[0, 0], [1, 5]], "color": [[0, 1, 1, 1]]}
})";

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// kSmall with one key replaced, or added.
std::string with(const std::string& key, const std::string& value) {
  Json json = Json::parse(kSmall);
  json[key] = Json::parse(value);
  return json.dump(1);
}

std::string without(const std::string& key) {
  Json json = Json::parse(kSmall);
  json.erase(key);
  return json.dump(1);
}

Experiment parsed(const std::string& text) { return parse_experiment(text, "folder/e.json"); }

std::string complaint(const std::string& text) {
  try {
    parsed(text);
  } catch (const UsageError& e) {
    return e.what();
  }
  return "accepted";
}

std::string scene_complaint(const std::string& text) {
  try {
    parse_scene(text, "s.json");
  } catch (const UsageError& e) {
    return e.what();
  }
  return "accepted";
}

/// "encoding page_size filter filtering storage" of every build, to read in one glance.
std::vector<std::string> build_texts(const Experiment& experiment) {
  std::vector<std::string> texts;
  for (const BuildPoint& b : experiment.builds) {
    const std::string size = b.parameters.contains("page_size") ? b.parameters["page_size"].dump() : "-";
    texts.push_back(fmt::format("{} {} {} {} {}", b.encoding, size, filter_name(b.filter), filtering_name(b.filtering),
                                format_name(b.storage)));
  }
  return texts;
}

// --- what is accepted ---

TEST(Experiment, OfOnePointHasTheDefaultsOfTheDocumentation) {
  const Experiment e = parsed(kSmall);
  EXPECT_EQ(e.name, "small");
  ASSERT_EQ(e.points(), 1u);
  EXPECT_EQ(e.datasets[0].name, "blobs_shell");
  EXPECT_EQ(e.datasets[0].generate["levels"], 2);
  EXPECT_EQ(e.renders[0].frames, 9);
  EXPECT_EQ(e.renders[0].warm_up, 2);
  EXPECT_EQ(e.renders[0].settings.consumer, ConsumerKind::raycast);
  EXPECT_EQ(e.renders[0].settings.width, 512);
  EXPECT_TRUE(e.renders[0].settings.skip);
  EXPECT_FALSE(e.renders[0].settings.early_end);
  EXPECT_EQ(e.seed, 1u);
  EXPECT_EQ(e.context, "egl");
  ASSERT_TRUE(e.reference);
  EXPECT_FALSE(e.reference->step);
  EXPECT_EQ(e.reference->tolerance, 1e-7);
  EXPECT_EQ(e.reference->common_filter, Filter::linear_vertex);
  EXPECT_FALSE(e.memory_limit);
  EXPECT_FALSE(e.minimum_psnr_db);
  EXPECT_TRUE(e.axes.empty());
}

TEST(Experiment, EveryEncodingHasItsOwnBuildAxes) {
  const Experiment e = parsed(with("encodings", R"([{"name": "uniform"}, {"name": "page_table", "page_size": [4, 8]}])"));
  EXPECT_THAT(build_texts(e), ElementsAre("uniform - nearest manual r32f", "page_table 4 nearest manual r32f",
                                          "page_table 8 nearest manual r32f"));
  EXPECT_THAT(e.axes, ElementsAre("encodings", "encodings[1].page_size"));
}

TEST(Experiment, AValueAndAListOfOneAreTheSame) {
  Json json = Json::parse(with("encodings", R"({"name": "page_table", "page_size": 4})"));
  json["filters"] = "nearest";
  json["datasets"] = json["datasets"][0];
  json["views"] = json["views"][0];
  EXPECT_THAT(build_texts(parsed(json.dump())), ElementsAre("page_table 4 nearest manual r32f"));
}

TEST(Experiment, NearestIgnoresFilteringAndIsNotBuiltTwice) {
  Json json = Json::parse(with("filters", R"(["nearest", "linear_page"])"));
  json["filtering"] = {"hardware", "manual"};
  EXPECT_THAT(
      build_texts(parsed(json.dump())),
      ElementsAre("uniform - nearest manual r32f", "uniform - linear_page hardware r32f", "uniform - linear_page manual r32f"));
}

TEST(Experiment, ADefaultGivenByNameIsNotBuiltTwice) {
  const Experiment e = parsed(with("encodings", R"([{"name": "page_table"}, {"name": "page_table", "page_size": [16, 32]}])"));
  EXPECT_EQ(e.builds.size(), 2u);
}

TEST(Experiment, AFilterThatAnEncodingLacksIsAPointAndNoMistake) {
  EXPECT_EQ(parsed(with("filters", R"(["basis"])")).points(), 1u);
}

TEST(Experiment, RenderAxesViewsAndTransferFunctionsMultiply) {
  Json json = Json::parse(with("render", R"({"mode": ["dvr"], "sampling": ["lattice", "adaptive"], "step": [1, 0.5, 0.25]})"));
  json["views"].push_back(json["views"][0]);
  json["views"][1]["eye"] = {0, 3, 0};
  json["views"][1]["name"] = "side";
  const Json first = json["transfer_function"];
  json["transfer_function"] = Json::array({first, first});
  json["transfer_function"][1]["extinction"] = Json::parse("[[0, 0], [1, 9]]");
  json["transfer_function"][0]["name"] = "thin";
  json["transfer_function"][1]["name"] = "dense";
  const Experiment e = parsed(json.dump());
  ASSERT_EQ(e.renders.size(), 24u);
  EXPECT_EQ(e.renders[0].view_name, "view 1");
  EXPECT_EQ(e.renders[23].view_name, "side");
  EXPECT_EQ(e.renders[0].transfer_function_name, "thin");
  EXPECT_EQ(e.renders[6].transfer_function_name, "dense");
  EXPECT_EQ(e.renders[6].transfer_function.extinction[1].extinction, 9);
  EXPECT_EQ(e.renders[2].settings.step, 0.25);
  EXPECT_EQ(e.renders[3].settings.sampling, Sampling::adaptive);
}

TEST(Experiment, ConsumersAreAnAxisAndOnlySlicesHaveATarget) {
  const Experiment e = parsed(with("render", R"({"mode": "projection",
      "consumer": ["raycast", "multipass", "slices", "stencil_slices"], "slice_target": ["rgba32f", "rgba8"]})"));
  std::vector<std::string> points;
  for (const RenderPoint& r : e.renders) {
    const Json json = render_json(r);
    points.push_back(json["consumer"].get<std::string>() + " " + json.value("slice_target", "-"));
  }
  EXPECT_THAT(points, ElementsAre("raycast -", "multipass -", "slices rgba32f", "slices rgba8", "stencil_slices rgba32f",
                                  "stencil_slices rgba8"));
}

TEST(Experiment, AToleranceStandsForTheIntegratorThatKnowsItAndHasNoStep) {
  const auto renders = [](const char* render) { return parsed(with("render", render)).renders; };
  EXPECT_EQ(renders("{}")[0].settings.integrator, Integrator::exponential_midpoint);
  EXPECT_EQ(renders(R"({"integrator": "midpoint"})")[0].settings.integrator, Integrator::exponential_midpoint);
  const auto asked = renders(R"({"tolerance": [1e-2, 1e-3], "step": [1, 0.5]})");
  ASSERT_EQ(asked.size(), 2u);
  EXPECT_EQ(asked[1].settings.integrator, Integrator::tolerance);
  EXPECT_EQ(asked[1].settings.tolerance, 1e-3);
  EXPECT_EQ(render_json(asked[1])["tolerance"], 1e-3);
  EXPECT_TRUE(render_json(asked[1])["step"].is_null());
  // the others have no tolerance: 2 steps and 2 tolerances, not 4 and 4
  const auto both = renders(R"({"integrator": ["euler", "tolerance"], "tolerance": [1e-2, 1e-3], "step": [1, 0.5]})");
  ASSERT_EQ(both.size(), 4u);
  EXPECT_EQ(render_json(both[0])["integrator"], "euler");
  EXPECT_FALSE(render_json(both[0]).contains("tolerance"));
}

TEST(Experiment, ValuesThatAreListsBecomeAxesAsListsOfLists) {
  Json json = Json::parse(kSmall);
  json["views"][0]["eye"] = Json::parse("[[3, 0, 0], [0, 3, 0]]");
  json["transfer_function"]["extinction"] = Json::parse("[[[0, 0], [1, 5]], [[0, 0], [1, 6]], [[0, 0], [1, 7]]]");
  const Experiment e = parsed(json.dump());
  ASSERT_EQ(e.renders.size(), 6u);
  EXPECT_EQ(e.renders[0].view_name, "view 1.1");
  EXPECT_EQ(e.renders[5].view.eye, Vec3d(0, 3, 0));
  EXPECT_EQ(e.renders[5].transfer_function.extinction[1].extinction, 7);
}

TEST(Experiment, AnOrbitStandsForItsViews) {
  // four views at a quarter of a turn from one another, from 30 degrees below to 60 above: at radius 2 the eye of view k lies
  // 2 cos(e) from the axis and 2 sin(e) above `at`, e = -30 + 30 k degrees
  const Experiment e = parsed(
      with("views",
           R"([{"name": "round", "fov_y": 20, "orbit": {"at": [1, 2, 3], "radius": 2, "count": 4, "elevation": [-30, 60]}}])"));
  ASSERT_EQ(e.renders.size(), 4u);
  const double half = std::sqrt(0.75);
  const std::vector<Vec3d> offsets = {{2 * half, 0, -1}, {0, 2, 0}, {-2 * half, 0, 1}, {0, -1, 2 * half}};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(e.renders[i].view_name, fmt::format("round_0{}", i));
    EXPECT_LT(glm::length(e.renders[i].view.eye - Vec3d(1, 2, 3) - offsets[i]), 1e-12) << i;
    EXPECT_EQ(e.renders[i].view.at, Vec3d(1, 2, 3));
    EXPECT_EQ(e.renders[i].view.up, Vec3d(0, 0, 1));
    EXPECT_EQ(e.renders[i].view.fov_y, 20);
  }
  EXPECT_THAT(e.axes, testing::Contains("views[0].orbit"));
}

TEST(Experiment, AnOrbitAroundAnyAxisStaysAcrossItAtItsRadius) {
  const Experiment e = parsed(with(
      "views",
      R"([{"orbit": {"at": [0, 0, 0], "radius": 3, "count": 120, "axis": [1, 2, -2]}}, {"eye": [3, 0, 0], "at": [0, 0, 0]}])"));
  ASSERT_EQ(e.renders.size(), 121u);
  EXPECT_EQ(e.renders[7].view_name, "view 1_007");
  EXPECT_EQ(e.renders[120].view_name, "view 2");
  Vec3d sum(0);
  for (std::size_t i = 0; i < 120; ++i) {
    const Vec3d eye = e.renders[i].view.eye;
    EXPECT_NEAR(glm::length(eye), 3, 1e-12);
    EXPECT_NEAR(glm::dot(eye, Vec3d(1, 2, -2)), 0, 1e-12);
    sum += eye;
  }
  EXPECT_LT(glm::length(sum), 1e-10) << "equal angles all around";
}

TEST(Experiment, ModesWithoutColourHaveNoTransferFunctionAndAreNotRepeatedForEach) {
  Json json = Json::parse(with("render", R"({"mode": ["dvr", "projection"], "early_end": 0.99})"));
  const Json first = json["transfer_function"];
  json["transfer_function"] = Json::array({first, first});
  json["transfer_function"][1]["extinction"] = Json::parse("[[0, 0], [1, 9]]");
  const Experiment e = parsed(json.dump());
  ASSERT_EQ(e.renders.size(), 3u);
  EXPECT_EQ(e.renders[0].settings.early_end, 0.99);
  EXPECT_EQ(e.renders[1].settings.mode, Mode::projection);
  EXPECT_FALSE(e.renders[1].settings.early_end);
  EXPECT_TRUE(e.renders[1].transfer_function.extinction.empty());
  EXPECT_TRUE(render_json(e.renders[1])["transfer_function"].is_null());
}

TEST(Experiment, ATransferFunctionIsOnlyNeededForColour) {
  Json json = Json::parse(without("transfer_function"));
  json["render"] = {{"mode", "mip"}};
  EXPECT_EQ(parsed(json.dump()).points(), 1u);
}

TEST(Experiment, GeneratorAxesMakeDataSetsAndItsListsStayLists) {
  const Experiment e =
      parsed(with("datasets", R"([{"generate": {"field": "shell", "levels": [3, 4], "root": [32, 32, 64], "ratio": [2, 4]}}])"));
  ASSERT_EQ(e.datasets.size(), 2u);
  EXPECT_EQ(e.datasets[0].name, "shell levels=3");
  EXPECT_EQ(e.datasets[1].name, "shell levels=4");
  EXPECT_EQ(e.datasets[1].generate["levels"], 4);
  EXPECT_EQ(e.datasets[1].generate["root"], Json::parse("[32, 32, 64]"));
  EXPECT_EQ(e.builds[1].dataset, 1u);
  EXPECT_EQ(parsed(with("datasets", R"({"name": "deep", "generate": {"levels": [3, 4]}})")).datasets[1].name, "deep levels=4");
}

TEST(Experiment, FramesMayBeAnAxis) {
  const Experiment e = parsed(with("frames", "[3, 9]"));
  ASSERT_EQ(e.renders.size(), 2u);
  EXPECT_EQ(e.renders[1].frames, 9);
}

TEST(Experiment, ReferenceMayBeOwnOrNoneAtAll) {
  EXPECT_FALSE(parsed(with("reference", "null")).reference);
  const Experiment own = parsed(with("reference", R"({"step": 0.25, "filter": "own"})"));
  EXPECT_EQ(own.reference->step, 0.25);
  EXPECT_FALSE(own.reference->common_filter);
  EXPECT_EQ(parsed(with("reference", R"({"filter": "basis"})")).reference->common_filter, Filter::basis);
  EXPECT_TRUE(own.reference->own);
  EXPECT_FALSE(parsed(with("reference", R"({"own": false})")).reference->own);
}

TEST(Experiment, KnowsItsLimits) {
  Json json = Json::parse(kSmall);
  json["memory_limit"] = 1000000;
  json["check"] = {{"psnr_db", 30}};
  json["context"] = "osmesa";
  json["seed"] = 7;
  const Experiment e = parsed(json.dump());
  EXPECT_EQ(e.memory_limit, 1000000);
  EXPECT_EQ(e.minimum_psnr_db, 30);
  EXPECT_FALSE(e.unchecked_because);
  EXPECT_EQ(parsed(with("check", R"({"psnr_db": 20, "why": "a sketch"})")).check_why, "a sketch");
  EXPECT_EQ(parsed(with("check", R"({"off": "a control"})")).unchecked_because, "a control");
  EXPECT_EQ(e.context, "osmesa");
  EXPECT_EQ(e.seed, 7u);
  EXPECT_FALSE(e.baseline);
  EXPECT_TRUE(parsed(with("baseline", "true")).baseline);
}

// --- data paths ---

class DataPaths : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("amrtex_experiment_{}", ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "plt00010");
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(DataPaths, AreLookedForBesideTheFileAndThenInTheCurrentFolder) {
  const std::string text = with("datasets", R"([{"file": "plt00010/", "field": ["rho", "p"]}])");
  const Experiment beside = parse_experiment(text, folder_ / "e.json");
  ASSERT_EQ(beside.datasets.size(), 2u);
  EXPECT_EQ(*beside.datasets[0].file, folder_ / "plt00010/");
  EXPECT_EQ(beside.datasets[0].name, "plt00010");
  EXPECT_EQ(beside.datasets[1].field, "p");
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  const Experiment current = parse_experiment(text, "elsewhere/e.json");
  fs::current_path(before);
  EXPECT_EQ(*current.datasets[0].file, "plt00010/");
}

TEST_F(DataPaths, NameBothPlacesWhereNothingWasFound) {
  try {
    parse_experiment(with("datasets", R"([{"file": "plt00011"}])"), folder_ / "e.json");
    FAIL() << "a missing file was accepted";
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("datasets[0].file"), HasSubstr((folder_ / "plt00011").string()),
                                HasSubstr((fs::current_path() / "plt00011").string())));
  }
}

TEST_F(DataPaths, AnExperimentThatIsNotThereIsAnError) {
  EXPECT_THROW(read_experiment(folder_ / "none.json"), Error);
  EXPECT_THROW(read_experiment(folder_), Error);
}

// --- what is refused ---

TEST(ExperimentErrors, SyntaxErrorsNameLineAndColumn) {
  EXPECT_THAT(complaint("{\n  \"name\": \"x\",\n  \"seed\": 1,,\n}"), StartsWith("folder/e.json:3:13: not valid JSON"));
  EXPECT_THAT(complaint("{\"name\": \"x\""), StartsWith("folder/e.json:1:"));
  EXPECT_THAT(complaint(""), StartsWith("folder/e.json:1:1: not valid JSON"));
  EXPECT_THAT(complaint(std::string(100000, '[') + std::string(100000, ']')), HasSubstr("nested more than"));
  EXPECT_THAT(complaint("{\"seed\": 1e999}"), StartsWith("folder/e.json"));
}

TEST(ExperimentErrors, AKeyThatIsGivenTwiceIsNamedWithItsLine) {
  EXPECT_THAT(complaint("{\n\"name\": \"x\",\n\"views\": [{\"eye\": 1,\n\"eye\": 2}]\n}"),
              StartsWith("folder/e.json:4: views[0].eye: this key is given twice"));
}

TEST(ExperimentErrors, NameTheLineOfTheKey) {
  const std::string text =
      "{\n  \"name\": \"x\",\n  \"datasets\": [{\"generate\": {}}],\n  \"encodings\": [\n    {\"name\": \"uniform\"},\n"
      "    {\"name\": \"page_table\",\n     \"page_sizes\": [\"}\\\"\", 4]}\n  ]\n}";
  EXPECT_THAT(complaint(text),
              AllOf(StartsWith("folder/e.json:7: encodings[1].page_sizes"), HasSubstr("did you mean 'page_size'?")));
}

struct Mistake {
  const char* key;
  const char* value;
  const char* place;     ///< named in the message
  const char* accepted;  ///< likewise
};

TEST(ExperimentErrors, NameKeyAndWhatIsAccepted) {
  const Mistake mistakes[] = {
      {"datset", "[]", "datset: unknown key", "did you mean 'datasets'?"},
      {"region", "[[0,0,0],[1,1,1]]", "region: unknown key", "accepted: name, datasets"},
      {"name", "3", "name:", "a string"},
      {"name", "\"\"", "name:", "empty"},
      {"datasets", "[]", "datasets:", "empty list"},
      {"datasets", "[{}]", "datasets[0]:", "'file' and 'generate'"},
      {"datasets", R"([{"file": "x", "generate": {}}])", "datasets[0]:", "'file' and 'generate'"},
      {"datasets", R"([{"file": "no such file"}])", "datasets[0].file:", "no such file or directory"},
      {"datasets", R"([{"generate": {}, "field": "x"}])", "datasets[0].field:", "generate"},
      {"datasets", R"(["x"])", "datasets[0]:", "an object"},
      {"datasets", R"([{"files": "x"}])", "datasets[0].files:", "did you mean 'file'?"},
      {"encodings", R"([{"name": "unifrom"}])", "encodings[0].name:", "uniform"},
      {"encodings", R"([{"page_size": 4}])", "encodings[0]:", "'name' is missing"},
      {"encodings", R"(["uniform"])", "encodings[0]:", "an object"},
      {"encodings", R"([{"name": "page_table", "page_size": []}])", "encodings[0].page_size:", "empty list"},
      {"filters", R"(["nearest", "cubic"])", "filters[1]:", "linear_vertex"},
      {"storage", R"("r64f")", "storage:", "r16f"},
      {"filtering", R"(["soft"])", "filtering[0]:", "hardware, manual"},
      {"render", R"({"mode": "surface"})", "render.mode:", "dvr, projection, mip, iso, dvr_iso"},
      {"render", R"({"mode": "iso"})", "render.mode:", "'isovalues' is missing"},
      {"render", R"({"mode": "iso", "isovalues": [1, 0.5]})", "render.isovalues:", "ascend"},
      {"render", R"({"mode": "iso", "isovalues": ["x"]})", "render.isovalues[0]:", "number"},
      {"render", R"({"mode": "iso", "isovalues": [1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17]})",
       "render.isovalues:", "17 values; at most 16"},
      {"render", R"({"mode": "iso", "isovalues": [1, 2], "iso_opacity": [0.1, 0.2, 0.3]})", "render.iso_opacity:", "one a value"},
      {"render", R"({"mode": "iso", "isovalues": [1], "iso_opacity": 0})", "render.iso_opacity:", "(0, 1]"},
      {"render", R"({"mode": "iso", "isovalues": [1], "surface_color": [[0, 1, 1]]})",
       "render.surface_color[0]:", "[value, r, g, b]"},
      {"render", R"({"mode": "iso", "isovalues": [1], "surface_color": [[0, 1, 1, 2]]})",
       "render.surface_color:", "between 0 and 1"},
      {"render", R"({"mode": "iso", "isovalues": [1], "iso_tolerance": 2})", "render.iso_tolerance:", "(0, 1]"},
      {"render", R"({"mode": "iso", "isovalues": [1], "shading": "phong"})", "render.shading:", "none, gradient"},
      {"render", R"({"mode": "iso", "isovalues": [1], "output": "position"})", "render.output:", "color, depth, normal"},
      {"render", R"({"sampling": ["lattice", 3]})", "render.sampling[1]:", "a string"},
      {"render", R"({"sampling": "random"})", "render.sampling:", "lattice"},
      {"render", R"({"step": [1, 0]})", "render.step[1]:", "above 0"},
      {"render", R"({"step": "1"})", "render.step:", "above 0"},
      {"render", R"({"width": 0})", "render.width:", "from 1 to 16384"},
      {"render", R"({"height": 1.5})", "render.height:", "an integer"},
      {"render", R"({"height": 18446744073709551615})", "render.height:", "an integer"},
      {"render", R"({"skip": 1})", "render.skip:", "true or false"},
      {"render", R"({"early_end": 2})", "render.early_end:", "from 0 to 1"},
      {"render", R"({"consumer": "splats"})", "render.consumer:", "raycast, multipass, slices, stencil_slices"},
      {"render", R"({"consumer": "slices", "slice_target": "rgba16f"})", "render.slice_target:", "rgba32f, rgba8"},
      {"render", R"({"point_light": [1, 2]})", "render.point_light:", "three numbers [x, y, z]"},
      {"render", R"({"point_light": 5})", "render.point_light:", "three numbers [x, y, z]"},
      {"render", R"({"point_light": [1, 2, "x"]})", "render.point_light[2]:", "number"},
      {"render", R"({"point_light": [1, 2, 3], "ambient": 1.5})", "render.ambient:", "from 0 to 1"},
      {"render", R"({"point_light": [1, 2, 3], "shadow_step": 0})", "render.shadow_step:", "above 0"},
      {"render", R"({"ambient": 0.5})", "render.ambient:", "'point_light'"},
      {"render", R"({"shadow_step": 2})", "render.shadow_step:", "'point_light'"},
      {"render", R"({"integrator": "euler", "point_light": [1, 2, 3]})", "render.point_light:", "not euler"},
      {"render", R"({"mode": "mip", "point_light": [1, 2, 3]})", "render.point_light:", "dvr and dvr_iso"},
      {"render", R"({"mode": "iso", "isovalues": [1], "point_light": [1, 2, 3]})", "render.point_light:", "not iso"},
      {"render", R"({"integrator": "simpson"})", "render.integrator:", "midpoint), euler, left, preintegrated, tolerance"},
      {"render", R"({"mode": ["dvr", "projection"], "integrator": "euler"})", "render.integrator:", "accepts the mode dvr"},
      {"render", R"({"mode": "mip", "integrator": "preintegrated"})", "render.integrator:", "accepts the mode dvr"},
      {"render", R"({"mode": "projection", "tolerance": 0.1})", "render.tolerance:", "accepts the mode dvr"},
      {"render", R"({"mode": "dvr_iso", "isovalues": [1], "integrator": "left"})", "render.integrator:", "accepts the mode dvr"},
      {"render", R"({"sampling": "lattice", "integrator": "tolerance"})", "render.integrator:", "the sampling adaptive"},
      {"render", R"({"sampling": "lattice", "tolerance": 0.001})", "render.tolerance:", "the sampling adaptive"},
      {"render", R"({"tolerance": 0})", "render.tolerance:", "above 0"},
      {"render", R"({"tolerance": [0.1, -0.1]})", "render.tolerance[1]:", "above 0"},
      {"render", R"({"tolerance": 2})", "render.tolerance:", "(0, 1]"},
      {"render", R"({"tolerance": "NaN"})", "render.tolerance:", "above 0"},
      {"render", R"({"level_of_detail": 0})", "render.level_of_detail:", "above 0"},
      {"render", R"({"level_of_detail": "pixel"})", "render.level_of_detail:", "above 0"},
      {"render", R"({"max_level": -1})", "render.max_level:", "from 0 to 63"},
      {"render", R"({"max_level": 1.5})", "render.max_level:", "an integer"},
      {"render", R"({"mode": "projection", "prune": true})", "render.prune: elsewhere", "the mode dvr, not projection"},
      {"render", R"({"prune": true, "max_level": 1})", "render.prune:", "max_level"},
      {"render", R"({"prune": true, "tolerance": 0.1})", "render.prune:", "euler and left, not tolerance"},
      {"render", R"({"prune": true, "needs": "all"})", "render.prune: 'needs' all keeps", "the needs scene, not all"},
      {"render", R"({"needs": "some"})", "render.needs", "scene, all"},
      {"render", R"({"mode": "iso", "isovalues": [1], "ambient_occlusion": {"rays": 4}})", "ambient_occlusion", "radius"},
      {"render", R"({"mode": "iso", "isovalues": [1], "ambient_occlusion": {"radius": 0}})",
       "ambient_occlusion.radius:", "above 0"},
      {"render", R"({"mode": "iso", "isovalues": [1], "ambient_occlusion": {"radius": 1, "rays": 0}})",
       "rays:", "from 1 to 1024"},
      {"render", R"({"mode": "iso", "isovalues": [1], "output": "depth", "ambient_occlusion": {"radius": 1}})",
       "render.ambient_occlusion:", "output color"},
      {"render", R"({"mirror": "x"})", "render.mirror:", "-x, +x"},
      {"render", R"({"mirror": "+x", "level_of_detail": 2})", "render.mirror:", "one of both"},
      {"render", R"({"mirror": "+x", "point_light": [0, 0, 0]})", "render.mirror:", "one of both"},
      {"render", R"({"triangles": "ball.obj"})", "render.triangles:", "an object"},
      {"render", R"({"triangles": {"color": [1, 1, 1]}})", "render.triangles", "'file' is missing"},
      {"render", R"({"triangles": {"file": "ball.obj", "colour": [1, 1, 1]}})", "render.triangles.colour:", "color"},
      {"render", R"({"triangles": [{"file": "folder/absent.obj"}]})", "render.triangles[0].file:", "no such file"},
      {"render", R"({"ray_offset": 3})", "render.ray_offset:", "true"},
      {"render", R"({"ray_offset": true, "integrator": "left"})", "render.ray_offset:", "exponential_midpoint and euler"},
      {"render", R"({"clip_planes": [[1, 0, 0]]})", "render.clip_planes[0]:", "[a, b, c, d]"},
      {"render", R"({"clip_planes": [1, 0, 0, 0]})", "render.clip_planes", "[a, b, c, d]"},
      {"render", R"({"clip_planes": [[1, 0, 0, 0], [0, 0, 0, 1]]})", "render.clip_planes: plane 1:", "no direction"},
      {"render", R"({"clip_planes": [[1, 0, "NaN", 0]]})", "render.clip_planes[0][2]:", "number"},
      {"render", R"({"widht": 4})", "render.widht:", "did you mean 'width'?"},
      {"views", "[]", "views:", "empty list"},
      {"views", R"([{"eye": [3, 0, 0], "at": [3, 0, 0]}])", "views[0].eye:", "differ"},
      {"views", R"([{"eye": [3, 0], "at": [0, 0, 0]}])", "views[0].eye:", "three numbers"},
      {"views", R"([{"eye": [3, 0, 0], "looking_at": [0, 0, 0]}])", "views[0]", "looking_at"},
      {"views", R"([{"orbit": 3}])", "views[0].orbit:", "at, radius, count, axis, elevation"},
      {"views", R"([{"orbit": {"at": [0, 0, 0], "radius": 1}}])",
       "views[0].orbit:", "'count' is missing; accepted: an integer from 1"},
      {"views", R"([{"orbit": {"at": [0, 0], "radius": 1, "count": 3}}])", "views[0].orbit:", "'at': accepted: three numbers"},
      {"views", R"([{"orbit": {"at": [0, 0, 0], "radius": 0, "count": 3}}])", "views[0].orbit:", "above 0"},
      {"views", R"([{"orbit": {"at": [0, 0, 0], "radius": 1, "count": 3, "axis": [0, 0, 0]}}])", "views[0].orbit:", "not all 0"},
      {"views", R"([{"orbit": {"at": [0, 0, 0], "radius": 1, "count": 3, "elevation": 90}}])",
       "views[0].orbit:", "between -90 and 90"},
      {"views", R"([{"orbit": {"at": [0, 0, 0], "radius": 1, "count": 3, "elevations": 9}}])", "views[0].orbit:", "'elevations'"},
      {"views", R"([{"eye": [3, 0, 0], "orbit": {"at": [0, 0, 0], "radius": 1, "count": 3}}])",
       "views[0].eye:", "beside 'orbit'"},
      {"transfer_function", R"({"extinction": []})", "transfer_function", ""},
      {"transfer_function", R"({"opacity": 3})", "transfer_function", "opacity"},
      {"frames", "0", "frames:", "from 1"},
      {"frames", "[3, \"x\"]", "frames[1]:", "an integer"},
      {"warm_up", "-1", "warm_up:", "from 0"},
      {"seed", "-1", "seed:", "of at least 0"},
      {"seed", "[1, 2]", "seed:", "an integer"},
      {"reference", "3", "reference:", "an object"},
      {"reference", R"({"step": 0})", "reference.step:", "above 0"},
      {"reference", R"({"tolerance": 0})", "reference.tolerance:", "1e-13"},
      {"reference", R"({"tolerance": 1e-9, "step": 0.5})",
       "reference.step:", "stands in place of 'tolerance'; accepted: one of both"},
      {"reference", R"({"filter": "cubic"})", "reference.filter:", "own, nearest"},
      {"reference", R"({"filters": "own"})", "reference.filters:", "did you mean 'filter'?"},
      {"reference", R"({"own": false, "filter": "own"})", "reference.own:", "there is no reference"},
      {"reference", R"({"shading": "flat"})", "reference.shading:", "none, gradient, central, clamped, analytic"},
      {"time_change", "3", "time_change:", "true or false"},
      {"context", "\"glx\"", "context:", "egl, egl_device, osmesa"},
      {"memory_limit", "0", "memory_limit:", "of at least 1"},
      {"baseline", "1", "baseline:", "true or false"},
      {"check", "{}", "check:", "one of the keys 'psnr_db'"},
      {"check", R"({"off": ""})", "check.off:", "the reason why"},
      {"check", R"({"off": "a control", "psnr_db": 30})", "check:", "one of the keys"},
      {"check", R"({"off": "a control", "why": "x"})", "check.why:", "belongs to 'psnr_db'"},
      {"check", R"({"psnr": 30})", "check.psnr:", "psnr_db"},
  };
  for (const Mistake& mistake : mistakes)
    EXPECT_THAT(complaint(with(mistake.key, mistake.value)),
                AllOf(testing::ContainsRegex("^folder/e.json:[0-9]+: "), HasSubstr(mistake.place), HasSubstr(mistake.accepted)))
        << mistake.key << ": " << mistake.value;
}

/// A folder with a triangle in it.
class TrianglesOfExperiments : public testing::Test {
 protected:
  TrianglesOfExperiments() : folder_(fs::temp_directory_path() / fmt::format("amrtex_experiment_triangles_{}", ::getpid())) {
    fs::create_directories(folder_);
    for (const char* name : {"a.obj", "copy.obj"}) std::ofstream(folder_ / name) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::ofstream(folder_ / "broken.obj") << "v 0 0 0\nf 1 2 3\n";
  }
  ~TrianglesOfExperiments() override { fs::remove_all(folder_); }

  Experiment parsed(const std::string& render) const { return parse_experiment(with("render", render), folder_ / "e.json"); }
  std::string hash(const RenderPoint& render) const {
    return configuration_hash(point_configuration(Experiment{}, BuildPoint{}, render, ""));
  }
  fs::path folder_;
};

TEST_F(TrianglesOfExperiments, AreOneValueOrAListOfThemAndListsOfListsAreAnAxis) {
  const Experiment one = parsed(R"({"triangles": {"file": "a.obj"}})");
  ASSERT_EQ(one.renders.size(), 1U);
  ASSERT_EQ(one.renders[0].settings.triangles.size(), 1U);
  EXPECT_EQ(one.renders[0].settings.triangles[0].mesh->triangles().size(), 1U);
  EXPECT_EQ(one.renders[0].settings.triangles[0].color, Vec3d(0.8));

  const Experiment axis =
      parsed(R"({"triangles": [[], [{"file": "a.obj", "color": [1, 0.5, 0]}, {"file": "a.obj"}]], "step": [1, 2]})");
  ASSERT_EQ(axis.renders.size(), 4U);
  EXPECT_FALSE(render_json(axis.renders[0]).contains("triangles")) << "as in records of scenes that know of none";
  const Json json = render_json(axis.renders[2])["triangles"];
  EXPECT_EQ(json[0]["file"], "a.obj");
  EXPECT_EQ(json[0]["color"], Json({1.0, 0.5, 0.0}));
  EXPECT_EQ(json[0]["triangles"], 1);
  const auto& objects = axis.renders[2].settings.triangles;
  EXPECT_EQ(objects[0].mesh, objects[1].mesh) << "read once";
  EXPECT_TRUE(parsed(R"({"triangles": null})").renders[0].settings.triangles.empty());
}

TEST_F(TrianglesOfExperiments, NameAMeasurementByWhatTheyHold) {
  const RenderPoint a = parsed(R"({"triangles": {"file": "a.obj"}})").renders[0];
  const RenderPoint copy = parsed(R"({"triangles": {"file": "copy.obj"}})").renders[0];
  const RenderPoint red = parsed(R"({"triangles": {"file": "a.obj", "color": [1, 0, 0]}})").renders[0];
  const RenderPoint none = parsed("{}").renders[0];
  EXPECT_EQ(hash(a), hash(copy));
  EXPECT_NE(hash(a), hash(red));
  EXPECT_NE(hash(a), hash(none));
}

TEST_F(TrianglesOfExperiments, AreRefusedWithFileLineAndKey) {
  const struct {
    const char* render;
    const char* place;
    const char* accepted;
  } mistakes[] = {
      {R"({"triangles": {"file": "broken.obj"}})", "render.triangles.file:", "accepted: OBJ, PLY or STL"},
      {R"({"triangles": {"file": "e.json"}})", "render.triangles.file:", "no such file"},
      {R"({"triangles": {"file": "a.obj", "color": [1, 0]}})", "render.triangles.color:", "[r, g, b]"},
      {R"({"triangles": {"file": "a.obj", "color": 1}})", "render.triangles.color:", "[r, g, b]"},
      {R"({"triangles": {"file": "a.obj", "color": [1, 0, 2]}})", "render.triangles.color[2]:", "from 0 to 1"},
      {R"({"mode": "iso", "isovalues": [1], "output": "normal", "triangles": {"file": "a.obj"}})",
       "render.triangles:", "output color"},
  };
  for (const auto& mistake : mistakes) {
    std::string complaint = "accepted";
    try {
      parsed(mistake.render);
    } catch (const UsageError& e) {
      complaint = e.what();
    }
    EXPECT_THAT(complaint,
                AllOf(testing::ContainsRegex("e.json:[0-9]+: "), HasSubstr(mistake.place), HasSubstr(mistake.accepted)));
  }
}

TEST(ExperimentErrors, NameMissingKeys) {
  for (const char* key : {"name", "datasets", "encodings", "views", "transfer_function"})
    EXPECT_THAT(complaint(without(key)), AllOf(StartsWith("folder/e.json:1: "), HasSubstr(fmt::format("'{}' is missing", key))));
  EXPECT_THAT(complaint("[]"), HasSubstr("an object"));
}

// --- scene files ---

TEST(SceneFile, IsAnExperimentOfOnePointWithARegion) {
  const Experiment e = parse_scene(with("region", R"({"lower": [0, 0, 0], "upper": [1, 1, 0.5]})"), "s.json");
  const Scene scene = scene_of(e, e.renders[0]);
  ASSERT_TRUE(scene.region);
  EXPECT_EQ((*scene.region)[1], Vec3d(1, 1, 0.5));
  EXPECT_EQ(scene.view.eye, Vec3d(3, 0, 0));
  EXPECT_EQ(scene.transfer_function.extinction.size(), 2u);
  EXPECT_EQ(parse_scene(with("region", "[[0, 0, 0], [1, 1, 2]]"), "s.json").region->at(1).z, 2);
  EXPECT_EQ(parse_scene(without("name"), "picture.json").name, "picture");
}

TEST(SceneFile, NamesTheAxesThatItCannotHave) {
  EXPECT_THAT(scene_complaint(with("render", R"({"step": [1, 0.5]})")), AllOf(StartsWith("s.json:"), HasSubstr("render.step")));
  EXPECT_THAT(scene_complaint(with("region", "[[0, 0, 0], [1, 0, 1]]")), HasSubstr("region: the lower corner"));
  EXPECT_THAT(scene_complaint(with("region", "[[0, 0, 0]]")), HasSubstr("region:"));
  EXPECT_THAT(scene_complaint(with("region", R"({"lower": [0, 0], "upper": [1, 1, 1]})")),
              HasSubstr("region.lower: accepted: three numbers"));
}

// --- the identity of points ---

TEST(PointConfiguration, IsUniqueForEveryPointAndTheSameInEveryRun) {
  Json json = Json::parse(with("encodings", R"([{"name": "uniform"}, {"name": "page_table", "page_size": [4, 8, 16]}])"));
  json["filters"] = {"nearest", "linear_page"};
  json["filtering"] = {"hardware", "manual"};
  json["storage"] = {"r32f", "r8"};
  json["render"] = {{"mode", {"dvr", "mip"}}, {"step", {1, 0.5}}, {"skip", {true, false}}};
  json["frames"] = {1, 2};
  const auto hashes = [&] {
    const Experiment e = parsed(json.dump());
    std::vector<std::string> list;
    for (const BuildPoint& build : e.builds)
      for (const RenderPoint& render : e.renders)
        list.push_back(configuration_hash(point_configuration(e, build, render, "mesh")));
    return list;
  };
  const std::vector<std::string> first = hashes();
  EXPECT_EQ(first.size(), 4u * 3 * 2 * 16);
  EXPECT_EQ(std::set<std::string>(first.begin(), first.end()).size(), first.size());
  EXPECT_EQ(hashes(), first);
}

// A record holds the experiment of its point alone, by which it can be measured again: it must say everything.
TEST(PointExperiments, MakeTheSamePointOfEveryCommittedExperiment) {
  int points = 0;
  const bool data_there = fs::exists(test::kSharedData.beside());  // experiments name it by its place
  std::vector<std::string> without_data;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(AMRTEX_SOURCE_DIR) / "experiments")) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".json" || entry.path().string().find("/results") != std::string::npos ||
        entry.path().string().find("/references/") != std::string::npos || name == "tables.json" || name == "columns.json" ||
        name.ends_with(".vl.json"))
      continue;
    if (!data_there && text_of(entry.path()).find("/shared/data/") != std::string::npos) {
      without_data.push_back(entry.path().string());
      continue;
    }
    const Experiment whole = name.find("scene") == 0 ? read_scene(entry.path()) : read_experiment(entry.path());
    // each build with the first picture, the first build with each picture
    for (std::size_t i = 0; i < std::max(whole.builds.size(), whole.renders.size()); ++i) {
      const BuildPoint& build = whole.builds[std::min(i, whole.builds.size() - 1)];
      const RenderPoint& render = whole.renders[std::min(i, whole.renders.size() - 1)];
      const Json file = point_experiment(whole, build, render);
      const Experiment alone = parse_experiment(file.dump(), entry.path());
      ASSERT_EQ(alone.points(), 1U) << entry.path() << file.dump(1);
      ASSERT_EQ(point_configuration(alone, alone.builds[0], alone.renders[0], "data"),
                point_configuration(whole, build, render, "data"))
          << entry.path() << file.dump(1);
      ++points;
    }
  }
  EXPECT_GT(points, 100);
  if (!without_data.empty())
    GTEST_SKIP() << fmt::format("no {}; not asked: {}", test::kSharedData.beside().string(), fmt::join(without_data, ", "));
}

TEST(PointConfiguration, ChangesWithMeshSettingsAndReferenceButNotWithNames) {
  const auto hash = [](const std::string& text, const char* mesh) {
    const Experiment e = parsed(text);
    return configuration_hash(point_configuration(e, e.builds[0], e.renders[0], mesh));
  };
  const std::string base = hash(kSmall, "mesh");
  EXPECT_NE(hash(kSmall, "other"), base);
  EXPECT_NE(hash(with("reference", "null"), "mesh"), base);
  EXPECT_EQ(hash(with("reference", R"({"own": true})"), "mesh"), base) << "the default: older records keep their names";
  EXPECT_NE(hash(with("reference", R"({"own": false})"), "mesh"), base);
  EXPECT_NE(hash(with("seed", "2"), "mesh"), base);
  EXPECT_NE(hash(with("context", "\"osmesa\""), "mesh"), base);
  EXPECT_NE(hash(with("memory_limit", "5"), "mesh"), base);
  EXPECT_EQ(hash(with("frames", "9"), "mesh"), base);
  EXPECT_EQ(hash(with("render", R"({"step": 1.0, "width": 512})"), "mesh"), base);
  Json named = Json::parse(kSmall);
  named["views"][0]["name"] = "front";
  EXPECT_EQ(hash(named.dump(), "mesh"), base);
}

TEST(Suggestion, OnlyNamesWhatIsNear) {
  const std::vector<std::string_view> names = {"width", "height"};
  EXPECT_EQ(suggestion("widht", names), "; did you mean 'width'?");
  EXPECT_EQ(suggestion("colour", names), "");
}

TEST(Prune, IsRefusedWhereTheTransferFunctionWillChange) {
  Json json = Json::parse(with("render", R"({"mode": "dvr", "prune": true})"));
  EXPECT_EQ(complaint(json.dump()), "accepted");
  const Json one = json["transfer_function"];
  Json other = one;
  other["extinction"] = {{0.5, 0}, {1, 5}};
  json["transfer_function"] = {one, other};
  EXPECT_THAT(complaint(json.dump()), AllOf(HasSubstr("transfer_function"), HasSubstr("prune")));
  json["transfer_function"] = one;
  json["transfer_function"]["extinction"] = {{{0, 0}, {1, 5}}, {{0.5, 0}, {1, 5}}};
  EXPECT_THAT(complaint(json.dump()), HasSubstr("prune"));
}

TEST(Prune, AndNeedsNameTheRecordOnlyWhereTheyAreNotTheDefault) {
  const auto hash = [](const std::string& render) {
    const Experiment e = parsed(with("render", render));
    return configuration_hash(point_configuration(e, e.builds.front(), e.renders.front(), "mesh"));
  };
  EXPECT_EQ(hash("{}"), hash(R"({"prune": false, "needs": "scene"})"));
  EXPECT_NE(hash("{}"), hash(R"({"prune": true})"));
  EXPECT_NE(hash("{}"), hash(R"({"needs": "all"})"));
}

TEST(RayOffset, HasTheExperimentsSeedAndStandsInEveryRecord) {
  const auto parsed = [](bool on) {
    Json json = Json::parse(with("render", fmt::format(R"({{"mode": "dvr", "ray_offset": {}}})", on)));
    json["seed"] = 77;
    return parse_experiment(json.dump(), "e.json").renders.front();
  };
  EXPECT_EQ(parsed(true).settings.ray_offset, 77u);
  EXPECT_EQ(render_json(parsed(true))["ray_offset"], true);
  EXPECT_EQ(render_json(parsed(true))["seed"], 77);
  EXPECT_FALSE(parsed(false).settings.ray_offset.has_value());
  EXPECT_EQ(render_json(parsed(false))["ray_offset"], false);
  EXPECT_FALSE(render_json(parsed(false)).contains("seed"));
}

TEST(ExplainError, IsOffUnlessAskedForAndNamesTheRecordOnlyThen) {
  const Experiment plain = parsed(kSmall);
  const Experiment explained = parsed(with("explain_error", "true"));
  EXPECT_FALSE(plain.explain_error);
  EXPECT_TRUE(explained.explain_error);
  const auto hash = [](const Experiment& e) {
    return configuration_hash(point_configuration(e, e.builds.front(), e.renders.front(), "mesh"));
  };
  EXPECT_EQ(hash(plain), hash(parsed(with("explain_error", "false"))));
  EXPECT_NE(hash(plain), hash(explained));
  EXPECT_THAT(complaint(with("explain_error", "1")), HasSubstr("explain_error"));
  Json both = Json::parse(with("explain_error", "true"));
  both["reference"] = nullptr;
  EXPECT_THAT(complaint(both.dump()), HasSubstr("no error to explain"));
}

TEST(ExplainLeftOut, IsOffUnlessAskedForAndNamesTheRecordOnlyThen) {
  const Experiment explained = parsed(with("explain_left_out", "true"));
  EXPECT_FALSE(parsed(kSmall).explain_left_out);
  EXPECT_TRUE(explained.explain_left_out);
  const auto hash = [](const Experiment& e) {
    return configuration_hash(point_configuration(e, e.builds.front(), e.renders.front(), "mesh"));
  };
  EXPECT_EQ(hash(parsed(kSmall)), hash(parsed(with("explain_left_out", "false"))));
  EXPECT_NE(hash(parsed(kSmall)), hash(explained));
  EXPECT_THAT(complaint(with("explain_left_out", "1")), HasSubstr("explain_left_out"));
}

// --- transfer functions of several fields

constexpr const char* kLight = R"("extinction": [[0, 0], [1, 5]], "color": [[0, 1, 1, 1]])";

/// kSmall with transfer functions of the named fields, of a mesh that has two.
std::string with_functions(const std::vector<std::string>& fields, const std::string& render = "{}") {
  Json json = Json::parse(without("transfer_function"));
  json["datasets"][0]["generate"]["more_fields"] = {"linear"};
  json["render"] = Json::parse(render);
  for (const std::string& field : fields)
    json["transfer_functions"].push_back(Json::parse(fmt::format(R"({{"field": "{}", {}}})", field, kLight)));
  return json.dump(1);
}

TEST(TransferFunctions, OfSeveralFieldsAreDrawnInOneVolume) {
  const Experiment e =
      parsed(with_functions({"blobs_shell", "linear"}, R"({"mode": ["dvr", "projection", "iso"], "isovalues": [1]})"));
  ASSERT_EQ(e.renders.size(), 3u);
  const RenderPoint& volume = e.renders[0];
  EXPECT_EQ(volume.transfer_function.extinction.size(), 2u);
  ASSERT_EQ(volume.more_fields.size(), 1u);
  EXPECT_EQ(volume.more_fields[0].field, "linear");
  EXPECT_EQ(scene_of(e, volume).more_fields.size(), 1u);
  EXPECT_EQ(volume.transfer_function_name, "transfer functions 1");
  EXPECT_EQ(render_json(volume)["more_transfer_functions"][0]["field"], "linear");
  for (const std::size_t other : {1u, 2u})
    EXPECT_TRUE(e.renders[other].more_fields.empty()) << "other modes draw the first alone";
  const auto hash = [](const Experiment& x) {
    return configuration_hash(point_configuration(x, x.builds.front(), x.renders.front(), "mesh"));
  };
  EXPECT_EQ(hash(parsed(with_functions({"blobs_shell"}))), hash(parsed(with("render", "{}")))) << "one is as transfer_function";
  EXPECT_NE(hash(parsed(with_functions({"blobs_shell"}))), hash(parsed(with_functions({"blobs_shell", "linear"}))));
}

TEST(TransferFunctions, OfSeveralFieldsAreAnAxisAsAListOfLists) {
  Json json = Json::parse(with_functions({"blobs_shell", "linear"}));
  Json alone = json["transfer_functions"];
  alone.erase(1);
  json["transfer_functions"] = {json["transfer_functions"], alone};
  const Experiment e = parsed(json.dump());
  ASSERT_EQ(e.renders.size(), 2u);
  EXPECT_EQ(e.renders[0].more_fields.size(), 1u);
  EXPECT_TRUE(e.renders[1].more_fields.empty());
  EXPECT_THAT(e.axes, ElementsAre("transfer_functions"));
}

TEST(TransferFunctions, OfSeveralFieldsAreRefusedByPlaceAndName) {
  const std::vector<std::string> both{"blobs_shell", "linear"};
  EXPECT_THAT(complaint(with_functions({"linear", "blobs_shell"})),
              AllOf(HasSubstr("transfer_functions[0].field:"), HasSubstr("'blobs_shell'")));
  EXPECT_THAT(complaint(with_functions({"blobs_shell", "linear", "linear"})),
              AllOf(HasSubstr("transfer_functions[2].field:"), HasSubstr("each field once")));
  Json json = Json::parse(with_functions(both));
  json["transfer_functions"][1].erase("field");
  EXPECT_THAT(complaint(json.dump()), HasSubstr("field"));
  json = Json::parse(with_functions(both));
  json["transfer_functions"][1]["opacity"] = 1;
  EXPECT_THAT(complaint(json.dump()), AllOf(HasSubstr("transfer_functions[1]"), HasSubstr("opacity")));
  json["transfer_functions"][1] = json["transfer_functions"][0];
  json["transfer_function"] = Json::parse(kSmall)["transfer_function"];
  EXPECT_THAT(complaint(json.dump()), AllOf(HasSubstr("transfer_function:"), HasSubstr("one of both")));
  for (const auto& [render, word] :
       std::vector<std::pair<std::string, std::string>>{{R"({"mode": "dvr_iso", "isovalues": [1]})", "not dvr_iso"},
                                                        {R"({"integrator": "preintegrated"})", "not preintegrated"},
                                                        {R"({"tolerance": 0.01})", "not tolerance"},
                                                        {R"({"point_light": [1, 2, 3]})", "'point_light'"},
                                                        {R"({"prune": true})", "'prune'"}})
    EXPECT_THAT(complaint(with_functions(both, render)), AllOf(HasSubstr("transfer_functions:"), HasSubstr(word)));
}

TEST(TransferFunctions, OfAnUnknownFieldNameThoseThereAre) {
  const Experiment e = parsed(with_functions({"blobs_shell", "rho"}));
  const AmrHierarchy mesh = load_dataset(e, e.datasets.front());
  try {
    more_fields(mesh, scene_of(e, e.renders.front()));
    ADD_FAILURE();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("'rho'"), HasSubstr("blobs_shell, linear")));
  }
}

TEST(ReferenceShading, IsThePicturesOwnUnlessAnotherIsAskedForAndNamesTheRecordOnlyThen) {
  const auto hash = [](const Experiment& e) {
    return configuration_hash(point_configuration(e, e.builds.front(), e.renders.front(), "mesh"));
  };
  const Experiment analytic = parsed(with("reference", R"({"shading": "analytic"})"));
  EXPECT_FALSE(parsed(kSmall).reference->shading);
  EXPECT_EQ(analytic.reference->shading, Shading::analytic);
  EXPECT_EQ(hash(parsed(kSmall)), hash(parsed(with("reference", R"({"shading": null})"))));
  EXPECT_NE(hash(parsed(kSmall)), hash(analytic));
  Json both = Json::parse(with("reference", R"({"shading": "analytic"})"));
  both["explain_error"] = true;
  EXPECT_THAT(complaint(both.dump()), AllOf(HasSubstr("explain_error:"), HasSubstr("own shading")));
}

TEST(TimeChange, IsOffUnlessAskedForAndNamesTheRecordOnlyThen) {
  const auto hash = [](const Experiment& e) {
    return configuration_hash(point_configuration(e, e.builds.front(), e.renders.front(), "mesh"));
  };
  EXPECT_FALSE(parsed(kSmall).time_change);
  EXPECT_TRUE(parsed(with("time_change", "true")).time_change);
  EXPECT_EQ(hash(parsed(kSmall)), hash(parsed(with("time_change", "false"))));
  EXPECT_NE(hash(parsed(kSmall)), hash(parsed(with("time_change", "true"))));
}

// Wald et al. 2020, sections 4.1 to 4.3: each can be switched off alone, and a record's `render` says which were on.
TEST(SwitchesOfSampling, StandInEveryRecord) {
  struct Switch {
    const char *render, *key, *value;
  };
  for (const Switch& s :
       std::initializer_list<Switch>{{R"({})", "sampling", R"("adaptive")"},  // steps of each region's finest cell
                                     {R"({"sampling": "lattice"})", "sampling", R"("lattice")"},
                                     {R"({})", "integrator", R"("exponential_midpoint")"},        // middles, opacity
                                     {R"({"integrator": "left"})", "integrator", R"("left")"},    // no middles
                                     {R"({"integrator": "euler"})", "integrator", R"("euler")"},  // no 1 - exp
                                     {R"({})", "ray_offset", "false"},
                                     {R"({"ray_offset": true})", "ray_offset", "true"},
                                     {R"({})", "early_end", "null"},
                                     {R"({"early_end": 0.98})", "early_end", "0.98"},
                                     {R"({})", "skip", "true"},
                                     {R"({"skip": false})", "skip", "false"}})
    EXPECT_EQ(render_json(parsed(with("render", s.render)).renders.front()).at(s.key).dump(), s.value) << s.render;
}

}  // namespace
}  // namespace amrtex
