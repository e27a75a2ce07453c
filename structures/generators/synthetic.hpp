// Hierarchies over analytic fields whose value and gradient are known exactly.
#pragma once

#include "structures/generators/analytic_fields.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// Builds a mesh from a specification as written in experiment files and given to
/// `amrtex generate` (docs/generate.md lists every key with unit, default and range).
/// The same specification gives the same bytes on every machine and at every thread
/// count. Throws UsageError naming the key and what it accepts.
MeshDescription generate_mesh(const Json& specification);

}  // namespace amrtex
