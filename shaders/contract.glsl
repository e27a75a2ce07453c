// The sampler contract: what an encoding provides and what is built on it, once.
// Prose: README.md. Spaces: integer cells of the finest level ("finest"), and cell
// widths of a region from its lower corner ("region", the q below).
// A value is a number in the units of its field (structures/mesh/value_units.hpp); the host puts pictures into field units.
DEFINE_INT(AMRTEX_FILTER)              // one of the AMRTEX_FILTER_... below
DEFINE_INT(AMRTEX_HARDWARE_FILTERING)  // 1 where the texture unit interpolates, else 0
DEFINE_INT(AMRTEX_POWER_OF_TWO)        // 1 where all refinement ratios are powers of two, else 0
DEFINE_INT(AMRTEX_RATIO_SHIFT)         // log2 of the refinement ratio where all levels have the same power of two, else 0
DEFINE_INT(AMRTEX_LEVELS)              // number of levels
DEFINE_INT(AMRTEX_FIELDS)              // how many fields of the mesh the structure holds
DEFINE_INT(AMRTEX_VALIDITY)            // 1 where cells may have no value in some field, else 0
DEFINE_INT(AMRTEX_VALUE_RANGES)        // 1 where regions know their value range, else 0
DEFINE_INT(AMRTEX_FIELD_RANGES)        // 1 where fields beside the first have value ranges as well, else 0
DEFINE_INT(AMRTEX_SCALED_STORAGE)      // 1 where texels hold (value - a) / b of a value, else 0
DEFINE_INT(AMRTEX_LEVEL_OF_DETAIL)     // 1 where refined cells may be drawn in place of what lies below, else 0

// the same numbers as enum class Filter (structures/mesh/filter.hpp; tests/filter_test.cpp compares)
#define AMRTEX_FILTER_NEAREST 0
#define AMRTEX_FILTER_LINEAR_LOD 1
#define AMRTEX_FILTER_LINEAR_PAGE 2
#define AMRTEX_FILTER_LINEAR_VERTEX 3
#define AMRTEX_FILTER_BASIS 4

// the same number as kMostFields (asserted in renderers/cpu/cpu_field.cpp.in)
#define AMRTEX_MOST_FIELDS 4

// the same number as kMostPoolTextures (asserted there as well): textures that a field's pool may be divided over
#define AMRTEX_MOST_POOL_TEXTURES 8

// Runs the statement behind it with t = number. Lanes may be in pages or bricks of different textures, and a context picks a texture by what is
// the same in all of them: each is asked in turn.
#define AMRTEX_OF_POOL_TEXTURE(t, number) \
  for (int t = 0; t < AMRTEX_POOL_TEXTURES; ++t) \
    if (AMRTEX_POOL_TEXTURES == 1 || t == (number))

#define AMRTEX_NO_RANGE 0xffffffffu  // coded range of a region without mesh

STRUCT Position {
  ivec3 cell;      // of the finest level
  vec3r fraction;  // in [0, 1)
};

// Part of the domain where one locate() stays valid. Its corners are multiples of
// its own cell width.
STRUCT Region {
  ivec3 lower;        // finest, inclusive
  ivec3 upper;        // finest, exclusive
  int level;
  int width;          // of its cells, in finest cells
  vec2r value_range;  // of every value that fetch_field can return here (AMRTEX_VALUE_RANGES): of field 0
  ivec4 handle;       // the encoding's own
  vec3r texture_lower;  // the encoding's own: texture coordinate of q = 0 (hardware filtering) ...
  vec3r texture_scale;  // ... and how much it grows with q
  uvec4 brick;          // the encoding's own: handle of the texture that holds the region (x, y), and its number (z)
};

STRUCT FieldSample {
  real value;
  int level;
};

UNIFORM(ivec3, u_domain_cells)                // finest
UNIFORM(real, u_range_origin)                 // what decode_range adds to
UNIFORM_ARRAY(vec2r, u_value_scale, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)  // a, b of each field's scaled storage
UNIFORM_ARRAY(int, u_level_width, AMRTEX_LEVELS, 64)  // cell width of each level, in finest cells

// Cell width of a level, in finest cells.
int level_width(IN(int) level) {
  if (AMRTEX_RATIO_SHIFT != 0) return 1 << (AMRTEX_RATIO_SHIFT * (AMRTEX_LEVELS - 1 - level));
  return u_level_width[level];
}

