#include "structures/readers/exabrick/exabrick.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>

#include "structures/readers/exabrick/exa_files.hpp"
#include "structures/readers/exabrick/exa_mesh.hpp"
#include "structures/readers/exabrick/exa_values.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

std::vector<ExaField> fields_to_read(const fs::path& path, const std::vector<ExaField>& all, const FieldChoice& names) {
  std::vector<std::string> there;
  for (const ExaField& field : all) there.push_back(field.name);
  std::vector<ExaField> wanted;
  for (const std::size_t i : names.among(path, there)) wanted.push_back(all[i]);
  return wanted;
}

/// All arrays of scalars go with the same cells.
std::uint64_t common_count(const std::vector<ExaField>& fields) {
  const std::uint64_t count = count_exa_scalars(fields.front().scalars);
  for (const ExaField& field : fields)
    if (const std::uint64_t other = count_exa_scalars(field.scalars); other != count)
      throw Error(
          fmt::format("{}: {} values, but {} has {}", field.scalars.string(), other, fields.front().scalars.string(), count));
  return count;
}

void set_domain(const ExaGrid& grid, const std::optional<ExaRemap>& remap, MeshDescription& mesh) {
  const auto world = [&](const std::array<std::int64_t, 3>& corner) {
    const Vec3d p(corner[0], corner[1], corner[2]);
    if (!remap) return p;
    return remap->to_lower +
           (p - remap->from_lower) * (remap->to_upper - remap->to_lower) / (remap->from_upper - remap->from_lower);
  };
  mesh.domain_lower = world(grid.lower);
  mesh.domain_upper = world(grid.upper);
  mesh.root_cells = grid.root_cells();
  for (std::size_t l = 0; l + 1 < grid.levels.size(); ++l) mesh.ratios.push_back(grid.ratio_to_finer(l));
}

/// Patches without values.
std::vector<std::vector<Patch>> empty_patches(const fs::path& path, const std::vector<std::vector<Box>>& boxes,
                                              std::size_t fields) {
  CheckedSize cells;
  for (const auto& level : boxes)
    for (const Box& box : level) cells += box.cells();
  require_memory(path, cells, fields, sizeof(float));
  std::vector<std::vector<Patch>> levels;
  for (const auto& level : boxes) {
    std::vector<Patch>& patches = levels.emplace_back(level.size());
    for (std::size_t k = 0; k < level.size(); ++k) patches[k].box = level[k];
  }
  return levels;
}

}  // namespace

bool is_exabrick(const fs::path& path) {
  std::error_code ignored;
  const auto known = [](const fs::path& file) {
    const std::string ending = file.extension().string();
    return ending == ".cells" || ending == ".bricks" || ending == ".exa";
  };
  if (fs::is_directory(path, ignored))
    return std::any_of(fs::directory_iterator(path, ignored), fs::directory_iterator(),
                       [&](const fs::directory_entry& entry) { return known(entry.path()); });
  if (!fs::is_regular_file(path, ignored)) return false;
  if (known(path) || path.extension() == ".scalars") return true;
  // under any other name: as many cells as the scalars beside it have values
  const fs::path scalars = fs::path(path).replace_extension(".scalars");
  if (!fs::is_regular_file(scalars, ignored)) return false;
  const auto bytes = fs::file_size(path, ignored);
  return bytes > 0 && bytes % sizeof(ExaCell) == 0 && fs::file_size(scalars, ignored) == bytes / sizeof(ExaCell) * sizeof(float);
}

MeshDescription read_exabrick(const fs::path& path, const FieldChoice& fields) {
  const ExaFiles files = find_exa_files(path);
  const std::vector<ExaField> wanted = fields_to_read(path, files.fields, fields);
  const ExaCellFile cells(files, common_count(wanted));
  const ExaGrid grid = find_grid(cells);
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  set_domain(grid, files.remap, mesh);
  for (const ExaField& field : wanted) mesh.fields.push_back(field.name);
  for (const ExaField& field : files.fields) mesh.fields_there.push_back(field.name);
  try {
    mesh.levels = empty_patches(path, patch_boxes(cells, grid), wanted.size());
    read_exa_values(cells, grid, wanted, mesh.levels);
  } catch (const std::bad_alloc&) {
    throw Error(fmt::format("{}: not enough memory for the values of {} fields", path.string(), wanted.size()));
  }
  return mesh;
}

}  // namespace amrtex
