#include "renderers/scene/stored_units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using ExtinctionPoint = TransferFunction::ExtinctionPoint;
using ColorPoint = TransferFunction::ColorPoint;

/// Largest number that has an offset (value_units).
constexpr double kMostOffsetNumber = 2;

/// Numbers between which curves have their points; log10 of more than floats hold is a float.
struct Window {
  double low, high;
};
Window window_of(bool logarithmic) { return logarithmic ? Window{0x1p-1000, 0x1p1000} : Window{-kMostNumber, kMostNumber}; }

ExtinctionPoint point_at(const TransferFunction& tf, double value, double number, const ExtinctionPoint& /*kind*/) {
  return {number, tf.extinction_at(value)};
}
ColorPoint point_at(const TransferFunction& tf, double value, double number, const ColorPoint& /*kind*/) {
  return {number, tf.color_at(value)};
}

/// Points of one curve over numbers, ascending, those outside of the window moved to its ends.
template <class Point>
std::vector<Point> mapped_points(const TransferFunction& tf, const std::vector<Point>& points, const ValueUnits& units) {
  const Window window = window_of(tf.logarithmic);
  std::vector<Point> mapped;
  for (const Point& p : points) {
    Point q = p;
    q.value = units.number(p.value);
    if (!(q.value >= window.low && q.value <= window.high)) {
      const double end = q.value > window.high ? window.high : window.low;
      q = point_at(tf, units.value(end), end, p);
    }
    if (!mapped.empty() && !(q.value > mapped.back().value))
      mapped.back() = q;  // values that no number tells apart
    else
      mapped.push_back(q);
  }
  return mapped;
}

/// log(value / from) of a value near the offset, without the digits that the value itself would lose.
double log_over(double from, double number, const ValueUnits& units) {
  const double above = (units.offset - from) + units.scale * number;
  return std::abs(above) < 0.5 * from ? std::log1p(above / from) : std::log(units.value(number) / from);
}

/// Where a number lies among points over values: the upper one's index and the weight of it.
template <class Point>
std::pair<std::size_t, double> segment_over_log(const std::vector<Point>& points, double number, const ValueUnits& units) {
  const auto beyond = [&](const Point& p) { return units.number(p.value) >= number; };
  const auto k = static_cast<std::size_t>(std::find_if(points.begin(), points.end(), beyond) - points.begin());
  if (k == 0) return {0, 1};
  if (k == points.size()) return {k - 1, 1};
  const double from = points[k - 1].value;
  const double way =
      points[k].value - from < 0.5 * from ? std::log1p((points[k].value - from) / from) : std::log(points[k].value / from);
  return {k, std::clamp(log_over(from, number, units) / way, 0.0, 1.0)};
}

double content(const ExtinctionPoint& p) { return p.extinction; }
Vec3d content(const ColorPoint& p) { return p.rgb; }

double blend(double a, double b, double w) { return std::isinf(a + b) ? a + b : a + w * (b - a); }
Vec3d blend(const Vec3d& a, const Vec3d& b, double w) { return a + w * (b - a); }

/// A curve over log10 as one of lines over numbers from 0 to kMostOffsetNumber: between its own points and so many more that a
/// line is off by less than 2^-20 of the whole.
template <class Point>
std::vector<Point> lines_over_log(const std::vector<Point>& points, const ValueUnits& units) {
  const double bend = kMostOffsetNumber * units.scale / units.offset;  // a chord is off by bend / (8 pieces^2)
  const int pieces = static_cast<int>(std::ceil(std::sqrt(bend * 0x1p17)));
  std::vector<double> numbers;
  for (int i = 0; i <= pieces; ++i) numbers.push_back(kMostOffsetNumber * i / pieces);
  for (const Point& p : points)
    if (const double number = units.number(p.value); number > 0 && number < kMostOffsetNumber) numbers.push_back(number);
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  std::vector<Point> lines;
  for (const double number : numbers) {
    const auto [k, w] = segment_over_log(points, number, units);
    lines.push_back({number, w == 1 ? content(points[k]) : blend(content(points[k - 1]), content(points[k]), w)});
  }
  return lines;
}

/// Is the curve the same for all values up to this one?
template <class Point>
bool constant_up_to(const std::vector<Point>& points, double value) {
  const auto differs = [&](const Point& p) { return content(p) != content(points.front()); };
  const auto first = std::find_if(points.begin(), points.end(), differs);
  return first == points.end() || std::prev(first)->value >= value;
}

}  // namespace

TransferFunction in_units(const TransferFunction& tf, const ValueUnits& units) {
  TransferFunction mapped = tf;
  if (!tf.logarithmic || units.offset == 0) {
    mapped.extinction = mapped_points(tf, tf.extinction, units);
    mapped.color = mapped_points(tf, tf.color, units);
    return mapped;
  }
  mapped.logarithmic = false;
  if (units.offset > 0) {
    mapped.extinction = lines_over_log(tf.extinction, units);
    mapped.color = lines_over_log(tf.color, units);
  } else {  // values below 0 take the first point's
    if (!tf.extinction.empty()) mapped.extinction = {{0, tf.extinction.front().extinction}};
    if (!tf.color.empty()) mapped.color = {{0, tf.color.front().rgb}};
  }
  return mapped;
}

Scene in_units(const Scene& scene, const std::function<ValueUnits(int)>& units) {
  Scene stored = scene;
  const ValueUnits own = units(0);
  stored.transfer_function = in_units(scene.transfer_function, own);
  for (double& isovalue : stored.settings.isosurfaces.values)
    isovalue = std::clamp(own.number(isovalue), -kMostNumber * 2, kMostNumber * 2);
  int number = 0;
  for (FieldTransfer& other : stored.more_fields) other.transfer_function = in_units(other.transfer_function, units(++number));
  return stored;
}

void require_log_axis(const TransferFunction& tf, const ValueUnits& units, double least) {
  const double end = units.scale * kLeastNumber;  // may be no double: then nothing lies below it
  if (!tf.logarithmic || units.offset != 0 || !(least > 0) || least >= end) return;
  if (constant_up_to(tf.extinction, end) && constant_up_to(tf.color, end)) return;
  throw UnsupportedError(
      fmt::format("transfer function: a logarithmic axis from {:.3g} on, of a field with magnitudes from {:.3g}: floats hold "
                  "them from {:.3g} on "
                  "beside the largest; accepted: a curve that is constant below, or a linear one",
                  std::min(tf.extinction.front().value, tf.color.front().value), least, end));
}

}  // namespace amrtex
