// The integrator that chooses its intervals, so that a channel of a pixel is off by no more than what was asked.
// A ray is cut into pieces at the planes on which f has kinks. On a piece f is a cubic, and four values tell all of it: nothing
// lies unseen between samples. A piece is divided into intervals. An interval's light is that of a line from end to end; how far f
// bends off that line, and what the transfer function makes of values so far beside it, bounds what its light is off by.
DEFINE_INT(AMRTEX_CONTINUOUS)  // 1 where the filter is continuous everywhere, else 0
UNIFORM(real, u_error_bound)   // of a pixel: the bounds of its intervals together

// Distance of the planes on which f has kinks, in cell widths of the region, and where the first one lies. Linear filters have them through the
// centres of cells, linear_vertex through their faces; the hats of coarser cells have them at faces as well, and so does what has a value.
#define AMRTEX_KINKS_AT_FACES \
  (AMRTEX_FILTER == AMRTEX_FILTER_LINEAR_VERTEX || AMRTEX_FILTER == AMRTEX_FILTER_BASIS || AMRTEX_VALIDITY != 0)
#define AMRTEX_KINKS_AT_CENTRES (AMRTEX_FILTER != AMRTEX_FILTER_LINEAR_VERTEX)
#define AMRTEX_KINK_DISTANCE (AMRTEX_KINKS_AT_FACES && AMRTEX_KINKS_AT_CENTRES ? real(0.5) : real(1))
#define AMRTEX_FIRST_KINK (AMRTEX_KINKS_AT_FACES ? real(0) : real(0.5))

// Shortest interval, in parts of a piece; taken whatever its bound. After so many tries it grows twofold with each eight more.
#define AMRTEX_SHORTEST_INTERVAL real(2.384185791015625e-7)
#define AMRTEX_PATIENCE 160
// Shortest piece that is made where f is no cubic, in cell widths.
#define AMRTEX_SHORTEST_PIECE real(0.00390625)

// ---- what the error may be, and has become

// Parts of the bound that an interval is granted by what it leaves behind: from the start on, by length, by opacity.
#define AMRTEX_GRANTED_AT_ONCE real(0.25)
#define AMRTEX_GRANTED_ON_THE_WAY real(0.375)

// Opens the account of a ray of length `whole`, or of the `part` of it that is drawn alone and begins at `begin`.
void open_account(INOUT(Accumulation) a, IN(real) whole, IN(real) begin, IN(real) part) {
  a.whole = whole;
  a.earlier = -begin;
  a.spent = u_error_bound * AMRTEX_GRANTED_AT_ONCE * max(real(1) - part / whole, real(0));
}

// What a ray that has come to `place` with this transmittance may be off by.
real granted_error(IN(Accumulation) a, IN(real) place, IN(real) transmittance) {
  real way = min((a.earlier + place) / a.whole, real(1));
  return u_error_bound * (AMRTEX_GRANTED_AT_ONCE + AMRTEX_GRANTED_ON_THE_WAY * (way + real(1) - transmittance));
}

// ---- what the transfer function does over a range of axis values

STRUCT Extent {
  real least;        // extinction
  real most;
  real slope;        // of extinction, at the steepest
  real swing;        // of extinction, to and fro
  real rise;         // of extinction, in the last stretch
  real color_slope;
  real color_swing;
  int stretches;     // between knots
};

Extent no_extent() {
  Extent e;
  e.least = real(1e30);
  e.most = real(0);
  e.slope = real(0);
  e.swing = real(0);
  e.rise = real(0);
  e.color_slope = real(0);
  e.color_swing = real(0);
  e.stretches = 0;
  return e;
}

real largest_of(IN(vec3r) v) { return max(v.x, max(v.y, v.z)); }

