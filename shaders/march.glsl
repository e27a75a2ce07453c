// The one integration loop: raycaster, CPU renderer and later consumers share it.
#if !AMRTEX_CPP
#ifndef AMRTEX_LATTICE
#error AMRTEX_LATTICE must be defined: 1 for lattice sampling, 0 for adaptive
#endif
#ifndef AMRTEX_SKIP
#error AMRTEX_SKIP must be defined: 1 where invisible regions are skipped, else 0
#endif
#ifndef AMRTEX_EARLY_END
#error AMRTEX_EARLY_END must be defined: 1 where a ray ends at u_early_end, else 0
#endif
#ifndef AMRTEX_COUNT
#error AMRTEX_COUNT must be defined: 1 where samples and regions are counted, else 0
#endif
#endif
DEFINE_INT(AMRTEX_LATTICE)
DEFINE_INT(AMRTEX_SKIP)
DEFINE_INT(AMRTEX_EARLY_END)
DEFINE_INT(AMRTEX_COUNT)
DEFINE_INT(AMRTEX_RAY_DOUBLE)

#if AMRTEX_CPP || AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE
#include "tolerance.glsl"
#endif
#if !AMRTEX_CPP
#ifndef AMRTEX_TRANSFERS
#error AMRTEX_TRANSFERS must be defined: fields of the volume, each with a transfer function; 1 leaves out what several need
#endif
#endif
DEFINE_INT(AMRTEX_TRANSFERS)
#define AMRTEX_SEVERAL_FIELDS (AMRTEX_TRANSFERS > 1)
#if AMRTEX_CPP || AMRTEX_SEVERAL_FIELDS
#include "fields.glsl"
#endif

UNIFORM(real, u_step)       // cell widths: of the finest level (lattice) or of the region (adaptive)
UNIFORM(real, u_early_end)  // transmittance at which a ray ends

bool ray_ended(IN(Accumulation) a) { return AMRTEX_EARLY_END != 0 && a.transmittance <= u_early_end; }

// Does the loop over samples end here: at the ray's end, or at a surface that is drawn first?
bool ray_stopped(IN(Accumulation) a) { return ray_ended(a) || (AMRTEX_ISOVALUES != 0 && a.crossing); }

// May the region be left out without changing the picture?
bool region_invisible(IN(Accumulation) a, IN(Region) r) {
  if (AMRTEX_SKIP == 0 || AMRTEX_VALUE_RANGES == 0) return false;
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0 && !on_one_side(a, r.value_range)) return false;
#endif
  if (AMRTEX_OCCLUSION != 0 && a.probing) return true;
#if AMRTEX_CPP || AMRTEX_SEVERAL_FIELDS
  if (AMRTEX_SEVERAL_FIELDS) return !fields_visible(r);
#endif
  if (AMRTEX_DRAWS_VOLUME) return !transfer_visible(r.value_range);
  if (AMRTEX_MODE == AMRTEX_MODE_ISO) return true;
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) return r.value_range.x == real(0) && r.value_range.y == real(0);
  return r.value_range.y <= a.maximum;
}

// locate(), but only as far as skipping needs: r may be a group of regions that cannot be seen, and needs open_region() before
// it is sampled. Pre-integration samples what it skips: there every region is its own. Groups know the range of the first field alone.
#define AMRTEX_SKIPS_IN_STAGES \
  (AMRTEX_STAGED_LOCATE && AMRTEX_SKIP != 0 && AMRTEX_VALUE_RANGES != 0 && !AMRTEX_PREINTEGRATED && !AMRTEX_SEVERAL_FIELDS)
bool march_locate(IN(Accumulation) a, IN(Position) p, OUT(Region) r) {
  if (!AMRTEX_SKIPS_IN_STAGES) return locate(p, r);
  int group = locate_group(p, r);
  return region_invisible(a, r) || locate_in_group(p, group, r);
}

// The sample at `at`, whose interval begins at `begin` (units of ray length; only isosurfaces use them).
void take_sample(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length, IN(ray_real) begin, IN(ray_real) at) {
#if AMRTEX_CPP || AMRTEX_SEVERAL_FIELDS
  if (AMRTEX_SEVERAL_FIELDS) {
    take_fields(a, r, q, length);
    return;
  }
#endif
  real value = fetch_field(r, q);
  if (AMRTEX_COUNT != 0) a.counted.x += 1;
  bool missing = AMRTEX_VALIDITY != 0 && is_no_value(value);
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, missing, value, begin, at);
    if (a.crossing) return;  // the surface comes first; this sample is taken again after it
    if (AMRTEX_OCCLUSION != 0 && a.probing) return;
  }
