// Where a byte of a map of blocks stands, and how it is read.
#include "block_maps.h"

uint block_index(IN(ivec3) block, IN(ivec3) blocks) { return uint(block.x + blocks.x * (block.y + blocks.y * block.z)); }

// Byte number `index` of a map, from the word that holds it.
int byte_of(IN(uint) word, IN(uint) index) { return int((word >> AMRTEX_BYTE_SHIFT(index)) & 255u); }
