// Entry point of `amrtex sample`: a field at given positions.
#include "portable_glsl.h"
#include "contract.glsl"
DEFINE_INT(AMRTEX_PROBE_FIELD)  // number of the field to sample, below AMRTEX_FIELDS
#if AMRTEX_PROBE_FIELD >= AMRTEX_FIELDS
#error AMRTEX_PROBE_FIELD must be below AMRTEX_FIELDS
#endif

layout(local_size_x = 64) in;
layout(std430) readonly buffer probe_cells_block { ivec4 probe_cells[]; };
layout(std430) readonly buffer probe_fractions_block { vec4 probe_fractions[]; };
layout(std430) writeonly buffer probe_values_block { vec4 probe_values[]; };
uniform int u_probe_count;

void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= u_probe_count) return;
  Position p;
  p.cell = probe_cells[i].xyz;
  p.fraction = probe_fractions[i].xyz;
  FieldSample s;
  bool found = sample_value(p, AMRTEX_PROBE_FIELD, s);
  probe_values[i] = vec4(s.value, found ? 1.0 : 0.0, float(s.level), 0.0);
}
