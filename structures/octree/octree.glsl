// octree: regions are leaf cells, found by a descent from the root or from a dense start grid. Words: octree_layout.h.
#include "octree/octree_layout.h"
DEFINE_INT(AMRTEX_OCTREE_GRADIENTS)     // 1 where leaves hold the direction of their gradient, else 0
DEFINE_INT(AMRTEX_OCTREE_LAYOUT)        // AMRTEX_OCTREE_WIDE or AMRTEX_OCTREE_RGBA8
DEFINE_INT(AMRTEX_OCTREE_TRAVERSAL)     // AMRTEX_OCTREE_FAST or AMRTEX_OCTREE_PAPER
DEFINE_INT(AMRTEX_OCTREE_NODE_BUFFER)   // 1 where nodes stand in a buffer, 0 where in a 3D texture
DEFINE_INT(AMRTEX_OCTREE_VALUE_BUFFER)  // 1 where values stand in a buffer, 0 where in a 3D texture
DEFINE_INT(AMRTEX_OCTREE_LOD)           // 1 where averages stand in a LOD texture of their own
DEFINE_INT(AMRTEX_OCTREE_START)         // 1 where there is a start grid, else 0
DEFINE_INT(AMRTEX_OCTREE_START_SHIFT)   // depths from the cells where a descent starts to level 0
DEFINE_INT(AMRTEX_OCTREE_GHOSTS)        // 1 where missing neighbours stand in the tree, 0 where there are none
DEFINE_INT(AMRTEX_OCTREE_PRUNED)        // 1 where nodes that show nothing are not stored, else 0

// slots may hold no cell, one without a value, or one that shows nothing
#define AMRTEX_OCTREE_EMPTY_SLOTS (AMRTEX_VALIDITY != 0 || AMRTEX_OCTREE_PRUNED != 0)

// what the march may use (contract.glsl); the paper's traversal pays its eight descents every sample
#define AMRTEX_CELL_REGIONS (AMRTEX_OCTREE_TRAVERSAL == AMRTEX_OCTREE_FAST)

#if AMRTEX_CPP
#define AMRTEX_FETCH_GRADIENT 1
#else
#define AMRTEX_FETCH_GRADIENT AMRTEX_OCTREE_GRADIENTS
#endif
#define AMRTEX_STORED_GRADIENTS (AMRTEX_OCTREE_GRADIENTS != 0)

#if AMRTEX_CPP || AMRTEX_OCTREE_NODE_BUFFER
BUFFER(uint, octree_nodes, octree_nodes_block)
#endif
#if AMRTEX_CPP || !AMRTEX_OCTREE_NODE_BUFFER
INTEGER_TEXTURE(tex_octree_nodes)
#endif
#if AMRTEX_CPP || (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE && AMRTEX_OCTREE_VALUE_BUFFER)
BUFFER(real, octree_values, octree_values_block)
#endif
#if AMRTEX_CPP || (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE && !AMRTEX_OCTREE_VALUE_BUFFER)
VALUE_TEXTURES(tex_octree_values, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)
#endif
#if AMRTEX_CPP || AMRTEX_OCTREE_LOD
VALUE_TEXTURES(tex_octree_lod, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)  // one texel a node
#endif
#if AMRTEX_CPP || AMRTEX_OCTREE_START
BUFFER(uint, octree_start, octree_start_block)
UNIFORM(ivec3, u_octree_start)  // cells of the start grid
#endif
#if AMRTEX_CPP || (AMRTEX_OCTREE_START && (AMRTEX_FILTER != AMRTEX_FILTER_NEAREST || AMRTEX_LEVEL_OF_DETAIL) && !AMRTEX_OCTREE_LOD)
BUFFER(uint, octree_start_slots, octree_start_slots_block)  // where the average of each cell of the start grid stands
#endif
#if AMRTEX_CPP || (AMRTEX_OCTREE_EMPTY_SLOTS && AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE)
BUFFER(uint, octree_validity, octree_validity_block)  // one bit a slot: a leaf (or what may be drawn in its place) with a value that may show
#endif
#if AMRTEX_CPP || (AMRTEX_VALUE_RANGES && AMRTEX_FILTER != AMRTEX_FILTER_NEAREST)
BUFFER(uint, octree_ranges, octree_ranges_block)  // one code a node: of all that its leaves can return
#endif
#if AMRTEX_CPP || (AMRTEX_FIELD_RANGES && AMRTEX_FILTER != AMRTEX_FILTER_NEAREST)
BUFFER(uint, octree_more_ranges, octree_more_ranges_block)  // the same of the further fields, those of a node side by side
#endif
UNIFORM(ivec3, u_octree_shift)  // log2 of nodes along x and y of their 3D textures

