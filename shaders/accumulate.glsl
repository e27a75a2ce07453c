// What a ray has gathered so far, and how one interval adds to it.
DEFINE_INT(AMRTEX_MODE)        // one of the AMRTEX_MODE_... below
DEFINE_INT(AMRTEX_INTEGRATOR)  // one of the AMRTEX_INTEGRATOR_... below
DEFINE_INT(AMRTEX_OFFSET_PICTURE)  // 1 where a projection or mip is of values whose units have an offset, else 0

UNIFORM(real, u_sum_unit)  // line integrals count in: a power of two, so that their sums are floats

// the same numbers as enum class Mode (renderers/scene/scene.hpp)
#define AMRTEX_MODE_DVR 0
#define AMRTEX_MODE_PROJECTION 1
#define AMRTEX_MODE_MIP 2
#define AMRTEX_MODE_ISO 3
#define AMRTEX_MODE_DVR_ISO 4
#define AMRTEX_DRAWS_VOLUME (AMRTEX_MODE == AMRTEX_MODE_DVR || AMRTEX_MODE == AMRTEX_MODE_DVR_ISO)

// the same numbers as enum class Integrator (renderers/scene/scene.hpp)
#define AMRTEX_INTEGRATOR_MIDPOINT 0
#define AMRTEX_INTEGRATOR_EULER 1
#define AMRTEX_INTEGRATOR_LEFT 2
#define AMRTEX_INTEGRATOR_PREINTEGRATED 3
#define AMRTEX_INTEGRATOR_TOLERANCE 4

// Are samples taken at the ends of intervals, and does the light between two depend on both?
#define AMRTEX_PREINTEGRATED (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_PREINTEGRATED)
// Where the sample of an interval lies, in intervals from its beginning.
#define AMRTEX_SAMPLE_PLACE (AMRTEX_PREINTEGRATED || AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_LEFT ? real(0) : real(0.5))

#if AMRTEX_CPP || AMRTEX_INTEGRATOR >= AMRTEX_INTEGRATOR_PREINTEGRATED
#include "preintegrated.glsl"
#endif

// What is known of the point at which the next interval begins.
#define AMRTEX_END_NONE 0     // there was no point yet
#define AMRTEX_END_MISSING 1  // it has no value
#define AMRTEX_END_VALUE 2

STRUCT Accumulation {
  vec3r color;         // premultiplied
  real transmittance;
  real sum;            // optical depth, or the line integral in units of ray length ...
  real lost;           // ... and what its float sum has lost so far (Kahan): long rays must not drift
  real maximum;
  real passed;         // offset pictures: ray length of what has values ...
  real passed_lost;    // ... and what its sum has lost
  int below;           // isovalues at or below the last sample; -1: it had no value, or there was none
  int beyond;          // the same of the sample that lies across a surface from it
  bool crossing;       // is there such a sample?
  ray_real before;     // where the last sample lay, and ...
  ray_real after;      // ... the one across the surface (units of ray length)
  ray_real between;    // where the interval of the one ends and that of the other begins
  int end_state;       // pre-integrated: one of AMRTEX_END_..., and ...
  real end_axis;       // ... the axis value there; by tolerance the value itself
  int end_level;       // by tolerance: level of the region that it was taken in, ...
  real stride;         // ... length of the next interval to try, ...
  real whole;          // ... of the ray, ...
  real earlier;        // ... of the part of it before this one, ...
  real spent;          // ... and the bound of the error so far
  vec4r surface;       // depth: world distance to the first surface; normal: its normal, 1
  bool probing;        // a secondary ray that looks for surfaces and gathers nothing
  ivec4 counted;       // samples, regions, regions skipped, 1 + finest level of a sample
};

Accumulation empty_accumulation() {
  Accumulation a;
  a.color = vec3r(0);
  a.transmittance = real(1);
  a.sum = real(0);
  a.lost = real(0);
  a.maximum = as_real(0xff800000u);  // minus infinity: no value is smaller
  a.passed = real(0);
  a.passed_lost = real(0);
  a.below = -1;
  a.beyond = -1;
  a.crossing = false;
  a.before = ray_real(0);
  a.after = ray_real(0);
  a.between = ray_real(0);
  a.end_state = AMRTEX_END_NONE;
  a.end_axis = real(0);
  a.end_level = -1;
  a.stride = real(1e30);
  a.whole = real(1);
  a.earlier = real(0);
  a.spent = real(0);
  a.surface = vec4r(0);
  a.probing = false;
  a.counted = ivec4(0);
  return a;
}

