#include "structures/readers/vtkhdf/vtkhdf_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/hdf5_file.hpp"
#include "structures/readers/index_box.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr std::size_t kMostLevels = 64;
constexpr const char* kRoot = "VTKHDF";

struct VtkLevel {
  std::string group;
  Vec3d spacing{1};             ///< world
  std::vector<IndexBox> boxes;  ///< cells of the level from the file's origin on
  std::int64_t cells = 0;       ///< of all boxes
};

/// So many finite numbers of an attribute.
Vec3d scan_corner(const Hdf5File& file, const std::string& group, const char* name) {
  const std::vector<double> numbers = file.reals(group, name);
  if (numbers.size() != 3) file.fail(group, fmt::format("attribute {} holds {} numbers; 3 are expected", name, numbers.size()));
  const Vec3d corner(numbers[0], numbers[1], numbers[2]);
  for (int axis = 0; axis < 3; ++axis)
    if (!std::isfinite(corner[axis])) file.fail(group, fmt::format("attribute {} is not finite", name));
  return corner;
}

void check_version(const Hdf5File& file) {
  const std::vector<std::int64_t> version = file.integers(kRoot, "Version");
  if (version.empty() || version.front() < 1 || version.front() > 2)
    file.fail(kRoot, fmt::format("its version is {}; 1 and 2 can be read", version.empty() ? 0 : version.front()));
  const std::string type = file.text(kRoot, "Type");
  if (type != "OverlappingAMR") file.fail(kRoot, fmt::format("its type is {}; only OverlappingAMR can be read", quote(type)));
  const std::string axes = file.has_attribute(kRoot, "GridDescription") ? file.text(kRoot, "GridDescription") : "XYZ";
  if (axes != "XYZ") file.fail(kRoot, fmt::format("its grids are {}; only XYZ, three dimensions, can be read", quote(axes)));
  const std::string steps = std::string(kRoot) + "/Steps";
  if (file.has(steps) && file.has_attribute(steps, "NSteps") && file.integer(steps, "NSteps") > 1)
    file.fail(steps, fmt::format("{} steps in time; files of one can be read", file.integer(steps, "NSteps")));
}

VtkLevel scan_level(const Hdf5File& file, std::string group) {
  VtkLevel level;
  level.group = std::move(group);
  level.spacing = scan_corner(file, level.group, "Spacing");
  if (!glm::all(glm::greaterThan(level.spacing, Vec3d(0)))) file.fail(level.group, "attribute Spacing: a width is not above 0");
  const std::string set = level.group + "/AMRBox";
  const Hdf5Array<std::int64_t> corners = file.read_integers(set);
  if (corners.shape.size() != 2 || corners.shape[1] != 6)
    file.fail(set, fmt::format("extents {}; (boxes, 6) are expected", text(corners.shape)));
  CheckedSize cells;
  for (std::size_t i = 0; i < corners.values.size(); i += 6) {
    IndexBox box;
    for (int axis = 0; axis < 3; ++axis) {  // lower and upper index of one axis after the other
      box.lower[axis] = corners.values[i + 2 * static_cast<std::size_t>(axis)];
      box.upper[axis] = corners.values[i + 2 * static_cast<std::size_t>(axis) + 1];
      if (std::abs(box.lower[axis]) > kInt32Max || std::abs(box.upper[axis]) > kInt32Max || box.upper[axis] < box.lower[axis])
        file.fail(set,
                  fmt::format("box {} reaches from {} to {} along {}", i / 6, box.lower[axis], box.upper[axis], "xyz"[axis]));
    }
    const Vec3l size = box.size();
    cells += CheckedSize(size.x) * size.y * size.z;
    level.boxes.push_back(box);
  }
  level.cells = cells.or_most();
  return level;
}

std::vector<VtkLevel> scan_levels(const Hdf5File& file) {
  std::vector<VtkLevel> levels;
  for (std::string group; file.has(group = fmt::format("{}/Level{}", kRoot, levels.size()));) {
    if (levels.size() == kMostLevels) file.fail(group, fmt::format("at most {} levels can be read", kMostLevels));
    levels.push_back(scan_level(file, group));
  }
  if (levels.empty()) file.fail(kRoot, "it has no group Level0");
  return levels;
}

int ratio_between(const Hdf5File& file, const VtkLevel& coarse, const VtkLevel& fine) {
  constexpr double kRounding = 1e-4;  // relative
  const Vec3d ratio = coarse.spacing / fine.spacing;
  const double whole = std::round(ratio.x);
  for (int axis = 0; axis < 3; ++axis)
    if (!(whole >= 2 && whole <= 65536 && std::abs(ratio[axis] - whole) <= kRounding * whole))
      file.fail(fine.group,
                fmt::format("its cells are {} as wide as those of {} along {}; the same whole ratio along all axes, 2 "
                            "or more, can be read",
                            1 / ratio[axis], coarse.group, "xyz"[axis]));
  return static_cast<int>(whole);
}

