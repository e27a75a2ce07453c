// The field of an encoding at given points: on the GL context and on the CPU.
#pragma once

#include <span>
#include <vector>

#include "renderers/cpu/cpu_field.hpp"
#include "renderers/gpu/structure.hpp"
#include "structures/mesh/domain_geometry.hpp"
#include "structures/mesh/finest_position.hpp"

namespace amrtex {

/// What a context can be given of a position: a cell, and the fraction in float.
FinestPosition position_on_gl(const FinestPosition& p);

/// The shader's positions: the fraction as float, so that GL and CPU see the same point. `number`
/// of the fields that the structure holds; throw UsageError where there are not so many.
std::vector<ProbeResult> probe_on_gl(Context& context, const DomainGeometry& geometry, const Structure& structure,
                                     std::span<const FinestPosition> points, int number = 0);
std::vector<ProbeResult> probe_on_cpu(const DomainGeometry& geometry, const EncodedField& field, Precision precision,
                                      std::span<const FinestPosition> points, int number = 0);

}  // namespace amrtex
