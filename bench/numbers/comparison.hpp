// Two programs measured several times: is the second slower, faster, the same, or can nobody tell?
//
// A value is what one process measured. Frames of a process share its memory layout, its compiled shaders and the machine's mood
// of that minute, so a hundred of them say little more than one; processes are what is counted.
//
// Test: Mann and Whitney's, exact. The rank sum's distribution is that over all ways to deal the values to A and B, counted by
// dynamic programming, ties at their mean rank. It assumes no shape of noise, and outliers, which times have on one side, weigh
// as their rank.
//
// Interval of the ratio: all ratios by which A's values can be multiplied without that test seeing a difference to B's (Hodges
// and Lehmann). Its ends are two of the n·m ratios of a value of B and one of A. A bootstrap of a median draws from a handful of
// values and holds less than it says for five of them; an interval of two medians apart is nearly twice as wide. This one is
// exact from four values a side on where noise multiplies both alike, and says the same as the test.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace amrtex {

struct RankTest {
  double p = 1;           ///< two-sided
  double smallest_p = 1;  ///< where the values were dealt so that all of one side are above the other's, ties as they are
};
/// Throws Error where a side has no values or one is not finite. The work grows as (n + m)^2 n^2: 8 against 8 take microseconds,
/// 100 against 100 a second.
RankTest rank_test(std::span<const double> a, std::span<const double> b);
/// The smallest two-sided p of n against m values without ties: 2 / (n + m over n).
double smallest_rank_p(std::size_t n, std::size_t m);

struct RatioInterval {
  double ratio = 1;  ///< median of B over median of A
  double lower = 1;
  double upper = 1;
  double coverage = 0;  ///< less than 1 - level where there are too few values; then it is from the least ratio to the largest
};
/// Values above 0. Throws Error for others, and where a side has none.
RatioInterval ratio_of_medians(std::span<const double> a, std::span<const double> b, double level);

/// Adjusted p, in the order given: a row is called where its own is at most the level. Then no row is called wrongly in 1 - level
/// of all families, however the rows depend on each other.
std::vector<double> holm(std::span<const double> p);

/// The fewest processes a side that can call one of so many rows.
std::size_t smallest_repeat(std::size_t rows, double level);

struct ComparisonRules {
  double effect = 0.02;  ///< ratios from 1 / (1 + effect) to 1 + effect are no change that matters
  double level = 0.05;
};

enum class Verdict { faster, slower, same, cannot_tell };
std::string_view verdict_name(Verdict verdict);

/// What was measured of one row: a value a process.
struct MeasuredRow {
  std::vector<double> a, b;
  /// Processes that do not count, since their baseline drifted.
  std::size_t drifted_a = 0, drifted_b = 0;
};

struct Comparison {
  std::size_t n_a = 0, n_b = 0;
  double median_a = 0, median_b = 0;
  RatioInterval interval;
  double p = 1;
  std::optional<double> adjusted_p;  ///< nothing where n is too small to reach the level even alone
  Verdict verdict = Verdict::cannot_tell;
  std::string reason;  ///< of cannot_tell; else empty
};

/// All rows are one family for Holm's correction: those that can reach the level alone. `slower`: called, and the ratio is at
/// least 1 + effect; `faster` likewise; `same`: the interval lies within the effect; both do not depend on which side is called
/// A.
std::vector<Comparison> compare_rows(std::span<const MeasuredRow> rows, const ComparisonRules& rules);

/// Values of a row by repetition; those of A and B have nothing to do with each other.
struct RepeatedRow {
  std::map<int, double> a, b;
};
/// What rows have in common: a value a repetition, the middle of what its rows are off from their own level, times the middle
/// level. Rows of one repetition share its minutes, so together they are one value. Rows without values on both sides are left
/// out.
MeasuredRow pooled(std::span<const RepeatedRow> rows);

}  // namespace amrtex
