// Value ranges on a coarse grid, for rays that leap.
#pragma once

#include <algorithm>
#include <bit>

#include "octree_ranges.hpp"
#include "structures/common/leap_grid.hpp"

namespace amrtex::oct {

/// Cells of a patch that lie in one block of the grid, at least one: calls f(them).
template <class F>
void for_each_group(const LeapGrid& grid, const Box& cells, int cell_width, F&& f) {
  const int edge = std::max((1 << grid.shift) / cell_width, 1);
  for_each_cell(cells.coarsened(edge), [&](const Vec3i& group) {
    f(intersection(Box{group, group + Vec3i(1)}.refined(edge), cells));
  });
}

/// Under `nearest`: a leaf's range is its value.
inline void cover_with_leaves(const AmrHierarchy& h, const EncodedField& field, int number, int level, const PatchPart& part,
                              LeapGrid& grid) {
  const Patch& patch = h.patches(level)[part.patch];
  const auto mask = h.leaf_mask(level, static_cast<int>(part.patch));
  const auto& values = patch.values[static_cast<std::size_t>(number)];
  for_each_group(grid, part.box, h.cell_width(level), [&](const Box& cells) {
    ValueRange range;
    for_each_cell(cells, [&](const Vec3i& c) {
      if (mask[patch.box.offset(c)] != 0) range.add(values[patch.box.offset(c)]);
    });
    if (!range.empty()) grid.cover(cells.refined(h.cell_width(level)), encode_range(field, 0, range));
  });
}

/// Of what is drawn first, from the written ranges of nodes where there are any.
inline LeapGrid leap_grid(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const TreeReader& reader,
                          const EncodedField& field) {
  LeapGrid grid = LeapGrid::over(h);
  const HostTexture* codes = field.find("octree_ranges");
  for (int level = 0; level < h.level_count(); ++level) {
    const int shift = std::countr_zero(static_cast<unsigned>(h.cell_width(level)));
    for (const PatchPart& part : patch_parts(h.patches(level))) {
      if (codes == nullptr) {
        cover_with_leaves(h, field, request.field, level, part, grid);
        continue;
      }
      for_each_node_of(tree, reader, shift, part.box, [&](std::int64_t node, const Box& cells) {
        grid.cover(cells.refined(h.cell_width(level)), codes->as<std::uint32_t>()[node]);
      });
    }
  }
  return grid;
}

}  // namespace amrtex::oct
