// From what a shader draws to a picture in the units of field and world.
#pragma once

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// Sets the units of line integrals and depths (shaders/march.glsl, isosurface.glsl), and bindings.picture. Throws
/// UnsupportedError where what a pixel shows may be no double.
void add_picture_units(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, SceneBindings& bindings);

/// Channels of the shader's picture that a picture of `channels` is made of.
int drawn_channels(const PictureUnits& units, int channels);

/// The picture of what a shader drew, in double.
Picture in_picture_units(Picture drawn, const PictureUnits& units);

}  // namespace amrtex
