// What a march does at one place, whatever its sampling: one sample or many of one value, and a region that it passes.
DEFINE_INT(AMRTEX_LATTICE)     // 1 for lattice sampling, 0 for adaptive
DEFINE_INT(AMRTEX_SKIP)        // 1 where invisible regions are skipped, else 0
DEFINE_INT(AMRTEX_EARLY_END)   // 1 where a ray ends at u_early_end, else 0
DEFINE_INT(AMRTEX_COUNT)       // 1 where samples and regions are counted, else 0
DEFINE_INT(AMRTEX_RAY_DOUBLE)  // 1 where rays are held in double, else 0
DEFINE_INT(AMRTEX_TRANSFERS)   // fields of the volume, each with a transfer function; 1 leaves out what several need
#define AMRTEX_SEVERAL_FIELDS (AMRTEX_TRANSFERS > 1)

// Samples of a region.
void count_samples(INOUT(Accumulation) a, IN(Region) r, IN(int) count) {
  if (AMRTEX_COUNT == 0) return;
  a.counted.x += count;
  if (AMRTEX_OCCLUSION != 0 && a.probing) return;  // of another ray than the pixel's
  a.counted.w = max(a.counted.w, AMRTEX_LEAF_LEVEL(r) + 1);
}

#if AMRTEX_CPP || AMRTEX_SEVERAL_FIELDS
#include "fields.glsl"
#endif
#include "left_out.glsl"

UNIFORM(real, u_step)       // cell widths: of the finest level (lattice) or of the region (adaptive)
UNIFORM(real, u_early_end)  // transmittance at which a ray ends

bool ray_ended(IN(Accumulation) a) { return AMRTEX_EARLY_END != 0 && a.transmittance <= u_early_end; }

// Does the loop over samples end here: at the ray's end, or at a surface that is drawn first?
bool ray_stopped(IN(Accumulation) a) { return ray_ended(a) || (AMRTEX_ISOVALUES != 0 && a.crossing); }

// May the region be left out without changing the picture?
bool region_invisible(IN(Accumulation) a, IN(Region) r) {
  if (AMRTEX_SKIP == 0 || AMRTEX_VALUE_RANGES == 0) return false;
  if (AMRTEX_ISOVALUES != 0 && !on_one_side(a, r.value_range)) return false;
  if (AMRTEX_OCCLUSION != 0 && a.probing) return true;
  if (AMRTEX_SEVERAL_FIELDS) return !fields_visible(r);
  if (AMRTEX_DRAWS_VOLUME) return !transfer_visible(r.value_range);
  if (AMRTEX_MODE == AMRTEX_MODE_ISO) return true;
  if (AMRTEX_MODE == AMRTEX_MODE_PROJECTION && AMRTEX_OFFSET_PICTURE != 0) return false;
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
  if (AMRTEX_SEVERAL_FIELDS) {
    take_fields(a, r, q, length);
    return;
  }
  real value = fetch_field(r, q);
  count_samples(a, r, 1);
  bool missing = AMRTEX_VALIDITY != 0 && is_no_value(value);
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, missing, value, begin, at);
    if (a.crossing) return;  // the surface comes first; this sample is taken again after it
    if (AMRTEX_OCCLUSION != 0 && a.probing) return;
  }
  if (AMRTEX_PREINTEGRATED) {
    take_point(a, missing, value, length);
    return;
  }
  if (missing) return;
  if (AMRTEX_SHADOWS != 0) {
    accumulate_lit(a, value, length, place_of(r, q));
    return;
  }
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
  count_samples(a, r, int(count));
  bool missing = AMRTEX_VALIDITY != 0 && is_no_value(value);
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, missing, value, begin, begin + way * ray_real(0.5));
    if (a.crossing) return;
    a.before = begin + way * ray_real(count - real(0.5));
    if (AMRTEX_OCCLUSION != 0 && a.probing) return;
  }
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
  count_samples(a, r, 1);
  real value = stencil_value(s, 0, octant, q);
  if (AMRTEX_ISOVALUES != 0) {
    note_side(a, false, value, begin, at);
    if (a.crossing || (AMRTEX_OCCLUSION != 0 && a.probing)) return;
  }
  if (AMRTEX_SHADOWS != 0) {
    accumulate_lit(a, value, length, place_of(r, q));
    return;
  }
  accumulate(a, value, length);
}

// A region that is not sampled, up to `exit`: a ray passes on its side, and loses it where there is no mesh.
void pass_region(INOUT(Accumulation) a, IN(bool) inside, IN(Region) r, IN(ray_real) exit) {
  if (AMRTEX_ISOVALUES != 0) {
    a.below = inside ? isovalues_below(r.value_range.x) : -1;
    a.before = exit;
  }
  a.end_level = -1;
  if (AMRTEX_PREINTEGRATED && AMRTEX_LATTICE != 0 && !inside) take_point(a, true, real(0), u_step);
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

