// kd_tree: a descent a region, one filtered fetch a sample and field, from the pool or from the brick's own texture; with the filter basis each
// sample searches the leaves whose cells' hats reach it. Words: kd_tree_layout.h.
#include "kd_tree/kd_tree_layout.h"
DEFINE_INT(AMRTEX_KD_DEPTH)       // splits from where a descent starts to the deepest leaf
DEFINE_INT(AMRTEX_KD_GRID)        // 1 where descents start from a grid, 0 where from the root
DEFINE_INT(AMRTEX_KD_VERTICES)    // 1 where texels are vertices, 0 where they are cells
DEFINE_INT(AMRTEX_KD_DATA_WORDS)  // words of a data node
DEFINE_INT(AMRTEX_KD_X_BITS)      // bits of x in a packed position
DEFINE_INT(AMRTEX_KD_Y_BITS)      // bits of y
DEFINE_INT(AMRTEX_KD_BINDLESS)    // 1 where each brick has its own texture, 0 where all are in the pool
DEFINE_INT(AMRTEX_KD_NUMBERED)    // 1 where data nodes tell the brick (bindless) or the texture of a divided pool

BUFFER(uvec2, kd_nodes, kd_nodes_block)
BUFFER(uint, kd_data, kd_data_block)
#if AMRTEX_CPP || AMRTEX_KD_GRID
BUFFER(uint, kd_start, kd_start_block)               // a cell of the grid: where the boxes below tell its node
BUFFER(uvec4, kd_start_nodes, kd_start_nodes_block)  // two a node: (lower corner, node), (upper corner, unused)
UNIFORM(ivec3, u_kd_grid)                            // cells of the grid
UNIFORM(ivec3, u_kd_grid_width)                      // x: width of a cell of the grid, finest cells
#endif
#if AMRTEX_CPP || !AMRTEX_KD_BINDLESS
DEFINE_INT(AMRTEX_POOL_TEXTURES)  // textures that the pool of a field is divided over
DEFINE_INT(AMRTEX_POOL_X)  // texels of each along x
DEFINE_INT(AMRTEX_POOL_Y)  // along y
DEFINE_INT(AMRTEX_POOL_Z)  // along z
VALUE_TEXTURES(tex_kd_pool, AMRTEX_FIELDS * AMRTEX_POOL_TEXTURES, AMRTEX_MOST_FIELDS * AMRTEX_MOST_POOL_TEXTURES)  // field by field, part by part
#endif
#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
DEFINE_INT(AMRTEX_HANDLE_TURNS)  // handles that invocations which run together may hold, 1 where a fetch takes different ones
VALUE_TEXTURE_SET(tex_kd_bricks, kd_handles, kd_handles_block)  // AMRTEX_FIELDS textures a brick
#endif
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING && AMRTEX_KD_BINDLESS
BUFFER(uint, kd_brick_sizes, kd_brick_sizes_block)  // last texel of each brick
#endif
#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
BUFFER(uint, kd_detail, kd_detail_block)  // a word a data node: its cells, and what takes their place
#endif
#if AMRTEX_CPP || AMRTEX_VALIDITY
BUFFER(uint, kd_validity, kd_validity_block)  // one bit a cell, each field of each data node from a new word
#endif

#define AMRTEX_BASIS_MISSING AMRTEX_VALIDITY
#define AMRTEX_BASIS_SEARCH (AMRTEX_FILTER == AMRTEX_FILTER_BASIS)
// A leaf's neighbours may be finer.
#define AMRTEX_FINER_HATS (AMRTEX_FILTER == AMRTEX_FILTER_BASIS)
#include "basis.glsl"

int kd_axis(IN(uvec2) node) { return int(node.x >> uint(AMRTEX_KD_CHILD_BITS + AMRTEX_KD_LEVEL_BITS)); }
int kd_level(IN(uvec2) node) { return int((node.x >> uint(AMRTEX_KD_CHILD_BITS)) & uint((1 << AMRTEX_KD_LEVEL_BITS) - 1)); }
int kd_first_child(IN(uvec2) node) { return int(node.x & uint((1 << AMRTEX_KD_CHILD_BITS) - 1)); }
int kd_split(IN(uvec2) node) { return int(node.y >> uint(AMRTEX_KD_DATA_BITS)); }
int kd_data_index(IN(uvec2) node) { return int(node.y & uint((1 << AMRTEX_KD_DATA_BITS) - 1)); }

