// Blocks of a level joined into boxes of mixed sizes, as AMR codes make their patches.
#pragma once

#include <vector>

#include "block_tree.hpp"

namespace amrtex {

/// Boxes, in blocks, that hold the given blocks and nothing else, no edge longer than `longest_edge` blocks. After
/// M. Berger and I. Rigoutsos, An algorithm for point clustering and grid generation (IEEE Transactions on Systems,
/// Man and Cybernetics 21(5), 1991), with an efficiency of 1: a box that is not full is cut where no block lies
/// (nearest to its middle), else where the number of blocks a layer changes most, else in the middle.
/// `blocks` in any order, each once; the boxes come in ascending order of their lower corners' x, then y, then z.
std::vector<Box> cluster_blocks(BlockList blocks, int longest_edge);

}  // namespace amrtex
