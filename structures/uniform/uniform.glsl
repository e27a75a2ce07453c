// uniform: locate() is arithmetic, fetch_value() one fetch of a dense texture.
#include "uniform/uniform_layout.h"
DEFINE_INT(AMRTEX_DENSE_LEVEL)     // the level that the texture holds
DEFINE_INT(AMRTEX_DENSE_BORDER)    // 1 where the texture holds the cells round the domain, else 0
DEFINE_INT(AMRTEX_DENSE_VERTICES)  // 1 where texels are vertices, 0 where they are cells

VALUE_TEXTURES(tex_dense, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)
UNIFORM(ivec3, u_dense_cells)   // cells of the level
UNIFORM(ivec3, u_dense_blocks)  // regions along each axis
#if AMRTEX_CPP || AMRTEX_VALIDITY
BUFFER(uint, dense_validity, dense_validity_block)  // one bit a cell, x fastest; each field from a new word
#endif
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
BUFFER(uint, dense_ranges, dense_ranges_block)  // coded value range a block
#endif

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
BUFFER(uint, dense_more_ranges, dense_more_ranges_block)  // those of the further fields, side by side

vec2r fetch_range(IN(Region) r, IN(int) field) {
  ivec3 block = ivec3(r.handle.x, r.handle.y, r.handle.z) / AMRTEX_DENSE_BLOCK;
  int index = block.x + u_dense_blocks.x * (block.y + u_dense_blocks.y * block.z);
  return decode_field_range(dense_more_ranges[index * (AMRTEX_FIELDS - 1) + field - 1], field);
}
#endif

// Where q = 0 lies in the texture, in texels: a cell's centre is its texel's; a vertex sits on the corner, half a texel from its own.
vec3r dense_first_texel(IN(ivec3) first) {
  return vec3r(first + ivec3(AMRTEX_DENSE_BORDER)) + (AMRTEX_DENSE_VERTICES != 0 ? vec3r(0.5) : vec3r(0));
}

bool locate(IN(Position) p, OUT(Region) r) {
  r.level = AMRTEX_DENSE_LEVEL;
  r.width = level_width(AMRTEX_DENSE_LEVEL);
  r.lower = ivec3(0);
  r.upper = u_domain_cells;
  r.value_range = vec2r(0);
  r.handle = ivec4(0);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  r.texture_scale = vec3r(1) / vec3r(u_dense_cells + ivec3(2 * AMRTEX_DENSE_BORDER + AMRTEX_DENSE_VERTICES));
  r.texture_lower = dense_first_texel(ivec3(0)) * r.texture_scale;
#endif
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
  if (AMRTEX_VALUE_RANGES != 0) {
    ivec3 block = divide_by_width(p.cell, r.width) / AMRTEX_DENSE_BLOCK;
    int block_width = AMRTEX_DENSE_BLOCK * r.width;
    r.lower = block * block_width;
    r.upper = min(r.lower + ivec3(block_width), u_domain_cells);
    ivec3 first = block * AMRTEX_DENSE_BLOCK;
    r.handle = ivec4(first.x, first.y, first.z, 0);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
    r.texture_lower = dense_first_texel(first) * r.texture_scale;
#endif
    uint code = dense_ranges[block.x + u_dense_blocks.x * (block.y + u_dense_blocks.y * block.z)];
    r.value_range = decode_range(code);
    return code != AMRTEX_NO_RANGE;
  }
#endif
  return true;
}

real dense_texel(IN(int) field, IN(ivec3) cell) {
  ivec3 last = u_dense_cells + ivec3(2 * AMRTEX_DENSE_BORDER + AMRTEX_DENSE_VERTICES - 1);
  return texelFetch(tex_dense[field], clamp(cell + ivec3(AMRTEX_DENSE_BORDER), ivec3(0), last), 0).x;
}

#if AMRTEX_CPP || AMRTEX_VALIDITY
bool dense_has_value(IN(int) field, IN(ivec3) cell) {
  ivec3 c = clamp(cell, ivec3(0), u_dense_cells - ivec3(1));
  uint bit = uint(c.x) + uint(u_dense_cells.x) * (uint(c.y) + uint(u_dense_cells.y) * uint(c.z));
  uint last = uint(u_dense_cells.x) * uint(u_dense_cells.y) * uint(u_dense_cells.z) - 1u;
  uint first_word = uint(field) * ((last >> 5u) + 1u);
  return ((dense_validity[first_word + (bit >> 5u)] >> (bit & 31u)) & 1u) != 0u;
}
#endif

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  ivec3 first = ivec3(r.handle.x, r.handle.y, r.handle.z);
#if AMRTEX_CPP || AMRTEX_VALIDITY
  if (AMRTEX_VALIDITY != 0 && !dense_has_value(field, first + ivec3(floor(q)))) return no_value();
#endif
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) return decode_value(dense_texel(field, first + ivec3(floor(q))), field);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  return decode_value(textureLod(tex_dense[field], r.texture_lower + q * r.texture_scale, 0.0).x, field);
#else
  PRECISE vec3r from_first = AMRTEX_DENSE_VERTICES != 0 ? q : q - vec3r(0.5);
  vec3r whole = floor(from_first);
  vec3r f = from_first - whole;
  ivec3 i = first + ivec3(whole);
  return decode_value(trilinear(dense_texel(field, i), dense_texel(field, i + ivec3(1, 0, 0)), dense_texel(field, i + ivec3(0, 1, 0)),
                                dense_texel(field, i + ivec3(1, 1, 0)), dense_texel(field, i + ivec3(0, 0, 1)),
                                dense_texel(field, i + ivec3(1, 0, 1)), dense_texel(field, i + ivec3(0, 1, 1)),
                                dense_texel(field, i + ivec3(1, 1, 1)), f), field);
#endif
}
