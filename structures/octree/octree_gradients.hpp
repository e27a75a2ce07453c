// Gradients that the layout `rgba8` stores beside its samples.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <vector>

#include "octree_reader.hpp"
#include "octree_windows.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex::oct {

/// Polar angle and azimuth in 8 bits each (octree_layout.h).
inline std::uint32_t direction_code(const Vec3d& g) {
  const double size = glm::length(g);
  if (!(size > 0) || !std::isfinite(size)) return 0;
  constexpr double kPi = std::numbers::pi;
  const auto polar = static_cast<std::uint32_t>(1 + std::lround(std::acos(std::clamp(g.z / size, -1.0, 1.0)) / kPi * 254));
  const auto azimuth = static_cast<std::uint32_t>(std::lround(std::atan2(g.y, g.x) / (2 * kPi) * 256) & 255);
  return (polar << 16) | (azimuth << 8);
}

/// Adds the direction of the central difference of the level values to each leaf.
inline void write_gradients(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree, const TreeReader& reader,
                            HostTexture& nodes) {
  for (int level = 0; level < h.level_count(); ++level) {
    const int shift = std::countr_zero(static_cast<unsigned>(h.cell_width(level)));
    const std::vector<PatchPart> parts = patch_parts(h.patches(level));
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      const Box wide = parts[k].box.grown(1);
      const Box& patch = h.patches(level)[parts[k].patch].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(parts[k].patch));
      std::vector<double> v(static_cast<std::size_t>(wide.cells()));
      filled_level_values(h, request.field, level, wide, v);
      const auto slope = [&](const Vec3i& c, const Vec3i& d) { return v[wide.offset(c + d)] - v[wide.offset(c - d)]; };
      for_each_node_of(tree, reader, shift, parts[k].box, [&](std::int64_t node, const Box& cells) {
        for_each_cell(cells, [&](const Vec3i& c) {
          if (mask[patch.offset(c)] == 0) return;
          const std::uint32_t code = direction_code({slope(c, {1, 0, 0}), slope(c, {0, 1, 0}), slope(c, {0, 0, 1})});
          const Vec3l tree_cell = Vec3l(c) - (tree.root.lower >> static_cast<std::int64_t>(shift));
          nodes.as<std::uint32_t>()[reader.word_texel(8 * node + octant_of(tree_cell, 0))] |= code;
        });
      });
    });
  }
}

}  // namespace amrtex::oct