// Where the descent for a cell starts: a node, whose box r receives.
int kd_begin(IN(ivec3) cell, INOUT(Region) r) {
#if AMRTEX_CPP || AMRTEX_KD_GRID
  if (AMRTEX_KD_GRID != 0) {
    ivec3 g = divide_by_width(cell, u_kd_grid_width.x);
    int start = int(kd_start[g.x + u_kd_grid.x * (g.y + u_kd_grid.y * g.z)]);
    uvec4 lower = kd_start_nodes[start * 2];
    uvec4 upper = kd_start_nodes[start * 2 + 1];
    r.lower = corner_of(lower);
    r.upper = corner_of(upper);
    return int(lower.w);
  }
#endif
  r.lower = ivec3(0);
  r.upper = u_domain_cells;
  return 0;
}

int kd_component(IN(ivec3) v, IN(int) axis) { return axis == 0 ? v.x : (axis == 1 ? v.y : v.z); }

#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
// The coarsest data node of a node with box r that suffices, and its level; AMRTEX_KD_NO_DATA where none does. A leaf's own always does:
// nothing takes its place.
int kd_sufficient(IN(uvec2) node, INOUT(Region) r) {
  int data = kd_data_index(node);
  bool more = data != AMRTEX_KD_NO_DATA;
  int i = 0;
  if (more) {
    do {
      uint word = kd_detail[data + i];
      int next = int((word >> uint(AMRTEX_KD_LEVEL_BITS)) & uint((2 << AMRTEX_KD_LEVEL_BITS) - 1));
      r.level = int(word & uint((1 << AMRTEX_KD_LEVEL_BITS) - 1));
      if (level_suffices(r.lower, r.upper, r.level, next)) return data + i;
      more = ((word >> uint(AMRTEX_KD_DETAIL_LAST_BIT)) & 1u) == 0u;
      i += 1;
    } while (more && i < AMRTEX_LEVELS);
  }
  return AMRTEX_KD_NO_DATA;
}
#endif

// The leaf that holds a cell, or the node above it that is drawn in its place. r receives its box and level; `data`: its data node.
void kd_find_leaf(IN(ivec3) cell, INOUT(Region) r, OUT(int) data) {
  uvec2 node = kd_nodes[kd_begin(cell, r)];
  int child = kd_first_child(node);
  data = AMRTEX_KD_NO_DATA;
#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
  r.level = kd_level(node);
  if (AMRTEX_LEVEL_OF_DETAIL != 0) data = kd_sufficient(node, r);
  if (data != AMRTEX_KD_NO_DATA) child = 0;
#endif
  int steps = 0;
  if (child != 0) {
    do {
      int axis = kd_axis(node);
      int plane = kd_component(r.lower, axis) + kd_split(node) * level_width(kd_level(node));
      bool above = kd_component(cell, axis) >= plane;
      ivec3 along = ivec3(axis == 0 ? 1 : 0, axis == 1 ? 1 : 0, axis == 2 ? 1 : 0);
      ivec3 others = ivec3(1) - along;
      if (above) r.lower = r.lower * others + along * plane;
      else r.upper = r.upper * others + along * plane;
      node = kd_nodes[child + (above ? 1 : 0)];
      child = kd_first_child(node);
      steps += 1;
#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
      r.level = kd_level(node);
      if (AMRTEX_LEVEL_OF_DETAIL != 0) data = kd_sufficient(node, r);
      if (data != AMRTEX_KD_NO_DATA) child = 0;
#endif
    } while (child != 0 && steps < AMRTEX_KD_DEPTH);
  }
  if (AMRTEX_LEVEL_OF_DETAIL == 0) {
    r.level = kd_level(node);
    data = kd_data_index(node);
  }
}

// A packed texel of the pool or of a brick.
ivec3 kd_texel_position(IN(uint) position) {
  return ivec3(int(position & ((1u << uint(AMRTEX_KD_X_BITS)) - 1u)),
               int((position >> uint(AMRTEX_KD_X_BITS)) & ((1u << uint(AMRTEX_KD_Y_BITS)) - 1u)),
               int(position >> uint(AMRTEX_KD_X_BITS + AMRTEX_KD_Y_BITS)));
}

