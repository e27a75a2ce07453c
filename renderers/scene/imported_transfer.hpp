// A transfer function as another program wrote it.
#pragma once

#include <array>
#include <vector>

#include "renderers/scene/color_map.hpp"

namespace amrtex {

struct OpacityPoint {
  double value;
  double opacity;  ///< 0 to 1, over a length that no such file states
};

/// Values ascend in both lists.
struct ImportedTransfer {
  ColorPoints colors;                 ///< linear RGB, of as few points as kColorBound takes; empty: the file has none
  std::vector<OpacityPoint> opacity;  ///< linear between points; empty: the file has none
  bool relative = false;              ///< values are places in a range that the file does not state
  bool logarithmic = false;           ///< both are joined over log10(value)

  /// From the first to the last value of both.
  std::array<double, 2> range() const;
  /// The same with values from 0 to 1 over range().
  ColorPoints unit_colors() const;
  std::vector<OpacityPoint> unit_opacity() const;
};

}  // namespace amrtex
