#include "structures/readers/raw_volume/coarsen_volume.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "structures/mesh/cell_boxes.hpp"
#include "structures/mesh/cell_memory.hpp"

namespace amrtex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kValuesAtOnce = std::size_t{1} << 15;  ///< of the volume, a thread; or rows where they are longer
constexpr int kPlanesAtOnce = 16;                            ///< at least; then their values are given back

/// Cells 2^k of the volume's wide: those that lie wholly in the volume.
struct CoarseCells {
  Vec3i size{0};
  CellArray<double> mean;  ///< NaN where a value is missing; of the volume itself, which is level 0: none are kept

  Box box() const { return {Vec3i(0), size}; }
};

/// Of the values under each of some cells of a level. Of none: low above high; of some: without bounds.
struct Bounds {
  Box cells;
  CellArray<double> low, high;
};

struct Range {
  double low = kInfinity;
  double high = -kInfinity;

  void add(double l, double h) {
    low = std::min(low, l);
    high = std::max(high, h);
  }
  bool empty() const { return low > high; }
};

/// How many things of so many values each are read at once, 1 to `most`.
int count_at_once(std::size_t values_each, int most) {
  return static_cast<int>(std::clamp<std::size_t>(kValuesAtOnce / values_each, 1, static_cast<std::size_t>(most)));
}

/// Values of a volume from the one with number `first` on; NaN where one is not finite.
void read_values(const Volume& volume, std::size_t first, std::span<double> out) {
  volume.source->read(first, out);
  for (double& v : out)
    if (!std::isfinite(v)) v = kNone;
}

Range range_of(const Volume& volume) {
  const auto count = static_cast<std::size_t>(Box{Vec3i(0), volume.cells}.cells());
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, (count + kValuesAtOnce - 1) / kValuesAtOnce), Range(),
      [&](const tbb::blocked_range<std::size_t>& parts, Range range) {
        CellArray<double> values(std::min(kValuesAtOnce, count));
        for (std::size_t part = parts.begin(); part < parts.end(); ++part) {
          const std::size_t first = part * kValuesAtOnce;
          const auto read = std::span(values).first(std::min(kValuesAtOnce, count - first));
          volume.source->read(first, read);
          for (const double v : read)
            if (std::isfinite(v)) range.add(v, v);
        }
        return range;
      },
      [](Range a, const Range& b) {
        a.add(b.low, b.high);
        return a;
      });
}

/// As many levels as are allowed and as have a whole cell, with place for their means.
std::vector<CoarseCells> make_levels(const Vec3i& cells, int most) {
  std::vector<CoarseCells> levels(1);
  levels[0].size = cells;
  while (std::ssize(levels) < most && std::min({levels.back().size.x, levels.back().size.y, levels.back().size.z}) > 1) {
    CoarseCells coarse;
    coarse.size = levels.back().size / 2;
    coarse.mean.resize(static_cast<std::size_t>(coarse.box().cells()));
    levels.push_back(std::move(coarse));
  }
  return levels;
}

/// The eight cells under one, of the volume itself or of the level below.
struct Eight {
  double sum = 0;
  int missing = 0;
  Range range;

  void add(double mean, double low, double high) {
    if (std::isnan(mean)) ++missing;
    sum += mean;
    range.add(low, high);
  }
  void add_value(double v) {
    if (std::isnan(v))
      add(v, kInfinity, -kInfinity);
    else
      add(v, v, v);
  }
  double mean() const { return missing == 0 ? sum / 8 : kNone; }
  Range bounds() const {
    if (missing == 0 || (missing == 8 && range.empty())) return range;
    return {-kInfinity, kInfinity};
  }
};

void set_cell(CoarseCells& level, Bounds& bounds, const Vec3i& cell, const Eight& under) {
  level.mean[level.box().offset(cell)] = under.mean();
  const std::size_t i = bounds.cells.offset(cell);
  const Range range = under.bounds();
  bounds.low[i] = range.low;
  bounds.high[i] = range.high;
}

Bounds make_bounds(const Box& cells) {
  const auto count = static_cast<std::size_t>(cells.cells());
  return {cells, CellArray<double>(count), CellArray<double>(count)};
}