bool locate(IN(Position) p, OUT(Region) r) {
  int data = AMRTEX_KD_NO_DATA;
  kd_find_leaf(p.cell, r, data);
  r.width = level_width(r.level);
  r.value_range = vec2r(0);
  r.handle = ivec4(0);
  r.brick = uvec4(0u);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
#if AMRTEX_KD_BINDLESS
  r.texture_scale = vec3r(0);
#else
  r.texture_scale = vec3r(1.0 / float(AMRTEX_POOL_X), 1.0 / float(AMRTEX_POOL_Y), 1.0 / float(AMRTEX_POOL_Z));
#endif
  r.texture_lower = vec3r(0);
#endif
  if (data == AMRTEX_KD_NO_DATA) return false;
#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
  uint data_node = uint(data);
#endif
  data *= AMRTEX_KD_DATA_WORDS;
  ivec3 texel = kd_texel_position(kd_data[data]);
  r.handle = ivec4(texel.x, texel.y, texel.z, 0);
  if (AMRTEX_KD_NUMBERED != 0) r.brick.z = kd_data[data + 1];
#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS != 0) {
    uvec2 brick = kd_handles[int(r.brick.z) * AMRTEX_FIELDS];  // once a region; of field 0
    r.brick.x = brick.x;
    r.brick.y = brick.y;
  }
#endif
  if (AMRTEX_VALUE_RANGES != 0) r.value_range = decode_range(kd_data[data + 1 + AMRTEX_KD_NUMBERED]);
#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
  r.brick.w = data_node;
#endif
  if (AMRTEX_VALIDITY != 0) r.handle.w = int(kd_data[data + AMRTEX_KD_DATA_WORDS - 1]);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
#if AMRTEX_KD_BINDLESS
  r.texture_scale = vec3r(1) / vec3r(kd_texel_position(kd_brick_sizes[r.brick.z]) + ivec3(1));
#endif
  // a cell's centre is its texel's; a vertex sits on the corner, half a texel from its own
  r.texture_lower = (vec3r(texel) + (AMRTEX_KD_VERTICES != 0 ? vec3r(0.5) : vec3r(0))) * r.texture_scale;
#endif
  return true;
}

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
BUFFER(uint, kd_more_ranges, kd_more_ranges_block)  // coded ranges of the further fields, those of a data node side by side

vec2r fetch_range(IN(Region) r, IN(int) field) {
  return decode_field_range(kd_more_ranges[int(r.brick.w) * (AMRTEX_FIELDS - 1) + field - 1], field);
}
#endif

// Cells of a region along each axis.
ivec3 kd_cells(IN(Region) r) { return divide_by_width(r.upper - r.lower, r.width); }

#if AMRTEX_CPP || AMRTEX_VALIDITY
// Of the cell c of a leaf with n cells, whose bits begin at the word `first`.
bool kd_bit(IN(int) first, IN(ivec3) n, IN(int) field, IN(ivec3) c) {
  int bit = c.x + n.x * (c.y + n.y * c.z);
  int words = (n.x * n.y * n.z + 31) >> 5;
  return ((kd_validity[first + field * words + (bit >> 5)] >> uint(bit & 31)) & 1u) != 0u;
}

bool kd_has_value(IN(Region) r, IN(int) field, IN(ivec3) cell) {
  ivec3 n = kd_cells(r);
  return kd_bit(r.handle.w, n, field, clamp(cell, ivec3(0), n - ivec3(1)));
}
#endif

#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
uvec2 kd_brick(IN(Region) r, IN(int) field) {
  if (field == 0) return uvec2(r.brick.x, r.brick.y);
  return kd_handles[int(r.brick.z) * AMRTEX_FIELDS + field];
}

real kd_brick_texel(IN(uvec2) brick, IN(ivec3) i) {
  real value = real(0);
  bool waits = true;
  for (int turn = 0; waits && turn < AMRTEX_HANDLE_TURNS; ++turn) {
    uvec2 served = SERVED_HANDLE(brick);
    if (served == brick) {
      value = SET_TEXEL(tex_kd_bricks, served, i).x;
      waits = false;
    }
  }
  return value;
}