#endif
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
  if (AMRTEX_PREINTEGRATED) {
    take_point(a, missing, value, length);
    return;
  }
#endif
  if (missing) return;
#if AMRTEX_CPP || AMRTEX_SHADOWS
  if (AMRTEX_SHADOWS != 0) {
    accumulate_lit(a, value, length, place_of(r, q));
    return;
  }
#endif
  accumulate(a, value, length);
}

// Many intervals of one length in a region of one value: what take_sample does with each, in
// the same order, so that the bits are the same; but one fetch and one transfer for all. In the light of a lamp
// each sample is its own: AMRTEX_CONSTANT_REGIONS is false.
// `begin` and `way`: where the first interval begins, and from each to the next.
#define AMRTEX_CONSTANT_REGIONS \
  (AMRTEX_CELL_REGIONS && AMRTEX_FILTER == AMRTEX_FILTER_NEAREST && AMRTEX_SHADOWS == 0 && !AMRTEX_PREINTEGRATED && !AMRTEX_SEVERAL_FIELDS)
// Eight values for many samples are those of one field.
#define AMRTEX_STENCILS (AMRTEX_CELL_REGIONS && AMRTEX_FILTER != AMRTEX_FILTER_NEAREST && !AMRTEX_SEVERAL_FIELDS)
void take_constant_samples(INOUT(Accumulation) a, IN(Region) r, IN(real) count, IN(real) length, IN(ray_real) begin, IN(ray_real) way) {
  real value = fetch_field(r, vec3r(0.5));
  if (AMRTEX_COUNT != 0) a.counted.x += int(count);
  bool missing = AMRTEX_VALIDITY != 0 && is_no_value(value);
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, missing, value, begin, begin + way * ray_real(0.5));
    if (a.crossing) return;
    a.before = begin + way * ray_real(count - real(0.5));
    if (AMRTEX_OCCLUSION != 0 && a.probing) return;
  }
#endif
  if (missing) return;
  vec4r light = vec4r(1);
  if (AMRTEX_DRAWS_VOLUME) light = interval_light(value, length);
  if (AMRTEX_MODE == AMRTEX_MODE_ISO) light.w = real(0);
  real i = real(0);
  if (light.w > real(0)) {
    do {
      if (AMRTEX_DRAWS_VOLUME) add_light(a, light);
      else accumulate(a, value, length);
      i += real(1);
    } while (i < count && AMRTEX_MODE != AMRTEX_MODE_MIP && !ray_ended(a));
  }
}

void take_stencil_sample(INOUT(Accumulation) a, IN(Region) r, IN(Stencil) s, IN(ivec3) octant, IN(vec3r) q, IN(real) length,
                         IN(ray_real) begin, IN(ray_real) at) {
  if (AMRTEX_COUNT != 0) a.counted.x += 1;
  real value = stencil_value(s, 0, octant, q);
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, false, value, begin, at);
    if (a.crossing || (AMRTEX_OCCLUSION != 0 && a.probing)) return;
  }
#endif
#if AMRTEX_CPP || AMRTEX_SHADOWS
  if (AMRTEX_SHADOWS != 0) {
    accumulate_lit(a, value, length, place_of(r, q));
    return;
  }
#endif
  accumulate(a, value, length);
}

// A region that is not sampled, up to `exit`: a ray passes on its side, and loses it where there is no mesh.
void pass_region(INOUT(Accumulation) a, IN(bool) inside, IN(Region) r, IN(ray_real) exit) {
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    a.below = inside ? isovalues_below(r.value_range.x) : -1;
    a.before = exit;
  }
#endif
  a.end_level = -1;
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
  if (AMRTEX_PREINTEGRATED && AMRTEX_LATTICE != 0 && !inside) take_point(a, true, real(0), u_step);
#endif
}

void count_region(INOUT(Accumulation) a, IN(bool) skipped) {
  if (AMRTEX_COUNT == 0) return;
  a.counted.y += 1;
  if (skipped) a.counted.z += 1;
}

// From where a ray is marched on after a surface.
STRUCT Front {
  int next;          // lattice: the next sample
  ray_real t;        // adaptive: where the region begins, ...
  Position p;        // ... the same as a position, ...
  real part;         // ... and the middle of its next interval, in intervals
};