// ---- addresses. Tree space: finest cells from the tree's lower corner, unsigned, since ghosts
// of a domain of 31 bits need the 32nd.

uvec3 octree_from_finest(IN(ivec3) cell) {
  if (AMRTEX_OCTREE_GHOSTS == 0) return uvec3(cell);
  return uvec3(cell) + uvec3(uint(level_width(0)));  // one cell of level 0 before the domain
}

// Which child of a node whose children are 2^shift wide.
int octree_octant(IN(uvec3) c, IN(int) shift) {
  uvec3 bit = (c >> uvec3(uint(shift))) & uvec3(1u);
  return int(bit.x | (bit.y << 1u) | (bit.z << 2u));
}

ivec3 octree_node_texel(IN(int) node) {
  return ivec3(node & ((1 << u_octree_shift.x) - 1), (node >> u_octree_shift.x) & ((1 << u_octree_shift.y) - 1),
               node >> (u_octree_shift.x + u_octree_shift.y));
}

ivec3 octree_slot_texel(IN(int) slot) {
  return octree_node_texel(slot >> 3) * 2 + ivec3(slot & 1, (slot >> 1) & 1, (slot >> 2) & 1);
}

// ---- nodes

// The word that tells of a slot: its node's (wide) or its own (rgba8).
uint octree_word(IN(int) slot) {
  bool own = AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_RGBA8;
#if AMRTEX_CPP || AMRTEX_OCTREE_NODE_BUFFER
  if (AMRTEX_OCTREE_NODE_BUFFER != 0) return octree_nodes[own ? slot : slot >> 3];
#endif
#if AMRTEX_CPP || !AMRTEX_OCTREE_NODE_BUFFER
  return texelFetch(tex_octree_nodes, own ? octree_slot_texel(slot) : octree_node_texel(slot >> 3), 0).x;
#endif
}

bool octree_is_inner(IN(uint) word, IN(int) slot) {
  if (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_RGBA8) return (word >> 24u) == uint(AMRTEX_OCTREE_INNER);
  return ((word >> uint(slot & 7)) & 1u) != 0u;
}

// The node in a slot that is inner.
int octree_child_node(IN(uint) word, IN(int) slot) {
  if (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_RGBA8)
    return int((word & 255u) | (((word >> 8u) & 255u) << uint(u_octree_shift.x)) |
               (((word >> 16u) & 255u) << uint(u_octree_shift.x + u_octree_shift.y)));
  return int(word >> uint(AMRTEX_OCTREE_MASK_BITS)) + int(bitCount(word & ((1u << uint(slot & 7)) - 1u)));
}

// What a texel of storage holds for a slot; decode_value makes it a value.
real octree_stored(IN(int) slot, IN(int) field) {
  if (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_RGBA8) return real(octree_word(slot) & 255u) / real(255);
#if AMRTEX_CPP || (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE && AMRTEX_OCTREE_VALUE_BUFFER)
  if (AMRTEX_OCTREE_VALUE_BUFFER != 0) return octree_values[slot];
#endif
#if AMRTEX_CPP || (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE && !AMRTEX_OCTREE_VALUE_BUFFER)
  return texelFetch(tex_octree_values[field], octree_slot_texel(slot), 0).x;
#endif
  return real(0);
}

