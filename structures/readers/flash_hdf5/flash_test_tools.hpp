// Files of FLASH as its own code writes them.
#pragma once

#include "structures/readers/hdf5_test_tools.hpp"

namespace amrtex::test {

struct FlashOptions {
  int version = 9;
  bool parameters = true;    ///< are domain and root blocks among the parameters of the run?
  bool padded_sets = false;  ///< do data sets bear the blanks behind their names?
  const char* geometry = "cartesian";
  int dimensionality = 0;  ///< that of the mesh, unless this one
  bool double_plot_files = false;
  hid_t type = H5T_IEEE_F32LE;
  Packing packing = Packing::contiguous;
};

inline void write_flash_parameters(Hdf5Writer& out, const MeshDescription& mesh, const Vec3i& block, int blocks,
                                   const FlashOptions& options) {
  using Integers = std::vector<std::pair<std::string, int>>;
  if (options.version < 8) {
    out.integers("file format version", {1}, {options.version}, H5T_NATIVE_INT);
    out.records("simulation parameters", {"total blocks", "nxb", "nyb", "nzb"}, {blocks, block.x, block.y, block.z});
    out.named<int>("integer runtime parameters", {{"igeomx", std::string_view(options.geometry) == "cartesian" ? 0 : 1}});
  } else {
    out.records("sim info", {"file format version", "something else"}, {options.version, 7});
    Integers scalars{{"nxb", block.x}, {"nyb", block.y}, {"nzb", block.z}, {"globalnumblocks", blocks}};
    scalars.emplace_back("dimensionality", options.dimensionality > 0 ? options.dimensionality : mesh.dimensions);
    out.named<int>("integer scalars", scalars);
    out.named<std::string>("string scalars", {{"geometry", options.geometry}});
    out.named<int>("logical runtime parameters", {{"plotfilegridquantitydp", options.double_plot_files ? 1 : 0}});
    if (options.parameters) {
      const Vec3i root = mesh.root_cells / block;
      out.named<int>("integer runtime parameters", {{"nblockx", root.x}, {"nblocky", root.y}, {"nblockz", root.z}});
    }
  }
  if (!options.parameters) return;
  std::vector<std::pair<std::string, double>> reals;
  for (int axis = 0; axis < 3; ++axis) {
    reals.emplace_back(std::string(1, "xyz"[axis]) + "min", mesh.domain_lower[axis]);
    reals.emplace_back(std::string(1, "xyz"[axis]) + "max", mesh.domain_upper[axis]);
  }
  out.named<double>("real runtime parameters", reals);
}

/// Writes a mesh of blocks of one size. Bounds are float32.
inline void write_flash(const std::filesystem::path& path, const MeshDescription& mesh, const FlashOptions& options = {}) {
  Hdf5Writer out(path);
  const Vec3i block = mesh.levels.front().front().box.size();
  std::vector<std::int64_t> levels;
  std::vector<double> bounds;
  std::vector<std::vector<double>> values(mesh.fields.size());
  Vec3d spacing = (mesh.domain_upper - mesh.domain_lower) / Vec3d(mesh.root_cells);
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    for (const Patch& patch : mesh.levels[l]) {
      levels.push_back(static_cast<std::int64_t>(l) + 1);
      for (int axis = 0; axis < 3; ++axis) {
        bounds.push_back(mesh.domain_lower[axis] + patch.box.lower[axis] * spacing[axis]);
        bounds.push_back(mesh.domain_lower[axis] + patch.box.upper[axis] * spacing[axis]);
      }
      for (std::size_t f = 0; f < mesh.fields.size(); ++f)
        for (const double v : patch.values[f]) values[f].push_back(v);
    }
    spacing /= 2.0;
  }
  const hsize_t blocks = levels.size();
  write_flash_parameters(out, mesh, block, static_cast<int>(blocks), options);
  out.texts("unknown names", mesh.fields, 4);
  out.integers("refine level", {blocks}, levels, H5T_NATIVE_INT);
  out.numbers("bounding box", {blocks, 3, 2}, bounds, H5T_IEEE_F32LE);
  for (std::size_t f = 0; f < mesh.fields.size(); ++f) {
    std::string name = mesh.fields[f];
    if (options.padded_sets) name.resize(4, ' ');
    out.numbers(name, {blocks, static_cast<hsize_t>(block.z), static_cast<hsize_t>(block.y), static_cast<hsize_t>(block.x)},
                values[f], options.type, options.packing);
  }
}

}  // namespace amrtex::test
