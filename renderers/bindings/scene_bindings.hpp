// A scene as the shaders see it: defines, uniforms and tables. The same for the GL
// context and for the CPU build of the same text.
#pragma once

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// Uniforms of the contract alone (what probes need).
UniformValues field_uniforms(const DomainGeometry& geometry, const EncodedField& field);

/// Everything that a consumer of shaders/march.glsl needs beside the field's own part.
SceneBindings bind_scene(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene);

}  // namespace amrtex
