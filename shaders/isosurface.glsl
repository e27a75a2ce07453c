// Isosurfaces on the sampler contract: where a ray crosses one, and what it adds to the picture.
// A hit is a change of side of f - isovalue between consecutive samples that both have a value,
// across regions too. Entering or leaving the mesh is none. A ray has samples at its two ends as well.
DEFINE_INT(AMRTEX_ISOVALUES)  // how many isosurfaces are drawn; 0 leaves out what they need
#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
DEFINE_INT(AMRTEX_OUTPUT)               // one of the AMRTEX_OUTPUT_... below
DEFINE_INT(AMRTEX_SHADING)              // one of the AMRTEX_SHADING_... below
DEFINE_INT(AMRTEX_SURFACE_POINTS)       // how many points the colours over field 1 have; 0: each isovalue has its colour
DEFINE_INT(AMRTEX_SURFACE_LOGARITHMIC)  // 1 where those points are joined over log10(value), else 0
#endif

// the same numbers as enum class Output (renderers/scene/scene.hpp)
#define AMRTEX_OUTPUT_COLOR 0
#define AMRTEX_OUTPUT_DEPTH 1
#define AMRTEX_OUTPUT_NORMAL 2

// the same numbers as enum class Shading (renderers/scene/scene.hpp)
#define AMRTEX_SHADING_NONE 0
#define AMRTEX_SHADING_GRADIENT 1
#define AMRTEX_SHADING_CENTRAL 2
#define AMRTEX_SHADING_CLAMPED 3
#define AMRTEX_SHADING_ANALYTIC 4

#if AMRTEX_CPP || AMRTEX_ISOVALUES > 0
UNIFORM_ARRAY(real, u_isovalues, AMRTEX_ISOVALUES, 16)           // ascending
UNIFORM_ARRAY(real, u_surface_light, 4 * AMRTEX_ISOVALUES, 64)  // rgb, optical depth of each
UNIFORM(real, u_surface_ambient)                                // light on a surface along the ray
UNIFORM(real, u_face_distance)                                  // finest cells; see surface_gradient
UNIFORM(int, u_bisections)                                      // of the interval between two samples

// How many isovalues are at or below a value: the one number that says on which side of each it is.
int isovalues_below(IN(real) value) {
  int count = 0;
  for (int i = 0; i < AMRTEX_ISOVALUES; ++i) count += value >= u_isovalues[i] ? 1 : 0;
  return count;
}

// Does a whole range lie on the side on which the ray is? A ray without a side takes any.
bool on_one_side(IN(Accumulation) a, IN(vec2r) value_range) {
  int lower = isovalues_below(value_range.x);
  return lower == isovalues_below(value_range.y) && (a.below < 0 || a.below == lower);
}

// Takes the side of a sample at `at`, whose interval begins at `begin`; or notes that a surface lies before it.
void note_side(INOUT(Accumulation) a, IN(bool) missing, IN(real) value, IN(ray_real) begin, IN(ray_real) at) {
  int below = missing ? -1 : isovalues_below(value);
  a.crossing = a.below >= 0 && below >= 0 && a.below != below;
  a.beyond = below;
  a.after = at;
  a.between = begin;
  if (a.crossing) return;
  a.below = below;
  a.before = at;
}

// The first crossing of an isovalue between two samples.
STRUCT Crossing {
  bool found;         // false: one end has no value after all
  ray_real t;         // units of ray length
  real value_before;  // of f at the two ends
  real value_after;
};

// Bisection through sample_field, then one secant: for a jump of f the last bracket, for a
// smooth f far better. One loop, its first two turns the ends: a shader holds the encoding's
// text once for each place that samples.
Crossing find_crossing(IN(Ray) ray, IN(Accumulation) a, IN(real) isovalue, IN(bool) rising) {
  Crossing c;
  c.found = true;
  c.value_before = real(0);
  c.value_after = real(0);
  ray_real from = a.before;
  ray_real to = a.after;
  real low = real(0);
  real high = real(0);
  for (int i = 0; i < u_bisections + 2; ++i) {
    ray_real t = i == 0 ? from : (i == 1 ? to : (from + to) * ray_real(0.5));
    FieldSample s;
    bool has_value = sample_field(make_position(ray.entry + ray.direction * t), s);
    bool beyond = i == 1 || (i > 1 && has_value && (s.value >= isovalue) == rising);
    if (i < 2) c.found = c.found && has_value;
    if (i == 0) c.value_before = s.value;
    if (i == 1) c.value_after = s.value;
    from = beyond ? from : t;
    low = beyond ? low : s.value;
    to = beyond ? t : to;
    high = beyond ? s.value : high;
  }
  real rise = high - low;
  real part = rise == real(0) || is_no_value(rise) ? real(0.5) : clamp((isovalue - low) / rise, real(0), real(1));
  c.t = from + (to - from) * ray_real(part);
  return c;
}

