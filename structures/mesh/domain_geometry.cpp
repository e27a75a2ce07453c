#include "structures/mesh/domain_geometry.hpp"

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

DomainGeometry::DomainGeometry(const AmrHierarchy& mesh)
    : lower(mesh.domain_lower()),
      upper(mesh.domain_upper()),
      cells(mesh.cells(mesh.finest_level())),
      spacing(mesh.spacing(mesh.finest_level())),
      longest_patch(0) {
  for (int level = 0; level < mesh.level_count(); ++level) {
    level_widths.push_back(mesh.cell_width(level));
    for (const Patch& patch : mesh.patches(level)) longest_patch = std::max(longest_patch, glm::length(Vec3d(patch.box.size())));
  }
}

double DomainGeometry::smallest_edge() const { return std::min({spacing.x, spacing.y, spacing.z}); }

}  // namespace amrtex
