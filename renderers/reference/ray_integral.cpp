#include "renderers/reference/ray_integral.hpp"

#include <algorithm>
#include <cmath>

namespace amrtex {
namespace {

constexpr double kSqrt3 = 1.7320508075688772935;
constexpr double kParts = 16;   // of a piece, before only its opaque ones are split further
constexpr double kThin = 0.25;  // optical depth of a part that is never split further

/// Maximum of a cubic over [0, 1] and where.
double argmax(const Cubic& f) {
  std::array<double, 2> inner{};
  double best = f(1) > f(0) ? 1 : 0;
  const int n = extrema_in_unit(f, inner);
  for (int i = 0; i < n; ++i)
    if (f(inner[static_cast<std::size_t>(i)]) > f(best)) best = inner[static_cast<std::size_t>(i)];
  return best;
}

}  // namespace

Cubic& Cubic::operator+=(const Cubic& other) {
  for (std::size_t i = 0; i < 4; ++i) c[i] += other.c[i];
  return *this;
}

int extrema_in_unit(const Cubic& f, std::array<double, 2>& out) {
  const double a = 3 * f.c[3];
  const double b = 2 * f.c[2];
  const double discriminant = b * b - 4 * a * f.c[1];
  if (!(discriminant > 0)) return 0;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));  // no cancellation
  int n = 0;
  for (const double s : {q / a, f.c[1] / q})
    if (s > 0 && s < 1) out[static_cast<std::size_t>(n++)] = s;
  if (n == 2 && out[0] > out[1]) std::swap(out[0], out[1]);
  return n;
}

/// Newton's method kept inside a bracket with a change of sign.
double root_between(const Cubic& f, double a, double b) {
  const bool rising = f(a) < 0;
  double s = (a + b) / 2;
  for (int i = 0; i < 100 && b - a > 0; ++i) {
    const double v = f(s);
    if (v == 0) return s;
    ((v < 0) == rising ? a : b) = s;
    const double slope = f.c[1] + s * (2 * f.c[2] + s * 3 * f.c[3]);
    double next = s - v / slope;
    if (!(next > a && next < b)) next = (a + b) / 2;
    if (std::abs(next - s) <= 1e-15) return next;
    s = next;
  }
  return s;
}

int roots_in_unit(const Cubic& f, std::array<double, 3>& out) {
  std::array<double, 2> inner{};
  const int m = extrema_in_unit(f, inner);
  int n = 0;
  double a = 0;
  for (int i = 0; i <= m; ++i) {
    const double b = i < m ? inner[static_cast<std::size_t>(i)] : 1;
    if ((f(a) < 0 && f(b) > 0) || (f(a) > 0 && f(b) < 0)) out[static_cast<std::size_t>(n++)] = root_between(f, a, b);
    a = b;
  }
  return n;
}

Cubic PieceFunction::minus(double value) const {
  Cubic difference = numerator;
  if (rational)
    for (std::size_t i = 0; i < 4; ++i) difference.c[i] -= value * denominator.c[i];
  else
    difference.c[0] -= value;
  return difference;
}

double maximum(const PieceFunction& f) {
  if (!f.rational) return f.numerator(argmax(f.numerator));
  // Dinkelbach: the maximum of N / D is the m at which max(N - m D) = 0.
  double best = std::max(f(0), f(1));
  for (int i = 0; i < 50; ++i) {
    const double next = f(argmax(f.minus(best)));
    if (!(next > best)) break;
    best = next;
  }
  return best;
}

double mean(const PieceFunction& f, int parts) {
  if (!f.rational) return f.numerator.integral();
  constexpr std::array<double, 2> kNode{0.3399810435848562648, 0.8611363115940525752};
  constexpr std::array<double, 2> kWeight{0.6521451548625461426, 0.3478548451374538574};
  double sum = 0;
  for (int i = 0; i < parts; ++i)
    for (std::size_t k = 0; k < 2; ++k)
      sum += kWeight[k] * (f((i + 0.5 - 0.5 * kNode[k]) / parts) + f((i + 0.5 + 0.5 * kNode[k]) / parts));
  return sum / (2 * parts);
}

TransferTable::TransferTable(const TransferFunction& tf, double extinction_scale) : logarithmic_(tf.logarithmic) {
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
    segments_.push_back({tf.axis(a), width > 0 ? 1 / width : 0, lower, upper, one_color && lower.extinction == upper.extinction,
                         one_color, lower.extinction + upper.extinction > 0});
    visible_before_.push_back(visible_before_.back() + (segments_.back().visible ? 1 : 0));
  }
}

std::size_t TransferTable::segment_of(double value) const {
  return static_cast<std::size_t>(std::upper_bound(knots_.begin(), knots_.end(), value) - knots_.begin());
}

TransferTable::Light TransferTable::light(const Segment& segment, double value) const {
  if (segment.constant) return segment.lower;
  const double axis = logarithmic_ ? std::log10(value) : value;
  const double w = std::clamp((axis - segment.axis_lower) * segment.inverse_width, 0.0, 1.0);
  // an infinite extinction is the segment's at both ends, and infinity minus itself is not a number
  const double rise =
      segment.upper.extinction == segment.lower.extinction ? 0 : segment.upper.extinction - segment.lower.extinction;
  return {segment.lower.extinction + w * rise, segment.lower.rgb + w * (segment.upper.rgb - segment.lower.rgb)};
}

