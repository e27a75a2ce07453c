// A mean that reproduces a constant to the bit. Private to the reference.
#pragma once

#include <limits>

namespace amrtex {

/// Relative to its first value.
class ExactMean {
 public:
  void add(double value, double weight = 1) {
    if (weight_ == 0) first_ = value;
    sum_ += (value - first_) * weight;
    weight_ += weight;
  }
  double weight() const { return weight_; }
  /// NaN of nothing.
  double value() const { return weight_ > 0 ? first_ + sum_ / weight_ : std::numeric_limits<double>::quiet_NaN(); }

 private:
  double first_ = 0;
  double sum_ = 0;
  double weight_ = 0;
};

}  // namespace amrtex
