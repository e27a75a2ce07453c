#include "renderers/reference/filter_reference.hpp"

namespace amrtex {

FilterPoints::Reach FilterPoints::reach_of(int level) const {
  return {static_cast<double>(field_.width(level)), field_.hierarchy().spacing(level)};
}

FilterPoints::Reach FilterPoints::reach(const ReferenceLeaf& leaf, const FinestPosition&) const { return reach_of(leaf.level); }

}  // namespace amrtex