/// Level 1 of a strip from the volume's values, two of its planes and some of its rows at a time.
Bounds first_level(const Volume& volume, CoarseCells& level, const Box& strip) {
  Bounds bounds = make_bounds(strip);
  if (strip.empty()) return bounds;
  const Box all{Vec3i(0), volume.cells};
  const auto width = static_cast<std::size_t>(volume.cells.x);
  const int rows = count_at_once(4 * width, strip.size().y);
  tbb::parallel_for(strip.lower.z, strip.upper.z, [&](int z) {
    CellArray<double> lower(2 * static_cast<std::size_t>(rows) * width);
    CellArray<double> upper(lower.size());
    for (int y = strip.lower.y; y < strip.upper.y; y += rows) {
      const Box part{{0, y, z}, {strip.upper.x, std::min(y + rows, strip.upper.y), z + 1}};
      const auto count = 2 * static_cast<std::size_t>(part.size().y) * width;
      read_values(volume, all.offset({0, 2 * y, 2 * z}), std::span(lower).first(count));
      read_values(volume, all.offset({0, 2 * y, 2 * z + 1}), std::span(upper).first(count));
      for_each_cell(part, [&](const Vec3i& cell) {
        const std::size_t begin = 2 * (static_cast<std::size_t>(cell.y - y) * width + static_cast<std::size_t>(cell.x));
        Eight under;
        for (const double* plane : {lower.data(), upper.data()})
          for (const double* row : {plane + begin, plane + begin + width}) {
            under.add_value(row[0]);
            under.add_value(row[1]);
          }
        set_cell(level, bounds, cell, under);
      });
    }
  });
  return bounds;
}

Bounds next_level(const CoarseCells& fine, const Bounds& fine_bounds, CoarseCells& coarse, const Box& strip) {
  Bounds bounds = make_bounds(strip);
  tbb::parallel_for(strip.lower.z, std::max(strip.lower.z, strip.upper.z), [&](int z) {
    for_each_cell({{strip.lower.x, strip.lower.y, z}, {strip.upper.x, strip.upper.y, z + 1}}, [&](const Vec3i& cell) {
      Eight under;
      for_each_cell(Box{cell, cell + Vec3i(1)}.refined(2), [&](const Vec3i& c) {
        const std::size_t i = fine_bounds.cells.offset(c);
        under.add(fine.mean[fine.box().offset(c)], fine_bounds.low[i], fine_bounds.high[i]);
      });
      set_cell(coarse, bounds, cell, under);
    });
  });
  return bounds;
}

/// Decides for blocks which level they have, a strip of the volume after the other: a row of the coarsest level's blocks along x.
/// Bounds are kept of one strip, means of all.
class BlockChooser {
 public:
  BlockChooser(const Volume& volume, const CoarsenCriterion& criterion)
      : volume_(volume),
        criterion_(criterion),
        levels_(make_levels(volume.cells, criterion.levels)),
        chosen_(levels_.size()),
        tolerance_(tolerance()) {}

  void choose() {
    const Vec3i blocks = ceil_div(volume_.cells, block_width(top()));
    for_each_cell({Vec3i(0), {1, blocks.y, blocks.z}}, [&](const Vec3i& first) {
      const Box strip{first, {blocks.x, first.y + 1, first.z + 1}};
      measure(strip);
      for_each_cell(strip, [&](const Vec3i& block) { visit(top(), block); });
    });
    bounds_.clear();
    levels_.resize(coarsest_ + 1);
  }

  /// Of a level, 0 the finest: those that are chosen, and those over finer ones whose cells all exist.
  std::vector<Vec3i>& blocks(std::size_t level) { return chosen_[level]; }
  CoarseCells& cells(std::size_t level) { return levels_[level]; }
  /// The coarsest level that a chosen block has.
  std::size_t coarsest() const { return coarsest_; }

 private:
  std::size_t top() const { return levels_.size() - 1; }
  int block_width(std::size_t level) const { return criterion_.block << level; }  ///< in the volume's cells

  double tolerance() const {
    if (top() == 0) return 0;  // nothing can become coarse
    const Range range = range_of(volume_);
    return range.empty() ? 0 : criterion_.tolerance * (range.high - range.low);
  }

  /// Means and bounds of a strip, which is in the coarsest level's blocks.
  void measure(const Box& strip) {
    bounds_.resize(1);
    for (std::size_t level = 1; level <= top(); ++level) {
      const Box cells = intersection(strip.refined(criterion_.block << (top() - level)), levels_[level].box());
      bounds_.push_back(level == 1 ? first_level(volume_, levels_[1], cells)
                                   : next_level(levels_[level - 1], bounds_[level - 1], levels_[level], cells));
    }
  }

