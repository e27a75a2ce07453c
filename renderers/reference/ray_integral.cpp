#include "renderers/reference/ray_integral.hpp"

#include <cmath>
#include <limits>
#include <optional>

namespace amrtex {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// ---- the rule of fixed parts ----

constexpr double kSqrt3 = 1.7320508075688772935;
constexpr double kParts = 16;   // of a piece, before only its opaque ones are split further
constexpr double kThin = 0.25;  // optical depth of a part that is never split further

// ---- the rule with a tolerance ----

constexpr double kDeepest = 10;     // optical depth of a part: no rule sees an exponential that falls faster
constexpr double kPurseShare = 64;  // part of the purse that one place may take
constexpr double kSteep = 16;       // growth of the field, over which a logarithm is split beside its steep end
constexpr double kTooSteep = 64;    // over which it is not even tried
constexpr double kSteepShare = 1.0 / 8;
constexpr double kFall = 16;      // of the ratio of two differences, which is the worst that the next one falls by
constexpr double kSquares = 8;    // each set of places leaves about the square of what the set before leaves, times this
constexpr int kHalvings = 2000;   // of one stretch, in the worst case; what is off then is in the estimate
constexpr int kLitHalvings = 64;  // where each place traces a ray to a lamp
constexpr double kRoundings = 4;  // of a place of the ray, in units of its last digit

/// A piece of one field inside one segment of its transfer function.
class PieceStretch final : public Stretch {
 public:
  PieceStretch(const PieceFunction& f, const RaySpan& piece, const TransferTable& table, const TransferTable::Segment& segment,
               const LightIntegral::Arriving& arriving)
      : Stretch(piece), f_(f), table_(table), segment_(segment), arriving_(arriving) {}

  TransferTable::Light light(double s) const override {
    TransferTable::Light light = table_.light(segment_, f_, s);
    if (arriving_ && light.extinction > 0) light.rgb *= arriving_(span().from + s * span().length());
    return light;
  }
  double most() const override { return segment_.most(); }
  double color_range() const override { return arriving_ ? 1 : table_.color_range(); }
  double growth(double a, double b) const override {
    if (!table_.logarithmic() || segment_.constant) return 1;
    return std::max(f_(b), segment_.value_lower) / std::max(f_(a), segment_.value_lower);
  }

 private:
  const PieceFunction& f_;
  const TransferTable& table_;
  const TransferTable::Segment& segment_;
  const LightIntegral::Arriving& arriving_;
};

/// Where a steep logarithm is split: beside the end where it falls, else in the middle.
double split_place(double growth, double a, double b) {
  if (growth > kSteep) return a + kSteepShare * (b - a);
  if (growth < 1 / kSteep) return b - kSteepShare * (b - a);
  return a + (b - a) / 2;
}

/// The last of the 7 places before which no more than the deepest part lies, else the first.
double opaque_place(const LightSamples& samples, double a, double b) {
  const NestedRule<7>& rule = kNestedRule<7>;
  std::size_t last = 0;
  for (std::size_t i = 1; i < 7; ++i) {
    double before = 0;
    for (std::size_t j = 0; j < 7; ++j) before += rule.before[i][j] * samples.depth[rule.index(j)];
    if (!(before <= kDeepest)) break;
    last = i;
  }
  return a + rule.place[last] * (b - a);
}

double difference(const Vec3d& a, const Vec3d& b) {
  return std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)});
}

/// What two rules differ by, seen from the front of the part: its light, and what it lets through of all that is behind.
double difference(const LightSums& a, const LightSums& b) {
  return difference(a.excess, b.excess) + std::exp(-std::max(std::min(a.depth, b.depth), 0.0)) * std::abs(a.depth - b.depth);
}

/// What two sets of places differ by is the error of the smaller. That of the larger is less, by a part of how the difference to
/// the set before fell.
double surely(double difference, double before) {
  return before > 0 ? difference * std::min(1.0, kFall * difference / before) : difference;
}

}  // namespace

