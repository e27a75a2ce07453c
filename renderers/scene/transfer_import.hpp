// Colour maps and transfer functions that other programs wrote.
#pragma once

#include <string>
#include <vector>

#include "renderers/scene/imported_transfer.hpp"

namespace amrtex {

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