// p moved along an axis by whole finest cells and by a part of one.
Position moved(IN(Position) p, IN(int) axis, IN(int) cells, IN(real) part) {
  Position to = p;
  real fraction = p.fraction[axis] + part;
  real whole = floor(fraction);
  to.fraction[axis] = clamp(fraction - whole, real(0), real(AMRTEX_BELOW_ONE));
  to.cell[axis] = p.cell[axis] + cells + int(whole);
  return to;
}

// Gradient at p, per unit of ray length along each axis: central differences over the width of
// one cell of the region that holds p. Surfaces of `nearest` are faces: a little more than what
// a hit may be off its face, to either side, sees which. A side without a value is left out.
vec3r surface_gradient(IN(Position) p, IN(real) isovalue) {
  bool faces = AMRTEX_FILTER == AMRTEX_FILTER_NEAREST;
  vec3r difference = vec3r(0);
  vec3r extent = vec3r(0);
  real center = isovalue;
  int cells = 0;
  real distance = u_face_distance;
  for (int i = 0; i < 7; ++i) {  // p itself, then its two sides along each axis
    int axis = max(i - 1, 0) >> 1;
    int side = i == 0 ? 0 : ((i & 1) != 0 ? -1 : 1);
    FieldSample s;
    bool has_value = sample_field(moved(p, axis, side * cells, faces ? real(side) * u_face_distance : real(0)), s);
    if (i == 0) {
      center = has_value ? s.value : isovalue;
      int width = s.level < 0 ? 0 : level_width(s.level);
      cells = faces ? 0 : width;
      distance = faces ? u_face_distance : real(width);
    } else {
      difference[axis] += real(side) * (has_value ? s.value : center);
      extent[axis] += has_value ? distance : real(0);
    }
  }
  vec3r gradient = vec3r(0);
  for (int axis = 0; axis < 3; ++axis)
    if (extent[axis] > real(0)) gradient[axis] = difference[axis] / extent[axis] * real(u_cells_per_unit[axis]);
  return gradient;
}

#if AMRTEX_FETCH_GRADIENT
// The gradient that the encoding stores, or computes.
#define AMRTEX_ENCODINGS_GRADIENT \
  (AMRTEX_STORED_GRADIENTS ? AMRTEX_SHADING <= AMRTEX_SHADING_GRADIENT : AMRTEX_SHADING == AMRTEX_SHADING_ANALYTIC)
vec3r encodings_gradient(IN(Position) p) {
  Region r;
  if (!locate(p, r)) return vec3r(0);
  return fetch_gradient(r, region_position(r, p)) * vec3r(u_cells_per_unit) / real(r.width);
}
#endif

#if AMRTEX_CPP || AMRTEX_SHADING == AMRTEX_SHADING_CLAMPED
// Central differences between places of the region that holds p, a leaf cell's width from it at most (Wald et al. 2020, section
// 5.1.2): the region is found once.
vec3r clamped_gradient(IN(Position) p) {
  Region r;
  if (!locate(p, r)) return vec3r(0);
  vec3r q = region_position(r, p);
  real width = real(level_width(AMRTEX_LEAF_LEVEL(r))) / real(r.width);
  vec3r gradient = vec3r(0);
  vec3r low = vec3r(0);
  real at = real(0);
  for (int i = 0; i < 6; ++i) {  // the lower and the upper side along each axis
    int axis = i >> 1;
    vec3r beside = q;
    beside[axis] += (i & 1) == 0 ? -width : width;
    beside = inside_region(r, beside);
    real value = fetch_field(r, beside);
    bool there = !is_no_value(value);
    if (!there) {
      beside = q;
      value = fetch_field(r, q);
    }
    if ((i & 1) == 0) {
      low[axis] = value;
      at = beside[axis];
    } else if (beside[axis] > at) {
      gradient[axis] = (value - low[axis]) / (beside[axis] - at);
    }
  }
  return gradient * vec3r(u_cells_per_unit) / real(r.width);
}
#endif

