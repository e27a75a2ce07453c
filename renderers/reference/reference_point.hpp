// A filter at one point: its value and its gradient. Private to the reference.
#pragma once

#include <optional>

#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/reference/reference_field.hpp"

namespace amrtex {

/// Point of finest index space -> position; a point on a face belongs to the upper cell,
/// the domain's last face to its last cell. nullopt outside the domain.
std::optional<FinestPosition> position_at(const AmrHierarchy& hierarchy, const Vec3d& p);

/// f(p); nullopt where there is no value. `vertices` may be null.
std::optional<double> value_at(const ReferenceField& field, const FinestPosition& p, VertexCache* vertices);

/// Central differences one cell width of the level at p to either side (of the leaf that holds p; of the
/// page with filter `linear_page`; a small part of a finest cell with `nearest`, whose surfaces are faces); p itself stands for a
/// side without a value. Per world length, along the world's axes; nullopt where p has no value. p in finest space.
std::optional<Vec3d> gradient_at(const ReferenceField& field, const Vec3d& p, VertexCache* vertices);

/// The derivative of f, in the same units. Of `nearest` and of what has none, gradient_at().
std::optional<Vec3d> derivative_at(const ReferenceField& field, const Vec3d& p, VertexCache* vertices);

}  // namespace amrtex