// Takes in the stretch behind knot i, as far as it lies from `low` to `high`.
void extend(INOUT(Extent) e, IN(int) i, IN(real) low, IN(real) high) {
  real x = knot(i, 0);
  real beyond = knot(i + 1, 0);
  if (low > beyond || high < x) return;
  real inverse = knot(i, 1);
  real t0 = (max(low, x) - x) * inverse;
  real t1 = (min(high, beyond) - x) * inverse;
  real k = knot(i, 2);
  real k_rise = knot(i + 1, 2) - k;
  real c_rise = largest_of(abs(knot_color(i + 1) - knot_color(i)));
  e.least = min(e.least, min(k + k_rise * t0, k + k_rise * t1));
  e.most = max(e.most, max(k + k_rise * t0, k + k_rise * t1));
  e.rise = k_rise * inverse;
  e.slope = max(e.slope, abs(e.rise));
  e.swing += abs(k_rise) * (t1 - t0);
  e.color_slope = max(e.color_slope, c_rise * inverse);
  e.color_swing += c_rise * (t1 - t0);
  e.stretches += 1;
}

Extent extent_between(IN(real) low, IN(real) high) {
  Extent e = no_extent();
  int last = knot_count() - 1;
  int i = knot_below(low);
  do {
    extend(e, i, low, high);
    i += 1;
  } while (i < last && knot(i, 0) <= high);
  return e;
}

// ---- light along a line

STRUCT Line {
  vec3r color;  // premultiplied, of the part walked through so far
  real opacity;
  real depth;
  real off;     // bound of what `color` is off by
};

// Place of the mean colour of a stretch between its ends, as seen from the near one. Weights are k exp(-depth so far), k linear. Thin ones:
// the mean by k less its covariance with the depth. Off by at most AMRTEX_MEAN_OFF(depth).
#define AMRTEX_MEAN_OFF(depth) min(real(0.002) * (depth) * (depth), real(0.12))
real mean_place(IN(real) k_near, IN(real) k_far, IN(real) depth) {
  real linear = real(2) * k_near / (k_near + k_far);
  real square = real(1) - linear;
  if (depth < real(0.5)) {
    real mean = real(0.5) + square / real(6);
    real squares = linear * linear / real(3) + linear * square * real(0.5) + square * square / real(5);
    return mean - depth * real(0.5) * (real(1) - squares - mean);
  }
  vec3r place = vec3r(0.1127016653792583, 0.5, 0.8872983346207417);
  real seen = min(depth, real(64));  // beyond, all weights would be 0; the first one is the nearest in any case
  vec3r weight = vec3r(5, 8, 5) * (vec3r(linear) + place * (real(2) * square)) * exp(place * (vec3r(linear) + place * square) * -seen);
  return dot(place, weight) / (weight.x + weight.y + weight.z);
}

// Adds the stretch behind knot i from `lower` to `upper`, of `length`. Where values rise it is seen from its lower end, and what was walked
// through lies in front.
void add_stretch(INOUT(Line) line, IN(int) i, IN(real) lower, IN(real) upper, IN(real) length, IN(bool) rising) {
  real x = knot(i, 0);
  real t0 = (lower - x) * knot(i, 1);
  real t1 = (upper - x) * knot(i, 1);
  real k = knot(i, 2);
  real k_rise = knot(i + 1, 2) - k;
  real k0 = k + k_rise * t0;
  real k1 = k + k_rise * t1;
  PRECISE real depth = min((k0 + k1) * real(0.5) * length, real(1e4));
  if (!(depth > real(0))) return;
  vec3r c = knot_color(i);
  vec3r c_rise = knot_color(i + 1) - c;
  vec3r across = c_rise * (t1 - t0);
  real place = rising ? mean_place(k0, k1, depth) : real(1) - mean_place(k1, k0, depth);
  real opacity = opacity_of(depth);
  real mine = rising ? opacity * (real(1) - line.opacity) : opacity;  // its share of the line's opacity ...
  real others = rising ? real(1) : real(1) - opacity;                 // ... and what it leaves of theirs
  line.color = line.color * others + (c + c_rise * t0 + across * place) * mine;
  line.off = line.off * others + largest_of(abs(across)) * AMRTEX_MEAN_OFF(depth) * mine;
  line.opacity = line.opacity * others + mine;
  line.depth += depth;
}