// ---- lattice: sample k of a ray lies at the middle of [k, k + 1) steps from the entry,
// a position that depends on the ray and k alone. Positions are anchored anew every
// AMRTEX_BLOCK samples and lie on a grid of 2^-12 of a finest cell, so that sums of cell and
// fraction are exact and encodings with other regions see the same bits.
#define AMRTEX_BLOCK 256
// A ray that a plane cuts begins inside of an interval, and so does one whose intervals are moved: what is left of it is an
// interval of its own (the head), with a sample in its own middle.
#define AMRTEX_CUT (AMRTEX_CLIP_PLANES > 0 || AMRTEX_RAY_OFFSET != 0)

ray_real interval_begin(IN(Ray) ray, IN(int) k) {
  if (AMRTEX_RAY_OFFSET != 0) return ray_real(u_step) * (ray_real(k) + ray_real(ray.phase));
  return ray_real(u_step) * ray_real(k);
}

// The first interval that is drawn in full, ...
int first_interval(IN(Ray) ray) {
  return AMRTEX_CUT ? max(int(ceil(ray.first / ray_real(u_step) - ray_real(ray.phase))), 0) : 0;
}

// ... and the one behind the last.
int full_intervals(IN(Ray) ray) {
  if (AMRTEX_RAY_OFFSET != 0) return max(int(floor(ray.length / ray_real(u_step) - ray_real(ray.phase))), 0);
  return int(floor(ray.length / ray_real(u_step)));
}

ray_real head_end(IN(Ray) ray) { return min(interval_begin(ray, first_interval(ray)), ray.length); }
#define AMRTEX_QUANTA real(4096)
#define AMRTEX_QUANTUM real(0.000244140625)

STRUCT LatticeBlock {
  ivec3 cell;      // anchor: finest cell ...
  vec3r fraction;  // ... and fraction, in quanta
  vec3r step;      // quanta a sample
  int first;       // its first sample, counted from the ray's entry
  real phase;      // of the ray
};

LatticeBlock lattice_block(IN(Ray) ray, IN(int) first) {
  LatticeBlock block;
  ray_real t = interval_begin(ray, first);
  Position anchor = make_position(ray.entry + ray.direction * t);
  block.cell = anchor.cell;
  block.fraction = anchor.fraction * AMRTEX_QUANTA;
  block.step = vec3r(ray.direction) * (u_step * AMRTEX_QUANTA);
  block.first = first;
  block.phase = ray.phase;
  return block;
}

// Offset of sample i of the block from its anchor cell, in whole quanta.
vec3r lattice_offset(IN(LatticeBlock) block, IN(real) i) {
  PRECISE vec3r way = block.step * (i + AMRTEX_SAMPLE_PLACE);
  PRECISE vec3r offset = floor(block.fraction + way);
  return offset;
}

ivec3 lattice_cell(IN(LatticeBlock) block, IN(real) i) {
  return clamp(block.cell + ivec3(floor(lattice_offset(block, i) * AMRTEX_QUANTUM)), ivec3(0), u_domain_cells - ivec3(1));
}

// First sample after i of the block that lies outside the region, at most `count`.
int lattice_exit(IN(LatticeBlock) block, IN(vec3r) inverse_step, IN(Region) r, IN(int) i, IN(int) count) {
  bvec3 up = greaterThanEqual(block.step, vec3r(0));
  ivec3 face = ivec3(up.x ? r.upper.x : r.lower.x, up.y ? r.upper.y : r.lower.y, up.z ? r.upper.z : r.lower.z);
  vec3r plane = vec3r(face - block.cell) * AMRTEX_QUANTA;
  vec3r far = (plane - block.fraction) * inverse_step;
  real exit = min(min(far.x, far.y), min(far.z, real(count)));
  int next = clamp(int(ceil(exit - AMRTEX_SAMPLE_PLACE)), i + 1, count);
  // the division rounds; where the samples lie decides
  bool too_far = false;
  bool too_near = false;
#if AMRTEX_CPP || !AMRTEX_RAY_DOUBLE
  if (AMRTEX_RAY_DOUBLE == 0) {
    // Offsets and planes are whole numbers of quanta below 2^24. Inside is below the upper plane, or not below
    // the lower one; beyond the domain's faces samples belong to the last cell.
    vec3r sense = vec3r(up) * real(2) - vec3r(1);
    ivec3 open = ivec3(equal(face, ivec3(up) * u_domain_cells));
    vec3r bound = sense * plane + (vec3r(1) - vec3r(up)) + vec3r(open) * real(1e30);
    too_far = next > i + 1 && any(greaterThanEqual(sense * lattice_offset(block, real(next - 1)), bound));
    too_near = next < count && all(lessThan(sense * lattice_offset(block, real(next)), bound));
    return next + (too_near ? 1 : 0) - (too_far ? 1 : 0);
  }
#endif
  too_far = next > i + 1 && !region_contains(r, lattice_cell(block, real(next - 1)));
  too_near = next < count && region_contains(r, lattice_cell(block, real(next)));
  return next + (too_near ? 1 : 0) - (too_far ? 1 : 0);
}

