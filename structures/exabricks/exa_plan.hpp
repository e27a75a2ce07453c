// What is built of a mesh: bricks, regions over them, and where both go.
#pragma once

#include <cstdint>
#include <vector>

#include "bricks.hpp"
#include "bvh.hpp"
#include "exabricks_layout.h"
#include "regions.hpp"
#include "structures/common/brick_packing.hpp"
#include "structures/common/hat_supports.hpp"
#include "structures/common/start_grid.hpp"

namespace amrtex::exa {

inline constexpr int kMiddleOffset = 1 << (AMRTEX_EXA_OFFSET_BITS - 1);

enum class Traversal { grid, kd, bvh };

struct Options {
  int brick_width = 32;
  int border = 1;
  Traversal traversal = Traversal::grid;
  bool cells = false;  ///< each sample searches its cells
  bool hats = false;   ///< filter basis
};

struct Plan {
  BrickTree tree;
  RegionSet set;
  packing::Packing packing;
  StartGrid grid;
  SupportList supports;  ///< of bricks, where samples search them
  std::vector<BvhNode> bvh;
  std::vector<std::int64_t> leaf_region;  ///< of an item of the BVH; -1: no mesh
  std::vector<std::int64_t> first_piece;  ///< of a region, among those that are stored
  std::int64_t stored_pieces = 0;
  bool cells_missing = false;       ///< do bricks hold cells without value?
  bool missing = false;             ///< are there bits that tell so?
  Vec3i texel_bits{0};              ///< of a packed texel
  std::int64_t validity_words = 0;  ///< of one field, that there are or would be
  std::int64_t brick_texels = 0;
  std::int64_t brick_cells = 0;
  /// A plain region needs none, but may turn out to have cells without value.
  bool keeps_pieces(const Options& o, const Region& r) const { return o.hats && !o.cells && (!r.plain || cells_missing); }
  std::int64_t regions() const { return static_cast<std::int64_t>(set.regions.size()); }
  std::int64_t bricks() const { return static_cast<std::int64_t>(tree.bricks.size()); }
};

/// Where the region's lower corner lies from the piece's, in cell widths of the region.
inline Vec3i corner_offset(const AmrHierarchy& h, const Plan& p, const Region& r, const Piece& piece) {
  const Brick& b = p.tree.bricks[static_cast<std::size_t>(piece.brick)];
  return (r.box.lower - piece.cells.lower * b.width) / h.cell_width(r.level);
}

inline std::uint32_t packed_texel(const Plan& p, const Vec3i& texel) {
  return static_cast<std::uint32_t>(texel.x) | static_cast<std::uint32_t>(texel.y) << p.texel_bits.x |
         static_cast<std::uint32_t>(texel.z) << (p.texel_bits.x + p.texel_bits.y);
}

inline std::uint32_t packed_size(const Vec3i& size) {
  return static_cast<std::uint32_t>(size.x) | static_cast<std::uint32_t>(size.y) << AMRTEX_EXA_SIZE_BITS |
         static_cast<std::uint32_t>(size.z) << (2 * AMRTEX_EXA_SIZE_BITS);
}

}  // namespace amrtex::exa
