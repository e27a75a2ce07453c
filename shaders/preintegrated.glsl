// Light of an interval along which the transfer function's axis (the value or its log10) goes linearly from
// one end's to the other's, with every point of both curves that lies between: no feature is too narrow.
// Nothing is tabulated over pairs of values: between two knots extinction and colour are linear.
DEFINE_INT(AMRTEX_KNOTS)  // how many knots the transfer function has as uniforms; 0 for the buffer

#define AMRTEX_KNOT_NUMBERS 6
#define AMRTEX_MOST_KNOTS 34

#if AMRTEX_CPP || AMRTEX_KNOTS > 0
// Of each knot: axis value, 1 / distance to the next one (0: constant up to it), extinction, rgb. The first
// and the last lie beyond all values.
UNIFORM_ARRAY(real, u_knots, AMRTEX_KNOT_NUMBERS * AMRTEX_KNOTS, 204)
#endif
#if AMRTEX_CPP || AMRTEX_KNOTS == 0
BUFFER(real, transfer_knots, transfer_knots_block)  // the same, of any number of knots
UNIFORM(int, u_knot_count)
#endif
UNIFORM(real, u_knot_lowest)  // axis values below count as this one: log10 of a value near 0 is no end of a line

real knot(IN(int) i, IN(int) number) {
#if AMRTEX_CPP || AMRTEX_KNOTS > 0
  if (AMRTEX_KNOTS > 0) return u_knots[AMRTEX_KNOT_NUMBERS * i + number];
#endif
#if AMRTEX_CPP || AMRTEX_KNOTS == 0
  return transfer_knots[AMRTEX_KNOT_NUMBERS * i + number];
#endif
}

vec3r knot_color(IN(int) i) { return vec3r(knot(i, 3), knot(i, 4), knot(i, 5)); }

int knot_count() {
#if AMRTEX_CPP || AMRTEX_KNOTS == 0
  if (AMRTEX_KNOTS == 0) return u_knot_count;
#endif
  return AMRTEX_KNOTS;
}

// A knot at or below x. Few knots are walked through by all lanes of a SIMD group together, from the first.
int knot_below(IN(real) x) {
  if (AMRTEX_KNOTS > 0) return 0;
  int low = 0;
  int high = knot_count() - 1;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (knot(middle, 0) <= x) low = middle;
    else high = middle;
  }
  return low;
}

// The end of an interval that a value stands for.
real interval_end(IN(real) value) { return max(transfer_axis(value), u_knot_lowest); }

// 1 - exp(-depth), to full precision for thin intervals as well.
real opacity_of(IN(real) depth) {
  if (depth < real(0.01)) return depth * (real(1) - depth * (real(0.5) - depth * (real(1) / real(6) - depth / real(24))));
  return real(1) - exp(-depth);
}

// Emitted colour of a stretch of optical depth `depth` along which extinction and colour are linear, weighted by what
// reaches its front: two Gauss points. Exact where thin or of one colour.
vec3r stretch_color(IN(real) k_near, IN(real) k_far, IN(vec3r) near_color, IN(vec3r) far_color, IN(real) depth) {
  vec3r step_color = far_color - near_color;
  if (step_color == vec3r(0)) return near_color;
  real first = real(0.21132486540518712);
  real between = real(0.57735026918962576);
  real k_first = k_near + (k_far - k_near) * first;
  real k_second = (k_near + (k_far - k_near) * (real(1) - first)) * exp(-depth * between);
  return near_color + step_color * (first + between * (k_second / (k_first + k_second)));
}

// Mean colour and optical depth of an interval of `length` between two axis values; `ends`: extinction at them.
vec4r light_between(IN(real) from, IN(real) to, IN(real) length, OUT(vec2r) ends) {
  real low = min(from, to);
  real high = max(from, to);
  bool rising = to >= from;
  bool flat_line = !(high - low > real(1e-30));
  real inverse = real(1) / max(high - low, real(1e-30));
  vec3r color = vec3r(0);  // premultiplied, of the part walked through so far ...
  real weight = real(0);   // ... and its opacity
  real depth = real(0);
  vec2r k_ends = vec2r(0);
  bool first = true;
  int last = knot_count() - 1;
  int i = knot_below(low);
  do {
    real x = knot(i, 0);
    real lower = max(low, x);
    real upper = min(high, knot(i + 1, 0));
    bool inside = flat_line ? low >= x && low < knot(i + 1, 0) : upper > lower;
    if (inside) {
      real part = flat_line ? real(1) : (upper - lower) * inverse;
      real t0 = (lower - x) * knot(i, 1);
      real t1 = (upper - x) * knot(i, 1);
      real k = knot(i, 2);
      real k_rise = knot(i + 1, 2) - k;
      real k0 = k + k_rise * t0;
      real k1 = k + k_rise * t1;
      if (first) k_ends.x = k0;
      k_ends.y = k1;
      first = false;
      PRECISE real stretch = min((k0 + k1) * real(0.5) * part * length, real(1e4));
      if (stretch > real(0)) {
        vec3r c = knot_color(i);
        vec3r c_rise = knot_color(i + 1) - c;
        vec3r c0 = c + c_rise * t0;
        vec3r c1 = c + c_rise * t1;
        vec3r rgb = rising ? stretch_color(k0, k1, c0, c1, stretch) : stretch_color(k1, k0, c1, c0, stretch);
        real opacity = opacity_of(stretch);
        real mine = rising ? opacity * (real(1) - weight) : opacity;    // its share of the interval's opacity ...
        real others = rising ? real(1) : real(1) - opacity;             // ... and what it leaves of theirs
        color = color * others + rgb * mine;
        weight = weight * others + mine;
        depth += stretch;
      }
    }
    i += 1;
  } while (i < last && knot(i, 0) <= high);
  ends = rising ? k_ends : vec2r(k_ends.y, k_ends.x);
  if (!(weight > real(0))) return vec4r(0);
  return vec4r(color / weight, min(depth, real(1e4)));
}
