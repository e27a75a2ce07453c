// The filters of docs/filters.md in double precision, by search in the AmrHierarchy.
// Shares no code with encodings or shaders: what they are judged against.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "renderers/scene/picture.hpp"
#include "renderers/scene/reference_rule.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/filter.hpp"
#include "structures/mesh/finest_position.hpp"

namespace amrtex {

/// Changes with every change that moves a pixel of a reference: pictures of another version are drawn again.
inline constexpr int kReferenceVersion = 2;

/// A picture that others are judged by, and what is known of it.
struct ReferencePicture {
  Picture picture;
  /// Largest error of a channel at any pixel, as the reference estimates it: of the integrals, for f as doubles hold it. Absent
  /// for a rule of fixed steps, an analytic field, and where surfaces are hit alone or under ambient occlusion
  /// (docs/numerical_method.md).
  std::optional<double> error;
  std::int64_t evaluations = 0;  ///< of f for the integrals
};

/// Safe to use from several threads.
class HierarchyReference {
 public:
  HierarchyReference(const AmrHierarchy& hierarchy, int field, FilterDefinition definition);
  ~HierarchyReference();

  /// f(p); nullopt where there is no value (outside, holes, NaN or infinite leaf).
  std::optional<double> sample(const FinestPosition& p) const;
  std::optional<double> sample(const Vec3d& p_world) const;

  /// Draws the scene: each ray is split wherever the filter is not smooth or f passes a point of the transfer function, and
  /// each part is halved until two rules of quadrature agree on it within its share of the rule's tolerance (or as a fixed step
  /// says); isosurfaces are roots on the pieces and jumps between them. Uses all cores. Independent of the scene's step,
  /// sampling, skip, early_end and tolerance.
  ReferencePicture draw(const Scene& scene, const ReferenceRule& rule = {}) const;
  /// Of draw(), the picture alone.
  Picture render(const Scene& scene, const ReferenceRule& rule = {}) const { return draw(scene, rule).picture; }

  /// The same picture of `truth` instead of the field, where the mesh has values: what the filter and the mesh do to a field is
  /// the difference of both. On each part of a ray `truth` is the cubic through four of its values; parts are as long as a fixed
  /// step says, or short enough that it is within the rule's tolerance of three values between, relative to its largest there.
  /// Modes dvr, projection and mip; throws UsageError for others.
  Picture render(const Scene& scene, const ReferenceRule& rule, const AnalyticField& truth) const;

 private:
  ReferencePicture draw(const Scene& scene, const ReferenceRule& rule, const AnalyticField* truth) const;

  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace amrtex
