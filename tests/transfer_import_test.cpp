// Colour maps and transfer functions of other programs.
#include "renderers/scene/transfer_import.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kExamples = fs::path(AMRTEX_SOURCE_DIR) / "data" / "color_maps";

class Import : public testing::Test {
 protected:
  Import() : folder_(fs::path(testing::TempDir()) / "amrtex_import") { fs::create_directories(folder_); }
  ~Import() override { fs::remove_all(folder_); }

  std::string file(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  std::string complaint(const std::string& bytes) const {
    try {
      import_transfer(file("bad", bytes));
    } catch (const UsageError& e) {
      return e.what();
    }
    return "";
  }

  fs::path folder_;
};

Vec3d color_at(const ImportedTransfer& t, double value) {
  TransferFunction tf;
  tf.color = t.colors;
  return srgb_from_linear(tf.color_at(value));
}

double opacity_at(const ImportedTransfer& t, double value) {
  TransferFunction tf;
  for (const auto& p : t.opacity) tf.extinction.push_back({p.value, p.opacity});
  return tf.extinction_at(value);
}

double largest(const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

template <class T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string xf_bytes(std::int32_t count) {
  std::string bytes;
  append(bytes, std::uint64_t{0x1235abc000});
  for (const float v : {100.F, 10.F, 20.F, 0.F, 50.F}) append(bytes, v);  // slider, absolute range, per cent of it
  append(bytes, count);
  for (std::int32_t i = 0; i < count; ++i)
    for (const float v : {static_cast<float>(i) / static_cast<float>(count - 1), 0.25F, 0.75F, i == count - 1 ? 1.F : 0.5F})
      append(bytes, v);
  return bytes;
}

TEST_F(Import, ParaViewJsonWithOpacityPoints) {
  const ImportedTransfer t = import_transfer((kExamples / "paraview.json").string());
  EXPECT_FALSE(t.relative);
  EXPECT_EQ(t.range()[0], 1.0);
  EXPECT_EQ(t.range()[1], 1.7);
  EXPECT_LE(largest(color_at(t, 1.0) - Vec3d(0.23137254902, 0.298039215686, 0.752941176471)), 1e-6);
  EXPECT_LE(largest(color_at(t, 1.35) - Vec3d(0.865, 0.865, 0.865)), kColorBound);
  EXPECT_NEAR(opacity_at(t, 1.1), 0, 1e-12);
  EXPECT_NEAR(opacity_at(t, 1.4), 0.2, 1e-9);  // midpoint 0.5, sharpness 0: a line from (1.1, 0) to (1.7, 0.4)
}

TEST_F(Import, ParaViewMapsFromZeroToOneAreLaidOverTheData) {
  const ImportedTransfer t =
      import_transfer(file("a.json", R"([{"Name": "first", "ColorSpace": "RGB", "RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]},
                                         {"Name": "second", "ColorSpace": "HSV", "RGBPoints": [-1, 1, 0, 0, 1, 1, 0, 1]}])"));
  EXPECT_TRUE(t.relative);
  EXPECT_LE(largest(color_at(t, 0.5) - Vec3d(0.5)), kColorBound);  // joined in sRGB, as ParaView does
  const ImportedTransfer second = import_transfer((folder_ / "a.json").string() + "#second");
  EXPECT_LE(largest(color_at(second, 0) - Vec3d(1, 0, 0.5)), kColorBound) << "red to magenta the short way";
  EXPECT_THROW(import_transfer((folder_ / "a.json").string() + "#third"), UsageError);
}

TEST_F(Import, ParaViewSharpnessMakesASlopeAStep) {
  // sharpness 1: a step at the midpoint
  const ImportedTransfer t =
      import_transfer(file("a.json", R"({"RGBPoints": [2, 0, 0, 0, 4, 1, 1, 1], "Points": [2, 0, 0.25, 1, 4, 0.8, 0.5, 0]})"));
  EXPECT_EQ(opacity_at(t, 2.4), 0);
  EXPECT_NEAR(opacity_at(t, 2.6), 0.8, 1e-12);
}

TEST_F(Import, ParaViewXml) {
  const ImportedTransfer t = import_transfer((kExamples / "paraview.xml").string());
  EXPECT_LE(largest(color_at(t, 1.5) - Vec3d(0.1, 0.6, 0.3)), 1e-6);
  EXPECT_NEAR(opacity_at(t, 1.25), 0.1, 1e-9);
}

TEST_F(Import, VisItColorTable) {
  const ImportedTransfer t = import_transfer((kExamples / "visit.ct").string());
  EXPECT_TRUE(t.relative);
  EXPECT_LE(largest(color_at(t, 0.4) - Vec3d(0, 255, 0) / 255.0), 1e-6);
  EXPECT_NEAR(opacity_at(t, 0.4), 51 / 255.0, 1e-9);
}

TEST_F(Import, GaussiansAsYtAddsThem) {
  const ImportedTransfer t = import_transfer((kExamples / "gaussians.json").string());
  // heights 0.05 at 1.2 and 0.5 at 1.55, both of width 0.002: exp(-(x - location)^2 / width); of several the highest
  for (const double x : {1.15, 1.2, 1.23, 1.4, 1.5, 1.55, 1.6}) {
    const double a = std::max(0.05 * std::exp(-(x - 1.2) * (x - 1.2) / 0.002), 0.5 * std::exp(-(x - 1.55) * (x - 1.55) / 0.002));
    EXPECT_NEAR(opacity_at(t, x), a, 0.002) << x;
  }
  EXPECT_LE(largest(color_at(t, 1.2) - Vec3d(0.2, 0.4, 1)), 0.01);
  EXPECT_LE(largest(color_at(t, 1.55) - Vec3d(1, 0.7, 0.1)), 0.01);
}

