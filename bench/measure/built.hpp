// A point's structure on a context, and what it took to get there.
#pragma once

#include <memory>

#include "bench/settings/experiment.hpp"
#include "renderers/context/context.hpp"
#include "renderers/gpu/structure.hpp"
#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

struct Built {
  Structure structure;
  double build_seconds = 0;
  double upload_seconds = 0;
};

/// Builds what the scene needs and uploads it. Throws UnsupportedError naming the encoding where the context lacks something,
/// and as Encoding::build and Structure do.
std::unique_ptr<Built> build_structure(const Experiment& experiment, const BuildPoint& build, const AmrHierarchy& mesh,
                                       const Scene& scene, Context& context);

}  // namespace amrtex
