// Fronts and fastest points of small sets whose answer can be seen.
#include "bench/numbers/pareto.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace amrtex {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(ParetoFront, IsWhatNoOtherPointBeats) {
  // 1 is slower and less exact than 0; 4 than 3; 0, 3 and 2 each win in something
  const std::vector<CostPoint> points = {{1, 0.5}, {2, 0.6}, {4, 0.1}, {3, 0.2}, {3.5, 0.3}};
  EXPECT_THAT(pareto_front(points), ElementsAre(0, 3, 2));
}

TEST(ParetoFront, IsEveryPointOfAHyperbola) {
  // error = 1 / time: whoever is faster is less exact
  std::vector<CostPoint> points;
  for (int i = 1; i <= 5; ++i) points.push_back({static_cast<double>(i), 1.0 / i});
  EXPECT_THAT(pareto_front(points), ElementsAre(0, 1, 2, 3, 4));
}

TEST(ParetoFront, KeepsOneOfEqualPointsAndTheBetterOfHalfEqualOnes) {
  EXPECT_THAT(pareto_front(std::vector<CostPoint>{{1, 1}, {1, 1}}), ElementsAre(0)) << "alike: the first";
  EXPECT_THAT(pareto_front(std::vector<CostPoint>{{1, 2}, {1, 1}}), ElementsAre(1)) << "equally fast: the exact one";
  EXPECT_THAT(pareto_front(std::vector<CostPoint>{{2, 1}, {1, 1}}), ElementsAre(1)) << "equally exact: the fast one";
}

TEST(ParetoFront, HasExactPicturesOnIt) {
  EXPECT_THAT(pareto_front(std::vector<CostPoint>{{1, 0.1}, {2, 0}, {3, 0}}), ElementsAre(0, 1)) << "0 is a valid error";
}

TEST(ParetoFront, PassesOverWhatWasNotMeasured) {
  const std::vector<CostPoint> points = {{kNaN, 0}, {1, kNaN}, {2, 1}, {0.5, kInfinity}, {kInfinity, 0}, {kNaN, kNaN}};
  EXPECT_THAT(pareto_front(points), ElementsAre(2));
  EXPECT_EQ(fastest_within(points, 10), 2u);
  EXPECT_EQ(most_exact(points), 2u);
}

TEST(ParetoFront, OfNothingIsEmpty) {
  EXPECT_THAT(pareto_front({}), IsEmpty());
  EXPECT_THAT(pareto_front(std::vector<CostPoint>{{kNaN, kNaN}}), IsEmpty());
  EXPECT_EQ(fastest_within({}, 1), std::nullopt);
  EXPECT_EQ(most_exact({}), std::nullopt);
}

TEST(ParetoFront, BeatsOrEqualsEveryPointAndNoPointOfItself) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> few(0, 9);  // small numbers, so that ties are many
  for (int round = 0; round < 100; ++round) {
    std::vector<CostPoint> points;
    for (int i = 0; i < 30; ++i) points.push_back({static_cast<double>(few(random)), static_cast<double>(few(random))});
    const auto front = pareto_front(points);
    for (const CostPoint& p : points)
      EXPECT_TRUE(std::any_of(front.begin(), front.end(),
                              [&](std::size_t i) { return points[i].time <= p.time && points[i].error <= p.error; }));
    for (std::size_t i = 1; i < front.size(); ++i) {
      EXPECT_LT(points[front[i - 1]].time, points[front[i]].time);
      EXPECT_GT(points[front[i - 1]].error, points[front[i]].error);
    }
  }
}

TEST(FastestWithin, IsTheFastestThatReachesTheErrorAndNotTheMostExact) {
  const std::vector<CostPoint> points = {{1, 1e-1}, {2, 1e-2}, {3, 1e-3}, {9, 1e-4}, {8, 1e-2}};
  EXPECT_EQ(fastest_within(points, 1e-2), 1u) << "a bound that is just reached is reached";
  EXPECT_EQ(fastest_within(points, 0.99e-2), 2u);
  EXPECT_EQ(fastest_within(points, 1), 0u);
  EXPECT_EQ(fastest_within(points, 1e-5), std::nullopt);
  EXPECT_EQ(most_exact(points), 3u);
}

TEST(FastestWithin, PrefersTheMoreExactOfEquallyFastOnes) {
  EXPECT_EQ(fastest_within(std::vector<CostPoint>{{1, 0.5}, {1, 0.25}, {1, 0.25}}, 1), 1u);
}

TEST(RelativeRmse, FallsTenfoldEveryTwentyDecibels) {
  EXPECT_DOUBLE_EQ(relative_rmse(0), 1);
  EXPECT_DOUBLE_EQ(relative_rmse(20), 0.1);
  EXPECT_NEAR(relative_rmse(60), 1e-3, 1e-18);
}

}  // namespace
}  // namespace amrtex
