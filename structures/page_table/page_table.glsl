// page_table: one table look-up a region and level of the table, one filtered fetch a sample and field.
#include "page_table/page_table_layout.h"
DEFINE_INT(AMRTEX_PAGE_SIZE)          // cells along the edge of a page, a power of two
DEFINE_INT(AMRTEX_PAGE_BORDER)        // texels between the lower face of a page and its first value
DEFINE_INT(AMRTEX_PAGE_EDGE)          // texels along the edge of a stored page
DEFINE_INT(AMRTEX_PAGE_NODES)         // 1 where texels are vertices, 0 where they are cells
DEFINE_INT(AMRTEX_PAGE_CONSTANTS)     // 1 where constant pages exist, else 0
DEFINE_INT(AMRTEX_PAGE_TABLE_LEVELS)  // look-ups that find a page, at most
DEFINE_INT(AMRTEX_PAGE_TABLE_TREE)    // 1 where sub-tables form a tree in a buffer, 0 where the second level is a texture
DEFINE_INT(AMRTEX_PAGE_ENTRY_WORDS)   // channels of an entry, 1 or 2
DEFINE_INT(AMRTEX_POOL_TEXTURES)      // textures that the pool of a field is divided over
DEFINE_INT(AMRTEX_POOL_X)             // texels of each along x
DEFINE_INT(AMRTEX_POOL_Y)             // along y
DEFINE_INT(AMRTEX_POOL_Z)             // along z

INTEGER_TEXTURE(tex_page_table)
#if AMRTEX_CPP || AMRTEX_PAGE_TABLE_TREE
BUFFER(uint, page_nodes, page_nodes_block)     // entries of sub-tables, x fastest
BUFFER(uvec2, page_stages, page_stages_block)  // a level of the tree below the first: width of an entry, finest cells; entries along an edge
#endif
#if AMRTEX_CPP || (AMRTEX_PAGE_TABLE_LEVELS == 2 && !AMRTEX_PAGE_TABLE_TREE)
INTEGER_TEXTURE(tex_page_subtables)
UNIFORM(ivec3, u_subtable)        // x: entries along an edge; y: width of an entry, finest cells; z: unused
UNIFORM(ivec3, u_subtable_shift)  // log2 of sub-tables along x and y of their texture
#endif
VALUE_TEXTURES(tex_pages, AMRTEX_FIELDS * AMRTEX_POOL_TEXTURES, AMRTEX_MOST_FIELDS * AMRTEX_MOST_POOL_TEXTURES)  // field by field, part by part
UNIFORM(ivec3, u_page_table)     // x: width of an entry of the first level, finest cells
UNIFORM(ivec3, u_pool_shift)     // log2 of pages along x and y of a texture of the pool
#if AMRTEX_CPP || AMRTEX_POOL_TEXTURES > 1
UNIFORM(ivec3, u_pool_pages)     // x: pages in a texture of the pool
#endif
#if AMRTEX_CPP || AMRTEX_VALIDITY
BUFFER(uint, page_validity, page_validity_block)  // one bit a cell, each field of each page from a new word
#endif

// Position of block `index` in a texture that holds 2^shift.x by 2^shift.y by n blocks.
ivec3 page_pool_position(IN(int) index, IN(ivec3) shift) {
  return ivec3(index & ((1 << shift.x) - 1), (index >> shift.x) & ((1 << shift.y) - 1), index >> (shift.x + shift.y));
}

int page_entry_kind(IN(uint) red) { return int(red >> uint(AMRTEX_PAGE_INDEX_BITS + AMRTEX_PAGE_LEVEL_BITS)); }
int page_entry_level(IN(uint) red) { return int((red >> uint(AMRTEX_PAGE_INDEX_BITS)) & uint((1 << AMRTEX_PAGE_LEVEL_BITS) - 1)); }
int page_entry_index(IN(uint) red) { return int(red & uint((1 << AMRTEX_PAGE_INDEX_BITS) - 1)); }

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
BUFFER(uint, page_more_ranges, page_more_ranges_block)  // coded ranges of the further fields, those of a page side by side

