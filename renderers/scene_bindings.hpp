// A scene as the shaders see it: defines, uniforms and tables. The same for the GL
// context and for the CPU build of the same text.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderers/scene.hpp"
#include "renderers/uniforms.hpp"

namespace amrtex {

struct SceneBindings {
  std::vector<std::pair<std::string, int>> defines;
  UniformValues uniforms;
  std::vector<HostTexture> buffers;  ///< the transfer function's tables, where it has too many points
  bool transfer_exact = true;        ///< evaluated from its points; else from a table of 4096 bins
};

/// Uniforms of the contract alone (what probes need).
UniformValues field_uniforms(const AmrHierarchy& hierarchy, const EncodedField& field);

/// Everything that a consumer of shaders/march.glsl needs beside the field's own part.
SceneBindings bind_scene(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene);

/// What builders may leave out for this scene. Throws UsageError where `prune` is asked for in a mode other than dvr.
SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering);

}  // namespace amrtex
