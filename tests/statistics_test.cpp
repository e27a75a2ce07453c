#include "bench/numbers/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using Samples = std::vector<double>;

TEST(Median, IsTheMiddleOfAnyOrder) {
  EXPECT_EQ(median(Samples{3, 1, 2}), 2);
  EXPECT_EQ(median(Samples{4, 1, 2, 3}), 2.5);
  EXPECT_EQ(median(Samples{0}), 0);
}

TEST(Median, DoesNotOverflow) { EXPECT_EQ(median(Samples{1.7e308, 1.7e308}), 1.7e308); }

TEST(Summary, OfOneSampleIsThatSample) {
  const Summary s = summarize(Samples{7.5});
  EXPECT_EQ(s.median, 7.5);
  EXPECT_EQ(s.mad, 0);
  EXPECT_EQ(s.ci_lower, 7.5);
  EXPECT_EQ(s.ci_upper, 7.5);
  EXPECT_EQ(s.min, 7.5);
  EXPECT_EQ(s.n, 1u);
  EXPECT_EQ(s.coverage, 0);
}

TEST(Summary, MadIgnoresAnOutlier) {
  const Summary s = summarize(Samples{1, 2, 3, 4, 1000});
  EXPECT_EQ(s.median, 3);
  EXPECT_EQ(s.mad, 1);
  EXPECT_EQ(s.min, 1);
}

// Ranks from the tables of the sign test: of 9 samples the 2nd and 8th, 96.1 %.
TEST(Summary, IntervalOfNineSamples) {
  const Summary s = summarize(Samples{1, 2, 3, 4, 5, 6, 7, 8, 9});
  EXPECT_EQ(s.ci_lower, 2);
  EXPECT_EQ(s.ci_upper, 8);
  EXPECT_NEAR(s.coverage, 1 - 20.0 / 512, 1e-12);
}

TEST(Summary, FiveSamplesCannotGive95PerCent) {
  const Summary s = summarize(Samples{5, 4, 3, 2, 1});
  EXPECT_EQ(s.ci_lower, 1);
  EXPECT_EQ(s.ci_upper, 5);
  EXPECT_NEAR(s.coverage, 1 - 2.0 / 32, 1e-12);
  EXPECT_GE(summarize(Samples{1, 2, 3, 4, 5, 6}).coverage, 0.95);
}

TEST(Summary, IntervalOfManySamplesIsNarrow) {
  Samples samples(2001);
  std::iota(samples.begin(), samples.end(), 0.0);
  const Summary s = summarize(samples);
  // normal approximation: 1000 -+ 1.96 sqrt(n) / 2
  EXPECT_NEAR(s.ci_lower, 1000 - 0.98 * std::sqrt(2001.0), 2);
  EXPECT_NEAR(s.ci_upper, 1000 + 0.98 * std::sqrt(2001.0), 2);
  EXPECT_GE(s.coverage, 0.95);
}

TEST(Summary, IntervalHoldsTheTrueMedianAsOftenAsItSays) {
  std::mt19937 random(1);
  std::exponential_distribution<double> distribution(1);  // median ln 2
  int held = 0;
  constexpr int kTrials = 4000;
  for (int trial = 0; trial < kTrials; ++trial) {
    Samples samples(9);
    for (double& x : samples) x = distribution(random);
    const Summary s = summarize(samples);
    if (s.ci_lower <= std::log(2.0) && std::log(2.0) <= s.ci_upper) ++held;
  }
  EXPECT_NEAR(held / double{kTrials}, 1 - 20.0 / 512, 0.012);  // four standard deviations
}

TEST(Summary, RefusesNothingAndNoNumbers) {
  EXPECT_THROW(summarize(Samples{}), Error);
  EXPECT_THROW(summarize(Samples{1, std::nan("")}), Error);
  EXPECT_THROW(summarize(Samples{INFINITY}), Error);
}

TEST(LinearFit, IsTheLineWhereThereIsOne) {
  const auto fit = fit_line(Samples{1, 2, 4}, Samples{1, -1, -5});  // y = 3 - 2 x
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->slope, -2, 1e-14);
  EXPECT_NEAR(fit->at_zero, 3, 1e-14);
  EXPECT_NEAR(fit->correlation, -1, 1e-14);
}

TEST(LinearFit, HasTheSlopeOfLeastSquares) {
  // means 1 and 1; sums of products of deviations: xx 2, xy 1, yy 2; r = 1/2
  const auto fit = fit_line(Samples{0, 1, 2}, Samples{1, 0, 2});
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->slope, 0.5, 1e-14);
  EXPECT_NEAR(fit->at_zero, 0.5, 1e-14);
  EXPECT_NEAR(fit->correlation, 0.5, 1e-14);
}

TEST(LinearFit, IsNothingWhereALineMeansNothing) {
  EXPECT_FALSE(fit_line(Samples{0, 1}, Samples{0, 1}));
  EXPECT_FALSE(fit_line(Samples{2, 2, 2}, Samples{0, 1, 2}));
  EXPECT_FALSE(fit_line(Samples{0, 1, 2}, Samples{2, 2, 2}));
  EXPECT_THROW(fit_line(Samples{0, 1, 2}, Samples{2, 2}), Error);
  EXPECT_THROW(fit_line(Samples{0, 1, NAN}, Samples{2, 2, 1}), Error);
}

}  // namespace
}  // namespace amrtex
