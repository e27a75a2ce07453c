// The one integration loop: raycaster, CPU renderer and later consumers share it.
#include "sample.glsl"
#include "block_maps.glsl"
#include "leap.glsl"
#include "plan.glsl"
#include "lattice.glsl"
#include "adaptive.glsl"

void march(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  if (AMRTEX_LATTICE != 0) march_lattice(ray, a, front);
  else march_adaptive(ray, a, front);
}

#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
// How far inside of a ray the samples at its ends lie, units: on a face between two cells, which of them is the ray in?
#define AMRTEX_INSIDE ray_real(0.0009765625)

// A sample of no length at the ray's entry or exit. Others lie in the middle of intervals, which may be as long as a coarse cell: a
// surface between an end and the sample next to it is not lost.
void note_ray_end(IN(Ray) ray, INOUT(Accumulation) a, IN(bool) exit) {
  ray_real inside = min(AMRTEX_INSIDE, (ray.length - ray.first) * ray_real(0.25));
  ray_real at = exit ? ray.length - inside : ray.first + inside;
  ray_vec3 place = ray.entry + ray.direction * at;
  // in a cell of what is drawn, wherever rounding puts it
  ray_vec3 whole = clamp(floor(place), floor(u_draw_lower), ceil(u_draw_upper) - ray_vec3(1));
  Position p;
  p.cell = ivec3(whole);
  p.fraction = clamp(vec3r(place - whole), vec3r(0), vec3r(AMRTEX_BELOW_ONE));
  if (AMRTEX_LATTICE != 0) p.fraction = (floor(p.fraction * AMRTEX_QUANTA) + real(0.5)) * AMRTEX_QUANTUM;  // as all samples there
  FieldSample s;
  bool has_value = sample_field(p, s);
  note_side(a, !has_value, s.value, exit ? ray.length : ray.first, at);
}

// Loops here and below are `if (n > 0) do ... while`, and not `while`: llvmpipe runs a body masked once even where no lane enters it
// (a fetch that none asked for). A GPU's compiler makes the same code of both.
//
// The loop over samples stops at each surface, so that none of what a surface costs (bisection, gradient) is inside of it.
void march_surfaces(IN(Ray) ray, INOUT(Accumulation) a, INOUT(Front) front) {
  int part = 0;  // of the ray: its entry, its head, all intervals that follow, its exit
  do {
    if (part == 0 || part == 3) note_ray_end(ray, a, part == 3);
    if (AMRTEX_CUT && part == 1) march_head(ray, a);
    if (part == 2) march(ray, a, front);
    part += a.crossing ? 0 : 1;
    if (a.crossing) draw_surface(ray, a);
  } while (part < 4 && !surfaces_ended(a) && !ray_ended(a));
}
#endif

// The picture's value for a ray that misses the drawn box. Largest numbers of offset pictures are told from none by the host.
vec4r missed_picture() {
  if (AMRTEX_MODE == AMRTEX_MODE_MIP && AMRTEX_OFFSET_PICTURE != 0) return vec4r(as_real(0xff800000u), real(0), real(0), real(1));
  return vec4r(real(0), real(0), real(0), real(AMRTEX_MODE == AMRTEX_MODE_PROJECTION || AMRTEX_MODE == AMRTEX_MODE_MIP ? 1 : 0));
}

// The picture's value for what a ray has gathered, surfaces apart: premultiplied RGBA, or (value, 0, 0, 1); of offset projections
// (value, length of what has values in two parts, 1).
vec4r volume_picture(IN(Accumulation) a) {
  if (AMRTEX_MODE == AMRTEX_MODE_DVR) return vec4r(a.color, real(1) - a.transmittance);
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION && AMRTEX_OFFSET_PICTURE != 0) return vec4r(a.sum * u_length_unit, a.passed, -a.passed_lost, real(1));
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) return vec4r(a.sum * u_length_unit, real(0), real(0), real(1));
  if (AMRTEX_OFFSET_PICTURE != 0) return vec4r(a.maximum, real(0), real(0), real(1));
  return vec4r(a.maximum < real(-3.4028235e38) ? real(0) : a.maximum, real(0), real(0), real(1));
}

// A ray, or the part of one before or behind the mirror.
void march_part(IN(Ray) ray, INOUT(Accumulation) a) {
  Front front;
  front.next = first_interval(ray);
  front.t = ray.first;
  front.p = make_position(AMRTEX_CUT ? ray.entry + ray.direction * ray.first : ray.entry);
  front.part = real(0.5);
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
  if (AMRTEX_ISOVALUES != 0) {
    march_surfaces(ray, a, front);
    return;
  }
#endif
  if (AMRTEX_CUT) march_head(ray, a);
  if (!AMRTEX_CUT || !ray_ended(a)) march(ray, a, front);
}

// May what lies behind be left out?
bool picture_ended(IN(Accumulation) a) { return (AMRTEX_ISOVALUES != 0 && surfaces_ended(a)) || ray_ended(a); }

// The picture's value for one ray.
vec4r march_ray(IN(Ray) ray, INOUT(Accumulation) a) {
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_TOLERANCE) open_account(a, real(ray.length), real(0), real(ray.length));
#if AMRTEX_CPP || AMRTEX_MIRROR
  for (int i = 0; i < (AMRTEX_MIRROR != 0 ? 2 : 1); ++i) {
    Ray part = ray;
    bool goes_on = false;
    bool drawn = AMRTEX_MIRROR == 0 || (mirrored_part(ray, i, part, goes_on) && !picture_ended(a));
    a.before = ray_real(0);  // on the mirror, where the part before noted its side
    a.end_state = AMRTEX_END_NONE;
    a.end_level = -1;
    a.earlier = real(part.start - ray.start);
    if (drawn) march_part(part, a);
  }
#else
  march_part(ray, a);
#endif
  if (AMRTEX_ISOVALUES != 0) return surface_picture(a);
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION && AMRTEX_OFFSET_PICTURE != 0 && AMRTEX_VALIDITY == 0) {
    // every place has a value: the length is the ray's own, to all digits
    ray_real whole = ray.length - ray.first;
    a.passed = real(whole);
    a.passed_lost = -real(whole - ray_real(a.passed));
  }
  return volume_picture(a);
}
