// What one piece of a ray adds to a pixel, in double precision: f along a piece is a
// quotient of two cubics, the transfer function is linear between its points.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <vector>

#include "renderers/scene/scene.hpp"

namespace amrtex {

/// A polynomial of degree 3 in the piece's own parameter s in [0, 1].
struct Cubic {
  std::array<double, 4> c{};
  double operator()(double s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
  double integral() const { return c[0] + c[1] / 2 + c[2] / 3 + c[3] / 4; }
  Cubic& operator+=(const Cubic& other);
};

/// The extrema of the cubic inside (0, 1), ascending; returns how many.
int extrema_in_unit(const Cubic& f, std::array<double, 2>& out);
/// The changes of sign of the cubic inside (0, 1), ascending; returns how many.
int roots_in_unit(const Cubic& f, std::array<double, 3>& out);
/// The change of sign in (a, b), at whose ends f has different signs.
double root_between(const Cubic& f, double a, double b);

/// f along a piece: numerator / denominator; the denominator is 1 for all filters but `basis`.
struct PieceFunction {
  Cubic numerator;
  Cubic denominator;
  bool rational = false;
  double lower = 0;  ///< bounds of f over the piece, not necessarily reached
  double upper = 0;
  double operator()(double s) const { return rational ? numerator(s) / denominator(s) : numerator(s); }
  /// A cubic that has the sign of f - value all along the piece.
  Cubic minus(double value) const;
};

/// Largest value of f over the piece.
double maximum(const PieceFunction& f);
/// Mean of f over the piece: exact for polynomials; quotients in `parts` parts with 4 Gauss points each.
double mean(const PieceFunction& f, int parts);

/// The transfer function as segments between the points of both its curves.
class TransferTable {
 public:
  /// `extinction_scale` turns the transfer function's extinction into one per world length.
  TransferTable(const TransferFunction& transfer_function, double extinction_scale);

  struct Light {
    double extinction;  ///< per world length
    Vec3d rgb;
  };
  struct Segment {
    double axis_lower, inverse_width;  ///< of value or log10(value); 0 where the segment is constant
    Light lower, upper;
    bool constant;  ///< both curves
    bool one_color;
    bool visible;  ///< extinction is not 0 throughout
  };

  const std::vector<double>& knots() const { return knots_; }
  bool logarithmic() const { return logarithmic_; }
  /// Segment k lies between knots k - 1 and k.
  std::size_t segment_of(double value) const;
  const Segment& segment(std::size_t k) const { return segments_[k]; }
  bool visible(std::size_t first, std::size_t last) const { return visible_before_[last + 1] > visible_before_[first]; }
  Light light(const Segment& segment, double value) const;

 private:
  bool logarithmic_;
  std::vector<double> knots_;
  std::vector<Segment> segments_;
  std::vector<int> visible_before_;  // visible segments below each
};

/// Emission and absorption along one ray, front to back: dC = T k c ds, dT = -T k ds; at a surface
/// of opacity a, C grows by T a c and T falls to T (1 - a).
class LightIntegral {
 public:
  /// Transmittance behind which nothing is added: far below what a float picture can show.
  static constexpr double kOpaque = 1e-12;

  /// Light that arrives at a place of the ray (its parameter, world length): what is emitted there is multiplied by it.
  using Arriving = std::function<double(double)>;

  LightIntegral() = default;  ///< no volume, surfaces alone
  /// Without `arriving` every place has its full light.
  explicit LightIntegral(const TransferTable& table, Arriving arriving = {}) : table_(&table), arriving_(std::move(arriving)) {}

  /// Adds a piece of `length`, or what lies between two of its places, in parts of at most
  /// `max_part` (both world), or of a 16th of the stretch where these are thin. `start`: where
  /// the piece begins, which only `arriving` asks for.
  void add(const PieceFunction& f, double length, double max_part, double from = 0, double to = 1, double start = 0);
  /// What the volume emits and takes at a place of a stretch (its parameter, in [0, 1]).
  using Places = std::function<TransferTable::Light(double)>;
  /// Adds the part between two places of a stretch of `length` in which the light is smooth, in parts as above; of any field, or
  /// of several.
  void add_smooth(const Places& at, double length, double max_part, double from, double to);
  /// Adds a surface behind all that was added before.
  void add_surface(const Vec3d& rgb, double opacity);

  double transmittance() const { return transmittance_; }
  const Vec3d& color() const { return color_; }

 private:
  void add_interval(const PieceFunction& f, double from, double to, double length, double max_part);
  template <class At>
  void add_parts(const At& at, double middle, double width, double length, double max_part);
  void add_part(const TransferTable::Light& first, const TransferTable::Light& second, double depth);
  TransferTable::Light light(const PieceFunction& f, const TransferTable::Segment& segment, double s, double length) const;

  const TransferTable* table_ = nullptr;
  Arriving arriving_;
  double start_ = 0;   // of the piece
  Vec3d color_{0};     // premultiplied
  double depth_ = 0;   // optical, of the volume, from the eye
  double passed_ = 1;  // what surfaces let through
  double transmittance_ = 1;
  std::vector<double> breaks_;
};

}  // namespace amrtex
