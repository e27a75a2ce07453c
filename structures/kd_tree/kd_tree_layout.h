// Shared by kd_tree.cpp and kd_tree.glsl.
//
// A node of the tree, two words of 32 bits (Kaehler & Abel 2013, section 3.3):
//
//   word 0   31  30 29     24 23                                0
//            [axis ][ level  ][ first child                      ]   0: a leaf, since the root is node 0
//   word 1   31            20 19                                0
//            [ split          ][ data node                        ]   AMRTEX_KD_NO_DATA: nothing is drawn here
//
//   The second child is the node after the first. `split` is where the plane lies, in cells of the node's level from
//   the node's lower corner. The first child is the one below the plane.
//
// A data node, AMRTEX_KD_DATA_WORDS words: where the texel of the node's lower cell (or vertex) lies in the pool or its
// brick, x in the lowest bits, then y and z; then the number of its brick (bindless) or, of a divided pool, texture; then its coded value range, where regions
// are skipped; then its first word of validity bits, where cells may have no value.
//
// With a level of detail, a node's data nodes stand one behind the other, the coarsest first: cells that are refined and
// may be drawn in place of what lies below, then a leaf's own. Each has a word in kd_detail:
//
//   13        12          6 5       0
//   [ last    ][ next     ][ level   ]   next: the coarsest level that takes the cells' place; 2^6: none. last: of the node
//
// A leaf of basis_supports (filter basis) tells its data node in the lower AMRTEX_KD_DATA_BITS bits and its level above them,
// plus 1.
#define AMRTEX_KD_DETAIL_LAST_BIT 13
#define AMRTEX_KD_CHILD_BITS 24
#define AMRTEX_KD_LEVEL_BITS 6
#define AMRTEX_KD_DATA_BITS 20
#define AMRTEX_KD_SPLIT_BITS 12
#define AMRTEX_KD_NO_DATA 0xfffff
