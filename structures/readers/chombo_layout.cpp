#include "structures/readers/chombo_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/slab.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

constexpr std::int64_t kInt32Max = std::numeric_limits<std::int32_t>::max();
constexpr std::int64_t kMaxLevels = 64;
constexpr std::int64_t kMaxGhosts = 1024;

std::vector<std::string> corner_names(int dimensions) {
  std::vector<std::string> names;
  for (const char* side : {"lo_", "hi_"})
    for (int axis = 0; axis < dimensions; ++axis) names.push_back(std::string(side) + "ijk"[axis]);
  return names;
}

/// A box of `dimensions` lower and as many upper indices; along other axes one cell at 0.
IndexBox box_of(const Hdf5File& file, const std::string& object, const std::int64_t* corners, int dimensions) {
  IndexBox box;
  for (int axis = 0; axis < dimensions; ++axis) {
    box.lower[axis] = corners[axis];
    box.upper[axis] = corners[dimensions + axis];
    if (std::abs(box.lower[axis]) > kInt32Max || std::abs(box.upper[axis]) > kInt32Max)
      file.fail(object, "indices of more than 31 bits");
  }
  if (glm::any(glm::lessThan(box.upper, box.lower))) file.fail(object, fmt::format("the box {} is empty", text(box)));
  if (glm::any(glm::greaterThan(box.size(), Vec3l(kInt32Max))))
    file.fail(object, fmt::format("the box {} is too wide", text(box)));
  return box;
}

int scan_dimensions(const Hdf5File& file) {
  const std::int64_t dimensions = file.integer("Chombo_global", "SpaceDim");
  if (dimensions == 1) file.fail("Chombo_global", "the data are 1-dimensional; 2 and 3 dimensions can be read");
  if (dimensions < 1 || dimensions > 3)
    file.fail("Chombo_global", fmt::format("SpaceDim is {}; 2 and 3 dimensions can be read", dimensions));
  return static_cast<int>(dimensions);
}

std::vector<std::string> scan_fields(const Hdf5File& file) {
  const std::int64_t count = file.integer("/", "num_components");
  if (count < 1 || count > kInt32Max) file.fail("/", fmt::format("num_components is {}; at least 1 is needed", count));
  std::vector<std::string> fields;
  for (std::int64_t i = 0; i < count; ++i) fields.push_back(file.text("/", fmt::format("component_{}", i)));
  return fields;
}

/// One number for all axes, or one for each.
template <class T>
std::vector<T> by_axis(const Hdf5File& file, const std::string& group, const char* name, std::vector<T> values, int dimensions) {
  if (values.size() == 1) values.resize(static_cast<std::size_t>(dimensions), values.front());
  if (std::ssize(values) < dimensions)
    file.fail(group, fmt::format("attribute {} holds {} values; one or {} are expected", name, values.size(), dimensions));
  return values;
}

Vec3d scan_spacing(const Hdf5File& file, const std::string& group, int dimensions) {
  const char* name = file.has_attribute(group, "Vec_dx") ? "Vec_dx" : "dx";
  const auto widths = by_axis(file, group, name, file.reals(group, name), dimensions);
  Vec3d spacing(1);
  for (int axis = 0; axis < dimensions; ++axis) {
    spacing[axis] = widths[static_cast<std::size_t>(axis)];
    if (!(spacing[axis] > 0) || !std::isfinite(spacing[axis]))
      file.fail(group, fmt::format("attribute {}: cells {} wide", name, spacing[axis]));
  }
  return spacing;
}

void scan_boxes(const Hdf5File& file, ChomboLevel& level, int dimensions) {
  const std::string set = level.group + "/boxes";
  const auto width = static_cast<std::size_t>(2 * dimensions);
  const auto corners = file.read_records(set, corner_names(dimensions));
  level.boxes.reserve(corners.size() / width);
  for (std::size_t i = 0; i < corners.size(); i += width) {
    level.boxes.push_back(box_of(file, set, corners.data() + i, dimensions));
    if (!level.domain.contains(level.boxes.back()))
      file.fail(set, fmt::format("box {} {} lies outside the domain {} of its level", i / width, text(level.boxes.back()),
                                 text(level.domain)));
  }
}

void scan_ghosts(const Hdf5File& file, ChomboLevel& level, int dimensions, std::size_t fields) {
  const std::string group = level.group + "/data_attributes";
  if (!file.has(group)) return;
  if (file.has_attribute(group, "comps") && file.integer(group, "comps") != static_cast<std::int64_t>(fields))
    file.fail(group, fmt::format("comps is {}, but the file names {} components", file.integer(group, "comps"), fields));
  if (!file.has_attribute(group, "outputGhost")) return;
  const auto ghosts = by_axis(file, group, "outputGhost", file.integers(group, "outputGhost"), dimensions);
  for (int axis = 0; axis < dimensions; ++axis) {
    level.ghosts[axis] = ghosts[static_cast<std::size_t>(axis)];
    if (level.ghosts[axis] < 0 || level.ghosts[axis] > kMaxGhosts)
      file.fail(group, fmt::format("outputGhost is {}; 0 to {} are expected", level.ghosts[axis], kMaxGhosts));
  }
}

