// Which of two runs is slower, and when nobody can tell: the numbers behind it, and how points of two folders find each other.
#include "bench/numbers/comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <random>

#include "bench/numbers/statistics.hpp"
#include "bench/records/merge_records.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/records/stored_picture.hpp"
#include "bench/report/compare.hpp"
#include "bench/report/repetitions.hpp"
#include "bench/report/report.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

using Values = std::vector<double>;

// --- the rank test ---

/// Twice the mean rank of each value among all.
std::vector<int> doubled_ranks(const Values& all) {
  std::vector<int> ranks;
  for (const double v : all) {
    const auto below = std::count_if(all.begin(), all.end(), [&](double x) { return x < v; });
    ranks.push_back(static_cast<int>(2 * below + std::count(all.begin(), all.end(), v) + 1));
  }
  return ranks;
}

/// By all ways to deal the values: how many are at least as far from the mean as the one seen, and how many are the farthest.
RankTest enumerated(const Values& a, const Values& b) {
  Values all = a;
  all.insert(all.end(), b.begin(), b.end());
  const std::vector<int> ranks = doubled_ranks(all);
  std::vector<bool> of_a(all.size());
  std::fill(of_a.end() - static_cast<std::ptrdiff_t>(a.size()), of_a.end(), true);
  const int mean = static_cast<int>(a.size() * (all.size() + 1));
  std::vector<int> off;
  do {
    int sum = 0;
    for (std::size_t i = 0; i < all.size(); ++i) sum += of_a[i] ? ranks[i] : 0;
    off.push_back(std::abs(sum - mean));
  } while (std::next_permutation(of_a.begin(), of_a.end()));
  const int seen = std::abs(std::accumulate(ranks.begin(), ranks.begin() + static_cast<std::ptrdiff_t>(a.size()), 0) - mean);
  const int farthest = *std::max_element(off.begin(), off.end());
  const auto share = [&](int least) {
    return static_cast<double>(std::count_if(off.begin(), off.end(), [&](int o) { return o >= least; })) /
           static_cast<double>(off.size());
  };
  return {share(seen), share(farthest)};
}

void expect_enumerated(const Values& a, const Values& b) {
  const RankTest test = rank_test(a, b), by_hand = enumerated(a, b);
  EXPECT_NEAR(test.p, by_hand.p, 1e-12);
  EXPECT_NEAR(test.smallest_p, by_hand.smallest_p, 1e-12);
}

TEST(RankTest, IsThatOfAllWaysToDealTheValues) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(0, 1);
  std::uniform_int_distribution<int> few(0, 3);  // many ties
  for (const auto& [n, m] : {std::pair{1, 1}, {1, 6}, {3, 3}, {5, 5}, {4, 7}, {8, 6}}) {
    Values a, b, tied_a, tied_b;
    for (int i = 0; i < n; ++i) {
      a.push_back(anywhere(random));
      tied_a.push_back(few(random));
    }
    for (int i = 0; i < m; ++i) {
      b.push_back(anywhere(random) + 0.3);
      tied_b.push_back(few(random) + 1);
    }
    expect_enumerated(a, b);
    expect_enumerated(tied_a, tied_b);
  }
}

// of 252 ways to deal ten values, two have all of one side above the other
TEST(RankTest, OfFiveAgainstFiveReaches2In252) {
  const RankTest test = rank_test(Values{1, 2, 3, 4, 5}, Values{6, 7, 8, 9, 10});
  EXPECT_NEAR(test.p, 2.0 / 252, 1e-15);
  EXPECT_NEAR(test.smallest_p, 2.0 / 252, 1e-15);
  EXPECT_NEAR(smallest_rank_p(5, 5), 2.0 / 252, 1e-15);
  EXPECT_NEAR(smallest_rank_p(8, 8), 2.0 / 12870, 1e-16);
  EXPECT_NEAR(smallest_rank_p(2, 3), 0.2, 1e-15);
}

TEST(RankTest, OfEqualValuesSeesNothing) {
  EXPECT_EQ(rank_test(Values{3, 3, 3}, Values{3, 3}).p, 1);
  EXPECT_EQ(rank_test(Values{3, 3, 3}, Values{3, 3}).smallest_p, 1);
}

// the normal approximation of the rank sum, z = shift / sqrt(n m (n + m + 1) / 12)
TEST(RankTest, OfManyValuesIsNearlyNormal) {
  Values a(40), b(40);
  for (int i = 0; i < 40; ++i) {
    a[static_cast<std::size_t>(i)] = i;
    b[static_cast<std::size_t>(i)] = i + 10.5;
  }
  double pairs = 0;  // of which b's is smaller
  for (const double x : a)
    for (const double y : b) pairs += y < x ? 1 : 0;
  const double z = (800 - pairs - 0.5) / std::sqrt(40.0 * 40 * 81 / 12);
  EXPECT_NEAR(rank_test(a, b).p, std::erfc(z / std::sqrt(2.0)), 1e-3);
}

TEST(RankTest, RefusesNothingAndNoNumbers) {
  EXPECT_THROW(rank_test(Values{}, Values{1}), Error);
  EXPECT_THROW(rank_test(Values{1}, Values{std::nan("")}), Error);
}

// --- the interval ---