// Light of a line between two axis values, and the extent of all values from `lowest` to `highest`, which hold both.
Line light_of_line(IN(real) from, IN(real) to, IN(real) length, IN(real) lowest, IN(real) highest, OUT(Extent) extent) {
  Line line;
  line.color = vec3r(0);
  line.opacity = real(0);
  line.depth = real(0);
  line.off = real(0);
  extent = no_extent();
  real low = min(from, to);
  real high = max(from, to);
  bool flat_line = !(high - low > real(1e-30));
  real inverse = real(1) / max(high - low, real(1e-30));
  int last = knot_count() - 1;
  int i = knot_below(lowest);
  do {
    extend(extent, i, lowest, highest);
    real lower = max(low, knot(i, 0));
    real upper = min(high, knot(i + 1, 0));
    bool inside = flat_line ? low >= knot(i, 0) && low < knot(i + 1, 0) : upper > lower;
    if (inside) add_stretch(line, i, lower, upper, flat_line ? length : (upper - lower) * inverse * length, to >= from);
    i += 1;
  } while (i < last && knot(i, 0) <= highest);
  return line;
}

// ---- pieces and intervals

// f along a piece of a ray: x + s (y + s (z + s w)), s from 0 to 1.
STRUCT Piece {
  vec4r power;
  real off;  // how far f may be from that
};

real piece_value(IN(Piece) p, IN(real) s) { return p.power.x + s * (p.power.y + s * (p.power.z + s * p.power.w)); }

// The cubic with these values at 1/8, 3/8, 5/8 and 7/8 of the piece, or at 0, 1/3, 2/3 and 1.
Piece cubic_through(IN(vec4r) f, IN(bool) inner) {
  real d1 = f.y - f.x;
  real d2 = (f.z - f.y) - d1;
  real d3 = ((f.w - f.z) - (f.z - f.y)) - d2;
  vec4r c = vec4r(f.x, d1 - d2 * real(0.5) + d3 / real(3), (d2 - d3) * real(0.5), d3 / real(6));  // in steps from the first
  Piece p;
  p.off = real(0);
  p.power = vec4r(c.x, c.y * real(3), c.z * real(9), c.w * real(27));
  if (inner)
    p.power = vec4r(c.x - c.y * real(0.5) + c.z * real(0.25) - c.w * real(0.125), (c.y - c.z + c.w * real(0.75)) * real(4),
                    (c.z - c.w * real(1.5)) * real(16), c.w * real(64));
  return p;
}

// An interval's colour, optical depth and opacity, and the bound of its error in front of which nothing is.
STRUCT Interval {
  vec4r light;
  real opacity;
  real error;
};

// How far the axis value may be from the line between those of both ends, where f is at most `bend` from its own. `lowest` to `highest`: all
// axis values of the interval.
real axis_bend(IN(real) f0, IN(real) f1, IN(real) bend, IN(real) lowest, IN(real) highest) {
  if (AMRTEX_LOGARITHMIC == 0) return bend;
  real least = min(f0, f1) - bend;
  if (!(least > real(0)) || lowest <= u_knot_lowest) return highest - lowest;
  // the logarithm of a line is off that line by at most an eighth of the square of what it goes through
  real through = log(max(f0, f1) / min(f0, f1));
  return min((through * through * real(0.125) + bend / least) * real(0.4342944819032518), highest - lowest);
}

