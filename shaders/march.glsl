// The one integration loop: raycaster, CPU renderer and later consumers share it.
#if !AMRTEX_CPP
#ifndef AMRTEX_MODE
#error AMRTEX_MODE must be defined: one of the AMRTEX_MODE_... below
#endif
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
DEFINE_INT(AMRTEX_MODE)
DEFINE_INT(AMRTEX_LATTICE)
DEFINE_INT(AMRTEX_SKIP)
DEFINE_INT(AMRTEX_EARLY_END)
DEFINE_INT(AMRTEX_COUNT)

// the same numbers as enum class Mode (renderers/scene.hpp)
#define AMRTEX_MODE_DVR 0
#define AMRTEX_MODE_PROJECTION 1
#define AMRTEX_MODE_MIP 2

UNIFORM(real, u_step)           // cell widths: of the finest level (lattice) or of the region (adaptive)
UNIFORM(real, u_early_end)      // transmittance at which a ray ends
UNIFORM(real, u_length_unit)    // world length of one unit of ray length (projection)

STRUCT Accumulation {
  vec3r color;         // premultiplied
  real transmittance;
  real sum;            // optical depth, or the line integral in units of ray length ...
  real lost;           // ... and what its float sum has lost so far (Kahan): long rays must not drift
  real maximum;
  ivec3 counted;       // samples, regions, regions skipped
};

Accumulation empty_accumulation() {
  Accumulation a;
  a.color = vec3r(0);
  a.transmittance = real(1);
  a.sum = real(0);
  a.lost = real(0);
  a.maximum = real(-3.0e38);
  a.counted = ivec3(0);
  return a;
}

void add_compensated(INOUT(Accumulation) a, IN(real) amount) {
  PRECISE real y = amount - a.lost;
  PRECISE real t = a.sum + y;
  PRECISE real lost = (t - a.sum) - y;
  a.lost = lost;
  a.sum = t;
}

// One interval of the exponential midpoint rule: `value` at its middle, `length` in units.
void accumulate(INOUT(Accumulation) a, IN(real) value, IN(real) length) {
  if (AMRTEX_MODE == AMRTEX_MODE_DVR) {
    vec4r light = transfer(value);
    if (light.w > real(0)) {
      PRECISE real depth = min(light.w * length, real(1e4));  // exp(-1e4) is 0; infinity would become NaN
      add_compensated(a, depth);
      real transmittance = min(exp(-a.sum), a.transmittance);
      PRECISE vec3r color = a.color + vec3r(light.x, light.y, light.z) * (a.transmittance - transmittance);
      a.color = color;
      a.transmittance = transmittance;
    }
  } else if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) {
    PRECISE real part = value * length;
    add_compensated(a, part);
  } else {
    a.maximum = max(a.maximum, value);
  }
}

bool ray_ended(IN(Accumulation) a) { return AMRTEX_EARLY_END != 0 && a.transmittance <= u_early_end; }

// May the region be left out without changing the picture?
bool region_invisible(IN(Accumulation) a, IN(Region) r) {
  if (AMRTEX_SKIP == 0 || AMRTEX_VALUE_RANGES == 0) return false;
  if (AMRTEX_MODE == AMRTEX_MODE_DVR) return !transfer_visible(r.value_range);
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) return r.value_range.x == real(0) && r.value_range.y == real(0);
  return r.value_range.y <= a.maximum;
}

void take_sample(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length) {
  real value = fetch_field(r, q);
  if (AMRTEX_COUNT != 0) a.counted.x += 1;
  if (AMRTEX_VALIDITY != 0 && is_no_value(value)) return;
  accumulate(a, value, length);
}

void count_region(INOUT(Accumulation) a, IN(bool) skipped) {
  if (AMRTEX_COUNT == 0) return;
  a.counted.y += 1;
  if (skipped) a.counted.z += 1;
}