ChomboLevel scan_level(const Hdf5File& file, std::int64_t number, int dimensions, std::size_t fields) {
  ChomboLevel level;
  level.group = fmt::format("level_{}", number);
  if (!file.has(level.group)) file.fail(level.group, "this level is missing");
  const auto corners = file.integers(level.group, "prob_domain", corner_names(dimensions));
  if (std::ssize(corners) != 2 * dimensions)
    file.fail(level.group, fmt::format("prob_domain holds {} numbers; {} are expected", corners.size(), 2 * dimensions));
  level.domain = box_of(file, level.group, corners.data(), dimensions);
  level.spacing = scan_spacing(file, level.group, dimensions);
  scan_boxes(file, level, dimensions);
  scan_ghosts(file, level, dimensions, fields);
  return level;
}

/// The ratio to the next finer level, which the attribute, the domains and the widths of the cells have to agree on.
int scan_ratio(const Hdf5File& file, const ChomboLevel& coarse, const ChomboLevel& fine, int dimensions) {
  constexpr double kRounding = 1e-4;  // relative; old codes write few digits
  const auto stated = by_axis(file, coarse.group, "ref_ratio", file.integers(coarse.group, "ref_ratio"), dimensions);
  for (int axis = 0; axis < dimensions; ++axis) {
    const std::int64_t ratio = stated[static_cast<std::size_t>(axis)];
    if (ratio != stated.front())
      file.fail(coarse.group, fmt::format("the refinement ratio differs between the axes, {} and {}; only the same ratio along "
                                          "all can be read",
                                          stated.front(), ratio));
    if (ratio < 2 || ratio > kInt32Max)
      file.fail(coarse.group, fmt::format("ref_ratio is {}; at least 2 is needed before the finest level", ratio));
    // products of 31 bits each
    if (coarse.domain.lower[axis] * ratio != fine.domain.lower[axis] ||
        coarse.domain.size()[axis] * ratio != fine.domain.size()[axis])
      file.fail(fine.group, fmt::format("its domain {} is not that of {}, {}, refined by {}", text(fine.domain), coarse.group,
                                        text(coarse.domain), ratio));
    const double expected = coarse.spacing[axis] / static_cast<double>(ratio);
    if (std::abs(fine.spacing[axis] - expected) > kRounding * expected)
      file.fail(fine.group, fmt::format("its cells are said to be {} wide along {}, but the ratio {} makes them {}",
                                        fine.spacing[axis], "xyz"[axis], ratio, expected));
  }
  return static_cast<int>(stated.front());
}

/// Which values of a level are whose.
struct PatchPlace {
  Box stored;  ///< with ghost cells; level space, the domain's corner at 0
  Box valid;
  std::uint64_t first = 0;  ///< of its values
  std::uint64_t cells = 0;  ///< that are stored for one component
};

struct LevelData {
  std::vector<PatchPlace> patches;
  std::vector<Hdf5Numbers> fields;             ///< one a wanted field; the same one again where all stand in one
  std::vector<std::uint64_t> component_first;  ///< components in front of each wanted field, in the same data set
};

/// What else a level holds that has no plain data: a checkpoint has one array for each of its variables.
[[noreturn]] void refuse_without_data(const Hdf5File& file, const ChomboLevel& level) {
  std::vector<std::string> others;
  constexpr std::string_view kData = ":datatype=0";
  for (const std::string& name : file.members(level.group))
    if (name.ends_with(kData)) others.push_back(name.substr(0, name.size() - kData.size()));
  if (others.empty()) file.fail(level.group, "it has boxes, but no data set data:datatype=0");
  file.fail(level.group,
            fmt::format("a checkpoint: it has no data set data:datatype=0 but such of {}; only plot files can be read",
                        listed(others)));
}

LevelData open_level(const ChomboLayout& layout, const ChomboLevel& level, ChomboComponents components,
                     const std::vector<std::size_t>& wanted) {
  LevelData data;
  const bool one_set = components == ChomboComponents::one_set;
  if (level.boxes.empty()) return data;
  if (!layout.file.has(level.group + "/data:datatype=0")) refuse_without_data(layout.file, level);
  for (const std::size_t component : wanted) {
    if (!one_set || data.fields.empty())
      data.fields.push_back(
          layout.file.open_numbers(fmt::format("{}/data:datatype={}", level.group, one_set ? 0 : component), 1));
    else
      data.fields.push_back(data.fields.front());
    data.component_first.push_back(one_set ? component : 0);
  }
  return data;
}

std::vector<std::int64_t> scan_offsets(const ChomboLayout& layout, const ChomboLevel& level) {
  const std::string set = level.group + "/data:offsets=0";
  if (!layout.file.has(set)) return {};
  const auto offsets = layout.file.read_integers(set).values;
  if (offsets.size() < level.boxes.size())
    layout.file.fail(set, fmt::format("{} offsets for {} boxes", offsets.size(), level.boxes.size()));
  return offsets;
}

