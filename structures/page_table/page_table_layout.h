// Shared by page_table.cpp and page_table.glsl.
//
// An entry of the page table (two 32-bit channels):
//
//   red    page: its index in the pool | constant: the value as float bits | sub-table: its index
//   green  31            16 15      8 7       0
//          [    unused     | kind    | level   ]
#define AMRTEX_PAGE_ABSENT 0    // no mesh here: neither page nor value
#define AMRTEX_PAGE_STORED 1
#define AMRTEX_PAGE_CONSTANT 2  // all cells and their border have one value
#define AMRTEX_PAGE_SUBTABLE 3  // look on in the second level of the table

#define AMRTEX_PAGE_LEVEL_MASK 255
#define AMRTEX_PAGE_KIND_SHIFT 8
