#include "structures/readers/flash_hdf5/flash_hdf5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "structures/mesh/quoted.hpp"
#include "structures/readers/flash_hdf5/flash_parameters.hpp"
#include "structures/readers/hdf5_file.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/slab.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxLevels = 64;
constexpr double kOff = 0.1;  // blocks; bounds are float32 in plot files

/// The tree as the file holds it.
struct Blocks {
  std::vector<std::int64_t> level;  ///< 0 the coarsest
  std::vector<double> bounds;       ///< lower and upper along each axis that there is, of each block
  std::size_t axes = 3;             ///< in the bounds

  std::size_t count() const { return level.size(); }
  double lower(std::size_t block, int axis) const { return bounds[2 * (block * axes + static_cast<std::size_t>(axis))]; }
  double upper(std::size_t block, int axis) const { return bounds[2 * (block * axes + static_cast<std::size_t>(axis)) + 1]; }
};

Blocks read_blocks(const Hdf5File& file, int dimensions) {
  Blocks blocks;
  blocks.level = file.read_integers("refine level").values;
  if (blocks.level.empty()) file.fail("refine level", "no block");
  for (std::size_t b = 0; b < blocks.count(); ++b) {
    if (blocks.level[b] < 1 || blocks.level[b] > kMaxLevels)
      file.fail("refine level", fmt::format("block {} is of level {}; 1 to {} are expected", b, blocks.level[b], kMaxLevels));
    --blocks.level[b];
  }
  Hdf5Array<double> bounds = file.read_reals("bounding box");
  const Hdf5Shape& shape = bounds.shape;
  if (shape.size() != 3 || shape[0] != blocks.count() || shape[1] < static_cast<std::uint64_t>(dimensions) || shape[1] > 3 ||
      shape[2] != 2)
    file.fail("bounding box", fmt::format("extents {} for {} blocks in {} dimensions; ({}, {}, 2) are expected", text(shape),
                                          blocks.count(), dimensions, blocks.count(), dimensions));
  blocks.axes = shape[1];
  blocks.bounds = std::move(bounds.values);
  for (const double bound : blocks.bounds)
    if (!std::isfinite(bound)) file.fail("bounding box", "a bound is not finite");
  return blocks;
}

struct Domain {
  Vec3d lower{0};
  Vec3d upper{1};
  Vec3i root_blocks{1};
};

/// From the parameters of the run, or from the blocks where a file has none.
Domain domain_of(const Hdf5File& file, const FlashParameters& parameters, const Blocks& blocks) {
  Domain domain;
  for (int axis = 0; axis < parameters.dimensions; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    double lowest = std::numeric_limits<double>::max();
    double highest = std::numeric_limits<double>::lowest();
    for (std::size_t b = 0; b < blocks.count(); ++b) {
      lowest = std::min(lowest, blocks.lower(b, axis));
      highest = std::max(highest, blocks.upper(b, axis));
    }
    domain.lower[axis] = parameters.lower[i].value_or(lowest);
    domain.upper[axis] = parameters.upper[i].value_or(highest);
    const double size = domain.upper[axis] - domain.lower[axis];
    const double root = (blocks.upper(0, axis) - blocks.lower(0, axis)) * std::ldexp(1.0, static_cast<int>(blocks.level[0]));
    const double counted = parameters.root_blocks[i] ? static_cast<double>(*parameters.root_blocks[i]) : std::round(size / root);
    if (!(size > 0) || !(counted >= 1) || !(counted * parameters.block_cells[axis] < std::numeric_limits<int>::max()))
      file.fail("bounding box", fmt::format("the domain from {} to {} along {} holds {} blocks", domain.lower[axis],
                                            domain.upper[axis], "xyz"[axis], counted));
    domain.root_blocks[axis] = static_cast<int>(counted);
  }
  return domain;
}

Box box_of(const Hdf5File& file, const FlashParameters& parameters, const Domain& domain, const Blocks& blocks,
           std::size_t block) {
  Box box{Vec3i(0), Vec3i(1)};
  const double scale = std::ldexp(1.0, static_cast<int>(blocks.level[block]));
  for (int axis = 0; axis < parameters.dimensions; ++axis) {
    const double count = domain.root_blocks[axis] * scale;  // blocks of this level in the domain
    const double width = (domain.upper[axis] - domain.lower[axis]) / count;
    const double first = (blocks.lower(block, axis) - domain.lower[axis]) / width;
    const double widths = (blocks.upper(block, axis) - blocks.lower(block, axis)) / width;
    const bool fits = count * parameters.block_cells[axis] < std::numeric_limits<int>::max();
    if (!fits || std::abs(first - std::round(first)) > kOff || std::abs(widths - 1) > kOff || first < -kOff ||
        first > count - 1 + kOff)
      file.fail(
          "bounding box",
          fmt::format("block {} of level {} lies from {} to {} along {}, which is no block {} wide of the domain from {} to {}",
                      block, blocks.level[block] + 1, blocks.lower(block, axis), blocks.upper(block, axis), "xyz"[axis], width,
                      domain.lower[axis], domain.upper[axis]));
    box.lower[axis] = static_cast<int>(std::lround(first)) * parameters.block_cells[axis];
    box.upper[axis] = box.lower[axis] + parameters.block_cells[axis];
  }
  return box;
}

/// Names of fields, and of their data sets: those have the blanks that fill a name up in some files.
struct FieldNames {
  std::vector<std::string> fields;
  std::vector<std::string> sets;
};

