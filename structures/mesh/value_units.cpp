#include "structures/mesh/value_units.hpp"

#include <cmath>
#include <limits>

namespace amrtex {
namespace {

/// Digits of a float behind those that a range needs: half an ulp of a number from 2^e on is 2^(e - 24).
constexpr int kSpareDigits = 24 - 20;
/// Largest magnitudes that are stored as they are: slopes, differences and sums of such values are normal floats as well.
constexpr int kLowestPlain = -96, kHighestPlain = 96;
/// Exponent of the smallest normal float.
constexpr int kLeastExponent = -126;
/// Exponent of the largest number where smaller ones need the room; 2^31 of them have a sum.
constexpr int kHighNumber = 62;

/// Would a float round numbers up to `most` by more than 2^-20 of `half_range` times 2?
bool too_coarse(double most, double half_range) {
  return half_range > 0 && std::ilogb(most) > std::ilogb(half_range) + 1 + kSpareDigits;
}

double half_range(double min, double max) { return max / 2 - min / 2; }

}  // namespace

ValueUnits value_units(const FieldStatistics& s) {
  const double most = std::max(std::abs(s.min), std::abs(s.max));
  if (!(most > 0)) return {};  // no values, or zeros
  const double half = half_range(s.min, s.max);
  if (too_coarse(most, half)) return {s.min, std::ldexp(1.0, std::ilogb(half) + 1)};
  const int highest = std::ilogb(most);
  const int lowest = std::ilogb(s.least_magnitude);
  const bool high = highest > kHighestPlain, low = highest < kLowestPlain;
  if (!high && !low && lowest >= kLeastExponent) return {};
  if (highest - lowest <= -kLeastExponent) return {0, std::ldexp(1.0, highest)};
  const bool all = highest - lowest <= kHighNumber - kLeastExponent;
  // what no float holds in any unit: as plainly as it can be
  if (!all && !low && highest < -kLeastExponent) return {};
  return {0, std::ldexp(1.0, highest - kHighNumber)};
}

bool floats_hold(double min, double max, double least) {
  const double most = std::max(std::abs(min), std::abs(max));
  if (!(most > 0)) return true;
  return !too_coarse(most, half_range(min, max)) && most <= std::numeric_limits<float>::max() &&
         (least == 0 || std::ilogb(least) >= kLeastExponent);
}

}  // namespace amrtex