vec2r fetch_range(IN(Region) r, IN(int) field) {
  return decode_field_range(page_more_ranges[r.handle.w * (AMRTEX_FIELDS - 1) + field - 1], field);
}
#endif

#if AMRTEX_CPP || AMRTEX_PAGE_TABLE_TREE
// From an entry of the first level, of `width` from `corner` (finest), down to the one that is no sub-table.
void page_descend(IN(ivec3) cell, INOUT(uvec4) entry, INOUT(ivec3) corner, INOUT(int) width) {
  int stage = 0;
  if (page_entry_kind(entry.x) == AMRTEX_PAGE_SUBTABLE) {
    do {
      uvec2 below = page_stages[stage];
      int edge = int(below.y);
      width = int(below.x);
      ivec3 s = divide_by_width(cell - corner, width);
      corner += s * width;
      int i = AMRTEX_PAGE_ENTRY_WORDS * (page_entry_index(entry.x) * AMRTEX_PAGE_NODE_UNIT + s.x + edge * (s.y + edge * s.z));
      entry.x = page_nodes[i];
      if (AMRTEX_PAGE_ENTRY_WORDS > 1) entry.y = page_nodes[i + 1];
      stage += 1;
    } while (page_entry_kind(entry.x) == AMRTEX_PAGE_SUBTABLE && stage < AMRTEX_PAGE_TABLE_LEVELS - 1);
  }
}
#endif

bool locate(IN(Position) p, OUT(Region) r) {
  ivec3 t = divide_by_width(p.cell, u_page_table.x);
  uvec4 entry = texelFetch(tex_page_table, t, 0);
#if AMRTEX_CPP || (AMRTEX_PAGE_TABLE_LEVELS == 2 && !AMRTEX_PAGE_TABLE_TREE)
  if (AMRTEX_PAGE_TABLE_LEVELS == 2 && AMRTEX_PAGE_TABLE_TREE == 0 && page_entry_kind(entry.x) == AMRTEX_PAGE_SUBTABLE) {
    ivec3 s = divide_by_width(p.cell - t * u_page_table.x, u_subtable.y);
    entry = texelFetch(tex_page_subtables, page_pool_position(page_entry_index(entry.x), u_subtable_shift) * u_subtable.x + s, 0);
  }
#endif
#if AMRTEX_CPP || AMRTEX_PAGE_TABLE_TREE
  ivec3 corner = t * u_page_table.x;
  int entry_width = u_page_table.x;
  if (AMRTEX_PAGE_TABLE_TREE != 0) page_descend(p.cell, entry, corner, entry_width);
#endif
  int kind = page_entry_kind(entry.x);
  r.level = page_entry_level(entry.x);
  r.width = level_width(r.level);
  // in cells of its level: a page that overhangs the domain may pass 31 bits of finest cells
  ivec3 first = divide_by_width(p.cell, r.width) & ivec3(-AMRTEX_PAGE_SIZE);
  r.lower = first * r.width;
  r.upper = min(first + ivec3(AMRTEX_PAGE_SIZE), divide_by_width(u_domain_cells, r.width)) * r.width;
#if AMRTEX_CPP || AMRTEX_PAGE_TABLE_TREE
  if (AMRTEX_PAGE_TABLE_TREE != 0 && kind == AMRTEX_PAGE_ABSENT) {  // many pages without mesh are passed as one entry
    r.lower = min(r.lower, corner);
    r.upper = max(r.upper, corner + min(ivec3(entry_width), u_domain_cells - corner));
  }
#endif
  r.value_range = vec2r(0);
  int index = page_entry_index(entry.x);
  int in_texture = index;
#if AMRTEX_CPP || AMRTEX_POOL_TEXTURES > 1
  if (AMRTEX_POOL_TEXTURES > 1) {
    r.brick.x = uint(index / u_pool_pages.x);
    in_texture = index % u_pool_pages.x;
  }
#endif
  ivec3 texel = page_pool_position(in_texture, u_pool_shift) * AMRTEX_PAGE_EDGE;
  r.handle = ivec4(texel.x, texel.y, texel.z, index);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  // a cell's centre is its texel's; a vertex sits on the corner, half a texel from its own
  r.texture_scale = vec3r(1.0 / float(AMRTEX_POOL_X), 1.0 / float(AMRTEX_POOL_Y), 1.0 / float(AMRTEX_POOL_Z));
  r.texture_lower = (vec3r(texel) + (AMRTEX_PAGE_NODES != 0 ? vec3r(0.5) : vec3r(AMRTEX_PAGE_BORDER))) * r.texture_scale;
#endif
  if (AMRTEX_VALUE_RANGES != 0) r.value_range = decode_range(entry.y);
  if (AMRTEX_PAGE_CONSTANTS != 0 && kind == AMRTEX_PAGE_CONSTANT) {
    r.handle = ivec4(0, 0, int(entry.y), -1);
    r.value_range = vec2r(as_real(entry.y));
  }
  return kind != AMRTEX_PAGE_ABSENT;
}

