// What is drawn of data that nobody has described.
#include "bench/settings/default_scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "bench/report/verdict.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/scene/framing.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/readers/mesh_io.hpp"
#include "test_meshes.hpp"

namespace amrtex::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kTiny = fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny" / "plt00008";

/// One level of n x 1 x 1 cells that hold f of 0 to n - 1.
template <class F>
AmrHierarchy row(int n, F&& f) {
  std::vector<double> values;
  for (int i = 0; i < n; ++i) values.push_back(f(i));
  return MeshBuilder({n, 1, 1}).patch(0, {{0, 0, 0}, {n, 1, 1}}, std::move(values)).hierarchy();
}

std::vector<double> all_quantiles(const AmrHierarchy& mesh, std::vector<double> shares, CellWeight weight = CellWeight::volume) {
  return quantiles(mesh, 0, shares, weight, Counted::all);
}

TEST(Quantiles, AreThoseOfTheSortedValues) {
  const AmrHierarchy mesh = row(1000, [](int i) { return i * 7 % 1000 - 500.0; });
  const std::vector<double> q = all_quantiles(mesh, {0, 0.25, 0.5, 0.999, 1});
  EXPECT_EQ(q[0], -500);
  EXPECT_NEAR(q[1], -250, 1.001);
  EXPECT_NEAR(q[2], 0, 1.001);
  EXPECT_NEAR(q[3], 499, 1.001);
  EXPECT_EQ(q[4], 499);
}

TEST(Quantiles, TellValuesApartThatDifferInTheTenthDigit) {
  const AmrHierarchy mesh = row(100, [](int i) { return 1e6 + i * 1e-3; });
  EXPECT_NEAR(all_quantiles(mesh, {0.5})[0], 1e6 + 0.05, 2e-3);
}

TEST(Quantiles, WeighCellsByTheirVolume) {
  // 7 coarse cells of value 0, and one that is refined to 8 of value 1: 1/8 of the volume, 8/15 of the cells
  MeshBuilder builder({2, 2, 2}, {2});
  builder.patch(0, {{0, 0, 0}, {2, 2, 2}}, std::vector<double>(8, 0.0));
  builder.patch(1, {{0, 0, 0}, {2, 2, 2}}, std::vector<double>(8, 1.0));
  const AmrHierarchy mesh = builder.hierarchy();
  EXPECT_EQ(all_quantiles(mesh, {0.8})[0], 0);
  EXPECT_EQ(all_quantiles(mesh, {0.9})[0], 1);
  EXPECT_EQ(all_quantiles(mesh, {0.5}, CellWeight::one)[0], 1);
}

TEST(Quantiles, LeaveOutWhatHasNoValue) {
  const AmrHierarchy mesh = row(10, [](int i) { return i < 5 ? kNan : 3.0; });
  EXPECT_EQ(all_quantiles(mesh, {0, 1}), (std::vector<double>{3, 3}));
  const AmrHierarchy none = row(4, [](int) { return kNan; });
  EXPECT_TRUE(std::isnan(all_quantiles(none, {0.5})[0]));
}

TEST(ValueHistogram, SharesAddUpToOneWithWhatLiesOutside) {
  const AmrHierarchy mesh = row(1000, [](int i) { return i / 1000.0; });
  const ValueHistogram h = value_histogram(mesh, 0, 0.1, 0.9, false, 8);
  double sum = h.below + h.above;
  for (const double s : h.share) {
    EXPECT_NEAR(s, 0.1, 0.0021);
    sum += s;
  }
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_NEAR(h.below, 0.1, 1e-9);
  EXPECT_NEAR(h.value_at(h.place(0.3)), 0.3, 1e-12);
}

TEST(ValueHistogram, OverLogarithmsIsEvenThere) {
  const AmrHierarchy mesh = row(600, [](int i) { return std::pow(10, i / 100.0); });
  const ValueHistogram h = value_histogram(mesh, 0, 1, 1e6, true, 6);
  for (const double s : h.share) EXPECT_NEAR(s, 1 / 6.0, 0.003);
  EXPECT_NEAR(h.value_at(0.5), 1e3, 1e-9);
}