  /// The cells of a block that the volume has, in the level's cells; empty where one of them is not whole.
  Box cells_of(std::size_t level, const Vec3i& block) const {
    const int width = 1 << level;
    const Vec3i lower = block * criterion_.block;
    const Vec3i end = glm::min((lower + criterion_.block) * width, levels_[0].size);
    for (int axis = 0; axis < 3; ++axis)
      if (end[axis] % width != 0) return {lower, lower};
    return {lower, end / width};
  }

  void visit(std::size_t level, const Vec3i& block) {
    if (glm::any(glm::greaterThanEqual(block * block_width(level), levels_[0].size))) return;
    const Box cells = cells_of(level, block);
    const bool taken = !cells.empty() && (level == 0 || is_uniform(level, cells));
    if (!cells.empty()) chosen_[level].push_back(block);
    if (taken) {
      coarsest_ = std::max(coarsest_, level);
      return;
    }
    for_each_cell(Box{block, block + Vec3i(1)}.refined(2), [&](const Vec3i& b) { visit(level - 1, b); });
  }

  bool is_uniform(std::size_t level, const Box& cells) const {
    const CoarseCells& of = levels_[level];
    const Bounds& bounds = bounds_[level];
    Range all;
    bool near = true;
    bool complete = true;
    for_each_cell(cells, [&](const Vec3i& c) {
      const std::size_t i = bounds.cells.offset(c);
      const double low = bounds.low[i];
      const double high = bounds.high[i];
      if (low > high) return;  // nothing but missing values
      const double mean = of.mean[of.box().offset(c)];
      all.add(low, high);
      complete = complete && !std::isnan(mean);
      near = near && std::max(high - mean, mean - low) <= tolerance_;
    });
    if (!complete) return false;
    return near || std::any_of(criterion_.hidden.begin(), criterion_.hidden.end(),
                               [&](const auto& range) { return range[0] <= all.low && all.high <= range[1]; });
  }

  const Volume& volume_;
  const CoarsenCriterion& criterion_;
  std::vector<CoarseCells> levels_;
  std::vector<Bounds> bounds_;  ///< a level, of the strip; of level 0 none
  std::vector<std::vector<Vec3i>> chosen_;
  std::size_t coarsest_ = 0;
  double tolerance_;
};

/// One piece for the values of a level; none for a few small patches.
std::shared_ptr<CellMemory> memory_for(const std::vector<Patch>& patches, RealType type) {
  std::size_t bytes = 0;
  for (const Patch& patch : patches) bytes += CellMemory::taken(static_cast<std::size_t>(patch.box.cells()) * bytes_of(type));
  return CellMemory::for_arrays(bytes);
}

/// Patches over blocks of a level.
std::vector<Patch> patches_over(std::vector<Vec3i>& blocks, const Box& cells, int edge) {
  std::sort(blocks.begin(), blocks.end(), array_order);
  std::vector<Box> boxes = boxes_of_cells(blocks);
  blocks = {};
  for (Box& box : boxes) box = intersection(box.refined(edge), cells);
  std::vector<Patch> patches;
  for (const Box& part : parts_of(boxes, kWidestPatch)) patches.push_back({part, {}});
  return patches;
}

/// Values that are still to be set.
void add_values(std::vector<Patch>& patches, RealType type, const std::shared_ptr<CellMemory>& memory) {
  for (Patch& patch : patches) patch.values.emplace_back(type, static_cast<std::size_t>(patch.box.cells()), memory);
}

/// Copies the part that a patch has of values over a box.
void copy_values(std::span<const double> values, const Box& box, Patch& patch) {
  const Box part = intersection(box, patch.box);
  patch.values.front().visit_stored([&](auto& stored) {
    using Real = typename std::decay_t<decltype(stored)>::value_type;
    for (int z = part.lower.z; z < part.upper.z; ++z)
      for (int y = part.lower.y; y < part.upper.y; ++y) {
        const double* row = &values[box.offset({part.lower.x, y, z})];
        std::transform(row, row + part.size().x, &stored[patch.box.offset({part.lower.x, y, z})],
                       [](double v) { return static_cast<Real>(v); });
      }
  });
}

/// Gives patches a level's means, which no type of the file holds; those of the level are given back.
void fill_coarse(CoarseCells& level, std::vector<Patch>& patches) {
  add_values(patches, RealType::float64, memory_for(patches, RealType::float64));
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t k) { copy_values(level.mean, level.box(), patches[k]); });
  level.mean = {};
}