// The interval of `length` from s0 to s1 of a piece.
Interval interval_of(IN(Piece) p, IN(real) s0, IN(real) s1, IN(real) length) {
  real f0 = piece_value(p, s0);
  real f1 = piece_value(p, s1);
  real curvature = real(2) * max(abs(p.power.z + real(3) * p.power.w * s0), abs(p.power.z + real(3) * p.power.w * s1));
  real bend = curvature * (s1 - s0) * (s1 - s0) * real(0.125) + p.off;
  real from = interval_end(f0);
  real to = interval_end(f1);
  real lowest = interval_end(min(f0, f1) - bend);
  real highest = interval_end(max(f0, f1) + bend);
  bend = axis_bend(f0, f1, bend, lowest, highest);
  Extent e;
  Line line = light_of_line(from, to, length, lowest, highest, e);
  Interval i;
  i.opacity = line.opacity;
  i.light = vec4r(line.color / max(line.opacity, real(1e-30)), min(line.depth, real(1e4)));
  // Extinction is off by no more than its steepest slope makes of the bend, two thirds of that in the mean. Where the line crosses the curve's
  // features, they are moved by no more than the time in which it goes as far as f bends.
  real crossing = min(real(2) * bend / max(abs(to - from), real(1e-30)), real(1));
  real mean_bend = AMRTEX_LOGARITHMIC == 0 ? bend * (real(2) / real(3)) : bend;
  real shift = min(min(e.slope * mean_bend, e.swing * crossing), e.most - e.least);
  real tint = min(e.color_slope * bend, e.color_swing);
  if (AMRTEX_LOGARITHMIC == 0 && e.stretches == 1 && p.off == real(0)) {
    // extinction is a cubic too: its mean is exact, and what its course is off by moves light between places that differ less
    real middle = piece_value(p, (s0 + s1) * real(0.5));
    i.light.w = max(i.light.w + length * e.rise * (middle - (f0 + f1) * real(0.5)) * (real(2) / real(3)), real(0));
    i.opacity = opacity_of(i.light.w);
    shift *= min(e.color_swing + i.light.w, real(1));
  }
  i.error = shift * length + tint * i.opacity + line.off;
  return i;
}

// Adds the light of a piece that begins at `begin`, until the transmittance falls to `least`. Returns how much of it that was: where f may be off its
// cubic and intervals become short, the rest is better told by a piece of its own.
real march_piece(INOUT(Accumulation) a, IN(Piece) p, IN(real) begin, IN(real) length, IN(real) least) {
  real s = real(0);
  real shortest = AMRTEX_SHORTEST_INTERVAL;
  int tries = 0;
  do {
    real rest = real(1) - s;
    real way = max(a.stride / length, shortest);
    way = way > rest * real(0.75) ? rest : min(way, rest * real(0.5));
    real next = way < rest ? s + way : real(1);
    Interval i = interval_of(p, s, next, way * length);
    real error = i.error * a.transmittance;
    real granted = granted_error(a, begin + next * length, a.transmittance * (real(1) - i.opacity));
    real allowed = (granted - a.spent) * real(0.5);  // the rest is for those to come
    bool taken = error <= allowed || way <= shortest;
    real factor = clamp(real(0.8) * pow(max(allowed, real(0)) / max(error, real(1e-30)), real(1) / real(3)), real(0.0625), real(4));
    if (taken) {
      if (i.light.w > real(0)) add_light(a, i.light);
      a.spent = min(a.spent + error, granted);
      a.stride = way < rest ? way * length * max(factor, real(1)) : max(a.stride, way * length * factor);
      s = next;
    } else {
      a.stride = way * length * min(factor, real(0.5));
      if (p.off > real(0) && a.stride < length * real(0.125)) return s;
    }
    tries += 1;
    if (tries > AMRTEX_PATIENCE && (tries & 7) == 0) shortest *= real(2);
  } while (s < real(1) && a.transmittance > least);
  return s;
}

// ---- samples

// f at q; false where there is no value.
bool take_value(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, OUT(real) value) {
  value = fetch_field(r, inside_region(r, q));
  count_samples(a, r, 1);
  return !(AMRTEX_VALIDITY != 0 && is_no_value(value));
}

// Does the value at the end of a piece serve the next one? Not where a cell's face is its neighbour's. Nor over log10: what rounds a large value
// on this side is a small value's own on the other.
#define AMRTEX_ENDS_SHARED (AMRTEX_VALIDITY == 0 && AMRTEX_LOGARITHMIC == 0)