/// Finds every patch of a level. Together they may not claim more values than there are, else a small file could make us
/// allocate without bound by naming the same values many times.
LevelData locate_level(const ChomboLayout& layout, const ChomboLevel& level, ChomboComponents components,
                       const std::vector<std::size_t>& wanted) {
  LevelData data = open_level(layout, level, components, wanted);
  if (level.boxes.empty()) return data;
  const std::vector<std::int64_t> offsets = scan_offsets(layout, level);
  const auto each = static_cast<std::int64_t>(components == ChomboComponents::one_set ? layout.fields.size() : 1);
  std::uint64_t present = std::numeric_limits<std::uint64_t>::max();
  for (const Hdf5Numbers& field : data.fields) present = std::min(present, field.count());
  CheckedSize claimed;
  for (std::size_t i = 0; i < level.boxes.size(); ++i) {
    PatchPlace place;
    const IndexBox& box = level.boxes[i];
    place.valid = {Vec3i(box.lower - level.domain.lower), Vec3i(box.upper - level.domain.lower + std::int64_t{1})};
    place.stored = {place.valid.lower - Vec3i(level.ghosts), place.valid.upper + Vec3i(level.ghosts)};
    const CheckedSize values = CheckedSize(place.stored.cells()) * each;
    place.cells = static_cast<std::uint64_t>(place.stored.cells());
    place.first = static_cast<std::uint64_t>(offsets.empty() ? claimed.or_most() : offsets[i]);
    claimed += values;
    if (claimed.or_most() > CheckedSize::of(present).or_most() || place.first > present ||
        static_cast<std::uint64_t>(values.or_most()) > present - place.first)
      layout.file.fail(level.group,
                       fmt::format("patch {} {} takes {} values from {} on with its {} components and {} ghost cells, "
                                   "but there are only {}, or the patches share some",
                                   i, text(box), values.or_most(), place.first, each, text(level.ghosts), present));
    data.patches.push_back(place);
  }
  return data;
}

void read_patch(const LevelData& level, const PatchPlace& place, Patch& patch) {
  patch.box = place.valid;
  for (std::size_t f = 0; f < level.fields.size(); ++f)
    patch.values.push_back(
        level.fields[f].read_box(place.first + level.component_first[f] * place.cells, place.stored, place.valid));
}

}  // namespace

ChomboLayout scan_chombo_layout(const std::filesystem::path& path) {
  ChomboLayout layout{Hdf5File(path), 3, {}, {}, {}};
  layout.dimensions = scan_dimensions(layout.file);
  layout.fields = scan_fields(layout.file);
  const std::int64_t levels = layout.file.integer("/", "num_levels");
  if (levels < 1 || levels > kMaxLevels)
    layout.file.fail("/", fmt::format("num_levels is {}; 1 to {} levels are supported", levels, kMaxLevels));
  for (std::int64_t l = 0; l < levels; ++l)
    layout.levels.push_back(scan_level(layout.file, l, layout.dimensions, layout.fields.size()));
  for (std::size_t l = 1; l < layout.levels.size(); ++l)
    layout.ratios.push_back(scan_ratio(layout.file, layout.levels[l - 1], layout.levels[l], layout.dimensions));
  return layout;
}

MeshDescription read_chombo_layout(const ChomboLayout& layout, ChomboComponents components, const Vec3d& lower,
                                   const Vec3d& upper, const FieldChoice& fields) {
  const std::filesystem::path& path = layout.file.path();
  const std::vector<std::size_t> wanted = fields.among(path, layout.fields);
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  mesh.domain_lower = lower;
  mesh.domain_upper = upper;
  mesh.root_cells = Vec3i(layout.levels.front().domain.size());
  mesh.ratios = layout.ratios;
  mesh.fields_there = layout.fields;
  for (const std::size_t component : wanted) mesh.fields.push_back(layout.fields[component]);
  std::vector<LevelData> sources;
  CheckedSize bytes;
  for (const ChomboLevel& level : layout.levels) {
    sources.push_back(locate_level(layout, level, components, wanted));
    for (const PatchPlace& place : sources.back().patches)
      for (const Hdf5Numbers& field : sources.back().fields)
        bytes += CheckedSize(place.valid.cells()) * static_cast<std::int64_t>(bytes_of(field.type()));
  }
  require_memory(path, bytes, 1, 1);
  mesh.levels.resize(sources.size());
  for (std::size_t l = 0; l < sources.size(); ++l) {
    const LevelData& level = sources[l];
    mesh.levels[l].resize(level.patches.size());
    const auto read = [&](std::size_t i) { read_patch(level, level.patches[i], mesh.levels[l][i]); };
    for_each_index(level.patches.size(), !level.fields.empty() && level.fields.front().parallel(), read);
  }
  if (layout.dimensions == 2) make_slab(mesh, path);
  return mesh;
}

}  // namespace amrtex
