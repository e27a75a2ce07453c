#include "renderers/reference/reference_point.hpp"

#include <cmath>

namespace amrtex {
namespace {

/// Place in a cell of a level, in its widths from its lower corner.
Vec3d place_in_cell(const FinestPosition& p, int width) { return (Vec3d(p.cell % width) + p.fraction) / Vec3d(width); }

struct DualPlace {
  Vec3i lower;  // of the cells between whose centres the position lies
  Vec3d q;      // from that cell's centre, cell widths
};
DualPlace dual_place(const FinestPosition& p, int width) {
  DualPlace place{p.cell / width, place_in_cell(p, width)};
  for (int a = 0; a < 3; ++a) {
    const bool below = place.q[a] < 0.5;
    place.lower[a] -= below ? 1 : 0;
    place.q[a] += below ? 0.5 : -0.5;
  }
  return place;
}

double linear(const ReferenceField& field, int level, const FinestPosition& p) {
  const DualPlace place = dual_place(p, field.width(level));
  return Trilinear::through(field.dual_cell(level, place.lower).values)(place.q);
}

double vertex(const ReferenceField& field, const ReferenceLeaf& leaf, const FinestPosition& p, VertexCache* vertices) {
  return Trilinear::through(field.leaf_vertices(leaf, vertices))(place_in_cell(p, field.width(leaf.level)));
}

/// A function that is linear along each axis, and its derivatives per finest cell.
struct Slope {
  double value = 0;
  Vec3d derivative{0};
  void add(const Trilinear& f, const Vec3d& q, int width) {
    value += f(q);
    for (int a = 0; a < 3; ++a) {
      Vec3d low = q, high = q;
      low[a] = 0;
      high[a] = 1;
      derivative[a] += (f(high) - f(low)) / width;
    }
  }
};

Slope basis_slope(const ReferenceField& field, const FinestPosition& p) {
  Slope numerator, denominator;
  for (int level = 0; level < field.hierarchy().level_count(); ++level) {
    const int width = field.width(level);
    const DualPlace place = dual_place(p, width);
    const auto cell = field.basis_cell(level, place.lower);
    numerator.add(Trilinear::through(cell.values), place.q, width);
    denominator.add(Trilinear::through(cell.weights), place.q, width);
    if (!cell.finer) break;
  }
  const double f = numerator.value / denominator.value;
  return {f, (numerator.derivative - f * denominator.derivative) / denominator.value};
}

Slope linear_slope(const ReferenceField& field, int level, const FinestPosition& p) {
  const DualPlace place = dual_place(p, field.width(level));
  Slope slope;
  slope.add(Trilinear::through(field.dual_cell(level, place.lower).values), place.q, field.width(level));
  return slope;
}

double basis(const ReferenceField& field, const FinestPosition& p) {
  double numerator = 0;
  double denominator = 0;
  for (int level = 0; level < field.hierarchy().level_count(); ++level) {
    const DualPlace place = dual_place(p, field.width(level));
    const auto cell = field.basis_cell(level, place.lower);
    numerator += Trilinear::through(cell.values)(place.q);
    denominator += Trilinear::through(cell.weights)(place.q);
    if (!cell.finer) break;
  }
  return numerator / denominator;
}

/// Value `cells` finest cells along an axis from p.
std::optional<double> value_beside(const ReferenceField& field, Vec3d p, int axis, double cells, VertexCache* vertices) {
  p[axis] += cells;
  const auto position = position_at(field.hierarchy(), p);
  return position ? value_at(field, *position, vertices) : std::nullopt;
}

/// Surfaces of `nearest` are faces; so far from one, in finest cells, its two sides are looked at.
constexpr double kFaceDistance = 1.0 / 512;

/// Distance to either side of a difference.
struct Difference {
  double cells;  // of the finest level
  Vec3d world;
};

Difference difference_at(const ReferenceField& field, const FinestPosition& p) {
  const AmrHierarchy& h = field.hierarchy();
  const Filter filter = field.definition().filter;
  if (filter == Filter::nearest) return {kFaceDistance, h.spacing(h.finest_level()) * kFaceDistance};
  const int level = filter == Filter::linear_page ? field.page_level(p.cell) : field.find_leaf(p.cell).level;
  return {static_cast<double>(field.width(level)), h.spacing(level)};
}

}  // namespace

std::optional<FinestPosition> position_at(const AmrHierarchy& hierarchy, const Vec3d& p) {
  const Vec3i cells = hierarchy.cells(hierarchy.finest_level());
  FinestPosition position{};
  for (int a = 0; a < 3; ++a) {
    if (!(p[a] >= 0 && p[a] <= cells[a])) return std::nullopt;
    position.cell[a] = std::min(static_cast<int>(std::min(p[a], 2147483647.0)), cells[a] - 1);
    position.fraction[a] = std::min(p[a] - position.cell[a], std::nextafter(1.0, 0.0));
  }
  return position;
}

std::optional<double> value_at(const ReferenceField& field, const FinestPosition& p, VertexCache* vertices) {
  const AmrHierarchy& h = field.hierarchy();
  if (!h.domain(h.finest_level()).contains(p.cell)) return std::nullopt;
  const ReferenceLeaf leaf = field.find_leaf(p.cell);
  if (leaf.level < 0 || std::isnan(leaf.value)) return std::nullopt;
  switch (field.definition().filter) {
    case Filter::nearest:
      return leaf.value;
    case Filter::linear_lod:
      return linear(field, leaf.level, p);
    case Filter::linear_page:
      return linear(field, field.page_level(p.cell), p);
    case Filter::linear_vertex:
      return vertex(field, leaf, p, vertices);
    case Filter::basis:
      return basis(field, p);
  }
  return std::nullopt;
}

std::optional<Vec3d> gradient_at(const ReferenceField& field, const Vec3d& p, VertexCache* vertices) {
  const auto position = position_at(field.hierarchy(), p);
  const auto here = position ? value_at(field, *position, vertices) : std::nullopt;
  if (!here) return std::nullopt;
  const Difference difference = difference_at(field, *position);
  Vec3d gradient(0);
  for (int a = 0; a < 3; ++a) {
    const auto below = value_beside(field, p, a, -difference.cells, vertices);
    const auto above = value_beside(field, p, a, difference.cells, vertices);
    const int sides = (below ? 1 : 0) + (above ? 1 : 0);
    if (sides > 0) gradient[a] = (above.value_or(*here) - below.value_or(*here)) / (sides * difference.world[a]);
  }
  return gradient;
}

std::optional<Vec3d> derivative_at(const ReferenceField& field, const Vec3d& p, VertexCache* vertices) {
  const Filter filter = field.definition().filter;
  if (filter == Filter::nearest) return gradient_at(field, p, vertices);
  const auto position = position_at(field.hierarchy(), p);
  if (!position || !value_at(field, *position, vertices)) return std::nullopt;
  const ReferenceLeaf leaf = field.find_leaf(position->cell);
  Slope slope;
  if (filter == Filter::basis)
    slope = basis_slope(field, *position);
  else if (filter == Filter::linear_vertex)
    slope.add(Trilinear::through(field.leaf_vertices(leaf, vertices)), place_in_cell(*position, field.width(leaf.level)),
              field.width(leaf.level));
  else
    slope = linear_slope(field, filter == Filter::linear_lod ? leaf.level : field.page_level(position->cell), *position);
  const AmrHierarchy& h = field.hierarchy();
  return slope.derivative / h.spacing(h.finest_level());
}

}  // namespace amrtex