// All eight in one turn.
void kd_brick_corners(IN(uvec2) brick, IN(ivec3) i, OUT(vec4r) lower, OUT(vec4r) upper) {
  lower = vec4r(0);
  upper = vec4r(0);
  bool waits = true;
  for (int turn = 0; waits && turn < AMRTEX_HANDLE_TURNS; ++turn) {
    uvec2 served = SERVED_HANDLE(brick);
    if (served == brick) {
      lower = vec4r(SET_TEXEL(tex_kd_bricks, served, i).x, SET_TEXEL(tex_kd_bricks, served, i + ivec3(1, 0, 0)).x,
                    SET_TEXEL(tex_kd_bricks, served, i + ivec3(0, 1, 0)).x, SET_TEXEL(tex_kd_bricks, served, i + ivec3(1, 1, 0)).x);
      upper = vec4r(SET_TEXEL(tex_kd_bricks, served, i + ivec3(0, 0, 1)).x, SET_TEXEL(tex_kd_bricks, served, i + ivec3(1, 0, 1)).x,
                    SET_TEXEL(tex_kd_bricks, served, i + ivec3(0, 1, 1)).x, SET_TEXEL(tex_kd_bricks, served, i + ivec3(1, 1, 1)).x);
      waits = false;
    }
  }
}
#endif

#if AMRTEX_CPP || !AMRTEX_KD_BINDLESS
real kd_pool_texel(IN(uint) number, IN(int) field, IN(ivec3) i) {
  real value = real(0);
  AMRTEX_OF_POOL_TEXTURE(t, int(number)) value = texelFetch(tex_kd_pool[t * AMRTEX_FIELDS + field], i, 0).x;
  return value;
}

#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
real kd_pool_filtered(IN(uint) number, IN(int) field, IN(vec3r) uvw) {
  real value = real(0);
  AMRTEX_OF_POOL_TEXTURE(t, int(number)) value = textureLod(tex_kd_pool[t * AMRTEX_FIELDS + field], uvw, 0.0).x;
  return value;
}
#endif
#endif

real kd_texel(IN(Region) r, IN(int) field, IN(ivec3) i) {
  real value = real(0);
#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS != 0) value = kd_brick_texel(kd_brick(r, field), i);
#endif
#if AMRTEX_CPP || !AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS == 0) value = kd_pool_texel(r.brick.z, field, i);
#endif
  return value;
}

// The texels i + (0 or 1) along each axis, x fastest.
void kd_corners(IN(Region) r, IN(int) field, IN(ivec3) i, OUT(vec4r) lower, OUT(vec4r) upper) {
#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS != 0) {
    kd_brick_corners(kd_brick(r, field), i, lower, upper);
    return;
  }
#endif
  lower = vec4r(kd_texel(r, field, i), kd_texel(r, field, i + ivec3(1, 0, 0)), kd_texel(r, field, i + ivec3(0, 1, 0)),
                kd_texel(r, field, i + ivec3(1, 1, 0)));
  upper = vec4r(kd_texel(r, field, i + ivec3(0, 0, 1)), kd_texel(r, field, i + ivec3(1, 0, 1)),
                kd_texel(r, field, i + ivec3(0, 1, 1)), kd_texel(r, field, i + ivec3(1, 1, 1)));
}

#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
#if AMRTEX_KD_BINDLESS
real kd_brick_filtered(IN(uvec2) brick, IN(vec3r) uvw) {
  real value = real(0);
  bool waits = true;
  for (int turn = 0; waits && turn < AMRTEX_HANDLE_TURNS; ++turn) {
    uvec2 served = SERVED_HANDLE(brick);
    if (served == brick) {
      value = SET_FILTERED(tex_kd_bricks, served, uvw).x;
      waits = false;
    }
  }
  return value;
}
#endif

real kd_filtered(IN(Region) r, IN(int) field, IN(vec3r) uvw) {
#if AMRTEX_KD_BINDLESS
  return kd_brick_filtered(kd_brick(r, field), uvw);
#else
  return kd_pool_filtered(r.brick.z, field, uvw);
#endif
}
#endif

#if AMRTEX_CPP || AMRTEX_FILTER == AMRTEX_FILTER_BASIS
// ---- basis: leaves as pieces. store: the first word of their bits, and the number of their brick (bindless) or texture

