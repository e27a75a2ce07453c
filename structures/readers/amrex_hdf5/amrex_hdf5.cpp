#include "structures/readers/amrex_hdf5/amrex_hdf5.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/chombo_layout.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// The first lines that codes give to the same layout, as in plotfiles.
constexpr std::array<std::string_view, 3> kVersions{"HyperCLaw-V1.1", "NavierStokes-V1.1", "CartGrid-V2.0"};
constexpr std::string_view kKind = "VanillaHDF5";

void check_version(const Hdf5File& file) {
  const std::string version = file.text("/", "version_name");
  if (std::find(kVersions.begin(), kVersions.end(), version) == kVersions.end())
    file.fail("/", fmt::format("version_name is {}; accepted: {}", quote(version), fmt::join(kVersions, ", ")));
  const std::string kind = file.text("/", "plotfile_type");
  if (kind != kKind) file.fail("/", fmt::format("plotfile_type is {}; accepted: {}", quote(kind), kKind));
  const std::int64_t system = file.integer("/", "coordinate_system");
  if (system != 0)
    file.fail("/", fmt::format("the coordinate system is {} ({}); only 0 (Cartesian) can be read", system,
                               system == 1 ? "cylindrical" : (system == 2 ? "spherical" : "unknown")));
}

/// Values of faces or nodes stand in the same data sets.
void refuse_centring(const ChomboLayout& layout) {
  for (const ChomboLevel& level : layout.levels) {
    std::vector<std::int64_t> types;
    if (layout.file.has_attribute(level.group, "domain_type")) types = layout.file.integers(level.group, "domain_type");
    if (layout.file.has(level.group + "/boxcenter")) {
      std::vector<std::string> names{"i", "j", "k"};
      names.resize(static_cast<std::size_t>(layout.dimensions));
      const auto of_boxes = layout.file.read_records(level.group + "/boxcenter", names);
      types.insert(types.end(), of_boxes.begin(), of_boxes.end());
    }
    if (std::any_of(types.begin(), types.end(), [](std::int64_t type) { return type != 0; }))
      layout.file.fail(level.group, "its values are not cell-centred; only cell-centred data can be read");
  }
}

Vec3d corner(const ChomboLayout& layout, const char* name) {
  const std::string& group = layout.levels.front().group;
  const std::vector<double> values = layout.file.reals(group, name);
  if (std::ssize(values) < layout.dimensions)
    layout.file.fail(group, fmt::format("attribute {} holds {} values; {} are expected", name, values.size(), layout.dimensions));
  Vec3d at(0);
  for (int axis = 0; axis < layout.dimensions; ++axis) at[axis] = values[static_cast<std::size_t>(axis)];
  return at;
}

/// The cells' widths say again what the corners and the cells say; a file where they differ is damaged.
void check_widths(const ChomboLayout& layout, const Vec3d& lower, const Vec3d& upper) {
  constexpr double kRounding = 1e-4;  // relative
  const ChomboLevel& root = layout.levels.front();
  for (int axis = 0; axis < layout.dimensions; ++axis) {
    const double expected = (upper[axis] - lower[axis]) / static_cast<double>(root.domain.size()[axis]);
    if (!(std::abs(root.spacing[axis] - expected) <= kRounding * expected))
      layout.file.fail(root.group,
                       fmt::format("its cells are said to be {} wide along {}, but the domain and its cells make them {}",
                                   root.spacing[axis], "xyz"[axis], expected));
  }
}

}  // namespace

bool is_amrex_hdf5(const fs::path& path) {
  if (!Hdf5File::has_signature(path)) return false;
  const Hdf5File file(path);
  return file.has_attribute("/", "plotfile_type") || (file.has_attribute("/", "version_name") && file.has("level_0"));
}

MeshDescription read_amrex_hdf5(const fs::path& path, const FieldChoice& fields) {
  check_version(Hdf5File(path));
  ChomboLayout layout = scan_chombo_layout(path);
  refuse_centring(layout);
  // ghost cells are counted in `ngrow`, and never written
  for (ChomboLevel& level : layout.levels) level.ghosts = Vec3l(0);
  const Vec3d lower = corner(layout, "prob_lo");
  const Vec3d upper = corner(layout, "prob_hi");
  check_widths(layout, lower, upper);
  const bool one_set = layout.fields.size() == 1 || !layout.file.has("level_0/data:datatype=1");
  return read_chombo_layout(layout, one_set ? ChomboComponents::one_set : ChomboComponents::set_for_each, lower, upper, fields);
}

}  // namespace amrtex
