// A scene as the shaders see it: defines, uniforms and tables. The same for the GL
// context and for the CPU build of the same text.
#pragma once

#include <string>

#include "renderers/bindings/leap_bindings.hpp"
#include "renderers/bindings/shader_assembler.hpp"
#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// Uniforms of the contract alone (what probes need).
UniformValues field_uniforms(const DomainGeometry& geometry, const EncodedField& field);

/// The shader that samples field number `number` at points.
ShaderKey probe_key(const EncodedField& field, int number);

/// Everything that a consumer of shaders/march.glsl needs beside the field's own part. `leaps`: as of add_leaps().
SceneBindings bind_scene(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene,
                         LeapMap leaps = LeapMap::where_something_is_hidden);

/// The shader of entry file `entry` with the defines of field and scene.
ShaderKey scene_key(const std::string& entry, const EncodedField& field, const SceneBindings& bindings, bool counting);
/// The raycaster's entry file.
const char* raycast_entry(const Scene& scene);

}  // namespace amrtex
