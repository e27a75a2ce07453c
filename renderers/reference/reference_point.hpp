// A filter at one point: its value and its gradient. Private to the reference.
#pragma once

#include <memory>
#include <optional>

#include "renderers/reference/filter_reference.hpp"

namespace amrtex {

/// One object serves one thread. The filter must outlive it.
class ReferencePoint {
 public:
  explicit ReferencePoint(const FilterReference& filter) : field_(&filter.field()), points_(filter.points()) {}

  /// f(p); nullopt where there is no value.
  std::optional<double> value(const FinestPosition& p);

  /// Central differences by the filter's reach to either side: one cell width of the level at p (of the leaf that holds p; of the
  /// page with filter `linear_page`; a small part of a finest cell with `nearest`, whose surfaces are faces); p itself stands for
  /// a side without a value. Per world length, along the world's axes; nullopt where p has no value. p in finest space.
  std::optional<Vec3d> gradient(const Vec3d& p);

  /// The derivative of f, in the same units. Of `nearest` and of what has none, gradient().
  std::optional<Vec3d> derivative(const Vec3d& p);

 private:
  std::optional<ReferenceLeaf> leaf_with_value(const FinestPosition& p) const;
  std::optional<double> value_beside(Vec3d p, int axis, double cells);

  const ReferenceField* field_;
  std::unique_ptr<FilterPoints> points_;
};

}  // namespace amrtex
