// The field of an encoding at given points: on the GL context and on the CPU.
#pragma once

#include <span>
#include <vector>

#include "renderers/cpu/cpu_field.hpp"
#include "renderers/gpu/gpu_field.hpp"
#include "renderers/reference/hierarchy_reference.hpp"

namespace amrtex {

/// Of the shader that samples field number `number` at points.
ShaderKey probe_key(const EncodedField& field, int number);

/// The shader's positions: the fraction as float, so that GL and CPU see the same point. `number`
/// of the fields that the structure holds; throw UsageError where there are not so many.
std::vector<ProbeResult> probe_on_gl(Context& context, const AmrHierarchy& hierarchy, const EncodedField& field,
                                     const GpuField& gpu, std::span<const FinestPosition> points, int number = 0);
std::vector<ProbeResult> probe_on_cpu(const AmrHierarchy& hierarchy, const EncodedField& field, Precision precision,
                                      std::span<const FinestPosition> points, int number = 0);

}  // namespace amrtex
