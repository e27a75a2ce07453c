// Quadrature on [0, 1] at 3, 7 or 15 places, each set within the next: what a larger set changes tells the error of the smaller,
// and no value is thrown away (T. N. L. Patterson, The optimum addition of points to quadrature formulae, Math. Comp. 22, 1968).
// Private to the reference.
#pragma once

#include <array>
#include <cstddef>

namespace amrtex {

/// Of the 15 places; the 7 are every second, the 3 every fourth, and the middle is in all.
inline constexpr std::size_t kNestedPlaces = 15;
inline constexpr std::size_t kNestedMiddle = 7;

/// Exact for polynomials of degree 5, 11 and 23 (N = 3, 7, 15).
template <std::size_t N>
struct NestedRule {
  std::array<double, N> place{};
  std::array<double, N> weight{};
  /// before[i][j]: weight of value j in the integral from 0 to place i of the polynomial through all values.
  std::array<std::array<double, N>, N> before{};

  /// Where value k stands among the 15.
  static constexpr std::size_t index(std::size_t k) { return (k + 1) * ((kNestedPlaces + 1) / (N + 1)) - 1; }
};

namespace nested_rule {

inline constexpr std::array<double, kNestedPlaces> kPlaces{
    0.0030840183936224888957, 0.019754365645989858288, 0.055770383563871500555, 0.11270166537925831148,
    0.18944852663138679853,   0.282878125326598721,    0.38830665678551655919,  0.5,
    0.61169334321448344081,   0.717121874673401279,    0.81055147336861320147,  0.88729833462074168852,
    0.94422961643612849945,   0.98024563435401014171,  0.9969159816063775111};
inline constexpr std::array<double, 3> kWeights3{0.27777777777777777778, 0.44444444444444444444, 0.27777777777777777778};
inline constexpr std::array<double, 7> kWeights7{0.052328113013233632597, 0.13424404493416672036, 0.20069870738798111145,
                                                 0.22545826932923707117,  0.20069870738798111145, 0.13424404493416672036,
                                                 0.052328113013233632597};
inline constexpr std::array<double, 15> kWeights15{0.0085008598149701301695, 0.025801641498539869848, 0.046463597657562268843,
                                                   0.06720762762189211018,   0.085755954568195690394, 0.10031426468849451052,
                                                   0.1095784292007937482,    0.11275524989910334369,  0.1095784292007937482,
                                                   0.10031426468849451052,   0.085755954568195690394, 0.06720762762189211018,
                                                   0.046463597657562268843,  0.025801641498539869848, 0.0085008598149701301695};

/// The polynomial that is 1 at place j and 0 at the others.
template <std::size_t N>
constexpr double basis(const std::array<double, N>& places, std::size_t j, double s) {
  double product = 1;
  for (std::size_t k = 0; k < N; ++k)
    if (k != j) product *= (s - places[k]) / (places[j] - places[k]);
  return product;
}

template <std::size_t N>
constexpr NestedRule<N> make(const std::array<double, N>& weights) {
  NestedRule<N> rule;
  rule.weight = weights;
  for (std::size_t i = 0; i < N; ++i) rule.place[i] = kPlaces[NestedRule<N>::index(i)];
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j)
      for (std::size_t k = 0; k < kNestedPlaces; ++k)  // of a higher degree than the polynomial
        rule.before[i][j] += rule.place[i] * kWeights15[k] * basis(rule.place, j, rule.place[i] * kPlaces[k]);
  return rule;
}

}  // namespace nested_rule

template <std::size_t N>
inline constexpr NestedRule<N> kNestedRule = [] {
  if constexpr (N == 3)
    return nested_rule::make<3>(nested_rule::kWeights3);
  else if constexpr (N == 7)
    return nested_rule::make<7>(nested_rule::kWeights7);
  else
    return nested_rule::make<15>(nested_rule::kWeights15);
}();

}  // namespace amrtex
