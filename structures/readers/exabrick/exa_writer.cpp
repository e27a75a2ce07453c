// Writes `.cells` and `.scalars`.
#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "structures/mesh/quoted.hpp"
#include "structures/mesh/unfinished_folder.hpp"
#include "structures/readers/exabrick/exa_files.hpp"
#include "structures/readers/exabrick/exabrick.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// The format's level of one of ours. Throws UnsupportedError where a width is no power of two.
int exa_level(const AmrHierarchy& mesh, int level, const fs::path& target) {
  const auto width = static_cast<unsigned>(mesh.cell_width(level));
  if (!std::has_single_bit(width))
    throw UnsupportedError(fmt::format("{}: cells of level {} are {} of the finest wide; .cells holds widths of 2^n",
                                       target.string(), level, width));
  return std::countr_zero(width);
}

/// Calls f(level, patch, offset of the cell in the patch, cell) for each leaf.
template <class F>
void for_each_leaf(const AmrHierarchy& mesh, F&& f) {
  for (int level = 0; level < mesh.level_count(); ++level)
    for (std::size_t k = 0; k < mesh.patches(level).size(); ++k) {
      const Patch& patch = mesh.patches(level)[k];
      const auto mask = mesh.leaf_mask(level, static_cast<int>(k));
      std::size_t i = 0;
      for_each_cell(patch.box, [&](const Vec3i& cell) {
        if (mask[i] != 0) f(level, patch, i, cell);
        ++i;
      });
    }
}

void write_cells(const AmrHierarchy& mesh, const fs::path& file, const fs::path& target) {
  std::vector<int> levels;
  for (int level = 0; level < mesh.level_count(); ++level)
    levels.push_back(mesh.leaf_cells(level) > 0 ? exa_level(mesh, level, target) : 0);
  std::vector<ExaCell> cells;
  cells.reserve(static_cast<std::size_t>(mesh.leaf_cells()));
  for_each_leaf(mesh, [&](int level, const Patch&, std::size_t, const Vec3i& cell) {
    const Vec3i lower = cell * mesh.cell_width(level);
    cells.push_back({lower.x, lower.y, lower.z, levels[static_cast<std::size_t>(level)]});
  });
  OutputFile out(file);
  out.write_values(cells);
  out.close();
}

void write_scalars(const AmrHierarchy& mesh, std::size_t field, const fs::path& file, const fs::path& target) {
  std::vector<float> scalars;
  scalars.reserve(static_cast<std::size_t>(mesh.leaf_cells()));
  for_each_leaf(mesh, [&](int, const Patch& patch, std::size_t i, const Vec3i&) {
    const double value = patch.values[field][i];
    scalars.push_back(static_cast<float>(value));
    if (std::isinf(scalars.back()))
      throw UnsupportedError(fmt::format("{}: {} of the field {} does not fit into 32 bits, which .scalars holds",
                                         target.string(), value, quote(mesh.fields()[field])));
  });
  OutputFile out(file);
  out.write_values(scalars);
  out.close();
}

/// Field names become parts of file names.
void check_field_name(const std::string& name, const fs::path& target) {
  if (name.empty() || name.find('/') != std::string::npos || printable(name) != name)
    throw UnsupportedError(fmt::format("{}: the field name {} cannot be part of a file's name", target.string(), quote(name)));
}

}  // namespace

void write_exabrick(const AmrHierarchy& mesh, const fs::path& path) {
  const fs::path target = without_slash(path);
  const std::string stem = target.stem().string();
  std::vector<std::string> names;
  for (const std::string& field : mesh.fields()) {
    if (mesh.fields().size() > 1) check_field_name(field, target);
    names.push_back(mesh.fields().size() > 1 ? fmt::format("{}.{}.scalars", stem, field) : stem + ".scalars");
  }
  names.push_back(target.filename().string());
  for (std::size_t i = 0; i + 1 < names.size(); ++i)
    if (names[i] == names.back())
      throw UsageError(fmt::format("{}: the scalars need this name; give one that ends in .cells", target.string()));
  for (const std::string& name : names) refuse_existing(target.parent_path() / name);
  UnfinishedFolder folder(target);
  for (std::size_t field = 0; field < mesh.fields().size(); ++field)
    write_scalars(mesh, field, folder.path() / names[field], target);
  write_cells(mesh, folder.path() / names.back(), target);
  folder.publish_files(names);
}

}  // namespace amrtex
