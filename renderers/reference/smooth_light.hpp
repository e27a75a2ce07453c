// The light of a stretch of a ray in which it is smooth, from 3, 7 or 15 places of it. Private to the reference.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "renderers/reference/nested_rule.hpp"
#include "renderers/reference/transfer_table.hpp"

namespace amrtex {

/// Part of a ray: places, world length from its first.
struct RaySpan {
  double from = 0;
  double to = 0;
  double length() const { return to - from; }
};

/// What a volume emits and takes along a stretch in which both are smooth, at places s in [0, 1].
class Stretch {
 public:
  explicit Stretch(const RaySpan& span) : span_(span) {}
  virtual ~Stretch() = default;

  const RaySpan& span() const { return span_; }
  virtual TransferTable::Light light(double s) const = 0;
  /// No extinction on it is larger.
  virtual double most() const = 0;
  /// Largest difference that its colours, and those of what else the ray meets, have in a channel.
  virtual double color_range() const = 0;
  /// How many times larger the field is at b than at a where the light follows its logarithm, which no polynomial does over many
  /// decades; else 1.
  virtual double growth(double /*a*/, double /*b*/) const { return 1; }

 private:
  RaySpan span_;
};

/// Values at the 15 places of the nested rules; which of them are there, the caller knows.
struct LightSamples {
  std::array<double, kNestedPlaces> depth{};  ///< optical, for the whole length at this extinction
  std::array<Vec3d, kNestedPlaces> rgb{};
};

/// The integrals over a part of a stretch. With b a colour near its colours c, C = b (1 - exp(-depth)) + excess.
struct LightSums {
  double depth = 0;
  Vec3d excess{0};    ///< integral of (c - b) k T
  double spread = 0;  ///< the same of |c - b|, in the channel where that is largest
};

/// T at each place comes from the integral of the polynomial through all N extinctions, which is exact for a cubic one.
template <std::size_t N>
LightSums sum_light(const LightSamples& samples) {
  const NestedRule<N>& rule = kNestedRule<N>;
  const Vec3d& base = samples.rgb[kNestedMiddle];
  LightSums sums;
  bool one_color = true;
  for (std::size_t i = 0; i < N; ++i) {
    sums.depth += rule.weight[i] * samples.depth[rule.index(i)];
    one_color = one_color && samples.rgb[rule.index(i)] == base;
  }
  if (one_color) return sums;
  for (std::size_t i = 0; i < N; ++i) {
    double before = 0;
    for (std::size_t j = 0; j < N; ++j) before += rule.before[i][j] * samples.depth[rule.index(j)];
    // where extinction jumps by decades the polynomial swings below 0
    const double emitted = rule.weight[i] * samples.depth[rule.index(i)] * std::exp(-std::max(before, 0.0));
    const Vec3d other = samples.rgb[rule.index(i)] - base;
    sums.excess += emitted * other;
    sums.spread += std::abs(emitted) * std::max({std::abs(other.x), std::abs(other.y), std::abs(other.z)});
  }
  return sums;
}

}  // namespace amrtex