TEST(ValueHistogram, IsTextWithARowABin) {
  const AmrHierarchy mesh = row(100, [](int i) { return i; });
  const std::string text = histogram_text(value_histogram(mesh, 0, 0, 99, false, 4), 60);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 5);
  EXPECT_THAT(text, HasSubstr("█"));
}

TEST(ShownRange, IsOfPercentilesNotOfOutliers) {
  const AmrHierarchy mesh = row(10000, [](int i) { return i == 5 ? 1e30 : i % 100; });
  const ShownRange range = shown_range(mesh, 0);
  EXPECT_FALSE(range.logarithmic);
  EXPECT_EQ(range.lower, 0);
  EXPECT_EQ(range.upper, 99);
}

TEST(ShownRange, IsLogarithmicWherePositiveValuesSpanMoreThanThreeDecades) {
  EXPECT_TRUE(shown_range(row(1000, [](int i) { return std::pow(10, i / 250.0); }), 0).logarithmic);   // 4
  EXPECT_FALSE(shown_range(row(1000, [](int i) { return std::pow(10, i / 400.0); }), 0).logarithmic);  // 2.5
  EXPECT_FALSE(shown_range(row(1000, [](int i) { return std::pow(10, i / 250.0) - 2; }), 0).logarithmic) << "some are negative";
  const ShownRange zeros = shown_range(row(1000, [](int i) { return i < 900 ? 0 : std::pow(10, (i - 900) / 25.0); }), 0);
  EXPECT_TRUE(zeros.logarithmic) << "those above 0 count";
  EXPECT_GT(zeros.lower, 0);
  EXPECT_THROW(shown_range(row(4, [](int i) { return -1.0 - i; }), 0, true), UsageError);
}

TEST(ShownRange, OfOneValueHasAnExtentAroundIt) {
  for (const double value : {0.0, 5.0, -1e300}) {
    const ShownRange range = shown_range(row(3, [&](int) { return value; }), 0);
    EXPECT_TRUE(range.constant);
    EXPECT_LT(range.lower, value);
    EXPECT_GT(range.upper, value);
  }
  EXPECT_TRUE(shown_range(row(3, [](int) { return kNan; }), 0).constant);
}

TransferFunction default_of(const AmrHierarchy& mesh, const TransferRequest& request = {}) {
  return default_transfer(mesh, 0, framing_view(mesh.domain_lower(), mesh.domain_upper(), "corner", 1), 1, request);
}

double depth_of(const AmrHierarchy& mesh, const TransferFunction& tf) {
  return median_depth(mesh, 0, tf, framing_view(mesh.domain_lower(), mesh.domain_upper(), "corner", 1), 1);
}

TEST(DefaultTransfer, HasAMedianDepthOfOneForTheRaysThatHit) {
  const char* specifications[] = {R"({"field": "blobs_shell", "levels": 3})", R"({"field": "shell", "levels": 3})"};
  for (const char* text : specifications) {
    const AmrHierarchy mesh(generate_mesh(Json::parse(text)));
    const TransferFunction tf = default_of(mesh);
    EXPECT_EQ(extinction_problem(tf), "");
    EXPECT_EQ(color_problem(tf.color, tf.logarithmic), "");
    EXPECT_NEAR(depth_of(mesh, tf), 1, 0.02) << text;  // extinction has three digits
  }
}

TEST(DefaultTransfer, MedianDepthOfAConstantCubeIsKnown) {
  // from far away along x all rays pass one edge length: depth = extinction
  const AmrHierarchy mesh = MeshBuilder({4, 4, 4}).patch(0, {{0, 0, 0}, {4, 4, 4}}, constant(2)).hierarchy();
  TransferFunction tf;
  tf.extinction = {{0, 3}};
  tf.color = {{0, Vec3d(1)}};
  View view;
  view.eye = {1000, 0.5, 0.5};
  view.at = Vec3d(0.5);
  view.fov_y = 0.05;
  EXPECT_NEAR(median_depth(mesh, 0, tf, view, 1), 3, 1e-4);
}

