#include "structures/readers/raw_volume/coarsen_volume.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "structures/mesh/cell_boxes.hpp"

namespace amrtex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr int kLargestPatch = 64;  ///< cells along an axis: patches are what is worked on in parallel

/// Cells 2^k of the volume's wide: those that lie wholly in the volume.
struct CoarseCells {
  Vec3i size{0};
  std::vector<double> mean;       ///< NaN where a value is missing
  std::vector<double> low, high;  ///< of the values under a cell; of none: low above high; of some: without bounds

  Box box() const { return {Vec3i(0), size}; }
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

Range range_of(const std::vector<double>& values) {
  Range range;
  for (const double v : values)
    if (std::isfinite(v)) range.add(v, v);
  return range;
}

/// The eight cells under one, of the volume itself (`low` and `high` null) or of the level below.
struct Eight {
  double sum = 0;
  int missing = 0;
  Range range;

  void add(double mean, double low, double high) {
    if (std::isnan(mean)) ++missing;
    sum += mean;
    range.add(low, high);
  }
  double mean() const { return missing == 0 ? sum / 8 : kNone; }
  Range bounds() const {
    if (missing == 0 || (missing == 8 && range.empty())) return range;
    return {-kInfinity, kInfinity};
  }
};

CoarseCells next_level(const CoarseCells& fine) {
  CoarseCells coarse;
  coarse.size = fine.size / 2;
  const auto count = static_cast<std::size_t>(coarse.box().cells());
  coarse.mean.resize(count);
  coarse.low.resize(count);
  coarse.high.resize(count);
  const bool is_volume = fine.low.empty();
  tbb::parallel_for(0, coarse.size.z, [&](int z) {
    for_each_cell({{0, 0, z}, {coarse.size.x, coarse.size.y, z + 1}}, [&](const Vec3i& cell) {
      Eight under;
      for_each_cell(Box{cell, cell + Vec3i(1)}.refined(2), [&](const Vec3i& c) {
        const std::size_t j = fine.box().offset(c);
        const double v = fine.mean[j];
        const bool none = is_volume && std::isnan(v);
        under.add(v, none ? kInfinity : is_volume ? v : fine.low[j], none ? -kInfinity : is_volume ? v : fine.high[j]);
      });
      const std::size_t i = coarse.box().offset(cell);
      coarse.mean[i] = under.mean();
      coarse.low[i] = under.bounds().low;
      coarse.high[i] = under.bounds().high;
    });
  });
  return coarse;
}

/// Decides for blocks which level they have.
class BlockChooser {
 public:
  BlockChooser(const std::vector<CoarseCells>& levels, const CoarsenCriterion& criterion, double tolerance)
      : levels_(levels), criterion_(criterion), tolerance_(tolerance), chosen_(levels.size()) {}

  /// Blocks a level, the finest first: those that are chosen, and those over finer ones whose cells all exist.
  std::vector<std::vector<Vec3i>> choose() {
    const std::size_t top = levels_.size() - 1;
    const Box blocks{Vec3i(0), ceil_div(levels_[0].size, criterion_.block << top)};
    for_each_cell(blocks, [&](const Vec3i& b) { visit(top, b); });
    return std::move(chosen_);
  }
  /// The coarsest level that a chosen block has.
  std::size_t coarsest() const { return coarsest_; }

  /// The cells of a block that the volume has, in the level's cells; empty where one of them is not whole.
  Box cells_of(std::size_t level, const Vec3i& block) const {
    const int width = 1 << level;
    const Vec3i lower = block * criterion_.block;
    const Vec3i end = glm::min((lower + criterion_.block) * width, levels_[0].size);
    for (int axis = 0; axis < 3; ++axis)
      if (end[axis] % width != 0) return {lower, lower};
    return {lower, end / width};
  }

 private:
  void visit(std::size_t level, const Vec3i& block) {
    if (glm::any(glm::greaterThanEqual(block * (criterion_.block << level), levels_[0].size))) return;
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
    Range all;
    bool near = true;
    bool complete = true;
    for_each_cell(cells, [&](const Vec3i& c) {
      const std::size_t i = of.box().offset(c);
      if (of.low[i] > of.high[i]) return;  // nothing but missing values
      all.add(of.low[i], of.high[i]);
      complete = complete && !std::isnan(of.mean[i]);
      near = near && std::max(of.high[i] - of.mean[i], of.mean[i] - of.low[i]) <= tolerance_;
    });
    if (!complete) return false;
    return near || std::any_of(criterion_.hidden.begin(), criterion_.hidden.end(),
                               [&](const auto& range) { return range[0] <= all.low && all.high <= range[1]; });
  }

  const std::vector<CoarseCells>& levels_;
  const CoarsenCriterion& criterion_;
  double tolerance_;
  std::vector<std::vector<Vec3i>> chosen_;
  std::size_t coarsest_ = 0;
};

/// Parts of a box that are at most kLargestPatch wide.
void add_parts(const Box& box, std::vector<Patch>& patches) {
  for_each_cell({Vec3i(0), ceil_div(box.size(), kLargestPatch)}, [&](const Vec3i& part) {
    const Vec3i lower = box.lower + part * kLargestPatch;
    patches.push_back({{lower, glm::min(lower + kLargestPatch, box.upper)}, {}});
  });
}

std::vector<Patch> patches_of(std::vector<Vec3i> blocks, const CoarseCells& cells, int edge, RealType type) {
  std::sort(blocks.begin(), blocks.end(), array_order);
  std::vector<Patch> patches;
  for (const Box& box : boxes_of_cells(blocks)) add_parts(intersection(box.refined(edge), cells.box()), patches);
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t k) {
    Patch& patch = patches[k];
    CellValues values(type, static_cast<std::size_t>(patch.box.cells()));
    values.visit_stored([&](auto& stored) {
      auto out = stored.begin();
      for (int z = patch.box.lower.z; z < patch.box.upper.z; ++z)
        for (int y = patch.box.lower.y; y < patch.box.upper.y; ++y) {
          const double* row = &cells.mean[cells.box().offset({patch.box.lower.x, y, z})];
          out = std::transform(row, row + patch.box.size().x, out,
                               [](double v) { return static_cast<typename std::decay_t<decltype(stored)>::value_type>(v); });
        }
    });
    patch.values.push_back(std::move(values));
  });
  return patches;
}

/// As many levels as are allowed and as have a whole cell.
std::vector<CoarseCells> make_levels(Volume& volume, int most) {
  std::vector<CoarseCells> levels(1);
  levels[0].size = volume.cells;
  levels[0].mean = std::move(volume.values);
  for (double& v : levels[0].mean)
    if (!std::isfinite(v)) v = kNone;
  while (std::ssize(levels) < most && std::min({levels.back().size.x, levels.back().size.y, levels.back().size.z}) > 1)
    levels.push_back(next_level(levels.back()));
  return levels;
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
  const Range range = range_of(volume.values);
  const double tolerance = range.empty() ? 0 : criterion.tolerance * (range.high - range.low);
  const std::vector<CoarseCells> levels = make_levels(volume, criterion.levels);
  BlockChooser chooser(levels, criterion, tolerance);
  std::vector<std::vector<Vec3i>> blocks = chooser.choose();
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
    mesh.levels.push_back(patches_of(std::move(blocks[level]), levels[level], criterion.block,
                                     level == 0 ? volume.type : RealType::float64));  // means are no values of the file
  return mesh;
}

}  // namespace amrtex
