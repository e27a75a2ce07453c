// exabricks: regions that know the cells whose hats reach into them. Words: exabricks_layout.h.
#include "exabricks/exabricks_layout.h"
DEFINE_INT(AMRTEX_EXA_DEPTH)    // splits from where a descent starts to the deepest leaf, or nodes of the BVH
DEFINE_INT(AMRTEX_EXA_GRID)     // 1 where descents start from a grid, else 0
DEFINE_INT(AMRTEX_EXA_BVH)      // 1 where regions are found through a BVH, 0 where through the tree of planes
DEFINE_INT(AMRTEX_EXA_CELLS)    // 1 where each sample searches its cells, 0 where its region knows them
DEFINE_INT(AMRTEX_EXA_BORDER)   // texels around a brick
DEFINE_INT(AMRTEX_EXA_MISSING)  // 1 where bricks hold cells without value, else 0
DEFINE_INT(AMRTEX_EXA_X_BITS)   // bits of x in a packed texel
DEFINE_INT(AMRTEX_EXA_Y_BITS)   // bits of y
DEFINE_INT(AMRTEX_POOL_X)       // texels of the pool along x
DEFINE_INT(AMRTEX_POOL_Y)       // along y
DEFINE_INT(AMRTEX_POOL_Z)       // along z

BUFFER(uvec4, exa_regions, exa_regions_block)  // two a region
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
BUFFER(uint, exa_ranges, exa_ranges_block)  // coded value range of a region
#endif
#if AMRTEX_CPP || AMRTEX_EXA_CELLS
BUFFER(uvec4, exa_bricks, exa_bricks_block)  // two a brick
#endif
#if AMRTEX_CPP || (AMRTEX_FILTER == AMRTEX_FILTER_BASIS && !AMRTEX_EXA_CELLS)
BUFFER(uvec4, exa_pieces, exa_pieces_block)
#endif
#if AMRTEX_CPP || AMRTEX_EXA_BVH
BUFFER(uvec4, exa_bvh, exa_bvh_block)  // two a node: (lower corner, region + 1 or 0 for an inner node), (upper corner, next node beside it)
#endif
#if AMRTEX_CPP || !AMRTEX_EXA_BVH
BUFFER(uvec2, exa_nodes, exa_nodes_block)
#endif
#if AMRTEX_CPP || AMRTEX_EXA_GRID
BUFFER(uint, exa_start, exa_start_block)               // a cell of the grid: where the boxes below tell its node
BUFFER(uvec4, exa_start_nodes, exa_start_nodes_block)  // two a node: (lower corner, node), (upper corner, coded value range)
UNIFORM(ivec3, u_exa_grid)                             // cells of the grid
UNIFORM(ivec3, u_exa_grid_width)                       // x: width of a cell of the grid, finest cells
#endif
#if AMRTEX_CPP || AMRTEX_EXA_MISSING
BUFFER(uint, exa_validity, exa_validity_block)  // one bit a texel of the pool, each field from a new word
#endif
VALUE_TEXTURES(tex_exa_pool, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)

#define AMRTEX_BASIS_MISSING AMRTEX_EXA_MISSING
#define AMRTEX_BASIS_SEARCH AMRTEX_EXA_CELLS
#include "basis.glsl"

// ---- locating

// A region is as fine as its finest hats; differences for normals are taken over the leaf's own cells.
#define AMRTEX_LEAF_LEVEL(r) int((r).brick.w)

int exa_axis(IN(uint) word) { return int(word >> uint(AMRTEX_EXA_CHILD_BITS)); }
int exa_first_child(IN(uint) word) { return int(word & ((1u << uint(AMRTEX_EXA_CHILD_BITS)) - 1u)); }
int exa_component(IN(ivec3) v, IN(int) axis) { return axis == 0 ? v.x : (axis == 1 ? v.y : v.z); }

#if AMRTEX_CPP || AMRTEX_EXA_GRID
// The entry of the grid's cell about a cell.
int exa_start_at(IN(ivec3) cell) {
  ivec3 g = divide_by_width(cell, u_exa_grid_width.x);
  return int(exa_start[g.x + u_exa_grid.x * (g.y + u_exa_grid.y * g.z)]);
}
#endif

