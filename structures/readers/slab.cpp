#include "structures/readers/slab.hpp"

#include <algorithm>

#include "structures/readers/memory_check.hpp"

namespace amrtex {

std::int64_t slab_cells(const MeshDescription& mesh, std::size_t level) {
  CheckedSize cells = 1;
  for (std::size_t l = 0; l < level; ++l) cells *= mesh.ratios[l];
  return std::min<std::int64_t>(cells.or_most(), std::numeric_limits<std::int32_t>::max());
}

namespace {

RealType type_of(const MeshDescription& mesh, std::size_t field) {
  for (const auto& level : mesh.levels)
    for (const Patch& patch : level)
      if (patch.values[field].type() == RealType::float64) return RealType::float64;
  return RealType::float32;
}

}  // namespace

void make_slab(MeshDescription& mesh, const std::filesystem::path& path) {
  CheckedSize cells;
  for (std::size_t level = 0; level < mesh.levels.size(); ++level)
    for (const Patch& patch : mesh.levels[level]) cells += CheckedSize(patch.box.cells()) * slab_cells(mesh, level);
  for (std::size_t field = 0; field < mesh.fields.size(); ++field) require_memory(path, cells, 1, bytes_of(type_of(mesh, field)));
  const Vec3d edge = (mesh.domain_upper - mesh.domain_lower) / Vec3d(mesh.root_cells) /
                     static_cast<double>(slab_cells(mesh, mesh.levels.size() - 1));
  mesh.dimensions = 2;
  mesh.root_cells.z = 1;
  mesh.domain_lower.z = 0;
  mesh.domain_upper.z = std::min(edge.x, edge.y);
  for (std::size_t level = 0; level < mesh.levels.size(); ++level)
    for (Patch& patch : mesh.levels[level]) {
      const auto depth = static_cast<std::size_t>(slab_cells(mesh, level));
      patch.box.lower.z = 0;
      patch.box.upper.z = static_cast<int>(depth);
      for (CellValues& values : patch.values)
        values.visit_stored([&](auto& stored) {
          const std::size_t plane = stored.size();
          stored.resize(plane * depth);
          for (std::size_t z = 1; z < depth; ++z) std::copy_n(stored.data(), plane, stored.data() + z * plane);
        });
    }
}

}  // namespace amrtex
