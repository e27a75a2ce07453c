#include "python/held_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "structures/readers/slab.hpp"

namespace amrtex {
namespace {

AmrHierarchy copy_with(const AmrHierarchy& mesh, const std::vector<std::string>& names) {
  MeshDescription copy;
  copy.name = mesh.name();
  copy.domain_lower = mesh.domain_lower();
  copy.domain_upper = mesh.domain_upper();
  copy.root_cells = mesh.cells(0);
  copy.periodic = mesh.periodic();
  copy.dimensions = mesh.dimensions();
  copy.fields = names;
  std::vector<std::size_t> fields;
  for (const std::string& name : names) {
    fields.push_back(static_cast<std::size_t>(mesh.field_index(name)));
    copy.units.push_back(mesh.unit(mesh.field_index(name)));
  }
  copy.levels.resize(static_cast<std::size_t>(mesh.level_count()));
  for (int level = 0; level < mesh.level_count(); ++level) {
    if (level < mesh.finest_level()) copy.ratios.push_back(mesh.ratio_to_finer(level));
    for (const Patch& patch : mesh.patches(level)) {
      Patch chosen{patch.box, {}};
      for (const std::size_t field : fields) chosen.values.push_back(patch.values[field]);
      copy.levels[static_cast<std::size_t>(level)].push_back(std::move(chosen));
    }
  }
  return AmrHierarchy(std::move(copy));
}

/// Refinement ratios say how many levels there are.
void place_patches(ArrayMesh& arrays) {
  MeshDescription& mesh = arrays.frame;
  mesh.levels.resize(mesh.ratios.size() + 1);
  for (std::size_t k = 0; k < arrays.patches.size(); ++k) {
    const std::int64_t level = arrays.levels[k];
    if (level < 0 || level >= std::ssize(mesh.levels))
      throw Error(fmt::format("{}: patch {} is of level {}; accepted: 0 to {}", mesh.name, k, level, mesh.levels.size() - 1));
    mesh.levels[static_cast<std::size_t>(level)].push_back(std::move(arrays.patches[k]));
  }
}

void reach_of_roots(MeshDescription& mesh) {
  if (mesh.root_cells != Vec3i(0)) return;
  for (const Patch& patch : mesh.levels.front()) mesh.root_cells = glm::max(mesh.root_cells, patch.box.upper);
  if (mesh.levels.front().empty())
    throw Error(fmt::format("{}: no patch of level 0; accepted: root_cells, the cells of the domain at level 0", mesh.name));
}

}  // namespace

std::shared_ptr<const AmrHierarchy> HeldMesh::with_fields(const std::vector<std::string>& names) {
  const std::vector<std::string>& there = mesh_->fields();
  for (const std::string& name : names) static_cast<void>(mesh_->field_index(name));
  if (names.size() <= there.size() && std::equal(names.begin(), names.end(), there.begin())) return mesh_;
  const std::lock_guard lock(mutex_);
  if (!copy_ || copied_ != names) {
    copy_ = std::make_shared<const AmrHierarchy>(copy_with(*mesh_, names));
    copied_ = names;
  }
  return copy_;
}

AmrHierarchy make_hierarchy(ArrayMesh arrays) {
  place_patches(arrays);
  MeshDescription& mesh = arrays.frame;
  reach_of_roots(mesh);
  if (mesh.dimensions == 2) make_slab(mesh, mesh.name);
  return AmrHierarchy(std::move(mesh));
}

}  // namespace amrtex