// ---- descents

#define AMRTEX_OCTREE_SLOT_MASK ((1u << uint(AMRTEX_OCTREE_SLOT_BITS)) - 1u)

// log2 of the width of the cells where descents start: those of the start grid, or the root.
int octree_start_shift() { return findLSB(level_width(0)) + AMRTEX_OCTREE_START_SHIFT; }

int octree_start_index(IN(uvec3) c, IN(int) shift) {
#if AMRTEX_CPP || AMRTEX_OCTREE_START
  ivec3 g = ivec3(c >> uvec3(uint(shift)));
  return g.x + u_octree_start.x * (g.y + u_octree_start.y * g.z);
#else
  return 0;
#endif
}

// Entry of the start grid; without one, of the root.
uint octree_begin(IN(uvec3) c, IN(int) shift) {
#if AMRTEX_CPP || AMRTEX_OCTREE_START
  if (AMRTEX_OCTREE_START != 0) return octree_start[octree_start_index(c, shift)];
#endif
  return uint(AMRTEX_OCTREE_START_INNER) << uint(AMRTEX_OCTREE_SLOT_BITS);
}

// Slot of the leaf that holds c, and log2 of its width.
int octree_find(IN(uvec3) c, OUT(int) shift) {
  shift = octree_start_shift();
  uint entry = octree_begin(c, shift);
  int slot = int(entry & AMRTEX_OCTREE_SLOT_MASK);
  int above = int(entry >> uint(AMRTEX_OCTREE_SLOT_BITS));
  bool inner = above == AMRTEX_OCTREE_START_INNER;
  if (inner) {
    int node = slot;
    do {
      shift -= 1;
      slot = node * 8 + octree_octant(c, shift);
      uint word = octree_word(slot);
      inner = octree_is_inner(word, slot);
      node = octree_child_node(word, slot);
    } while (inner && shift > 0);
  } else {
    shift += above;
  }
  return slot;
}

int octree_level(IN(int) shift) {
  if (AMRTEX_RATIO_SHIFT != 0) return max(AMRTEX_LEVELS - 1 - shift / AMRTEX_RATIO_SHIFT, 0);
  int level = 0;
  for (int l = 1; l < AMRTEX_LEVELS; ++l) level += level_width(l) >= (1 << shift) ? 1 : 0;
  return level;
}

bool octree_has_value(IN(int) slot) {
  if (AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_RGBA8) return (octree_word(slot) >> 24u) == uint(AMRTEX_OCTREE_LEAF);
#if AMRTEX_CPP || (AMRTEX_OCTREE_EMPTY_SLOTS && AMRTEX_OCTREE_LAYOUT == AMRTEX_OCTREE_WIDE)
  return ((octree_validity[slot >> 5] >> uint(slot & 31)) & 1u) != 0u;
#endif
  return true;
}

// Empty cells are of any power of two and may overhang the domain.
void octree_empty_region(IN(uvec3) c, IN(int) shift, INOUT(Region) r) {
  uvec3 origin = octree_from_finest(ivec3(0));
  uvec3 lower = max((c >> uvec3(uint(shift))) << uvec3(uint(shift)), origin);
  // sizes as offsets from c, so that no bit is lost in domains of 31 bits
  uvec3 rest = (uvec3(1u) << uvec3(uint(shift))) - (c & ((uvec3(1u) << uvec3(uint(shift))) - uvec3(1u)));
  r.lower = ivec3(lower - origin);
  r.upper = ivec3(min(c - origin + rest, uvec3(u_domain_cells)));
  r.width = min(r.width, 1 << min(shift, 30));
}

// Sample of a leaf, or average of an inner node, in `slot`; `node` is the inner node.
real octree_depth_value(IN(int) slot, IN(int) node, IN(bool) inner, IN(int) field) {
#if AMRTEX_CPP || AMRTEX_OCTREE_LOD
  if (AMRTEX_OCTREE_LOD != 0) {
    if (inner) return texelFetch(tex_octree_lod[field], octree_node_texel(node), 0).x;
  }
#endif
  return octree_stored(slot, field);
}

