// What the pieces of a ray add to a pixel, in double precision. Private to the reference.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "renderers/reference/piece_function.hpp"
#include "renderers/reference/smooth_light.hpp"
#include "renderers/reference/transfer_table.hpp"

namespace amrtex {

/// How finely one ray is integrated: in parts of a largest length, or where that is 0 within a tolerance.
struct RayRule {
  double part = 0;       ///< world length of the largest part
  double tolerance = 0;  ///< of full scale, for the whole ray
  double length = 0;     ///< world length of the ray, on which some of the tolerance is spent evenly
};

/// Emission and absorption along one ray, front to back: dC = T k c ds, dT = -T k ds; at a surface
/// of opacity a, C grows by T a c and T falls to T (1 - a).
class LightIntegral {
 public:
  /// Light that arrives at a place of the ray (its parameter, world length): what is emitted there is multiplied by it.
  using Arriving = std::function<double(double)>;

  /// Without a table there is no volume but what add_smooth() is given; without `arriving` every place has its full light.
  explicit LightIntegral(const RayRule& rule, const TransferTable* table = nullptr, Arriving arriving = {})
      : rule_(rule),
        opaque_(std::max(kOpaque, rule.tolerance * kUnseen)),
        table_(table),
        arriving_(std::move(arriving)),
        purse_(rule.tolerance / 4) {}

  /// Adds the piece that lies between two places of the ray (world length), or what is between two of its own places.
  void add(const PieceFunction& f, const RaySpan& piece, double first = 0, double last = 1);
  /// Adds what is between two places of a stretch in which the light is smooth; of any field, or of several.
  void add_smooth(const Stretch& stretch, double first = 0, double last = 1);
  /// Adds a surface behind all that was added before.
  void add_surface(const Vec3d& rgb, double opacity);

  double transmittance() const { return transmittance_; }
  /// Is nothing seen behind what was added?
  bool opaque() const { return transmittance_ < opaque_; }
  const Vec3d& color() const { return color_; }
  /// What a channel may be off by; of the rule with a tolerance alone.
  double error() const { return error_ + (opaque() ? transmittance_ : 0); }
  /// Of the field and its transfer function.
  std::int64_t evaluations() const { return evaluations_; }

 private:
  void add_interval(const PieceFunction& f, const RaySpan& piece, double first, double last);
  void add_exact(const Stretch& stretch, double first, double last);
  void add_stretch(const Stretch& stretch, double first, double last);
  void add_parts(const Stretch& stretch, double middle, double width);
  void add_part(const TransferTable::Light& first, const TransferTable::Light& second, double depth);
  void add_within(const Stretch& stretch, double first, double last);
  void take(const Stretch& stretch, double first, double last, std::size_t begin, LightSamples& samples);
  double share(const LightSums& sums, double length) const;
  bool enough(double off, const LightSums& sums, double length) const;
  void spend(double off, const LightSums& sums, double length);
  void commit(const LightSums& sums, const Vec3d& base, double off, const Stretch& stretch);
  TransferTable::Light evaluate(const Stretch& stretch, double s) {
    ++evaluations_;
    return stretch.light(s);
  }

  static constexpr double kOpaque = 1e-12;  // far below what a float picture can show
  static constexpr double kUnseen = 0.01;   // of the tolerance

  RayRule rule_;
  double opaque_;  // transmittance behind which nothing is added
  const TransferTable* table_;
  Arriving arriving_;
  Vec3d color_{0};     // premultiplied
  double depth_ = 0;   // optical, of the volume, from the eye
  double passed_ = 1;  // what surfaces let through
  double transmittance_ = 1;
  double error_ = 0;
  bool joins_ = false;       // the next part to the piece before, where the field and its light may jump
  double taken_before_ = 0;  // by a layer as thin as the rounding of a place, at the part before
  double purse_;             // what is left of the tolerance for places where halving helps little: singular ones
  int halvings_ = 0;         // left for the stretch
  std::int64_t evaluations_ = 0;
  std::vector<double> breaks_;
};

}  // namespace amrtex
