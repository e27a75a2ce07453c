#include "structures/readers/exabrick/exa_mesh.hpp"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <string>
#include <utility>

#include "structures/mesh/cell_boxes.hpp"
#include "structures/mesh/error.hpp"
#include "structures/readers/exabrick/cell_cubes.hpp"

namespace amrtex {
namespace {

std::string text(const ExaCell& c) { return fmt::format("({}, {}, {}) of level {}", c.x, c.y, c.z, c.level); }

[[noreturn]] void refuse(const ExaCellFile& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.path().string(), what));
}

std::int64_t floor_to(std::int64_t value, std::int64_t width) {
  const std::int64_t rest = value % width;
  return value - (rest < 0 ? rest + width : rest);
}

std::array<std::int64_t, 3> corner(const ExaCell& c) { return {c.x, c.y, c.z}; }

/// What some cells reach over.
struct Reach {
  std::array<std::int64_t, 3> lower;
  std::array<std::int64_t, 3> upper;
  std::uint32_t levels = 0;  ///< a bit each
  ExaCell widest{};          ///< the first of the coarsest ones
  std::uint64_t number = 0;  ///< of the widest one

  Reach() {
    lower.fill(std::numeric_limits<std::int64_t>::max());
    upper.fill(std::numeric_limits<std::int64_t>::min());
  }

  void add(const CellRun& run, std::uint64_t run_number) {
    const auto at = corner(run.first);
    const std::int64_t width = run.first.width();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], at[axis]);
      upper[axis] = std::max(upper[axis], at[axis] + width * (axis == 0 ? std::int64_t{run.count} : 1));
    }
    add_widest(run.first, run_number);
    levels |= 1U << run.first.level;
  }
  void add(const Reach& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], other.lower[axis]);
      upper[axis] = std::max(upper[axis], other.upper[axis]);
    }
    if (other.levels != 0) add_widest(other.widest, other.number);
    levels |= other.levels;
  }

 private:
  /// To be called before the level's bit is set.
  void add_widest(const ExaCell& cell, std::uint64_t cell_number) {
    const bool wider = levels == 0 || cell.level > widest.level || (cell.level == widest.level && cell_number < number);
    if (!wider) return;
    widest = cell;
    number = cell_number;
  }
};

Reach find_reach(const ExaCellFile& file) {
  Reach all;
  std::mutex mutex;
  file.for_each_chunk([&](const CellChunk& chunk) {
    Reach own;
    for (const CellRun& run : chunk.runs) own.add(run, chunk.first_cell + run.place);
    const std::lock_guard lock(mutex);
    all.add(own);
  });
  return all;
}

/// All cells of the file, a set each of our levels.
std::vector<CellCollector> collect_cells(const ExaCellFile& file, const ExaGrid& grid) {
  std::vector<CellCollector> levels(grid.levels.size());
  tbb::enumerable_thread_specific<CellGatherer> gatherers([&] { return CellGatherer(levels); });
  file.for_each_chunk([&](const CellChunk& chunk) {
    CellGatherer& gatherer = gatherers.local();
    for (const CellRun& run : chunk.runs) {
      const auto at = corner(run.first);
      for (std::size_t axis = 0; axis < 3; ++axis)
        if ((at[axis] - grid.lower[axis]) % run.first.width() != 0)
          throw BadCell{chunk.first_cell + run.place,
                        fmt::format("cell {} {} does not lie on a multiple of its width, {}", chunk.first_cell + run.place,
                                    text(run.first), run.first.width())};
      gatherer.add(grid.level_of(run.first), grid.place(run.first), run.count);
    }
  });
  for (CellGatherer& gatherer : gatherers) gatherer.flush();
  return levels;
}

/// Names the first two cells of the file that lie in one place.
[[noreturn]] void refuse_twice(const ExaCellFile& file, const ExaGrid& grid, std::size_t level, const Vec3i& cell) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> there;  // number in the file, place in the scalars
  std::mutex mutex;
  file.for_each_chunk([&](const CellChunk& chunk) {
    for (const CellRun& run : chunk.runs) {
      const Vec3i first = grid.place(run.first);
      const std::int64_t step = std::int64_t{cell.x} - first.x;
      if (grid.level_of(run.first) != level || first.y != cell.y || first.z != cell.z || step < 0 || step >= run.count) continue;
      const std::uint32_t place = run.place + static_cast<std::uint32_t>(step);
      const std::lock_guard lock(mutex);
      there.emplace_back(chunk.first_cell + place, chunk.scalar(place));
      std::sort(there.begin(), there.end());
      if (there.size() > 2) there.pop_back();
    }
  });
  if (there.size() < 2) refuse(file, "changed while it was read");
  refuse(file, fmt::format("cells {} and {} overlap: both are of level {} at one place", there[0].second, there[1].second,
                           grid.levels[level]));
}

