// Light of one lamp, a point: a secondary ray from each sample towards it gathers the optical depth of the
// volume between them (Kaehler & Abel 2013, section 4). The light that arrives is
//   ambient + (1 - ambient) exp(-depth).
// The secondary ray is always marched adaptively: equal intervals of at most u_shadow_step cell widths in each region.
DEFINE_INT(AMRTEX_SHADOWS)  // 1 where a lamp lights the volume, 0 leaves out what that needs

#if AMRTEX_CPP || AMRTEX_SHADOWS
UNIFORM(ray_vec3, u_lamp)      // finest; may lie outside of the domain
UNIFORM(real, u_lamp_ambient)  // light where the lamp does not reach, in [0, 1]
UNIFORM(real, u_shadow_step)   // cell widths of the region

#define AMRTEX_SHADOW_OPAQUE real(40)  // exp(-40) is nothing beside any other light

#if !AMRTEX_CPP
// of adaptive.glsl
Position leave_region(IN(Ray) ray, IN(Region) r, IN(ray_real) t, IN(bvec3) through);
#endif

// What lies between a place and the lamp, up to the drawn box and the planes that cut it: a ray of length 0 where it is at the lamp.
Ray ray_to_lamp(IN(Position) p) {
  Ray ray = secondary_ray(ray_vec3(p.cell) + ray_vec3(p.fraction));
  ray_vec3 way = (u_lamp - ray.entry) / u_cells_per_unit;
  // scaled first: the square of the way to a far lamp may be no float
  ray_real largest = max(abs(way.x), max(abs(way.y), abs(way.z)));
  if (largest > ray_real(0)) {
    ray_real in_largest = length(way / largest);
    ray.direction = way / largest / in_largest * u_cells_per_unit;
    ray.length = largest * in_largest;
  }
  end_where_drawn(ray);
  return ray;
}

// Adds the optical depth of `length` units inside a region, entered at f (finest cells from its corner).
void add_region_depth(INOUT(Accumulation) a, INOUT(Accumulation) shade, IN(Region) r, IN(vec3r) f, IN(vec3r) direction, IN(real) length) {
  real inverse_width = real(1) / real(r.width);
  real count = max(ceil(length * inverse_width / u_shadow_step - real(1e-4)), real(1));
  real interval = length / count;
  vec3r q0 = f * inverse_width;
  vec3r dq = direction * (interval * inverse_width);
  real i = real(0.5);
  if (i < count) {
    do {
      PRECISE vec3r q = q0 + dq * i;
      real value = fetch_field(r, q);
      if (AMRTEX_COUNT != 0) a.counted.x += 1;
      if (!(AMRTEX_VALIDITY != 0 && is_no_value(value))) {
        PRECISE real depth = min(transfer(value).w * interval, real(1e4));
        add_compensated(shade, depth);
      }
      i += real(1);
    } while (i < count && shade.sum < AMRTEX_SHADOW_OPAQUE);
  }
}

// Part of the lamp's light that reaches p. Samples and regions are counted in `a`.
real lamp_transmittance(INOUT(Accumulation) a, IN(Position) place) {
  Ray ray = ray_to_lamp(place);
  Accumulation shade = empty_accumulation();
  vec3r direction = vec3r(ray.direction);
  vec3r inverse = safe_inverse(direction);
  Position p = place;
  ray_real t = ray_real(0);
  bool more = ray.length > ray_real(0);
  if (more) {
    do {
      Region r;
      bool inside = locate(p, r);
      vec3r f = vec3r(p.cell - r.lower) + p.fraction;
      vec3r exits = max(-f * inverse, (vec3r(r.upper - r.lower) - f) * inverse);
      real length = max(min(exits.x, min(exits.y, exits.z)), real(0));
      ray_real next = t + ray_real(length);
      more = next < ray.length;
      if (!more) length = real(max(ray.length - t, ray_real(0)));
      bool skipped = !inside || (AMRTEX_SKIP != 0 && AMRTEX_VALUE_RANGES != 0 && !transfer_visible(r.value_range));
      if (AMRTEX_COUNT != 0) a.counted += ivec4(0, 1, skipped ? 1 : 0, 0);
      if (!skipped && length > real(0)) add_region_depth(a, shade, r, f, direction, length);
      t = next;
      bool x = exits.x <= min(exits.y, exits.z);
      bool y = !x && exits.y <= exits.z;
      p = leave_region(ray, r, t, bvec3(x, y, !x && !y));
      more = more && all(greaterThanEqual(p.cell, ivec3(0))) && all(lessThan(p.cell, u_domain_cells));
    } while (more && shade.sum < AMRTEX_SHADOW_OPAQUE);
  }
  return exp(-shade.sum);
}

// Light that arrives at p.
real lamp_light(INOUT(Accumulation) a, IN(Position) p) {
  PRECISE real light = u_lamp_ambient + (real(1) - u_lamp_ambient) * lamp_transmittance(a, p);
  return light;
}

// The place q of a region, or beside it, as a position: exact where the cell width is a power of two.
Position place_of(IN(Region) r, IN(vec3r) q) {
  PRECISE vec3r from_corner = q * real(r.width);
  vec3r whole = floor(from_corner);
  Position p;
  p.cell = clamp(r.lower + ivec3(whole), ivec3(0), u_domain_cells - ivec3(1));
  p.fraction = min(from_corner - whole, vec3r(AMRTEX_BELOW_ONE));
  return p;
}

// accumulate() in the light of the lamp. Only a sample that is seen pays for a secondary ray.
void accumulate_lit(INOUT(Accumulation) a, IN(real) value, IN(real) length, IN(Position) p) {
  vec4r light = interval_light(value, length);
  if (!(light.w > real(0))) return;
  real lit = real(0);
  if (a.transmittance > real(0)) lit = lamp_light(a, p);
  add_light(a, vec4r(light.x * lit, light.y * lit, light.z * lit, light.w));
}
#endif