#if AMRTEX_CPP || !AMRTEX_EXA_BVH
// The leaf below a node that holds a cell: its region. r.lower and r.upper, the node's box, become the leaf's.
uint exa_descend(IN(int) from, IN(ivec3) cell, INOUT(Region) r) {
  uvec2 node = exa_nodes[from];
  int child = exa_first_child(node.x);
  int steps = 0;
  if (child != 0) {
    do {
      int axis = exa_axis(node.x);
      int plane = int(node.y);
      bool above = exa_component(cell, axis) >= plane;
      ivec3 along = ivec3(axis == 0 ? 1 : 0, axis == 1 ? 1 : 0, axis == 2 ? 1 : 0);
      ivec3 others = ivec3(1) - along;
      if (above) r.lower = r.lower * others + along * plane;
      else r.upper = r.upper * others + along * plane;
      node = exa_nodes[child + (above ? 1 : 0)];
      child = exa_first_child(node.x);
      steps += 1;
    } while (child != 0 && steps < AMRTEX_EXA_DEPTH);
  }
  return node.y;
}
#endif

#if AMRTEX_CPP || AMRTEX_EXA_BVH
// The same through the BVH, whose nodes stand depth first: what does not hold the cell is passed over. A leaf has the
// region + 1, and 0xffffffff + 1 = 0 tells an inner node: leaves without mesh have AMRTEX_EXA_NO_REGION itself.
uint exa_search_bvh(IN(ivec3) cell, INOUT(Region) r) {
  int i = 0;
  uint found = 0u;
  int steps = 0;
  do {
    uvec4 lower = exa_bvh[i * 2];
    uvec4 upper = exa_bvh[i * 2 + 1];
    r.lower = corner_of(lower);
    r.upper = corner_of(upper);
    bool holds = all(greaterThanEqual(cell, r.lower)) && all(lessThan(cell, r.upper));
    if (holds) found = lower.w;
    i = holds ? i + 1 : int(upper.w);
    steps += 1;
  } while (found == 0u && steps < AMRTEX_EXA_DEPTH);
  return found == AMRTEX_EXA_NO_REGION ? found : found - 1u;
}
#endif

ivec3 exa_unpack_size(IN(uint) size) {
  uint most = (1u << uint(AMRTEX_EXA_SIZE_BITS)) - 1u;
  return ivec3(int(size & most), int((size >> uint(AMRTEX_EXA_SIZE_BITS)) & most), int(size >> uint(2 * AMRTEX_EXA_SIZE_BITS)));
}

ivec3 exa_unpack_texel(IN(uint) texel) {
  return ivec3(int(texel & ((1u << uint(AMRTEX_EXA_X_BITS)) - 1u)),
               int((texel >> uint(AMRTEX_EXA_X_BITS)) & ((1u << uint(AMRTEX_EXA_Y_BITS)) - 1u)),
               int(texel >> uint(AMRTEX_EXA_X_BITS + AMRTEX_EXA_Y_BITS)));
}

vec3r exa_inverse_pool() {
  return vec3r(real(1) / real(AMRTEX_POOL_X), real(1) / real(AMRTEX_POOL_Y), real(1) / real(AMRTEX_POOL_Z));
}

// Found in three steps, of which a march takes no more than it needs: a box of the start grid and the range of all in it, ...
#define AMRTEX_STAGED_LOCATE true
int locate_group(IN(Position) p, INOUT(Region) r) {
#if AMRTEX_CPP || AMRTEX_EXA_GRID
  if (AMRTEX_EXA_GRID != 0) {
    int start = exa_start_at(p.cell);
    uvec4 lower = exa_start_nodes[start * 2];
    uvec4 upper = exa_start_nodes[start * 2 + 1];
    r.lower = corner_of(lower);
    r.upper = corner_of(upper);
    if (AMRTEX_VALUE_RANGES != 0) r.value_range = decode_range(upper.w);
    return int(lower.w);
  }
#endif
  r.lower = ivec3(0);
  r.upper = u_domain_cells;
  r.value_range = vec2r(as_real(0xff800000u), as_real(0x7f800000u));  // any value
  return 0;
}

