#include "renderers/reference/reference_point.hpp"

#include <cmath>

namespace amrtex {

std::optional<ReferenceLeaf> ReferencePoint::leaf_with_value(const FinestPosition& p) const {
  const AmrHierarchy& h = field_->hierarchy();
  if (!h.domain(h.finest_level()).contains(p.cell)) return std::nullopt;
  const ReferenceLeaf leaf = field_->find_leaf(p.cell);
  if (leaf.level < 0 || std::isnan(leaf.value)) return std::nullopt;
  return leaf;
}

std::optional<double> ReferencePoint::value(const FinestPosition& p) {
  const auto leaf = leaf_with_value(p);
  return leaf ? std::optional(points_->value(*leaf, p)) : std::nullopt;
}

/// Value `cells` finest cells along an axis from p.
std::optional<double> ReferencePoint::value_beside(Vec3d p, int axis, double cells) {
  p[axis] += cells;
  const auto position = position_at(field_->hierarchy(), p);
  return position ? value(*position) : std::nullopt;
}

std::optional<Vec3d> ReferencePoint::gradient(const Vec3d& p) {
  const auto position = position_at(field_->hierarchy(), p);
  const auto leaf = position ? leaf_with_value(*position) : std::nullopt;
  if (!leaf) return std::nullopt;
  const double here = points_->value(*leaf, *position);
  const FilterPoints::Reach reach = points_->reach(*leaf, *position);
  Vec3d gradient(0);
  for (int a = 0; a < 3; ++a) {
    const auto below = value_beside(p, a, -reach.cells);
    const auto above = value_beside(p, a, reach.cells);
    const int sides = (below ? 1 : 0) + (above ? 1 : 0);
    if (sides > 0) gradient[a] = (above.value_or(here) - below.value_or(here)) / (sides * reach.world[a]);
  }
  return gradient;
}

std::optional<Vec3d> ReferencePoint::derivative(const Vec3d& p) {
  const AmrHierarchy& h = field_->hierarchy();
  const auto position = position_at(h, p);
  const auto leaf = position ? leaf_with_value(*position) : std::nullopt;
  if (!leaf) return std::nullopt;
  const auto per_cell = points_->derivative(*leaf, *position);
  return per_cell ? std::optional(*per_cell / h.spacing(h.finest_level())) : gradient(p);
}

}  // namespace amrtex