// ---- lattice: sample k of a ray lies at the middle of [k, k + 1) steps from the entry,
// a position that depends on the ray and k alone. Positions are anchored anew every
// AMRTEX_BLOCK samples and lie on a grid of 2^-12 of a cell, so that sums of cell and
// fraction are exact and encodings with other regions see the same bits.
#define AMRTEX_BLOCK 256
#define AMRTEX_QUANTUM real(4096)

STRUCT LatticeBlock {
  ivec3 cell;       // anchor: finest cell ...
  vec3r fraction;   // ... and fraction
  vec3r step;       // finest cells a sample
  real last;        // middle of the ray's last interval, in samples from the block's first
  real end;         // the ray's exit, likewise
};

LatticeBlock lattice_block(IN(Ray) ray, IN(int) first) {
  LatticeBlock block;
  ray_real t = ray_real(u_step) * ray_real(first);
  Position anchor = make_position(ray.entry + ray.direction * t);
  block.cell = anchor.cell;
  block.fraction = anchor.fraction;
  block.step = vec3r(ray.direction) * u_step;
  block.end = real((ray.length - t) / ray_real(u_step));
  real whole = ceil(block.end) - real(1);
  block.last = (whole + block.end) * real(0.5);
  return block;
}

// Offset of sample i of the block from its anchor cell, in finest cells.
vec3r lattice_offset(IN(LatticeBlock) block, IN(real) i) {
  PRECISE vec3r way = block.step * min(i + real(0.5), block.last);
  PRECISE vec3r offset = floor((block.fraction + way) * AMRTEX_QUANTUM) / AMRTEX_QUANTUM;
  return offset;
}

ivec3 lattice_cell(IN(LatticeBlock) block, IN(real) i) {
  return clamp(block.cell + ivec3(floor(lattice_offset(block, i))), ivec3(0), u_domain_cells - ivec3(1));
}

// First sample after i of the block that lies outside the region, at most `count`.
int lattice_exit(IN(LatticeBlock) block, IN(Region) r, IN(int) i, IN(int) count) {
  vec3r to_lower = vec3r(r.lower - block.cell) - block.fraction;
  vec3r to_upper = vec3r(r.upper - block.cell) - block.fraction;
  real exit = real(count);
  for (int axis = 0; axis < 3; ++axis) {
    real d = block.step[axis];
    if (d > real(0)) exit = min(exit, to_upper[axis] / d);
    if (d < real(0)) exit = min(exit, to_lower[axis] / d);
  }
  int next = clamp(int(ceil(exit - real(0.5))), i + 1, count);
  // the division rounds; the samples' own cells decide
  if (next > i + 1 && !region_contains(r, lattice_cell(block, real(next - 1)))) next -= 1;
  else if (next < count && region_contains(r, lattice_cell(block, real(next)))) next += 1;
  return next;
}

void march_lattice_region(INOUT(Accumulation) a, IN(LatticeBlock) block, IN(Region) r, IN(int) first, IN(int) next) {
  ivec3 from_corner = block.cell - r.lower;
  ivec3 whole = divide_by_width(from_corner, r.width);
  vec3r rest = vec3r(from_corner - whole * r.width);
  vec3r corner = vec3r(whole);
  real inverse_width = real(1) / real(r.width);
  real i = real(first);
  real end = real(next);
  if (i < end) {
    do {
      PRECISE vec3r in_cells = (rest + lattice_offset(block, i)) * inverse_width;
      PRECISE vec3r q = corner + (floor(in_cells * AMRTEX_QUANTUM) + real(0.5)) / AMRTEX_QUANTUM;
      take_sample(a, r, q, u_step * min(real(1), block.end - i));
      i += real(1);
    } while (i < end && !ray_ended(a));
  }
}

