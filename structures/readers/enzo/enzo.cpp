#include "structures/readers/enzo/enzo.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/enzo/enzo_text.hpp"
#include "structures/readers/hdf5_file.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/slab.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHierarchy = ".hierarchy";

/// What a file begins with, as far as a probe looks; empty where it cannot be read.
std::string head_of(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return {};
  std::string head(std::size_t{1} << 16, '\0');
  std::ifstream in(path, std::ios::binary);
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount())));
  return head;
}

bool says_grids(const fs::path& path) {
  const std::string head = head_of(path);
  return head.find("GridRank") != std::string::npos && head.find("GridStartIndex") != std::string::npos;
}
bool says_parameters(const fs::path& path) { return head_of(path).find("TopGridRank") != std::string::npos; }

bool holds_grids(const fs::path& path) {
  if (!Hdf5File::has_signature(path)) return false;
  const std::vector<std::string> groups = Hdf5File(path).members("/");
  return std::any_of(groups.begin(), groups.end(), [](const std::string& name) {
    return name.size() == 12 && name.starts_with("Grid") && name.find_first_not_of("0123456789", 4) == std::string::npos;
  });
}

/// Hierarchies in a folder, in alphabetical order.
std::vector<fs::path> hierarchies_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end; entry.increment(failure))
    if (entry->path().filename().string().ends_with(kHierarchy) && says_grids(entry->path())) found.push_back(entry->path());
  std::sort(found.begin(), found.end());
  return found;
}

struct EnzoFiles {
  fs::path parameters;
  fs::path hierarchy;
};

fs::path without_hierarchy(const fs::path& path) {
  const std::string name = path.string();
  return name.ends_with(kHierarchy) ? fs::path(name.substr(0, name.size() - kHierarchy.size())) : path;
}

EnzoFiles find_files(const fs::path& path) {
  const auto fail = [&](const std::string& what) { throw Error(fmt::format("{}: {}", path.string(), what)); };
  fs::path parameters = without_hierarchy(path);
  if (fs::is_directory(path)) {
    const std::vector<fs::path> found = hierarchies_in(path);
    std::vector<std::string> names;
    for (const fs::path& hierarchy : found) names.push_back(without_hierarchy(hierarchy).filename().string());
    if (found.size() != 1) fail(fmt::format("{} outputs of Enzo: {}; name one of these files", found.size(), listed(names)));
    parameters = without_hierarchy(found.front());
  } else if (Hdf5File::has_signature(path)) {
    fail("values of an output of Enzo; name its parameter file or its folder, so that the grids are known");
  } else if (!path.string().ends_with(kHierarchy) && says_grids(path)) {
    fail("a hierarchy of Enzo, whose name should end in .hierarchy behind that of the parameter file");
  }
  fs::path hierarchy = parameters;
  hierarchy += kHierarchy;
  return {parameters, hierarchy};
}

/// A grid in the cells of its level. Edges are written with 12 digits or more.
Box box_of(const fs::path& path, const EnzoParameters& parameters, const EnzoGrid& grid) {
  constexpr double kOff = 0.1;  // cells
  Box box{Vec3i(0), Vec3i(1)};
  const double scale = std::pow(static_cast<double>(parameters.refine_by), grid.level);
  for (int axis = 0; axis < parameters.rank; ++axis) {
    const double cells = parameters.root_cells[axis] * scale;
    const double width = (parameters.upper[axis] - parameters.lower[axis]) / cells;
    const double first = (grid.lower[axis] - parameters.lower[axis]) / width;
    const double behind = (grid.upper[axis] - parameters.lower[axis]) / width;
    const bool inside = first > -kOff && behind < cells + kOff && cells < std::numeric_limits<int>::max();
    if (!inside || std::abs(first - std::round(first)) > kOff || std::abs(behind - first - grid.cells[axis]) > kOff)
      throw Error(fmt::format(
          "{}: grid {} of level {}: its edges {} and {} along {} are not those of {} cells {} wide in the domain", path.string(),
          grid.number, grid.level, grid.lower[axis], grid.upper[axis], "xyz"[axis], grid.cells[axis], width));
    box.lower[axis] = static_cast<int>(std::lround(first));
    box.upper[axis] = box.lower[axis] + grid.cells[axis];
  }
  return box;
}

std::string group_of(const EnzoGrid& grid) { return fmt::format("Grid{:08}", grid.number); }

/// Names of the fields that the first grid holds: those with a label in the code's order, then what else it wrote.
std::vector<std::string> fields_of(const Hdf5File& file, const EnzoParameters& parameters, const EnzoGrid& grid) {
  std::vector<std::string> there;
  for (const std::string& name : file.members(group_of(grid)))
    if (file.rank_of_reals(fmt::format("{}/{}", group_of(grid), name)) == static_cast<std::size_t>(parameters.rank))
      there.push_back(name);
  if (there.empty()) file.fail(group_of(grid), "it holds no field");
  auto next = there.begin();
  for (const auto& [number, label] : parameters.labels)
    if (const auto found = std::find(next, there.end(), label); found != there.end()) {
      std::rotate(next, found, found + 1);
      ++next;
    }
  return there;
}

