// Distances on a grid of blocks, for rays that leap over what is empty.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// Larger distances count as this.
inline constexpr int kMostDistance = 255;

/// Chessboard (Chebyshev) distance of each block to the nearest one that is `marked`, which has 0; x fastest. What lies outside
/// of the grid is not marked. The two passes over 13 neighbours each of Rosenfeld & Pfaltz 1968 are exact for this distance.
std::vector<std::uint8_t> chessboard_distances(const Vec3i& blocks, std::span<const std::uint8_t> marked);

/// The same to the nearest marked block of one octant: that lies at or behind each block in the direction of the octant along
/// every axis. Bit a of `octant`: the direction is negative along axis a.
std::vector<std::uint8_t> octant_distances(const Vec3i& blocks, std::span<const std::uint8_t> marked, int octant);

}  // namespace amrtex