// ... the region's own box and range, ...
bool locate_in_group(IN(Position) p, IN(int) group, INOUT(Region) r) {
#if AMRTEX_CPP
  uint region = AMRTEX_EXA_BVH != 0 ? exa_search_bvh(p.cell, r) : exa_descend(group, p.cell, r);
#elif AMRTEX_EXA_BVH
  uint region = exa_search_bvh(p.cell, r);
#else
  uint region = exa_descend(group, p.cell, r);
#endif
  r.handle = ivec4(int(region), 0, 0, 0);
#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
  r.brick.x = region;
#endif
  r.level = AMRTEX_LEVELS - 1;
  r.width = 1;
  if (region == AMRTEX_EXA_NO_REGION) return false;
#if AMRTEX_CPP || AMRTEX_VALUE_RANGES
  if (AMRTEX_VALUE_RANGES != 0) r.value_range = decode_range(exa_ranges[int(region)]);
#endif
  return true;
}

// ... and what samples in it read. Handle: (texel of the brick's first cell, its cells along the axes, first piece or the brick, pieces and
// flags or 0 in a plain region). texture_lower and texture_scale turn q into cell widths from the brick's corner, or into its texture coordinate.
void open_region(INOUT(Region) r) {
  int region = r.handle.x;
  uvec4 store = exa_regions[region * 2];
  uvec4 place = exa_regions[region * 2 + 1];
  int levels = (1 << AMRTEX_EXA_LEVEL_BITS) - 1;
  r.level = int(store.w >> uint(AMRTEX_EXA_PIECE_BITS + AMRTEX_EXA_LEVEL_BITS + 1)) & levels;
  r.width = level_width(r.level);
  r.brick = uvec4(0u, 0u, 0u, uint(int(store.w >> uint(AMRTEX_EXA_PIECE_BITS)) & levels));
#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
  r.brick.x = uint(region);
#endif
  uint flags = AMRTEX_EXA_OWN_FLAG | AMRTEX_EXA_MISSING_FLAG | ((1u << uint(AMRTEX_EXA_PIECE_BITS)) - 1u);
  r.handle = ivec4(int(store.x), int(store.y), AMRTEX_EXA_CELLS != 0 ? int(place.w) : int(store.z),
                   (store.w & AMRTEX_EXA_PLAIN_FLAG) != 0u ? 0 : int(store.w & flags));
  real inverse_width = real(1) / real(level_width(AMRTEX_LEAF_LEVEL(r)));
  r.texture_lower = vec3r(r.lower - corner_of(place)) * inverse_width;
  r.texture_scale = vec3r(real(r.width) * inverse_width);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  r.texture_lower = (vec3r(exa_unpack_texel(store.x)) + r.texture_lower) * exa_inverse_pool();
  r.texture_scale *= exa_inverse_pool();
#endif
}

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
BUFFER(uint, exa_more_ranges, exa_more_ranges_block)  // coded ranges of the further fields, those of a region side by side

vec2r fetch_range(IN(Region) r, IN(int) field) {
  return decode_field_range(exa_more_ranges[int(r.brick.x) * (AMRTEX_FIELDS - 1) + field - 1], field);
}
#endif

bool locate(IN(Position) p, OUT(Region) r) {
  r.value_range = vec2r(0);
  int group = locate_group(p, r);
  r.value_range = vec2r(0);
  r.brick = uvec4(0u);
  r.texture_lower = vec3r(0);
  r.texture_scale = vec3r(0);
  if (!locate_in_group(p, group, r)) {
    r.handle = ivec4(0);
    return false;
  }
  open_region(r);
  return true;
}

bool exa_flag(IN(Region) r, IN(uint) flag) { return (uint(r.handle.w) & flag) != 0u; }

#if AMRTEX_CPP || (AMRTEX_FILTER == AMRTEX_FILTER_BASIS && !AMRTEX_EXA_CELLS)
BasisPiece exa_piece(IN(Region) r, IN(int) index) {
  uvec4 words = exa_pieces[index];
  uint most = (1u << uint(AMRTEX_EXA_OFFSET_BITS)) - 1u;
  ivec3 offset = ivec3(int(words.z & most), int(words.z >> uint(AMRTEX_EXA_OFFSET_BITS)), int(words.w & most));
  BasisPiece p;
  p.from_corner = vec3r(offset - ivec3(1 << (AMRTEX_EXA_OFFSET_BITS - 1)));
  p.scale = real(r.width) * (real(1) / real(level_width(int(words.w >> uint(AMRTEX_EXA_OFFSET_BITS)))));
  p.texel = exa_unpack_texel(words.x);
  p.cells = exa_unpack_size(words.y);
  p.store = uvec2(0u);
  return p;
}
#endif

