// Writes plotfiles: FABs of float32 where all fields of the patch are, else of float64, little endian, `Cell_H` version 1, one
// data file a level.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/mesh/unfinished_folder.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

std::string box_text(const Box& box) {
  const Vec3i upper = box.upper - Vec3i(1);
  return fmt::format("(({},{},{}) ({},{},{}) (0,0,0))", box.lower.x, box.lower.y, box.lower.z, upper.x, upper.y, upper.z);
}

std::string header_of_level(const AmrHierarchy& mesh, int level) {
  const auto patches = mesh.patches(level);
  const Vec3d h = mesh.spacing(level);
  std::string s = fmt::format("{} {} 0\n0\n", level, patches.size());
  for (const Patch& patch : patches)
    for (int axis = 0; axis < 3; ++axis)
      s += fmt::format("{} {}\n", mesh.domain_lower()[axis] + patch.box.lower[axis] * h[axis],
                       mesh.domain_lower()[axis] + patch.box.upper[axis] * h[axis]);
  return s + fmt::format("Level_{}/Cell\n", level);
}

std::string header_text(const AmrHierarchy& mesh) {
  std::string s = fmt::format("HyperCLaw-V1.1\n{}\n{}\n3\n0\n{}\n", mesh.fields().size(), fmt::join(mesh.fields(), "\n"),
                              mesh.finest_level());
  const Vec3d lower = mesh.domain_lower();
  const Vec3d upper = mesh.domain_upper();
  s += fmt::format("{} {} {}\n{} {} {}\n", lower.x, lower.y, lower.z, upper.x, upper.y, upper.z);
  for (int level = 0; level < mesh.finest_level(); ++level) s += fmt::format("{} ", mesh.ratio_to_finer(level));
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += box_text(mesh.domain(level)) + " ";
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += "0 ";
  s += "\n";
  for (int level = 0; level < mesh.level_count(); ++level) {
    const Vec3d h = mesh.spacing(level);
    s += fmt::format("{} {} {}\n", h.x, h.y, h.z);
  }
  s += "0\n0\n";
  for (int level = 0; level < mesh.level_count(); ++level) s += header_of_level(mesh, level);
  return s;
}

/// One type for all fields of a patch; means of refined cells are rounded to it.
RealType type_of(const Patch& patch) {
  const bool single = std::all_of(patch.values.begin(), patch.values.end(),
                                  [](const CellValues& values) { return values.type() == RealType::float32; });
  return single ? RealType::float32 : RealType::float64;
}

std::string_view fab_descriptor(RealType type) {
  return type == RealType::float32 ? "((8, (32 8 23 0 1 9 0 127)),(4, (4 3 2 1)))"
                                   : "((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))";
}

/// Range of the values that are numbers, as they are written: AMReX reads its tables by stream extraction, which fails on "nan".
/// Without any number, the range that AMReX takes for empty.
std::pair<double, double> finite_range(const CellValues& values, RealType type) {
  std::pair<double, double> range{std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest()};
  values.visit([&](const auto& view) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double v = type == RealType::float32 ? static_cast<double>(static_cast<float>(view[i])) : view[i];
      if (std::isfinite(v)) range = {std::min(range.first, v), std::max(range.second, v)};
    }
  });
  return range;
}

/// Writes the data file of a level; returns where each patch begins.
std::vector<std::uint64_t> write_level_data(const AmrHierarchy& mesh, int level, const fs::path& path) {
  static_assert(std::endian::native == std::endian::little, "values are written as they stand in memory");
  std::vector<std::uint64_t> offsets;
  OutputFile out(path);
  for (const Patch& patch : mesh.patches(level)) {
    offsets.push_back(out.written());
    const RealType type = type_of(patch);
    out.write(fmt::format("FAB {}{} {}\n", fab_descriptor(type), box_text(patch.box), patch.values.size()));
    for (const CellValues& values : patch.values) out.write_cells(values, type);
  }
  out.close();
  return offsets;
}

void write_cell_header(const AmrHierarchy& mesh, int level, const std::vector<std::uint64_t>& offsets, const fs::path& path) {
  const auto patches = mesh.patches(level);
  OutputFile out(path);
  out.write(fmt::format("1\n1\n{}\n0\n({} 0\n", mesh.fields().size(), patches.size()));
  for (const Patch& patch : patches) out.write(box_text(patch.box) + "\n");
  out.write(fmt::format(")\n{}\n", patches.size()));
  for (std::uint64_t offset : offsets) out.write(fmt::format("FabOnDisk: Cell_D_00000 {}\n", offset));
  std::string minima = fmt::format("\n{},{}\n", patches.size(), patches.empty() ? 0 : mesh.fields().size());
  std::string maxima = minima;
  for (const Patch& patch : patches) {
    for (const CellValues& values : patch.values) {
      const auto [lowest, highest] = finite_range(values, type_of(patch));
      minima += fmt::format("{:.17e},", lowest);
      maxima += fmt::format("{:.17e},", highest);
    }
    minima += "\n";
    maxima += "\n";
  }
  out.write(minima + maxima + "\n");
  out.close();
}

/// Names stand one a line, and readers trim them.
void check_field_names(const AmrHierarchy& mesh, const fs::path& path) {
  for (const std::string& name : mesh.fields())
    if (name.empty() || printable(name) != name || name.front() == ' ' || name.back() == ' ')
      throw Error(
          fmt::format("{}: the field name {} cannot be written; a plotfile has one name a line", path.string(), quote(name)));
}

}  // namespace

void write_amrex_plotfile(const AmrHierarchy& hierarchy, const fs::path& path) {
  const fs::path target = without_slash(path);
  check_field_names(hierarchy, target);
  refuse_existing(target);
  UnfinishedFolder folder(target);
  for (int level = 0; level < hierarchy.level_count(); ++level) {
    const fs::path level_folder = folder.path() / fmt::format("Level_{}", level);
    std::error_code failure;
    if (!fs::create_directory(level_folder, failure))
      throw Error(fmt::format("{}: {}", level_folder.string(), reason_of(failure)));
    const auto offsets = write_level_data(hierarchy, level, level_folder / "Cell_D_00000");
    write_cell_header(hierarchy, level, offsets, level_folder / "Cell_H");
  }
  OutputFile header(folder.path() / "Header");
  header.write(header_text(hierarchy));
  header.close();
  folder.publish();
}

}  // namespace amrtex