// Division of a cell index by the cell width of a level, towards minus infinity.
ivec3 divide_by_width(IN(ivec3) cell, IN(int) width) {
  if (AMRTEX_POWER_OF_TWO != 0) return cell >> findLSB(width);
  ivec3 adjusted = cell - ivec3(lessThan(cell, ivec3(0))) * (width - 1);
  return adjusted / width;
}

// The value that a texel of scaled storage stands for in field number `field`.
real decode_value(IN(real) code, IN(int) field) {
  if (AMRTEX_SCALED_STORAGE == 0) return code;
  return u_value_scale[field].x + u_value_scale[field].y * code;
}

// A value range as encodings store it: distances of minimum and maximum from the field's
// minimum, rounded outwards to the upper halves of floats (structures/common/build_tools.hpp).
vec2r decode_range(IN(uint) code) {
  return vec2r(u_range_origin + as_real(code << 16u), u_range_origin + as_real(code & 0xffff0000u));
}

#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
UNIFORM_ARRAY(real, u_range_origins, AMRTEX_FIELDS, AMRTEX_MOST_FIELDS)  // what ranges of each field are relative to

// The same of field number `field`. Encodings have `vec2r fetch_range(Region r, int field)` then, for fields beside the first.
vec2r decode_field_range(IN(uint) code, IN(int) field) {
  return vec2r(u_range_origins[field] + as_real(code << 16u), u_range_origins[field] + as_real(code & 0xffff0000u));
}
#endif

// Trilinear interpolation; v[i] belongs to corner (i & 1, (i >> 1) & 1, i >> 2). Written
// once and precise, so that every encoding's manual filter gives the same bits.
real trilinear(IN(real) v0, IN(real) v1, IN(real) v2, IN(real) v3, IN(real) v4, IN(real) v5, IN(real) v6, IN(real) v7, IN(vec3r) f) {
  PRECISE real x0 = v0 + (v1 - v0) * f.x;
  PRECISE real x1 = v2 + (v3 - v2) * f.x;
  PRECISE real x2 = v4 + (v5 - v4) * f.x;
  PRECISE real x3 = v6 + (v7 - v6) * f.x;
  PRECISE real y0 = x0 + (x1 - x0) * f.y;
  PRECISE real y1 = x2 + (x3 - x2) * f.y;
  PRECISE real z = y0 + (y1 - y0) * f.z;
  return z;
}

// The eight level values between which f is trilinear about q, in an encoding whose regions are single leaf
// cells. They stay the same while q stays in one octant of its cell, and across the cell's faces as far as the
// cells there are leaves of the same level.
STRUCT Stencil {
  vec4r lower;  // corners 0 to 3, as texels hold them
  vec4r upper;  // corners 4 to 7
  uint leaves;  // bit i: the cell at corner i is a leaf of the region's level and has a value
};

// Octant of the cell [0, 1)^3 that holds q.
ivec3 stencil_octant(IN(vec3r) q) { return ivec3(greaterThanEqual(q, vec3r(0.5))); }

// Does the stencil about `octant` of a region give f at q, which may lie in a neighbour of the region?
bool stencil_holds(IN(Stencil) s, IN(ivec3) octant, IN(vec3r) q) {
  vec3r from_corner = q - vec3r(octant);
  bvec3 upper = greaterThanEqual(from_corner, vec3r(0));
  int corner = (upper.x ? 1 : 0) + (upper.y ? 2 : 0) + (upper.z ? 4 : 0);
  bool near = all(greaterThanEqual(from_corner, vec3r(-0.5))) && all(lessThan(from_corner, vec3r(0.5)));
  return near && ((s.leaves >> uint(corner)) & 1u) != 0u;
}

real stencil_value(IN(Stencil) s, IN(int) field, IN(ivec3) octant, IN(vec3r) q) {
  PRECISE vec3r from_first = q + vec3r(0.5);
  PRECISE vec3r f = from_first - vec3r(octant);
  return decode_value(trilinear(s.lower.x, s.lower.y, s.lower.z, s.lower.w, s.upper.x, s.upper.y, s.upper.z, s.upper.w, f), field);
}

#if AMRTEX_CPP || AMRTEX_LEVEL_OF_DETAIL
UNIFORM(int, u_detail_level)    // nothing finer is drawn
UNIFORM(vec3r, u_detail_eye)    // finest
UNIFORM(vec3r, u_detail_scale)  // of a distance in finest cells: the widest cells, in finest cells, that suffice there ...
UNIFORM(real, u_detail_far)     // ... and the square of their width at any distance (orthographic views)

