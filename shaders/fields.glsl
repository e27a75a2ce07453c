// A volume of several fields, each with its own transfer function (Wald et al. 2020): extinctions add, and the colour that is
// emitted is their mean weighted by extinction,
//   kappa = sum kappa_i(f_i),   c = sum kappa_i c_i / kappa.
// A field adds nothing where it has no value. That of field 0 is the transfer function of one field; the others' are evaluated from their points.
DEFINE_INT(AMRTEX_EXTINCTION_POINTS_1)    // how many points extinction of field 1 has
DEFINE_INT(AMRTEX_COLOR_POINTS_1)         // how many points colour has
DEFINE_INT(AMRTEX_LOGARITHMIC_1)          // 1 where the points are joined over log10(value), else 0
DEFINE_INT(AMRTEX_MORE_INVISIBLE_RANGES)  // how many intervals of values of the further fields have no extinction
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 2
DEFINE_INT(AMRTEX_EXTINCTION_POINTS_2)  // the same of field 2
DEFINE_INT(AMRTEX_COLOR_POINTS_2)
DEFINE_INT(AMRTEX_LOGARITHMIC_2)
#endif
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 3
DEFINE_INT(AMRTEX_EXTINCTION_POINTS_3)  // the same of field 3
DEFINE_INT(AMRTEX_COLOR_POINTS_3)
DEFINE_INT(AMRTEX_LOGARITHMIC_3)
#endif

UNIFORM_ARRAY(real, u_extinction_points_1, 3 * AMRTEX_EXTINCTION_POINTS_1, 48)
UNIFORM_ARRAY(real, u_color_points_1, 5 * AMRTEX_COLOR_POINTS_1, 160)
AMRTEX_EXTINCTION_CURVE(points_extinction_1, u_extinction_points_1, AMRTEX_EXTINCTION_POINTS_1)
AMRTEX_COLOR_CURVE(points_color_1, u_color_points_1, AMRTEX_COLOR_POINTS_1)
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 2
UNIFORM_ARRAY(real, u_extinction_points_2, 3 * AMRTEX_EXTINCTION_POINTS_2, 48)
UNIFORM_ARRAY(real, u_color_points_2, 5 * AMRTEX_COLOR_POINTS_2, 160)
AMRTEX_EXTINCTION_CURVE(points_extinction_2, u_extinction_points_2, AMRTEX_EXTINCTION_POINTS_2)
AMRTEX_COLOR_CURVE(points_color_2, u_color_points_2, AMRTEX_COLOR_POINTS_2)
#endif
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 3
UNIFORM_ARRAY(real, u_extinction_points_3, 3 * AMRTEX_EXTINCTION_POINTS_3, 48)
UNIFORM_ARRAY(real, u_color_points_3, 5 * AMRTEX_COLOR_POINTS_3, 160)
AMRTEX_EXTINCTION_CURVE(points_extinction_3, u_extinction_points_3, AMRTEX_EXTINCTION_POINTS_3)
AMRTEX_COLOR_CURVE(points_color_3, u_color_points_3, AMRTEX_COLOR_POINTS_3)
#endif

bool field_present(IN(real) value) { return !(AMRTEX_VALIDITY != 0 && is_no_value(value)); }

// Adds a field's colour and extinction to those of the fields before: either alone stays as it is, to the bit.
void add_field(INOUT(vec4r) sum, IN(vec3r) rgb, IN(real) kappa) {
  if (!(kappa > real(0))) return;
  PRECISE real total = sum.w + kappa;
  PRECISE real part = kappa / total;
  PRECISE vec3r color = vec3r(sum.x, sum.y, sum.z) * (real(1) - part) + rgb * part;
  sum = vec4r(color, total);
}

// rgb, extinction of all fields at a place of a region.
vec4r fields_transfer(IN(Region) r, IN(vec3r) q) {
  vec4r sum = vec4r(0);
  real value = fetch_value(r, 0, q);
  if (field_present(value)) sum = transfer(value);
  value = fetch_value(r, 1, q);
  if (field_present(value)) {
    real x = curve_axis(value, AMRTEX_LOGARITHMIC_1 != 0);
    add_field(sum, points_color_1(x), points_extinction_1(x));
  }
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 2
  if (AMRTEX_TRANSFERS > 2) {
    value = fetch_value(r, 2, q);
    if (field_present(value)) {
      real x = curve_axis(value, AMRTEX_LOGARITHMIC_2 != 0);
      add_field(sum, points_color_2(x), points_extinction_2(x));
    }
  }
#endif
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 3
  if (AMRTEX_TRANSFERS > 3) {
    value = fetch_value(r, 3, q);
    if (field_present(value)) {
      real x = curve_axis(value, AMRTEX_LOGARITHMIC_3 != 0);
      add_field(sum, points_color_3(x), points_extinction_3(x));
    }
  }
#endif
  return sum;
}

// One interval of `length` with its sample at q.
void take_fields(INOUT(Accumulation) a, IN(Region) r, IN(vec3r) q, IN(real) length) {
  count_samples(a, r, 1);
  vec4r light = fields_transfer(r, q);
  PRECISE real depth = min(light.w * length, real(1e4));  // as interval_light()
  if (depth > real(0)) add_light(a, vec4r(light.x, light.y, light.z, depth));
}

#if AMRTEX_CPP || AMRTEX_MORE_INVISIBLE_RANGES > 0
UNIFORM_ARRAY(real, u_more_invisible_ranges, 3 * AMRTEX_MORE_INVISIBLE_RANGES, 72)  // field, first and last value of each
#endif

// transfer_visible() of a field beside the first.
bool field_visible(IN(int) field, IN(vec2r) value_range) {
  bool visible = true;
#if AMRTEX_CPP || AMRTEX_MORE_INVISIBLE_RANGES > 0
  for (int i = 0; i < AMRTEX_MORE_INVISIBLE_RANGES; ++i)
    visible = visible && !(int(u_more_invisible_ranges[3 * i]) == field && value_range.x >= u_more_invisible_ranges[3 * i + 1] &&
                           value_range.y <= u_more_invisible_ranges[3 * i + 2]);
#endif
  return visible;
}

// May anything be seen in a region, of any field?
bool fields_visible(IN(Region) r) {
  if (transfer_visible(r.value_range)) return true;
#if AMRTEX_CPP || AMRTEX_FIELD_RANGES
  if (AMRTEX_FIELD_RANGES != 0) {
    bool visible = field_visible(1, fetch_range(r, 1));
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 2
    if (AMRTEX_TRANSFERS > 2) visible = visible || field_visible(2, fetch_range(r, 2));
#endif
#if AMRTEX_CPP || AMRTEX_TRANSFERS > 3
    if (AMRTEX_TRANSFERS > 3) visible = visible || field_visible(3, fetch_range(r, 3));
#endif
    return visible;
  }
#endif
  return true;
}
