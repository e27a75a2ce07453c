// Value ranges of linear_lod: one a node, of everything that its leaves can return.
#pragma once

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/spin_mutex.h>

#include <bit>
#include <vector>

#include "octree_reader.hpp"
#include "octree_windows.hpp"
#include "structures/common/build_tools.hpp"

namespace amrtex::oct {

/// Boxes of cells of a level that finer patches lie on, whether a patch of the level stores them or not.
inline std::vector<Box> refined_parts(const AmrHierarchy& h, int level) {
  std::vector<Box> parts;
  for (int finer = level + 1; finer < h.level_count(); ++finer)
    for (const PatchPart& part : patch_parts(h.patches(finer)))
      parts.push_back(part.box.coarsened(h.cell_width(level) / h.cell_width(finer)));
  return parts;
}

/// Ranges of field number `number` of all nodes.
inline std::vector<ValueRange> ranges_of_nodes(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree,
                                               const TreeReader& reader, int number) {
  std::vector<ValueRange> of_node(static_cast<std::size_t>(tree.nodes));
  tbb::spin_mutex mutex;  // a node may lie over the face between two parts
  tbb::enumerable_thread_specific<WindowRanges> windows;
  const auto add = [&](std::int64_t node, const ValueRange& range) {
    if (range.empty()) return;
    const tbb::spin_mutex::scoped_lock lock(mutex);
    ValueRange& all = of_node[static_cast<std::size_t>(node)];
    all.add(range.min);
    all.add(range.max);
  };
  for (int level = 0; level < h.level_count(); ++level) {
    const int shift = std::countr_zero(static_cast<unsigned>(h.cell_width(level)));
    const std::vector<PatchPart> parts = patch_parts(h.patches(level));
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      const PatchPart& part = parts[k];
      const Box& patch = h.patches(level)[part.patch].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(part.patch));
      WindowRanges& window = windows.local();
      window.read(h, request.field_at(number), level, part.box);
      for_each_node_of(tree, reader, shift, part.box, [&](std::int64_t node, const Box& cells) {
        ValueRange range;
        for_each_cell(cells, [&](const Vec3i& c) {
          if (mask[patch.offset(c)] != 0) window.add_to(range, c);
        });
        add(node, range);
      });
    });
    if (!request.needs.level_of_detail) continue;
    const std::vector<Box> refined = refined_parts(h, level);
    tbb::parallel_for(std::size_t{0}, refined.size(), [&](std::size_t k) {
      WindowRanges& window = windows.local();
      window.read(h, request.field_at(number), level, refined[k]);
      for_each_node_of(tree, reader, shift, refined[k], [&](std::int64_t node, const Box& cells) {
        ValueRange range;
        for_each_cell(cells, [&](const Vec3i& c) { window.add_to(range, c); });
        add(node, range);
      });
    });
  }
  return of_node;
}

inline void write_ranges(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const TreeReader& reader,
                         EncodedField& field) {
  const MoreRanges more(field, "octree_more_ranges");
  for (int number = 0; number < (more.needed() ? field.field_count : 1); ++number) {
    const std::vector<ValueRange> of_node = ranges_of_nodes(h, request, tree, reader, number);
    auto* codes = field.find("octree_ranges")->as<std::uint32_t>();
    tbb::parallel_for(std::size_t{0}, of_node.size(), [&](std::size_t i) {
      if (number == 0) codes[i] = encode_range(of_node[i], field.range_origin, request.storage, field.scale);
      more.set(static_cast<std::int64_t>(i), number, of_node[i]);
    });
  }
}

}  // namespace amrtex::oct