TEST(DefaultTransfer, LeavesTheBackgroundOut) {
  const auto blob = [](const Vec3d& p) { return 1 + std::exp(-40 * glm::dot(p - Vec3d(0.5), p - Vec3d(0.5))); };
  const AmrHierarchy mesh = MeshBuilder({32, 32, 32}).patch(0, {{0, 0, 0}, {32, 32, 32}}, blob).hierarchy();
  const TransferFunction rising = default_of(mesh);
  EXPECT_EQ(rising.extinction_at(1.0), 0);
  EXPECT_GT(rising.extinction_at(1.95), 0);
  const AmrHierarchy hole =
      MeshBuilder({32, 32, 32}).patch(0, {{0, 0, 0}, {32, 32, 32}}, [&](const Vec3d& p) { return 3 - blob(p); }).hierarchy();
  const TransferFunction falling = default_of(hole);
  EXPECT_EQ(falling.extinction_at(2.0), 0);
  EXPECT_GT(falling.extinction_at(1.05), 0);
}

TEST(DefaultTransfer, OfSignedValuesIsSymmetricAndCoolWarm) {
  const auto wave = [](const Vec3d& p) {
    return std::sin(6.28 * p.x) * std::exp(-30 * glm::dot(p - Vec3d(0.5), p - Vec3d(0.5)));
  };
  const AmrHierarchy mesh = MeshBuilder({32, 32, 32}).patch(0, {{0, 0, 0}, {32, 32, 32}}, wave).hierarchy();
  const TransferFunction tf = default_of(mesh);
  EXPECT_EQ(tf.color.front().value, -tf.color.back().value);
  EXPECT_GT(tf.color.front().rgb.z, tf.color.front().rgb.x) << "blue is cool";
  EXPECT_EQ(tf.extinction_at(0), 0);
  EXPECT_GT(tf.extinction_at(tf.color.back().value), 0);
  EXPECT_GT(tf.extinction_at(tf.color.front().value), 0);
  TransferRequest named;
  named.color_map = "gray";
  EXPECT_EQ(default_of(mesh, named).color.front().rgb, Vec3d(0));
}

TEST(DefaultTransfer, IsValidForEveryOddField) {
  const std::vector<double> one{4};
  std::vector<AmrHierarchy> meshes;
  meshes.push_back(MeshBuilder({1, 1, 1}).patch(0, {{0, 0, 0}, {1, 1, 1}}, one).hierarchy());
  meshes.push_back(row(5, [](int) { return 0.0; }));
  meshes.push_back(row(5, [](int) { return kNan; }));
  meshes.push_back(row(5, [](int i) { return i == 2 ? kNan : -i * 1e30; }));
  meshes.push_back(row(5, [](int i) { return i == 2 ? 1e300 : -1e300; }));
  meshes.push_back(row(5, [](int i) { return i * 1e-310; }));
  meshes.push_back(fields_with_gaps().hierarchy());
  for (const AmrHierarchy& mesh : meshes) {
    const TransferFunction tf = default_of(mesh);
    EXPECT_EQ(extinction_problem(tf), "");
    EXPECT_EQ(color_problem(tf.color, tf.logarithmic), "");
    EXPECT_GE(tf.color.size(), 2U);
  }
}

TEST(DefaultTransfer, TakesARange) {
  const AmrHierarchy mesh = row(100, [](int i) { return i; });
  TransferRequest request;
  request.range = {{10, 20}};
  EXPECT_EQ(default_of(mesh, request).color.front().value, 10);
  EXPECT_EQ(default_of(mesh, request).color.back().value, 20);
  request.range = {{20, 10}};
  EXPECT_THROW(default_of(mesh, request), UsageError);
  request.range = {{-1, 10}};
  request.logarithmic = true;
  EXPECT_THROW(default_of(mesh, request), UsageError);
}

