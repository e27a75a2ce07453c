// A view in the mesh's own coordinates.
#pragma once

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// A view in the mesh's own coordinates, and what of the mesh is drawn. A point p lies at (p - eye) / cells_per_unit from the
/// eye, in units of the smallest edge of a finest cell; the vectors are in these units.
struct FinestCamera {
  Vec3d eye{0};                       ///< finest cells
  Vec3d forward{0}, right{0}, up{0};  ///< as in CameraFrame
  Vec3d cells_per_unit{1};
  Vec3d lower{0}, upper{0};  ///< finest cells: the domain, or the sub-box to draw
  bool orthographic = false;
};
FinestCamera finest_camera(const DomainGeometry& geometry, const Scene& scene);

/// Would a position on the lattice be off in float, so that rays are held in double?
bool needs_double_rays(const DomainGeometry& geometry, const Scene& scene);

/// Eye, directions, box to draw and size of the picture (shaders/ray.glsl).
void add_camera(const DomainGeometry& geometry, const Scene& scene, SceneBindings& bindings);
/// At which distance cells are small enough to stand for what lies below them (level_suffices() in shaders/contract.glsl).
void add_detail(const DomainGeometry& geometry, const Scene& scene, SceneBindings& bindings);

}  // namespace amrtex