// May cells of `level` that are refined everywhere in a box (finest) be drawn themselves? `next` is the level that would
// take their place. After Kaehler & Hege 2002, section 7: a ball as large as a cell's diagonal, where the box is nearest to
// the eye, is smaller on the picture than the threshold. A pure function of box and scene.
bool level_suffices(IN(ivec3) lower, IN(ivec3) upper, IN(int) level, IN(int) next) {
  if (next > u_detail_level) return true;
  PRECISE vec3r away = (clamp(u_detail_eye, vec3r(lower), vec3r(upper)) - u_detail_eye) * u_detail_scale;
  PRECISE real widest = away.x * away.x + away.y * away.y + away.z * away.z + u_detail_far;
  real width = real(level_width(level));
  return width * width < widest;
}
#endif

#include AMRTEX_ENCODING_FILE

// Optional: `locate` in steps, for a march that skips: the box and value range of a group of regions about p, which a march passes as one where
// none can be seen; the region's own box and value range; and what samples in it need.
#ifndef AMRTEX_STAGED_LOCATE
#define AMRTEX_STAGED_LOCATE false
int locate_group(IN(Position) p, INOUT(Region) r) { return 0; }
bool locate_in_group(IN(Position) p, IN(int) group, INOUT(Region) r) { return locate(p, r); }
void open_region(INOUT(Region) r) {}
#endif

// The drawn field: number 0, of which ranges, constants and skipping speak.
real fetch_field(IN(Region) r, IN(vec3r) q) { return fetch_value(r, 0, q); }

// Optional: every region is one leaf cell. Then fetch_field has one value in it (nearest), or is
// stencil_value() of what fetch_stencil(r, octant, s) gives (linear), and the march fetches once for many samples.
#ifndef AMRTEX_CELL_REGIONS
#define AMRTEX_CELL_REGIONS false
void fetch_stencil(IN(Region) r, IN(ivec3) octant, OUT(Stencil) s) {
  s.lower = vec4r(0);
  s.upper = vec4r(0);
  s.leaves = 0u;
}
#endif

// Optional: may hats of finer cells than the region's reach into it?
#ifndef AMRTEX_FINER_HATS
#define AMRTEX_FINER_HATS false
#endif

// Optional: level of the leaf cell that holds a position of the region, where that is not the region's own.
#ifndef AMRTEX_LEAF_LEVEL
#define AMRTEX_LEAF_LEVEL(r) (r).level
#endif

// Optional: `vec3r fetch_gradient(Region r, vec3r q)`, the gradient of f per cell width of r along each axis, and
// AMRTEX_STORED_GRADIENTS: are they stored, and any there? Else they are the derivative of f (Encoding::analytic_gradients).
#ifndef AMRTEX_FETCH_GRADIENT
#define AMRTEX_FETCH_GRADIENT 0
#define AMRTEX_STORED_GRADIENTS false
#endif

bool region_contains(IN(Region) r, IN(ivec3) cell) {
  return all(greaterThanEqual(cell, r.lower)) && all(lessThan(cell, r.upper));
}

// Where a position lies in a region: q, in cell widths of r from its lower corner. Rounding
// never carries it through the upper face of its cell: floor(q) is that cell.
vec3r region_position(IN(Region) r, IN(Position) p) {
  ivec3 from_corner = p.cell - r.lower;
  ivec3 whole = divide_by_width(from_corner, r.width);
  PRECISE vec3r rest = (vec3r(from_corner - whole * r.width) + p.fraction) / real(r.width);
  PRECISE vec3r q = min(vec3r(whole) + rest, vec3r(whole + ivec3(1)) * AMRTEX_BELOW_ONE);
  return q;
}

// q inside a region: at most so far from its lower corner that rounding does not carry it through a face.
vec3r inside_region(IN(Region) r, IN(vec3r) q) {
  return clamp(q, vec3r(0), vec3r(r.upper - r.lower) / real(r.width) * AMRTEX_BELOW_ONE);
}

// Field number `field` (a constant at every call) at a position; false where it has no value.
bool sample_value(IN(Position) p, IN(int) field, OUT(FieldSample) s) {
  Region r;
  s.value = real(0);
  s.level = -1;
  if (any(lessThan(p.cell, ivec3(0))) || any(greaterThanEqual(p.cell, u_domain_cells))) return false;
  if (!locate(p, r)) return false;
  s.value = fetch_value(r, field, region_position(r, p));
  s.level = AMRTEX_LEAF_LEVEL(r);
  if (AMRTEX_VALIDITY != 0 && is_no_value(s.value)) return false;
  return true;
}

// The drawn field.
bool sample_field(IN(Position) p, OUT(FieldSample) s) { return sample_value(p, 0, s); }
