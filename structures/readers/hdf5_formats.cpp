#include "structures/readers/hdf5_formats.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>
#include <fstream>

#include "structures/mesh/shared_library.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr const char* kModule = "libamrtex_hdf5.so";

/// Folders of the program, and of the library that this code is part of where that is another file.
std::vector<fs::path> own_folders() {
  std::vector<fs::path> folders;
  std::error_code failure;
  const fs::path program = fs::read_symlink("/proc/self/exe", failure);
  if (!failure) folders.push_back(program.parent_path());
  Dl_info here{};
  if (::dladdr(reinterpret_cast<const void*>(&hdf5_formats), &here) != 0 && here.dli_fname != nullptr) {
    const fs::path file = fs::canonical(here.dli_fname, failure);
    if (!failure && (folders.empty() || file.parent_path() != folders.front())) folders.push_back(file.parent_path());
  }
  return folders;
}

std::vector<std::string> module_names() {
  std::vector<std::string> names;
  std::error_code failure;
  for (const fs::path& folder : own_folders())
    for (const fs::path& place : {folder / kModule, folder.parent_path() / "lib" / "amrtex" / kModule})
      if (fs::exists(place, failure)) names.push_back(place.string());
  // the loader's own message about a path that is not there would say less than its message about the name
  if (names.empty()) names.emplace_back(kModule);
  return library_names("AMRTEX_HDF5", names);
}

const Hdf5Formats& open_module() {
  try {
    const SharedLibrary module(module_names());
    const Hdf5Formats* formats = module.require<const Hdf5Formats*()>("amrtex_hdf5_formats")();
    if (formats->layout != hdf5_module_layout()) throw Error(fmt::format("{} belongs to another build of amrtex", module.name()));
    return *formats;
  } catch (const Error& e) {
    throw Error(fmt::format("the module for HDF5 cannot be opened: {}; needed: {} beside the program or in ../lib/amrtex, with libhdf5",
                            e.what(), kModule));
  }
}

}  // namespace

const Hdf5Formats& hdf5_formats() {
  if (amrtex_hdf5_formats != nullptr) return *amrtex_hdf5_formats();
  return open_module();
}

bool has_hdf5_signature(const fs::path& path) {
  constexpr std::string_view kSignature("\x89HDF\r\n\x1a\n", 8);
  std::error_code failure;
  if (!fs::is_regular_file(path, failure) || failure) return false;
  const std::uint64_t size = fs::file_size(path, failure);
  std::ifstream in(path, std::ios::binary);
  // behind a user block of 512 bytes or more, which doubles
  for (std::uint64_t at = 0; !failure && in && at + kSignature.size() <= size; at = at == 0 ? 512 : 2 * at) {
    std::array<char, 8> found{};
    in.seekg(static_cast<std::streamoff>(at));
    in.read(found.data(), found.size());
    if (in && std::string_view(found.data(), found.size()) == kSignature) return true;
  }
  return false;
}

void write_vtkhdf_by_module(const AmrHierarchy& hierarchy, const fs::path& path) { hdf5_formats().write_vtkhdf(hierarchy, path); }

}  // namespace amrtex