// Slot in the parent of an inner cell of the start grid, where its average stands.
int octree_average_slot(IN(uvec3) c, IN(int) shift) {
#if AMRTEX_CPP || (AMRTEX_OCTREE_START && (AMRTEX_FILTER != AMRTEX_FILTER_NEAREST || AMRTEX_LEVEL_OF_DETAIL) && !AMRTEX_OCTREE_LOD)
  return int(octree_start_slots[octree_start_index(c, shift)]);
#else
  return 0;
#endif
}

// The value of a region's cell: a leaf, or with a level of detail an inner cell.
real octree_leaf_value(IN(Region) r, IN(int) field) {
  // the octant follows from where the region lies
  int slot = r.handle.x * 8 + octree_octant(octree_from_finest(r.lower), findLSB(r.width));
  return decode_value(octree_depth_value(slot, r.handle.z, r.handle.w != 0, field), field);
}

#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
// Is the inner cell of width 2^shift that holds a finest cell one of a level, and does it suffice?
bool octree_suffices(IN(ivec3) cell, IN(int) shift) {
  int level = octree_level(shift);
  int width = level_width(level);
  if (width != 1 << shift) return false;
  ivec3 lower = cell & ivec3(-width);
  return level_suffices(lower, lower + ivec3(width), level, level + 1);
}

// octree_find, but for the cell that is drawn: the leaf, or the first inner cell above it that suffices. `node`: the inner one's, else -1.
int octree_find_drawn(IN(ivec3) cell, OUT(int) shift, OUT(int) node) {
  uvec3 c = octree_from_finest(cell);
  shift = octree_start_shift();
  uint entry = octree_begin(c, shift);
  int slot = int(entry & AMRTEX_OCTREE_SLOT_MASK);
  int above = int(entry >> uint(AMRTEX_OCTREE_SLOT_BITS));
  node = -1;
  if (above != AMRTEX_OCTREE_START_INNER) {
    shift += above;
    return slot;
  }
  int inner_node = slot;
  bool drawn = false;
  if (AMRTEX_OCTREE_START_SHIFT == 0) drawn = octree_suffices(cell, shift);
  if (drawn && AMRTEX_OCTREE_LOD == 0) slot = octree_average_slot(c, shift);
  bool inner = true;
  if (!drawn) {
    do {
      shift -= 1;
      slot = inner_node * 8 + octree_octant(c, shift);
      uint word = octree_word(slot);
      inner = octree_is_inner(word, slot);
      inner_node = octree_child_node(word, slot);
      if (inner) drawn = octree_suffices(cell, shift);
    } while (inner && !drawn && shift > 0);
  }
  if (drawn) node = inner_node;
  return slot;
}
#endif

bool locate(IN(Position) p, OUT(Region) r) {
  int shift = 0;
  uvec3 c = octree_from_finest(p.cell);
  int node = -1;
  int slot = 0;
#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
  if (AMRTEX_LEVEL_OF_DETAIL != 0) slot = octree_find_drawn(p.cell, shift, node);
#endif
  if (AMRTEX_LEVEL_OF_DETAIL == 0) slot = octree_find(c, shift);
  r.level = octree_level(shift);
  r.width = level_width(r.level);
  r.lower = p.cell & ivec3(-r.width);
  r.upper = r.lower + ivec3(r.width);
  r.value_range = vec2r(0);
  r.handle = ivec4(slot >> 3, shift, node, node >= 0 ? 1 : 0);
  bool inside = true;
  if (AMRTEX_OCTREE_EMPTY_SLOTS) {
    inside = octree_has_value(slot);
    if (!inside) octree_empty_region(c, shift, r);
  }
  if (AMRTEX_VALUE_RANGES != 0) {
    if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) {
      if (inside) r.value_range = vec2r(octree_leaf_value(r, 0));
    }
#if AMRTEX_CPP || (AMRTEX_VALUE_RANGES && AMRTEX_FILTER != AMRTEX_FILTER_NEAREST)
    else r.value_range = decode_range(octree_ranges[r.handle.x]);
#endif
  }
  return inside;
}

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
// Of another field in a region with a value.
vec2r fetch_range(IN(Region) r, IN(int) field) {
#if AMRTEX_CPP || AMRTEX_FILTER != AMRTEX_FILTER_NEAREST
  if (AMRTEX_FILTER != AMRTEX_FILTER_NEAREST)
    return decode_field_range(octree_more_ranges[r.handle.x * (AMRTEX_FIELDS - 1) + field - 1], field);
#endif
  return vec2r(octree_leaf_value(r, field));
}
#endif

