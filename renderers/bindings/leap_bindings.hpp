// How far rays may leap where a scene shows nothing (shaders/leap.glsl).
#pragma once

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

enum class LeapMap {
  where_something_is_hidden,
  always,  ///< a change of transfer function that hides nothing, or all of a sudden something, then keeps the shader
};

/// The map of distances, from the field's value ranges and what the scene hides; none as `map` tells, where the encoding tells no
/// ranges, or where a ray's own state decides what it may skip (isosurfaces, mip, pre-integration, several fields).
/// `stored`: the scene in stored units.
void add_leaps(const EncodedField& field, const Scene& stored, LeapMap map, SceneBindings& bindings);

}  // namespace amrtex