// 2 P(U <= 2) = 8 / 252, and 2 P(U <= 3) = 14 / 252 > 5 %: two of the 25 ratios are left out at each end
TEST(RatioOfMedians, OfFiveAgainstFiveLeavesOutTwoRatiosAtEachEnd) {
  const Values a = {1, 1.1, 1.2, 1.3, 1.4}, b = {2, 2.3, 2.5, 2.9, 3.1};
  Values ratios;
  for (const double x : a)
    for (const double y : b) ratios.push_back(y / x);
  std::sort(ratios.begin(), ratios.end());
  const RatioInterval interval = ratio_of_medians(a, b, 0.05);
  EXPECT_DOUBLE_EQ(interval.ratio, 2.5 / 1.2);
  EXPECT_EQ(interval.lower, ratios[2]);
  EXPECT_EQ(interval.upper, ratios[22]);
  EXPECT_NEAR(interval.coverage, 1 - 8.0 / 252, 1e-12);
}

TEST(RatioOfMedians, OfTooFewValuesIsFromTheLeastRatioToTheLargest) {
  const RatioInterval interval = ratio_of_medians(Values{1, 2}, Values{3, 4}, 0.05);
  EXPECT_EQ(interval.lower, 1.5);
  EXPECT_EQ(interval.upper, 4);
  EXPECT_NEAR(interval.coverage, 1 - 2.0 / 6, 1e-12);
  EXPECT_EQ(ratio_of_medians(Values{2}, Values{3}, 0.05).coverage, 0);
}

// what the interval holds the test does not reject, and the reverse
TEST(RatioOfMedians, SaysTheSameAsTheTest) {
  std::mt19937 random(2);
  std::lognormal_distribution<double> noise(0, 0.1);
  for (int trial = 0; trial < 20; ++trial) {
    Values a(6), b(7);
    for (double& x : a) x = noise(random);
    for (double& x : b) x = noise(random);
    const RatioInterval interval = ratio_of_medians(a, b, 0.05);
    const auto p_of = [&](double ratio) {
      Values scaled = a;
      for (double& x : scaled) x *= ratio;
      return rank_test(scaled, b).p;
    };
    EXPECT_LE(p_of(interval.lower * (1 - 1e-9)), 0.05);
    EXPECT_GT(p_of(interval.lower * (1 + 1e-9)), 0.05);
    EXPECT_GT(p_of(interval.upper * (1 - 1e-9)), 0.05);
    EXPECT_LE(p_of(interval.upper * (1 + 1e-9)), 0.05);
  }
}

TEST(RatioOfMedians, HoldsTheTrueRatioAsOftenAsItSays) {
  std::mt19937 random(3);
  std::lognormal_distribution<double> noise(0, 0.05);
  constexpr int kTrials = 4000;
  for (const std::size_t n : {4u, 5u, 8u}) {
    int held = 0;
    double coverage = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      Values a(n), b(n);
      for (double& x : a) x = noise(random);
      for (double& x : b) x = 1.1 * noise(random);
      const RatioInterval interval = ratio_of_medians(a, b, 0.05);
      coverage = interval.coverage;
      held += interval.lower <= 1.1 && 1.1 <= interval.upper ? 1 : 0;
    }
    EXPECT_GE(coverage, 0.95);
    EXPECT_NEAR(held / double{kTrials}, coverage, 4 * std::sqrt(coverage * (1 - coverage) / kTrials)) << n;
  }
}

TEST(RatioOfMedians, TurnsOverWithItsSides) {
  const Values a = {1, 1.2, 1.25, 1.4, 2}, b = {1.1, 1.3, 1.6, 1.7, 1.9, 2.2};
  const RatioInterval forth = ratio_of_medians(a, b, 0.05), back = ratio_of_medians(b, a, 0.05);
  EXPECT_NEAR(forth.ratio * back.ratio, 1, 1e-14);
  EXPECT_NEAR(forth.lower * back.upper, 1, 1e-14);
  EXPECT_NEAR(forth.upper * back.lower, 1, 1e-14);
}

TEST(RatioOfMedians, RefusesWhatHasNoRatio) {
  EXPECT_THROW(ratio_of_medians(Values{0, 1}, Values{1}, 0.05), Error);
  EXPECT_THROW(ratio_of_medians(Values{1}, Values{-1}, 0.05), Error);
  EXPECT_THROW(ratio_of_medians(Values{1}, Values{}, 0.05), Error);
}

// --- many rows ---

// sorted 0.005, 0.01, 0.03, 0.04: times 4, 3, 2, 1 and never falling: 0.02, 0.03, 0.06, 0.06
TEST(Holm, OfFourRowsByHand) {
  const std::vector<double> adjusted = holm(Values{0.01, 0.04, 0.03, 0.005});
  EXPECT_NEAR(adjusted[0], 0.03, 1e-15);
  EXPECT_NEAR(adjusted[1], 0.06, 1e-15);
  EXPECT_NEAR(adjusted[2], 0.06, 1e-15);
  EXPECT_NEAR(adjusted[3], 0.02, 1e-15);
  EXPECT_THAT(holm(Values{0.9, 0.8}), ElementsAre(1, 1));
  EXPECT_THAT(holm(Values{}), IsEmpty());
}

// 6 * 2 / 252 = 0.0476, 7 * 2 / 252 = 0.0556; 321 * 2 / 12870 = 0.0499
TEST(SmallestRepeat, IsFiveForSixRowsAndEightForThreeHundred) {
  EXPECT_EQ(smallest_repeat(1, 0.05), 4u);
  EXPECT_EQ(smallest_repeat(6, 0.05), 5u);
  EXPECT_EQ(smallest_repeat(7, 0.05), 6u);
  EXPECT_EQ(smallest_repeat(300, 0.05), 8u);
  EXPECT_EQ(smallest_repeat(321, 0.05), 8u);
  EXPECT_EQ(smallest_repeat(322, 0.05), 9u);
  EXPECT_EQ(smallest_repeat(0, 0.05), 4u);
}

