// Places in a mesh as everybody names them: a cell of the finest level and where in it.
#pragma once

#include <optional>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

class AmrHierarchy;

/// A position as everywhere in the contract: a cell of the finest level and a fraction in [0, 1).
struct FinestPosition {
  Vec3i cell;
  Vec3d fraction;
};

/// Point of finest index space -> position; a point on a face belongs to the upper cell,
/// the domain's last face to its last cell. nullopt outside the domain.
std::optional<FinestPosition> position_at(const AmrHierarchy& mesh, const Vec3d& p);

/// World -> finest index space.
Vec3d to_finest_index(const AmrHierarchy& mesh, const Vec3d& p_world);

/// World -> finest position, as position_at().
std::optional<FinestPosition> finest_position(const AmrHierarchy& mesh, const Vec3d& p_world);

}  // namespace amrtex
