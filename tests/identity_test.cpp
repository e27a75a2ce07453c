// Which points are the same measurement: what the name of a record, the name of a reference and the implementation know.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <fstream>
#include <set>

#include "bench/measure/environment.hpp"
#include "bench/measure/runner.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/shader_cache.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/exact_hash.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::HasSubstr;

std::string exact(const MeshBuilder& mesh, const std::vector<int>& fields = {0}) { return exact_hash(mesh.hierarchy(), fields); }
std::string content(const MeshBuilder& mesh) { return mesh.hierarchy().content_hash(0); }

MeshBuilder cube(const Vec3d& lower, const Vec3d& upper, std::vector<double> values = {1, 2, 3, 4, 5, 6, 7, 8}) {
  return MeshBuilder({2, 2, 2}, {}, lower, upper).patch(0, {Vec3i(0), Vec3i(2)}, std::move(values));
}

TEST(ExactHash, KnowsSpacingAndOriginWhichTheContentHashDoesNot) {
  const MeshBuilder unit = cube(Vec3d(0), Vec3d(1));
  for (const MeshBuilder& other : {cube(Vec3d(0), {1, 1, 2}), cube(Vec3d(1), Vec3d(2)), cube(Vec3d(0), Vec3d(1 + 1e-15))}) {
    EXPECT_NE(exact(other), exact(unit));
    EXPECT_EQ(content(other), content(unit));
  }
  EXPECT_EQ(exact(cube(Vec3d(0), Vec3d(1))), exact(unit));
}

TEST(ExactHash, KnowsValuesThatFloatDoesNot) {
  const auto offset = [](double slope) { return MeshBuilder({4, 4, 4}).root([=](const Vec3d& p) { return 1e8 + slope * p.x; }); };
  EXPECT_EQ(content(offset(1e-3)), content(offset(0)));
  EXPECT_NE(exact(offset(1e-3)), exact(offset(0)));
}

TEST(ExactHash, KnowsTheFieldsInUseAndNoOthers) {
  const auto mesh = [](const Function& second) { return MeshBuilder({4, 4, 4}).root(waves).also("g", second); };
  const MeshBuilder one = mesh(slopes), other = mesh(constant(1));
  EXPECT_EQ(exact(one), exact(other)) << "the second field is not in use";
  EXPECT_NE(exact(one, {0, 1}), exact(other, {0, 1}));
  EXPECT_NE(exact(one, {0, 1}), exact(one, {1, 0}));
}

TEST(ExactHash, KnowsHowPatchesAreCutButNotWhatLiesUnderFinerOnes) {
  const Box left{{0, 0, 0}, {1, 2, 2}}, right{{1, 0, 0}, {2, 2, 2}};
  const MeshBuilder whole = MeshBuilder({2, 2, 2}).root(waves);
  const MeshBuilder cut = MeshBuilder({2, 2, 2}).patch(0, left, waves).patch(0, right, waves);
  EXPECT_EQ(content(cut), content(whole));
  EXPECT_NE(exact(cut), exact(whole));
  const auto refined = [&](double below) {
    return MeshBuilder({2, 2, 2}, {2}).patch(0, {Vec3i(0), Vec3i(2)}, constant(below)).patch(1, {Vec3i(0), Vec3i(4)}, waves);
  };
  EXPECT_EQ(exact(refined(3)), exact(refined(4)));
}

// ---- runs

