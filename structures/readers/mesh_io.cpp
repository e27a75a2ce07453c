#include "structures/readers/mesh_io.hpp"

#include <fmt/format.h>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/amrex_hdf5/amrex_hdf5.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/chombo_hdf5/chombo_hdf5.hpp"
#include "structures/readers/enzo/enzo.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "structures/readers/flash_hdf5/flash_hdf5.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"
#include "structures/readers/raw_volume/raw_volume.hpp"
#include "structures/readers/vtkhdf/vtkhdf_reader.hpp"

namespace amrtex {
namespace {

struct Format {
  const char* name;  ///< for messages, with what it looks like; all of them fit into one line of 400 characters
  bool (*probe)(const std::filesystem::path& path);
  MeshDescription (*read)(const std::filesystem::path& path, const FieldChoice& fields);
};

/// One line a format; the first whose probe says yes reads.
constexpr Format kFormats[] = {
    {"AMReX plotfile (folder with `Header`)", is_amrex_plotfile, read_amrex_plotfile},
    {"AMReX-HDF5 (`plotfile_type`)", is_amrex_hdf5, read_amrex_hdf5},
    {"Chombo (`Chombo_global`)", is_chombo_hdf5, read_chombo_hdf5},
    {"Enzo (`NAME.hierarchy`)", is_enzo, read_enzo},
    {"FLASH (`sim info`)", is_flash_hdf5, read_flash_hdf5},
    {"VTKHDF (group `VTKHDF`)", is_vtkhdf, read_vtkhdf},
    {"volume (NRRD, `.npy`, `name_WxHxD_type.raw`)", is_raw_volume, read_raw_volume},
    {"npz (levels, boxes, values)", is_npz_mesh, read_npz_mesh},
    {"ExaBrick (`.cells` or `.bricks` with `.scalars`, `.exa`)", is_exabrick, read_exabrick},
};

std::string known_formats() {
  std::string names;
  for (const Format& format : kFormats) names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

}  // namespace

MeshDescription read_mesh(const std::filesystem::path& path, const FieldChoice& fields) {
  if (const std::string reason = why_absent(path); !reason.empty()) throw Error(fmt::format("{}: {}", path.string(), reason));
  for (const Format& format : kFormats)
    if (format.probe(path)) return format.read(path, fields);
  throw Error(fmt::format("{}: not in a format that can be read: {}", path.string(), known_formats()));
}

}  // namespace amrtex