TEST(DefaultScene, IsASceneAndTheSameEveryTime) {
  const AmrHierarchy mesh(read_mesh(kTiny));
  SceneRequest request;
  request.data = kTiny;
  const std::string text = default_scene(mesh, request).dump();
  EXPECT_EQ(text, default_scene(mesh, request).dump());
  const Experiment scene = parse_scene(text, "scene.json");
  EXPECT_EQ(scene.builds.front().filter, Filter::linear_vertex);
  EXPECT_EQ(*scene.datasets.front().field, "phi");
  for (const std::string mode : {"projection", "mip", "iso", "dvr_iso"}) {
    request.mode = mode;
    EXPECT_EQ(mode_name(parse_scene(default_scene(mesh, request).dump(), "scene.json").renders.front().settings.mode), mode);
  }
}

TEST(DefaultScene, OfASweepIsAnExperimentOfEveryEncoding) {
  const AmrHierarchy mesh(read_mesh(kTiny));
  SceneRequest request;
  request.data = kTiny;
  const Experiment experiment = parse_experiment(default_experiment(mesh, request).dump(), "experiment.json");
  std::set<std::string> encodings;
  for (const BuildPoint& build : experiment.builds) encodings.insert(build.encoding);
  EXPECT_THAT(encodings, testing::IsSupersetOf({"uniform", "page_table", "octree", "kd_tree", "exabricks"}));
  EXPECT_GT(experiment.points(), 20U);
}

TEST(DefaultScene, AFolderIsDataAndJsonIsNot) {
  const fs::path folder = fs::path(testing::TempDir()) / "amrtex_is_data";
  fs::create_directories(folder);
  const auto file = [&](const char* name, const std::string& bytes) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    return folder / name;
  };
  EXPECT_TRUE(is_data_set(kTiny));
  EXPECT_TRUE(is_data_set(file("a.hdf5", "\x89HDF\r\n\x1a\n")));
  EXPECT_TRUE(is_data_set(file("a.cells", std::string("{\0\0\0", 4))));
  EXPECT_FALSE(is_data_set(file("scene", " \n{\"name\": 1}")));
  EXPECT_FALSE(is_data_set(file("bad.json", "nothing")));
  EXPECT_FALSE(is_data_set(folder / "none"));
  fs::remove_all(folder);
}

Json record(const char* encoding, double mebibytes, double ms, Json psnr) {
  return {{"status", "ok"},
          {"encoding", encoding},
          {"filter", "nearest"},
          {"storage", "r8"},
          {"render", {{"step", 1.0}}},
          {"memory", {{"total_bytes", mebibytes * 1048576}}},
          {"frame", {{"wall_ms", {{"median", ms}}}}},
          {"error_common", {{"rmse", psnr.is_null() ? 0.0 : 0.1}, {"psnr_db", psnr}}}};
}

TEST(Verdict, NamesTheSmallestAndTheFastestThatIsGood) {
  std::vector<Json> records{record("a", 1, 9, 30), record("b", 2, 5, 40), record("c", 3, 7, 55), record("d", 4, 8, nullptr)};
  records.push_back({{"status", "failed"}, {"encoding", "e"}});
  const std::string text = verdict(records);
  EXPECT_THAT(text, testing::StartsWith("smallest: a (nearest, r8, step 1.0): 1.00 MiB, 9 ms, 30.0 dB"));
  EXPECT_THAT(text, HasSubstr("fastest at >= 50 dB: c (nearest, r8, step 1.0): 3.00 MiB, 7 ms, 55.0 dB"));
  EXPECT_THAT(verdict({record("a", 1, 9, 30), record("b", 2, 5, 40)}), HasSubstr("none reaches 50 dB, the nearest is b"));
  EXPECT_EQ(verdict({}), "nothing was drawn");
}

}  // namespace
}  // namespace amrtex::test