TEST_F(Import, GaussiansOverLogarithms) {
  const ImportedTransfer t = import_transfer(file(
      "a.json", R"({"bounds": [-3, 1], "log": true, "gaussians": [{"location": -1, "width": 0.5, "height": [1, 1, 1, 0.4]}]})"));
  EXPECT_TRUE(t.logarithmic);
  EXPECT_NEAR(t.range()[0], 1e-3, 1e-12);
  EXPECT_NEAR(opacity_at(t, 0.1), 0.4, 1e-6);
}

TEST_F(Import, XfWithAHeader) {
  const ImportedTransfer t = import_transfer(file("a.xf", xf_bytes(128)));
  EXPECT_EQ(t.range()[0], 10);  // 0 to 50 per cent of 10 to 20
  EXPECT_EQ(t.range()[1], 15);
  EXPECT_LE(largest(color_at(t, 12.5) - Vec3d(0.5, 0.25, 0.75)), kColorBound);
  EXPECT_NEAR(opacity_at(t, 12), 0.5, 1e-6);
  EXPECT_NEAR(opacity_at(t, 15), 1, 1e-12);
}

TEST_F(Import, XfOfOpacitiesAlone) {
  std::string bytes;
  for (int i = 0; i < 128; ++i) append(bytes, static_cast<float>(i) / 127);
  const ImportedTransfer t = import_transfer(file("a.xf", bytes));
  EXPECT_TRUE(t.relative);
  EXPECT_TRUE(t.colors.empty());
  EXPECT_EQ(t.opacity.size(), 2U) << "points on a line are left out";
  EXPECT_NEAR(opacity_at(t, 0.25), 0.25, 1e-6);
}

TEST_F(Import, WhatIsNoneIsRefusedInOneLineThatNamesTheFile) {
  const std::string xf = xf_bytes(128);
  for (const std::string& bytes :
       {std::string(),
        std::string("hello"),
        std::string("{"),
        std::string("[]"),
        std::string("{}"),
        std::string("<a/>"),
        std::string("<ColorMaps></ColorMaps>"),
        std::string("<Object name=\"ViewState\"/>"),
        std::string("<ColorMap><Point x='a'/>"),
        std::string(R"({"RGBPoints": [0, 0, 0]})"),
        std::string(R"({"RGBPoints": [0, 0, 0, 0, 0, 1, 1, 1]})"),
        std::string(R"({"RGBPoints": [0, 0, 0, 0, 1, 2, 1, 1]})"),
        std::string(R"({"RGBPoints": [0, 0, 0, 0, 1, "a", 1, 1]})"),
        std::string(R"({"ColorSpace": "XYZ", "RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]})"),
        std::string(R"({"RGBPoints": [1, 0, 0, 0, 0, 1, 1, 1]})"),
        std::string(R"({"RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1], "Points": [0, 2, 0.5, 0, 1, 1, 0.5, 0]})"),
        std::string(R"({"gaussians": []})"),
        std::string(R"({"bounds": [0, 1], "gaussians": [{}]})"),
        std::string(R"({"bounds": [0, 1], "gaussians": [{"location": 0, "width": 0, "height": [1, 1, 1, 1]}]})"),
        xf.substr(0, 40),
        xf.substr(0, xf.size() - 1),
        xf + "x",
        std::string(512, '\xff'),
        std::string(100, '\0')}) {
    const std::string text = complaint(bytes);
    EXPECT_THAT(text, HasSubstr("bad")) << bytes.substr(0, 60);
    EXPECT_EQ(text.find('\n'), std::string::npos);
  }
  EXPECT_THROW(import_transfer((folder_ / "none").string()), UsageError);
  EXPECT_THROW(import_transfer(folder_.string()), UsageError);
}

TEST(ExtinctionOf, FollowsTheLogarithmWithinItsBound) {
  const std::vector<OpacityPoint> opacity{{0, 0}, {1, 0.3}, {2, 0.05}, {3, 1}, {4, 1}};
  const double length = 0.01;
  TransferFunction tf;
  tf.extinction = extinction_of(opacity, length);
  ImportedTransfer t;
  t.opacity = opacity;
  for (int i = 0; i <= 40000; ++i) {
    const double v = i / 10000.0;
    const double exact = -std::log1p(-std::min(opacity_at(t, v), 1 - 0x1p-24)) / length;
    const double bound = std::max(kExtinctionShare * exact, kExtinctionDepth / length);
    ASSERT_LE(std::abs(tf.extinction_at(v) - exact), bound) << v;
  }
  EXPECT_DOUBLE_EQ(tf.extinction_at(3.5), 24 * std::log(2) / length) << "1 is taken as 1 - 2^-24";
  EXPECT_LT(tf.extinction.size(), 100U);
}

TEST(ExtinctionOf, AtThePointsThemselvesIsExact) {
  const auto points = extinction_of({{0, 0.5}, {1, 0.5}}, 2);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_DOUBLE_EQ(points[0].extinction, std::log(2) / 2);
}

}  // namespace
}  // namespace amrtex
