// Chombo files as its own code writes them, and in the variants that other codes made of them.
#pragma once

#include <limits>

#include "structures/readers/hdf5_test_tools.hpp"

namespace amrtex::test {

struct ChomboOptions {
  int ghosts = 0;
  bool offsets = true;
  bool arrays = false;  ///< dx, ref_ratio and single numbers as arrays
  hid_t type = H5T_NATIVE_DOUBLE;
  Packing packing = Packing::contiguous;
  bool amrex = false;         ///< what AMReX writes of it
  bool set_for_each = false;  ///< AMReX: one data set for each component
};

inline std::vector<std::string> box_members(int dimensions) {
  if (dimensions == 2) return {"lo_i", "lo_j", "hi_i", "hi_j"};
  return {"lo_i", "lo_j", "lo_k", "hi_i", "hi_j", "hi_k"};
}
/// Inclusive corners, moved by `corner`.
inline std::vector<int> box_values(const Box& box, const Vec3i& corner, int dimensions) {
  std::vector<int> values;
  for (int axis = 0; axis < dimensions; ++axis) values.push_back(box.lower[axis] + corner[axis]);
  for (int axis = 0; axis < dimensions; ++axis) values.push_back(box.upper[axis] + corner[axis] - 1);
  return values;
}

/// A field of a patch with ghost cells around it, which hold what no cell does.
inline void append_with_ghosts(const Patch& patch, std::size_t field, const Vec3i& ghosts, std::vector<double>& out) {
  const Box stored{patch.box.lower - ghosts, patch.box.upper + ghosts};
  for_each_cell(stored, [&](const Vec3i& cell) {
    out.push_back(patch.box.contains(cell) ? patch.values[field][patch.box.offset(cell)] : -999.0);
  });
}

inline void write_chombo_level(Hdf5Writer& out, const MeshDescription& mesh, std::size_t l, const Box& domain,
                               const Vec3i& corner, const ChomboOptions& options) {
  const std::string group = fmt::format("level_{}", l);
  const int dimensions = mesh.dimensions;
  const bool last = l + 1 == mesh.levels.size();
  const double dx = (mesh.domain_upper.x - mesh.domain_lower.x) / domain.size().x;
  const int ratio = last ? (options.amrex ? 1 : 2) : mesh.ratios[l];
  const Vec3i ghosts = dimensions == 2 ? Vec3i(options.ghosts, options.ghosts, 0) : Vec3i(options.ghosts);
  out.group(group);
  if (options.arrays) {
    out.attribute(group, "dx", std::vector<double>(static_cast<std::size_t>(dimensions), dx));
    out.attribute(group, "ref_ratio", std::vector<int>(static_cast<std::size_t>(dimensions), ratio));
  } else {
    out.attribute(group, "dx", dx);
    out.attribute(group, "ref_ratio", ratio);
  }
  out.record_attribute(group, "prob_domain", box_members(dimensions), box_values(domain, corner, dimensions));
  if (options.amrex) {
    const Vec3d lower = mesh.domain_lower;
    const Vec3d upper = mesh.domain_upper;
    out.attribute(group, "prob_lo", std::vector<double>{lower.x, lower.y, lower.z});
    out.attribute(group, "prob_hi", std::vector<double>{upper.x, upper.y, upper.z});
    out.attribute(group, "domain_type", std::vector<int>{0, 0, 0});
    out.attribute(group, "ngrow", std::vector<int>{1});
  } else if (options.ghosts > 0) {
    out.group(group + "/data_attributes");
    const std::vector<std::string> members{"intvecti", "intvectj", "intvectk"};
    const std::vector<int> widths(static_cast<std::size_t>(dimensions), options.ghosts);
    out.record_attribute(group + "/data_attributes", "outputGhost", {members.begin(), members.begin() + dimensions}, widths);
    out.attribute(group + "/data_attributes", "comps", static_cast<int>(mesh.fields.size()));
  }
  std::vector<int> boxes;
  std::vector<std::int64_t> offsets{0};
  std::vector<std::vector<double>> sets(options.set_for_each ? mesh.fields.size() : 1);
  for (const Patch& patch : mesh.levels[l]) {
    const auto values = box_values(patch.box, corner, dimensions);
    boxes.insert(boxes.end(), values.begin(), values.end());
    for (std::size_t f = 0; f < mesh.fields.size(); ++f) append_with_ghosts(patch, f, ghosts, sets[options.set_for_each ? f : 0]);
    offsets.push_back(static_cast<std::int64_t>(sets.front().size()));
  }
  out.records(group + "/boxes", box_members(dimensions), boxes);
  if (options.offsets) out.integers(group + "/data:offsets=0", {offsets.size()}, offsets);
  for (std::size_t i = 0; i < sets.size(); ++i)
    out.numbers(fmt::format("{}/data:datatype={}", group, i), {sets[i].size()}, sets[i], options.type, options.packing);
}

/// Writes a mesh whose cells are as wide along all axes and whose corner is a whole number of root cells.
inline void write_chombo(const std::filesystem::path& path, const MeshDescription& mesh, const ChomboOptions& options = {}) {
  Hdf5Writer out(path);
  const auto number = [&](const std::string& object, const char* name, int value) {
    if (options.arrays || options.amrex)
      out.attribute(object, name, std::vector<int>{value});
    else
      out.attribute(object, name, value);
  };
  number("/", "num_components", static_cast<int>(mesh.fields.size()));
  number("/", "num_levels", static_cast<int>(mesh.levels.size()));
  for (std::size_t f = 0; f < mesh.fields.size(); ++f) out.attribute("/", fmt::format("component_{}", f), mesh.fields[f].c_str());
  out.group("Chombo_global");
  number("Chombo_global", "SpaceDim", mesh.dimensions);
  if (options.amrex) {
    out.attribute("/", "version_name", "HyperCLaw-V1.1");
    out.attribute("/", "plotfile_type", "VanillaHDF5");
    number("/", "coordinate_system", 0);
  }
  Vec3i cells = mesh.root_cells;
  const double dx = (mesh.domain_upper.x - mesh.domain_lower.x) / cells.x;
  Vec3i corner(glm::round(mesh.domain_lower / dx));
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    write_chombo_level(out, mesh, l, {Vec3i(0), cells}, corner, options);
    if (l == mesh.ratios.size()) break;
    cells *= mesh.ratios[l];
    corner *= mesh.ratios[l];
  }
}

}  // namespace amrtex::test