#if AMRTEX_CPP || AMRTEX_EXA_CELLS
BasisPiece exa_brick(IN(Region) r, IN(int) brick) {
  uvec4 place = exa_bricks[brick * 2];
  uvec4 store = exa_bricks[brick * 2 + 1];
  BasisPiece p;
  basis_place(r, corner_of(place), level_width(int(place.w)), p);
  p.texel = exa_unpack_texel(store.z);
  p.cells = exa_unpack_size(store.w);
  p.store = uvec2(0u);
  return p;
}
#endif

// ---- values

real exa_texel(IN(int) field, IN(ivec3) texel) { return texelFetch(tex_exa_pool[field], texel, 0).x; }

#if AMRTEX_CPP || AMRTEX_EXA_MISSING
bool exa_has_value(IN(int) field, IN(ivec3) texel) {
  int words = (AMRTEX_POOL_X * AMRTEX_POOL_Y * AMRTEX_POOL_Z + 31) >> 5;
  int bit = texel.x + AMRTEX_POOL_X * (texel.y + AMRTEX_POOL_Y * texel.z);
  return ((exa_validity[field * words + (bit >> 5)] >> uint(bit & 31)) & 1u) != 0u;
}
#endif

#if AMRTEX_CPP || AMRTEX_FILTER == AMRTEX_FILTER_BASIS
real basis_texel(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell) { return exa_texel(field, p.texel + cell); }

#if AMRTEX_CPP || AMRTEX_EXA_MISSING
bool basis_has_value(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell) { return exa_has_value(field, p.texel + cell); }
#endif

#if AMRTEX_CPP || AMRTEX_EXA_CELLS
BasisPiece basis_found(IN(Region) r, IN(int) node) { return exa_brick(r, int(basis_supports[node * 2].w) - 1); }
#endif

#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
real basis_filtered(IN(BasisPiece) p, IN(int) field, IN(vec3r) at) { return textureLod(tex_exa_pool[field], at * exa_inverse_pool(), 0.0).x; }
real basis_widest_texture(IN(BasisPiece) p) { return float(max(AMRTEX_POOL_X, max(AMRTEX_POOL_Y, AMRTEX_POOL_Z))); }
#endif

// All cells of the region's own brick; where they lie from the region is not told.
BasisPiece exa_own_brick(IN(Region) r) {
  BasisPiece own;
  own.from_corner = vec3r(0);
  own.scale = real(r.width) * (real(1) / real(level_width(AMRTEX_LEAF_LEVEL(r))));
  own.texel = exa_unpack_texel(uint(r.handle.x));
  own.cells = exa_unpack_size(uint(r.handle.y));
  own.store = uvec2(0u);
  return own;
}

// Trilinear in the texels of the region's own brick. Where all hats that reach the region are those of them, that is f.
real exa_plain_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  return decode_value(textureLod(tex_exa_pool[field], r.texture_lower + q * r.texture_scale, 0.0).x, field);
#else
  BasisPiece own = exa_own_brick(r);
  ivec3 last = own.cells - ivec3(2 - AMRTEX_EXA_BORDER);
  PRECISE vec3r scaled = q * r.texture_scale;
  PRECISE vec3r x = scaled + r.texture_lower;
  PRECISE vec3r from_centre = x - vec3r(0.5);
  vec3r whole = clamp(floor(from_centre), vec3r(-AMRTEX_EXA_BORDER), vec3r(last));
  PRECISE vec3r f = from_centre - whole;
  ivec3 i = ivec3(whole);
  return basis_between(own, field, i, i + ivec3(1), f);
#endif
}
#endif

