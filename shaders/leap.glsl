// Empty space in one leap: the domain in blocks of equal cubes, each with its chessboard distance to the nearest block in which
// something may be seen. After Deakin & Knackstedt 2019, Accelerated volume rendering with Chebyshev distance maps. The host makes it
// from the encoding's value ranges and the transfer function (renderers/bindings/leap_bindings.cpp).
DEFINE_INT(AMRTEX_LEAPS)  // one of AMRTEX_LEAPS_... (block_maps.h)

#if AMRTEX_CPP || AMRTEX_LEAPS
BUFFER(uint, leap_distances, leap_distances_block)  // laid out in block_maps.h
UNIFORM(ivec3, u_leap_blocks)  // along each axis
UNIFORM(int, u_leap_shift)     // log2 of a block's edge, finest cells

// What a ray at p may leap over within the domain: the largest cube of hidden blocks about p's, from p's cell on along the direction;
// false where p's own may be seen. Of the region it sets the box alone. `forward`: does the ray move up each axis?
// Regions do not overlap; a leap overlaps regions. Did its box hold what lies behind the ray, rounding might take the ray back on one axis while it
// passes a face of another, and a leap and a region whose faces meet where the ray goes would send it to and fro for ever.
bool leap(IN(Position) p, IN(bvec3) forward, INOUT(Region) r) {
  ivec3 block = p.cell >> u_leap_shift;
  ivec3 up = ivec3(forward);
  uint index = block_index(block, u_leap_blocks);
  if (AMRTEX_LEAPS == AMRTEX_LEAPS_OCTANT) {
    int octant = (forward.x ? 0 : 1) + (forward.y ? 0 : 2) + (forward.z ? 0 : 4);
    index += uint(octant * u_leap_blocks.x * u_leap_blocks.y * u_leap_blocks.z);
  }
  int distance = byte_of(leap_distances[index / AMRTEX_BYTES_IN_WORD], index);
  ivec3 lower = max(block - ivec3(distance - 1), ivec3(0)) << u_leap_shift;
  ivec3 upper = min(min(block + ivec3(distance), u_leap_blocks) << u_leap_shift, u_domain_cells);
  r.lower = p.cell + (lower - p.cell) * (ivec3(1) - up);
  r.upper = p.cell + ivec3(1) + (upper - p.cell - ivec3(1)) * up;
  return distance > 0;
}
#else
bool leap(IN(Position) p, IN(bvec3) forward, INOUT(Region) r) { return false; }
#endif