#if AMRTEX_CPP || AMRTEX_VALIDITY
bool page_has_value(IN(Region) r, IN(int) field, IN(ivec3) cell) {
  if (r.handle.w < 0) return true;
  ivec3 c = clamp(cell, ivec3(0), ivec3(AMRTEX_PAGE_SIZE - 1));
  int bit = c.x + AMRTEX_PAGE_SIZE * (c.y + AMRTEX_PAGE_SIZE * c.z);
  int words = AMRTEX_PAGE_SIZE * AMRTEX_PAGE_SIZE * AMRTEX_PAGE_SIZE / 32;
  return ((page_validity[(r.handle.w * AMRTEX_FIELDS + field) * words + (bit >> 5)] >> uint(bit & 31)) & 1u) != 0u;
}
#endif

real page_texel(IN(Region) r, IN(int) field, IN(ivec3) texel) {
  real value = real(0);
  AMRTEX_OF_POOL_TEXTURE(t, int(r.brick.x)) value = texelFetch(tex_pages[t * AMRTEX_FIELDS + field], texel, 0).x;
  return value;
}

#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
real page_filtered(IN(Region) r, IN(int) field, IN(vec3r) uvw) {
  real value = real(0);
  AMRTEX_OF_POOL_TEXTURE(t, int(r.brick.x)) value = textureLod(tex_pages[t * AMRTEX_FIELDS + field], uvw, 0.0).x;
  return value;
}
#endif

real page_stored_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  ivec3 page = ivec3(r.handle.x, r.handle.y, r.handle.z);
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) {
    ivec3 cell = clamp(ivec3(floor(q)), ivec3(0), ivec3(AMRTEX_PAGE_SIZE - 1));
    return decode_value(page_texel(r, field, page + cell + AMRTEX_PAGE_BORDER), field);
  }
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  return decode_value(page_filtered(r, field, r.texture_lower + q * r.texture_scale), field);
#else
  PRECISE vec3r from_first = AMRTEX_PAGE_NODES != 0 ? q : q + vec3r(real(AMRTEX_PAGE_BORDER) - real(0.5));
  vec3r whole = clamp(floor(from_first), vec3r(0), vec3r(AMRTEX_PAGE_EDGE - 2));
  vec3r f = from_first - whole;
  ivec3 i = page + ivec3(whole);
  return decode_value(trilinear(page_texel(r, field, i), page_texel(r, field, i + ivec3(1, 0, 0)), page_texel(r, field, i + ivec3(0, 1, 0)),
                                page_texel(r, field, i + ivec3(1, 1, 0)), page_texel(r, field, i + ivec3(0, 0, 1)),
                                page_texel(r, field, i + ivec3(1, 0, 1)), page_texel(r, field, i + ivec3(0, 1, 1)),
                                page_texel(r, field, i + ivec3(1, 1, 1)), f), field);
#endif
}

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if AMRTEX_CPP || AMRTEX_VALIDITY
  if (AMRTEX_VALIDITY != 0 && !page_has_value(r, field, ivec3(floor(q)))) return no_value();
#endif
  if (AMRTEX_PAGE_CONSTANTS != 0 && r.handle.w < 0) return as_real(uint(r.handle.z));
  return page_stored_value(r, field, q);
}