// ---- the eight values of linear_lod

// Corner i of the stencil between cells `low` and `high` of one depth.
uvec3 octree_corner(IN(uvec3) low, IN(uvec3) high, IN(int) i) {
  return uvec3((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y, (i & 4) != 0 ? high.z : low.z);
}

// The paper's way: a full descent from the root to the depth whose cells are 2^shift wide.
real octree_descend(IN(uvec3) c, IN(int) shift, IN(int) field) {
  int at = octree_start_shift();
  int node = 0;
  int slot = 0;
  bool inner = true;
  do {
    at -= 1;
    slot = node * 8 + octree_octant(c, at);
    uint word = octree_word(slot);
    inner = octree_is_inner(word, slot);
    node = octree_child_node(word, slot);
  } while (inner && at > shift);
  return octree_depth_value(slot, node, inner, field);
}

void octree_stencil(IN(Region) r, IN(int) field, IN(ivec3) octant, OUT(Stencil) s) {
  int shift = r.handle.y;
  ivec3 first = r.lower + (octant - ivec3(1)) * r.width;
  ivec3 second = r.lower + octant * r.width;
  bvec3 before = lessThan(first, ivec3(0));
  bvec3 behind = greaterThanEqual(second, u_domain_cells);
  if (AMRTEX_OCTREE_GHOSTS == 0) {  // outside the domain the fill is the nearest cell's value
    first = max(first, ivec3(0));
    second = min(second, u_domain_cells - ivec3(1));
  }
  uvec3 low = octree_from_finest(first);
  uvec3 high = octree_from_finest(second);
  real v[8];
  s.leaves = 0u;
  if (AMRTEX_OCTREE_TRAVERSAL == AMRTEX_OCTREE_PAPER) {
    for (int i = 0; i < 8; ++i) v[i] = octree_descend(octree_corner(low, high, i), shift, field);
  } else {
    // All eight go down together; one that meets a leaf stays there. llvmpipe keeps these arrays in registers when it has unrolled the
    // loops over them, which have constant bounds for that; a GPU that does not unroll puts 32 numbers into local memory, and a
    // sample then waits for it.
    int slot[8];
    int node[8];
    bool inner[8];
    bool same[8];  // at the depth of the region, not above it
    int at = octree_start_shift();
    for (int i = 0; i < 8; ++i) {
      uint entry = octree_begin(octree_corner(low, high, i), at);
      slot[i] = int(entry & AMRTEX_OCTREE_SLOT_MASK);
      node[i] = slot[i];
      int above = int(entry >> uint(AMRTEX_OCTREE_SLOT_BITS));
      inner[i] = above == AMRTEX_OCTREE_START_INNER;
      same[i] = at == shift && above == 0;
    }
    if (at == shift) {  // the start grid's own depth
      for (int i = 0; i < 8; ++i) {
        if (inner[i] && AMRTEX_OCTREE_LOD == 0) slot[i] = octree_average_slot(octree_corner(low, high, i), at);
      }
    } else {
      do {
        at -= 1;
        for (int i = 0; i < 8; ++i) {
          if (inner[i]) {
            slot[i] = node[i] * 8 + octree_octant(octree_corner(low, high, i), at);
            uint word = octree_word(slot[i]);
            inner[i] = octree_is_inner(word, slot[i]);
            node[i] = octree_child_node(word, slot[i]);
            same[i] = at == shift && !inner[i];
          }
        }
      } while (at > shift);
    }
    for (int i = 0; i < 8; ++i) {
      v[i] = octree_depth_value(slot[i], node[i], inner[i], field);
      if (AMRTEX_OCTREE_EMPTY_SLOTS) {
        if (same[i]) same[i] = octree_has_value(slot[i]);
      }
      bool outside = ((i & 1) != 0 ? behind.x : before.x) || ((i & 2) != 0 ? behind.y : before.y) || ((i & 4) != 0 ? behind.z : before.z);
      s.leaves |= same[i] && !outside ? 1u << uint(i) : 0u;
    }
    // which neighbours are drawn at this level only their own locate() knows
    if (AMRTEX_LEVEL_OF_DETAIL != 0) s.leaves = 1u << uint((1 - octant.x) + 2 * (1 - octant.y) + 4 * (1 - octant.z));
  }
  s.lower = vec4r(v[0], v[1], v[2], v[3]);
  s.upper = vec4r(v[4], v[5], v[6], v[7]);
}

// Optional part of the contract: for the drawn field.
void fetch_stencil(IN(Region) r, IN(ivec3) octant, OUT(Stencil) s) { octree_stencil(r, 0, octant, s); }

// ---- gradients: the layout of the paper has room for a direction

#if AMRTEX_FETCH_GRADIENT
// Direction of a leaf's gradient, of length 1 or 0.
vec3r octree_direction(IN(uint) word) {
  real polar_code = real((word >> 16u) & 255u);
  real polar = (polar_code - real(1)) * real(3.14159265358979 / 254.0);
  real azimuth = real((word >> 8u) & 255u) * real(6.28318530717959 / 256.0);
  vec3r direction = vec3r(sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar));
  return (word >> 24u) == uint(AMRTEX_OCTREE_LEAF) && polar_code > real(0) ? direction : vec3r(0);
}