// Unit normal, along the gradient; 0 where there is no gradient.
vec3r surface_normal(IN(Position) p, IN(real) isovalue) {
  vec3r gradient = vec3r(0);
  bool found = false;
#if AMRTEX_FETCH_GRADIENT
  found = AMRTEX_ENCODINGS_GRADIENT;
  if (AMRTEX_ENCODINGS_GRADIENT) gradient = encodings_gradient(p);
#endif
#if AMRTEX_CPP || AMRTEX_SHADING == AMRTEX_SHADING_CLAMPED
  if (AMRTEX_SHADING == AMRTEX_SHADING_CLAMPED && AMRTEX_FILTER != AMRTEX_FILTER_NEAREST) {
    gradient = clamped_gradient(p);
    found = true;
  }
#endif
  if (!found) gradient = surface_gradient(p, isovalue);
  // fields of any magnitude: the square of a gradient may be no float
  real largest = max(abs(gradient.x), max(abs(gradient.y), abs(gradient.z)));
  if (!(largest > real(0)) || largest > real(3e38)) return vec3r(0);
  return normalize(gradient / largest);
}

// Light that comes back from a surface: a lamp at the eye, both sides alike (surface_light in renderers/scene/scene.hpp).
real reflected_light(IN(Ray) ray, IN(vec3r) normal) {
  if (normal == vec3r(0)) return real(1);
  vec3r direction = vec3r(ray.direction) / vec3r(u_cells_per_unit);
  return u_surface_ambient + (real(1) - u_surface_ambient) * abs(dot(normal, direction));
}

// Adds an interval of the volume, or with a negative length takes back what lies behind a surface; `lit` is the
// light on it.
void shift_volume(INOUT(Accumulation) a, IN(real) value, IN(real) length, IN(real) lit) {
  vec4r light = transfer(value);
  PRECISE real depth = light.w * length;
  if (!(abs(depth) < real(30))) return;  // opaque: nothing of it shows
  add_compensated(a, depth);
  real transmittance = exp(-a.sum);
  a.color += vec3r(light.x, light.y, light.z) * (lit * (a.transmittance - transmittance));
  a.transmittance = transmittance;
}

#if AMRTEX_CPP || AMRTEX_SURFACE_POINTS > 0
UNIFORM_ARRAY(real, u_surface_points, 5 * AMRTEX_SURFACE_POINTS, 160)  // see AMRTEX_COLOR_CURVE
AMRTEX_COLOR_CURVE(mapped_color, u_surface_points, AMRTEX_SURFACE_POINTS)
#endif

// Colour of field 1 at p; the isovalue's own where there is no such field, or no value of it.
vec3r surface_color(IN(Position) p, IN(int) k) {
#if AMRTEX_CPP || AMRTEX_SURFACE_POINTS > 0
  FieldSample s;
  if (AMRTEX_SURFACE_POINTS > 0 && sample_value(p, 1, s)) return mapped_color(curve_axis(s.value, AMRTEX_SURFACE_LOGARITHMIC != 0));
#endif
  return vec3r(u_surface_light[4 * k], u_surface_light[4 * k + 1], u_surface_light[4 * k + 2]);
}

#if AMRTEX_CPP || AMRTEX_OCCLUSION
UNIFORM(int, u_occlusion_rays)
UNIFORM(real, u_occlusion_radius)  // units

#if !AMRTEX_CPP
bool meets_surface(INOUT(Accumulation) a, IN(Ray) ray, IN(int) side);  // of adaptive.glsl
#endif

// Ambient occlusion: share of the rays from a hit that meet no surface within the radius. They go to the eye's side, with a
// density that falls with the cosine to the normal: evenly spread over a disk (a golden spiral), and up from there onto the hemisphere.
real open_share(INOUT(Accumulation) a, IN(Ray) ray, IN(Position) p, IN(vec3r) normal, IN(int) side) {
  if (normal == vec3r(0)) return real(1);
  vec3r up = dot(normal, vec3r(ray.direction) / vec3r(u_cells_per_unit)) > real(0) ? -normal : normal;
  // a basis around it without a square root (Duff et al. 2017)
  real sense = up.z >= real(0) ? real(1) : real(-1);
  real e = real(-1) / (sense + up.z);
  real f = up.x * up.y * e;
  vec3r right = vec3r(real(1) + sense * up.x * up.x * e, sense * f, -sense * up.x);
  vec3r ahead = vec3r(f, sense + up.y * up.y * e, -up.y);
  // off the surface by a little more than what a hit may be off it
  ray_vec3 from = ray_vec3(p.cell) + ray_vec3(p.fraction) + ray_vec3(up * u_face_distance);
  // where f jumps they may begin behind the surface all the same: then they have no side yet
  FieldSample s;
  bool has_value = sample_field(make_position(clamp(from, u_draw_lower, u_draw_upper)), s);
  int begins = has_value && isovalues_below(s.value) == side ? side : -1;
  int open = 0;
  for (int i = 0; i < u_occlusion_rays; ++i) {
    real square = (real(i) + real(0.5)) / real(u_occlusion_rays);
    real angle = real(i) * real(2.39996322972865332) + ray.turn;
    vec3r direction = (right * cos(angle) + ahead * sin(angle)) * sqrt(square) + up * sqrt(real(1) - square);
    Ray probe = secondary_ray(clamp(from, u_draw_lower, u_draw_upper));
    probe.direction = ray_vec3(direction) * u_cells_per_unit;
    probe.length = ray_real(u_occlusion_radius);
    end_where_drawn(probe);
    open += meets_surface(a, probe, begins) ? 0 : 1;
  }
  return real(open) / real(u_occlusion_rays);
}
#endif