#if AMRTEX_CPP || (AMRTEX_FILTER == AMRTEX_FILTER_BASIS && AMRTEX_EXA_MISSING)
// Has the leaf cell that holds q a value? It is of the region's first piece, or brick.
bool exa_own_cell_has_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if AMRTEX_CPP
  return basis_holds_value(AMRTEX_EXA_CELLS != 0 ? exa_brick(r, r.handle.z) : exa_piece(r, r.handle.z), field, q);
#elif AMRTEX_EXA_CELLS
  return basis_holds_value(exa_brick(r, r.handle.z), field, q);
#else
  return basis_holds_value(exa_piece(r, r.handle.z), field, q);
#endif
}
#endif

#if AMRTEX_CPP || (AMRTEX_FILTER == AMRTEX_FILTER_BASIS && !AMRTEX_EXA_CELLS)
// `own`: what the texels of the region's brick say at q.
real exa_mean_of_pieces(IN(Region) r, IN(int) field, IN(vec3r) q, IN(real) own) {
  vec2r mean = vec2r(0);
  int i = r.handle.z;
  int end = i + (r.handle.w & ((1 << AMRTEX_EXA_PIECE_BITS) - 1));
  bool reads_own = exa_flag(r, AMRTEX_EXA_OWN_FLAG);
#if AMRTEX_CPP || AMRTEX_EXA_MISSING
  if (reads_own && AMRTEX_EXA_MISSING != 0 && exa_flag(r, AMRTEX_EXA_MISSING_FLAG)) {
    BasisPiece marked = exa_piece(r, i);
    reads_own = basis_all_present(marked, field, basis_position(marked, q));
    if (reads_own && i + 1 == end) return own;  // what a plain region without the mark has, to the bit
  }
#endif
  if (reads_own) {
    BasisPiece first = exa_piece(r, i);
    basis_add_weighted(mean, own, basis_hat_sum(first, basis_position(first, q)));
    i += 1;
  }
  if (i < end) {
    do {
      basis_add_piece(exa_piece(r, i), field, q, exa_flag(r, AMRTEX_EXA_MISSING_FLAG), mean);
      i += 1;
    } while (i < end);
  }
  return mean.x;
}
#endif

real exa_nearest_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  ivec3 cells = exa_unpack_size(uint(r.handle.y));
  ivec3 texel = exa_unpack_texel(uint(r.handle.x)) + clamp(ivec3(floor(q)), ivec3(0), cells - ivec3(1));
#if AMRTEX_CPP || AMRTEX_EXA_MISSING
  if (AMRTEX_EXA_MISSING != 0 && !exa_has_value(field, texel)) return no_value();
#endif
  return decode_value(exa_texel(field, texel), field);
}

#if AMRTEX_CPP || AMRTEX_FILTER == AMRTEX_FILTER_BASIS
real exa_basis_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if AMRTEX_CPP || AMRTEX_EXA_MISSING
  if (AMRTEX_EXA_MISSING != 0 && exa_flag(r, AMRTEX_EXA_MISSING_FLAG) && !exa_own_cell_has_value(r, field, q)) return no_value();
#endif
#if AMRTEX_CPP
  if (AMRTEX_EXA_CELLS != 0) return basis_search(r, field, q, exa_flag(r, AMRTEX_EXA_MISSING_FLAG));
#elif AMRTEX_EXA_CELLS
  return basis_search(r, field, q, exa_flag(r, AMRTEX_EXA_MISSING_FLAG));
#endif
#if AMRTEX_CPP || (AMRTEX_FILTER == AMRTEX_FILTER_BASIS && !AMRTEX_EXA_CELLS)
  // one fetch for all lanes of a SIMD group: most need nothing else
  real value = real(0);
  if (r.handle.w == 0 || exa_flag(r, AMRTEX_EXA_OWN_FLAG)) value = exa_plain_value(r, field, q);
  if (r.handle.w != 0) value = exa_mean_of_pieces(r, field, q, value);
  return value;
#endif
}
#endif

#if AMRTEX_CPP || AMRTEX_FILTER == AMRTEX_FILTER_BASIS
// ---- gradient of basis: of a quotient of two sums, hat by hat (Wald et al. 2020, section 5.1.2)
#define AMRTEX_FETCH_GRADIENT 1
#define AMRTEX_STORED_GRADIENTS false

STRUCT ExaSlopes {
  vec4r values;  // sum of hats times values: its derivatives by q, and itself
  vec4r hats;    // the same of the hats
};

