#include "bench/numbers/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "bench/numbers/baseline_drift.hpp"
#include "bench/numbers/statistics.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Sums of probabilities are off by roundings: a p of exactly the level counts as reaching it.
bool reaches(double p, double level) { return p <= level * (1 + 1e-9); }

/// Twice the rank of each of the values, A's first; ties have their mean, so twice a rank is whole.
std::vector<std::size_t> doubled_ranks(std::span<const double> a, std::span<const double> b) {
  std::vector<double> values(a.begin(), a.end());
  values.insert(values.end(), b.begin(), b.end());
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::size_t> ranks;
  for (const double value : values) {
    const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), value);
    ranks.push_back(static_cast<std::size_t>(first - sorted.begin()) + 1 + static_cast<std::size_t>(last - sorted.begin()));
  }
  return ranks;
}

/// [s]: the probability that n of the ranks, drawn at random, add up to s. Ranks are asked for one after the other; with k taken
/// and `left` to be asked, each is taken with (n - k) / left. So no count overflows.
std::vector<double> sum_distribution(std::span<const std::size_t> ranks, std::size_t n) {
  const std::size_t most = std::accumulate(ranks.begin(), ranks.end(), std::size_t{0});
  std::vector<std::vector<double>> taken(n + 1, std::vector<double>(most + 1));
  taken[0][0] = 1;
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    const double left = static_cast<double>(ranks.size() - i);
    for (std::size_t k = std::min(i + 1, n) + 1; k-- > 0;) {
      const double stays = 1 - static_cast<double>(n - k) / left;
      for (double& p : taken[k]) p *= stays;
      if (k == 0) continue;
      const double joins = static_cast<double>(n - k + 1) / left;
      for (std::size_t s = ranks[i]; s <= most; ++s) taken[k][s] += taken[k - 1][s - ranks[i]] * joins;
    }
  }
  return std::move(taken[n]);
}

void require_values(std::span<const double> values) {
  if (values.empty()) throw Error("comparison: a side has no values");
  for (const double value : values)
    if (!std::isfinite(value)) throw Error("comparison: a value is not a finite number");
}

/// How many of the n * m ratios lie outside at each end, and how often the ratio does.
struct Outside {
  std::size_t ratios = 0;
  double probability = 0;  ///< on both sides together
};

/// Mann and Whitney's count of pairs of which B's is smaller is below k with the probability that the test gives it.
Outside ratios_outside(std::size_t n, std::size_t m, double level) {
  std::vector<std::size_t> ranks(n + m);
  std::iota(ranks.begin(), ranks.end(), std::size_t{1});
  const std::vector<double> p = sum_distribution(ranks, n);
  const std::size_t least = n * (n + 1) / 2;  // rank sum of the n smallest
  Outside outside{1, 2 * p[least]};
  for (std::size_t u = 1; u < n * m / 2; ++u) {
    const double wider = outside.probability + 2 * p[least + u];
    if (!reaches(wider, level)) break;
    outside = {u + 1, wider};
  }
  return outside;
}

std::string count_text(const Comparison& c) { return fmt::format("{} against {}", c.n_a, c.n_b); }

std::string drift_text(const MeasuredRow& row) {
  return fmt::format("baselines drifted by more than {:g} % in {} of {} repetitions of A and {} of {} of B", 100 * kBaselineDrift,
                     row.drifted_a, row.a.size() + row.drifted_a, row.drifted_b, row.b.size() + row.drifted_b);
}

/// The rows of one call of compare_rows().
struct Family {
  std::size_t rows = 0;     ///< with values on both sides
  std::size_t members = 0;  ///< of these, what can reach the level alone
  std::size_t called = 0;
  ComparisonRules rules;
};

