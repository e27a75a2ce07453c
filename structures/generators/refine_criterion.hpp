// Which parts of a generated mesh are refined.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "structures/generators/analytic_fields.hpp"
#include "structures/mesh/block_tree.hpp"

namespace amrtex {

/// The unit of refinement is the part of a block that one block of the next finer level covers.
class RefineCriterion {
 public:
  virtual ~RefineCriterion() = default;
  /// Sets flags[i] to 1 where block i of `children`, x fastest, is wanted. `children`
  /// lie over one block of `level` and are named by their place in level + 1.
  virtual void mark(int level, const Box& children, std::span<std::uint8_t> flags) const = 0;
};

/// Reads the key `refine`. The grid and the field must outlive the criterion.
std::unique_ptr<RefineCriterion> read_criterion(SpecReader& specification, const BlockGrid& grid, const WorldBox& domain,
                                                const AnalyticField& field, std::uint64_t seed);

/// Blocks of level + 1 that the criterion wants over the given blocks, in any order.
BlockList wanted_children(const BlockGrid& grid, int level, const BlockList& blocks, const RefineCriterion& criterion);

}  // namespace amrtex
