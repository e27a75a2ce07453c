#include "structures/readers/mesh_io.hpp"

#include <fmt/format.h>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "structures/readers/hdf5_formats.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"
#include "structures/readers/raw_volume/raw_volume.hpp"

namespace amrtex {
namespace {

/// One line a format; the first whose probe says yes reads. Those over HDF5 are asked last (hdf5_module.cpp): only then is their
/// module opened. All names fit into one line of 400 characters.
constexpr MeshFormat kFormats[] = {
    {"AMReX plotfile (folder with `Header`)", is_amrex_plotfile, read_amrex_plotfile},
    {"volume (NRRD, `.npy`, `name_WxHxD_type.raw`)", is_raw_volume, read_raw_volume},
    {"npz (levels, boxes, values)", is_npz_mesh, read_npz_mesh},
    {"ExaBrick (`.cells` or `.bricks` with `.scalars`, `.exa`)", is_exabrick, read_exabrick},
};

std::string names_of(std::span<const MeshFormat> formats) {
  std::string names;
  for (const MeshFormat& format : formats) names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

std::span<const MeshFormat> formats_over_hdf5(const std::filesystem::path& path) {
  try {
    return hdf5_formats().read;
  } catch (const Error& e) {
    if (has_hdf5_signature(path)) throw Error(fmt::format("{}: an HDF5 file ({}): {}", path.string(), kHdf5FormatNames, e.what()));
    throw Error(fmt::format("{}: in no format that can be read without HDF5 ({} need it): {}", path.string(), kHdf5FormatNames, e.what()));
  }
}

}  // namespace

MeshDescription read_mesh(const std::filesystem::path& path, const FieldChoice& fields) {
  if (const std::string reason = why_absent(path); !reason.empty()) throw Error(fmt::format("{}: {}", path.string(), reason));
  for (const MeshFormat& format : kFormats)
    if (format.probe(path)) return format.read(path, fields);
  const std::span<const MeshFormat> over_hdf5 = formats_over_hdf5(path);
  for (const MeshFormat& format : over_hdf5)
    if (format.probe(path)) return format.read(path, fields);
  throw Error(fmt::format("{}: not in a format that can be read: {}, {}", path.string(), names_of(kFormats), names_of(over_hdf5)));
}

}  // namespace amrtex