std::string reason_of(const Comparison& c, const MeasuredRow& row, double smallest_p, const Family& family) {
  const bool drifted = row.drifted_a + row.drifted_b > 0;
  if (c.n_a == 0 || c.n_b == 0) return drifted ? drift_text(row) : "no times on both sides";
  const bool called = c.adjusted_p && reaches(*c.adjusted_p, family.rules.level);
  // Holm's last step asks this of each row that is not called
  const double asked = family.rules.level / static_cast<double>(std::max<std::size_t>(family.members - family.called, 1));
  if (!called && (!c.adjusted_p || !reaches(smallest_p, asked))) {
    if (drifted) return fmt::format("{}; the rest, {}, is too few for {} rows", drift_text(row), count_text(c), family.rows);
    return fmt::format("n too small: {} cannot decide {} rows, --repeat {} can", count_text(c), family.rows,
                       smallest_repeat(family.rows, family.rules.level));
  }
  if (called) return fmt::format("differs, but perhaps by less than {:g} %", 100 * family.rules.effect);
  const std::string text = fmt::format("the ratio may be from {:.3f} to {:.3f}: more repetitions or a quieter machine would tell",
                                       c.interval.lower, c.interval.upper);
  return drifted ? fmt::format("{}; {}", text, drift_text(row)) : text;
}

Verdict verdict_of(const Comparison& c, const ComparisonRules& rules) {
  if (c.n_a == 0 || c.n_b == 0) return Verdict::cannot_tell;
  const double most = 1 + rules.effect;
  if (c.adjusted_p && reaches(*c.adjusted_p, rules.level)) {
    if (c.interval.ratio >= most) return Verdict::slower;
    if (c.interval.ratio <= 1 / most) return Verdict::faster;
  }
  const bool narrow = c.interval.lower >= 1 / most && c.interval.upper <= most;
  return narrow && reaches(1 - c.interval.coverage, rules.level) ? Verdict::same : Verdict::cannot_tell;
}

/// All but what needs the other rows.
Comparison measured(const MeasuredRow& row, double level) {
  Comparison c;
  c.n_a = row.a.size();
  c.n_b = row.b.size();
  if (!row.a.empty()) c.median_a = median(row.a);
  if (!row.b.empty()) c.median_b = median(row.b);
  if (!row.a.empty() && !row.b.empty()) c.interval = ratio_of_medians(row.a, row.b, level);
  return c;
}

/// The logarithms' middle on both sides, each side for itself, so that it does not matter which has more of them.
double level_of(const RepeatedRow& row) {
  const auto middle = [](const std::map<int, double>& side) {
    std::vector<double> logs;
    for (const auto& [repetition, value] : side) logs.push_back(std::log(value));
    return median(logs);
  };
  return (middle(row.a) + middle(row.b)) / 2;
}

}  // namespace

double smallest_rank_p(std::size_t n, std::size_t m) {
  const double nn = static_cast<double>(n), mm = static_cast<double>(m);
  return std::min(1.0, 2 * std::exp(std::lgamma(nn + 1) + std::lgamma(mm + 1) - std::lgamma(nn + mm + 1)));
}

RankTest rank_test(std::span<const double> a, std::span<const double> b) {
  require_values(a);
  require_values(b);
  const std::vector<std::size_t> ranks = doubled_ranks(a, b);
  const std::size_t n = a.size();
  const auto mean = static_cast<std::ptrdiff_t>(n * (ranks.size() + 1));  // of twice the sum of n ranks
  const auto off = [&](std::size_t sum) { return static_cast<std::size_t>(std::abs(static_cast<std::ptrdiff_t>(sum) - mean)); };
  const std::size_t seen = off(std::accumulate(ranks.begin(), ranks.begin() + static_cast<std::ptrdiff_t>(n), std::size_t{0}));
  const std::vector<double> p = sum_distribution(ranks, n);
  std::size_t farthest = 0;
  for (std::size_t s = 0; s < p.size(); ++s)
    if (p[s] > 0) farthest = std::max(farthest, off(s));
  RankTest test{0, 0};
  for (std::size_t s = 0; s < p.size(); ++s) {
    if (off(s) >= seen) test.p += p[s];
    if (off(s) == farthest) test.smallest_p += p[s];
  }
  return {std::min(test.p, 1.0), std::min(test.smallest_p, 1.0)};
}