/// The file says no domain: it is the box around all boxes, out to the cells of level 0.
IndexBox domain_of(const Hdf5File& file, const std::vector<VtkLevel>& levels, const std::vector<int>& ratios) {
  const auto floor_div = [](std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); };
  IndexBox domain{Vec3l(kInt32Max), Vec3l(-kInt32Max)};
  std::int64_t width = 1;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    if (l > 0) width *= ratios[l - 1];
    if (width > kInt32Max) file.fail(levels[l].group, "more than 31 bits of index");
    for (const IndexBox& box : levels[l].boxes)
      for (int axis = 0; axis < 3; ++axis) {
        domain.lower[axis] = std::min(domain.lower[axis], floor_div(box.lower[axis], width));
        domain.upper[axis] = std::max(domain.upper[axis], floor_div(box.upper[axis], width));
      }
  }
  if (domain.upper.x < domain.lower.x) file.fail(kRoot, "its levels hold no box");
  if (glm::any(glm::greaterThan(domain.size(), Vec3l(kInt32Max))))
    file.fail(kRoot, "its boxes reach over more than 31 bits of index");
  return domain;
}

/// Arrays of one real a cell; ghost flags and vectors are none.
std::vector<std::string> scan_fields(const Hdf5File& file, const VtkLevel& level) {
  const std::string group = level.group + "/CellData";
  std::vector<std::string> fields;
  if (file.has(group))
    for (const std::string& name : file.members(group))
      if (file.rank_of_reals(fmt::format("{}/{}", group, name)) == 1) fields.push_back(name);
  if (fields.empty()) file.fail(level.group, "it holds no array of one real a cell in CellData; values of points cannot be read");
  return fields;
}

Hdf5Numbers open_field(const Hdf5File& file, const VtkLevel& level, const std::string& field) {
  const std::string set = fmt::format("{}/CellData/{}", level.group, field);
  Hdf5Numbers values = file.open_numbers(set, 1);
  if (values.count() != static_cast<std::uint64_t>(level.cells))
    file.fail(set, fmt::format("{} values; its boxes hold {} cells", values.count(), level.cells));
  return values;
}

void read_level(const Hdf5File& file, const VtkLevel& level, const Vec3l& lower, MeshDescription& mesh,
                std::vector<Patch>& patches) {
  std::vector<std::uint64_t> first;
  std::uint64_t cells = 0;
  for (const IndexBox& box : level.boxes) {
    patches.push_back(
        {{Vec3i(box.lower - lower), Vec3i(box.upper - lower + std::int64_t{1})}, std::vector<CellValues>(mesh.fields.size())});
    first.push_back(cells);
    cells += static_cast<std::uint64_t>(patches.back().box.cells());
  }
  for (std::size_t field = 0; field < mesh.fields.size() && !patches.empty(); ++field) {
    const Hdf5Numbers values = open_field(file, level, mesh.fields[field]);
    require_memory(file.path(), level.cells, 1, bytes_of(values.type()));
    for_each_index(patches.size(), values.parallel(),
                   [&](std::size_t k) { patches[k].values[field] = values.read_box(first[k], patches[k].box, patches[k].box); });
  }
}

}  // namespace

bool is_vtkhdf(const fs::path& path) { return Hdf5File::has_signature(path) && Hdf5File(path).has(kRoot); }

MeshDescription read_vtkhdf(const fs::path& path, const FieldChoice& fields) {
  const Hdf5File file(path);
  check_version(file);
  const Vec3d origin = scan_corner(file, kRoot, "Origin");
  const std::vector<VtkLevel> levels = scan_levels(file);
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  for (std::size_t l = 1; l < levels.size(); ++l) mesh.ratios.push_back(ratio_between(file, levels[l - 1], levels[l]));
  const IndexBox domain = domain_of(file, levels, mesh.ratios);
  const Vec3d spacing = levels.front().spacing;
  mesh.root_cells = Vec3i(domain.size());
  mesh.domain_lower = origin + Vec3d(domain.lower) * spacing;
  mesh.domain_upper = origin + Vec3d(domain.upper + std::int64_t{1}) * spacing;
  mesh.fields_there = scan_fields(file, levels.front());
  for (const std::size_t field : fields.among(path, mesh.fields_there)) mesh.fields.push_back(mesh.fields_there[field]);
  Vec3l lower = domain.lower;
  mesh.levels.resize(levels.size());
  for (std::size_t l = 0; l < levels.size(); ++l) {
    if (l > 0) lower *= mesh.ratios[l - 1];
    read_level(file, levels[l], lower, mesh, mesh.levels[l]);
  }
  return mesh;
}

}  // namespace amrtex
