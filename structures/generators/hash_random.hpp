// Random numbers that depend on what they are for and not on the order in which
// they are drawn, so that parallel generators give the same mesh at any thread count.
#pragma once

#include <cstdint>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
constexpr std::uint64_t mix_bits(std::uint64_t v) {
  v += 0x9e3779b97f4a7c15u;
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

/// The upper 53 bits as a number in [0, 1).
constexpr double unit_interval(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }

/// In [0, 1), of one cell or block of one level; `stream` keeps different uses of a seed apart.
inline double cell_random(std::uint64_t seed, std::uint64_t stream, int level, const Vec3i& cell) {
  std::uint64_t h = mix_bits(mix_bits(seed) + stream);
  h = mix_bits(h + static_cast<std::uint64_t>(level));
  for (int a = 0; a < 3; ++a) h = mix_bits(h + static_cast<std::uint32_t>(cell[a]));
  return unit_interval(h);
}

}  // namespace amrtex
