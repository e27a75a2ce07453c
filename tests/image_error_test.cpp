#include "bench/numbers/image_error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Picture picture(int width, int height, int channels, std::vector<double> values) {
  Picture p(width, height, channels);
  p.values = std::move(values);
  return p;
}

std::string message_of(const Picture& a, const Picture& b) {
  try {
    compare(a, b);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Compare, EqualPicturesHaveNoErrorAndNoPsnr) {
  const Picture p = picture(2, 1, 4, {0, 0.25, 0.5, 1, 0.1, 0.2, 0.3, 0.4});
  const ErrorMetrics error = compare(p, p);
  EXPECT_EQ(error.rmse, 0);
  EXPECT_EQ(error.max, 0);
  EXPECT_EQ(error.mrse, 0);
  EXPECT_FALSE(error.psnr_db);
}

// One channel of four off by 0.1: rmse = 0.1 / 2, PSNR = 20 log10(2 / 0.1) = 26.02 dB.
TEST(Compare, OnePixelOfColour) {
  const ErrorMetrics error = compare(picture(1, 1, 4, {0.5, 0.5, 0.5, 1}), picture(1, 1, 4, {0.4, 0.5, 0.5, 1}));
  EXPECT_NEAR(error.rmse, 0.05, 1e-15);
  EXPECT_NEAR(error.max, 0.1, 1e-15);
  EXPECT_NEAR(*error.psnr_db, 20 * std::log10(20.0), 1e-9);
  EXPECT_NEAR(error.mrse, 0.01 / (0.41 * 0.41) / 4, 1e-15);
}

TEST(Compare, PeakOfOneChannelIsTheReferencesRange) {
  const Picture reference = picture(2, 1, 1, {100, 300});
  const ErrorMetrics error = compare(picture(2, 1, 1, {102, 302}), reference);
  EXPECT_NEAR(error.rmse, 2, 1e-12);
  EXPECT_NEAR(*error.psnr_db, 40, 1e-9);
}

TEST(Compare, WithoutARangeThereIsNoPsnr) {
  const ErrorMetrics error = compare(picture(1, 1, 1, {3}), picture(1, 1, 1, {5}));
  EXPECT_EQ(error.rmse, 2);
  EXPECT_FALSE(error.psnr_db);
  EXPECT_FALSE(reaches_psnr(error, 0));
}

TEST(Compare, MrseSkipsInfiniteTerms) {
  const ErrorMetrics error = compare(picture(2, 1, 1, {1, 2}), picture(2, 1, 1, {-0.01, 1}));
  EXPECT_NEAR(error.mrse, 1 / (1.01 * 1.01) / 2, 1e-12);
}

TEST(Compare, NoValueInBothPicturesIsNoDifference) {
  const Picture p = picture(3, 1, 1, {kNan, kInfinity, 2});
  const ErrorMetrics error = compare(picture(3, 1, 1, {kNan, kInfinity, 2}), p);
  EXPECT_EQ(error.rmse, 0);
  EXPECT_EQ(error.max, 0);
}

TEST(Compare, NoValueInOnePictureIsAWrongPicture) {
  const Picture good = picture(2, 2, 1, {0, 1, 2, 3});
  EXPECT_THAT(message_of(picture(2, 2, 1, {0, 1, 2, kNan}), good), testing::HasSubstr("pixel (1, 1)"));
  EXPECT_THAT(message_of(good, picture(2, 2, 1, {0, 1, kNan, 3})), testing::HasSubstr("pixel (0, 1)"));
  EXPECT_THROW(compare(picture(2, 2, 1, {0, 1, 2, kInfinity}), good), Error);
  EXPECT_THROW(compare(picture(1, 1, 1, {kInfinity}), picture(1, 1, 1, {-kInfinity})), Error);
}

TEST(Compare, NamesTheSizesThatDiffer) {
  EXPECT_THAT(message_of(Picture(2, 1, 4), Picture(1, 2, 4)),
              testing::AllOf(testing::HasSubstr("2 x 1 x 4"), testing::HasSubstr("1 x 2 x 4")));
  EXPECT_THROW(compare(Picture(1, 1, 4), Picture(1, 1, 1)), Error);
  EXPECT_THROW(compare(Picture(), Picture()), Error);
  EXPECT_THROW(compare(picture(2, 1, 1, {0}), picture(2, 1, 1, {0})), Error);
}

TEST(ReachesPsnr, PerfectPicturesAlwaysDo) {
  EXPECT_TRUE(reaches_psnr({.rmse = 0, .max = 0, .psnr_db = std::nullopt, .mrse = 0}, 100));
  EXPECT_TRUE(reaches_psnr({.rmse = 0.1, .max = 0.1, .psnr_db = 20, .mrse = 0}, 20));
  EXPECT_FALSE(reaches_psnr({.rmse = 0.1, .max = 0.1, .psnr_db = 20, .mrse = 0}, 20.1));
}

TEST(PixelErrors, AreTheLargestOverTheChannelsAndTheirPercentilesAreOnes) {
  const Picture a = picture(2, 2, 4, {0, 0, 0, 0, 0.1, 0, 0, 0.3, 0, 0, 0, 0.2, 0, 0, 0.4, 0});
  const Picture b = picture(2, 2, 4, std::vector<double>(16, 0.0));
  const std::vector<double> errors = pixel_errors(a, b);
  EXPECT_EQ(errors, (std::vector<double>{0, 0.2, 0.3, 0.4}));
  EXPECT_EQ(percentile(errors, 0.5), 0.2);
  EXPECT_EQ(percentile(errors, 0.75), 0.3);
  EXPECT_EQ(percentile(errors, 0.95), 0.4);
  EXPECT_EQ(percentile(errors, 0), 0);
  EXPECT_EQ(share_within(errors, 0.3), 0.75);
  EXPECT_EQ(share_within(errors, 0.29), 0.5);
}

TEST(ErrorMetricsTable, PerfectValuesAreThoseOfAPerfectPicture) {
  const Picture p = picture(1, 1, 4, {0, 0, 0, 0});
  const ErrorMetrics error = compare(p, p);
  const std::map<std::string_view, std::optional<double>> values = {
      {"rmse", error.rmse}, {"max", error.max}, {"psnr_db", error.psnr_db}, {"mrse", error.mrse}};
  for (const Metric& metric : error_metrics()) {
    EXPECT_EQ(metric.perfect, values.at(metric.name)) << metric.name;
    EXPECT_EQ(metric.lower_is_better, metric.name != "psnr_db");
  }
  EXPECT_EQ(error_metrics().size(), values.size());
}

}  // namespace
}  // namespace amrtex
