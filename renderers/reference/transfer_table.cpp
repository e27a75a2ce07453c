#include "renderers/reference/transfer_table.hpp"

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

double range_of(const std::vector<TransferFunction::ColorPoint>& points) {
  double range = 0;
  for (int c = 0; c < 3 && !points.empty(); ++c) {
    const auto [low, high] =
        std::minmax_element(points.begin(), points.end(), [c](const auto& a, const auto& b) { return a.rgb[c] < b.rgb[c]; });
    range = std::max(range, high->rgb[c] - low->rgb[c]);
  }
  return range;
}

}  // namespace

TransferTable::TransferTable(const TransferFunction& tf, double extinction_scale)
    : logarithmic_(tf.logarithmic), color_range_(range_of(tf.color)) {
  for (const auto& p : tf.extinction) knots_.push_back(p.value);
  for (const auto& p : tf.color) knots_.push_back(p.value);
  std::sort(knots_.begin(), knots_.end());
  knots_.erase(std::unique(knots_.begin(), knots_.end()), knots_.end());
  visible_before_.push_back(0);
  for (std::size_t k = 0; k <= knots_.size(); ++k) {
    const double a = knots_[k > 0 ? k - 1 : 0];
    const double b = knots_[std::min(k, knots_.size() - 1)];
    Light lower{tf.extinction_at(a) * extinction_scale, tf.color_at(a)};
    Light upper{tf.extinction_at(b) * extinction_scale, tf.color_at(b)};
    if (std::isinf(lower.extinction + upper.extinction))
      lower.extinction = upper.extinction = lower.extinction + upper.extinction;
    const double width = tf.axis(b) - tf.axis(a);
    const bool one_color = lower.rgb == upper.rgb;
    segments_.push_back({a, tf.axis(a), width, lower, upper, one_color && lower.extinction == upper.extinction, one_color,
                         lower.extinction + upper.extinction > 0});
    visible_before_.push_back(visible_before_.back() + (segments_.back().visible ? 1 : 0));
  }
}

std::size_t TransferTable::segment_of(double value) const {
  return static_cast<std::size_t>(std::upper_bound(knots_.begin(), knots_.end(), value) - knots_.begin());
}

TransferTable::Light TransferTable::light(const Segment& segment, const PieceFunction& f, double s) const {
  if (segment.constant) return segment.lower;
  // at the ends of a stretch rounding may take f out of the segment, and below 0 there is no logarithm
  const double way =
      logarithmic_ ? std::log10(std::max(f(s), segment.value_lower)) - segment.axis_lower : f.above(segment.value_lower, s);
  const double w = segment.width > 0 ? std::clamp(way / segment.width, 0.0, 1.0) : 0;
  // an infinite extinction is the segment's at both ends, and infinity minus itself is not a number
  const double rise =
      segment.upper.extinction == segment.lower.extinction ? 0 : segment.upper.extinction - segment.lower.extinction;
  return {segment.lower.extinction + w * rise, segment.lower.rgb + w * (segment.upper.rgb - segment.lower.rgb)};
}

}  // namespace amrtex
