// Functions that are linear along each axis between 8 values. Private to the reference.
#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "structures/mesh/finest_position.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// f = sum of coefficient k times the product of those of x, y, z whose bit is set in k.
struct Trilinear {
  std::array<double, 8> coefficients{};
  /// From the values at the corners of the unit cube, x fastest.
  static Trilinear through(const std::array<double, 8>& corners);
  double operator()(const Vec3d& q) const;
};

/// A value and its derivatives per finest cell.
struct Slope {
  double value = 0;
  Vec3d derivative{0};
  /// `width`: finest cells of the unit cube.
  void add(const Trilinear& f, const Vec3d& q, int width);
};

/// One function, and bounds of it in the unit cube.
struct TrilinearCell {
  int level = -1;
  Vec3i cell{0};
  bool all_leaves = false;  ///< between centres of leaves of this level alone
  Trilinear f;
  double lower = 0, upper = 0;
};

inline std::pair<double, double> bounds(const std::array<double, 8>& values) {
  const auto [lower, upper] = std::minmax_element(values.begin(), values.end());
  return {*lower, *upper};
}

/// Place in a cell of a level, in its widths from its lower corner.
inline Vec3d place_in_cell(const FinestPosition& p, int width) { return (Vec3d(p.cell % width) + p.fraction) / Vec3d(width); }

struct DualPlace {
  Vec3i lower;  ///< of the cells between whose centres the position lies
  Vec3d q;      ///< from that cell's centre, cell widths
};
DualPlace dual_place(const FinestPosition& p, int width);

}  // namespace amrtex
