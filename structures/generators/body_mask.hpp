// A solid body in a generated mesh: it holds no cells, and its curved surface is cut out with the finest of them.
#pragma once

#include <memory>
#include <optional>

#include "structures/generators/analytic_fields.hpp"
#include "structures/mesh/block_tree.hpp"

namespace amrtex {

/// The body is where an analytic field is above a value. A block is cut where some of its samples, two a cell and axis, are above
/// it and some are not, with a margin of a quarter of a block around it; of the finest level each block is in or out as a whole,
/// by its middle. What lies over a block that is not cut is in or out with it, so a part thinner than half a cell may be missed.
class BodyMask {
 public:
  enum class Place { outside, cut, inside };

  /// The grid must outlive the mask.
  BodyMask(const BlockGrid& grid, const WorldBox& domain, std::unique_ptr<AnalyticField> field, double above);

  Place place(int level, const Vec3i& block) const;

  /// Makes `children`, wanted over `blocks` of a level, those that there must be: all over cut blocks, none inside.
  void fit_children(int level, const BlockList& blocks, BlockList& children) const;

  /// Removes the blocks inside, and those that are cut: the finest blocks over these take their place.
  void carve(BlockTree& tree) const;

 private:
  bool is_cut(int level, const Vec3i& block) const;
  bool above(int level, const Vec3d& cells) const;
  bool middle_inside(int level, const Vec3i& block) const;
  void drop_inside(int level, BlockList& blocks) const;

  const BlockGrid& grid_;
  WorldBox domain_;
  std::unique_ptr<AnalyticField> field_;
  double above_;
  BlockTree cut_;  ///< all levels but the finest
};

/// Reads the key `body`; absent without it. `specification` is the whole one.
std::optional<BodyMask> read_body(SpecReader& reader, const Json& specification, const BlockGrid& grid, const WorldBox& domain);

}  // namespace amrtex