// q of a sample is offset * scale + corner.
STRUCT LatticeFrame {
  vec3r corner;  // cell widths of the region: its samples' q at offset 0, plus half a quantum
  real scale;    // cell widths of the region a quantum
};

LatticeFrame lattice_frame(IN(LatticeBlock) block, IN(Region) r) {
  ivec3 from_corner = block.cell - r.lower;
  LatticeFrame frame;
#if AMRTEX_CPP || !AMRTEX_RAY_DOUBLE
  // at most 2048 finest cells: every sum below and in lattice_q is exact
  if (AMRTEX_RAY_DOUBLE == 0) {
    real inverse_width = real(1) / real(r.width);
    frame.scale = AMRTEX_QUANTUM * inverse_width;
    frame.corner = (vec3r(from_corner) + real(0.5) * AMRTEX_QUANTUM) * inverse_width;
    return frame;
  }
#endif
  frame.corner = vec3r(divide_by_width(from_corner, r.width));
  frame.scale = real(1) / real(r.width);
  return frame;
}

vec3r lattice_q(IN(LatticeBlock) block, IN(LatticeFrame) frame, IN(Region) r, IN(real) i) {
  vec3r offset = lattice_offset(block, i);
#if AMRTEX_CPP || !AMRTEX_RAY_DOUBLE
  if (AMRTEX_RAY_DOUBLE == 0) {
    PRECISE vec3r q = offset * frame.scale + frame.corner;
    return q;
  }
#endif
  // large domains: positions are rounded once more, to 2^-12 of the region's own cells
  ivec3 from_corner = block.cell - r.lower;
  vec3r rest = vec3r(from_corner - divide_by_width(from_corner, r.width) * r.width);
  PRECISE vec3r in_cells = (rest + offset * AMRTEX_QUANTUM) * frame.scale;
  PRECISE vec3r q_large = frame.corner + (floor(in_cells * AMRTEX_QUANTA) + real(0.5)) * AMRTEX_QUANTUM;
  return q_large;
}

// Where sample i of the block lies, or with - 1/2 where its interval begins (units of ray length).
ray_real lattice_place(IN(LatticeBlock) block, IN(real) i) {
  if (AMRTEX_RAY_OFFSET != 0) return ray_real(u_step) * (ray_real(block.first) + ray_real(block.phase) + ray_real(i));
  return ray_real(u_step) * (ray_real(block.first) + ray_real(i));
}

#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
// Points first to next - 1 lie in a region that cannot be seen: no interval between them can, but those before and
// behind them may be.
void pass_points(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(Region) r, IN(int) first, IN(int) next) {
  LatticeFrame frame = lattice_frame(block, r);
  int i = first;
  do {
    take_sample(a, r, lattice_q(block, frame, r, real(i)), u_step, ray_real(0), ray_real(0));
    a.end_state = i + 1 < next ? AMRTEX_END_NONE : a.end_state;
    i = max(i + 1, next - 1);
  } while (i < next);
}
#endif

// Returns the sample that lies across a surface, or `next`.
int march_lattice_region(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(Region) r, IN(int) first, IN(int) next) {
  if (AMRTEX_CONSTANT_REGIONS) {
    take_constant_samples(a, r, real(next - first), u_step, lattice_place(block, real(first)), ray_real(u_step));
    return AMRTEX_ISOVALUES != 0 && a.crossing ? first : next;
  }
  LatticeFrame frame = lattice_frame(block, r);
  real i = real(first);
  real end = real(next);
  if (i < end) {
    do {
      take_sample(a, r, lattice_q(block, frame, r, i), u_step, lattice_place(block, i), lattice_place(block, i + real(0.5)));
      i += real(1);
    } while (i < end && !ray_stopped(a));
  }
  return AMRTEX_ISOVALUES != 0 && a.crossing ? int(i) - 1 : next;
}

