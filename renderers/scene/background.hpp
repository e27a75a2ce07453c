// What a picture to look at has behind it.
#pragma once

#include "renderers/scene/scene.hpp"

namespace amrtex {

/// Nearly black behind light colours, white behind dark ones and behind raw values: linear RGB. It follows from the scene alone,
/// so that a scene that was saved looks the same again.
Vec3d background_for(const Scene& scene);

}  // namespace amrtex