BasisPiece basis_found(IN(Region) r, IN(int) node) {
  uvec4 lower = basis_supports[node * 2];
  uvec4 upper = basis_supports[node * 2 + 1];
  uint leaf = lower.w - 1u;
  int width = level_width(int(leaf >> uint(AMRTEX_KD_DATA_BITS)));
  int data = int(leaf & uint((1 << AMRTEX_KD_DATA_BITS) - 1)) * AMRTEX_KD_DATA_WORDS;
  ivec3 reach = ivec3((width + 1) >> 1);  // the box of supports is so much larger than the leaf's
  ivec3 corner = corner_of(lower) + reach;
  BasisPiece p;
  basis_place(r, corner, width, p);
  p.texel = kd_texel_position(kd_data[data]);
  p.cells = divide_by_width(corner_of(upper) - reach - corner, width);
  p.store = uvec2(AMRTEX_VALIDITY != 0 ? kd_data[data + AMRTEX_KD_DATA_WORDS - 1] : 0u, AMRTEX_KD_NUMBERED != 0 ? kd_data[data + 1] : 0u);
  return p;
}

#if AMRTEX_CPP || AMRTEX_VALIDITY
bool basis_has_value(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell) { return kd_bit(int(p.store.x), p.cells, field, cell); }
#endif

#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
uvec2 kd_piece_brick(IN(BasisPiece) p, IN(int) field) { return kd_handles[int(p.store.y) * AMRTEX_FIELDS + field]; }
#endif

real basis_texel(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell) {
  real value = real(0);
#if AMRTEX_CPP || AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS != 0) value = kd_brick_texel(kd_piece_brick(p, field), p.texel + cell);
#endif
#if AMRTEX_CPP || !AMRTEX_KD_BINDLESS
  if (AMRTEX_KD_BINDLESS == 0) value = kd_pool_texel(p.store.y, field, p.texel + cell);
#endif
  return value;
}

#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
#if AMRTEX_KD_BINDLESS
ivec3 kd_brick_size(IN(BasisPiece) p) { return kd_texel_position(kd_brick_sizes[p.store.y]) + ivec3(1); }
#endif

real basis_widest_texture(IN(BasisPiece) p) {
#if AMRTEX_KD_BINDLESS
  ivec3 size = kd_brick_size(p);
  return float(max(size.x, max(size.y, size.z)));
#else
  return float(max(AMRTEX_POOL_X, max(AMRTEX_POOL_Y, AMRTEX_POOL_Z)));
#endif
}

real basis_filtered(IN(BasisPiece) p, IN(int) field, IN(vec3r) at) {
#if AMRTEX_KD_BINDLESS
  return kd_brick_filtered(kd_piece_brick(p, field), at / vec3r(kd_brick_size(p)));
#else
  return kd_pool_filtered(p.store.y, field, at * vec3r(1.0 / float(AMRTEX_POOL_X), 1.0 / float(AMRTEX_POOL_Y), 1.0 / float(AMRTEX_POOL_Z)));
#endif
}
#endif
#endif

real kd_stored_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  ivec3 first = ivec3(r.handle.x, r.handle.y, r.handle.z);
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) {
    ivec3 cell = clamp(ivec3(floor(q)), ivec3(0), kd_cells(r) - ivec3(1));
    return decode_value(kd_texel(r, field, first + cell), field);
  }
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  return decode_value(kd_filtered(r, field, r.texture_lower + q * r.texture_scale), field);
#else
  // counted from the vertex, or from the centre of the cell before the region
  PRECISE vec3r from_first = AMRTEX_KD_VERTICES != 0 ? q : q + vec3r(0.5);
  int last = AMRTEX_KD_VERTICES != 0 ? 1 : 0;
  vec3r whole = clamp(floor(from_first), vec3r(0), vec3r(kd_cells(r) - ivec3(last)));
  vec3r f = from_first - whole;
  ivec3 i = first + ivec3(whole) - ivec3(1 - last);
  vec4r lower;
  vec4r upper;
  kd_corners(r, field, i, lower, upper);
  return decode_value(trilinear(lower.x, lower.y, lower.z, lower.w, upper.x, upper.y, upper.z, upper.w, f), field);
#endif
}

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if AMRTEX_CPP || AMRTEX_VALIDITY
  if (AMRTEX_VALIDITY != 0 && !kd_has_value(r, field, ivec3(floor(q)))) return no_value();
#endif
#if AMRTEX_CPP
  return AMRTEX_FILTER == AMRTEX_FILTER_BASIS ? basis_search(r, field, q, AMRTEX_VALIDITY != 0) : kd_stored_value(r, field, q);
#elif AMRTEX_FILTER == AMRTEX_FILTER_BASIS
  return basis_search(r, field, q, AMRTEX_VALIDITY != 0);
#else
  return kd_stored_value(r, field, q);
#endif
}