// 1 / v without infinities: a ray along a face, or almost along it, never ends a region through it.
vec3r safe_inverse(IN(vec3r) v) {
  vec3r sense = vec3r(greaterThanEqual(v, vec3r(0))) * real(2) - vec3r(1);
  return sense / max(abs(v), vec3r(1e-20));
}

// Samples from `first` on for which the eight values about it hold; returns the first that needs others, or
// lies across a surface.
int march_lattice_stencil(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(Region) r, IN(int) first, IN(int) count) {
  LatticeFrame frame = lattice_frame(block, r);
  real i = real(first);
  real end = real(count);
  vec3r q = lattice_q(block, frame, r, i);
  ivec3 octant = stencil_octant(q);
  Stencil s;
  fetch_stencil(r, octant, s);
  bool holds = true;
  do {
    take_stencil_sample(a, r, s, octant, q, u_step, lattice_place(block, i), lattice_place(block, i + real(0.5)));
    i += real(1);
    q = lattice_q(block, frame, r, i);
    holds = stencil_holds(s, octant, q);
  } while (holds && i < end && !ray_stopped(a));
  return AMRTEX_ISOVALUES != 0 && a.crossing ? int(i) - 1 : int(i);
}

Position lattice_position(IN(LatticeBlock) block, IN(real) i) {
  Position p;
  vec3r offset = lattice_offset(block, i) * AMRTEX_QUANTUM;
  p.cell = clamp(block.cell + ivec3(floor(offset)), ivec3(0), u_domain_cells - ivec3(1));
  p.fraction = offset - floor(offset);
  return p;
}

// From sample `from` of the block; returns the one across a surface, or `count`.
int march_lattice_block(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(int) from, IN(int) count) {
  bool stencils = AMRTEX_STENCILS;  // their own cells decide where they end
  vec3r inverse_step = safe_inverse(block.step);
  int i = from;
  if (i < count) {
    do {
      Region r;
      int first = i;
      bool skipped = true;
      do {  // the next region that can be seen: all lanes of a SIMD group then sample together
        first = i;
        bool inside = march_locate(a, lattice_position(block, real(i)), r);
        skipped = !inside || region_invisible(a, r);
        if (skipped || !stencils) i = lattice_exit(block, inverse_step, r, i, count);
        count_region(a, skipped);
        if (skipped) pass_region(a, inside, r, lattice_place(block, real(i) - real(0.5)));
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
        if (AMRTEX_PREINTEGRATED && skipped && inside) pass_points(a, block, r, first, i);
#endif
      } while (skipped && i < count);
      if (AMRTEX_SKIPS_IN_STAGES && !skipped) open_region(r);
      if (stencils && !skipped) i = march_lattice_stencil(a, block, r, first, count);
      if (!stencils && !skipped) i = march_lattice_region(a, block, r, first, i);
    } while (i < count && !ray_stopped(a));
  }
  return i;
}

// A sample at `at` as a block of one, which lies at p. `whole`: full intervals before its own.
LatticeBlock lattice_point(IN(Ray) ray, IN(int) whole, IN(ray_real) at, OUT(Position) p) {
  LatticeBlock block;
  p = make_position(ray.entry + ray.direction * at);
  block.cell = p.cell;
  block.fraction = p.fraction * AMRTEX_QUANTA;
  block.step = vec3r(0);
  block.first = whole;
  block.phase = ray.phase;
  return block;
}

void take_lattice_point(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(Region) r, IN(ray_real) start, IN(ray_real) at, IN(real) length) {
  take_sample(a, r, lattice_q(block, lattice_frame(block, r), r, real(0)), length, start, at);
}

// A sample at `at` for an interval of `length`, which begins at `start`.
void march_lattice_point(INOUT(Accumulation) a, IN(Ray) ray, IN(int) whole, IN(ray_real) start, IN(ray_real) at, IN(real) length) {
  Position p;
  LatticeBlock block = lattice_point(ray, whole, at, p);
  Region r;
  bool inside = locate(p, r);
  bool skipped = !inside || (region_invisible(a, r) && !AMRTEX_PREINTEGRATED);
  count_region(a, skipped);
  if (!skipped) take_lattice_point(a, block, r, start, at, length);
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
  if (AMRTEX_PREINTEGRATED && skipped) take_point(a, true, real(0), length);
#endif
}

