// What lies in a scene beside the volume: surfaces and their light, a lamp, planes that cut, a mirror, triangles.
#pragma once

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// Isosurfaces (shaders/isosurface.glsl); nothing where the mode draws none. `stored`: the scene in the field's units.
void add_surfaces(const Scene& scene, const Scene& stored, const EncodedField& field, SceneBindings& bindings);
/// Light that reaches surfaces from around them.
void add_occlusion(const DomainGeometry& geometry, const RenderSettings& settings, SceneBindings& bindings);
/// A lamp and its shadows (shaders/shadow.glsl).
void add_light(const DomainGeometry& geometry, const RenderSettings& settings, SceneBindings& bindings);
void add_clip_planes(const DomainGeometry& geometry, const RenderSettings& settings, SceneBindings& bindings);
void add_ray_offset(const RenderSettings& settings, SceneBindings& bindings);
void add_mirror(const RenderSettings& settings, SceneBindings& bindings);
/// Where rays end at triangles (shaders/triangles.glsl). Nothing of it in a scene without them, not even a define: they have an
/// entry point of their own.
void add_triangles(const DomainGeometry& geometry, const Scene& scene, SceneBindings& bindings);

}  // namespace amrtex
