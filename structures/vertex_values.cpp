#include "vertex_values.hpp"

#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "level_values.hpp"

namespace amrtex {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Level of the leaf with a value that holds the cell of `level`; `level` itself where the
/// cell is stored there, refined, or has no value.
int holding_level(const AmrHierarchy& h, int field, int level, const Vec3i& cell) {
  if (!h.domain(level).contains(cell) || h.find_patch(level, cell) >= 0 || h.refined_within(level, {cell, cell + Vec3i(1)}))
    return level;
  for (int coarser = level - 1; coarser >= 0; --coarser) {
    const Vec3i parent = cell / (h.cell_width(coarser) / h.cell_width(level));
    const int patch = h.find_patch(coarser, parent);
    if (patch >= 0) return std::isnan(h.value({coarser, patch, parent}, field)) ? level : coarser;
  }
  return level;
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

double mean_around(const AmrHierarchy& h, int field, int level, const Vec3i& vertex) {
  std::array<double, 8> v{};
  filled_level_values(h, field, level, {vertex - Vec3i(1), vertex + Vec3i(1)}, v);
  MeanAboutFirst mean;
  for (const double value : v) mean.add(value);
  return mean.value();
}

/// Vertices of coarser levels that were asked for in one call. A vertex between levels asks for those of the coarser
/// leaf, and these again: without it the questions double with every level.
using KnownVertices = std::map<std::array<int, 4>, double>;

double vertex_value(const AmrHierarchy& h, int field, int level, const Vec3i& vertex, KnownVertices& known);

double known_vertex_value(const AmrHierarchy& h, int field, int level, const Vec3i& vertex, KnownVertices& known) {
  const std::array<int, 4> key{level, vertex.x, vertex.y, vertex.z};
  if (const auto it = known.find(key); it != known.end()) return it->second;
  return known[key] = vertex_value(h, field, level, vertex, known);
}

/// The trilinear interpolant of leaf `cell` of `level` at a vertex of `fine`.
double interpolate_leaf(const AmrHierarchy& h, int field, int level, const Vec3i& cell, int fine, const Vec3i& vertex,
                        KnownVertices& known) {
  const int r = h.cell_width(level) / h.cell_width(fine);
  const Vec3d f = Vec3d(vertex - cell * r) / static_cast<double>(r);
  double first = kNone;  // the sum is taken about it: constants are kept to the bit
  double sum = 0;
  for_each_cell({Vec3i(0), Vec3i(2)}, [&](const Vec3i& c) {
    const double w = (c.x != 0 ? f.x : 1 - f.x) * (c.y != 0 ? f.y : 1 - f.y) * (c.z != 0 ? f.z : 1 - f.z);
    if (!(w > 0)) return;
    const double value = known_vertex_value(h, field, level, cell + c, known);
    if (std::isnan(first)) first = value;
    sum += w * (value - first);
  });
  return first + sum;
}

double vertex_value(const AmrHierarchy& h, int field, int level, const Vec3i& vertex, KnownVertices& known) {
  int coarsest = level;
  Vec3i cell{0};
  for_each_cell({vertex - Vec3i(1), vertex + Vec3i(1)}, [&](const Vec3i& c) {
    const int l = holding_level(h, field, level, c);
    if (l < coarsest) {
      coarsest = l;
      cell = c / (h.cell_width(l) / h.cell_width(level));
    }
  });
  if (coarsest < level) return interpolate_leaf(h, field, coarsest, cell, level, vertex, known);
  return mean_around(h, field, level, vertex);
}

/// Is every cell of the box that lies in the domain stored at `level`?
bool all_stored(const AmrHierarchy& h, int level, const Box& box) {
  const Box inside = intersection(box, h.domain(level));
  std::int64_t stored = 0;
  for (int k : h.patches_in(level, inside))
    stored += intersection(h.patches(level)[static_cast<std::size_t>(k)].box, inside).cells();
  return stored == inside.cells();
}

}  // namespace

void vertex_values(const AmrHierarchy& h, int field, int level, const Box& vertices, std::span<double> out) {
  const Box cells{vertices.lower - Vec3i(1), vertices.upper};
  if (!all_stored(h, level, cells)) {
    KnownVertices known;
    std::size_t i = 0;
    for_each_cell(vertices, [&](const Vec3i& v) { out[i++] = vertex_value(h, field, level, v, known); });
    return;
  }
  std::vector<double> v(static_cast<std::size_t>(cells.cells()));
  filled_level_values(h, field, level, cells, v);
  std::size_t i = 0;
  for_each_cell(vertices, [&](const Vec3i& vertex) {
    MeanAboutFirst mean;
    for_each_cell({vertex - Vec3i(1), vertex + Vec3i(1)}, [&](const Vec3i& c) { mean.add(v[cells.offset(c)]); });
    out[i++] = mean.value();
  });
}

}  // namespace amrtex
