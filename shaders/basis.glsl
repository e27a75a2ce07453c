// The filter `basis` of encodings that keep boxes of cells of one level: pieces. A piece's hats sum to a product of clamps, and its values are the
// trilinear filter with its position clamped to the outer centres: sum of hats times values = w T. So a piece costs eight texels or one filtered fetch.
//
// An encoding includes this after it has defined
//   AMRTEX_BASIS_MISSING   1 where cells of pieces may have no value, else 0
//   AMRTEX_BASIS_SEARCH    1 where samples search their pieces, else 0
// and defines the functions that are only declared here.

// The first three words as a corner of a box.
ivec3 corner_of(IN(uvec4) words) { return ivec3(int(words.x), int(words.y), int(words.z)); }

#if AMRTEX_CPP || AMRTEX_FILTER == AMRTEX_FILTER_BASIS
#if AMRTEX_CPP || AMRTEX_BASIS_SEARCH
BUFFER(uvec4, basis_supports, basis_supports_block)  // two a node: structures/common/hat_supports.hpp
#endif

// A box of cells of one level.
STRUCT BasisPiece {
  vec3r from_corner;  // of the region's lower corner from the piece's, in cell widths of the region
  real scale;         // cell width of the region over that of the piece
  ivec3 texel;        // of its first cell
  ivec3 cells;        // along each axis
  uvec2 store;        // what else its encoding reads its texels by
};

#if !AMRTEX_CPP
real basis_texel(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell);  // as stored; cells are counted from the piece's first
#if AMRTEX_BASIS_MISSING
bool basis_has_value(IN(BasisPiece) p, IN(int) field, IN(ivec3) cell);
#endif
#if AMRTEX_BASIS_SEARCH
BasisPiece basis_found(IN(Region) r, IN(int) node);  // the piece of a leaf of basis_supports
#endif
#if AMRTEX_HARDWARE_FILTERING
real basis_filtered(IN(BasisPiece) p, IN(int) field, IN(vec3r) at);  // at: in texels from the texture's corner
real basis_widest_texture(IN(BasisPiece) p);                         // the largest of its extents, texels
#endif
#endif

// Where a piece lies whose lower corner, finest cells, and cell width are given.
void basis_place(IN(Region) r, IN(ivec3) corner, IN(int) width, INOUT(BasisPiece) p) {
  p.from_corner = vec3r(r.lower - corner) / real(r.width);
  p.scale = real(r.width) / real(width);
}

// q in cell widths of a piece from its corner.
vec3r basis_position(IN(BasisPiece) p, IN(vec3r) q) {
  PRECISE vec3r x = (q + p.from_corner) * p.scale;
  return x;
}

// Between the centres of the cells i and j.
real basis_between(IN(BasisPiece) p, IN(int) field, IN(ivec3) i, IN(ivec3) j, IN(vec3r) f) {
  return decode_value(trilinear(basis_texel(p, field, i), basis_texel(p, field, ivec3(j.x, i.y, i.z)), basis_texel(p, field, ivec3(i.x, j.y, i.z)),
                                basis_texel(p, field, ivec3(j.x, j.y, i.z)), basis_texel(p, field, ivec3(i.x, i.y, j.z)),
                                basis_texel(p, field, ivec3(j.x, i.y, j.z)), basis_texel(p, field, ivec3(i.x, j.y, j.z)), basis_texel(p, field, j), f),
                      field);
}

// Trilinear between the centres of a piece's cells, constant beyond the outer ones; x in cell widths from its corner.
real basis_clamped_value(IN(BasisPiece) p, IN(int) field, IN(vec3r) x) {
#if !AMRTEX_CPP && AMRTEX_HARDWARE_FILTERING
  // Past the centre the texture unit would read of another piece's texel: the rounding of its coordinate is kept off. That is four times 2^-24 of
  // the extent: of the sum here, the inverse extent, their product, and the texture unit's way back to texels.
  vec3r off = min(vec3r(p.cells - ivec3(1)), vec3r(1)) * (2.3841858e-7 * basis_widest_texture(p));
  vec3r inside = clamp(x, vec3r(0.5) + off, vec3r(p.cells) - vec3r(0.5) - off);
  return decode_value(basis_filtered(p, field, vec3r(p.texel) + inside), field);
#else
  PRECISE vec3r from_centre = clamp(x - vec3r(0.5), vec3r(0), vec3r(p.cells - ivec3(1)));
  ivec3 i = ivec3(floor(from_centre));
  PRECISE vec3r f = from_centre - vec3r(i);
  return basis_between(p, field, i, min(i + ivec3(1), p.cells - ivec3(1)), f);
#endif
}