/// A field of a grid, stored with or without its ghost cells.
struct Source {
  Hdf5Numbers values;
  Box stored;
  Box valid;
};

Source open_field(const Hdf5File& file, const EnzoGrid& grid, int rank, const Box& box, const std::string& field) {
  const std::string set = fmt::format("{}/{}", group_of(grid), field);
  Source source{file.open_numbers(set, static_cast<std::size_t>(rank)), box, box};
  const auto has_cells = [&](const Vec3i& cells) {
    for (int axis = 0; axis < rank; ++axis)
      if (source.values.shape()[static_cast<std::size_t>(rank - 1 - axis)] != static_cast<std::uint64_t>(cells[axis]))
        return false;
    return true;
  };
  if (has_cells(grid.cells)) return source;
  if (!has_cells(grid.stored))
    file.fail(set,
              fmt::format("extents {}; the hierarchy says {} x {} x {} cells, x fastest here, or {} x {} x {} with ghost cells",
                          text(source.values.shape()), grid.cells.z, grid.cells.y, grid.cells.x, grid.stored.z, grid.stored.y,
                          grid.stored.x));
  source.stored.lower = box.lower - grid.ghosts;
  source.stored.upper = source.stored.lower + grid.stored;
  return source;
}

/// Reads grids whose values stand in one file.
void read_file(const Hdf5File& file, const std::vector<const EnzoGrid*>& grids, int rank, const std::vector<std::string>& fields,
               const std::vector<Patch*>& patches) {
  std::vector<Source> sources;
  bool parallel = true;
  for (std::size_t i = 0; i < grids.size(); ++i)
    for (const std::string& field : fields) {
      sources.push_back(open_field(file, *grids[i], rank, patches[i]->box, field));
      parallel = parallel && sources.back().values.parallel();
    }
  for_each_index(sources.size(), parallel, [&](std::size_t i) {
    patches[i / fields.size()]->values[i % fields.size()] = sources[i].values.read_box(0, sources[i].stored, sources[i].valid);
  });
}

void read_values(const EnzoFiles& files, const EnzoParameters& parameters, const std::vector<EnzoGrid>& grids,
                 const std::vector<Box>& boxes, MeshDescription& mesh) {
  std::map<std::string, std::vector<std::size_t>> by_file;
  std::vector<std::pair<std::size_t, std::size_t>> place(grids.size());  // level and patch
  for (std::size_t i = 0; i < grids.size(); ++i) {
    auto& level = mesh.levels[static_cast<std::size_t>(grids[i].level)];
    place[i] = {static_cast<std::size_t>(grids[i].level), level.size()};
    level.push_back({boxes[i], std::vector<CellValues>(mesh.fields.size())});
    by_file[grids[i].file].push_back(i);
  }
  for (const auto& [name, members] : by_file) {
    std::vector<const EnzoGrid*> of_file;
    std::vector<Patch*> patches;
    for (const std::size_t i : members) {
      of_file.push_back(&grids[i]);
      patches.push_back(&mesh.levels[place[i].first][place[i].second]);
    }
    read_file(Hdf5File(files.hierarchy.parent_path() / name), of_file, parameters.rank, mesh.fields, patches);
  }
}

}  // namespace

bool is_enzo(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return !hierarchies_in(path).empty();
  return says_parameters(path) || says_grids(path) || holds_grids(path);
}

MeshDescription read_enzo(const fs::path& path, const FieldChoice& fields) {
  const EnzoFiles files = find_files(path);
  const EnzoParameters parameters = scan_enzo_parameters(files.parameters);
  const std::vector<EnzoGrid> grids = scan_enzo_hierarchy(files.hierarchy, parameters.rank);
  MeshDescription mesh;
  mesh.name = dataset_name(files.parameters);
  mesh.domain_lower = parameters.lower;
  mesh.domain_upper = parameters.upper;
  mesh.root_cells = parameters.root_cells;
  int finest = 0;
  std::vector<Box> boxes;
  CheckedSize cells;
  for (const EnzoGrid& grid : grids) {
    finest = std::max(finest, grid.level);
    boxes.push_back(box_of(files.hierarchy, parameters, grid));
    cells += boxes.back().cells();
  }
  mesh.ratios.assign(static_cast<std::size_t>(finest), parameters.refine_by);
  mesh.levels.resize(static_cast<std::size_t>(finest) + 1);
  const std::vector<std::string> there =
      fields_of(Hdf5File(files.hierarchy.parent_path() / grids.front().file), parameters, grids.front());
  for (const std::size_t field : fields.among(files.parameters, there)) {
    mesh.fields.push_back(there[field]);
    mesh.units.push_back(enzo_unit(parameters, there[field]));
  }
  mesh.fields_there = there;
  require_memory(files.parameters, cells, mesh.fields.size());
  read_values(files, parameters, grids, boxes, mesh);
  if (parameters.rank == 2) make_slab(mesh, files.parameters);
  return mesh;
}

}  // namespace amrtex
