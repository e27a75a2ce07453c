// Reads the written octree on the host: for its start grid, and to find the nodes that cells of the mesh stand in.
#pragma once

#include <tbb/parallel_for.h>

#include <bit>
#include <cstdint>

#include "octree_shape.hpp"

namespace amrtex::oct {

class TreeReader {
 public:
  TreeReader(const HostTexture& nodes, const Options& options, const Plan& plan)
      : nodes_(nodes), options_(options), plan_(plan) {}

  /// Texel of a slot's own word (layout `rgba8`).
  std::size_t word_texel(std::int64_t slot) const {
    if (plan_.node_buffer) return static_cast<std::size_t>(slot);
    const Vec3i in_node(static_cast<int>(slot & 1), static_cast<int>((slot >> 1) & 1), static_cast<int>((slot >> 2) & 1));
    return Box{Vec3i(0), nodes_.size}.offset(plan_.texture.position(slot >> 3) * 2 + in_node);
  }

  /// Node in a slot; -1 where the slot is no inner one.
  std::int64_t child(std::int64_t slot) const {
    const auto* words = nodes_.as<std::uint32_t>();
    const bool buffer = plan_.node_buffer;
    const Box all{Vec3i(0), nodes_.size};
    const Vec3i position = plan_.texture.position(slot >> 3);
    if (options_.paper_layout) {
      const std::uint32_t word = words[word_texel(slot)];
      if (word >> 24 != AMRTEX_OCTREE_INNER) return -1;
      return (word & 255) | (((word >> 8) & 255) << plan_.texture.shift.x) |
             (((word >> 16) & 255) << (plan_.texture.shift.x + plan_.texture.shift.y));
    }
    const std::uint32_t word = words[buffer ? static_cast<std::size_t>(slot >> 3) : all.offset(position)];
    const std::uint32_t bit = 1U << (slot & 7);
    if ((word & bit) == 0) return -1;
    return (word >> AMRTEX_OCTREE_MASK_BITS) + std::popcount(word & (bit - 1));
  }

 private:
  const HostTexture& nodes_;
  const Options& options_;
  const Plan& plan_;
};

/// Octant of tree-space position `c` among children 2^shift wide.
inline int octant_of(const Vec3l& c, int shift) {
  const Vec3l bit = (c >> static_cast<std::int64_t>(shift)) & std::int64_t{1};
  return static_cast<int>(bit.x | (bit.y << 1) | (bit.z << 2));
}

inline void write_start_grid(const Tree& tree, const TreeReader& reader, const Plan& plan, EncodedField& field) {
  const int shift = tree.level_0_shift + plan.start_shift;
  auto* entries = field.find("octree_start")->as<std::uint32_t>();
  auto* slots = plan.start_slots ? field.find("octree_start_slots")->as<std::uint32_t>() : nullptr;
  tbb::parallel_for(0, plan.start.z, [&](int z) {
    for_each_cell({Vec3i(0, 0, z), Vec3i(plan.start.x, plan.start.y, z + 1)}, [&](const Vec3i& g) {
      const Vec3l c = Vec3l(g) << static_cast<std::int64_t>(shift);
      int at = tree.root.shift;
      std::int64_t slot = 0;
      std::int64_t node = 0;
      while (at > shift && node >= 0) {
        slot = 8 * node + octant_of(c, --at);
        node = reader.child(slot);
      }
      const std::size_t i = Box{Vec3i(0), plan.start}.offset(g);
      const auto above = static_cast<std::uint32_t>(node >= 0 ? AMRTEX_OCTREE_START_INNER : at - shift);
      entries[i] = static_cast<std::uint32_t>(node >= 0 ? node : slot) | (above << AMRTEX_OCTREE_SLOT_BITS);
      if (slots != nullptr) slots[i] = static_cast<std::uint32_t>(slot);
    });
  });
}

/// Calls f(node, cells) for each node that has children among the cells of the box (space of the level of width 2^shift).
template <class F>
void for_each_node_of(const Tree& tree, const TreeReader& reader, int shift, const Box& box, F&& f) {
  const Vec3l origin = -tree.root.lower >> static_cast<std::int64_t>(shift);
  const Vec3l first = (Vec3l(box.lower) + origin) >> std::int64_t{1};
  const Vec3l last = (Vec3l(box.upper - Vec3i(1)) + origin) >> std::int64_t{1};
  for_each_cell({Vec3i(0), Vec3i(last - first) + Vec3i(1)}, [&](const Vec3i& p) {
    const Vec3l child = (first + Vec3l(p)) * std::int64_t{2};
    std::int64_t node = 0;
    for (int s = tree.root.shift - 1; s > shift && node >= 0; --s)
      node = reader.child(8 * node + octant_of(child << static_cast<std::int64_t>(shift), s));
    if (node < 0) return;
    const Vec3i lower(child - origin);
    f(node, intersection({lower, lower + Vec3i(2)}, box));
  });
}

}  // namespace amrtex::oct
