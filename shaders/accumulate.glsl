// What a ray has gathered so far, and how one interval adds to it.
#if !AMRTEX_CPP
#ifndef AMRTEX_MODE
#error AMRTEX_MODE must be defined: one of the AMRTEX_MODE_... below
#endif
#endif
DEFINE_INT(AMRTEX_MODE)

// the same numbers as enum class Mode (renderers/scene.hpp)
#define AMRTEX_MODE_DVR 0
#define AMRTEX_MODE_PROJECTION 1
#define AMRTEX_MODE_MIP 2
#define AMRTEX_MODE_ISO 3
#define AMRTEX_MODE_DVR_ISO 4
#define AMRTEX_DRAWS_VOLUME (AMRTEX_MODE == AMRTEX_MODE_DVR || AMRTEX_MODE == AMRTEX_MODE_DVR_ISO)

STRUCT Accumulation {
  vec3r color;         // premultiplied
  real transmittance;
  real sum;            // optical depth, or the line integral in units of ray length ...
  real lost;           // ... and what its float sum has lost so far (Kahan): long rays must not drift
  real maximum;
  int below;           // isovalues at or below the last sample; -1: it had no value, or there was none
  int beyond;          // the same of the sample that lies across a surface from it
  bool crossing;       // is there such a sample?
  ray_real before;     // where the last sample lay, and ...
  ray_real after;      // ... the one across the surface (units of ray length)
  ray_real between;    // where the interval of the one ends and that of the other begins
  vec4r surface;       // depth: world distance to the first surface; normal: its normal, 1
  ivec3 counted;       // samples, regions, regions skipped
};

Accumulation empty_accumulation() {
  Accumulation a;
  a.color = vec3r(0);
  a.transmittance = real(1);
  a.sum = real(0);
  a.lost = real(0);
  a.maximum = as_real(0xff800000u);  // minus infinity: no value is smaller
  a.below = -1;
  a.beyond = -1;
  a.crossing = false;
  a.before = ray_real(0);
  a.after = ray_real(0);
  a.between = ray_real(0);
  a.surface = vec4r(0);
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

// One interval of emitted colour (rgb) and optical depth (w).
void add_light(INOUT(Accumulation) a, IN(vec4r) light) {
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

// One interval of the exponential midpoint rule: `value` at its middle, `length` in units.
void accumulate(INOUT(Accumulation) a, IN(real) value, IN(real) length) {
  if (AMRTEX_DRAWS_VOLUME) {
    vec4r light = interval_light(value, length);
    if (light.w > real(0)) add_light(a, light);
  } else if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION) {
    PRECISE real part = value * length;
    add_compensated(a, part);
  } else if (AMRTEX_MODE == AMRTEX_MODE_MIP) {
    a.maximum = max(a.maximum, value);
  }
}
