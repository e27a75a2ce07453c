// How far samples may lie apart (sampling `planned`, shaders/plan.glsl).
#pragma once

#include <cstdint>
#include <vector>

#include "renderers/bindings/shader_inputs.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// The plan of a scene in stored units, from how the field varies; its define alone where the sampling is another one.
void add_plan(const DomainGeometry& geometry, const EncodedField& field, const Scene& stored, SceneBindings& bindings);

/// What intervals of length h cost a ray in a block: h^2 times this, a unit of its length. Of the midpoint rule for
/// int k c ds with k and c functions of f(s): the second derivative of what is integrated over 24, where a kink of a curve counts as
/// spread over `edge`, and the order of emission and absorption inside of an interval. 0 where one interval is exact.
/// `extinction_unit`: extinction per unit of ray length.
double error_density(const BlockVariation& block, const TransferFunction& transfer_function, double extinction_unit, double edge);

/// Steps of blocks (units of ray length; infinite where one interval is exact), so that between any two they differ by no more
/// than `edge` times the number of faces between them.
void smooth_steps(const Vec3i& blocks, double edge, std::vector<double>& steps);

}  // namespace amrtex
