// Filter `nearest`: the value of the leaf that holds p.
#include "renderers/reference/filter_reference.hpp"

namespace amrtex {
namespace {

/// Surfaces of `nearest` are faces; so far from one, in finest cells, its two sides are looked at.
constexpr double kFaceDistance = 1.0 / 512;

class NearestPoints final : public FilterPoints {
 public:
  using FilterPoints::FilterPoints;
  double value(const ReferenceLeaf& leaf, const FinestPosition&) override { return leaf.value; }
  std::optional<Vec3d> derivative(const ReferenceLeaf&, const FinestPosition&) override { return std::nullopt; }
  Reach reach(const ReferenceLeaf&, const FinestPosition&) const override {
    const AmrHierarchy& h = field().hierarchy();
    return {kFaceDistance, h.spacing(h.finest_level()) * kFaceDistance};
  }
};

class NearestPieces final : public FilterPieces {
 public:
  using FilterPieces::FilterPieces;
  bool locate(RayFront& front) override { return front.enter_leaf(); }
  PieceFunction function(const RayFront& front, double, double) const override {
    PieceFunction f;
    f.base = f.lower = f.upper = front.leaf().value;
    return f;
  }
};

}  // namespace

std::unique_ptr<FilterReference> make_nearest_reference(const AmrHierarchy& hierarchy, int field,
                                                        const FilterDefinition& definition) {
  return std::make_unique<PlainFilterReference<NearestPoints, NearestPieces>>(hierarchy, field, definition);
}

}  // namespace amrtex