RatioInterval ratio_of_medians(std::span<const double> a, std::span<const double> b, double level) {
  for (const std::span<const double> side : {a, b}) {
    require_values(side);
    if (*std::min_element(side.begin(), side.end()) <= 0) throw Error("comparison: a value is not above 0");
  }
  std::vector<double> ratios;
  for (const double x : a)
    for (const double y : b) ratios.push_back(y / x);
  std::sort(ratios.begin(), ratios.end());
  const Outside outside = ratios_outside(a.size(), b.size(), level);
  RatioInterval interval;
  interval.ratio = median(b) / median(a);
  // of many and oddly spread values the ratio of medians may lie outside: it is always told as a part
  interval.lower = std::min(ratios[outside.ratios - 1], interval.ratio);
  interval.upper = std::max(ratios[ratios.size() - outside.ratios], interval.ratio);
  interval.coverage = std::max(0.0, 1 - outside.probability);
  return interval;
}

std::vector<double> holm(std::span<const double> p) {
  std::vector<std::size_t> order(p.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return p[i] < p[j]; });
  std::vector<double> adjusted(p.size());
  double so_far = 0;
  for (std::size_t step = 0; step < order.size(); ++step) {
    so_far = std::max(so_far, std::min(1.0, static_cast<double>(p.size() - step) * p[order[step]]));
    adjusted[order[step]] = so_far;
  }
  return adjusted;
}

std::size_t smallest_repeat(std::size_t rows, double level) {
  if (!(level > 0)) throw Error(fmt::format("comparison: no number of repetitions reaches the level {}", level));
  std::size_t n = 1;
  while (!reaches(smallest_rank_p(n, n) * static_cast<double>(std::max<std::size_t>(rows, 1)), level)) ++n;
  return n;
}

std::string_view verdict_name(Verdict verdict) {
  constexpr std::array<std::string_view, 4> names = {"faster", "slower", "same", "cannot tell"};
  return names[static_cast<std::size_t>(verdict)];
}

std::vector<Comparison> compare_rows(std::span<const MeasuredRow> rows, const ComparisonRules& rules) {
  std::vector<Comparison> comparisons;
  std::vector<double> smallest(rows.size(), 1.0), p;
  std::vector<std::size_t> members;
  Family family{.rules = rules};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Comparison& c = comparisons.emplace_back(measured(rows[i], rules.level));
    if (c.n_a == 0 || c.n_b == 0) continue;
    ++family.rows;
    const RankTest test = rank_test(rows[i].a, rows[i].b);
    c.p = test.p;
    smallest[i] = test.smallest_p;
    if (!reaches(test.smallest_p, rules.level)) continue;
    members.push_back(i);
    p.push_back(test.p);
  }
  family.members = members.size();
  const std::vector<double> adjusted = holm(p);
  for (std::size_t i = 0; i < members.size(); ++i) comparisons[members[i]].adjusted_p = adjusted[i];
  family.called = static_cast<std::size_t>(
      std::count_if(adjusted.begin(), adjusted.end(), [&](double each) { return reaches(each, rules.level); }));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Comparison& c = comparisons[i];
    c.verdict = verdict_of(c, rules);
    if (c.verdict == Verdict::cannot_tell) c.reason = reason_of(c, rows[i], smallest[i], family);
  }
  return comparisons;
}

MeasuredRow pooled(std::span<const RepeatedRow> rows) {
  std::vector<double> levels;
  std::map<int, std::vector<double>> a, b;  // of each repetition, what its rows are off
  for (const RepeatedRow& row : rows) {
    if (row.a.empty() || row.b.empty()) continue;
    const double level = levels.emplace_back(level_of(row));
    for (const auto& [repetition, value] : row.a) a[repetition].push_back(std::log(value) - level);
    for (const auto& [repetition, value] : row.b) b[repetition].push_back(std::log(value) - level);
  }
  MeasuredRow together;
  for (const auto& [repetition, off] : a) together.a.push_back(std::exp(median(off) + median(levels)));
  for (const auto& [repetition, off] : b) together.b.push_back(std::exp(median(off) + median(levels)));
  return together;
}

}  // namespace amrtex
