#include "bench/measure/value_resolution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderers/scene/stored_units.hpp"

namespace amrtex {
namespace {

constexpr double kMuch = 1.0 / 8;

/// How a field's numbers are rounded.
class Rounding {
 public:
  explicit Rounding(const EncodedField& field) : storage_(field.storage) {
    const FieldStatistics& s = field.values.front();
    const ValueUnits& units = field.scale.units;
    min_ = units.number(s.min);
    max_ = units.number(s.max);
    step_ = field.scale.in_units().scale;
    if (min_ == max_) own_ = std::abs(static_cast<double>(static_cast<float>(min_)) - min_);
  }
  double min() const { return min_; }
  double max() const { return max_; }

  /// Most that a number is off by.
  double at(double number) const {
    if (storage_ == Storage::r64f) return 0;
    if (min_ == max_) return own_;  // codes hold a constant
    const double of_float = std::max(std::ldexp(std::abs(number), -24), kLeastNumber);
    if (storage_ == Storage::r8) return of_float + step_ / 510;
    if (storage_ == Storage::r16) return of_float + step_ / 131070;
    if (storage_ == Storage::r16f) return of_float + std::ldexp(step_, -12);
    return of_float;
  }

 private:
  Storage storage_;
  double min_, max_, step_;
  double own_ = 0;
};

/// Error of the extinction between two points, as far as the field has values there.
double error_between(const TransferFunction& tf, std::size_t i, const Rounding& rounding) {
  const auto& p = tf.extinction[i];
  const auto& q = tf.extinction[i + 1];
  const double low = std::max(p.value, rounding.min()), high = std::min(q.value, rounding.max());
  if (high < low) return 0;
  const double number = std::abs(low) > std::abs(high) ? low : high;
  const double off = rounding.at(number);
  // an axis of log10 is steepest at the lower end
  const double on_axis = tf.logarithmic ? std::log10(1 + rounding.at(low) / std::max(low, kLeastNumber)) : off;
  const double share = std::min(on_axis / (tf.axis(q.value) - tf.axis(p.value)), 1.0);
  return share * std::abs(q.extinction - p.extinction);
}

std::optional<double> extinction_error(const TransferFunction& tf, const Rounding& rounding) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < tf.extinction.size(); ++i) {
    largest = std::max(largest, tf.extinction[i].extinction);
    if (i + 1 < tf.extinction.size()) worst = std::max(worst, error_between(tf, i, rounding));
  }
  const double share = worst / largest;
  return share > kMuch ? std::optional(share) : std::nullopt;
}

std::optional<double> isovalue_shift(const std::vector<double>& isovalues, const Rounding& rounding) {
  double worst = 0;
  for (const double isovalue : isovalues) {
    if (isovalue < rounding.min() || isovalue > rounding.max()) continue;
    std::vector<double> others = isovalues;
    others.insert(others.end(), {rounding.min(), rounding.max()});
    const double off = rounding.at(isovalue);
    for (const double other : others)
      if (other != isovalue && off > kMuch * std::abs(other - isovalue)) worst = std::max(worst, off);
  }
  return worst > 0 ? std::optional(worst) : std::nullopt;
}

}  // namespace

std::vector<std::string> ValueResolution::warnings() const {
  std::vector<std::string> list;
  if (extinction)
    list.push_back(fmt::format(
        "the transfer function tells values apart that are stored as one: extinctions are off by up to {:.2g} of the largest",
        *extinction));
  if (isovalue)
    list.push_back(
        fmt::format("isovalues lie nearer to each other or to the ends of the field than values are stored: they are off "
                    "by up to {:.2g}",
                    *isovalue));
  return list;
}

Json ValueResolution::json() const {
  return {{"extinction", extinction ? Json(*extinction) : Json()}, {"isovalue", isovalue ? Json(*isovalue) : Json()}};
}

ValueResolution value_resolution(const EncodedField& field, const Scene& scene) {
  ValueResolution resolution;
  if (std::isnan(field.values.front().min)) return resolution;
  const Rounding rounding(field);
  const Scene stored = in_units(scene, [&](int number) { return field.scale_of(number).units; });
  if (scene.settings.draws_volume()) resolution.extinction = extinction_error(stored.transfer_function, rounding);
  if (scene.settings.draws_surfaces()) {
    resolution.isovalue = isovalue_shift(stored.settings.isosurfaces.values, rounding);
    if (resolution.isovalue) *resolution.isovalue *= field.scale.units.scale;
  }
  return resolution;
}

}  // namespace amrtex
