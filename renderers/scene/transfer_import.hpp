// Colour maps and transfer functions that other programs wrote.
#pragma once

#include <array>
#include <filesystem>
#include <string>
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

/// Reads ParaView's colour maps (JSON, XML), `.xf` of the ExaBricks family, VisIt's `.ct`, and lists of Gaussians as yt adds them
/// (JSON): docs/color_maps.md. "file#name" chooses one of several maps. Throws UsageError naming the file and what is wrong.
ImportedTransfer import_transfer(const std::string& file);

/// What the extinction of an imported opacity may be off between its points: the larger of this share of it and of this optical
/// depth over the opacity's own length.
inline constexpr double kExtinctionShare = 0.01, kExtinctionDepth = 0.001;

/// Extinction per world unit of an opacity over `length`, world: -ln(1 - a) / length, a cut at 1 - 2^-24. Between the points of
/// the opacity, which goes linearly there, further ones keep to the bound above.
std::vector<TransferFunction::ExtinctionPoint> extinction_of(const std::vector<OpacityPoint>& opacity, double length);

}  // namespace amrtex
