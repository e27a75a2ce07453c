// Fields whose value and gradient are known exactly, and the part of a generator specification that they share with meshes.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <string>

#include "structures/generators/spec_reader.hpp"
#include "structures/mesh/json.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// The domain in world space, or a part of it.
struct WorldBox {
  Vec3d lower{0};
  Vec3d upper{1};

  Vec3d extent() const { return upper - lower; }
  Vec3d middle() const { return at(Vec3d(0.5)); }
  /// Point at fractions of the edges; (0,0,0) is the lower corner.
  Vec3d at(const Vec3d& fraction) const { return lower + extent() * fraction; }
  /// The shortest edge, world: what default lengths are relative to.
  double edge() const { return std::min({extent().x, extent().y, extent().z}); }
};

/// An analytic scalar field over world space.
class AnalyticField {
 public:
  virtual ~AnalyticField() = default;
  virtual double value(const Vec3d& p_world) const = 0;
  virtual Vec3d gradient(const Vec3d& p_world) const = 0;  ///< per world length
  /// At least the gradient's length everywhere in a box (world), per world length; infinite where nobody knows.
  virtual double steepest_in(const WorldBox& /*box*/) const { return std::numeric_limits<double>::infinity(); }
};

/// Builds the analytic field of a generator specification.
std::unique_ptr<AnalyticField> make_analytic_field(const Json& specification);

/// Reads the key `domain`.
WorldBox read_domain(SpecReader& specification);

/// Type of the field of a specification: "blobs_shell" when it names none.
std::string analytic_field_type(const Json& specification);

}  // namespace amrtex
