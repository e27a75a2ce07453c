// Empty space in one leap: the domain in blocks of equal cubes, each with its chessboard distance to the nearest block in which
// something may be seen. After Deakin & Knackstedt 2019, Accelerated volume rendering with Chebyshev distance maps. The host makes it
// from the encoding's value ranges and the transfer function (renderers/bindings/leap_bindings.cpp).
DEFINE_INT(AMRTEX_LEAPS)  // one of the AMRTEX_LEAPS_... below

// the same numbers as enum class Leap (renderers/scene/scene.hpp)
#define AMRTEX_LEAPS_NONE 0
#define AMRTEX_LEAPS_CUBE 1    // one map: what lies behind a ray stops it as well
#define AMRTEX_LEAPS_OCTANT 2  // eight maps, one for each octant of directions

#if AMRTEX_CPP || AMRTEX_LEAPS
BUFFER(uint, leap_distances, leap_distances_block)  // four blocks a word, x fastest, lowest byte first; map after map
UNIFORM(ivec3, u_leap_blocks)  // along each axis
UNIFORM(int, u_leap_shift)     // log2 of a block's edge, finest cells

// The largest cube of hidden blocks about p's, or from p's on along the direction, within the domain; false where p's own may be seen.
// Of the region it sets the box alone. `forward`: does the ray move up each axis?
bool leap(IN(Position) p, IN(bvec3) forward, INOUT(Region) r) {
  ivec3 block = p.cell >> u_leap_shift;
  int index = block.x + u_leap_blocks.x * (block.y + u_leap_blocks.y * block.z);
  if (AMRTEX_LEAPS == AMRTEX_LEAPS_OCTANT) {
    int octant = (forward.x ? 0 : 1) + (forward.y ? 0 : 2) + (forward.z ? 0 : 4);
    index += octant * u_leap_blocks.x * u_leap_blocks.y * u_leap_blocks.z;
  }
  int distance = int((leap_distances[index >> 2] >> uint((index & 3) << 3)) & 255u);
  ivec3 below = ivec3(distance - 1);
  ivec3 above = ivec3(distance);
  if (AMRTEX_LEAPS == AMRTEX_LEAPS_OCTANT) {
    below *= ivec3(1) - ivec3(forward);
    above = ivec3(1) + (above - ivec3(1)) * ivec3(forward);
  }
  r.lower = max(block - below, ivec3(0)) << u_leap_shift;
  r.upper = min(min(block + above, u_leap_blocks) << u_leap_shift, u_domain_cells);
  return distance > 0;
}
#else
bool leap(IN(Position) p, IN(bvec3) forward, INOUT(Region) r) { return false; }
#endif
