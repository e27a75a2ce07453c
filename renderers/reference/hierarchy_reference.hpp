// The filters of shaders/README.md in double precision, by search in the AmrHierarchy.
// Shares no code with encodings or shaders: what they are judged against.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "renderers/scene/picture.hpp"
#include "renderers/scene/scene.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/filter.hpp"
#include "structures/mesh/finest_position.hpp"

namespace amrtex {

/// Safe to use from several threads.
class HierarchyReference {
 public:
  HierarchyReference(const AmrHierarchy& hierarchy, int field, FilterDefinition definition);
  ~HierarchyReference();

  /// f(p); nullopt where there is no value (outside, holes, NaN or infinite leaf).
  std::optional<double> sample(const FinestPosition& p) const;
  std::optional<double> sample(const Vec3d& p_world) const;

  /// Draws the scene: each ray is split wherever the filter is not smooth, pieces are
  /// integrated in parts of at most `step` finest cell widths; isosurfaces are roots on
  /// the pieces and jumps between them. Uses all cores. Independent of the scene's step,
  /// sampling, skip, early_end and tolerance.
  Picture render(const Scene& scene, double step) const;

  /// The same picture of `truth` instead of the field, where the mesh has values: what the filter and the mesh do to a field is
  /// the difference of both. On each part of a ray `truth` is the cubic through four of its values, so the error is of order 4
  /// in `step` where it is smooth. Modes dvr, projection and mip; throws UsageError for others.
  Picture render(const Scene& scene, double step, const AnalyticField& truth) const;

 private:
  Picture draw(const Scene& scene, double step, const AnalyticField* truth) const;

  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace amrtex