void LightIntegral::add(const PieceFunction& f, double length, double max_part, double from, double to, double start) {
  if (table_ == nullptr || !(to > from)) return;
  start_ = start;
  const std::size_t first = table_->segment_of(f.lower);
  const std::size_t last = table_->segment_of(f.upper);
  if (!table_->visible(first, last)) return;
  if (first == last) {
    add_interval(f, from, to, length, max_part);
    return;
  }
  breaks_.assign({from, to});
  for (std::size_t k = first; k < last; ++k) {
    std::array<double, 3> roots{};
    const int n = roots_in_unit(f.minus(table_->knots()[k]), roots);
    for (int i = 0; i < n; ++i)
      if (const double s = roots[static_cast<std::size_t>(i)]; s > from && s < to) breaks_.push_back(s);
  }
  std::sort(breaks_.begin(), breaks_.end());
  for (std::size_t i = 0; i + 1 < breaks_.size(); ++i)
    if (breaks_[i + 1] > breaks_[i]) add_interval(f, breaks_[i], breaks_[i + 1], length, max_part);
}

void LightIntegral::add_surface(const Vec3d& rgb, double opacity) {
  color_ += transmittance_ * opacity * rgb;
  transmittance_ *= 1 - opacity;
  passed_ *= 1 - opacity;
}

/// Inside one segment of the transfer function everything is smooth: two Gauss points a part.
void LightIntegral::add_interval(const PieceFunction& f, double from, double to, double length, double max_part) {
  const auto& segment = table_->segment(table_->segment_of(f((from + to) / 2)));
  if (!segment.visible) return;
  // two points integrate a cubic extinction exactly, and of one colour nothing else is needed
  const bool exact = !arriving_ && (segment.constant || (segment.one_color && !table_->logarithmic() && !f.rational));
  const double wanted = exact ? 1 : std::ceil((to - from) * length / max_part * (1 - 1e-9));
  const int parts = static_cast<int>(std::clamp(wanted, 1.0, kParts));
  const double width = (to - from) / parts;
  const auto at = [&](double s) { return light(f, segment, s, length); };
  for (int i = 0; i < parts; ++i)
    add_parts(at, from + (i + 0.5) * width, width, length, exact ? std::numeric_limits<double>::infinity() : max_part);
  transmittance_ = passed_ * std::exp(-depth_);  // the product of the parts drifts
}

void LightIntegral::add_smooth(const Places& at, double length, double max_part, double from, double to) {
  const int parts = static_cast<int>(std::clamp(std::ceil((to - from) * length / max_part * (1 - 1e-9)), 1.0, kParts));
  const double width = (to - from) / parts;
  for (int i = 0; i < parts; ++i) add_parts(at, from + (i + 0.5) * width, width, length, max_part);
  transmittance_ = passed_ * std::exp(-depth_);
}

/// One part, or where it is longer than wanted its halves, as long as it is not thin: in a cell
/// thousands of the finest wide, f is one cubic, and most of its parts would only cost time.
template <class At>
void LightIntegral::add_parts(const At& at, double middle, double width, double length, double max_part) {
  if (transmittance_ < kOpaque) return;
  const double offset = width / (2 * kSqrt3);
  const TransferTable::Light first = at(middle - offset);
  const TransferTable::Light second = at(middle + offset);
  const double depth = (first.extinction + second.extinction) / 2 * (width * length);
  if (width * length > max_part * 1.001 && depth > kThin) {
    add_parts(at, middle - width / 4, width / 2, length, max_part);
    add_parts(at, middle + width / 4, width / 2, length, max_part);
    return;
  }
  add_part(first, second, depth);
}

/// What a place of the piece emits.
TransferTable::Light LightIntegral::light(const PieceFunction& f, const TransferTable::Segment& segment, double s,
                                          double length) const {
  TransferTable::Light light = table_->light(segment, f(s));
  if (arriving_ && light.extinction > 0) light.rgb *= arriving_(start_ + s * length);
  return light;
}

/// A part of mean extinction K and length h has opacity 1 - exp(-K h); its colour is the mean of
/// the two points' weighted by what each sends to the front. Exact where colour and light are constant.
void LightIntegral::add_part(const TransferTable::Light& first, const TransferTable::Light& second, double depth) {
  if (!(depth > 0)) return;
  const double opacity = -std::expm1(-depth);
  Vec3d rgb = first.rgb;
  if (std::isfinite(depth) && second.rgb != first.rgb) {
    const double behind = second.extinction * std::exp(-depth / kSqrt3);  // depth from one Gauss point to the other
    rgb += behind / (first.extinction + behind) * (second.rgb - first.rgb);
  }
  color_ += transmittance_ * opacity * rgb;
  transmittance_ -= transmittance_ * opacity;
  depth_ += depth;
}

}  // namespace amrtex
