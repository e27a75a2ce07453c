// Outputs of Enzo as its own code writes them.
#pragma once

#include <memory>

#include "structures/readers/hdf5_test_tools.hpp"

namespace amrtex::test {

struct EnzoOptions {
  bool ghosts = false;              ///< are ghost cells written?
  std::string baked = "./DD0001/";  ///< in front of the names of data files
  std::size_t grids_per_file = 5;
  hid_t type = H5T_NATIVE_DOUBLE;
  Packing packing = Packing::contiguous;
};

inline std::string enzo_numbers(const Vec3d& v, int rank) {
  std::string text;
  for (int axis = 0; axis < rank; ++axis) text += fmt::format("{:.14g} ", v[axis]);
  return text;
}

inline void write_enzo_values(Hdf5Writer& out, const MeshDescription& mesh, const Patch& patch, std::size_t number,
                              const Vec3i& ghosts, const EnzoOptions& options) {
  const Box stored{patch.box.lower - ghosts, patch.box.upper + ghosts};
  std::vector<hsize_t> shape;
  for (int axis = mesh.dimensions - 1; axis >= 0; --axis) shape.push_back(static_cast<hsize_t>(stored.size()[axis]));
  for (std::size_t f = 0; f < mesh.fields.size(); ++f) {
    std::vector<double> values;
    for_each_cell(stored, [&](const Vec3i& cell) {
      values.push_back(patch.box.contains(cell) ? patch.values[f][patch.box.offset(cell)] : -999.0);
    });
    out.numbers(fmt::format("Grid{:08}/{}", number, mesh.fields[f]), shape, values, options.type, options.packing);
  }
  out.numbers(fmt::format("Grid{:08}/particle_mass", number), {3}, {1, 2, 3});
}

/// Writes `run`, `run.hierarchy` and `run.cpu0000` onwards into a folder. All ratios have to be the same.
inline void write_enzo(const std::filesystem::path& folder, const MeshDescription& mesh, const EnzoOptions& options = {}) {
  const int rank = mesh.dimensions;
  const int refine_by = mesh.ratios.empty() ? 2 : mesh.ratios.front();
  std::string parameters = fmt::format("InitialTime = 0.5\nTopGridRank = {}\nTopGridDimensions   = {}\nRefineBy = {}\n", rank,
                                       enzo_numbers(Vec3d(mesh.root_cells), rank), refine_by);
  parameters += fmt::format("DomainLeftEdge         = {}\nDomainRightEdge        = {}\n", enzo_numbers(mesh.domain_lower, rank),
                            enzo_numbers(mesh.domain_upper, rank));
  for (std::size_t f = 0; f < mesh.fields.size(); ++f) parameters += fmt::format("DataLabel[{}] = {}\n", f, mesh.fields[f]);
  write_bytes(folder / "run", parameters + "Coordinate = 0\nVersionNumber              = 2.600000\n");
  const Vec3i ghosts(3, rank > 1 ? 3 : 0, rank > 2 ? 3 : 0);
  std::string hierarchy = "\n";
  std::size_t number = 1;
  std::unique_ptr<Hdf5Writer> out;
  Vec3d spacing = (mesh.domain_upper - mesh.domain_lower) / Vec3d(mesh.root_cells);
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    const std::size_t first = number;
    for (const Patch& patch : mesh.levels[l]) {
      const std::string name = fmt::format("run.cpu{:04}", (number - 1) / options.grids_per_file);
      if ((number - 1) % options.grids_per_file == 0) out = std::make_unique<Hdf5Writer>(folder / name);
      write_enzo_values(*out, mesh, patch, number, options.ghosts ? ghosts : Vec3i(0), options);
      const Vec3i size = patch.box.size();
      hierarchy += fmt::format("Grid = {}\nTask = 0\nGridRank = {}\nGridDimension     = {}\n", number, rank,
                               enzo_numbers(Vec3d(size + 2 * ghosts), rank));
      hierarchy += fmt::format("GridStartIndex    = {}\nGridEndIndex      = {}\n", enzo_numbers(Vec3d(ghosts), rank),
                               enzo_numbers(Vec3d(size + ghosts - 1), rank));
      hierarchy += fmt::format("GridLeftEdge      = {}\nGridRightEdge     = {}\n",
                               enzo_numbers(mesh.domain_lower + Vec3d(patch.box.lower) * spacing, rank),
                               enzo_numbers(mesh.domain_lower + Vec3d(patch.box.upper) * spacing, rank));
      hierarchy += fmt::format("NumberOfBaryonFields = {}\nBaryonFileName = {}{}\nNumberOfParticles   = 0\n", mesh.fields.size(),
                               options.baked, name);
      const bool last = &patch == &mesh.levels[l].back();
      hierarchy += fmt::format("Pointer: Grid[{}]->NextGridThisLevel = {}\n", number, last ? 0 : number + 1);
      if (last)
        hierarchy +=
            fmt::format("Pointer: Grid[{}]->NextGridNextLevel = {}\n", first, l + 1 == mesh.levels.size() ? 0 : number + 1);
      hierarchy += "\n";
      ++number;
    }
    if (l < mesh.ratios.size()) spacing /= mesh.ratios[l];
  }
  write_bytes(folder / "run.hierarchy", hierarchy);
}

}  // namespace amrtex::test
