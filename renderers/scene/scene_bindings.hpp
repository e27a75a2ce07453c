// A scene as the shaders see it: defines, uniforms and tables. The same for the GL
// context and for the CPU build of the same text.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderers/gpu/uniforms.hpp"
#include "renderers/scene/scene.hpp"

namespace amrtex {

struct SceneBindings {
  std::vector<std::pair<std::string, int>> defines;
  UniformValues uniforms;
  std::vector<HostTexture> buffers;  ///< the transfer function's tables, where it has too many points; triangles
  bool transfer_exact = true;        ///< evaluated from its points; else from a table of 4096 bins
  double triangle_seconds = 0;       ///< that finding where rays meet triangles took
};

/// A view in the mesh's own coordinates, and what of the mesh is drawn. A point p lies at (p - eye) / cells_per_unit from the
/// eye, in units of the smallest edge of a finest cell; the vectors are in these units.
struct FinestCamera {
  Vec3d eye{0};                       ///< finest cells
  Vec3d forward{0}, right{0}, up{0};  ///< as in CameraFrame
  Vec3d cells_per_unit{1};
  Vec3d lower{0}, upper{0};  ///< finest cells: the domain, or the sub-box to draw
  bool orthographic = false;
};
FinestCamera finest_camera(const AmrHierarchy& hierarchy, const Scene& scene);

/// Uniforms of the contract alone (what probes need).
UniformValues field_uniforms(const AmrHierarchy& hierarchy, const EncodedField& field);

/// Everything that a consumer of shaders/march.glsl needs beside the field's own part.
SceneBindings bind_scene(const AmrHierarchy& hierarchy, const EncodedField& field, const Scene& scene);

/// What builders may leave out for this scene. Throws UsageError where `prune` is asked for in a mode other than dvr.
SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering);

}  // namespace amrtex