/// n against n values, one side wholly above the other.
MeasuredRow apart(std::size_t n, double ratio) {
  MeasuredRow row;
  for (std::size_t i = 0; i < n; ++i) {
    row.a.push_back(1 + 1e-4 * static_cast<double>(i));
    row.b.push_back(ratio * (1 + 1e-4 * static_cast<double>(i)));
  }
  return row;
}

std::vector<Verdict> verdicts(const std::vector<Comparison>& comparisons) {
  std::vector<Verdict> list;
  for (const Comparison& c : comparisons) list.push_back(c.verdict);
  return list;
}

std::vector<MeasuredRow> times(std::size_t count, const MeasuredRow& row) { return std::vector<MeasuredRow>(count, row); }

TEST(CompareRows, FiveAgainstFiveCannotDecideFromSevenRowsOn) {
  EXPECT_THAT(verdicts(compare_rows(times(6, apart(5, 1.5)), {})), Each(Verdict::slower));
  const auto seven = compare_rows(times(7, apart(5, 1.5)), {});
  EXPECT_THAT(verdicts(seven), Each(Verdict::cannot_tell));
  EXPECT_EQ(seven[0].reason, "n too small: 5 against 5 cannot decide 7 rows, --repeat 6 can");
  EXPECT_THAT(verdicts(compare_rows(times(7, apart(6, 1.5)), {})), Each(Verdict::slower));
}

TEST(CompareRows, EightAgainstEightDecideThreeHundred) {
  EXPECT_THAT(verdicts(compare_rows(times(300, apart(8, 1.5)), {})), Each(Verdict::slower));
  EXPECT_THAT(verdicts(compare_rows(times(322, apart(8, 1.5)), {})), Each(Verdict::cannot_tell));
}

TEST(CompareRows, RowsThatCannotReachTheLevelDoNotCount) {
  std::vector<MeasuredRow> rows = times(6, apart(5, 1.5));
  rows.resize(16, apart(3, 1.5));  // 2 / 20 at best
  const auto comparisons = compare_rows(rows, {});
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(comparisons[i].verdict, Verdict::slower);
  for (std::size_t i = 6; i < 16; ++i) {
    EXPECT_EQ(comparisons[i].verdict, Verdict::cannot_tell);
    EXPECT_FALSE(comparisons[i].adjusted_p);
    EXPECT_THAT(comparisons[i].reason, HasSubstr("n too small: 3 against 3"));
  }
}

TEST(CompareRows, AnEffectBelowTheLeastThatMattersIsTheSame) {
  EXPECT_EQ(compare_rows(times(1, apart(5, 1.01)), {})[0].verdict, Verdict::same);
  EXPECT_EQ(compare_rows(times(1, apart(5, 1.03)), {})[0].verdict, Verdict::slower);
  EXPECT_EQ(compare_rows(times(1, apart(5, 1 / 1.03)), {})[0].verdict, Verdict::faster);
  EXPECT_EQ(compare_rows(times(1, apart(5, 1.03)), {.effect = 0.05})[0].verdict, Verdict::same);
  EXPECT_EQ(compare_rows(times(9, apart(5, 1.0)), {})[0].verdict, Verdict::same) << "same needs no test";
}

TEST(CompareRows, SidesMayChangePlaces) {
  std::mt19937 random(4);
  std::lognormal_distribution<double> noise(0, 0.02);
  std::vector<MeasuredRow> forth, back;
  for (int i = 0; i < 40; ++i) {
    MeasuredRow row;
    for (int n = 0; n < 6; ++n) row.a.push_back(noise(random));
    for (int n = 0; n < 8; ++n) row.b.push_back((1 + 0.003 * i) * noise(random));
    forth.push_back(row);
    std::swap(row.a, row.b);
    back.push_back(row);
  }
  const auto verdict_forth = verdicts(compare_rows(forth, {})), verdict_back = verdicts(compare_rows(back, {}));
  for (std::size_t i = 0; i < forth.size(); ++i) {
    const bool turned = verdict_forth[i] == Verdict::slower;
    EXPECT_EQ(verdict_back[i], turned ? Verdict::faster : verdict_forth[i]);
  }
  EXPECT_THAT(verdict_forth, testing::Contains(Verdict::slower));
}

TEST(CompareRows, SayWhyNobodyCanTell) {
  const auto reason = [](const MeasuredRow& row) { return compare_rows(times(1, row), {})[0].reason; };
  EXPECT_EQ(reason({{1}, {}}), "no times on both sides");
  EXPECT_THAT(reason({{1}, {}, 2, 3}),
              HasSubstr("baselines drifted by more than 15 % in 2 of 3 repetitions of A and 3 of 3 of B"));
  EXPECT_THAT(reason({{1, 2, 3}, {4, 5, 6}, 2, 2}), AllOf(HasSubstr("drifted"), HasSubstr("3 against 3, is too few for 1 rows")));
  EXPECT_THAT(reason({{1, 2, 3, 4, 5}, {1.1, 2.1, 3.1, 4.1, 5.1}}), HasSubstr("the ratio may be from"));
  // apart, but by 1.01 to 1.03
  EXPECT_EQ(reason({{1, 1.001, 1.002, 1.003, 1.004}, {1.0181, 1.0182, 1.0183, 1.0184, 1.032}}),
            "differs, but perhaps by less than 2 %");
}

/// 24 rows of 8 against 8 processes; every fourth row's B is `slowdown` times slower.
std::vector<MeasuredRow> simulated(std::mt19937& random, double slowdown) {
  std::lognormal_distribution<double> noise(0, 0.03);
  std::vector<MeasuredRow> rows(24);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (int n = 0; n < 8; ++n) {
      rows[i].a.push_back(noise(random));
      rows[i].b.push_back((i % 4 == 0 ? slowdown : 1) * noise(random));
    }
  return rows;
}