/// Sets of leaves by level.
std::vector<CellCubes> find_leaves(const ExaCellFile& file, const ExaGrid& grid) {
  std::vector<CellCollector> collected = collect_cells(file, grid);
  std::vector<CellCubes> leaves;
  for (std::size_t l = 0; l < collected.size(); ++l) {
    if (const auto cell = collected[l].twice()) refuse_twice(file, grid, l, *cell);
    leaves.push_back(collected[l].take());
  }
  return leaves;
}

void require_apart(const ExaCellFile& file, const CellCubes& leaves, const CellCubes& touched, int width) {
  const CellCubes both = common(leaves, touched);
  if (both.empty()) return;
  const Vec3i first = first_cell(both);
  refuse(file, fmt::format("{} cells overlap finer ones; the first is {} finest cells wide, at ({}, {}, {}) of its level",
                           count_cells(both), width, first.x, first.y, first.z));
}

/// Boxes of a level's cells: those of whole parents by the parents' boxes, so that no stored parent is cut.
std::vector<Box> boxes_of_level(const CellCubes& cells, const CellCubes& parents, int ratio) {
  std::vector<Box> boxes = parts_of(boxes_of_runs(runs_of(parents)), std::max(1, kWidestPatch / ratio));
  for (Box& box : boxes) box = box.refined(ratio);
  const std::vector<Box> rest = parts_of(boxes_of_runs(runs_of(outside(cells, parents, ratio))), kWidestPatch);
  boxes.insert(boxes.end(), rest.begin(), rest.end());
  return boxes;
}

}  // namespace

Vec3i ExaGrid::root_cells() const {
  const auto count = [&](std::size_t axis) { return static_cast<int>((upper[axis] - lower[axis]) >> levels.front()); };
  return {count(0), count(1), count(2)};
}

Vec3i ExaGrid::place(const ExaCell& cell) const {
  return {static_cast<int>((cell.x - lower[0]) >> cell.level), static_cast<int>((cell.y - lower[1]) >> cell.level),
          static_cast<int>((cell.z - lower[2]) >> cell.level)};
}

ExaGrid find_grid(const ExaCellFile& file) {
  const Reach reach = find_reach(file);
  ExaGrid grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t origin = corner(reach.widest)[axis];  // a corner of the coarsest grid
    const std::int64_t width = reach.widest.width();
    grid.lower[axis] = origin + floor_to(reach.lower[axis] - origin, width);
    grid.upper[axis] = origin - floor_to(origin - reach.upper[axis], width);
    if (grid.upper[axis] - grid.lower[axis] > std::numeric_limits<std::int32_t>::max())
      refuse(file, fmt::format("its cells reach from {} to {} along axis {}; at most 31 bits are supported", reach.lower[axis],
                               reach.upper[axis], "xyz"[axis]));
  }
  for (int level = kMostExaLevel; level >= 0; --level)
    if ((reach.levels >> level & 1) != 0) {
      grid.ours[static_cast<std::size_t>(level)] = grid.levels.size();
      grid.levels.push_back(level);
    }
  return grid;
}

std::vector<std::vector<Box>> patch_boxes(const ExaCellFile& file, const ExaGrid& grid) {
  std::vector<CellCubes> leaves = find_leaves(file, grid);
  std::vector<std::vector<Box>> boxes(leaves.size());
  CellCubes whole;    // cells of the level whose children are all there
  CellCubes touched;  // cells of the level with anything under them
  for (std::size_t l = leaves.size(); l-- > 0;) {
    const CellCubes own = std::move(leaves[l]);
    require_apart(file, own, touched, grid.width(l));
    const CellCubes cells = joined(own, whole);
    if (l == 0) {
      boxes[0] = parts_of(boxes_of_runs(runs_of(cells)), kWidestPatch);
      break;
    }
    const int ratio = grid.ratio_to_finer(l - 1);
    whole = whole_parents(cells, ratio);
    touched = touched_parents(joined(cells, touched), ratio);
    boxes[l] = boxes_of_level(cells, whole, ratio);
  }
  return boxes;
}

}  // namespace amrtex
