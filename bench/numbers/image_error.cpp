#include "bench/numbers/image_error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

/// Keeps the denominator of MRSE away from 0 where the reference is black.
constexpr double kMrseOffset = 0.01;

void require_same_shape(const Picture& a, const Picture& b) {
  const auto shape = [](const Picture& p) { return fmt::format("{} x {} x {}", p.width, p.height, p.channels); };
  if (a.width != b.width || a.height != b.height || a.channels != b.channels)
    throw Error(fmt::format("compare: the picture is {} and its reference {}", shape(a), shape(b)));
  const std::size_t expected =
      static_cast<std::size_t>(a.width) * static_cast<std::size_t>(a.height) * static_cast<std::size_t>(a.channels);
  if (expected == 0 || a.values.size() != expected || b.values.size() != expected)
    throw Error(fmt::format("compare: a picture of {} needs {} values and has {} and {}", shape(a), expected, a.values.size(),
                            b.values.size()));
}

bool same_special(double v, double r) { return (std::isnan(v) && std::isnan(r)) || v == r; }

[[noreturn]] void throw_special(const Picture& picture, std::size_t index, double v, double r) {
  const std::size_t channels = static_cast<std::size_t>(picture.channels), width = static_cast<std::size_t>(picture.width);
  const std::size_t pixel = index / channels;
  throw Error(fmt::format("compare: pixel ({}, {}), channel {}: the picture has {} and the reference {}", pixel % width,
                          pixel / width, index % channels, v, r));
}

double largest_difference(const Picture& picture, const Picture& reference) {
  double largest = 0;
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    const double v = picture.values[i], r = reference.values[i];
    if (std::isfinite(v) && std::isfinite(r))
      largest = std::max(largest, std::abs(v - r));
    else if (!same_special(v, r))
      throw_special(picture, i, v, r);
  }
  return largest;
}

/// A power of two in which differences up to `largest` have squares that are doubles; 1 where they have them as they are.
double square_unit(double largest) {
  constexpr int kSquare = 400;  // exponents of what is squared as it is
  const int exponent = largest > 0 ? std::ilogb(largest) : 0;
  return std::abs(exponent) <= kSquare ? 1 : std::ldexp(1.0, exponent);
}

double finite_range(const Picture& picture) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : picture.values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  return high > low ? high - low : 0;
}

}  // namespace

ErrorMetrics compare(const Picture& picture, const Picture& reference) {
  require_same_shape(picture, reference);
  ErrorMetrics error;
  error.max = largest_difference(picture, reference);
  const double unit = square_unit(error.max);
  double sum = 0, relative_sum = 0;
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    const double v = picture.values[i], r = reference.values[i];
    if (!std::isfinite(v) || !std::isfinite(r)) continue;
    const double difference = std::abs(v - r) / unit, offset = (r + kMrseOffset) / unit;
    sum += difference * difference;
    const double relative = (difference * difference) / (offset * offset);
    if (std::isfinite(relative)) relative_sum += relative;
  }
  const double n = static_cast<double>(picture.values.size());
  error.rmse = unit * std::sqrt(sum / n);
  error.mrse = relative_sum / n;
  const double peak = picture.channels == 1 ? finite_range(reference) : 1;
  if (error.rmse > 0 && peak > 0) error.psnr_db = 20 * std::log10(peak / error.rmse);
  return error;
}

std::vector<double> pixel_errors(const Picture& picture, const Picture& reference) {
  require_same_shape(picture, reference);
  const auto channels = static_cast<std::size_t>(picture.channels);
  std::vector<double> errors(picture.values.size() / channels, 0);
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    const double v = picture.values[i], r = reference.values[i];
    if (same_special(v, r)) continue;
    if (!std::isfinite(v) || !std::isfinite(r)) throw_special(picture, i, v, r);
    errors[i / channels] = std::max(errors[i / channels], std::abs(v - r));
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double percentile(const std::vector<double>& errors, double share) {
  const double rank = std::ceil(share * static_cast<double>(errors.size()));
  return errors.at(static_cast<std::size_t>(std::max(rank, 1.0)) - 1);
}

double share_within(const std::vector<double>& errors, double bound) {
  const auto end = std::upper_bound(errors.begin(), errors.end(), bound);
  return static_cast<double>(end - errors.begin()) / static_cast<double>(errors.size());
}

bool reaches_psnr(const ErrorMetrics& error, double psnr_db) {
  return error.rmse == 0 || (error.psnr_db && *error.psnr_db >= psnr_db);
}

std::span<const Metric> error_metrics() {
  static constexpr std::array<Metric, 4> metrics = {{{"rmse", "RMSE", "", true, 0.0},
                                                     {"max", "max error", "", true, 0.0},
                                                     {"psnr_db", "PSNR", "dB", false, std::nullopt},
                                                     {"mrse", "MRSE", "1", true, 0.0}}};
  return metrics;
}

}  // namespace amrtex
