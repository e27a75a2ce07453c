// When two readings of a baseline are of a machine at one speed.
#pragma once

#include <algorithm>
#include <cmath>

namespace amrtex {

/// Readings that differ by more say that the machine was busy.
inline constexpr double kBaselineDrift = 0.15;

/// Milliseconds of a baseline before a point and after it.
inline bool baselines_agree(double before, double after) {
  return std::abs(after - before) <= kBaselineDrift * std::min(before, after);
}

}  // namespace amrtex
