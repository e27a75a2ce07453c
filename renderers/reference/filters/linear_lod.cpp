// Filter `linear_lod`: trilinear in the level values of the level of the leaf that holds p.
#include "renderers/reference/filters/dual_cells.hpp"

namespace amrtex {
namespace {

class LodPoints final : public DualPoints {
 public:
  using DualPoints::DualPoints;
  double value(const ReferenceLeaf& leaf, const FinestPosition& p) override { return value_of(leaf.level, p); }
  std::optional<Vec3d> derivative(const ReferenceLeaf& leaf, const FinestPosition& p) override {
    return derivative_of(leaf.level, p);
  }
};

class LodPieces final : public DualPieces {
 public:
  using DualPieces::DualPieces;
  bool locate(RayFront& front) override {
    if (!front.enter_leaf()) return false;
    const TrilinearCell& cell = find_cell(front, front.leaf().level);
    if (cell.all_leaves) front.open();  // between leaves of one level nothing changes at their faces
    front.clip_dual(cell.level, cell.cell);
    return true;
  }
};

}  // namespace

std::unique_ptr<FilterReference> make_linear_lod_reference(const AmrHierarchy& hierarchy, int field,
                                                           const FilterDefinition& definition) {
  return std::make_unique<PlainFilterReference<LodPoints, LodPieces>>(hierarchy, field, definition);
}

}  // namespace amrtex
