// How a scene's picture is shown: what its colours stand for, and what of it is background.
#pragma once

#include <string>

#include "renderers/scene/color_map.hpp"
#include "renderers/scene/picture.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// The colours of a volume or of surfaces over values; without points where the picture holds one number a pixel, or no colours.
TransferFunction shown_colors(const Scene& scene);
/// What the values beside a picture's colours, or of its pixels, are: of a scene that draws `field`.
std::string shown_quantity(const Scene& scene, const std::string& field);
/// The same of the mesh's first field, with its unit where the file says it.
std::string shown_quantity(const Scene& scene, const AmrHierarchy& mesh);
/// Raw values of rays that pass the domain are none, rather than 0: what lies around it is background.
Picture without_outside(const Picture& picture, const Scene& scene, const DomainGeometry& geometry);

}  // namespace amrtex
