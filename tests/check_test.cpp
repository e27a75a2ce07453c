// The bound that a picture has to meet unless an experiment says otherwise.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <cmath>
#include <set>

#include "bench/measure/check_bound.hpp"
#include "bench/measure/runner.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/settings/json_file.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

double bound(const BuildPoint& build, const RenderSettings& settings) { return psnr_of(default_allowances(build, settings)); }

BuildPoint page_table() {
  BuildPoint build;
  build.encoding = "page_table";
  build.filter = Filter::linear_page;
  return build;
}

RenderSettings with_step(double step) {
  RenderSettings s;
  s.step = step;
  return s;
}

TEST(DefaultBound, AsksForMoreWhereTheStepIsShorterAndForNoLessWhereItIsLonger) {
  const BuildPoint build = page_table();
  EXPECT_GT(bound(build, with_step(0.25)), bound(build, with_step(0.5)));
  EXPECT_GT(bound(build, with_step(0.5)), bound(build, with_step(1)));
  EXPECT_EQ(bound(build, with_step(1)), bound(build, with_step(40)));
  EXPECT_NEAR(bound(build, with_step(1)), 42, 1) << "two grey levels of 256";
}

TEST(DefaultBound, AllowsWhatStorageFilteringAndIntegratorCannotHelp) {
  const RenderSettings settings = with_step(0.5);
  BuildPoint exact = page_table();
  exact.filtering = Filtering::manual;
  double before = bound(exact, settings);
  for (const Storage storage : {Storage::r16, Storage::r16f, Storage::r8}) {
    BuildPoint stored = exact;
    stored.storage = storage;
    EXPECT_LT(bound(stored, settings), before) << format_name(storage);
    before = bound(stored, settings);
  }
  BuildPoint filtered = exact;
  filtered.filtering = Filtering::hardware;
  EXPECT_LT(bound(filtered, settings), bound(exact, settings));
  for (const Integrator integrator : {Integrator::euler, Integrator::left, Integrator::preintegrated}) {
    RenderSettings s = settings;
    s.integrator = integrator;
    EXPECT_LT(bound(exact, s), bound(exact, settings)) << integrator_name(integrator);
  }
  BuildPoint jumps = exact;
  jumps.filter = Filter::nearest;
  EXPECT_LT(bound(jumps, settings), bound(exact, settings)) << "a step across a jump is of order one";
  RenderSettings lattice = settings;
  lattice.sampling = Sampling::lattice;
  EXPECT_LT(bound(exact, lattice), bound(exact, settings)) << "its intervals do not end where levels change";
}

TEST(DefaultBound, HoldsAToleranceToItsWord) {
  RenderSettings s;
  s.integrator = Integrator::tolerance;
  s.tolerance = 1e-3;
  BuildPoint build = page_table();
  build.filtering = Filtering::manual;
  EXPECT_NEAR(bound(build, s), 54, 1) << "twice what was promised, since it goes by estimates";
}

TEST(DefaultBound, OfSurfacesFollowsFromTheirSilhouettes) {
  RenderSettings small;
  small.mode = Mode::iso;
  small.width = small.height = 64;
  RenderSettings large = small;
  large.width = large.height = 1024;
  EXPECT_LT(bound(page_table(), small), bound(page_table(), large)) << "fewer pixels, more of them on a silhouette";
}

TEST(Check, SaysWhyNothingIsAsked) {
  Experiment e;
  RenderSettings pruned;
  pruned.max_level = 1;
  EXPECT_THAT(check_of(e, page_table(), pruned).why, HasSubstr("on purpose"));
  RenderSettings shaded;
  shaded.mode = Mode::iso;
  shaded.isosurfaces.shading = Shading::central;
  e.reference->shading = Shading::analytic;
  EXPECT_THAT(check_of(e, page_table(), shaded).why, HasSubstr("other normals"));
  e.unchecked_because = "a control";
  EXPECT_THAT(check_of(e, page_table(), with_step(1)).why, HasSubstr("a control"));
  e.reference->own = false;
  EXPECT_THAT(check_of(e, page_table(), with_step(1)).why, HasSubstr("own filter"));
  e.reference.reset();
  EXPECT_EQ(check_of(e, page_table(), with_step(1)).why, "no reference");
  EXPECT_FALSE(check_of(e, page_table(), with_step(1)).psnr_db);
}

