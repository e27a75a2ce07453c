// What a scene asks of the structure that it is drawn from.
#pragma once

#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

/// What builders may leave out for this scene. Throws UsageError where `prune` is asked for in a mode other than dvr.
SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering);

/// Throws where the structure was built without what the scene draws: UsageError for parts that another transfer function hid,
/// Error for fields and levels of detail.
void require_needs(const EncodedField& field, const Scene& scene);

}  // namespace amrtex
