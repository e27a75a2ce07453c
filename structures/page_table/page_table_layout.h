// Shared by page_table.cpp and page_table.glsl.
//
// An entry of the page table (32-bit channels; the second one only where ranges or
// constants exist):
//
//   red    31  30 29     24 23                0
//          [kind ][ level  ][ index            ]   of the page in the pool, or of the sub-table
//   green  page: its coded value range | constant: the value as float bits
//
// The index of a sub-table counts sub-tables where all are alike (two levels), and units
// of AMRTEX_PAGE_NODE_UNIT entries where they stand in a buffer (a tree of tables).
#define AMRTEX_PAGE_ABSENT 0  // no mesh here: neither page nor value
#define AMRTEX_PAGE_STORED 1
#define AMRTEX_PAGE_CONSTANT 2  // all cells and their border have one value
#define AMRTEX_PAGE_SUBTABLE 3  // look on in the next level of the table

#define AMRTEX_PAGE_INDEX_BITS 24
#define AMRTEX_PAGE_LEVEL_BITS 6
#define AMRTEX_PAGE_NODE_UNIT 8