TEST(Check, PassesAPictureThatIsOffByRoundingAlone) {
  Picture reference(2, 1, 1);
  reference.values = {1e8, 1e8};  // no range: no PSNR
  const ErrorMetrics rounding{.rmse = 3, .max = 4, .psnr_db = std::nullopt, .mrse = 0};
  EXPECT_TRUE(passes({50, "default", ""}, rounding, reference));
  const ErrorMetrics wrong{.rmse = 1e6, .max = 1e7, .psnr_db = std::nullopt, .mrse = 0};
  EXPECT_FALSE(passes({50, "default", ""}, wrong, reference));
  EXPECT_TRUE(passes({std::nullopt, "", "no reference"}, wrong, reference));
}

// ---- the project's own experiments

/// With another mesh in place of files, which need not be on this machine.
Experiment settings_of(const fs::path& file) {
  Json json = JsonFile::read(file).root().json();
  Json& datasets = json.at("datasets");
  if (!datasets.is_array()) datasets = Json::array({datasets});
  for (Json& dataset : datasets)
    if (dataset.contains("file")) dataset = {{"generate", {{"field", "blobs"}}}};
  return parse_experiment(json.dump(), file);
}

std::vector<fs::path> committed_experiments() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(AMRTEX_SOURCE_DIR "/experiments")) {
    if (entry.path().extension() != ".json" || entry.path().string().find("/results") != std::string::npos) continue;
    const Json json = JsonFile::read(entry.path()).root().json();
    if (json.is_object() && json.contains("encodings") && json.contains("frames")) files.push_back(entry.path());
  }
  return files;
}

bool has_own_reference(const Experiment& e) { return e.reference && e.reference->own; }

/// In the folder `checked` beside the experiment, or beside its folder.
fs::path twin_of(const fs::path& experiment) {
  const fs::path beside = experiment.parent_path() / "checked" / "experiment.json";
  return fs::exists(beside) ? beside : experiment.parent_path().parent_path() / "checked" / "experiment.json";
}

std::string build_text(const BuildPoint& b) {
  return fmt::format("{} {} {} {} {}", b.encoding, b.parameters.dump(), filter_name(b.filter), format_name(b.storage),
                     filtering_name(b.filtering));
}

std::string way_to_draw(const RenderPoint& render) {
  const RenderSettings& s = render.settings;
  return fmt::format("{} {} {} {}", consumer_name(s.consumer), mode_name(s.mode), sampling_name(s.sampling),
                     integrator_name(s.integrator));
}

TEST(CommittedExperiments, TimedWithoutAnOwnReferenceHaveACheckedTwin) {
  int twins = 0;
  for (const fs::path& file : committed_experiments()) {
    const Experiment experiment = settings_of(file);
    if (has_own_reference(experiment)) continue;
    ASSERT_TRUE(fs::exists(twin_of(file))) << file << " has no " << twin_of(file);
    const Experiment twin = settings_of(twin_of(file));
    EXPECT_TRUE(has_own_reference(twin)) << twin_of(file);
    EXPECT_FALSE(twin.minimum_psnr_db || twin.unchecked_because) << twin_of(file) << ": the default check is what it is for";
    std::set<std::string> builds, ways;
    for (const BuildPoint& b : twin.builds) builds.insert(build_text(b));
    for (const RenderPoint& r : twin.renders) {
      ways.insert(way_to_draw(r));
      EXPECT_LE(std::max(r.settings.width, r.settings.height), 128) << twin_of(file);
    }
    for (const BuildPoint& b : experiment.builds)
      EXPECT_TRUE(builds.contains(build_text(b))) << file << ": not in its twin: " << build_text(b);
    for (const RenderPoint& r : experiment.renders)
      EXPECT_TRUE(ways.contains(way_to_draw(r))) << file << ": not in its twin: " << way_to_draw(r);
    ++twins;
  }
  EXPECT_GT(twins, 0);
}

TEST(CommittedExperiments, SayWhyTheyAskForAnotherBoundThanTheDefault) {
  for (const fs::path& file : committed_experiments()) {
    const Experiment experiment = settings_of(file);
    if (experiment.minimum_psnr_db) {
      EXPECT_FALSE(experiment.check_why.empty()) << file;
    }
  }
}

// ---- runs

