#include "bench/numbers/statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

std::vector<double> sorted_samples(std::span<const double> samples) {
  if (samples.empty()) throw Error("statistics: there are no samples");
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (!std::isfinite(samples[i])) throw Error(fmt::format("statistics: sample {} is not a finite number", i));
  std::vector<double> sorted(samples.begin(), samples.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

double median_of_sorted(const std::vector<double>& sorted) {
  const std::size_t middle = sorted.size() / 2;
  if (sorted.size() % 2 == 1) return sorted[middle];
  return sorted[middle - 1] + (sorted[middle] - sorted[middle - 1]) / 2;
}

/// Probability that of n fair coins exactly k show heads; by logarithms, since 2^-n underflows.
double coin_probability(std::size_t n, std::size_t k) {
  const double nn = static_cast<double>(n), kk = static_cast<double>(k);
  return std::exp(std::lgamma(nn + 1) - std::lgamma(kk + 1) - std::lgamma(nn - kk + 1) - nn * std::log(2.0));
}

struct Ranks {
  std::size_t outside;  ///< samples left out at each end
  double coverage;
};

/// The narrowest symmetric interval [x(k), x(n-1-k)] that holds the median with 95 %:
/// it misses when at most k samples lie on one side of the median.
Ranks median_interval(std::size_t n) {
  double tail = coin_probability(n, 0);
  Ranks ranks{0, std::max(0.0, 1 - 2 * tail)};
  for (std::size_t k = 1; 2 * k < n; ++k) {
    tail += coin_probability(n, k);
    if (1 - 2 * tail < 0.95) break;
    ranks = {k, 1 - 2 * tail};
  }
  return ranks;
}

}  // namespace

double median(std::span<const double> samples) { return median_of_sorted(sorted_samples(samples)); }

Summary summarize(std::span<const double> samples) {
  const std::vector<double> sorted = sorted_samples(samples);
  Summary s;
  s.n = sorted.size();
  s.min = sorted.front();
  s.median = median_of_sorted(sorted);
  std::vector<double> deviations;
  for (const double x : sorted) deviations.push_back(std::abs(x - s.median));
  s.mad = median(deviations);
  const Ranks ranks = median_interval(s.n);
  s.ci_lower = sorted[ranks.outside];
  s.ci_upper = sorted[s.n - 1 - ranks.outside];
  s.coverage = ranks.coverage;
  return s;
}

std::optional<LinearFit> fit_line(std::span<const double> x, std::span<const double> y) {
  if (x.size() != y.size()) throw Error(fmt::format("statistics: {} values of x and {} of y", x.size(), y.size()));
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) throw Error(fmt::format("statistics: point {} is not finite", i));
  if (x.size() < 3) return std::nullopt;
  const auto mean = [](std::span<const double> values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  };
  const double mean_x = mean(x), mean_y = mean(y);
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = x[i] - mean_x, dy = y[i] - mean_y;
    xx += dx * dx;
    xy += dx * dy;
    yy += dy * dy;
  }
  if (!(xx > 0) || !(yy > 0)) return std::nullopt;
  const double slope = xy / xx;
  return LinearFit{slope, mean_y - slope * mean_x, std::clamp(xy / std::sqrt(xx * yy), -1.0, 1.0)};
}

}  // namespace amrtex
