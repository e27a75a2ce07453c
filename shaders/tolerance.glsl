// The integrator that chooses its intervals, so that a channel of a pixel is off by no more than what was asked.
// An interval is the two pre-integrated halves between three samples. How far the middle one is off the line between the
// ends says what the halves are still off (a parabola through the three), and corrects them.
DEFINE_INT(AMRTEX_CONTINUOUS)  // 1 where the filter is continuous everywhere, else 0
UNIFORM(real, u_interval_error)  // that one interval may have
UNIFORM(real, u_longest)         // interval, in cell widths of the region

// One sample in the middle of a region is off by no more than an eighth of what its light may vary by.
#define AMRTEX_SURE real(8)
// Shortest interval, in cell widths.
#define AMRTEX_SHORTEST real(0.015625)

// How much light a unit of length varies by from one axis value to another, to and fro: by extinction, and by colour.
real light_variation(IN(real) low, IN(real) high) {
  real most = real(0);
  real rises = real(0);
  real colors = real(0);
  int last = knot_count() - 1;
  int i = knot_below(low);
  do {
    real x = knot(i, 0);
    real beyond = knot(i + 1, 0);
    if (low <= beyond && high >= x) {
      real t0 = (max(low, x) - x) * knot(i, 1);
      real t1 = (min(high, beyond) - x) * knot(i, 1);
      real k = knot(i, 2);
      real k_rise = knot(i + 1, 2) - k;
      most = max(most, max(k + k_rise * t0, k + k_rise * t1));
      rises += abs(k_rise) * (t1 - t0);
      vec3r c_rise = abs(knot_color(i + 1) - knot_color(i)) * (t1 - t0);
      colors += max(c_rise.x, max(c_rise.y, c_rise.z));
    }
    i += 1;
  } while (i < last && knot(i, 0) <= high);
  return rises + most * min(colors, real(1));
}

// Colour, optical depth and estimated error of an interval.
STRUCT Estimate {
  vec4r light;
  real error;  // of the pixel, in front of which nothing is
};

real largest_of(IN(vec4r) v) {
  vec4r size = abs(v);
  return max(max(size.x, size.y), max(size.z, size.w));
}

// From the axis values at both ends and in the middle.
Estimate estimate_interval(IN(real) from, IN(real) middle, IN(real) to, IN(real) length) {
  Estimate e;
  vec2r k_first;
  vec2r k_second;
  vec4r first = light_between(from, middle, length * real(0.5), k_first);
  vec4r second = light_between(middle, to, length * real(0.5), k_second);
  e.error = real(0);
  e.light = vec4r(0);
  real depth = first.w + second.w;
  if (!(depth > real(0))) return e;
  vec4r emitted_first = vec4r(vec3r(first.x, first.y, first.z) * first.w, first.w);
  vec4r emitted_second = vec4r(vec3r(second.x, second.y, second.z) * second.w, second.w);
  real span = to - from;
  real off = middle - (from + to) * real(0.5);
  // Halves less one interval over the line from end to end, which is the halves' mean weighted by their part of the line.
  // Where the middle lies beyond the ends there is no such line: then from the extinction at the three.
  vec4r correction = vec4r(0);
  if (abs(off) * real(2) <= abs(span)) {
    real skew = abs(span) > real(1e-30) ? off / span : real(0);
    correction = (emitted_second - emitted_first) * (skew * real(2) / real(3));
    e.error = largest_of(correction);
  } else {
    real bump = (k_first.y - (k_first.x + k_second.y) * real(0.5)) * length / real(6);
    correction = vec4r(0);
    e.error = max(abs(bump), largest_of(emitted_second - emitted_first) / real(3));
  }
  // light of knots that lie inside a half: it goes with 1 / the slope there, which a parabola has by up to 2 off / span off
  real inside = abs(first.w - (k_first.x + k_first.y) * length * real(0.25)) + abs(second.w - (k_second.x + k_second.y) * length * real(0.25));
  e.error += min(inside, depth) * min(abs(off) * real(2) / max(abs(span), real(1e-30)), real(1));
  vec4r emitted = emitted_first + emitted_second;
  vec4r corrected = clamp(emitted + correction, emitted * real(0.5), emitted * real(2));
  // colours weighted by what reaches the front of the interval
  real front = opacity_of(first.w);
  real behind = opacity_of(second.w) * (real(1) - front);
  vec3r color = (vec3r(first.x, first.y, first.z) * front + vec3r(second.x, second.y, second.z) * behind) / (front + behind);
  vec3r shift = vec3r(corrected.x, corrected.y, corrected.z) / corrected.w - vec3r(emitted.x, emitted.y, emitted.z) / emitted.w;
  e.light = vec4r(clamp(color + shift, vec3r(0), vec3r(1)), corrected.w);
  e.error = e.error * (front + behind) / depth;
  return e;
}