// f along the piece from t to t + way; false where it has no value. `from`: f at t where `has_from`, and then at the end.
bool take_piece(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) t, IN(real) way, INOUT(real) from,
                INOUT(bool) has_from, OUT(Piece) p) {
  vec4r f;
  if (AMRTEX_STENCILS) {
    ivec3 octant = stencil_octant(q0 + dq * (t + way * real(0.5)));
    Stencil s;
    fetch_stencil(r, octant, s);
    count_samples(a, r, 1);
    for (int i = 0; i < 4; ++i) f[i] = stencil_value(s, 0, octant, q0 + dq * (t + way * (real(i) / real(3))));
    p = cubic_through(f, false);
    return true;
  }
  bool inner = AMRTEX_VALIDITY != 0;
  bool valued = true;
  for (int i = 0; i < 4; ++i) {
    real place = inner ? real(0.125) + real(0.25) * real(i) : real(i) / real(3);
    real value = from;
    if (!(i == 0 && has_from)) valued = take_value(a, r, q0 + dq * (t + way * place), value) && valued;
    f[i] = value;
  }
  has_from = AMRTEX_ENDS_SHARED;
  from = f.w;
  p = cubic_through(f, inner);
  return valued;
}

// Is f known to be a cubic on a piece, as well as the curves can tell?
#define AMRTEX_EXACT_PIECES (AMRTEX_FILTER != AMRTEX_FILTER_BASIS && AMRTEX_LOGARITHMIC == 0)

// How far f may be from the cubic through four of its values. A quotient of sums of hats: twice what it is off by in the middle. Over log10
// the rounding of the largest value counts where others are so much smaller.
real off_cubic(INOUT(Accumulation) a, IN(Region) r, IN(Piece) p, IN(vec3r) middle) {
  real off = real(0);
  if (AMRTEX_FILTER == AMRTEX_FILTER_BASIS) {
    real value;
    if (take_value(a, r, middle, value)) off = real(2) * abs(value - piece_value(p, real(0.5)));
  }
  vec4r size = abs(p.power);
  if (AMRTEX_LOGARITHMIC != 0) off += (size.x + size.y + size.z + size.w) * ((real(1) - AMRTEX_BELOW_ONE) * real(64));
  return off;
}

// ---- regions

// The even part of a region: one sample for all of its `length`.
void take_even_part(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length) {
  real value;
  vec2r ends;
  a.end_level = -1;
  if (!take_value(a, r, q, value)) return;
  vec4r light = light_between(interval_end(value), interval_end(value), length, ends);
  if (light.w > real(0)) add_light(a, light);
}

// Bound of what one sample for a `length` of a region of this extent is off by.
real even_error(IN(Extent) e, IN(real) length) { return (e.most - e.least) * length + min(e.most * length, real(1)) * e.color_swing; }

// Does the value at the end of the region before hold at the beginning of this one?
bool end_continues(IN(Accumulation) a, IN(Region) r) {
  if (!AMRTEX_ENDS_SHARED || a.end_level < 0) return false;
  return AMRTEX_CONTINUOUS != 0 || a.end_level == r.level;
}

// How far it is from q to where hats of finer cells, half of their width beyond the region's faces, may have a kink.
real way_to_finer_kink(IN(Region) r, IN(vec3r) q, IN(vec3r) dq) {
  vec3r size = vec3r(r.upper - r.lower) / real(r.width);
  vec3r beside = min(q, size - q);
  real distance = min(beside.x, min(beside.y, beside.z));
  real unit = real(0.5);  // between kinks here ...
  real zone = real(0);    // ... and from the faces to where those of the next finer cells begin
  for (int level = r.level + 1; level < AMRTEX_LEVELS; ++level) {
    real reach = real(0.5) * real(level_width(level)) / real(r.width);
    if (distance < reach) unit = reach;
    else zone = max(zone, reach);
  }
  vec3r sense = vec3r(greaterThanEqual(dq, vec3r(0))) * real(2) - vec3r(1);
  vec3r inverse = vec3r(1) / max(abs(dq), vec3r(1e-20));
  vec3r to_plane = ((floor(q * sense / unit) + vec3r(1)) * unit - q * sense) * inverse;
  vec3r to_zone = (vec3r(greaterThan(sense, vec3r(0))) * size - q * sense - vec3r(zone)) * inverse;
  vec3r to_next = min(to_plane, max(to_zone, vec3r(0)));
  return min(to_next.x, min(to_next.y, to_next.z));
}