// Adds the eight hats about x of the texels of `p`, and of `beyond` more around them; `check`: those of cells without value are left out.
void exa_add_slopes(IN(BasisPiece) p, IN(int) beyond, IN(bool) check, IN(vec3r) x, INOUT(ExaSlopes) slopes) {
  PRECISE vec3r from_centre = x - vec3r(0.5);
  vec3r whole = floor(from_centre);
  PRECISE vec3r f = from_centre - whole;
  int k = 0;
  do {
    ivec3 corner = ivec3(k & 1, (k >> 1) & 1, k >> 2);
    ivec3 c = ivec3(whole) + corner;
    bool there = all(greaterThanEqual(c, ivec3(-beyond))) && all(lessThan(c, p.cells + ivec3(beyond)));
#if AMRTEX_CPP || AMRTEX_EXA_MISSING
    if (there && check) there = exa_has_value(0, p.texel + c);
#endif
    if (there) {
      vec3r w = vec3r(corner) * f + vec3r(ivec3(1) - corner) * (vec3r(1) - f);
      vec3r slope = vec3r(corner * 2 - ivec3(1)) * p.scale;
      vec4r hat = vec4r(slope.x * w.y * w.z, w.x * slope.y * w.z, w.x * w.y * slope.z, w.x * w.y * w.z);
      slopes.values += hat * decode_value(exa_texel(0, p.texel + c), 0);
      slopes.hats += hat;
    }
    k += 1;
  } while (k < 8);
}

#if AMRTEX_CPP || !AMRTEX_EXA_CELLS
// Of a plain region: its brick's texels as they stand.
void exa_add_plain_slopes(IN(Region) r, IN(vec3r) q, INOUT(ExaSlopes) slopes) {
  BasisPiece own = exa_own_brick(r);
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  vec3r x = (r.texture_lower + q * r.texture_scale) / exa_inverse_pool() - vec3r(own.texel);
#else
  vec3r x = q * r.texture_scale + r.texture_lower;
#endif
  exa_add_slopes(own, AMRTEX_EXA_BORDER, false, x, slopes);
}
#endif

vec3r fetch_gradient(IN(Region) r, IN(vec3r) q) {
  ExaSlopes slopes;
  slopes.values = vec4r(0);
  slopes.hats = vec4r(0);
  bool check = AMRTEX_EXA_MISSING != 0 && exa_flag(r, AMRTEX_EXA_MISSING_FLAG);
#if AMRTEX_CPP || AMRTEX_EXA_CELLS
  if (AMRTEX_EXA_CELLS != 0) {
    int node = 0;
    do {
      int leaf = basis_next(r, q, node);
      if (leaf >= 0) {
        BasisPiece found = basis_found(r, leaf);
        exa_add_slopes(found, 0, check, basis_position(found, q), slopes);
      }
    } while (node != 0);
  }
#endif
#if AMRTEX_CPP || !AMRTEX_EXA_CELLS
  int i = r.handle.z;
  int end = i + (r.handle.w & ((1 << AMRTEX_EXA_PIECE_BITS) - 1));
  if (AMRTEX_EXA_CELLS == 0 && r.handle.w == 0) exa_add_plain_slopes(r, q, slopes);
  if (AMRTEX_EXA_CELLS == 0 && i < end) {
    do {
      BasisPiece piece = exa_piece(r, i);
      exa_add_slopes(piece, 0, check, basis_position(piece, q), slopes);
      i += 1;
    } while (i < end);
  }
#endif
  real inverse = real(1) / slopes.hats.w;
  real value = slopes.values.w * inverse;
  return (vec3r(slopes.values.x, slopes.values.y, slopes.values.z) - vec3r(slopes.hats.x, slopes.hats.y, slopes.hats.z) * value) * inverse;
}
#endif

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
#if AMRTEX_CPP
  return AMRTEX_FILTER == AMRTEX_FILTER_NEAREST ? exa_nearest_value(r, field, q) : exa_basis_value(r, field, q);
#elif AMRTEX_FILTER == AMRTEX_FILTER_NEAREST
  return exa_nearest_value(r, field, q);
#else
  return exa_basis_value(r, field, q);
#endif
}