// The axis value at q; false where there is no value.
bool take_end(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, OUT(real) at) {
  real value = fetch_field(r, inside_region(r, q));
  if (AMRTEX_COUNT != 0) a.counted.x += 1;
  at = real(0);
  if (AMRTEX_VALIDITY != 0 && is_no_value(value)) return false;
  at = interval_end(value);
  return true;
}

// A region in which light hardly varies: one sample.
void take_even_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length) {
  real at;
  vec2r ends;
  a.end_level = -1;
  if (!take_end(a, r, q, at)) return;
  vec4r light = light_between(at, at, length, ends);
  if (light.w > real(0)) add_light(a, light);
}

// Does the value at the end of the region before hold at the beginning of this one?
bool end_continues(IN(Accumulation) a, IN(Region) r) {
  if (AMRTEX_VALIDITY != 0 || a.end_level < 0) return false;
  return AMRTEX_CONTINUOUS != 0 || a.end_level == r.level;
}

// Marches a region from its q0 on, over `length`; dq a unit of length. Ends where the transmittance falls to `least`.
void march_tolerance_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) length, IN(real) least) {
  real allowed = u_interval_error;
  if (AMRTEX_VALUE_RANGES != 0 && AMRTEX_VALIDITY == 0) {
    real variation = light_variation(interval_end(r.value_range.x), interval_end(r.value_range.y));
    if (variation * length * a.transmittance <= allowed * AMRTEX_SURE) {
      take_even_region(a, r, q0 + dq * (length * real(0.5)), length);
      return;
    }
  }
  real shortest = AMRTEX_SHORTEST * real(r.width);
  // no value is told by samples alone: none of its cells may lie between them
  real longest = (AMRTEX_VALIDITY != 0 ? min(u_longest, real(0.5)) : u_longest) * real(r.width);
  real t = real(0);
  real from = a.end_axis;
  bool has_from = true;
  if (!end_continues(a, r)) has_from = take_end(a, r, q0, from);
  real way = length;
  real to = real(0);
  bool has_to = false;
  bool fetch_to = true;
  do {
    if (fetch_to) {
      real rest = length - t;
      way = min(a.stride, longest);
      way = way > rest * real(0.75) ? rest : min(way, rest * real(0.5));
      has_to = take_end(a, r, q0 + dq * (t + way), to);
    }
    real middle;
    bool has_middle = take_end(a, r, q0 + dq * (t + way * real(0.5)), middle);
    bool shortened = way * real(0.5) <= shortest;
    fetch_to = true;
    if (has_from && has_middle && has_to) {
      Estimate e = estimate_interval(from, middle, to, way);
      e.error = e.error * a.transmittance;
      fetch_to = shortened || e.error <= allowed;
      if (fetch_to && e.light.w > real(0)) add_light(a, e.light);
      a.stride = fetch_to ? (e.error * real(10) <= allowed ? max(a.stride, way * real(2)) : way) : way * real(0.5);
    } else if (has_from || has_middle || has_to) {
      fetch_to = shortened;  // an edge of what has values: to the shortest interval, and half of that
      real value = has_from ? from : (has_to ? to : middle);
      vec2r ends;
      vec4r light = light_between(value, value, way * real(0.5), ends);
      if (fetch_to && light.w > real(0)) add_light(a, light);
      a.stride = fetch_to ? way : way * real(0.5);
    } else {
      a.stride = max(a.stride, way * real(2));
    }
    if (fetch_to) {
      t += way;
      from = to;
      has_from = has_to;
    } else {
      way *= real(0.5);
      to = middle;
      has_to = has_middle;
    }
  } while (t < length && a.transmittance > least);
  a.end_axis = from;
  a.end_level = has_from ? r.level : -1;
}
