// Sampling `lattice`: sample k of a ray lies at the middle of [k, k + 1) steps from the entry, a position that depends on the
// ray and k alone. Positions are anchored anew every AMRTEX_BLOCK samples and lie on a grid of 2^-12 of a finest cell (a
// quantum), so that sums of cell and fraction are exact and encodings with other regions see the same bits.
#define AMRTEX_BLOCK 256
#define AMRTEX_QUANTA real(4096)
#define AMRTEX_QUANTUM real(0.000244140625)

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
  // at most 2048 finest cells: every sum below and in lattice_q is exact
  if (AMRTEX_RAY_DOUBLE == 0) {
    real inverse_width = real(1) / real(r.width);
    frame.scale = AMRTEX_QUANTUM * inverse_width;
    frame.corner = (vec3r(from_corner) + real(0.5) * AMRTEX_QUANTUM) * inverse_width;
    return frame;
  }
  frame.corner = vec3r(divide_by_width(from_corner, r.width));
  frame.scale = real(1) / real(r.width);
  return frame;
}

vec3r lattice_q(IN(LatticeBlock) block, IN(LatticeFrame) frame, IN(Region) r, IN(real) i) {
  vec3r offset = lattice_offset(block, i);
  if (AMRTEX_RAY_DOUBLE == 0) {
    PRECISE vec3r q = offset * frame.scale + frame.corner;
    return q;
  }
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
  bvec3 up = greaterThanEqual(block.step, vec3r(0));
  int i = from;
  if (i < count) {
    do {
      Region r;
      int first = i;
      bool skipped = true;
      do {  // the next region that can be seen: all lanes of a SIMD group then sample together, 8 on llvmpipe as 32 or 64 on a GPU
        first = i;
        Position p = lattice_position(block, real(i));
        bool leaped = AMRTEX_LEAPS != 0 && leap(p, up, r);
        bool inside = true;
        if (!leaped) inside = march_locate(a, p, r);
        skipped = leaped || !inside || region_invisible(a, r);
        if (skipped || !stencils) i = lattice_exit(block, inverse_step, r, i, count);
        count_region(a, skipped);
        if (skipped) pass_region(a, inside, r, lattice_place(block, real(i) - real(0.5)));
        if (AMRTEX_PREINTEGRATED && skipped && inside) pass_points(a, block, r, first, i);
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
  if (AMRTEX_PREINTEGRATED && skipped) take_point(a, true, real(0), length);
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

