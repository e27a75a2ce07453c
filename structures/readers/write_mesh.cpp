#include "structures/readers/write_mesh.hpp"

#include <fmt/format.h>

#include <array>
#include <vector>

#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"
#include "structures/mesh/unfinished_folder.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "structures/readers/hdf5_formats.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"

namespace amrtex {
namespace {

struct WrittenFormat {
  const char* name;
  const char* ending;  ///< empty: a folder
  void (*write)(const AmrHierarchy& hierarchy, const std::filesystem::path& path);
};

/// One line a format.
constexpr WrittenFormat kWritten[] = {
    {"amrex", "", write_amrex_plotfile},
    {"exabrick", ".cells", write_exabrick},
    {"npz", ".npz", write_npz_mesh},
    {"vtkhdf", ".vtkhdf", write_vtkhdf_by_module},
};

/// Whoever writes one of these means a file, not a plotfile's folder of that name.
constexpr std::array kOthers = {".h5",      ".hdf5",   ".hdf", ".npy",  ".raw", ".nrrd", ".nhdr",
                                ".scalars", ".bricks", ".exa", ".vthb", ".vti", ".vtk"};

const WrittenFormat& format_of(const std::filesystem::path& path, std::string_view format) {
  std::vector<std::string_view> names;
  const std::string ending = without_slash(path).extension().string();
  for (const WrittenFormat& known : kWritten) {
    names.emplace_back(known.name);
    if (format.empty() ? (!ending.empty() && ending == known.ending) : format == known.name) return known;
  }
  if (!format.empty())
    throw UsageError(fmt::format("no format {}{}; accepted: {}", quote(format), suggestion(format, names), written_formats()));
  for (const std::string_view other : kOthers)
    if (ending == other)
      throw UsageError(
          fmt::format("{}: files {} are not written; accepted endings and formats: {}", path.string(), other, written_formats()));
  return kWritten[0];
}

}  // namespace

void write_mesh(const AmrHierarchy& hierarchy, const std::filesystem::path& path, std::string_view format) {
  format_of(path, format).write(hierarchy, path);
}

void require_writable_format(const std::filesystem::path& path, std::string_view format) {
  if (format_of(path, format).write != write_vtkhdf_by_module) return;
  try {
    hdf5_formats();
  } catch (const Error& e) {
    throw Error(fmt::format("{}: vtkhdf is written over HDF5: {}", path.string(), e.what()));
  }
}

std::string written_formats() {
  std::string names;
  for (const WrittenFormat& format : kWritten)
    names +=
        fmt::format("{}{} ({})", names.empty() ? "" : ", ", format.name, *format.ending == '\0' ? "a folder" : format.ending);
  return names;
}

}  // namespace amrtex