void LightIntegral::add(const PieceFunction& f, const RaySpan& piece, double first, double last) {
  if (table_ == nullptr || !(last > first)) return;
  const std::size_t low = table_->segment_of(f.lower);
  const std::size_t high = table_->segment_of(f.upper);
  if (!table_->visible(low, high)) return;
  joins_ = true;
  breaks_.assign({first, last});
  const auto break_at = [&](double s) {
    if (s > first && s < last) breaks_.push_back(s);
  };
  for (std::size_t k = low; k < high; ++k) {
    std::array<double, 3> roots{};
    const int n = roots_in_unit(f.minus(table_->knots()[k]), roots);
    for (int i = 0; i < n; ++i) break_at(roots[static_cast<std::size_t>(i)]);
  }
  if (table_->logarithmic() && rule_.part == 0) {  // near its least value a logarithm is steep: that shall be an end
    std::array<double, 2> extrema{};
    const int n = extrema_in_unit(f.numerator, extrema);
    for (int i = 0; i < n; ++i) break_at(extrema[static_cast<std::size_t>(i)]);
  }
  std::sort(breaks_.begin(), breaks_.end());
  for (std::size_t i = 0; i + 1 < breaks_.size(); ++i)
    if (breaks_[i + 1] > breaks_[i]) add_interval(f, piece, breaks_[i], breaks_[i + 1]);
}

void LightIntegral::add_surface(const Vec3d& rgb, double opacity) {
  color_ += transmittance_ * opacity * rgb;
  transmittance_ *= 1 - opacity;
  passed_ *= 1 - opacity;
}

/// Inside one segment of the transfer function everything is smooth.
void LightIntegral::add_interval(const PieceFunction& f, const RaySpan& piece, double first, double last) {
  const auto& segment = table_->segment(table_->segment_of(f((first + last) / 2)));
  if (!segment.visible) return;
  const PieceStretch stretch(f, piece, *table_, segment, arriving_);
  if (!arriving_ && (segment.constant || (segment.one_color && !table_->logarithmic() && !f.rational)))
    add_exact(stretch, first, last);
  else
    add_stretch(stretch, first, last);
}

/// Two Gauss points integrate a cubic extinction exactly, and of one colour nothing else is needed.
void LightIntegral::add_exact(const Stretch& stretch, double first, double last) {
  if (opaque()) return;
  const double middle = (first + last) / 2;
  const double offset = (last - first) / (2 * kSqrt3);
  const TransferTable::Light a = evaluate(stretch, middle - offset);
  const TransferTable::Light b = evaluate(stretch, middle + offset);
  const double depth = (a.extinction + b.extinction) / 2 * ((last - first) * stretch.span().length());
  if (rule_.part > 0) {
    add_part(a, b, depth);
    transmittance_ = passed_ * std::exp(-depth_);
  } else if (depth > 0) {
    commit({depth, Vec3d(0), 0}, a.rgb, 0, stretch);
  }
}

void LightIntegral::add_smooth(const Stretch& stretch, double first, double last) {
  joins_ = true;
  add_stretch(stretch, first, last);
}

void LightIntegral::add_stretch(const Stretch& stretch, double first, double last) {
  if (rule_.part == 0) {
    halvings_ = arriving_ ? kLitHalvings : kHalvings;
    add_within(stretch, first, last);
    return;
  }
  const double wanted = std::ceil((last - first) * stretch.span().length() / rule_.part * (1 - 1e-9));
  const int parts = static_cast<int>(std::clamp(wanted, 1.0, kParts));
  const double width = (last - first) / parts;
  for (int i = 0; i < parts; ++i) add_parts(stretch, first + (i + 0.5) * width, width);
  transmittance_ = passed_ * std::exp(-depth_);  // the product of the parts drifts
}

