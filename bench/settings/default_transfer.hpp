// A transfer function for data that nobody has described: colours over the range of most values, extinction that shows what
// stands out from the background, as much of it as a picture can take.
#pragma once

#include <optional>
#include <string>

#include "bench/settings/value_histogram.hpp"
#include "renderers/scene/color_map.hpp"

namespace amrtex {

struct TransferRequest {
  std::string color_map;                       ///< empty: viridis, or cool_warm where values lie on both sides of 0
  std::optional<std::array<double, 2>> range;  ///< first and last value of the colours; absent: shown_range
  std::optional<bool> logarithmic;             ///< absent: as the values span decades
  std::optional<ColorPoints> colors;           ///< in place of a named map: over 0 to 1
};

/// The optical depth that half of the rays which meet something pass through.
inline constexpr double kMedianDepth = 1;

/// Extinction is 0 around the value that fills most of the volume, and grows with the distance from it; without such a value it
/// grows with the value. It is scaled so that the median optical depth of the rays of this view which meet any of it is
/// kMedianDepth. The same data and view give the same numbers on every machine.
TransferFunction default_transfer(const AmrHierarchy& mesh, int field, const View& view, double aspect,
                                  const TransferRequest& request = {});

/// World length that an opacity is meant over where nobody says: the domain's diagonal by the cube root of its leaf cells, about
/// the width of a cell. ParaView begins with it, too.
double opacity_length(const AmrHierarchy& mesh);

/// Median optical depth of those of a grid of the picture's rays that meet some extinction, with the values of leaf cells; 0
/// where there is none.
double median_depth(const AmrHierarchy& mesh, int field, const TransferFunction& transfer_function, const View& view,
                    double aspect);

}  // namespace amrtex
