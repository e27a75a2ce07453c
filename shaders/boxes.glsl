// What a ray gathers in one box alone, for consumers that draw box by box and blend the results: the same samples
// as march.glsl takes there (multi-pass), or one sample on a plane perpendicular to the direction of view (slices).
DEFINE_INT(AMRTEX_SLICES)  // 1 where boxes are drawn as slices, 0 where rays are marched through them

UNIFORM(ray_real, u_first_slice)  // units: distance of slice 0 from the eye, along the direction of view

// Where a ray enters and leaves the region, grown by `margin` finest cells; units from the ray's entry. False where it misses.
bool region_interval(IN(Ray) ray, IN(Region) r, IN(ray_real) margin, OUT(ray_real) enter, OUT(ray_real) leave) {
  enter = ray.first;
  leave = ray.length;
  ivec3 entry_cell = make_position(ray.entry).cell;
  for (int axis = 0; axis < 3; ++axis) {
    ray_real o = ray.entry[axis];
    ray_real d = ray.direction[axis];
    if (d == ray_real(0)) {  // parallel to these faces: the cells that it passes decide
      if (entry_cell[axis] < r.lower[axis] || entry_cell[axis] >= r.upper[axis]) return false;
    } else {
      ray_real t0 = (ray_real(r.lower[axis]) - margin - o) / d;
      ray_real t1 = (ray_real(r.upper[axis]) + margin - o) / d;
      enter = max(enter, min(t0, t1));
      leave = min(leave, max(t0, t1));
    }
  }
  return leave > enter;
}

// The interval from `start` to `end`, shorter than others, where its sample lies in the region.
void take_box_part(IN(Ray) ray, IN(Region) r, INOUT(Accumulation) a, IN(int) whole, IN(ray_real) start, IN(ray_real) end) {
  if (!(start < end)) return;
  Position p;
  ray_real middle = (start + end) * ray_real(0.5);
  LatticeBlock part = lattice_point(ray, whole, middle, p);
  if (region_contains(r, p.cell)) take_lattice_point(a, part, r, start, middle, real(end - start));
}

// Lattice samples whose cells lie in the region. The interval only tells where to look for the first.
#define AMRTEX_BOX_MARGIN ray_real(0.00390625)
void march_lattice_box(IN(Ray) ray, IN(Region) r, INOUT(Accumulation) a) {
  ray_real enter;
  ray_real leave;
  if (!region_interval(ray, r, AMRTEX_BOX_MARGIN, enter, leave)) return;
  int whole = full_intervals(ray);
  int from = max(int(floor(enter / ray_real(u_step))) - 2, first_interval(ray));
  int to = min(int(ceil(leave / ray_real(u_step))) + 2, whole);
  int first = from & ~(AMRTEX_BLOCK - 1);
  if (AMRTEX_CUT) take_box_part(ray, r, a, first_interval(ray), ray.first, head_end(ray));
  if (from < to) {
    do {
      LatticeBlock block = lattice_block(ray, first);
      int count = min(whole - first, AMRTEX_BLOCK);
      int end = min(to - first, AMRTEX_BLOCK);
      int i = max(from - first, 0);
      bool inside = region_contains(r, lattice_cell(block, real(i)));
      if (!inside && i + 1 < end) {
        do {
          i += 1;
          inside = region_contains(r, lattice_cell(block, real(i)));
        } while (!inside && i + 1 < end);
      }
      if (inside) march_lattice_region(a, block, r, i, lattice_exit(block, safe_inverse(block.step), r, i, count));
      first += AMRTEX_BLOCK;
    } while (first < to);
  }
  ray_real rest = interval_begin(ray, whole);
  if (first_interval(ray) <= whole) take_box_part(ray, r, a, whole, rest, ray.length);
}

void march_adaptive_box(IN(Ray) ray, IN(Region) r, INOUT(Accumulation) a) {
  ray_real enter;
  ray_real leave;
  if (!region_interval(ray, r, ray_real(0), enter, leave)) return;
  vec3r f = vec3r(ray.entry + ray.direction * enter - ray_vec3(r.lower));
  f = clamp(f, vec3r(0), vec3r(r.upper - r.lower));
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE) open_account(a, real(ray.length), real(enter), real(leave - enter));
  march_adaptive_region(a, r, f, vec3r(ray.direction), real(leave - enter), enter, real(0.5), ray.phase);
}

void march_box(IN(Ray) ray, IN(Region) r, INOUT(Accumulation) a) {
  if (AMRTEX_LATTICE != 0) march_lattice_box(ray, r, a);
  else march_adaptive_box(ray, r, a);
}

// The sample of a ray on slice number n, if that lies in the region; it stands for the distance between the region's slices.
bool find_slice(IN(Ray) ray, IN(Region) r, IN(int) n, OUT(Position) p, OUT(real) length) {
  ray_real cosine = ray_real(1);
  if (u_orthographic == 0) cosine = dot(ray.direction / u_cells_per_unit, u_forward);
  PRECISE ray_real depth = u_first_slice + ray_real(n) * ray_real(u_step);
  PRECISE ray_real t = depth / cosine - ray.start;
  PRECISE ray_vec3 at = ray.entry + ray.direction * t;
  p = make_position(at);
  length = real(ray_real(u_step) * ray_real(AMRTEX_LATTICE != 0 ? 1 : r.width) / cosine);
  return t >= ray.first && t < ray.length && region_contains(r, p.cell);
}

void take_slice(INOUT(Accumulation) a, IN(Region) r, IN(Position) p, IN(real) length) {
  take_sample(a, r, region_position(r, p), length, ray_real(0), ray_real(0));
}

// What a box adds to the picture, before blending.
vec4r box_picture(IN(Accumulation) a) {
  if (AMRTEX_MODE == AMRTEX_MODE_MIP) return vec4r(a.maximum, real(0), real(0), real(1));
  return volume_picture(a);
}
