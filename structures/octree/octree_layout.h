// Shared by octree.cpp and octree.glsl. The children of inner node n have the slots 8 n + i; child i lies
// at (i & 1, (i >> 1) & 1, i >> 2) of the node's box. Node 0 is the root.
//
// Layout `wide`, one 32-bit word a node:
//
//   31                                  8 7       0
//   [ index of the first inner child     | mask    ]   mask bit i: child i is an inner node
//
//   The inner children of a node have consecutive indices, in the order of their bits.
//
// Layout `rgba8`, one 32-bit word (4 x 8 bits) a slot:
//
//   alpha 31   24 blue 23     16 green 15      8 red 7          0
//   [ type       | z             | y            | x              ]   inner: address of the node, in blocks of 2^3 texels
//   [ type       | polar angle   | azimuth      | sample         ]   leaf; the angles only where gradients are needed
//   [ type       | polar angle   | azimuth      | fill           ]   empty: no cell, or one without value
//   Polar angle: 0 no gradient, else 1 + 254 * angle from z / pi. Azimuth: 256 * angle from x / (2 pi).
#define AMRTEX_OCTREE_WIDE 0
#define AMRTEX_OCTREE_RGBA8 1

#define AMRTEX_OCTREE_FAST 0
#define AMRTEX_OCTREE_PAPER 1

#define AMRTEX_OCTREE_EMPTY 0
#define AMRTEX_OCTREE_INNER 1
#define AMRTEX_OCTREE_LEAF 2

#define AMRTEX_OCTREE_MASK_BITS 8
#define AMRTEX_OCTREE_INDEX_BITS 24  // of a node

// An entry of the start grid: the inner node that fills the grid's cell, or the slot of the leaf that
// covers it, as many depths above as the upper bits tell.
//
//   31          27 26                    0
//   [ depths above | slot                  ]   leaf
//   [ 31           | node                  ]   inner node
#define AMRTEX_OCTREE_SLOT_BITS 27
#define AMRTEX_OCTREE_START_INNER 31
