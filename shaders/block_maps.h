// Shared by the host's maps of blocks (renderers/bindings/leap_bindings.cpp, plan_bindings.cpp) and their shaders (leap.glsl, plan.glsl).
//
// A map holds a byte for each block of a grid of equal cubes over the domain: blocks x fastest, map after map, four bytes a word:
//
//   31     24 23     16 15      8 7       0
//   [ 4 i+3 ][ 4 i+2 ][ 4 i+1 ][ 4 i     ]
#define AMRTEX_BYTES_IN_WORD 4
#define AMRTEX_BYTE_SHIFT(index) (8 * ((index) % AMRTEX_BYTES_IN_WORD))

// leap_distances: to the nearest block in which something may be seen, 0 there. Values of AMRTEX_LEAPS:
#define AMRTEX_LEAPS_NONE 0
#define AMRTEX_LEAPS_CUBE 1    // one map: what lies behind a ray stops it as well
#define AMRTEX_LEAPS_OCTANT 2  // eight maps, one for each octant of directions

// planned_steps: code c is a step of 2^(c / AMRTEX_PLAN_CODES_AN_OCTAVE - AMRTEX_PLAN_OCTAVES_BELOW_ONE) units of ray length.
#define AMRTEX_PLAN_CONSTANT 255  // in this block one interval is exact, however long
#define AMRTEX_PLAN_CODES_AN_OCTAVE 8
#define AMRTEX_PLAN_OCTAVES_BELOW_ONE 4