std::size_t called(const std::vector<Comparison>& comparisons) {
  return static_cast<std::size_t>(std::count_if(comparisons.begin(), comparisons.end(), [](const Comparison& c) {
    return c.verdict == Verdict::slower || c.verdict == Verdict::faster;
  }));
}

// Holm: at most one pair of runs in twenty has any row that is called
TEST(CompareRows, OfOneProgramCallNoMoreThanTheLevel) {
  std::mt19937 random(5);
  std::size_t rows_called = 0, pairs_called = 0;
  constexpr std::size_t kPairs = 400;
  for (std::size_t pair = 0; pair < kPairs; ++pair) {
    const std::size_t here = called(compare_rows(simulated(random, 1), {}));
    rows_called += here;
    pairs_called += here > 0 ? 1 : 0;
  }
  EXPECT_LE(static_cast<double>(pairs_called), 0.05 * kPairs + 4 * std::sqrt(0.05 * 0.95 * kPairs));
  EXPECT_LE(static_cast<double>(rows_called), 0.05 * kPairs * 24);
}

TEST(CompareRows, FindASlowdownOfTenPerCent) {
  std::mt19937 random(6);
  int found = 0;
  for (int pair = 0; pair < 20; ++pair) {
    const auto comparisons = compare_rows(simulated(random, 1.1), {});
    int slower = 0;
    for (std::size_t i = 0; i < comparisons.size(); i += 4) slower += comparisons[i].verdict == Verdict::slower ? 1 : 0;
    found += slower >= 4 ? 1 : 0;  // of six rows
  }
  EXPECT_GE(found, 18);
}

TEST(Pooled, OneRowIsItself) {
  const MeasuredRow row = pooled(std::vector<RepeatedRow>{{{{0, 2.0}, {3, 4.0}}, {{1, 8.0}}}});
  ASSERT_THAT(row.a, SizeIs(2));
  EXPECT_NEAR(row.a[0], 2, 1e-14);
  EXPECT_NEAR(row.a[1], 4, 1e-14);
  ASSERT_THAT(row.b, SizeIs(1));
  EXPECT_NEAR(row.b[0], 8, 1e-14);
}

// rows of 1, 10 and 100 that move together by 2 from A to B; one of a repetition is missing
TEST(Pooled, RowsOfOneRepetitionAreOneValue) {
  std::vector<RepeatedRow> rows;
  for (const double level : {1.0, 10.0, 100.0})
    rows.push_back({{{0, level}, {1, level * 1.1}}, {{0, level * 2}, {1, level * 2.2}}});
  rows[2].a.erase(1);
  rows.push_back({{{0, 5.0}}, {}});
  const MeasuredRow row = pooled(rows);
  ASSERT_THAT(row.a, SizeIs(2));
  ASSERT_THAT(row.b, SizeIs(2));
  EXPECT_NEAR(row.b[0] / row.a[0], 2, 1e-12);
  EXPECT_NEAR(row.a[1] / row.a[0], 1.1, 1e-12);
  EXPECT_TRUE(pooled(std::vector<RepeatedRow>{}).a.empty());
}

// --- folders ---

/// A measured record, complete enough to be written.
Json record(const std::string& encoding, int repetition, double wall_ms, double before, double after) {
  Json r = blank_record(Status::ok);
  r["experiment"] = "sizes";
  r["configuration"] = "c-" + encoding;
  r["implementation"] = "i1";
  r["repetition"] = repetition;
  r["dataset"] = {{"name", "blobs"},      {"source", nullptr}, {"hash", "h1"},  {"exact_hash", "e1"}, {"leaf_cells", 1000},
                  {"stored_cells", 1100}, {"levels", 3},       {"patches", 10}, {"field", "phi"}};
  r["check_reason"] = "no reference";
  r["encoding"] = encoding;
  r["build_parameters"] = Json::object();
  r["filter"] = "nearest";
  r["storage"] = "r32f";
  r["filtering"] = "manual";
  r["render"] = {{"consumer", "raycast"}, {"mode", "dvr"},
                 {"sampling", "lattice"}, {"step", 1.0},
                 {"integrator", "i"},     {"width", 64},
                 {"height", 32},          {"view", Json::object()},
                 {"view_name", "view 1"}, {"transfer_function", Json::object()}};
  r["memory"] = {{"total_bytes", 100},
                 {"by_role", {{"payload", 60}, {"duplicated", 20}, {"topology", 20}, {"padding", 0}}},
                 {"texels_by_texture", nullptr},
                 {"texels_per_cell", 1.25},
                 {"host_peak_bytes", nullptr}};
  const Values samples = {wall_ms};
  r["frame"] = {
      {"wall_ms", timing_json(samples)}, {"gpu_ms", nullptr}, {"all_wall_ms", samples}, {"baseline_ms", {before, after}}};
  r["frame"]["relative"] = wall_ms / ((before + after) / 2);
  r["error"] = error_json({.rmse = 0.25, .max = 0.5, .psnr_db = 12.0, .mrse = 0}, "r");
  for (const char* key : {"split", "reference_error", "limited_by_reference", "within_tolerance_seen"}) r["error"][key] = nullptr;
  r["image_hash"] = "picture of " + encoding;
  r["context"] = {{"renderer", "llvmpipe"},
                  {"gl_version", "4.5"},
                  {"extensions_missing", nullptr},
                  {"cpu", "some"},
                  {"cores", 2},
                  {"environment", nullptr},
                  {"build_type", nullptr},
                  {"compiler", nullptr},
                  {"commit", nullptr},
                  {"dirty", nullptr},
                  {"shader_hash", nullptr},
                  {"date", "2026-01-01T00:00:00Z"},
                  {"device", "some"},
                  {"shader_cache", nullptr}};
  validate_record(r);
  return r;
}

