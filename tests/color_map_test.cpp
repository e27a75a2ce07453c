// Named colour maps, and curves made of few points.
#include "renderers/scene/color_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>

#include "bench/verify/meshes.hpp"
#include "renderers/bindings/transfer_bindings.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

Vec3d at(const ColorPoints& points, double value) {
  TransferFunction tf;
  tf.color = points;
  return srgb_from_linear(tf.color_at(value));
}

double largest(const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// matplotlib's tables as text, wherever the package lies.
std::string matplotlib_tables() {
  const char* given = std::getenv("AMRTEX_MATPLOTLIB");
  const fs::path folder = given != nullptr ? given : "/usr/lib/python3/dist-packages/matplotlib";
  std::ifstream in(folder / "_cm_listed.py");
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The 256 colours of one of them; linear, over 0 to 1.
ColorPoints listed_map(const std::string& tables, const std::string& name) {
  const std::string head = "_" + name + "_data = ";
  const std::size_t begin = tables.find(head), end = tables.find("]]", begin);
  if (begin == std::string::npos || end == std::string::npos) return {};
  std::string numbers = tables.substr(begin + head.size(), end - begin - head.size());
  for (char& ch : numbers)
    if (ch == '[' || ch == ']' || ch == ',') ch = ' ';
  std::istringstream in(numbers);
  ColorPoints points;
  for (Vec3d c; in >> c.x >> c.y >> c.z;) points.push_back({static_cast<double>(points.size()) / 255, linear_from_srgb(c)});
  return points;
}

TEST(ColorMap, EveryNameGivesPointsFromZeroToOneThatTheExactPathTakes) {
  EXPECT_THAT(color_map_names(), testing::ElementsAre("viridis", "inferno", "magma", "plasma", "turbo", "cool_warm", "gray"));
  for (const std::string_view name : color_map_names()) {
    const ColorPoints map = color_map(name);
    EXPECT_EQ(map.front().value, 0) << name;
    EXPECT_EQ(map.back().value, 1) << name;
    EXPECT_LE(map.size(), kMostExactColors) << name;
    EXPECT_EQ(color_problem(map, false), "") << name;
  }
  EXPECT_EQ(color_map("viridis").size(), 16U);
  EXPECT_THROW(color_map("jet"), UsageError);
}

TEST(ColorMap, ListedMapsAreTheFewestPointsOfMatplotlibsTables) {
  const std::string tables = matplotlib_tables();
  if (tables.empty())
    GTEST_SKIP() << "no matplotlib/_cm_listed.py; set AMRTEX_MATPLOTLIB to its folder (package python3-matplotlib)";
  for (const std::string name : {"viridis", "inferno", "magma", "plasma", "turbo"}) {
    const ColorPoints dense = listed_map(tables, name);
    ASSERT_EQ(dense.size(), 256U) << name;
    const ColorPoints map = color_map(name), few = fewest_points(dense, kColorBound);
    EXPECT_EQ(map.size(), few.size()) << name;
    for (const auto& p : dense)  // our entries have four digits
      EXPECT_LE(largest(at(map, p.value) - srgb_from_linear(p.rgb)), kColorBound + 1e-4) << name << " at " << p.value;
  }
}

TEST(ColorMap, GrayIsEvenInSrgb) {
  const ColorPoints map = color_map("gray");
  for (int i = 0; i <= 1000; ++i)
    EXPECT_LE(largest(at(map, i / 1000.0) - Vec3d(i / 1000.0)), kColorBound + 1e-3) << i;  // between the 256 samples too
}

TEST(ColorMap, CoolWarmHasMorelandsEndsAndMiddle) {
  // Diverging Color Maps for Scientific Visualization (Expanded), table of 257 values: 0, 128, 256
  const ColorPoints map = color_map("cool_warm");
  EXPECT_LE(largest(at(map, 0) - Vec3d(59, 76, 192) / 255.0), 1e-3);
  EXPECT_LE(largest(at(map, 1) - Vec3d(180, 4, 38) / 255.0), 1e-3);
  EXPECT_LE(largest(at(map, 0.5) - Vec3d(221, 221, 221) / 255.0), kColorBound + 1.0 / 255);
  EXPECT_LE(largest(diverging_color(Vec3d(59, 76, 192) / 255.0, Vec3d(180, 4, 38) / 255.0, 0.25) - Vec3d(141, 176, 254) / 255.0),
            2.0 / 255);
}

TEST(ColorMap, LabGoesThereAndBack) {
  for (const Vec3d c : {Vec3d(0.2, 0.5, 0.9), Vec3d(0), Vec3d(1), Vec3d(0.01, 0.001, 0.3)})
    EXPECT_LE(largest(linear_from_lab(lab_from_linear(c)) - c), 1e-6);
  EXPECT_NEAR(lightness(Vec3d(1)), 100, 1e-3);
  EXPECT_NEAR(lightness(Vec3d(0.18418651851244416)), 50, 1e-3);  // ((50 + 16) / 116)^3
}

/// Colours over 0 to 1, of that many points.
bool is_exact(std::size_t colors, std::size_t extinctions) {
  const AmrHierarchy mesh = verify::MeshBuilder({2, 2, 2}).patch(0, {{0, 0, 0}, {2, 2, 2}}, verify::constant(1)).hierarchy();
  Scene scene;
  for (std::size_t i = 0; i < colors; ++i)
    scene.transfer_function.color.push_back({static_cast<double>(i), Vec3d(static_cast<double>(i % 2))});
  for (std::size_t i = 0; i < extinctions; ++i) scene.transfer_function.extinction.push_back({static_cast<double>(i), 1});
  SceneBindings bindings;
  add_transfer_function(mesh, scene, bindings);
  return bindings.transfer_exact;
}

TEST(ColorMap, ThirtyTwoColoursAreEvaluatedExactlyAndMoreFromATable) {
  EXPECT_TRUE(is_exact(32, 16));
  EXPECT_FALSE(is_exact(33, 16));
  EXPECT_FALSE(is_exact(2, 17));
}

TEST(FewestPoints, LeaveWhatLiesOnALineAndKeepCorners) {
  ColorPoints dense;
  for (int i = 0; i <= 100; ++i) dense.push_back({i / 100.0, Vec3d(i < 40 ? i / 40.0 : 1.0)});
  const ColorPoints few = fewest_points(dense, 1e-9);
  ASSERT_EQ(few.size(), 3U);
  EXPECT_EQ(few[1].value, 0.4);
}

TEST(FewestPoints, OfManyKeepTheBoundEverywhere) {
  ColorPoints dense;
  for (int i = 0; i <= 3000; ++i) dense.push_back({i / 3000.0, Vec3d(0.5 + 0.5 * std::sin(i / 100.0), 0.3, i / 3000.0)});
  const ColorPoints few = fewest_points(dense, kColorBound);
  EXPECT_LT(few.size(), 400U);
  for (const auto& p : dense) EXPECT_LE(largest(at(few, p.value) - srgb_from_linear(p.rgb)), kColorBound * 1.0001);
}

TEST(Stretch, LaysAMapOverValuesOrTheirLogarithms) {
  const ColorPoints map{{0, Vec3d(0)}, {0.5, Vec3d(0.2)}, {1, Vec3d(1)}};
  EXPECT_DOUBLE_EQ(stretch(map, -2, 6, false)[1].value, 2);
  EXPECT_NEAR(stretch(map, 1e-4, 1e2, true)[1].value, 0.1, 1e-12);
  EXPECT_EQ(stretch(map, -1e308, 1e308, false)[2].value, 1e308);
}

}  // namespace
}  // namespace amrtex
