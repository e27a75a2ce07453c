// How far a picture is from its reference: over all channels of linear values, before
// any tone mapping and before 8 bits.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "renderers/scene/picture.hpp"

namespace amrtex {

struct ErrorMetrics {
  double rmse = 0;                ///< root of the mean squared difference over the whole picture
  double max = 0;                 ///< largest absolute difference
  std::optional<double> psnr_db;  ///< absent where rmse is 0 (perfect), or where the peak is 0
  double mrse = 0;                ///< mean of (v - r)^2 / (r + 0.01)^2, infinite terms skipped
};

/// Four channels: premultiplied RGBA, the peak of PSNR is 1. One channel: the peak is
/// the range of the reference's finite values. A value that is NaN, or the same
/// infinity, in both pictures is no difference; a value that is not finite in exactly
/// one of them is no number to average but a wrong picture: Error naming the pixel.
/// Throws Error when sizes or channels differ.
ErrorMetrics compare(const Picture& picture, const Picture& reference);

/// Largest difference of each pixel's channels, ascending.
std::vector<double> pixel_errors(const Picture& picture, const Picture& reference);
/// The error that this share of the pixels does not exceed, from `pixel_errors`.
double percentile(const std::vector<double>& pixel_errors, double share);
/// Share of the pixels whose error is at most `bound`.
double share_within(const std::vector<double>& pixel_errors, double bound);

/// Whether the picture is plausible: perfect, or at least `psnr_db`.
bool reaches_psnr(const ErrorMetrics& error, double psnr_db);

/// One row of the table of metrics, for reports.
struct Metric {
  std::string_view name;  ///< key in records
  std::string_view label;
  std::string_view unit;  ///< empty: the picture's
  bool lower_is_better;
  std::optional<double> perfect;  ///< of an exact picture; absent = unbounded, null in records
};
std::span<const Metric> error_metrics();

}  // namespace amrtex
