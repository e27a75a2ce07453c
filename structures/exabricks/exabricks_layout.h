// Shared by exabricks.cpp and exabricks.glsl.
//
// A node of the tree over the regions, two words:
//
//   word 0   31  30 29                                          0
//            [axis ][ first child                                ]   0: a leaf, since the root is node 0
//   word 1   inner node: the plane, in finest cells; leaf: the region, or AMRTEX_EXA_NO_REGION where there is no mesh
//
// A region, AMRTEX_EXA_REGION_WORDS words: its brick; its first piece; then
//
//            31     30       29      24 23    22        0
//            [plain][missing][ level   ][ own ][ pieces  ]
//
// and its coded value range, where regions are skipped. `plain`: its brick's texels give f as they stand. `own`: they give
// the values of its first piece, without clamping.
//
// A brick, two times four words: its lower corner in finest cells and its level; unused, unused, the texel of its first cell
// (x in the lowest bits, then y, then z) and its cells along x, y and z in 10 bits each.
//
// A piece, four words: its first texel and its cells as above; where the region's lower corner lies from the piece's, in
// cell widths of the region plus 2^15, 16 bits an axis; its level in the upper half of the last word.
#define AMRTEX_EXA_CHILD_BITS 30
#define AMRTEX_EXA_NO_REGION 0xffffffffu
#define AMRTEX_EXA_PIECE_BITS 23
#define AMRTEX_EXA_LEVEL_BITS 6
#define AMRTEX_EXA_OWN_FLAG 0x00800000u
#define AMRTEX_EXA_MISSING_FLAG 0x40000000u
#define AMRTEX_EXA_PLAIN_FLAG 0x80000000u
#define AMRTEX_EXA_SIZE_BITS 10
#define AMRTEX_EXA_OFFSET_BITS 16
// places of the stack of a search for cells: more than the deepest tree has planes above a brick
#define AMRTEX_EXA_STACK 64
