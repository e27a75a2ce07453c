// Shared by uniform.cpp and uniform.glsl.
#define AMRTEX_DENSE_BLOCK 32  // cells along the edge of a region: the unit of skipping