// The planes of kinks that a ray crosses in a region.
STRUCT Kinks {
  vec3r next;     // number of the plane that comes next along each axis
  vec3r sense;    // to the one behind it
  vec3r inverse;  // 1 / cell widths a unit of length
};

Kinks kinks_from(IN(vec3r) q0, IN(vec3r) dq) {
  Kinks k;
  k.sense = vec3r(greaterThanEqual(dq, vec3r(0))) * real(2) - vec3r(1);
  k.inverse = k.sense / max(abs(dq), vec3r(1e-20));
  k.next = floor((q0 - vec3r(AMRTEX_FIRST_KINK)) / AMRTEX_KINK_DISTANCE) + max(k.sense, vec3r(0));
  return k;
}

// Where the next plane behind t is met.
real next_kink(INOUT(Kinks) k, IN(vec3r) q0, IN(real) t) {
  vec3r at = (k.next * AMRTEX_KINK_DISTANCE + vec3r(AMRTEX_FIRST_KINK) - q0) * k.inverse;
  k.next += k.sense * vec3r(lessThanEqual(at, vec3r(t)));
  at = (k.next * AMRTEX_KINK_DISTANCE + vec3r(AMRTEX_FIRST_KINK) - q0) * k.inverse;
  return max(min(at.x, min(at.y, at.z)), t);
}

// Marches a region from its q0 on, over `length`; dq a unit of length; `begin`: where the ray enters it. Ends where the transmittance
// falls to `least`.
void march_tolerance_region(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q0, IN(vec3r) dq, IN(real) length, IN(real) begin,
                            IN(real) least) {
  Extent extent = no_extent();
  if (AMRTEX_VALUE_RANGES != 0) extent = extent_between(interval_end(r.value_range.x), interval_end(r.value_range.y));
  if (AMRTEX_VALIDITY != 0) extent.least = real(0);
  Kinks kinks = kinks_from(q0, dq);
  bool has_from = end_continues(a, r);
  real from = a.end_axis;
  real t = real(0);
  real longest = length;  // piece
  bool even = false;
  do {
    real rest = length - t;
    real error = even_error(extent, rest) * a.transmittance;
    even = AMRTEX_VALUE_RANGES != 0 && error * real(2) <= granted_error(a, begin + length, a.transmittance) - a.spent;
    if (even) {
      a.spent += error;
      take_even_part(a, r, q0 + dq * (t + rest * real(0.5)), rest);
      t = length;
    } else {
      real way = min(min(next_kink(kinks, q0, t), length) - t, longest);
      if (AMRTEX_FINER_HATS) {
        real bias = real(0.25) * AMRTEX_SHORTEST_PIECE * real(r.width);
        way = min(way, bias + way_to_finer_kink(r, q0 + dq * (t + bias), dq));
      }
      Piece p;
      bool valued = way > real(0) && take_piece(a, r, q0, dq, t, way, from, has_from, p);
      if (valued && !AMRTEX_EXACT_PIECES) {
        if (way > AMRTEX_SHORTEST_PIECE * real(r.width)) p.off = off_cubic(a, r, p, q0 + dq * (t + way * real(0.5)));
        real done = march_piece(a, p, begin + t, way, least);
        has_from = has_from && done == real(1);
        longest = done < real(1) ? way * real(0.25) : max(longest, way * real(2));
        way *= done;
      } else if (valued) {
        march_piece(a, p, begin + t, way, least);
      } else {
        longest = length;
      }
      t = t + way;
    }
  } while (t < length && a.transmittance > least);
  a.end_axis = from;
  a.end_level = !even && has_from ? r.level : -1;
}
