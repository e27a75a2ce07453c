// How finely the double reference integrates: until what it estimates of its own error is below a tolerance, or, to compare with,
// by a fixed step.
#pragma once

#include <optional>

namespace amrtex {

/// Largest error of a reference picture of the modes `dvr` and `dvr_iso`, of full scale (1).
struct ReferenceTolerance {
  static constexpr double kLeast = 1e-13;  ///< below it the rounding of doubles decides
  double value = 1e-7;
};

/// The same of `projection` and `mip`, whatever a scene asks for: relative to the integral of |f| along the ray, and to its
/// largest |f|.
inline constexpr double kLineTolerance = 1e-12;

/// Made of either, so that both stand where a rule is asked for.
class ReferenceRule {
 public:
  ReferenceRule(ReferenceTolerance tolerance = {}) : tolerance_(tolerance) {}
  /// Parts of at most so many widths of the finest cells, with two Gauss points each. Tells nothing of its error.
  ReferenceRule(double step) : step_(step) {}

  const std::optional<double>& step() const { return step_; }
  double tolerance() const { return tolerance_.value; }

 private:
  ReferenceTolerance tolerance_;
  std::optional<double> step_;
};

}  // namespace amrtex
