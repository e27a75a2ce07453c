#include "structures/common/variation_grid.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "structures/common/leap_grid.hpp"
#include "structures/common/patch_parts.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex {
namespace {

/// Level values of a part of a patch and one cell around it.
struct Neighbourhood {
  Box cells;  ///< level space, one cell larger than the part on each side
  std::vector<double> values;
  std::array<std::ptrdiff_t, 3> to_next;  ///< from a value to the next one along each axis
};

Neighbourhood neighbourhood(const AmrHierarchy& h, int field, int level, const Box& part) {
  const Box cells = part.grown(1);
  Neighbourhood n{cells, std::vector<double>(static_cast<std::size_t>(cells.cells())), {}};
  filled_level_values(h, field, level, cells, n.values);
  n.to_next = {1, cells.size().x, std::ptrdiff_t{cells.size().x} * cells.size().y};
  return n;
}

/// Differences of no number count as none.
void keep_larger(double& most, double difference) {
  if (std::abs(difference) > most) most = std::abs(difference);
}

/// Largest of the four second differences across the edges of a cell that lie along the third axis.
double mixed_difference(const double* v, std::ptrdiff_t a, std::ptrdiff_t b) {
  double most = 0;
  for (const std::ptrdiff_t to_a : {-a, a})
    for (const std::ptrdiff_t to_b : {-b, b}) keep_larger(most, v[to_a + to_b] - v[to_a] - v[to_b] + v[0]);
  return most;
}

/// Largest of the eight third differences from a cell to the corners of its neighbourhood.
double corner_difference(const double* v, const std::array<std::ptrdiff_t, 3>& to_next) {
  double most = 0;
  for (const std::ptrdiff_t x : {-to_next[0], to_next[0]})
    for (const std::ptrdiff_t y : {-to_next[1], to_next[1]})
      for (const std::ptrdiff_t z : {-to_next[2], to_next[2]})
        keep_larger(most, v[x + y + z] - v[x + y] - v[y + z] - v[z + x] + v[x] + v[y] + v[z] - v[0]);
  return most;
}

/// `inverse`: 1 / width of the level's cells along each axis, lengths of rays. The cell's value is a number.
BlockVariation cell_variation(const Neighbourhood& n, const Vec3i& cell, const Vec3d& inverse, const ValueUnits& units) {
  const double* v = &n.values[n.cells.offset(cell)];
  const double corner = corner_difference(v, n.to_next);
  Vec3d first(0), slope(corner), second(0);
  double cross = 0, way = 0.5 * corner;
  for (int a = 0; a < 3; ++a) {
    const double up = v[n.to_next[a]] - v[0], down = v[0] - v[-n.to_next[a]];
    keep_larger(first[a], up);
    keep_larger(first[a], down);
    keep_larger(second[a], (up - down) * inverse[a] * inverse[a]);
    way += 0.5 * first[a];
    slope[a] += first[a];
  }
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3;
    const double mixed = mixed_difference(v, n.to_next[a], n.to_next[b]);
    way += 0.5 * mixed;
    slope[a] += mixed;  // towards the neighbours along the other axis the differences are others
    slope[b] += mixed;
    cross += (mixed + corner) * inverse[a] * inverse[b];
  }
  const double number = units.number(v[0]);
  const auto in_units = [&](double difference) { return static_cast<float>(difference / units.scale); };
  return {static_cast<float>(number - way / units.scale), static_cast<float>(number + way / units.scale),
          in_units(glm::length(slope * inverse)), in_units(std::max({second.x, second.y, second.z}) + cross)};
}

class Blocks {
 public:
  explicit Blocks(const LeapGrid& frame) : shift_(frame.shift), all_{Vec3i(0), frame.blocks}, of_blocks_(frame.ranges.size()) {}

  /// `cells`: finest.
  void cover(const Box& cells, const BlockVariation& variation) {
    for_each_cell(Box{cells.lower >> shift_, ((cells.upper - Vec3i(1)) >> shift_) + Vec3i(1)},
                  [&](const Vec3i& b) { of_blocks_[all_.offset(b)].add(variation); });
  }
  void add(const Blocks& other) {
    for (std::size_t i = 0; i < of_blocks_.size(); ++i) of_blocks_[i].add(other.of_blocks_[i]);
  }
  std::vector<BlockVariation>& of_blocks() { return of_blocks_; }

 private:
  int shift_;
  Box all_;
  std::vector<BlockVariation> of_blocks_;
};

void cover_with_part(const AmrHierarchy& h, int field, const ValueUnits& units, int level, const PatchPart& part, Blocks& blocks) {
  const Neighbourhood n = neighbourhood(h, field, level, part.box);
  const Box patch = h.patches(level)[part.patch].box;
  const auto leaves = h.leaf_mask(level, static_cast<int>(part.patch));
  const Vec3d finest = h.spacing(h.finest_level());
  const Vec3d inverse = std::min({finest.x, finest.y, finest.z}) / h.spacing(level);
  const int width = h.cell_width(level);
  for_each_cell(part.box, [&](const Vec3i& c) {
    if (leaves[patch.offset(c)] == 0 || !std::isfinite(n.values[n.cells.offset(c)])) return;
    blocks.cover({c * width, (c + Vec3i(1)) * width}, cell_variation(n, c, inverse, units));
  });
}

}  // namespace

void BlockVariation::add(const BlockVariation& other) {
  low = std::min(low, other.low);
  high = std::max(high, other.high);
  slope = std::max(slope, other.slope);
  bend = std::max(bend, other.bend);
}

VariationGrid VariationGrid::of(const AmrHierarchy& h, int field, const ValueUnits& units) {
  const LeapGrid frame = LeapGrid::over(h);
  if (frame.empty()) return {};
  tbb::enumerable_thread_specific<Blocks> of_threads(frame);
  for (int level = 0; level < h.level_count(); ++level) {
    const std::vector<PatchPart> parts = patch_parts(h.patches(level));
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, parts.size(), 1), [&](const auto& range) {
      for (std::size_t i = range.begin(); i != range.end(); ++i)
        cover_with_part(h, field, units, level, parts[i], of_threads.local());
    });
  }
  Blocks all(frame);
  for (const Blocks& blocks : of_threads) all.add(blocks);
  return {frame.shift, frame.blocks, std::move(all.of_blocks())};
}

}  // namespace amrtex
