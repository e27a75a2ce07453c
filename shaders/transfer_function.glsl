// Value -> emitted colour and extinction, both piecewise linear over the value or its log10.
// Few points are evaluated as they are: exact for any spacing, and cheaper than a look-up
// where gathers are slow. Many points come from a table of evenly spaced entries.
DEFINE_INT(AMRTEX_INVISIBLE_RANGES)   // how many intervals of values have no extinction
DEFINE_INT(AMRTEX_LOGARITHMIC)        // 1 where the points are joined over log10(value), else 0
DEFINE_INT(AMRTEX_EXTINCTION_POINTS)  // how many points extinction has; 0 for the table
DEFINE_INT(AMRTEX_COLOR_POINTS)       // how many points colour has; 0 for the table

#if AMRTEX_CPP || AMRTEX_INVISIBLE_RANGES > 0
UNIFORM_ARRAY(real, u_invisible_ranges, 2 * AMRTEX_INVISIBLE_RANGES, 16)  // first and last value of each
#endif

// The value, or its log10: where the points stand. What is not above 0 lies before all points.
real curve_axis(IN(real) value, IN(bool) logarithmic) {
  if (!logarithmic) return value;
  if (!(value > real(0))) return real(-1e30);
  return log2(max(value, real(1.17549435e-38))) * real(0.30102999566398119521);
}
real transfer_axis(IN(real) value) { return curve_axis(value, AMRTEX_LOGARITHMIC != 0); }

// The loops over points have constant bounds and no branch out of them: llvmpipe unrolls them into selects, as a GPU does; leaving early
// would save a GPU little, since the lanes of a group hold different values.
//
// A function of that name: colour over an axis, from an array of `count` points of 5 numbers: axis value,
// 1 / distance from the one before, rgb less that one's.
#define AMRTEX_COLOR_CURVE(name, points, count)                                                       \
  vec3r name(IN(real) x) {                                                                            \
    vec3r rgb = vec3r(points[2], points[3], points[4]);                                               \
    for (int i = 1; i < count; ++i) {                                                                 \
      real done = clamp((x - points[5 * i]) * points[5 * i + 1] + real(1), real(0), real(1));         \
      rgb += vec3r(points[5 * i + 2], points[5 * i + 3], points[5 * i + 4]) * done;                   \
    }                                                                                                 \
    return rgb;                                                                                       \
  }

// The same for extinction per unit of ray length, of `count` points of 3 numbers: axis value, extinction, slope to the next point.
// A segment's end is replaced by the next one's beginning, so that between two points of extinction 0 it is exactly 0.
#define AMRTEX_EXTINCTION_CURVE(name, points, count)                                     \
  real name(IN(real) x) {                                                                \
    real kappa = points[1];                                                              \
    for (int i = 0; i < count; ++i) {                                                    \
      real way = x - points[3 * i];                                                      \
      kappa = way > real(0) ? points[3 * i + 1] + points[3 * i + 2] * way : kappa;       \
    }                                                                                    \
    return kappa;                                                                        \
  }

#if AMRTEX_CPP || AMRTEX_EXTINCTION_POINTS > 0
UNIFORM_ARRAY(real, u_extinction_points, 3 * AMRTEX_EXTINCTION_POINTS, 48)  // see AMRTEX_EXTINCTION_CURVE
UNIFORM_ARRAY(real, u_color_points, 5 * AMRTEX_COLOR_POINTS, 160)           // see AMRTEX_COLOR_CURVE

AMRTEX_EXTINCTION_CURVE(points_extinction, u_extinction_points, AMRTEX_EXTINCTION_POINTS)
AMRTEX_COLOR_CURVE(points_color, u_color_points, AMRTEX_COLOR_POINTS)
#endif

#if AMRTEX_CPP || AMRTEX_EXTINCTION_POINTS == 0
BUFFER(vec4r, transfer_table, transfer_table_block)  // rgb, extinction per unit of ray length
UNIFORM(vec2r, u_transfer_axis)                      // table position = (axis value - x) * y
UNIFORM(int, u_transfer_last)                        // index of the table's last entry, at least 1

real table_position(IN(real) x) { return clamp((x - u_transfer_axis.x) * u_transfer_axis.y, real(0), real(u_transfer_last)); }

vec4r table_transfer(IN(real) axis_value) {
  real x = table_position(axis_value);
  int i = min(int(x), u_transfer_last - 1);
  vec4r low = transfer_table[i];
  vec4r high = transfer_table[i + 1];
  return low + (high - low) * (x - real(i));
}
#endif

// rgb, extinction
vec4r transfer(IN(real) value) {
  real x = transfer_axis(value);
#if AMRTEX_CPP || AMRTEX_EXTINCTION_POINTS > 0
  if (AMRTEX_EXTINCTION_POINTS > 0) return vec4r(points_color(x), points_extinction(x));
#endif
#if AMRTEX_CPP || AMRTEX_EXTINCTION_POINTS == 0
  return table_transfer(x);
#endif
}

// May any value of the range have an extinction above 0? Conservative: the host lists
// intervals of values in which every extinction is 0.
bool transfer_visible(IN(vec2r) value_range) {
  bool visible = true;
#if AMRTEX_CPP || AMRTEX_INVISIBLE_RANGES > 0
  for (int i = 0; i < AMRTEX_INVISIBLE_RANGES; ++i)
    visible = visible && !(value_range.x >= u_invisible_ranges[2 * i] && value_range.y <= u_invisible_ranges[2 * i + 1]);
#endif
  return visible;
}
