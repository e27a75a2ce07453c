#include "vertex_values.hpp"

#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "level_values.hpp"

namespace amrtex {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Level of the leaf with a value that holds each cell of the box, x fastest; `level` itself where the cell is
/// stored there, refined, outside, or has no value.
std::vector<int> holding_levels(const AmrHierarchy& h, int field, int level, const Box& box) {
  std::vector<int> holding(static_cast<std::size_t>(box.cells()), level);
  const Box inside = intersection(box, h.domain(level));
  for (int coarser = 0; coarser < level; ++coarser) {
    const int r = h.cell_width(coarser) / h.cell_width(level);
    for (const int k : h.patches_in(coarser, inside.coarsened(r))) {
      const Patch& patch = h.patches(coarser)[static_cast<std::size_t>(k)];
      const auto& values = patch.values[static_cast<std::size_t>(field)];
      for_each_cell(intersection(patch.box.refined(r), inside), [&](const Vec3i& cell) {
        holding[box.offset(cell)] = std::isnan(values[patch.box.offset(cell / r)]) ? level : coarser;
      });
    }
  }
  for (int finer = level; finer < h.level_count(); ++finer) {
    const int r = h.cell_width(level) / h.cell_width(finer);
    for (const int k : h.patches_in(finer, inside.refined(r))) {
      const Box covered = h.patches(finer)[static_cast<std::size_t>(k)].box.coarsened(r);
      for_each_cell(intersection(covered, inside), [&](const Vec3i& cell) { holding[box.offset(cell)] = level; });
    }
  }
  return holding;
}

/// A mean taken about its first value, so that the mean of equal values is that value to the bit.
struct MeanAboutFirst {
  double first = kNone;
  double sum = 0;
  int n = 0;

  void add(double value) {
    if (std::isnan(value)) return;
    if (n++ == 0) first = value;
    sum += value - first;
  }
  double value() const { return n > 0 ? first + sum / n : kNone; }
};

/// Mean of the values of the 8 cells around a vertex; `cells` is their box.
double mean_around(const Vec3i& vertex, const Box& cells, std::span<const double> values) {
  MeanAboutFirst mean;
  for_each_cell({vertex - Vec3i(1), vertex + Vec3i(1)}, [&](const Vec3i& c) { mean.add(values[cells.offset(c)]); });
  return mean.value();
}

/// Vertices of one level, all that a box of finer cells lies between.
struct CoarseVertices {
  int ratio;  ///< of cell widths
  Box box;
  std::vector<double> values;

  CoarseVertices(const AmrHierarchy& h, int field, int level, int finer, const Box& finer_cells)
      : ratio(h.cell_width(level) / h.cell_width(finer)) {
    const Box cells = finer_cells.coarsened(ratio);
    box = {cells.lower, cells.upper + Vec3i(1)};
    values.resize(static_cast<std::size_t>(box.cells()));
    vertex_values(h, field, level, box, values);
  }

  /// The trilinear interpolant of a cell at a vertex of the finer level.
  double interpolate(const Vec3i& cell, const Vec3i& vertex) const {
    const Vec3d f = Vec3d(vertex - cell * ratio) / static_cast<double>(ratio);
    double first = kNone;  // the sum is taken about it: constants are kept to the bit
    double sum = 0;
    for_each_cell({Vec3i(0), Vec3i(2)}, [&](const Vec3i& c) {
      const double w = (c.x != 0 ? f.x : 1 - f.x) * (c.y != 0 ? f.y : 1 - f.y) * (c.z != 0 ? f.z : 1 - f.z);
      if (!(w > 0)) return;
      const double value = values[box.offset(cell + c)];
      if (std::isnan(first)) first = value;
      sum += w * (value - first);
    });
    return first + sum;
  }
};

}  // namespace

void vertex_values(const AmrHierarchy& h, int field, int level, const Box& vertices, std::span<double> out) {
  const Box cells{vertices.lower - Vec3i(1), vertices.upper};
  std::vector<double> values(static_cast<std::size_t>(cells.cells()));
  filled_level_values(h, field, level, cells, values);
  const std::vector<int> holding = holding_levels(h, field, level, cells);
  std::map<int, CoarseVertices> coarser;  // by level, made when first met
  std::size_t i = 0;
  for_each_cell(vertices, [&](const Vec3i& vertex) {
    int coarsest = level;
    Vec3i cell{0};
    for_each_cell({vertex - Vec3i(1), vertex + Vec3i(1)}, [&](const Vec3i& c) {
      const int l = holding[cells.offset(c)];
      if (l >= coarsest) return;
      coarsest = l;
      cell = c;
    });
    if (coarsest == level) {
      out[i++] = mean_around(vertex, cells, values);
      return;
    }
    const auto found = coarser.try_emplace(coarsest, h, field, coarsest, level, intersection(cells, h.domain(level))).first;
    const CoarseVertices& v = found->second;
    out[i++] = v.interpolate(cell / v.ratio, vertex);
  });
}

}  // namespace amrtex