class Identity : public testing::Test {
 protected:
  Identity() {
    std::string name = fs::temp_directory_path() / "amrtex_identity_XXXXXX";
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~Identity() override { fs::remove_all(folder_); }

  /// A tiny experiment over the mesh, written as `name`.
  Json experiment_over(const MeshBuilder& mesh, const std::string& name) const {
    write_amrex_plotfile(mesh.hierarchy(), folder_ / name);
    return {{"name", "identity"},
            {"datasets", {{{"name", "mesh"}, {"file", name}, {"field", "f"}}}},
            {"encodings", {{{"name", "uniform"}}}},
            {"filters", {"nearest"}},
            {"render", {{"step", 0.25}, {"width", 8}, {"height", 8}}},
            {"views", {{{"eye", {3, 2.5, 2}}, {"at", {0.5, 0.5, 0.5}}, {"fov_y", 40}}}},
            {"transfer_function", {{"extinction", {{-100, 1}, {1e9, 2}}}, {"color", {{0, 1, 0.5, 0}, {1, 0, 0.5, 1}}}}},
            {"frames", 1},
            {"warm_up", 0},
            {"reference", {{"step", 0.5}, {"filter", "own"}}}};
  }

  RunSummary run(const Json& experiment, const std::function<void(RunOptions&)>& adjust = {}) const {
    RunOptions options;
    options.folder = folder_ / "out";
    if (adjust) adjust(options);
    return run_experiment(parse_experiment(experiment.dump(), folder_ / "e.json"), options);
  }

  std::vector<Json> records() const { return load_records(folder_ / "out"); }
  /// Pictures; beside each stands what is known of it.
  std::size_t references() const {
    std::size_t pictures = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "out" / "references"))
      pictures += entry.path().extension() == ".npy" ? 1 : 0;
    return pictures;
  }

  /// Changes the one record there is behind the program's back.
  void edit_record(const std::function<void(Json&)>& edit) const {
    Json record = records().front();
    edit(record);
    std::ofstream(folder_ / "out" / "records.jsonl") << record_line(record) << "\n";
  }

  fs::path folder_;
};

TEST_F(Identity, MeshesThatDifferInSpacingOriginOrBelowFloatHaveRecordsAndReferencesOfTheirOwn) {
  const auto fine = [](double slope) { return MeshBuilder({2, 2, 2}).root([=](const Vec3d& p) { return 1e8 + slope * p.x; }); };
  const std::vector<MeshBuilder> meshes = {cube(Vec3d(0), Vec3d(1)), cube(Vec3d(0), {1, 1, 0.5}), cube(Vec3d(0.25), Vec3d(1.25)),
                                           fine(1e-3), fine(0)};
  std::set<std::string> contents, exact_hashes, configurations;
  for (std::size_t i = 0; i < meshes.size(); ++i)
    EXPECT_EQ(run(experiment_over(meshes[i], fmt::format("plt{}", i))).measured, 1) << "mesh " << i;
  for (const Json& record : records()) {
    contents.insert(record.at("dataset").at("hash"));
    exact_hashes.insert(record.at("dataset").at("exact_hash"));
    configurations.insert(record.at("configuration"));
  }
  EXPECT_EQ(contents.size(), 2U) << "formats that round to float call them the same";
  EXPECT_EQ(exact_hashes.size(), meshes.size());
  EXPECT_EQ(configurations.size(), meshes.size());
  EXPECT_EQ(references(), meshes.size());
}

TEST_F(Identity, FurtherFieldsAndTrianglesAreKnownByWhatTheyHold) {
  const auto mesh = [](const Function& second) { return MeshBuilder({4, 4, 4}).root(waves).also("g", second); };
  const AmrHierarchy one = mesh(waves).hierarchy(), other = mesh(constant(1)).hierarchy();
  Scene colored;
  colored.settings.mode = Mode::iso;
  colored.settings.isosurfaces.color_field = "g";
  EXPECT_NE(exact_data_hash(one, colored), exact_data_hash(other, colored));
  Scene several;
  several.more_fields = {{"g", {}}};
  EXPECT_NE(exact_data_hash(one, several), exact_data_hash(other, several));
  EXPECT_EQ(exact_data_hash(one, Scene{}), exact_data_hash(other, Scene{}));
  const auto with_triangle = [](double z) {
    const Triangle triangle = {Vec3d(0), Vec3d(1, 0, 0), Vec3d(0, 1, z)};
    Scene scene;
    scene.settings.triangles = {{std::make_shared<const TriangleMesh>(std::vector<Triangle>{triangle}), Vec3d(1), "a.obj"}};
    return scene;
  };
  EXPECT_EQ(exact_data_hash(one, with_triangle(0)), exact_data_hash(one, with_triangle(0)));
  EXPECT_NE(exact_data_hash(one, with_triangle(0)), exact_data_hash(one, with_triangle(1)));
  EXPECT_NE(exact_data_hash(one, with_triangle(0)), exact_data_hash(one, Scene{}));
}