// `side`: isovalues at or below f on the side from which the ray comes.
void composite_surface(IN(Ray) ray, INOUT(Accumulation) a, IN(Position) p, IN(int) k, IN(int) side, IN(real) lit) {
  vec3r rgb = surface_color(p, k) * lit;
  vec3r normal = vec3r(0);
  if (AMRTEX_SHADING != 0 || AMRTEX_OCCLUSION != 0) normal = surface_normal(p, u_isovalues[k]);
  if (AMRTEX_SHADING != 0) rgb = rgb * reflected_light(ray, normal);
#if AMRTEX_CPP || AMRTEX_OCCLUSION
  if (AMRTEX_OCCLUSION != 0) rgb = rgb * open_share(a, ray, p, normal, side);
#endif
  add_compensated(a, u_surface_light[4 * k + 3]);
  real transmittance = min(exp(-a.sum), a.transmittance);
  a.color += rgb * (a.transmittance - transmittance);
  a.transmittance = transmittance;
}

// The surface between the last sample and the next: of the isovalue that is crossed first.
void draw_surface(IN(Ray) ray, INOUT(Accumulation) a) {
  bool rising = a.beyond > a.below;
  int k = rising ? a.below : a.below - 1;
  Crossing c = find_crossing(ray, a, u_isovalues[k], rising);
  a.crossing = false;
  a.below = c.found ? a.below + (rising ? 1 : -1) : -1;
  if (!c.found) return;
  Position p = make_position(ray.entry + ray.direction * c.t);
  if (AMRTEX_OUTPUT == AMRTEX_OUTPUT_DEPTH) a.surface = vec4r(real(ray.start + c.t) * u_length_unit, real(0), real(0), real(1));
  if (AMRTEX_OUTPUT == AMRTEX_OUTPUT_NORMAL) a.surface = vec4r(surface_normal(p, u_isovalues[k]), real(1));
  if (AMRTEX_OUTPUT == AMRTEX_OUTPUT_NORMAL && AMRTEX_MIRROR != 0 && ray.mirrored)
    a.surface[AMRTEX_MIRROR_AXIS] = -a.surface[AMRTEX_MIRROR_AXIS];
  if (AMRTEX_OUTPUT != AMRTEX_OUTPUT_COLOR) return;
  // the part of an interval between its end and the surface is moved to the other side of it
  real shift = real(c.t - a.between);
  real value = shift > real(0) ? c.value_after : c.value_before;
  vec2r lit = vec2r(1);  // of the surface, and of the sample whose interval is split
#if AMRTEX_CPP || AMRTEX_SHADOWS
  if (AMRTEX_SHADOWS != 0)
    // a loop: the text of a secondary ray stands here once. llvmpipe inlines every call and compiles for seconds otherwise; a compiler
    // that unrolls it gives that back and is as fast.
    for (int i = 0; i < 2; ++i)
      lit[i] = lamp_light(a, i == 0 ? p : make_position(ray.entry + ray.direction * (shift > real(0) ? a.after : a.before)));
#endif
  if (AMRTEX_DRAWS_VOLUME) shift_volume(a, value, shift, lit.y);
  composite_surface(ray, a, p, k, rising ? k : k + 1, lit.x);
  if (AMRTEX_DRAWS_VOLUME) shift_volume(a, value, -shift, lit.y);
}

// An opaque surface ends a ray; pictures of depth and normals end at the first.
bool surfaces_ended(IN(Accumulation) a) {
  if (AMRTEX_OUTPUT != AMRTEX_OUTPUT_COLOR) return a.surface.w > real(0);
  return !(a.transmittance > real(0));
}

vec4r surface_picture(IN(Accumulation) a) {
  if (AMRTEX_OUTPUT == AMRTEX_OUTPUT_COLOR) return vec4r(a.color, real(1) - a.transmittance);
  return a.surface;
}
#endif