void march_lattice(IN(Ray) ray, INOUT(Accumulation) a) {
  int samples = max(int(ceil(ray.length / ray_real(u_step))), 1);
  int k = 0;
  int block_first = -AMRTEX_BLOCK;
  LatticeBlock block;
  while (k < samples && !ray_ended(a)) {
    if (k >= block_first + AMRTEX_BLOCK) {
      block_first = k - k % AMRTEX_BLOCK;
      block = lattice_block(ray, block_first);
    }
    int i = k - block_first;
    int count = min(samples - block_first, AMRTEX_BLOCK);
    Position p;
    vec3r offset = lattice_offset(block, real(i));
    p.cell = lattice_cell(block, real(i));
    p.fraction = offset - floor(offset);
    Region r;
    bool inside = locate(p, r);
    int next = lattice_exit(block, r, i, count);
    bool skipped = !inside || region_invisible(a, r);
    count_region(a, skipped);
    if (!skipped) march_lattice_region(a, block, r, i, next);
    k = block_first + next;
  }
}

// ---- adaptive: each region is divided into equal intervals of at most `step` of its own cells.

// Length to the region's exit from f (finest cells from its lower corner) and the axis of that exit.
real region_exit(IN(vec3r) f, IN(vec3r) size, IN(vec3r) direction, OUT(int) exit_axis) {
  real exit = real(3e38);
  exit_axis = -1;
  for (int axis = 0; axis < 3; ++axis) {
    real d = direction[axis];
    if (d == real(0)) continue;
    real t = ((d > real(0) ? size[axis] : real(0)) - f[axis]) / d;
    if (t < exit) {
      exit = t;
      exit_axis = axis;
    }
  }
  return max(exit, real(0));
}

// The ray's next position after it left region r through `axis`.
Position leave_region(IN(Ray) ray, IN(Region) r, IN(ray_real) t, IN(int) axis) {
  Position p = make_position(ray.entry + ray.direction * t);
  p.cell = clamp(p.cell, r.lower, r.upper - ivec3(1));  // rounding must not carry it through another face
  bool forward = ray.direction[axis] > ray_real(0);
  p.cell[axis] = forward ? r.upper[axis] : r.lower[axis] - 1;
  p.fraction[axis] = forward ? real(0) : real(0.99999994);
  return p;
}

void march_adaptive_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length) {
  real inverse_width = real(1) / real(r.width);
  real count = max(ceil(length * inverse_width / u_step - real(1e-4)), real(1));
  real interval = length / count;
  vec3r q0 = f * inverse_width;
  vec3r dq = direction * (interval * inverse_width);
  real i = real(0.5);
  if (i < count) {
    do {
      take_sample(a, r, q0 + dq * i, interval);
      i += real(1);
    } while (i < count && !ray_ended(a));
  }
}

void march_adaptive(IN(Ray) ray, INOUT(Accumulation) a) {
  ray_real t = ray_real(0);
  vec3r direction = vec3r(ray.direction);
  Position p = make_position(ray.entry);
  bool more = true;
  while (more && !ray_ended(a)) {
    Region r;
    bool inside = locate(p, r);
    vec3r f = vec3r(p.cell - r.lower) + p.fraction;
    int axis = -1;
    real length = region_exit(f, vec3r(r.upper - r.lower), direction, axis);
    ray_real next = t + ray_real(length);
    more = axis >= 0 && next < ray.length;
    if (!more) length = real(max(ray.length - t, ray_real(0)));
    bool skipped = !inside || region_invisible(a, r);
    count_region(a, skipped);
    if (!skipped && length > real(0)) march_adaptive_region(a, r, f, direction, length);
    t = next;
    if (more) {
      p = leave_region(ray, r, t, axis);
      more = p.cell[axis] >= 0 && p.cell[axis] < u_domain_cells[axis];
    }
  }
}

// The picture's value for one ray: premultiplied RGBA, or (value, 0, 0, 1).
vec4r march_ray(IN(Ray) ray, INOUT(Accumulation) a) {
  if (AMRTEX_LATTICE != 0) march_lattice(ray, a);
  else march_adaptive(ray, a);
  if (AMRTEX_MODE == AMRTEX_MODE_DVR) return vec4r(a.color, real(1) - a.transmittance);
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) return vec4r(a.sum * u_length_unit, real(0), real(0), real(1));
  return vec4r(a.maximum < real(-2.9e38) ? real(0) : a.maximum, real(0), real(0), real(1));
}