// The interval from `start` to `end`, shorter than others: what is left after `whole` full ones, or a head.
void march_lattice_part(INOUT(Accumulation) a, IN(Ray) ray, IN(int) whole, IN(ray_real) start, IN(ray_real) end) {
  real length = real(end - start);
  if (AMRTEX_PREINTEGRATED) {  // the end of the last full one, where there is one, and its own
    int i = 0;
    do {
      march_lattice_point(a, ray, whole, start, i == 0 ? start : end, i == 0 ? u_step : length);
      i += 1;
    } while (i < 2 && length > real(0));
    return;
  }
  bool left = AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_LEFT;
  march_lattice_point(a, ray, whole, start, left ? start : (start + end) * ray_real(0.5), length);
}

void march_head(IN(Ray) ray, INOUT(Accumulation) a) {
  ray_real end = head_end(ray);
  if (AMRTEX_LATTICE == 0 || !(ray.first < end)) return;
  march_lattice_part(a, ray, first_interval(ray), ray.first, end);
  a.end_state = AMRTEX_END_NONE;  // the lattice takes the point at its end itself
}

// Three nested loops (blocks, regions, samples): what is computed in an inner one is paid
// by every lane of a SIMD group at every turn.
void march_lattice(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  int whole = full_intervals(ray);
  bool begins_later = AMRTEX_ISOVALUES != 0 || AMRTEX_CUT;
  int first = begins_later ? front.next & ~(AMRTEX_BLOCK - 1) : 0;
  if (first < whole) {
    do {
      int from = begins_later ? max(front.next - first, 0) : 0;
      front.next = first + march_lattice_block(a, lattice_block(ray, first), from, min(whole - first, AMRTEX_BLOCK));
      first += AMRTEX_BLOCK;
    } while (first < whole && !ray_stopped(a));
  }
  bool rest = AMRTEX_PREINTEGRATED || interval_begin(ray, whole) < ray.length;
  rest = rest && first_interval(ray) <= whole;  // else the head was all
  if (rest && !ray_stopped(a)) march_lattice_part(a, ray, whole, interval_begin(ray, whole), ray.length);
}

// ---- adaptive: each region is divided into equal intervals of at most `step` of its own cells.

// The ray's next position after it left region r through the axis that `through` marks.
Position leave_region(IN(Ray) ray, IN(Region) r, IN(ray_real) t, IN(bvec3) through) {
  ray_vec3 at = ray.entry + ray.direction * t;
  // rounding must not carry it through another face
  ray_vec3 whole = clamp(floor(at), ray_vec3(r.lower), ray_vec3(r.upper - ivec3(1)));
  Position p;
  p.cell = ivec3(whole);
  p.fraction = clamp(vec3r(at - whole), vec3r(0), vec3r(AMRTEX_BELOW_ONE));
  for (int axis = 0; axis < 3; ++axis) {
    bool forward = ray.direction[axis] > ray_real(0);
    p.cell[axis] = through[axis] ? (forward ? r.upper[axis] : r.lower[axis] - 1) : p.cell[axis];
    p.fraction[axis] = through[axis] ? (forward ? real(0) : real(AMRTEX_BELOW_ONE)) : p.fraction[axis];
  }
  return p;
}

// The interval of a region that is the i-th to be sampled (from 0.5 on): its middle and its length, in intervals. Where a ray's
// intervals are moved the first and the last of `count` + 1 are parts of one.
vec2r interval_at(IN(real) i, IN(real) count, IN(real) phase) {
  if (AMRTEX_RAY_OFFSET == 0) return vec2r(i, 1);
  real from = max(i - real(1.5) + phase, real(0));
  real to = min(i - real(0.5) + phase, count);
  return vec2r((from + to) * real(0.5), to - from);
}

// What march_adaptive_region does, with the eight values of one octant at a time.
real march_adaptive_cell(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) count, IN(real) interval,
                         IN(ray_real) begin, IN(real) from, IN(real) phase) {
  real i = from;
  real last = AMRTEX_RAY_OFFSET != 0 ? count + real(1) : count;
  vec2r part = interval_at(i, count, phase);
  vec3r q = q0 + dq * part.x;
  if (i < last) {
    do {
      ivec3 octant = stencil_octant(q);
      Stencil s;
      fetch_stencil(r, octant, s);
      bool same = true;
      do {
        ray_real start = begin + ray_real(interval * (part.x - real(0.5) * part.y));
        take_stencil_sample(a, r, s, octant, q, interval * part.y, start, begin + ray_real(interval * part.x));
        i += real(1);
        part = interval_at(i, count, phase);
        q = q0 + dq * part.x;
        same = all(equal(stencil_octant(q), octant));
      } while (same && i < last && !ray_stopped(a));
    } while (i < last && !ray_stopped(a));
  }
  return i - real(1);
}

