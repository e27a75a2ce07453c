// Leaves of the kD-tree in which the scene's transfer function shows nothing: they keep their place in the tree, so
// that rays step over the same boxes, and lose their data.
#pragma once

#include <tbb/parallel_for.h>

#include <cstdint>
#include <vector>

#include "kd_hats.hpp"
#include "kd_partition.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex::kd {

/// How the values of a leaf are stored.
struct LeafTexels {
  bool vertices = false;  ///< else cells,
  bool hats = false;      ///< those of other leaves that reach in are read too,
  int border = 0;         ///< and so many more around them
  double leak = 0;        ///< what the texture unit may see of other bricks, field units
};

/// Range of all that the filter may read in a leaf. Empty where it has no value.
inline ValueRange leaf_range(const AmrHierarchy& h, int field, const Leaf& leaf, const LeafTexels& texels) {
  constexpr int kChunk = 32;
  ValueRange range;
  std::vector<double> values;
  for_each_cell({Vec3i(0), ceil_div(leaf.cells.size(), kChunk)}, [&](const Vec3i& i) {
    const Vec3i lower = leaf.cells.lower + i * kChunk;
    const Box chunk{lower, glm::min(lower + Vec3i(kChunk), leaf.cells.upper)};
    const Box box = texels.vertices ? Box{chunk.lower, chunk.upper + Vec3i(1)} : chunk.grown(texels.border);
    values.resize(static_cast<std::size_t>(box.cells()));
    if (texels.vertices)
      vertex_values(h, field, leaf.level, box, values);
    else
      filled_level_values(h, field, leaf.level, box, values);
    for (const double v : values) range.add(v);
  });
  if (range.empty()) return range;
  return {range.min - texels.leak, range.max + texels.leak};
}

/// One a leaf: can nothing of it be seen, and is none of it read by leaves that can?
inline std::vector<std::uint8_t> hidden_leaves(const AmrHierarchy& h, const BuildRequest& request, const Tree& tree,
                                               const LeafTexels& texels) {
  const FieldStatistics& s = h.statistics(request.field);
  const StorageScale scale = storage_scale(request.storage, s);
  const double origin = range_origin(s, request.storage, scale);
  std::vector<std::uint8_t> hides(tree.leaves.size());
  std::vector<HatNode> nodes;
  if (texels.hats) nodes = hat_nodes(h, tree);
  tbb::parallel_for(std::size_t{0}, hides.size(), [&](std::size_t i) {
    ValueRange range = leaf_range(h, request.field, tree.leaves[i], texels);
    if (texels.hats && !range.empty()) add_reaching_values(h, request.field, tree, nodes, static_cast<int>(i), range);
    hides[i] = hidden(request.needs, range, origin, request.storage, scale) ? 1 : 0;
  });
  if (texels.hats) keep_read_leaves(h, tree, nodes, hides);
  return hides;
}

/// Takes the data of these leaves; the others keep their order.
inline void remove_leaves(Tree& tree, const std::vector<std::uint8_t>& hides) {
  std::vector<int> new_index(tree.leaves.size(), -1);
  std::vector<Leaf> kept;
  for (std::size_t i = 0; i < hides.size(); ++i) {
    if (hides[i] != 0) continue;
    new_index[i] = static_cast<int>(kept.size());
    kept.push_back(tree.leaves[i]);
  }
  for (Node& n : tree.nodes)
    if (n.leaf >= 0) n.leaf = new_index[static_cast<std::size_t>(n.leaf)];
  tree.leaves = std::move(kept);
}

}  // namespace amrtex::kd