// Adds to a sum of floats, with what its roundings have lost so far (Kahan).
void add_to_sum(INOUT(real) sum, INOUT(real) lost, IN(real) amount) {
  PRECISE real y = amount - lost;
  PRECISE real t = sum + y;
  PRECISE real rest = (t - sum) - y;
  lost = rest;
  sum = t;
}

void add_compensated(INOUT(Accumulation) a, IN(real) amount) { add_to_sum(a.sum, a.lost, amount); }

// Length of what has values.
void add_passed(INOUT(Accumulation) a, IN(real) length) { add_to_sum(a.passed, a.passed_lost, length); }

// The control: dC = T k c ds and dT = -T k ds in one explicit step each. T becomes negative or grows without bound where
// k ds > 1; that is the picture it stands for, kept among numbers.
void add_euler(INOUT(Accumulation) a, IN(vec4r) light) {
  real most = real(1e30);
  a.color = clamp(a.color + vec3r(light.x, light.y, light.z) * (a.transmittance * light.w), vec3r(-most), vec3r(most));
  a.transmittance = clamp(a.transmittance * (real(1) - light.w), -most, most);
}

// One interval of emitted colour (rgb) and optical depth (w).
void add_light(INOUT(Accumulation) a, IN(vec4r) light) {
  if (AMRTEX_INTEGRATOR == AMRTEX_INTEGRATOR_EULER) {
    add_euler(a, light);
    return;
  }
  add_compensated(a, light.w);
  real transmittance = min(exp(-a.sum), a.transmittance);
  PRECISE vec3r color = a.color + vec3r(light.x, light.y, light.z) * (a.transmittance - transmittance);
  a.color = color;
  a.transmittance = transmittance;
}

// Colour and optical depth of an interval of one value.
vec4r interval_light(IN(real) value, IN(real) length) {
  vec4r light = transfer(value);
  PRECISE real depth = min(light.w * length, real(1e4));  // exp(-1e4) is 0; infinity would become NaN
  return vec4r(light.x, light.y, light.z, depth);
}

#if AMRTEX_CPP || AMRTEX_INTEGRATOR >= AMRTEX_INTEGRATOR_PREINTEGRATED
// Light between two ends, of which one may have no value: then half of the interval has the other's.
vec4r light_of_ends(IN(int) from_state, IN(real) from, IN(int) to_state, IN(real) to, IN(real) length) {
  vec2r ends;
  bool both = from_state == to_state;
  if (from_state == AMRTEX_END_NONE || (both && from_state != AMRTEX_END_VALUE)) return vec4r(0);
  real first = from_state == AMRTEX_END_VALUE ? from : to;
  real second = to_state == AMRTEX_END_VALUE ? to : from;
  return light_between(first, second, both ? length : length * real(0.5), ends);
}

// A point of the ray: adds the interval of `length` that ends there, and begins the next.
void take_point(INOUT(Accumulation) a, IN(bool) missing, IN(real) value, IN(real) length) {
  int state = missing ? AMRTEX_END_MISSING : AMRTEX_END_VALUE;
  real at = missing ? real(0) : interval_end(value);
  vec4r light = light_of_ends(a.end_state, a.end_axis, state, at, length);
  if (light.w > real(0)) add_light(a, light);
  a.end_state = state;
  a.end_axis = at;
}
#endif

// One interval of the midpoint and left point rules: `value` at the place of its sample, `length` in units.
void accumulate(INOUT(Accumulation) a, IN(real) value, IN(real) length) {
#if AMRTEX_CPP || AMRTEX_PREINTEGRATED
  if (AMRTEX_PREINTEGRATED) {
    take_point(a, false, value, length);
    return;
  }
#endif
  if (AMRTEX_DRAWS_VOLUME) {
    vec4r light = interval_light(value, length);
    if (light.w > real(0)) add_light(a, light);
  } else if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) {
    PRECISE real part = value * u_sum_unit * length;
    add_compensated(a, part);
    if (AMRTEX_OFFSET_PICTURE != 0) add_passed(a, length);
  } else if (AMRTEX_MODE == AMRTEX_MODE_MIP) {
    a.maximum = max(a.maximum, value);
  }
}
