// Error against time: which settings are worth having, and which is the fastest that is exact enough.
// One definition for tables, diagrams and advice.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace amrtex {

/// One setting in one scene. A point whose time or error is not finite was not measured: it is on no front and reaches nothing.
struct CostPoint {
  double time = 0;   ///< of a frame, any unit
  double error = 0;  ///< any measure that is 0 where the picture is exact and grows with the error
};

/// Indices of the points that no other point beats, by ascending time and so by falling error. One point beats another when it
/// is no worse in both and better in one; of points that are alike in both the first is kept.
std::vector<std::size_t> pareto_front(std::span<const CostPoint> points);

/// The fastest point whose error is at most `bound`; of equally fast ones the most exact, of those alike the first. Nothing where
/// no point reaches it.
std::optional<std::size_t> fastest_within(std::span<const CostPoint> points, double bound);

/// The most exact point; of equally exact ones the fastest, of those alike the first. Nothing where none was measured.
std::optional<std::size_t> most_exact(std::span<const CostPoint> points);

/// The root mean square error of a picture whose PSNR is `psnr_db`, as a share of the peak: 10^(-dB / 20).
double relative_rmse(double psnr_db);

}  // namespace amrtex
