#include "structures/readers/mesh_io.hpp"

#include <fmt/format.h>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/amrex_hdf5/amrex_hdf5.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/chombo_hdf5/chombo_hdf5.hpp"
#include "structures/readers/enzo/enzo.hpp"
#include "structures/readers/flash_hdf5/flash_hdf5.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"
#include "structures/readers/raw_volume/raw_volume.hpp"

namespace amrtex {
namespace {

struct Format {
  const char* name;  ///< for messages
  bool (*probe)(const std::filesystem::path& path);
  MeshDescription (*read)(const std::filesystem::path& path, const std::vector<std::string>& fields);
};

/// One line a format; the first whose probe says yes reads.
constexpr Format kFormats[] = {
    {"AMReX plotfile (a folder with a file `Header`)", is_amrex_plotfile, read_amrex_plotfile},
    {"AMReX-HDF5 (attribute `plotfile_type`)", is_amrex_hdf5, read_amrex_hdf5},
    {"Chombo (HDF5, group `Chombo_global`)", is_chombo_hdf5, read_chombo_hdf5},
    {"Enzo (a folder with `NAME` and `NAME.hierarchy`)", is_enzo, read_enzo},
    {"FLASH (HDF5, `sim info`)", is_flash_hdf5, read_flash_hdf5},
    {"volume (NRRD, a `.npy` of three axes, or `name_WxHxD_type.raw`)", is_raw_volume, read_raw_volume},
    {"npz (a `.npz` of levels, boxes and values)", is_npz_mesh, read_npz_mesh},
    {"ExaBrick (`.cells` or `.bricks` with `.scalars`, or the `.exa` that names them)", is_exabrick, read_exabrick},
};

std::string known_formats() {
  std::string names;
  for (const Format& format : kFormats) names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

}  // namespace

MeshDescription read_mesh(const std::filesystem::path& path, const std::vector<std::string>& fields) {
  if (const std::string reason = why_absent(path); !reason.empty()) throw Error(fmt::format("{}: {}", path.string(), reason));
  for (const Format& format : kFormats)
    if (format.probe(path)) return format.read(path, fields);
  throw Error(fmt::format("{}: not in a format that can be read: {}", path.string(), known_formats()));
}

}  // namespace amrtex
