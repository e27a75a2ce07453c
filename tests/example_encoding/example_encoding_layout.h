// Shared by example_encoding.cpp and example_encoding.glsl.
#define AMRTEX_HASHED_EDGE 4  // cells along the edge of a brick; 64 cells, one bit each in two words

// Where the search for a brick begins: place of the brick among those of its level, and the level.
#define AMRTEX_HASHED_MIX(h) ((h) ^ ((h) >> 15u))
#define AMRTEX_HASHED_START(x, y, z, level)                                                                        \
  AMRTEX_HASHED_MIX(uint(x) * 0x9e3779b1u + uint(y) * 0x85ebca77u + uint(z) * 0xc2b2ae3du + uint(level) * 0x27d4eb2fu)

// Last word of an entry of the table: level in the lower bits, 1 + number of the brick above; 0: no brick.
#define AMRTEX_HASHED_LEVEL_BITS 6