/// How much slower than usual.
struct Slowness {
  double baseline = 1, kd_tree = 1, others = 1;
};

/// Eight encodings by eight processes. A process has its own speed, shared by the baseline; a time has a little noise besides.
std::vector<Json> run_of(unsigned seed, const Slowness& slow = {}) {
  constexpr const char* kNames[] = {"kd_tree",  "kd_tree 2", "kd_tree 3", "octree",
                                    "octree 2", "octree 3",  "uniform",   "exabricks"};
  std::mt19937 random(seed);
  std::lognormal_distribution<double> process(0, 0.02), noise(0, 0.01);
  std::vector<Json> records;
  for (int repetition = 0; repetition < 8; ++repetition) {
    const double speed = process(random);
    for (const char* name : kNames) {
      const bool kd_tree = std::string_view(name).starts_with("kd_tree");
      const double wall = 20 * speed * noise(random) * (kd_tree ? slow.kd_tree : slow.others);
      const double before = 10 * speed * noise(random) * slow.baseline, after = 10 * speed * noise(random) * slow.baseline;
      Json r = record(name, repetition, wall, before, after);
      if (kd_tree) r["encoding"] = "kd_tree";
      if (std::string_view(name).starts_with("octree")) r["encoding"] = "octree";
      records.push_back(std::move(r));
    }
  }
  return records;
}

/// The records of both sides stay, since the comparison points into them.
struct Compared {
  Compared(std::vector<Json> of_a, std::vector<Json> of_b)
      : a{"out/a", std::move(of_a)}, b{"out/b", std::move(of_b)}, result(compare_folders(a, b, {})) {}
  Compared(const Compared&) = delete;
  Compared& operator=(const Compared&) = delete;

  std::vector<Verdict> verdicts_of(const std::string& encoding) const {
    std::vector<Verdict> list;
    for (const ComparedPoint& p : result.points)
      if (p.a->at("encoding") == encoding) list.push_back(p.verdict);
    return list;
  }
  std::vector<std::string> differences() const {
    std::vector<std::string> list;
    for (const Difference& d : result.differences) list.push_back(d.what);
    return list;
  }

  ComparedFolder a, b;
  FolderComparison result;
};

template <class Change>
std::vector<Json> changed(std::vector<Json> records, Change change) {
  for (Json& r : records) change(r);
  return records;
}

