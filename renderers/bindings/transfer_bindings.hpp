// Transfer functions as shaders evaluate them: from their points, or from a table; and the values that they hide.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

// Curves are those of a scene in stored units (renderers/scene/stored_units.hpp), or over values where only these are asked for.

/// Intervals of values without extinction, first and last value of each.
std::vector<std::array<double, 2>> invisible_ranges(const TransferFunction& transfer_function);

/// Extinction per unit of ray length of an extinction of 1.
double extinction_unit(const DomainGeometry& geometry, const TransferFunction& transfer_function);

/// As u_color_points in shaders/transfer_function.glsl.
std::vector<double> color_points(const TransferFunction& transfer_function);

/// The scene's first transfer function (shaders/transfer_function.glsl). Modes without one declare points of which nothing is
/// read.
void add_transfer_function(const DomainGeometry& geometry, const Scene& scene, SceneBindings& bindings);

/// Those of the fields beside the first (shaders/fields.glsl): nothing of theirs where there are none.
void add_more_transfer_functions(const DomainGeometry& geometry, const Scene& scene, SceneBindings& bindings);

/// Both curves' points as one list, which shaders/preintegrated.glsl and tolerance.glsl need. `unit`: see extinction_unit().
void add_knots(const TransferFunction& transfer_function, double unit, SceneBindings& bindings);

}  // namespace amrtex
