// The formats over HDF5, which lie in a module of their own: the program starts without it, and without the libraries that
// HDF5 brings along. It is opened when a file may need it. Tests have the same code linked in.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

/// A format that is read.
struct MeshFormat {
  const char* name;  ///< for messages
  bool (*probe)(const std::filesystem::path& path);
  MeshDescription (*read)(const std::filesystem::path& path, const FieldChoice& fields);
};

/// What the module offers. Program and module are built together: nothing of this is kept stable.
struct Hdf5Formats {
  std::size_t layout;  ///< hdf5_module_layout() of the module
  std::span<const MeshFormat> read;
  void (*write_vtkhdf)(const AmrHierarchy& hierarchy, const std::filesystem::path& path);
};

/// Differs between a program and a module that do not belong together: sizes of what passes between them.
inline constexpr std::size_t hdf5_module_layout() {
  return sizeof(AmrHierarchy) + 1000 * sizeof(MeshDescription) + 1000000 * sizeof(Hdf5Formats);
}

/// The module's formats, or those that are linked in. Opens the module: AMRTEX_HDF5 where it is set, else libamrtex_hdf5.so
/// beside the program, in ../lib/amrtex from there, or where the loader searches. Throws Error that names it and says why not.
const Hdf5Formats& hdf5_formats();

/// For messages where the module is absent.
inline constexpr const char* kHdf5FormatNames = "AMReX-HDF5, Chombo, Enzo, FLASH, VTKHDF";

/// Does the file begin as HDF5 files do? Any path may be asked.
bool has_hdf5_signature(const std::filesystem::path& path);

/// write_vtkhdf() of the module.
void write_vtkhdf_by_module(const AmrHierarchy& hierarchy, const std::filesystem::path& path);

}  // namespace amrtex

/// What the module exports; null where it is not linked in.
extern "C" [[gnu::weak, gnu::visibility("default")]] const amrtex::Hdf5Formats* amrtex_hdf5_formats();