/// One part, or where it is longer than wanted its halves, as long as it is not thin: in a cell
/// thousands of the finest wide, f is one cubic, and most of its parts would only cost time.
void LightIntegral::add_parts(const Stretch& stretch, double middle, double width) {
  if (opaque()) return;
  const double offset = width / (2 * kSqrt3);
  const double length = width * stretch.span().length();
  const TransferTable::Light first = evaluate(stretch, middle - offset);
  const TransferTable::Light second = evaluate(stretch, middle + offset);
  const double depth = (first.extinction + second.extinction) / 2 * length;
  if (length > rule_.part * 1.001 && depth > kThin) {
    add_parts(stretch, middle - width / 4, width / 2);
    add_parts(stretch, middle + width / 4, width / 2);
    return;
  }
  add_part(first, second, depth);
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

/// One part where two rules of it agree, else two, front to back.
void LightIntegral::add_within(const Stretch& stretch, double first, double last) {
  LightSamples samples;
  while (!opaque()) {
    const double length = (last - first) * stretch.span().length();
    const double most = transmittance_ * stretch.most() * length;  // that this can add
    const double growth = stretch.growth(first, last);
    const double middle = split_place(growth, first, last);
    const bool splits = halvings_ > 0 && middle > first && middle < last;
    std::optional<double> place;  // of the split
    if (splits && (growth > kTooSteep || growth < 1 / kTooSteep) && most > purse_ / kPurseShare) place = middle;
    if (!place) {
      take(stretch, first, last, 1, samples);
      if (std::isinf(samples.depth[kNestedMiddle])) {  // as it is all along: what is seen is the front
        commit({std::numeric_limits<double>::infinity()}, evaluate(stretch, first).rgb, 0, stretch);
        return;
      }
      LightSums sums = sum_light<7>(samples);
      if (splits && sums.depth > kDeepest) {
        place = opaque_place(samples, first, last);
        if (!(*place > first && *place < last)) place = middle;  // rounded onto an end
      } else {
        double off = std::min(transmittance_ * difference(sums, sum_light<3>(samples)), most);
        const double left = off * std::min(1.0, kSquares * off / (transmittance_ * (sums.spread + sums.depth)));
        if (!enough(off, sums, length) && enough(left, sums, length)) {
          take(stretch, first, last, 0, samples);
          const LightSums before = sums;
          sums = sum_light<15>(samples);
          off = std::min(surely(transmittance_ * difference(sums, before), off), most);
        }
        if (!splits || enough(off, sums, length)) {
          spend(off, sums, length);
          commit(sums, samples.rgb[kNestedMiddle], off, stretch);
          return;
        }
        place = middle;
      }
    }
    --halvings_;
    add_within(stretch, first, *place);
    first = *place;
  }
}

/// Every second of the 15 places of a part.
void LightIntegral::take(const Stretch& stretch, double first, double last, std::size_t begin, LightSamples& samples) {
  const double length = (last - first) * stretch.span().length();
  for (std::size_t k = begin; k < kNestedPlaces; k += 2) {
    const TransferTable::Light light = evaluate(stretch, first + nested_rule::kPlaces[k] * (last - first));
    samples.depth[k] = light.extinction * length;
    samples.rgb[k] = light.rgb;
  }
}

/// A part's share of the tolerance: half of it goes by what parts take of the light, a quarter by their length. What is left lies
/// in the purse.
double LightIntegral::share(const LightSums& sums, double length) const {
  const double taken = transmittance_ * -std::expm1(-std::max(sums.depth, 0.0));
  return rule_.tolerance * (taken / 2 + (rule_.length > 0 ? length / rule_.length / 4 : 0));
}

bool LightIntegral::enough(double off, const LightSums& sums, double length) const {
  return off <= purse_ / kPurseShare || off <= share(sums, length);
}

void LightIntegral::spend(double off, const LightSums& sums, double length) {
  if (off <= purse_ / kPurseShare && off > share(sums, length)) purse_ -= off;
}

/// A face or a knot lies where doubles say it lies: a layer of that thickness may be too much or missing, and at a face it may be
/// of the piece before. Light is continuous at knots.
void LightIntegral::commit(const LightSums& sums, const Vec3d& base, double off, const Stretch& stretch) {
  const double depth = std::max(sums.depth, 0.0);
  const double before = transmittance_;
  color_ += before * (-std::expm1(-depth) * base + sums.excess);
  depth_ += depth;
  transmittance_ = passed_ * std::exp(-depth_);
  const double layer = kRoundings * kEpsilon * std::max(std::abs(stretch.span().from), std::abs(stretch.span().to));
  const double taken = std::min(1.0, stretch.most() * layer);
  error_ += off + taken * transmittance_;
  if (joins_) error_ += std::min(taken, taken_before_) * before * stretch.color_range();
  joins_ = false;
  error_ = std::min(1.0, error_);  // no channel can be off by more
  taken_before_ = taken;
}

}  // namespace amrtex
