#include "structures/mesh/vertex_values.hpp"

#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "structures/mesh/level_values.hpp"

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
      patch.values[static_cast<std::size_t>(field)].visit([&](const auto& values) {
        for_each_cell(intersection(patch.box.refined(r), inside), [&](const Vec3i& cell) {
          holding[box.offset(cell)] = std::isnan(values[patch.box.offset(cell / r)]) ? level : coarser;
        });
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

/// Vertices of one level.
struct LevelVertices {
  Box box;
  std::vector<double> values;

  /// The trilinear interpolant of a cell at a vertex of a finer level, whose cells are 1 / `ratio` as wide.
  double interpolate(int ratio, const Vec3i& cell, const Vec3i& vertex) const {
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

/// The vertices of a box and those of coarser levels that they may ask for. Each level is computed once, when it is first
/// met: asked from every finer level anew, the work would double with each level.
class VerticesAndCoarser {
 public:
  VerticesAndCoarser(const AmrHierarchy& h, int field, int level, const Box& vertices)
      : h_(&h), field_(field), reach_(static_cast<std::size_t>(level) + 1, Box{vertices.lower, vertices.lower}) {
    reach_.back() = vertices;
    for (int l = level; l > 0; --l)
      for (int m = 0; m < l; ++m) widen(m, around(l).coarsened(ratio(m, l)));
  }

  void compute(int level, std::span<double> out) {
    const Box& vertices = reach(level);
    const Box cells{vertices.lower - Vec3i(1), vertices.upper};
    std::vector<double> values(static_cast<std::size_t>(cells.cells()));
    filled_level_values(*h_, field_, level, cells, values);
    const std::vector<int> holding = holding_levels(*h_, field_, level, cells);
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
      const int r = ratio(coarsest, level);
      out[i++] = coarsest == level ? mean_around(vertex, cells, values) : coarser(coarsest).interpolate(r, cell / r, vertex);
    });
  }

 private:
  int ratio(int coarse, int fine) const { return h_->cell_width(coarse) / h_->cell_width(fine); }
  Box& reach(int level) { return reach_[static_cast<std::size_t>(level)]; }

  /// The cells of the domain around all vertices of a level.
  Box around(int level) { return intersection({reach(level).lower - Vec3i(1), reach(level).upper}, h_->domain(level)); }

  /// Adds the vertices of these cells.
  void widen(int level, const Box& cells) {
    if (cells.empty()) return;
    Box& box = reach(level);
    const Box more{cells.lower, cells.upper + Vec3i(1)};
    box = box.empty() ? more : Box{glm::min(box.lower, more.lower), glm::max(box.upper, more.upper)};
  }

  const LevelVertices& coarser(int level) {
    const auto [found, fresh] = coarser_.try_emplace(level);
    if (fresh) {
      std::vector<double> values(static_cast<std::size_t>(reach(level).cells()));
      compute(level, values);
      found->second = {reach(level), std::move(values)};
    }
    return found->second;
  }

  const AmrHierarchy* h_;
  int field_;
  std::vector<Box> reach_;  ///< vertices, a level
  std::map<int, LevelVertices> coarser_;
};

}  // namespace

void vertex_values(const AmrHierarchy& h, int field, int level, const Box& vertices, std::span<double> out) {
  VerticesAndCoarser(h, field, level, vertices).compute(level, out);
}

}  // namespace amrtex
