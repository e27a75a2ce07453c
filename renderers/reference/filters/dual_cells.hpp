// Trilinear between the centres of 8 cells of one level, which `linear_lod` and `linear_page` are once they know the level.
#pragma once

#include "renderers/reference/cell_cache.hpp"
#include "renderers/reference/filter_reference.hpp"

namespace amrtex {

class DualPoints : public FilterPoints {
 public:
  using FilterPoints::FilterPoints;

 protected:
  double value_of(int level, const FinestPosition& p) const {
    const DualPlace place = dual_place(p, field().width(level));
    return Trilinear::through(field().dual_cell(level, place.lower).values)(place.q);
  }
  Vec3d derivative_of(int level, const FinestPosition& p) const {
    const DualPlace place = dual_place(p, field().width(level));
    Slope slope;
    slope.add(Trilinear::through(field().dual_cell(level, place.lower).values), place.q, field().width(level));
    return slope.derivative;
  }
};

class DualPieces : public FilterPieces {
 public:
  using FilterPieces::FilterPieces;
  PieceFunction function(const RayFront& front, double from, double to) const override {
    const double width = field().width(cell_->level);
    PieceFunction f;
    f.base = cell_->f.coefficients[0];
    f.numerator = front.rise_along(cell_->f, (Vec3d(cell_->cell) + 0.5) * width, width, from, to);
    f.lower = cell_->lower;
    f.upper = cell_->upper;
    return f;
  }

 protected:
  /// Between whose centres the front lies.
  const TrilinearCell& find_cell(const RayFront& front, int level) {
    const Vec3i dual = front.dual_index(level);
    TrilinearCell& entry = cells_.at(level, dual);
    if (entry.level != level || entry.cell != dual) {
      const auto found = field().dual_cell(level, dual);
      const auto [lower, upper] = bounds(found.values);
      entry = {level, dual, found.all_leaves, Trilinear::through(found.values), lower, upper};
    }
    cell_ = &entry;
    return entry;
  }

 private:
  CellCache<TrilinearCell> cells_;
  const TrilinearCell* cell_ = nullptr;  // of the piece
};

}  // namespace amrtex
