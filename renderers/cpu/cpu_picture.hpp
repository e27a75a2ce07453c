// Pictures from the text of the raycaster, compiled for the CPU.
#pragma once

#include "renderers/cpu/cpu_field.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/domain_geometry.hpp"

namespace amrtex {

/// The raycaster's picture, all cores.
Picture render_on_cpu(const DomainGeometry& geometry, const EncodedField& field, const Scene& scene, bool double_precision);
/// The same with a CPU build of one's own.
Picture trace_on_cpu(CpuField& cpu, const DomainGeometry& geometry, const EncodedField& field, const Scene& scene);

}  // namespace amrtex
