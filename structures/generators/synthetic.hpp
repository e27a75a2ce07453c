// Hierarchies over analytic fields whose value and gradient are known exactly.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// An analytic scalar field over world space.
class AnalyticField {
 public:
  virtual ~AnalyticField() = default;
  virtual double value(const Vec3d& p_world) const = 0;
  virtual Vec3d gradient(const Vec3d& p_world) const = 0;  ///< per world length
};

/// Builds the analytic field of a generator specification.
std::unique_ptr<AnalyticField> make_analytic_field(const Json& specification);

/// Builds a mesh from a specification as written in experiment files and given to
/// `amrtex generate` (docs/generate.md lists every key with unit, default and range).
/// The same specification gives the same bytes on every machine and at every thread
/// count. Throws UsageError naming the key and what it accepts.
MeshDescription generate_mesh(const Json& specification);

}  // namespace amrtex