/// Whole rows, or whole planes where these are small: what is read at once.
Vec3i part_at_once(const Vec3i& size) {
  const auto row = static_cast<std::size_t>(size.x);
  const int rows = count_at_once(row, size.y);
  return {size.x, rows, rows < size.y ? 1 : count_at_once(row * static_cast<std::size_t>(size.y), size.z)};
}

/// Reads such a part and hands it to the patches.
void fill_from_part(const Volume& volume, const Box& part, std::span<Patch* const> patches) {
  if (std::none_of(patches.begin(), patches.end(), [&](const Patch* patch) { return overlap(part, patch->box); })) return;
  CellArray<double> values(static_cast<std::size_t>(part.cells()));
  read_values(volume, Box{Vec3i(0), volume.cells}.offset(part.lower), values);
  for (Patch* patch : patches)
    if (overlap(part, patch->box)) copy_values(values, part, *patch);
}

void fill_planes(const Volume& volume, const Box& planes, std::vector<Patch>& patches) {
  std::vector<Patch*> met;
  for (Patch& patch : patches)
    if (overlap(planes, patch.box)) met.push_back(&patch);
  const Vec3i edge = part_at_once(volume.cells);
  const Vec3i parts = (planes.size() - 1) / edge + 1;
  tbb::parallel_for(0, parts.z, [&](int z) {
    tbb::parallel_for(0, parts.y, [&](int y) {
      const Vec3i lower = planes.lower + Vec3i(0, y, z) * edge;
      fill_from_part(volume, {lower, lower + glm::min(edge, planes.upper - lower)}, met);
    });
  });
}

/// Gives the finest level's patches the volume's values, some planes after the other. What a source holds in memory is given back
/// meanwhile: patches then have arrays of their own, which take memory as far as they are set; huge pages take it before.
void fill_finest(Volume& volume, std::vector<Patch>& patches) {
  add_values(patches, volume.type, volume.source->holds_values() ? nullptr : memory_for(patches, volume.type));
  const Box all{Vec3i(0), volume.cells};
  const int at_once = part_at_once(volume.cells).z;
  const int step = ceil_div(kPlanesAtOnce, at_once) * at_once;
  for (int z = 0; z < volume.cells.z;) {
    const int end = z + std::min(step, volume.cells.z - z);
    fill_planes(volume, {{0, 0, z}, {volume.cells.x, volume.cells.y, end}}, patches);
    volume.source->give_back_before(all.offset({0, 0, end}));
    z = end;
  }
  volume.source.reset();
}

}  // namespace

void validate(const CoarsenCriterion& criterion) {
  if (!(criterion.tolerance >= 0 && criterion.tolerance <= 1))
    throw UsageError(fmt::format("tolerance {}: accepted is a share of the range, 0 to 1", criterion.tolerance));
  if (criterion.levels < 1 || criterion.levels > 16)
    throw UsageError(fmt::format("levels {}: accepted: 1 to 16", criterion.levels));
  if (criterion.block < 2 || criterion.block > 256 || criterion.block % 2 != 0)
    throw UsageError(fmt::format("block {}: accepted is an even number from 2 to 256", criterion.block));
  for (const auto& range : criterion.hidden)
    if (!(range[0] <= range[1]))
      throw UsageError(fmt::format("hidden range {} to {}: its end lies before its begin", range[0], range[1]));
}

MeshDescription coarsen_volume(Volume volume, const CoarsenCriterion& criterion) {
  validate(criterion);
  BlockChooser chooser(volume, criterion);
  chooser.choose();
  MeshDescription mesh;
  mesh.name = volume.name;
  mesh.fields = {volume.field};
  mesh.units = {volume.unit};
  const int widest = 1 << chooser.coarsest();
  mesh.root_cells = ceil_div(volume.cells, widest);
  mesh.ratios.assign(chooser.coarsest(), 2);
  mesh.domain_lower = volume.lower;
  mesh.domain_upper = volume.lower + Vec3d(mesh.root_cells) * static_cast<double>(widest) * volume.spacing;
  for (std::size_t level = chooser.coarsest() + 1; level-- > 0;)
    mesh.levels.push_back(patches_over(chooser.blocks(level), chooser.cells(level).box(), criterion.block));
  fill_finest(volume, mesh.levels.back());
  for (std::size_t level = 1; level <= chooser.coarsest(); ++level)
    fill_coarse(chooser.cells(level), mesh.levels[chooser.coarsest() - level]);
  return mesh;
}

}  // namespace amrtex
