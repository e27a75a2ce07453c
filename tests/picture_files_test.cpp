// Pictures to look at and to measure: ticks beside them, what lies behind them, EXR.
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "renderers/scene/background.hpp"
#include "renderers/scene/color_map.hpp"
#include "renderers/scene/dot_font.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/ticks.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> texts(const std::vector<Tick>& list) {
  std::vector<std::string> all;
  for (const Tick& t : list) all.push_back(t.text);
  return all;
}

TEST(Ticks, AreRoundNumbersInsideOfTheRange) {
  EXPECT_THAT(texts(ticks(0, 1, false, 6)), testing::ElementsAre("0", "0.2", "0.4", "0.6", "0.8", "1"));
  EXPECT_THAT(texts(ticks(-3.2, 9.9, false, 4)), testing::ElementsAre("0", "5"));
  EXPECT_THAT(texts(ticks(-7.6, 7.6, false, 4)), testing::ElementsAre("-5", "0", "5"));
  EXPECT_THAT(texts(ticks(1e6, 1e6 + 4e-3, false, 5)),
              testing::ElementsAre("1000000", "1000000.001", "1000000.002", "1000000.003", "1000000.004"));
  EXPECT_THAT(texts(ticks(1e-31, 1e-28, true, 8)), testing::ElementsAre("1e-31", "1e-30", "1e-29", "1e-28"));
  EXPECT_THAT(texts(ticks(1e-8, 1e-6, true, 3)), testing::ElementsAre("1e-8", "1e-7", "1e-6"));
  EXPECT_THAT(texts(ticks(0, 4e7, false, 5)), testing::ElementsAre("0", "1e7", "2e7", "3e7", "4e7"));
  EXPECT_THAT(texts(ticks(1, 20, true, 8)), testing::ElementsAre("1", "2", "5", "10", "20"));
  EXPECT_LE(ticks(1e-200, 1e200, true, 7).size(), 8U);
  EXPECT_GE(ticks(3.1, 3.2, true, 7).size(), 2U) << "no power of ten lies between";
  EXPECT_TRUE(ticks(1, 1, false, 5).empty());
}

TEST(Ticks, StayFewAndAscendForEveryRange) {
  for (const double lower : {-1e300, -7.0, 0.0, 1e-300, 123456.0})
    for (const double extent : {1e-3, 1.0, 3.7, 1e300}) {
      const std::vector<Tick> list = ticks(lower, lower + extent, false, 6);
      EXPECT_LE(list.size(), 6U);
      for (std::size_t i = 1; i < list.size(); ++i) EXPECT_GT(list[i].value, list[i - 1].value);
    }
}

TEST(DotFont, TellsLettersApart) {
  EXPECT_NE(dot_glyph('0'), dot_glyph('8'));
  EXPECT_NE(dot_glyph('r'), dot_glyph('n'));
  EXPECT_EQ(dot_glyph('\x80'), dot_glyph('\x81')) << "a box for what it does not have";
}

TEST(Background, IsDarkBehindLightColoursAndLightBehindDarkOnes) {
  Scene scene;
  scene.transfer_function.extinction = {{0, 0}, {1, 10}};
  scene.transfer_function.color = color_map("viridis");
  EXPECT_LT(lightness(background_for(scene)), 20) << "the dense end is yellow";
  scene.transfer_function.extinction = {{0, 10}, {1, 0}};
  EXPECT_GT(lightness(background_for(scene)), 80) << "the dense end is violet";
}

TEST(Exr, HoldsTheFloatsToTheBit) {
  const fs::path path = fs::path(testing::TempDir()) / "amrtex_picture.exr";
  Picture picture(3, 2, 4);
  for (std::size_t i = 0; i < picture.values.size(); ++i) picture.values[i] = 0.1 * static_cast<double>(i);
  write_exr(picture, path);
  Imf::InputFile file(path.c_str());
  const auto box = file.header().dataWindow();
  ASSERT_EQ(box.max.x - box.min.x + 1, 3);
  ASSERT_EQ(box.max.y - box.min.y + 1, 2);
  std::vector<float> blue(6);
  Imf::FrameBuffer buffer;
  buffer.insert("B", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(blue.data()), sizeof(float), 3 * sizeof(float)));
  file.setFrameBuffer(buffer);
  file.readPixels(0, 1);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(blue[i], static_cast<float>(picture.values[4 * i + 2]));
  fs::remove(path);
}

TEST(Exr, OfRawValuesHasOneChannel) {
  const fs::path path = fs::path(testing::TempDir()) / "amrtex_values.exr";
  write_exr(Picture(2, 2, 1), path);
  EXPECT_NE(Imf::InputFile(path.c_str()).header().channels().findChannel("Y"), nullptr);
  fs::remove(path);
  EXPECT_THROW(write_exr(Picture(2, 2, 3), path), Error);
  EXPECT_THROW(write_exr(Picture(2, 2, 4), fs::path(testing::TempDir()) / "no" / "a.exr"), Error);
}

}  // namespace
}  // namespace amrtex
