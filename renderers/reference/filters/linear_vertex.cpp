// Filter `linear_vertex`: trilinear between the 8 vertices of the leaf that holds p.
#include <cmath>

#include "renderers/reference/cell_cache.hpp"
#include "renderers/reference/exact_mean.hpp"
#include "renderers/reference/filter_reference.hpp"

namespace amrtex {
namespace {

/// Values at corners of finest cells (finest space), kept from one look-up to the next; of one thread.
/// A value is a function of the place alone: with m the coarsest level whose leaves touch it, the
/// mean of 8 v_m where it is a corner of level m, else that leaf's own interpolant.
class Vertices {
 public:
  explicit Vertices(const ReferenceField& field) : field_(field) {}

  /// Of a leaf, x fastest.
  std::array<double, 8> of_leaf(const ReferenceLeaf& leaf) {
    std::array<double, 8> values{};
    for (int k = 0; k < 8; ++k)
      values[static_cast<std::size_t>(k)] = value((leaf.cell + corner_offset(k)) * field_.width(leaf.level));
    return values;
  }

 private:
  struct Entry {
    Vec3i vertex{-1};
    double value = 0;
  };

  double value(const Vec3i& vertex) {
    if (const Entry& entry = entry_of(vertex); entry.vertex == vertex) return entry.value;
    const double value = compute(vertex);
    entry_of(vertex) = {vertex, value};
    return value;
  }
  Entry& entry_of(const Vec3i& vertex) { return entries_[CellHash{}(vertex) & (kEntries - 1)]; }
  double compute(const Vec3i& vertex);
  double interpolate(int axis, Vec3i corner, int width, const Vec3d& q);

  static constexpr std::size_t kEntries = std::size_t{1} << 16;
  const ReferenceField& field_;
  std::vector<Entry> entries_ = std::vector<Entry>(kEntries);
};

double Vertices::compute(const Vec3i& vertex) {
  const AmrHierarchy& h = field_.hierarchy();
  ReferenceLeaf coarsest;
  ReferenceLeaf leaf;
  for (int k = 0; k < 8; ++k) {
    const Vec3i cell = vertex - corner_offset(k);
    if (!h.domain(h.finest_level()).contains(cell)) continue;
    leaf = field_.find_leaf(cell, leaf);
    if (leaf.level >= 0 && !std::isnan(leaf.value) && (coarsest.level < 0 || leaf.level < coarsest.level)) coarsest = leaf;
  }
  if (coarsest.level < 0) return std::numeric_limits<double>::quiet_NaN();
  const int w = field_.width(coarsest.level);
  const Vec3i corner = vertex / w;
  if (corner * w != vertex) return interpolate(2, coarsest.cell * w, w, Vec3d(vertex - coarsest.cell * w) / Vec3d(w));
  ExactMean mean;
  const auto around = field_.dual_cell(coarsest.level, corner - Vec3i(1));
  for (const double v : around.values) mean.add(v);
  return mean.value();
}

/// Linear along `axis` and the axes below, from the corners that have weight alone: what
/// lies on a face or edge depends on that face's or edge's vertices.
double Vertices::interpolate(int axis, Vec3i corner, int width, const Vec3d& q) {
  if (axis < 0) return value(corner);
  Vec3i upper = corner;
  upper[axis] += width;
  if (q[axis] == 0) return interpolate(axis - 1, corner, width, q);
  if (q[axis] == 1) return interpolate(axis - 1, upper, width, q);
  const double a = interpolate(axis - 1, corner, width, q);
  const double b = interpolate(axis - 1, upper, width, q);
  return a + (b - a) * q[axis];
}

class VertexPoints final : public FilterPoints {
 public:
  explicit VertexPoints(const ReferenceField& field) : FilterPoints(field), vertices_(field) {}
  double value(const ReferenceLeaf& leaf, const FinestPosition& p) override {
    return Trilinear::through(vertices_.of_leaf(leaf))(place_in_cell(p, field().width(leaf.level)));
  }
  std::optional<Vec3d> derivative(const ReferenceLeaf& leaf, const FinestPosition& p) override {
    const int width = field().width(leaf.level);
    Slope slope;
    slope.add(Trilinear::through(vertices_.of_leaf(leaf)), place_in_cell(p, width), width);
    return slope.derivative;
  }

 private:
  Vertices vertices_;
};

class VertexPieces final : public FilterPieces {
 public:
  explicit VertexPieces(const ReferenceField& field) : FilterPieces(field), vertices_(field) {}
  bool locate(RayFront& front) override {
    if (!front.enter_leaf()) return false;
    const ReferenceLeaf& leaf = front.leaf();
    TrilinearCell& cell = cells_.at(leaf.level, leaf.cell);
    if (cell.level != leaf.level || cell.cell != leaf.cell) {
      const auto values = vertices_.of_leaf(leaf);
      const auto [lower, upper] = bounds(values);
      cell = {leaf.level, leaf.cell, false, Trilinear::through(values), lower, upper};
    }
    cell_ = &cell;
    return true;
  }
  PieceFunction function(const RayFront& front, double from, double to) const override {
    const double width = field().width(cell_->level);
    PieceFunction f;
    f.base = cell_->f.coefficients[0];
    f.numerator = front.rise_along(cell_->f, Vec3d(cell_->cell) * width, width, from, to);
    f.lower = cell_->lower;
    f.upper = cell_->upper;
    return f;
  }

 private:
  Vertices vertices_;
  CellCache<TrilinearCell> cells_;
  const TrilinearCell* cell_ = nullptr;  // of the piece
};

}  // namespace

std::unique_ptr<FilterReference> make_linear_vertex_reference(const AmrHierarchy& hierarchy, int field,
                                                              const FilterDefinition& definition) {
  return std::make_unique<PlainFilterReference<VertexPoints, VertexPieces>>(hierarchy, field, definition);
}

}  // namespace amrtex