// The sum of a piece's hats at x: it grows from 0, half a cell before the piece, to 1 at the first centres.
real basis_hat_sum(IN(BasisPiece) p, IN(vec3r) x) {
  PRECISE vec3r below = x + vec3r(0.5);
  PRECISE vec3r above = vec3r(p.cells) + vec3r(0.5) - x;
  vec3r w = clamp(min(below, above), vec3r(0), vec3r(1));
  PRECISE real product = w.x * w.y * w.z;
  return product;
}

// One more value with the sum of its hats into (mean so far, hats so far). Not a sum of products that is divided in the end: that
// rounds a constant field off its constant, and passes the largest float where values come near it.
void basis_add_weighted(INOUT(vec2r) mean, IN(real) value, IN(real) hats) {
  mean.y += hats;
  real share = hats > real(0) ? hats / mean.y : real(0);
  PRECISE real shift = (value - mean.x) * share;
  mean.x += shift;
}

#if AMRTEX_CPP || AMRTEX_BASIS_MISSING
// Has every cell of the piece whose hat reaches x a value?
bool basis_all_present(IN(BasisPiece) p, IN(int) field, IN(vec3r) x) {
  ivec3 first = ivec3(floor(x - vec3r(0.5)));
  bool all_there = true;
  int k = 0;
  do {
    ivec3 c = clamp(first + ivec3(k & 1, (k >> 1) & 1, k >> 2), ivec3(0), p.cells - ivec3(1));
    all_there = all_there && basis_has_value(p, field, c);
    k += 1;
  } while (k < 8);
  return all_there;
}

// Adds the piece's hats one by one; those of cells without value are left out.
void basis_add_present(IN(BasisPiece) p, IN(int) field, IN(vec3r) x, INOUT(vec2r) mean) {
  PRECISE vec3r from_centre = x - vec3r(0.5);
  vec3r whole = floor(from_centre);
  PRECISE vec3r f = from_centre - whole;
  ivec3 first = ivec3(whole);
  int k = 0;
  do {
    ivec3 corner = ivec3(k & 1, (k >> 1) & 1, k >> 2);
    ivec3 c = first + corner;
    bool there = all(greaterThanEqual(c, ivec3(0))) && all(lessThan(c, p.cells));
    if (there && basis_has_value(p, field, c)) {
      PRECISE vec3r w = vec3r(corner) * f + vec3r(ivec3(1) - corner) * (vec3r(1) - f);
      PRECISE real hat = w.x * w.y * w.z;
      basis_add_weighted(mean, decode_value(basis_texel(p, field, c), field), hat);
    }
    k += 1;
  } while (k < 8);
}

// Has the cell of the piece that holds q a value?
bool basis_holds_value(IN(BasisPiece) p, IN(int) field, IN(vec3r) q) {
  // the middle of a cell of the region's width: never at a face
  vec3r middle = (floor(q) + vec3r(0.5) + p.from_corner) * p.scale;
  return basis_has_value(p, field, clamp(ivec3(floor(middle)), ivec3(0), p.cells - ivec3(1)));
}
#endif

// Adds a piece at q; `check`: its cells may be without value.
void basis_add_piece(IN(BasisPiece) p, IN(int) field, IN(vec3r) q, IN(bool) check, INOUT(vec2r) mean) {
  vec3r x = basis_position(p, q);
#if AMRTEX_CPP || AMRTEX_BASIS_MISSING
  if (AMRTEX_BASIS_MISSING != 0 && check) {
    if (!basis_all_present(p, field, x)) {
      basis_add_present(p, field, x, mean);
      return;
    }
  }
#endif
  basis_add_weighted(mean, basis_clamped_value(p, field, x), basis_hat_sum(p, x));
}

#if AMRTEX_CPP || AMRTEX_BASIS_SEARCH
// The next leaf of basis_supports whose cells' hats may reach q, from node i on: boxes of supports, depth first; what does not hold q is passed
// over. -1: there is none. i becomes the node after it, 0 at the end.
int basis_next(IN(Region) r, IN(vec3r) q, INOUT(int) i) {
  vec3r place = q * real(r.width);
  int leaf = -1;
  do {
    uvec4 lower = basis_supports[i * 2];
    uvec4 upper = basis_supports[i * 2 + 1];
    bool holds = all(greaterThan(place, vec3r(corner_of(lower) - r.lower))) && all(lessThan(place, vec3r(corner_of(upper) - r.lower)));
    if (holds && lower.w != 0u) leaf = i;
    i = holds && lower.w == 0u ? i + 1 : int(upper.w);
  } while (i != 0 && leaf < 0);
  return leaf;
}

// f at q after a search from the root, as each sample of Wald et al. 2017 makes it.
real basis_search(IN(Region) r, IN(int) field, IN(vec3r) q, IN(bool) check) {
  vec2r mean = vec2r(0);
  int i = 0;
  do {
    int leaf = basis_next(r, q, i);
    if (leaf >= 0) basis_add_piece(basis_found(r, leaf), field, q, check, mean);
  } while (i != 0);
  return mean.x;
}
#endif
#endif
