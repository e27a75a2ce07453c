// example_encoding: from the finest level up, the brick that would hold the position is looked up in a hash table.
#include "example_encoding/example_encoding_layout.h"
DEFINE_INT(AMRTEX_HASHED_BORDER)  // texels between a brick's face and its neighbour's in the pool

VALUE_TEXTURES(tex_hashed, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)
UNIFORM(ivec3, u_hashed_table)  // x: entries, a power of two; y: entries that a search reads at most
UNIFORM(ivec3, u_hashed_pool)   // bricks of the pool along each axis
BUFFER(uvec4, hashed_table, hashed_table_block)     // place of the brick in its level; level and number
BUFFER(uvec2, hashed_leaves, hashed_leaves_block)   // one bit a cell of a brick: is it a leaf?
#if AMRTEX_CPP || AMRTEX_VALIDITY
BUFFER(uvec2, hashed_validity, hashed_validity_block)  // one bit a cell, those of a brick's fields side by side
#endif
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
BUFFER(uint, hashed_ranges, hashed_ranges_block)  // coded value range a brick
#endif

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
BUFFER(uint, hashed_more_ranges, hashed_more_ranges_block)  // those of the further fields, side by side

vec2r fetch_range(IN(Region) r, IN(int) field) {
  return decode_field_range(hashed_more_ranges[r.handle.w * (AMRTEX_FIELDS - 1) + field - 1], field);
}
#endif

// Number of the brick of this place and level, or -1.
int hashed_brick(IN(ivec3) place, IN(int) level) {
  uvec3 wanted = uvec3(place);
  int i = int(AMRTEX_HASHED_START(place.x, place.y, place.z, level) & uint(u_hashed_table.x - 1));
  for (int step = 0; step < u_hashed_table.y; ++step) {
    uvec4 entry = hashed_table[i];
    if (entry.w == 0u) return -1;
    bool same = entry.x == wanted.x && entry.y == wanted.y && entry.z == wanted.z;
    if (same && int(entry.w & uint((1 << AMRTEX_HASHED_LEVEL_BITS) - 1)) == level) return int(entry.w >> uint(AMRTEX_HASHED_LEVEL_BITS)) - 1;
    i = (i + 1) & (u_hashed_table.x - 1);
  }
  return -1;
}

bool hashed_bit(IN(uvec2) bits, IN(ivec3) cell) {
  int i = cell.x + AMRTEX_HASHED_EDGE * (cell.y + AMRTEX_HASHED_EDGE * cell.z);
  return (((i < 32 ? bits.x : bits.y) >> uint(i & 31)) & 1u) != 0u;
}

// First texel of the brick's own cells.
ivec3 hashed_texel(IN(int) brick) {
  ivec3 place = ivec3(brick % u_hashed_pool.x, brick / u_hashed_pool.x % u_hashed_pool.y, brick / (u_hashed_pool.x * u_hashed_pool.y));
  return place * (AMRTEX_HASHED_EDGE + 2 * AMRTEX_HASHED_BORDER) + ivec3(AMRTEX_HASHED_BORDER);
}

// The whole brick where all of it are leaves, else the one cell.
void hashed_region(IN(ivec3) cell, IN(ivec3) place, IN(int) brick, INOUT(Region) r) {
  uvec2 leaves = hashed_leaves[brick];
  bool whole = leaves.x == 0xffffffffu && leaves.y == 0xffffffffu;
  ivec3 lower = whole ? place * AMRTEX_HASHED_EDGE : cell;
  ivec3 first = lower - place * AMRTEX_HASHED_EDGE;
  r.lower = lower * r.width;
  r.upper = r.lower + ivec3((whole ? AMRTEX_HASHED_EDGE : 1) * r.width);
  r.handle = ivec4(first.x, first.y, first.z, brick);
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
  if (AMRTEX_VALUE_RANGES != 0) r.value_range = decode_range(hashed_ranges[brick]);
#endif
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  r.texture_scale = vec3r(1) / vec3r(u_hashed_pool * (AMRTEX_HASHED_EDGE + 2 * AMRTEX_HASHED_BORDER));
  r.texture_lower = vec3r(hashed_texel(brick) + first) * r.texture_scale;
#endif
}

bool locate(IN(Position) p, OUT(Region) r) {
  r.value_range = vec2r(0);
  r.handle = ivec4(0);
  for (int level = AMRTEX_LEVELS - 1; level >= 0; --level) {
    r.level = level;
    r.width = level_width(level);
    ivec3 cell = divide_by_width(p.cell, r.width);
    ivec3 place = cell / AMRTEX_HASHED_EDGE;
    int brick = hashed_brick(place, level);
    if (brick < 0 || !hashed_bit(hashed_leaves[brick], cell - place * AMRTEX_HASHED_EDGE)) continue;
    hashed_region(cell, place, brick, r);
    return true;
  }
  // a hole, of which no more is known than this cell
  r.level = AMRTEX_LEVELS - 1;
  r.width = 1;
  r.lower = p.cell;
  r.upper = p.cell + ivec3(1);
  return false;
}

real hashed_value(IN(int) field, IN(ivec3) texel) { return texelFetch(tex_hashed[field], texel, 0).x; }

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  ivec3 first = ivec3(r.handle.x, r.handle.y, r.handle.z);
  ivec3 last = (r.upper - r.lower) / r.width - ivec3(1);
  ivec3 own = clamp(ivec3(floor(q)), ivec3(0), last);
#if AMRTEX_CPP || AMRTEX_VALIDITY
  if (AMRTEX_VALIDITY != 0 && !hashed_bit(hashed_validity[r.handle.w * AMRTEX_FIELDS + field], first + own)) return no_value();
#endif
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) return decode_value(hashed_value(field, hashed_texel(r.handle.w) + first + own), field);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  return decode_value(textureLod(tex_hashed[field], r.texture_lower + q * r.texture_scale, 0.0).x, field);
#else
  PRECISE vec3r from_first = q - vec3r(0.5);
  vec3r whole = clamp(floor(from_first), vec3r(-1), vec3r(last));
  vec3r f = from_first - whole;
  ivec3 i = hashed_texel(r.handle.w) + first + ivec3(whole);
  return decode_value(trilinear(hashed_value(field, i), hashed_value(field, i + ivec3(1, 0, 0)), hashed_value(field, i + ivec3(0, 1, 0)),
                                hashed_value(field, i + ivec3(1, 1, 0)), hashed_value(field, i + ivec3(0, 0, 1)),
                                hashed_value(field, i + ivec3(1, 0, 1)), hashed_value(field, i + ivec3(0, 1, 1)),
                                hashed_value(field, i + ivec3(1, 1, 1)), f), field);
#endif
}
