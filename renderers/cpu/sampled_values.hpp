// An encoding's text under other names: its regions say where the march samples, what it finds there comes
// from somewhere else. Included inside the struct of cpu_sampler.cpp.in, in place of the encoding's own file.
#define locate encoding_locate
#define fetch_value encoding_value
#define fetch_stencil encoding_stencil
#define fetch_gradient encoding_gradient
#define locate_group encoding_group
#define locate_in_group encoding_in_group
#define open_region encoding_open
#include AMRTEX_SAMPLED_FILE
#undef locate
#undef fetch_value
#undef fetch_stencil
#undef fetch_gradient
#undef locate_group
#undef locate_in_group
#undef open_region
// every sample is fetched, and any may be without a value; gradients are differences of the values
#undef AMRTEX_CELL_REGIONS
#undef AMRTEX_STAGED_LOCATE
#undef AMRTEX_FETCH_GRADIENT
#undef AMRTEX_STORED_GRADIENTS
#define AMRTEX_VALIDITY 1

const FieldValues* values = nullptr;

/// True everywhere: whether there is a value is not for the encoding to say.
bool locate(const Position& p, Region& r) {
  encoding_locate(p, r);
  return true;
}

/// Samples of `adaptive` often lie on faces of cells to the last bit: floor(q) is the cell here as well.
FinestPosition sampled_position(const Region& r, const vec3r& q) const {
  const vec3r cell = floor(q);
  const vec3r in_cell = min((q - cell) * static_cast<real>(r.width), vec3r(static_cast<real>(r.width) * AMRTEX_BELOW_ONE));
  const vec3r finest = floor(in_cell);
  FinestPosition p;
  p.cell = r.lower + ivec3(cell) * r.width + ivec3(finest);
  p.fraction = in_cell - finest;
  const ivec3 last = u_domain_cells - ivec3(1);
  for (int axis = 0; axis < 3; ++axis) {  // rounding on the domain's faces
    if (p.cell[axis] < 0) p.fraction[axis] = 0;
    if (p.cell[axis] > last[axis]) p.fraction[axis] = AMRTEX_BELOW_ONE;
  }
  p.cell = clamp(p.cell, ivec3(0), last);
  return p;
}

real fetch_value(const Region& r, int field, const vec3r& q) {
  const std::optional<double> value = (*values)(sampled_position(r, q), field);
  return value ? static_cast<real>(*value) : no_value();
}
