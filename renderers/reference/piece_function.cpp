#include "renderers/reference/piece_function.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "renderers/reference/nested_rule.hpp"

namespace amrtex {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr int kMostHalvings = 40;  // of a quotient's piece: beyond, doubles tell its places no longer apart

/// Maximum of a cubic over [0, 1] and where.
double argmax(const Cubic& f) {
  std::array<double, 2> inner{};
  double best = f(1) > f(0) ? 1 : 0;
  const int n = extrema_in_unit(f, inner);
  for (int i = 0; i < n; ++i)
    if (f(inner[static_cast<std::size_t>(i)]) > f(best)) best = inner[static_cast<std::size_t>(i)];
  return best;
}

template <std::size_t N>
double nested_mean(const std::array<double, kNestedPlaces>& values) {
  const auto& rule = kNestedRule<N>;
  double sum = 0;
  for (std::size_t k = 0; k < N; ++k) sum += rule.weight[k] * values[rule.index(k)];
  return sum;
}

/// Adds the mean of a quotient's rise from a to b times b - a. `most`: error allowed for a length of 1.
void add_mean(const PieceFunction& f, double a, double b, double most, int halvings, Mean& mean) {
  std::array<double, kNestedPlaces> values{};
  for (std::size_t k = 0; k < kNestedPlaces; ++k) values[k] = f.rise(a + (b - a) * nested_rule::kPlaces[k]);
  mean.evaluations += static_cast<std::int64_t>(kNestedPlaces);
  const double fine = nested_mean<15>(values);
  const double off = std::abs(fine - nested_mean<7>(values));
  if (off > most && halvings > 0) {
    const double middle = (a + b) / 2;
    add_mean(f, a, middle, most, halvings - 1, mean);
    add_mean(f, middle, b, most, halvings - 1, mean);
    return;
  }
  mean.value += (b - a) * fine;
  mean.error += (b - a) * off;
}

}  // namespace

Cubic& Cubic::operator+=(const Cubic& other) {
  for (std::size_t i = 0; i < 4; ++i) c[i] += other.c[i];
  return *this;
}

Cubic& Cubic::operator*=(double factor) {
  for (double& v : c) v *= factor;
  return *this;
}

int extrema_in_unit(const Cubic& f, std::array<double, 2>& out) {
  double a = 3 * f.c[3];
  double b = 2 * f.c[2];
  double c = f.c[1];
  const double size = std::max({std::abs(a), std::abs(b), std::abs(c)});
  if (!(size > 1e-140 && size < 1e140)) {  // else squares are no numbers
    if (!(size > 0 && std::isfinite(size))) return 0;
    a /= size;
    b /= size;
    c /= size;
  }
  const double discriminant = b * b - 4 * a * c;
  if (!(discriminant > 0)) return 0;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));  // no cancellation
  int n = 0;
  for (const double s : {q / a, c / q})
    if (s > 0 && s < 1) out[static_cast<std::size_t>(n++)] = s;
  if (n == 2 && out[0] > out[1]) std::swap(out[0], out[1]);
  return n;
}

/// Newton's method kept inside a bracket with a change of sign. A root near 0 is found to its own digits, not to those of 1:
/// between it and 0 may lie a layer that is opaque.
double root_between(const Cubic& f, double a, double b) {
  const bool rising = f(a) < 0;
  double s = (a + b) / 2;
  for (int i = 0; i < 200 && b - a > 2 * kEpsilon * b; ++i) {
    const double v = f(s);
    if (v == 0) return s;
    ((v < 0) == rising ? a : b) = s;
    const double slope = f.c[1] + s * (2 * f.c[2] + s * 3 * f.c[3]);
    double next = s - v / slope;
    if (!(next > a && next < b)) next = -f.c[0] / (f.c[1] + s * (f.c[2] + s * f.c[3]));  // of the chord from 0
    if (!(next > a && next < b)) next = (a + b) / 2;
    if (std::abs(next - s) <= 2 * kEpsilon * next) return next;
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
    for (std::size_t i = 0; i < 4; ++i) difference.c[i] += (base - value) * denominator.c[i];
  else
    difference.c[0] += base - value;
  return difference;
}

double PieceFunction::largest() const { return std::max(std::abs(lower), std::abs(upper)); }

double maximum(const PieceFunction& f) {
  if (!f.rational) return f(argmax(f.numerator));
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
  if (!f.rational) return f.base + f.numerator.integral();
  constexpr std::array<double, 2> kNode{0.3399810435848562648, 0.8611363115940525752};
  constexpr std::array<double, 2> kWeight{0.6521451548625461426, 0.3478548451374538574};
  double sum = 0;
  for (int i = 0; i < parts; ++i)
    for (std::size_t k = 0; k < 2; ++k)
      sum += kWeight[k] * (f.rise((i + 0.5 - 0.5 * kNode[k]) / parts) + f.rise((i + 0.5 + 0.5 * kNode[k]) / parts));
  return f.base + sum / (2 * parts);
}

Mean mean_within(const PieceFunction& f, double tolerance) {
  Mean mean;
  const double rounding = 4 * kEpsilon * f.largest();
  if (f.rational)
    add_mean(f, 0, 1, std::max(tolerance * f.largest(), rounding), kMostHalvings, mean);
  else
    mean.value = f.numerator.integral();
  mean.value += f.base;
  mean.error += rounding;
  return mean;
}

}  // namespace amrtex
