// Shared by exabricks.cpp and exabricks.glsl.
//
// A node of the tree over the regions, two words:
//
//   word 0   31  30 29                                          0
//            [axis ][ first child                                ]   0: a leaf, since the root is node 0
//   word 1   inner node: the plane, in finest cells; leaf: the region, or AMRTEX_EXA_NO_REGION where there is no mesh
//
// A region, two times four words: the texel of its brick's first cell (x in the lowest bits, then y, then z); that brick's cells
// along x, y and z in 10 bits each; its first piece; then
//
//            31     30       29      24 23    22            17 16        0
//            [plain][missing][ level   ][ own ][ brick's level ][ pieces  ]
//
// and the brick's lower corner in finest cells, and its number. Its coded value range is a word of its own, where regions are
// skipped. `plain`: its brick's texels give f as they stand. `own`: they give the values of its first piece, without clamping.
//
// A brick, two times four words, for searches: its lower corner in finest cells and its level; unused, unused, the texel of its
// first cell and its cells as above.
//
// A piece, four words: its first texel and its cells as above; where the region's lower corner lies from the piece's, in
// cell widths of the region plus 2^15, 16 bits an axis; its level in the upper half of the last word.
#define AMRTEX_EXA_CHILD_BITS 30
#define AMRTEX_EXA_NO_REGION 0xffffffffu
#define AMRTEX_EXA_PIECE_BITS 17
#define AMRTEX_EXA_LEVEL_BITS 6
#define AMRTEX_EXA_OWN_FLAG 0x00800000u
#define AMRTEX_EXA_MISSING_FLAG 0x40000000u
#define AMRTEX_EXA_PLAIN_FLAG 0x80000000u
#define AMRTEX_EXA_SIZE_BITS 10
#define AMRTEX_EXA_OFFSET_BITS 16
