#include "structures/mesh/finest_position.hpp"

#include <cmath>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

std::optional<FinestPosition> position_at(const AmrHierarchy& mesh, const Vec3d& p) {
  const Vec3i cells = mesh.cells(mesh.finest_level());
  FinestPosition position{};
  for (int a = 0; a < 3; ++a) {
    if (!(p[a] >= 0 && p[a] <= cells[a])) return std::nullopt;
    position.cell[a] = std::min(static_cast<int>(std::min(p[a], 2147483647.0)), cells[a] - 1);
    position.fraction[a] = std::min(p[a] - position.cell[a], std::nextafter(1.0, 0.0));
  }
  return position;
}

Vec3d to_finest_index(const AmrHierarchy& mesh, const Vec3d& p_world) {
  return (p_world - mesh.domain_lower()) * Vec3d(mesh.cells(mesh.finest_level())) / (mesh.domain_upper() - mesh.domain_lower());
}

std::optional<FinestPosition> finest_position(const AmrHierarchy& mesh, const Vec3d& p_world) {
  // asked in the world: a point at the domain's upper end may be rounded past it in cells
  for (int a = 0; a < 3; ++a)
    if (!(p_world[a] >= mesh.domain_lower()[a] && p_world[a] <= mesh.domain_upper()[a])) return std::nullopt;
  return position_at(mesh, glm::min(to_finest_index(mesh, p_world), Vec3d(mesh.cells(mesh.finest_level()))));
}

}  // namespace amrtex