// The word of the leaf at the depth of cells 2^shift wide or above; 0 where there is none.
uint octree_leaf_word(IN(uvec3) c, IN(int) shift) {
  int at = 0;
  int slot = octree_find(c, at);
  return at >= shift ? octree_word(slot) : 0u;
}

// Optional part of the contract: the gradient of f per cell width of r; here its direction alone, of length 1
// or 0. Under linear_lod the directions of the eight cells are interpolated; those that are divided or empty have
// none and stand back.
vec3r fetch_gradient(IN(Region) r, IN(vec3r) q) {
  int shift = r.handle.y;
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) return octree_direction(octree_leaf_word(octree_from_finest(r.lower), shift));
  ivec3 octant = stencil_octant(q);
  vec3r f = q + vec3r(0.5) - vec3r(octant);
  uvec3 low = octree_from_finest(max(r.lower + (octant - ivec3(1)) * r.width, ivec3(0)));
  uvec3 high = octree_from_finest(min(r.lower + octant * r.width, u_domain_cells - ivec3(1)));
  vec3r sum = vec3r(0);
  for (int i = 0; i < 8; ++i) {
    real weight = ((i & 1) != 0 ? f.x : real(1) - f.x) * ((i & 2) != 0 ? f.y : real(1) - f.y) * ((i & 4) != 0 ? f.z : real(1) - f.z);
    sum += octree_direction(octree_leaf_word(octree_corner(low, high, i), shift)) * weight;
  }
  real size = length(sum);
  return size > real(0) ? sum / size : vec3r(0);
}
#endif

real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {
  if (AMRTEX_FILTER == AMRTEX_FILTER_NEAREST) {
    if (AMRTEX_VALUE_RANGES != 0 && field == 0) return r.value_range.x;
    return octree_leaf_value(r, field);
  }
  Stencil s;
  ivec3 octant = stencil_octant(q);
  octree_stencil(r, field, octant, s);
  return stencil_value(s, field, octant, q);
}