#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
// Both ends of every interval, of this region's own values: a region beyond a face may have others there.
void march_points(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) count, IN(real) interval) {
  real i = real(0);
  a.end_state = AMRTEX_END_NONE;
  do {
    take_sample(a, r, inside_region(r, q0 + dq * i), interval, ray_real(0), ray_real(0));
    i += real(1);
  } while (i <= count && !ray_ended(a));
}
#endif

// From interval middle `from` on; returns that across a surface, or of the last sample. `phase`: the ray's.
real march_adaptive_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length, IN(ray_real) begin,
                           IN(real) from, IN(real) phase) {
  real inverse_width = real(1) / real(r.width);
#if AMRTEX_CPP || AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE) {
    march_tolerance_region(a, r, f * inverse_width, direction * inverse_width, length, AMRTEX_EARLY_END != 0 ? u_early_end : real(0));
    return from;
  }
#endif
  // a float counts to 2^24: the host refuses smaller steps, and no loop is endless
  real count = clamp(ceil(length * inverse_width / u_step - real(1e-4)), real(1), real(16777216));
  real interval = length / count;
  if (AMRTEX_CONSTANT_REGIONS) {
    ray_real first = begin + ray_real(interval * (from - real(0.5)));
    take_constant_samples(a, r, count - (from - real(0.5)), interval, first, ray_real(interval));
    return from;
  }
  vec3r q0 = f * inverse_width;
  vec3r dq = direction * (interval * inverse_width);
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
  if (AMRTEX_PREINTEGRATED) {
    march_points(a, r, q0, dq, count, interval);
    return from;
  }
#endif
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_LEFT) q0 -= dq * real(0.5);
  if (AMRTEX_STENCILS) return march_adaptive_cell(a, r, q0, dq, count, interval, begin, from, phase);
  real i = from;
  real last = AMRTEX_RAY_OFFSET != 0 ? count + real(1) : count;
  if (i < last) {
    do {
      vec2r part = interval_at(i, count, phase);
      vec3r q = q0 + dq * part.x;
      if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_LEFT) q = inside_region(r, q);
      ray_real start = begin + ray_real(interval * (part.x - real(0.5) * part.y));
      take_sample(a, r, q, interval * part.y, start, begin + ray_real(interval * part.x));
      i += real(1);
    } while (i < last && !ray_stopped(a));
  }
  return i - real(1);
}

void march_adaptive(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  vec3r direction = vec3r(ray.direction);
  bvec3 forward = greaterThan(ray.direction, ray_vec3(0));
  ray_vec3 speed = abs(ray.direction);
  // along an axis that it does not move on, a ray leaves through no face, wherever rounding put it
  ray_vec3 still = ray_vec3(lessThan(speed, ray_vec3(1e-20))) * ray_real(1e30);
  ray_vec3 inverse = ray_real(1) / max(speed, ray_vec3(1e-20));
  ray_real t = front.t;
  Position p = front.p;
  real part = front.part;
  bool more = true;
  do {
    Region r;
    ray_real length = ray_real(0);
    bool skipped = true;
    do {  // the next region that can be seen: all lanes of a SIMD group then sample together
      bool inside = march_locate(a, p, r);
      front.t = t;
      front.p = p;
      // Where the ray meets a face follows from ray and face alone: whatever lies before it, one hidden region or many, the next
      // region is entered at the same place to the bit, and lengths sum to the chord.
      ray_vec3 lower = ray.entry - ray_vec3(r.lower);
      ray_vec3 upper = ray_vec3(r.upper) - ray.entry;
      ray_vec3 ahead = ray_vec3(forward.x ? upper.x : lower.x, forward.y ? upper.y : lower.y, forward.z ? upper.z : lower.z);
      ray_vec3 exits = ahead * inverse + still;
      ray_real next = max(min(exits.x, min(exits.y, exits.z)), t);
      more = next < ray.length;
      length = max((more ? next : ray.length) - t, ray_real(0));
      skipped = !inside || region_invisible(a, r);
      count_region(a, skipped);
      if (skipped) pass_region(a, inside, r, next);
      t = next;
      bool x = exits.x <= min(exits.y, exits.z);
      bool y = !x && exits.y <= exits.z;
      p = leave_region(ray, r, t, bvec3(x, y, !x && !y));
      more = more && all(greaterThanEqual(p.cell, ivec3(0))) && all(lessThan(p.cell, u_domain_cells));
    } while (skipped && more);
    if (AMRTEX_SKIPS_IN_STAGES && !skipped) open_region(r);
    vec3r f = vec3r(ray_vec3(front.p.cell - r.lower) + ray_vec3(front.p.fraction));  // as exact as the ray before it is rounded
    if (!skipped && length > ray_real(0)) front.part = march_adaptive_region(a, r, f, direction, real(length), front.t, part, ray.phase);
    part = real(0.5);
  } while (more && !ray_stopped(a));
}

