#include "renderers/scene/imported_transfer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace amrtex {
namespace {

template <class Points>
Points over_unit(const Points& points, const std::array<double, 2>& range, bool logarithmic) {
  Points unit = points;
  const auto axis = [&](double v) { return logarithmic ? std::log10(v) : v / 2; };
  const double first = axis(range[0]), span = axis(range[1]) - first;
  for (auto& p : unit) p.value = span > 0 ? std::clamp((axis(p.value) - first) / span, 0.0, 1.0) : 0.5;
  return unit;
}

}  // namespace

std::array<double, 2> ImportedTransfer::range() const {
  std::array<double, 2> range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto take = [&](const auto& points) {
    if (points.empty()) return;
    range[0] = std::min(range[0], points.front().value);
    range[1] = std::max(range[1], points.back().value);
  };
  take(colors);
  take(opacity);
  return range;
}

ColorPoints ImportedTransfer::unit_colors() const { return over_unit(colors, range(), logarithmic); }
std::vector<OpacityPoint> ImportedTransfer::unit_opacity() const { return over_unit(opacity, range(), logarithmic); }

}  // namespace amrtex
