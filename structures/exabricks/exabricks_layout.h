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
//            31     30      29      24 23        0
//            [plain][missing][ level   ][ pieces  ]
//
// and its coded value range, where regions are skipped.
//
// A piece (and a brick, which stands before all pieces under its own number), two times four words: the lower corner in
// finest cells and the level; the texel of its first cell in the pool and its cells along x, y, z in 10 bits each.
#define AMRTEX_EXA_CHILD_BITS 30
#define AMRTEX_EXA_NO_REGION 0xffffffffu
#define AMRTEX_EXA_PIECE_BITS 24
#define AMRTEX_EXA_LEVEL_BITS 6
#define AMRTEX_EXA_MISSING_FLAG 0x40000000u
#define AMRTEX_EXA_PLAIN_FLAG 0x80000000u
#define AMRTEX_EXA_SIZE_BITS 10
// places of the stack of a search for cells: more than the deepest tree has planes above a brick
#define AMRTEX_EXA_STACK 64
