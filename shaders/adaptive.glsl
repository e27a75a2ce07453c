// Samplings `adaptive` and `planned`: each region is divided into equal intervals of at most `step` of its own cells, or of what is planned.
#if AMRTEX_CPP || AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE
#include "tolerance.glsl"
#endif

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

// Both ends of every interval, of this region's own values: a region beyond a face may have others there.
void march_points(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) count, IN(real) interval) {
  real i = real(0);
  a.end_state = AMRTEX_END_NONE;
  do {
    take_sample(a, r, inside_region(r, q0 + dq * i), interval, ray_real(0), ray_real(0));
    i += real(1);
  } while (i <= count && !ray_ended(a));
}

// From interval middle `from` on; returns that across a surface, or of the last sample. `phase`: the ray's.
real march_adaptive_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length, IN(ray_real) begin,
                           IN(real) from, IN(real) phase) {
  real inverse_width = real(1) / real(r.width);
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE) {
    march_tolerance_region(a, r, f * inverse_width, direction * inverse_width, length, real(begin), AMRTEX_EARLY_END != 0 ? u_early_end : real(0));
    return from;
  }
  // a float counts to 2^24: the host refuses smaller steps, and no loop is endless
  real intervals = AMRTEX_PLANNED != 0 ? length / planned_step(r, f, direction, length) : length * inverse_width / u_step;
  real count = clamp(ceil(intervals - real(1e-4)), real(1), real(16777216));
  real interval = length / count;
  if (AMRTEX_CONSTANT_REGIONS) {
    ray_real first = begin + ray_real(interval * (from - real(0.5)));
    take_constant_samples(a, r, count - (from - real(0.5)), interval, first, ray_real(interval));
    return from;
  }
  vec3r q0 = f * inverse_width;
  vec3r dq = direction * (interval * inverse_width);
  if (AMRTEX_PREINTEGRATED) {
    march_points(a, r, q0, dq, count, interval);
    return from;
  }
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

// What a ray's direction tells of how it leaves boxes.
STRUCT Course {
  bvec3 forward;
  ray_vec3 inverse;  // units a finest cell along each axis
  ray_vec3 still;    // added to where it leaves: along an axis that it does not move on, through no face, wherever rounding put it
};

Course course_of(IN(Ray) ray) {
  Course course;
  ray_vec3 speed = abs(ray.direction);
  course.forward = greaterThan(ray.direction, ray_vec3(0));
  course.still = ray_vec3(lessThan(speed, ray_vec3(1e-20))) * ray_real(1e30);
  course.inverse = ray_real(1) / max(speed, ray_vec3(1e-20));
  return course;
}

// Passes the box of r, in which the ray is at t: t and p are then behind its face. Returns whether the ray goes on.
// Where the ray meets a face follows from ray and face alone: whatever lies before it, one hidden region or many, the next
// region is entered at the same place to the bit, and lengths sum to the chord.
bool pass_box(IN(Ray) ray, IN(Course) course, IN(Region) r, INOUT(ray_real) t, INOUT(Position) p) {
  ray_vec3 lower = ray.entry - ray_vec3(r.lower);
  ray_vec3 upper = ray_vec3(r.upper) - ray.entry;
  bvec3 forward = course.forward;
  ray_vec3 ahead = ray_vec3(forward.x ? upper.x : lower.x, forward.y ? upper.y : lower.y, forward.z ? upper.z : lower.z);
  ray_vec3 exits = ahead * course.inverse + course.still;
  t = max(min(exits.x, min(exits.y, exits.z)), t);
  bool x = exits.x <= min(exits.y, exits.z);
  bool y = !x && exits.y <= exits.z;
  p = leave_region(ray, r, t, bvec3(x, y, !x && !y));
  return t < ray.length && all(greaterThanEqual(p.cell, ivec3(0))) && all(lessThan(p.cell, u_domain_cells));
}

void march_adaptive(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  vec3r direction = vec3r(ray.direction);
  Course course = course_of(ray);
  ray_real t = front.t;
  Position p = front.p;
  real part = front.part;
  bool more = true;
  do {
    Region r;
    bool skipped = true;
    do {  // the next region that can be seen: all lanes of a SIMD group then sample together
      bool leaped = AMRTEX_LEAPS != 0 && leap(p, course.forward, r);
      bool inside = true;
      if (!leaped) inside = march_locate(a, p, r);
      front.t = t;
      front.p = p;
      skipped = leaped || !inside || region_invisible(a, r);
      count_region(a, skipped);
      more = pass_box(ray, course, r, t, p);
      if (skipped) pass_region(a, inside, r, t);
    } while (skipped && more);
    if (AMRTEX_SKIPS_IN_STAGES && !skipped) open_region(r);
    ray_real length = max(min(t, ray.length) - front.t, ray_real(0));
    vec3r f = vec3r(ray_vec3(front.p.cell - r.lower) + ray_vec3(front.p.fraction));  // as exact as the ray before it is rounded
    if (!skipped && length > ray_real(0)) front.part = march_adaptive_region(a, r, f, direction, real(length), front.t, part, ray.phase);
    part = real(0.5);
  } while (more && !ray_stopped(a));
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

