#include "structures/readers/chombo_hdf5/chombo_hdf5.hpp"

#include <fmt/format.h>

#include "structures/readers/chombo_layout.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

double real_or(const Hdf5File& file, const std::string& group, const std::string& name, double otherwise) {
  if (!file.has_attribute(group, name)) return otherwise;
  const std::vector<double> values = file.reals(group, name);
  if (values.size() != 1) file.fail(group, fmt::format("attribute {} holds {} values instead of one", name, values.size()));
  return values.front();
}

/// Checkpoints count the steps to the next change of the grids, and may hold any variables in any centring.
void refuse_checkpoint(const Hdf5File& file) {
  if (file.has_attribute("/", "regrid_interval_0"))
    file.fail("/", "a checkpoint, as the attribute regrid_interval_0 says; only plot files can be read");
}

/// PLUTO writes with Chombo and adds its geometry to each level.
void refuse_curved(const Hdf5File& file) {
  constexpr const char* kGeometries[] = {"unknown", "Cartesian", "cylindrical", "polar", "spherical"};
  const std::string group = "level_0";
  if (file.has_attribute(group, "geometry")) {
    const std::int64_t geometry = file.integer(group, "geometry");
    if (geometry != 1)
      file.fail(group, fmt::format("the geometry is {} ({}); only 1 (Cartesian) can be read", geometry,
                                   kGeometries[geometry > 1 && geometry < 5 ? geometry : 0]));
  }
  if (real_or(file, group, "logr", 0) != 0) file.fail(group, "logr is set: the first axis is logarithmic, which cannot be read");
}

}  // namespace

bool is_chombo_hdf5(const fs::path& path) {
  if (!Hdf5File::has_signature(path)) return false;
  const Hdf5File file(path);
  return file.has("Chombo_global") || (file.has("level_0") && file.has_attribute("/", "num_levels"));
}

MeshDescription read_chombo_hdf5(const fs::path& path, const FieldChoice& fields) {
  refuse_checkpoint(Hdf5File(path));
  const ChomboLayout layout = scan_chombo_layout(path);
  refuse_curved(layout.file);
  const ChomboLevel& root = layout.levels.front();
  // PLUTO's corner of the domain, and what its cells are stretched by along y and z
  const Vec3d origin(real_or(layout.file, root.group, "domBeg1", 0), real_or(layout.file, root.group, "domBeg2", 0),
                     real_or(layout.file, root.group, "domBeg3", 0));
  const Vec3d stretch(1, real_or(layout.file, root.group, "g_x2stretch", 1), real_or(layout.file, root.group, "g_x3stretch", 1));
  const Vec3d spacing = root.spacing * stretch;
  return read_chombo_layout(layout, ChomboComponents::one_set, origin + Vec3d(root.domain.lower) * spacing,
                            origin + Vec3d(root.domain.upper + std::int64_t{1}) * spacing, fields);
}

}  // namespace amrtex