FieldNames scan_names(const Hdf5File& file) {
  FieldNames names;
  for (const std::string& padded : file.read_texts("unknown names")) {
    const auto last = padded.find_last_not_of(' ');
    names.fields.push_back(last == std::string::npos ? "" : padded.substr(0, last + 1));
    names.sets.push_back(padded);
  }
  if (names.fields.empty()) file.fail("unknown names", "no field");
  return names;
}

Hdf5Numbers open_field(const Hdf5File& file, const FlashParameters& parameters, std::size_t blocks, const std::string& field,
                       const std::string& set) {
  const bool padded = !set.empty() && file.has(set);
  const std::string name = padded ? set : field;
  if (name.empty() || (!padded && !file.has(name)))
    file.fail("unknown names", fmt::format("the field {} has no data set", quote(field)));
  const Vec3i n = parameters.block_cells;
  const Hdf5Shape expected{blocks, static_cast<std::uint64_t>(n.z), static_cast<std::uint64_t>(n.y),
                           static_cast<std::uint64_t>(n.x)};
  const Hdf5Numbers values = file.open_numbers(name, 4);
  if (values.shape() != expected)
    file.fail(name, fmt::format("extents {}; {} are expected: blocks, z, y, x", text(values.shape()), text(expected)));
  if (values.bytes_each() == 8 && !parameters.double_plot_files)
    file.fail(name,
              "a checkpoint: values of float64, and plot files of such (plotfileGridQuantityDP) were not asked for; only "
              "plot files, ..._hdf5_plt_cnt_..., can be read");
  return values;
}

/// Reads many blocks at a time, since each of them alone is small.
template <class T>
void read_blocks_of(const Hdf5Numbers& values, const std::vector<Patch*>& patches, std::size_t field) {
  constexpr std::size_t kValuesAtOnce = std::size_t{1} << 16;
  const auto each = static_cast<std::size_t>(values.count() / patches.size());
  const std::size_t at_once = std::max<std::size_t>(1, kValuesAtOnce / each);
  for_each_index((patches.size() + at_once - 1) / at_once, values.parallel(), [&](std::size_t group) {
    const std::size_t from = group * at_once;
    const std::size_t count = std::min(at_once, patches.size() - from);
    CellArray<T> buffer(count * each);
    values.read(from * each, std::span(buffer));
    for (std::size_t i = 0; i < count; ++i) {
      const T* const begin = buffer.data() + i * each;
      patches[from + i]->values[field] = CellArray<T>(begin, begin + each);
    }
  });
}

void read_field(const Hdf5Numbers& values, const std::vector<Patch*>& patches, std::size_t field) {
  if (values.type() == RealType::float32)
    read_blocks_of<float>(values, patches, field);
  else
    read_blocks_of<double>(values, patches, field);
}

}  // namespace

bool is_flash_hdf5(const fs::path& path) {
  if (!Hdf5File::has_signature(path)) return false;
  const Hdf5File file(path);
  return file.has("sim info") || (file.has("file format version") && (file.has("refine level") || file.has("unknown names")));
}

MeshDescription read_flash_hdf5(const fs::path& path, const FieldChoice& fields) {
  const Hdf5File file(path);
  const FlashParameters parameters = scan_flash_parameters(file);
  if (!file.has("refine level")) file.fail("refine level", "no tree of blocks; files of particles alone cannot be read");
  const Blocks blocks = read_blocks(file, parameters.dimensions);
  const Domain domain = domain_of(file, parameters, blocks);
  const FieldNames names = scan_names(file);
  const std::vector<std::size_t> wanted = fields.among(path, names.fields);
  MeshDescription mesh;
  mesh.name = dataset_name(path);
  mesh.domain_lower = domain.lower;
  mesh.domain_upper = domain.upper;
  mesh.root_cells = domain.root_blocks * parameters.block_cells;
  const auto finest = static_cast<std::size_t>(*std::max_element(blocks.level.begin(), blocks.level.end()));
  mesh.ratios.assign(finest, 2);
  mesh.levels.resize(finest + 1);
  mesh.fields_there = names.fields;
  std::vector<Hdf5Numbers> sources;
  for (const std::size_t field : wanted) {
    mesh.fields.push_back(names.fields[field]);
    sources.push_back(open_field(file, parameters, blocks.count(), names.fields[field], names.sets[field]));
  }
  const std::int64_t cells = Box{Vec3i(0), parameters.block_cells}.cells();
  for (const Hdf5Numbers& source : sources)
    require_memory(path, CheckedSize::of(blocks.count()) * cells, wanted.size(), bytes_of(source.type()));
  std::vector<Patch*> patches(blocks.count());
  std::vector<std::size_t> place(blocks.count());
  for (std::size_t b = 0; b < blocks.count(); ++b) {
    auto& level = mesh.levels[static_cast<std::size_t>(blocks.level[b])];
    place[b] = level.size();
    level.push_back({box_of(file, parameters, domain, blocks, b), std::vector<CellValues>(wanted.size())});
  }
  for (std::size_t b = 0; b < blocks.count(); ++b) patches[b] = &mesh.levels[static_cast<std::size_t>(blocks.level[b])][place[b]];
  for (std::size_t f = 0; f < sources.size(); ++f) read_field(sources[f], patches, f);
  if (parameters.dimensions == 2) make_slab(mesh, path);
  return mesh;
}

}  // namespace amrtex
