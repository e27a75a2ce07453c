// Robust statistics of a few repeated measurements.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace amrtex {

/// What is told of a list of samples, in the samples' unit.
struct Summary {
  double median = 0;
  double mad = 0;       ///< median absolute deviation from the median, not scaled to a standard deviation
  double ci_lower = 0;  ///< confidence interval of the median
  double ci_upper = 0;
  double coverage = 0;  ///< probability that the interval holds the median: >= 0.95 from 6 samples on
  double min = 0;
  std::size_t n = 0;
};

/// Mean of the two middle samples where their number is even. Throws Error when there
/// are no samples or one is not finite.
double median(std::span<const double> samples);

/// The interval is of order statistics: it assumes no distribution and draws no random
/// numbers. Fewer than 6 samples cannot give 95 %; then it is [min, max]. Throws Error
/// when there are no samples or one is not finite.
Summary summarize(std::span<const double> samples);

/// The line through points with the least squares of what y is off, and Pearson's correlation coefficient of x and y.
struct LinearFit {
  double slope = 0;  ///< y per x
  double at_zero = 0;
  double correlation = 0;  ///< -1 to 1
};

/// Nothing where a line means nothing: fewer than three points, or all of one x or one y. Throws Error where the lists
/// differ in length or a number is not finite.
std::optional<LinearFit> fit_line(std::span<const double> x, std::span<const double> y);

}  // namespace amrtex
