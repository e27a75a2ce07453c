// What it costs to look at the same structure with another transfer function or other isovalues.
#pragma once

#include <cstdint>
#include <vector>

#include "renderers/context/context.hpp"
#include "renderers/gpu/structure.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// The scene after a small change: every point of the transfer function moved up by a hundredth of the range of its extinction
/// points, isovalues by a hundredth of what they span (of themselves where there is one).
Scene changed_scene(Scene scene);

struct ChangeTimes {
  std::vector<double> wall_ms;  ///< of each change
  std::int64_t bytes = 0;       ///< of what is uploaded because of it: uniforms that differ (4 a number), tables
};

/// Goes `times` times from the scene to the changed one or back: what decides which regions are hidden is made anew on the host,
/// uploaded and bound, and GL has finished. No frame is drawn. Throws UnsupportedError where the changed scene needs another
/// shader, or another structure because what was hidden was not built.
ChangeTimes time_changes(Context& context, const DomainGeometry& geometry, const Structure& structure, const Scene& scene,
                         int times);

}  // namespace amrtex