class CheckedRun : public testing::Test {
 protected:
  CheckedRun() {
    std::string name = fs::temp_directory_path() / "amrtex_check_XXXXXX";
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~CheckedRun() override { fs::remove_all(folder_); }

  /// A page table of an ordinary scene, 48 x 48 pixels.
  static Json experiment(double step, const Json& more = Json::object()) {
    Json json = {
        {"name", "checked"},
        {"datasets", {{{"file", AMRTEX_SOURCE_DIR "/data/amrex_tiny/plt00008"}, {"field", "phi"}}}},
        {"encodings", {{{"name", "page_table"}}}},
        {"filters", {"linear_page"}},
        {"render", {{"sampling", "adaptive"}, {"step", step}, {"width", 48}, {"height", 48}}},
        {"views", {{{"eye", {2.2, 1.8, 1.5}}, {"at", {0.5, 0.5, 0.5}}, {"fov_y", 35}}}},
        {"transfer_function",
         {{"extinction", {{1.0, 0}, {1.05, 0}, {1.2, 4}, {1.5, 20}, {1.9, 60}}},
          {"color", {{1.0, 0, 0, 0.3}, {1.2, 0.1, 0.4, 1.0}, {1.4, 0.9, 0.9, 0.9}, {1.65, 1.0, 0.5, 0.1}, {1.9, 0.8, 0, 0}}}}},
        {"frames", 1},
        {"warm_up", 0},
        {"reference", {{"step", 0.25}, {"filter", "own"}}}};
    json.update(more);
    return json;
  }

  Json record_of(const Json& json) {
    RunOptions options;
    options.folder = folder_ / std::to_string(runs_++);
    run_experiment(parse_experiment(json.dump(), folder_ / "e.json"), options);
    return load_records(options.folder).at(0);
  }

  fs::path folder_;
  int runs_ = 0;
};

TEST_F(CheckedRun, AStepOfFortyCellsFailsUnlessItIsAskedFor) {
  const Json good = record_of(experiment(1));
  EXPECT_EQ(good.at("status"), "ok") << good.at("reason");
  EXPECT_EQ(good.at("check").at("from"), "default");
  EXPECT_THAT(good.at("check").at("why").get<std::string>(), AllOf(HasSubstr("step 1"), HasSubstr("filtering hardware")));
  EXPECT_TRUE(good.at("check_reason").is_null());

  const Json coarse = record_of(experiment(40));
  EXPECT_EQ(coarse.at("status"), "failed");
  EXPECT_THAT(coarse.at("reason").get<std::string>(), HasSubstr("asked for by the default"));
  EXPECT_TRUE(coarse.at("frame").is_null());
  EXPECT_LT(coarse.at("error").at("psnr_db"), coarse.at("check").at("psnr_db"));

  const Json off = record_of(experiment(40, {{"check", {{"off", "steps are what is looked at"}}}}));
  EXPECT_EQ(off.at("status"), "ok");
  EXPECT_TRUE(off.at("check").is_null());
  EXPECT_THAT(off.at("check_reason").get<std::string>(), HasSubstr("steps are what is looked at"));
  EXPECT_NE(off.at("configuration"), coarse.at("configuration"));

  const Json lax = record_of(experiment(40, {{"check", {{"psnr_db", 10}, {"why", "a sketch"}}}}));
  EXPECT_EQ(lax.at("status"), "ok");
  EXPECT_EQ(lax.at("check"), Json({{"psnr_db", 10.0}, {"from", "experiment"}, {"why", "a sketch"}}));
}

TEST_F(CheckedRun, WithoutAReferenceThePictureIsUnchecked) {
  const Json record = record_of(experiment(40, {{"reference", nullptr}}));
  EXPECT_EQ(record.at("status"), "ok");
  EXPECT_TRUE(record.at("check").is_null());
  EXPECT_EQ(record.at("check_reason"), "no reference");
}

TEST_F(CheckedRun, AToleranceIsCountedOverWhatIsSeen) {
  Json json = experiment(1);
  json["render"] = {{"tolerance", 0.01}, {"width", 48}, {"height", 48}};
  const Json error = record_of(json).at("error");
  const double all = error.at("within_tolerance"), seen = error.at("within_tolerance_seen");
  EXPECT_GE(all, seen) << "empty pixels are exact";
  EXPECT_GT(seen, 0.9);
  EXPECT_TRUE(record_of(experiment(1)).at("error").at("within_tolerance_seen").is_null());
}

}  // namespace
}  // namespace amrtex