TEST_F(Identity, ARecordSaysWhatWasAskedWhatDrewItAndWhereTheDataCameFrom) {
  EXPECT_EQ(run(experiment_over(cube(Vec3d(0), Vec3d(1)), "plt")).measured, 1);
  const Json record = records().at(0);
  EXPECT_EQ(record.at("schema"), "amrtex-record/2");
  EXPECT_EQ(record.at("implementation"), implementation_hash());
  EXPECT_EQ(record.at("repetition"), 0);
  EXPECT_EQ(record.at("dataset").at("source"), "plt") << "as the experiment has it";
  EXPECT_GT(record.at("process_peak_bytes"), 1 << 20);
  EXPECT_FALSE(record.at("context").at("device").is_null());
  if (record.at("context").at("software") == true) {
    EXPECT_TRUE(record.at("frame").at("gpu_ms").is_null()) << "there the timer means nothing";
  }
}

TEST_F(Identity, WhatAnotherImplementationDrewIsMeasuredAgainUnlessItIsToBeKept) {
  const Json experiment = experiment_over(cube(Vec3d(0), Vec3d(1)), "plt");
  EXPECT_EQ(run(experiment).measured, 1);
  EXPECT_EQ(run(experiment).kept, 1);
  edit_record([](Json& record) { record["implementation"] = "0123"; });
  EXPECT_EQ(run(experiment, [](RunOptions& o) { o.keep_old = true; }).kept, 1);
  EXPECT_EQ(records().at(0).at("implementation"), "0123");
  EXPECT_EQ(run(experiment).measured, 1);
  EXPECT_EQ(records().at(0).at("implementation"), implementation_hash());
  EXPECT_EQ(records().size(), 1U) << "it has taken the place of the other";
}

TEST_F(Identity, AFolderOfTheFirstSchemaIsReportedButNotRunInto) {
  const Json experiment = experiment_over(cube(Vec3d(0), Vec3d(1)), "plt");
  EXPECT_EQ(run(experiment).measured, 1);
  Json old = records().at(0);
  old["schema"] = kFirstSchema;
  for (const char* key :
       {"configuration", "implementation", "repetition", "asked", "check", "check_reason", "process_peak_bytes"})
    old.erase(key);
  fs::remove(folder_ / "out" / "records.jsonl");
  fs::create_directory(folder_ / "out" / "records");
  std::ofstream(folder_ / "out" / "records" / "point.json") << old.dump();
  try {
    run(experiment);
    FAIL() << "it went on from records of schema 1";
  } catch (const UsageError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr((folder_ / "out").string()), HasSubstr("point.json"), HasSubstr("another folder")));
  }
  const Json record = records().at(0);
  EXPECT_EQ(record.at("schema"), kFirstSchema);
  EXPECT_TRUE(record.at("implementation").is_null());
  EXPECT_TRUE(record.at("check_reason").is_null());
}

TEST_F(Identity, ShadersComeFromACacheOfTheRunsOwn) {
  const Json experiment = experiment_over(cube(Vec3d(0), Vec3d(1)), "plt");
  EXPECT_EQ(run(experiment).measured, 1);
  EXPECT_TRUE(records().at(0).at("context").at("shader_cache").is_null()) << "whatever the driver does is not known";
  ::unsetenv("MESA_SHADER_CACHE_DIR");
  ::unsetenv("__GL_SHADER_DISK_CACHE_PATH");
  EXPECT_EQ(use_shader_cache(folder_ / "cache"), "cold");
  EXPECT_EQ(::getenv("MESA_SHADER_CACHE_DIR"), (folder_ / "cache").string());
  std::ofstream(folder_ / "cache" / "index") << "compiled";
  EXPECT_EQ(use_shader_cache(folder_ / "cache"), "warm");
  EXPECT_EQ(use_shader_cache(folder_ / "other"), "warm") << "a folder that is set already stays";
  ::setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
  EXPECT_EQ(use_shader_cache(folder_ / "cache"), "cold");
  for (const char* name : {"MESA_SHADER_CACHE_DISABLE", "MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH"}) ::unsetenv(name);
}

}  // namespace
}  // namespace amrtex
