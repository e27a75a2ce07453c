// f along a piece of a ray on which its filter is smooth: a quotient of two cubics. Private to the reference.
#pragma once

#include <array>
#include <cstdint>

namespace amrtex {

/// A polynomial of degree 3 in the piece's own parameter s in [0, 1].
struct Cubic {
  std::array<double, 4> c{};
  double operator()(double s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
  double integral() const { return c[0] + c[1] / 2 + c[2] / 3 + c[3] / 4; }
  Cubic& operator+=(const Cubic& other);
  Cubic& operator*=(double factor);
};

/// The extrema of the cubic inside (0, 1), ascending; returns how many.
int extrema_in_unit(const Cubic& f, std::array<double, 2>& out);
/// The changes of sign of the cubic inside (0, 1), ascending; returns how many.
int roots_in_unit(const Cubic& f, std::array<double, 3>& out);
/// The change of sign in (a, b), at whose ends f has different signs; to some units of its own last digit.
double root_between(const Cubic& f, double a, double b);

/// f = base + numerator / denominator; the denominator is 1 for all filters but `basis`. The base is a value of the cells, so
/// that what a small rise above a large value is keeps its digits.
struct PieceFunction {
  double base = 0;
  Cubic numerator;
  Cubic denominator{{1, 0, 0, 0}};
  bool rational = false;
  double lower = 0;  ///< bounds of f over the piece, not necessarily reached
  double upper = 0;
  double rise(double s) const { return rational ? numerator(s) / denominator(s) : numerator(s); }
  double operator()(double s) const { return base + rise(s); }
  /// f - value, without the rounding of f itself.
  double above(double value, double s) const { return (base - value) + rise(s); }
  /// A cubic that has the sign of f - value all along the piece.
  Cubic minus(double value) const;
  /// Largest |f| that the bounds let expect.
  double largest() const;
};

/// Largest value of f over the piece.
double maximum(const PieceFunction& f);
/// Mean of f over the piece: exact for polynomials; quotients in `parts` parts with 4 Gauss points each.
double mean(const PieceFunction& f, int parts);

/// The mean and what it may be off by.
struct Mean {
  double value = 0;
  double error = 0;
  std::int64_t evaluations = 0;  ///< of f
};
/// Quotients in halves until the error is at most `tolerance` times the largest |f|.
Mean mean_within(const PieceFunction& f, double tolerance);

}  // namespace amrtex