void march(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  if (AMRTEX_LATTICE != 0) march_lattice(ray, a, front);
  else march_adaptive(ray, a, front);
}

#if AMRTEX_CPP || AMRTEX_OCCLUSION
// Does a ray that begins on a side (-1: on none) meet a surface? Sampled adaptively, as all secondary rays.
bool meets_surface(INOUT(Accumulation) a, IN(Ray) ray, IN(int) side) {
  Accumulation probe = empty_accumulation();
  probe.probing = true;
  probe.below = side;
  probe.counted = a.counted;
  Front front;
  front.next = 0;
  front.t = ray_real(0);
  front.p = make_position(ray.entry);
  front.part = real(0.5);
  if (ray.length > ray_real(0)) march_adaptive(ray, probe, front);
  a.counted = probe.counted;
  return probe.crossing;
}
#endif

#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
// The loop over samples stops at each surface, so that none of what a surface costs (bisection,
// gradient) is inside of it.
void march_surfaces(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front, IN(bool) goes_on) {
  bool more = true;
  bool at_mirror = false;
  do {
    if (!at_mirror) march(ray, a, front);
#if AMRTEX_CPP || AMRTEX_MIRROR
    if (AMRTEX_MIRROR != 0 && goes_on && !a.crossing && !ray_ended(a)) {
      at_mirror = true;
      note_end(ray, a);
    }
#endif
    more = a.crossing;
    if (a.crossing) draw_surface(ray, a);
    more = more && !surfaces_ended(a) && !ray_ended(a);
  } while (more);
}
#endif

// The picture's value for a ray that misses the drawn box.
vec4r missed_picture() {
  return vec4r(real(0), real(0), real(0), real(AMRTEX_MODE == AMRTEX_MODE_PROJECTION || AMRTEX_MODE == AMRTEX_MODE_MIP ? 1 : 0));
}

// The picture's value for what a ray has gathered, surfaces apart: premultiplied RGBA, or (value, 0, 0, 1).
vec4r volume_picture(IN(Accumulation) a) {
  if (AMRTEX_MODE == AMRTEX_MODE_DVR) return vec4r(a.color, real(1) - a.transmittance);
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) return vec4r(a.sum * u_length_unit, real(0), real(0), real(1));
  return vec4r(a.maximum < real(-3.4028235e38) ? real(0) : a.maximum, real(0), real(0), real(1));
}

// A ray, or the part of one before or behind the mirror.
void march_part(IN(Ray) ray, INOUT(Accumulation) a, IN(bool) goes_on) {
  Front front;
  front.next = first_interval(ray);
  front.t = ray.first;
  front.p = make_position(AMRTEX_CUT ? ray.entry + ray.direction * ray.first : ray.entry);
  front.part = real(0.5);
  if (AMRTEX_CUT) march_head(ray, a);
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    if (!AMRTEX_CUT || !ray_ended(a)) march_surfaces(ray, a, front, goes_on);
    return;
  }
#endif
  if (!AMRTEX_CUT || !ray_ended(a)) march(ray, a, front);
}

// May what lies behind be left out?
bool picture_ended(IN(Accumulation) a) {
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0 && surfaces_ended(a)) return true;
#endif
  return ray_ended(a);
}

// The picture's value for one ray.
vec4r march_ray(IN(Ray) ray, INOUT(Accumulation) a) {
#if AMRTEX_CPP || AMRTEX_MIRROR
  for (int i = 0; i < (AMRTEX_MIRROR != 0 ? 2 : 1); ++i) {
    Ray part = ray;
    bool goes_on = false;
    bool drawn = AMRTEX_MIRROR == 0 || (mirrored_part(ray, i, part, goes_on) && !picture_ended(a));
    a.before = ray_real(0);  // on the mirror, where the part before noted its side
    a.end_state = AMRTEX_END_NONE;
    a.end_level = -1;
    if (drawn) march_part(part, a, goes_on);
  }
#else
  march_part(ray, a, false);
#endif
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) return surface_picture(a);
#endif
  return volume_picture(a);
}
