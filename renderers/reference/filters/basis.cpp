// Filter `basis`: the mean of the leaves' values, weighted by hats one cell wide.
#include <cmath>
#include <limits>

#include "renderers/reference/cell_cache.hpp"
#include "renderers/reference/filter_reference.hpp"

namespace amrtex {
namespace {

class BasisPoints final : public FilterPoints {
 public:
  using FilterPoints::FilterPoints;

  double value(const ReferenceLeaf&, const FinestPosition& p) override {
    double numerator = 0;
    double denominator = 0;
    visit(p, [&](const Trilinear& values, const Trilinear& weights, const Vec3d& q, int) {
      numerator += values(q);
      denominator += weights(q);
    });
    return numerator / denominator;
  }

  std::optional<Vec3d> derivative(const ReferenceLeaf&, const FinestPosition& p) override {
    Slope numerator, denominator;
    visit(p, [&](const Trilinear& values, const Trilinear& weights, const Vec3d& q, int width) {
      numerator.add(values, q, width);
      denominator.add(weights, q, width);
    });
    const double f = numerator.value / denominator.value;
    return (numerator.derivative - f * denominator.derivative) / denominator.value;
  }

 private:
  /// Both sums of each level down to the last whose leaves reach p.
  template <class Visit>
  void visit(const FinestPosition& p, Visit&& visit) const {
    for (int level = 0; level < field().hierarchy().level_count(); ++level) {
      const int width = field().width(level);
      const DualPlace place = dual_place(p, width);
      const auto cell = field().basis_cell(level, place.lower);
      visit(Trilinear::through(cell.values), Trilinear::through(cell.weights), place.q, width);
      if (!cell.finer) break;
    }
  }
};

class BasisPieces final : public FilterPieces {
 public:
  using FilterPieces::FilterPieces;

  /// From the coarsest level down to the last whose leaves reach the front: between the dual
  /// planes of all of these the quotient's two sums are polynomials.
  bool locate(RayFront& front) override {
    piece_.clear();
    if (field().has_missing() && !front.enter_leaf()) return false;
    for (int level = 0; level < field().hierarchy().level_count(); ++level) {
      const Vec3i dual = front.dual_index(level);
      const Cell& cell = find_cell(level, dual);
      front.clip_dual(level, dual);
      if (cell.any) piece_.push_back(cell);
      if (!cell.finer) break;
    }
    return true;
  }

  PieceFunction function(const RayFront& front, double from, double to) const override {
    PieceFunction f;
    f.lower = std::numeric_limits<double>::infinity();
    f.upper = -f.lower;
    f.base = piece_.empty() ? 0 : piece_.front().base;
    f.denominator = {};
    for (const Cell& cell : piece_) {
      const double width = field().width(cell.level);
      const Vec3d lower = (Vec3d(cell.cell) + 0.5) * width;
      Cubic weights = front.rise_along(cell.denominator, lower, width, from, to);
      weights.c[0] += cell.denominator.coefficients[0];
      f.denominator += weights;
      f.numerator += front.rise_along(cell.numerator, lower, width, from, to);
      f.numerator.c[0] += cell.numerator.coefficients[0];
      if (cell.base != f.base) f.numerator += weights *= cell.base - f.base;
      f.lower = std::min(f.lower, cell.lower);
      f.upper = std::max(f.upper, cell.upper);
    }
    // all hats of one level add up to 1
    f.rational = f.denominator.c[0] != 1 || f.denominator.c[1] != 0 || f.denominator.c[2] != 0 || f.denominator.c[3] != 0;
    return f;
  }

 private:
  struct Cell {
    int level = -1;
    Vec3i cell{0};
    bool any = false, finer = false;
    Trilinear numerator, denominator;
    double base = 0;  // of the values in the numerator: one of them
    double lower = 0, upper = 0;
  };

  const Cell& find_cell(int level, const Vec3i& cell) {
    Cell& entry = cells_.at(level, cell);
    if (entry.level == level && entry.cell == cell) return entry;
    auto basis = field().basis_cell(level, cell);
    entry = {level, cell, basis.any, basis.finer, {}, Trilinear::through(basis.weights), 0, 0, 0};
    entry.lower = std::numeric_limits<double>::infinity();
    entry.upper = -entry.lower;
    for (std::size_t k = 0; k < 8; ++k) {
      if (basis.weights[k] == 0) continue;
      if (std::isinf(entry.lower)) entry.base = basis.values[k];
      entry.lower = std::min(entry.lower, basis.values[k]);
      entry.upper = std::max(entry.upper, basis.values[k]);
      basis.values[k] -= entry.base;
    }
    entry.numerator = Trilinear::through(basis.values);
    return entry;
  }

  CellCache<Cell> cells_;
  std::vector<Cell> piece_;  // of each level that reaches it
};

}  // namespace

std::unique_ptr<FilterReference> make_basis_reference(const AmrHierarchy& hierarchy, int field,
                                                      const FilterDefinition& definition) {
  return std::make_unique<PlainFilterReference<BasisPoints, BasisPieces>>(hierarchy, field, definition);
}

}  // namespace amrtex
