// Blocks of a level joined into boxes of mixed sizes, as AMR codes make their patches.
#pragma once

#include <vector>

#include "structures/mesh/block_tree.hpp"

namespace amrtex {

struct ClusterRules {
  int longest_edge = 1;   ///< of a box, blocks
  double efficiency = 1;  ///< least share of a box that is blocks which were given, in (0, 1]
};

/// Boxes, in blocks, that hold all of the given blocks; below an efficiency of 1 others too between them. Boxes do not overlap.
/// After M. Berger and I. Rigoutsos, An algorithm for point clustering and grid generation (IEEE Transactions on Systems, Man and
/// Cybernetics 21(5), 1991): a box that is not full enough is cut where no block lies (nearest to its middle), else where the
/// number of blocks a layer changes most, else in the middle. `blocks` in any order, each once; the boxes come in ascending order
/// of their lower corners' x, then y, then z.
std::vector<Box> cluster_blocks(BlockList blocks, const ClusterRules& rules);

/// The boxes of every level of a tree. Blocks that boxes hold beside the tree's are added to it, with what its own
/// rules then ask for; no holes and no skipped levels may be there below an efficiency of 1.
std::vector<std::vector<Box>> cluster_tree(const BlockGrid& grid, const TreeRules& tree_rules, const ClusterRules& rules,
                                           BlockTree& tree);

}  // namespace amrtex
