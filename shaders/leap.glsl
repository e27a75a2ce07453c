// Empty space in one leap: the domain in blocks of equal cubes, each with its chessboard distance to the nearest block in which
// something may be seen. After Deakin & Knackstedt 2019, Accelerated volume rendering with Chebyshev distance maps. The host makes it
// from the encoding's value ranges and the transfer function (renderers/bindings/leap_bindings.cpp).
DEFINE_INT(AMRTEX_LEAPS)  // 1 where rays leap, else 0

#if AMRTEX_CPP || AMRTEX_LEAPS
BUFFER(uint, leap_distances, leap_distances_block)  // four blocks a word, x fastest, lowest byte first
UNIFORM(ivec3, u_leap_blocks)  // along each axis
UNIFORM(int, u_leap_shift)     // log2 of a block's edge, finest cells

// The largest cube of hidden blocks about p's, within the domain; false where p's own may be seen. Of the region it sets the box alone.
bool leap(IN(Position) p, INOUT(Region) r) {
  ivec3 block = p.cell >> u_leap_shift;
  int index = block.x + u_leap_blocks.x * (block.y + u_leap_blocks.y * block.z);
  int distance = int((leap_distances[index >> 2] >> uint((index & 3) << 3)) & 255u);
  r.lower = max(block - ivec3(distance - 1), ivec3(0)) << u_leap_shift;
  r.upper = min(min(block + ivec3(distance), u_leap_blocks) << u_leap_shift, u_domain_cells);
  return distance > 0;
}
#else
bool leap(IN(Position) p, INOUT(Region) r) { return false; }
#endif