std::string complaint(const ComparedFolder& a, const ComparedFolder& b) {
  try {
    compare_folders(a, b, {});
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(CompareFolders, OfOneProgramAreTheSame) {
  const Compared c(run_of(1), run_of(2));
  EXPECT_TRUE(c.result.one_context);
  EXPECT_THAT(c.result.points, SizeIs(8));
  EXPECT_THAT(c.differences(), IsEmpty());
  EXPECT_FALSE(has_findings(c.result));
  ASSERT_THAT(c.result.baselines, SizeIs(1));
  EXPECT_EQ(c.result.baselines[0].comparison.n_a, 8u) << "points of a process are one value";
  for (const ComparedPoint& p : c.result.points) {
    EXPECT_NE(p.verdict, Verdict::slower);
    EXPECT_NE(p.verdict, Verdict::faster);
  }
  EXPECT_EQ(c.result.smallest_repeat, 6u);
}

TEST(CompareFolders, FindASlowerEncoding) {
  const Compared c(run_of(3), run_of(4, {.kd_tree = 1.1}));
  EXPECT_THAT(c.verdicts_of("kd_tree"), ElementsAre(Verdict::slower, Verdict::slower, Verdict::slower));
  EXPECT_THAT(c.verdicts_of("octree"), Each(testing::AnyOf(Verdict::same, Verdict::cannot_tell)));
  ASSERT_THAT(c.result.encodings, SizeIs(2)) << "those with one point alone are no line";
  for (const ComparedLine& line : c.result.encodings)
    EXPECT_EQ(line.comparison.verdict == Verdict::slower, line.name == "kd_tree") << line.name;
  EXPECT_NE(c.result.baselines[0].comparison.verdict, Verdict::slower);
  EXPECT_TRUE(has_findings(c.result));
}

TEST(CompareFolders, AChangeOfAllIsALineOfItsOwn) {
  const Compared c(run_of(5), run_of(6, {.baseline = 1.1, .kd_tree = 1.1, .others = 1.1}));
  EXPECT_EQ(c.result.baselines[0].comparison.verdict, Verdict::slower);
  EXPECT_THAT(c.result.baselines[0].note, HasSubstr("its points changed with it"));
  EXPECT_NEAR(c.result.baselines[0].comparison.interval.ratio, 1.1, 0.05);
  for (const ComparedPoint& p : c.result.points) {
    EXPECT_FALSE(p.by_time);
    EXPECT_NE(p.verdict, Verdict::slower);
    EXPECT_EQ(p.time->verdict, Verdict::slower);
  }
  EXPECT_TRUE(has_findings(c.result));
}

// ratios to a baseline that became slower would call all else faster
TEST(CompareFolders, WhereTheBaselineAloneChangedPointsGoByTheirTimes) {
  const Compared c(run_of(7), run_of(8, {.baseline = 1.2, .kd_tree = 1.2}));
  EXPECT_EQ(c.result.baselines[0].comparison.verdict, Verdict::slower);
  EXPECT_THAT(c.result.baselines[0].note, HasSubstr("go by their times"));
  EXPECT_THAT(c.verdicts_of("kd_tree"), Each(Verdict::slower));
  EXPECT_THAT(c.verdicts_of("octree"), Each(testing::AnyOf(Verdict::same, Verdict::cannot_tell)));
}

TEST(CompareFolders, FindPlantedSlowdownsAndNothingElse) {
  int found = 0, common = 0, called_points = 0;
  for (unsigned pair = 0; pair < 20; ++pair) {
    const Compared one(run_of(100 + pair), run_of(200 + pair, {.kd_tree = 1.1}));
    const auto slower = one.verdicts_of("kd_tree");
    found += std::count(slower.begin(), slower.end(), Verdict::slower) == 3 ? 1 : 0;
    const Compared all(run_of(300 + pair), run_of(400 + pair, {.baseline = 1.1, .kd_tree = 1.1, .others = 1.1}));
    common += all.result.baselines[0].comparison.verdict == Verdict::slower ? 1 : 0;
    const Compared none(run_of(500 + pair), run_of(600 + pair));
    for (const ComparedPoint& p : none.result.points)
      called_points += p.verdict == Verdict::slower || p.verdict == Verdict::faster ? 1 : 0;
  }
  EXPECT_GE(found, 18);
  EXPECT_GE(common, 18);
  EXPECT_LE(called_points, 20 * 8 / 20) << "5 % of the rows";
}

TEST(CompareFolders, ProcessesWhoseBaselineDriftedDoNotCount) {
  std::vector<Json> drifted = run_of(9);
  for (Json& r : drifted)
    if (r["repetition"] < 5) r["frame"]["baseline_ms"][1] = 1.2 * r["frame"]["baseline_ms"][0].get<double>();
  const Compared c(run_of(10), drifted);
  for (const ComparedPoint& p : c.result.points) {
    EXPECT_EQ(p.relative->n_a, 8u);
    EXPECT_EQ(p.relative->n_b, 3u);
    if (p.verdict == Verdict::cannot_tell) {
      EXPECT_THAT(p.reason, HasSubstr("baselines drifted by more than 15 % in 0 of 8 repetitions of A and 5 of 8 of B"));
    }
  }
}

TEST(CompareFolders, WhatIsExactComesFirst) {
  std::vector<Json> other = run_of(12);
  for (Json& r : other) {
    if (r["configuration"] == "c-uniform") r["memory"]["by_role"]["payload"] = 61, r["memory"]["total_bytes"] = 101;
    if (r["configuration"] == "c-octree") r["image_hash"] = "another", r["error"]["max"] = 0.625;
    if (r["configuration"] == "c-exabricks" && r["repetition"] == 7) {
      r["status"] = "failed";
      r["reason"] = "a crash";
      r["frame"] = nullptr;
    }
  }
  const Compared c(run_of(11), other);
  EXPECT_THAT(c.differences(), testing::UnorderedElementsAre("/memory/total_bytes", "/memory/by_role/payload", "/error/max",
                                                             "/image_hash", "status"));
  for (const Difference& d : c.result.differences) {
    EXPECT_TRUE(d.counts);
    if (d.what == "status") {
      EXPECT_EQ(d.b, "1 failed, 7 ok");
    }
  }
  EXPECT_EQ(comparison_tables(c.result).front().title, "what differs");
  EXPECT_TRUE(has_findings(c.result));
}

TEST(CompareFolders, ARunThatDiffersFromItselfIsADifference) {
  std::vector<Json> flickers = run_of(13);
  flickers.back()["image_hash"] = "another";
  const Compared c(flickers, flickers);
  EXPECT_THAT(c.differences(), ElementsAre("/image_hash"));
  EXPECT_TRUE(c.result.differences[0].a.is_array());
}

Json elsewhere(Json r) {
  r["context"]["renderer"] = "Some GPU";
  return r;
}

TEST(CompareFolders, OfTwoContextsCompareRatiosAlone) {
  // twice as fast, and pictures and errors that another driver makes
  const auto other = [](Json& r) {
    r = elsewhere(r);
    for (const char* key : {"/frame/wall_ms/median", "/frame/baseline_ms/0", "/frame/baseline_ms/1"})
      r[Json::json_pointer(key)] = r[Json::json_pointer(key)].get<double>() / 2;
    r["image_hash"] = "another";
    r["error"]["rmse"] = 0.2500001;
  };
  const Compared c(run_of(14), changed(run_of(15, {.kd_tree = 1.1}), other));
  EXPECT_FALSE(c.result.one_context);
  EXPECT_THAT(c.verdicts_of("kd_tree"), Each(Verdict::slower));
  EXPECT_THAT(c.result.baselines, IsEmpty());
  for (const ComparedPoint& p : c.result.points) EXPECT_FALSE(p.time);
  EXPECT_THAT(c.differences(), Each("/error/rmse"));
  for (const Difference& d : c.result.differences) EXPECT_FALSE(d.counts);
}

TEST(CompareFolders, WithoutABaselineTwoContextsHaveNothingToCompare) {
  const auto bare = [](Json& r) { r["frame"]["baseline_ms"] = nullptr, r["frame"]["relative"] = nullptr; };
  const Compared one(changed(run_of(16), bare), changed(run_of(17, {.kd_tree = 1.3}), bare));
  EXPECT_THAT(one.verdicts_of("kd_tree"), Each(Verdict::slower)) << "by their times";
  const Compared two(changed(run_of(16), bare), changed(changed(run_of(17), bare), [](Json& r) { r = elsewhere(r); }));
  EXPECT_THAT(two.verdicts_of("kd_tree"), Each(Verdict::cannot_tell));
  EXPECT_THAT(two.result.points[0].reason, HasSubstr("no baseline beside it"));
}

TEST(CompareFolders, ContextsOfMergedFoldersArePairedWithThemselves) {
  std::vector<Json> both = run_of(18), faster = run_of(19);
  for (const Json& r : run_of(20)) both.push_back(elsewhere(r));
  const Compared c(both, faster);
  EXPECT_TRUE(c.result.one_context);
  EXPECT_THAT(c.result.points, SizeIs(8));
  EXPECT_THAT(c.result.notes, ElementsAre("out/a: 1 contexts that out/b lacks are left out"));
  std::vector<Json> other = both;
  const Compared merged(both, other);
  EXPECT_THAT(merged.result.points, SizeIs(16));
  EXPECT_THAT(merged.result.baselines, SizeIs(2));
  int tables = 0;
  for (const Table& table : comparison_tables(merged.result)) tables += table.title == "frame times" ? 1 : 0;
  EXPECT_EQ(tables, 2);
}

TEST(CompareFolders, APointIsOfTheProgramThatMeasuredItLast) {
  std::vector<Json> records = run_of(21);
  for (Json& r : records)
    if (r["repetition"] >= 5) r["implementation"] = "i0", r["context"]["date"] = "2025-01-01T00:00:00Z";
  const Compared c(records, run_of(22));
  EXPECT_EQ(c.result.points[0].relative->n_a, 5u);
  EXPECT_THAT(c.result.notes, ElementsAre("out/a: 24 records of older programs are left out"));
}

TEST(CompareFolders, SayWhatIsOnOneSideAlone) {
  std::vector<Json> fewer = run_of(23);
  std::erase_if(fewer, [](const Json& r) { return r["configuration"] == "c-uniform"; });
  const Compared c(run_of(24), fewer);
  EXPECT_THAT(c.result.only_a, SizeIs(1));
  EXPECT_THAT(c.result.only_b, IsEmpty());
  EXPECT_THAT(comparison_summary(c.result), HasSubstr("1 points only in A, 0 only in B"));
}

TEST(CompareFolders, RefuseWhatCannotBePaired) {
  const auto other = changed(run_of(2), [](Json& r) { r["configuration"] = "another " + r["configuration"].get<std::string>(); });
  EXPECT_THAT(complaint({"A", run_of(1)}, {"B", other}),
              AllOf(HasSubstr("A and B have no point in common, of 8 and 8"), HasSubstr("accepted")));
  EXPECT_THAT(complaint({"A", {}}, {"B", run_of(1)}), HasSubstr("A: no records; accepted"));
  const auto first_schema = changed(run_of(1), [](Json& r) { r["schema"] = kFirstSchema, r["configuration"] = nullptr; });
  EXPECT_THAT(complaint({"A", run_of(1)}, {"B", first_schema}), HasSubstr("B: its records, of schema 'amrtex-record/1'"));
  std::vector<Json> two = changed(run_of(1), [](Json& r) { r = elsewhere(r); });
  for (Json r : run_of(2)) {
    r["context"]["cores"] = 99;
    two.push_back(r);
  }
  EXPECT_THAT(complaint({"A", run_of(1)}, {"B", two}), HasSubstr("A holds 1 contexts and B 2, none of them in both"));
}

TEST(CompareFolders, AreToldToProgramsInFull) {
  const Compared c(run_of(25), run_of(26, {.kd_tree = 1.1}));
  const Json json = comparison_json(c.result);
  EXPECT_EQ(json["counts"]["slower"], 3);
  EXPECT_EQ(json["findings"], true);
  EXPECT_EQ(json["smallest_repeat"], 6);
  EXPECT_THAT(json["points"], SizeIs(8));
  for (const Json& point : json["points"]) {
    EXPECT_EQ(point["by"], "relative");
    EXPECT_EQ(point["relative"]["n"], Json({8, 8}));
    EXPECT_TRUE(point["configuration"].is_string());
    EXPECT_EQ(point["verdict"] == "cannot tell", point["reason"].is_string());
  }
}

// --- merging ---

class Merging : public testing::Test {
 protected:
  Merging() {
    std::string name = (fs::temp_directory_path() / "amrtex_merging_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~Merging() override { fs::remove_all(folder_); }

  fs::path at(const std::string& name) const { return folder_ / name; }
  fs::path written(const std::string& name, const std::vector<Json>& records) const {
    RecordFile file(at(name));
    for (const Json& r : records) file.append(r);
    return at(name);
  }
  MergedRecords merge(const std::vector<fs::path>& inputs) const { return merge_records(at("out"), inputs); }
  std::string complaint(const std::vector<fs::path>& inputs) const {
    try {
      merge(inputs);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  std::vector<Json> merged() const { return load_record_lines(at("out")).records; }

 private:
  fs::path folder_;
};

Json small(int repetition, double wall_ms) { return record("uniform", repetition, wall_ms, 10, 10); }

TEST_F(Merging, KeepsContextsApart) {
  const fs::path a = written("a", {small(0, 1), small(1, 2)}), b = written("b", {elsewhere(small(0, 3))});
  const MergedRecords result = merge({a, b});
  EXPECT_EQ(result.added, 3u);
  EXPECT_EQ(result.renumbered, 0u);
  EXPECT_THAT(merged(), SizeIs(3));
  EXPECT_THAT(make_tables(merged()), SizeIs(2));
}

TEST_F(Merging, TwiceChangesNothing) {
  const fs::path a = written("a", {small(0, 1), small(1, 2)}), b = written("b", {small(0, 3)});
  merge({a, b});
  const MergedRecords again = merge({b, a});
  EXPECT_EQ(again.added, 0u);
  EXPECT_EQ(again.present, 3u);
  EXPECT_THAT(merged(), SizeIs(3));
}

// two machines of one kind both have a repetition 0: they are two processes
TEST_F(Merging, LosesNoRepetition) {
  const MergedRecords result = merge({written("a", {small(0, 1), small(1, 2)}), written("b", {small(0, 3), small(1, 4)})});
  EXPECT_EQ(result.added, 4u);
  EXPECT_EQ(result.renumbered, 2u);
  std::vector<int> repetitions;
  for (const Json& r : merged()) repetitions.push_back(r["repetition"]);
  EXPECT_THAT(repetitions, ElementsAre(0, 1, 2, 3));
}

TEST_F(Merging, TakesPicturesAlong) {
  const std::string name = small(0, 1)["configuration"];
  const fs::path a = written("a", {small(0, 1)}), b = written("b", {small(0, 2)}), c = written("c", {elsewhere(small(0, 3))});
  Picture one(2, 1, 1), two(2, 1, 1);
  one.values = {1, 3};
  two.values = {5, 7};
  for (const auto& [folder, picture] : {std::pair(b, one), std::pair(c, two)}) {
    fs::create_directories(picture_folder(folder));
    write_stored_picture(picture_path(folder, name), {picture, std::nullopt});
    std::ofstream(picture_path(folder, name, ".png")) << "to look at";
  }
  EXPECT_EQ(merge({a, b, c}).pictures, 1u) << "a has none, b's is the first";
  EXPECT_EQ(read_stored_picture(picture_path(at("out"), name)).picture.values, one.values);
  EXPECT_TRUE(fs::exists(picture_path(at("out"), name, ".png")));
  EXPECT_EQ(merge({a, b, c}).pictures, 0u) << "merging twice changes nothing";
}

TEST_F(Merging, RefusesPointsOfTwoPrograms) {
  Json other = small(0, 2);
  other["implementation"] = "i2";
  const fs::path a = written("a", {small(0, 1)}), b = written("b", {other});
  EXPECT_THAT(complaint({a, b}), AllOf(HasSubstr(a.string()), HasSubstr(b.string()), HasSubstr("by two programs"),
                                       HasSubstr("accepted: folders of one program")));
  EXPECT_FALSE(fs::exists(at("out"))) << "nothing is written then";
  EXPECT_EQ(complaint({a}), "accepted");
  EXPECT_THAT(complaint({b}), HasSubstr("by two programs"));
  EXPECT_EQ(complaint({written("c", {elsewhere(other)})}), "accepted") << "on another machine it is another point";
}

TEST_F(Merging, RefusesWhatItCannotRead) {
  const fs::path a = written("a", {small(0, 1)});
  EXPECT_THAT(complaint({a, at("absent")}), HasSubstr("absent"));
  EXPECT_THAT(complaint({a, written("empty", {})}), HasSubstr("no records"));
  Json newer = small(0, 1);
  newer["schema"] = "amrtex-record/3";
  fs::create_directories(at("newer"));
  std::ofstream(at("newer") / "records.jsonl") << record_line(newer) << "\n";
  EXPECT_THAT(complaint({a, at("newer")}), AllOf(HasSubstr("newer"), HasSubstr("amrtex-record/3")));
  EXPECT_FALSE(fs::exists(at("out")));
}

TEST_F(Merging, TellsOfATornLine) {
  const fs::path a = written("a", {small(0, 1), small(1, 2)});
  fs::resize_file(a / "records.jsonl", fs::file_size(a / "records.jsonl") - 10);
  const MergedRecords result = merge({a});
  EXPECT_EQ(result.added, 1u);
  EXPECT_THAT(result.warnings, SizeIs(1));
}

// --- repetitions and contexts in tables ---

TEST(RepetitionsInTables, AreOneRowWithTheMedianOfProcesses) {
  std::vector<Json> records = {small(0, 1), small(1, 4), small(2, 2), record("octree", 0, 7, 10, 10)};
  records.push_back(elsewhere(small(0, 9)));
  const std::vector<Json> ones = one_a_point(records);
  ASSERT_THAT(ones, SizeIs(3));
  EXPECT_EQ(ones[0]["frame"]["wall_ms"]["median"], 2);
  EXPECT_EQ(ones[0]["frame"]["wall_ms"]["n"], 3);
  EXPECT_EQ(ones[0]["frame"]["relative"], 0.2);
  EXPECT_NO_THROW(validate_record(ones[0]));
  EXPECT_EQ(ones[1], records[3]) << "one alone stays as it is";
  EXPECT_EQ(ones[2], records[4]);
}

TEST(RepetitionsInTables, OfWhichOneFailedAreAFailure) {
  std::vector<Json> records = {small(0, 1), small(1, 4)};
  records[1]["status"] = "failed";
  records[1]["reason"] = "a crash";
  records[1]["frame"] = nullptr;
  EXPECT_EQ(one_a_point(records)[0]["reason"], "in 1 of 2 repetitions: a crash");
}

TEST(ContextsInTables, OfOneRendererAreToldApart) {
  std::vector<Json> records = {small(0, 1), small(0, 2), small(0, 3)};
  records[1]["context"]["cores"] = 64;
  records[2]["context"]["renderer"] = "Some GPU";
  std::vector<std::string> names;
  for (const Table& table : make_tables(records)) names.push_back(table.constants[0].second);
  EXPECT_THAT(names, ElementsAre("Some GPU", "llvmpipe, 2 cores", "llvmpipe, 64 cores"));
}

}  // namespace
}  // namespace amrtex
