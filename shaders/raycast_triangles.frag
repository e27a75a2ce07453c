// Entry point of the raycaster where the scene has triangles: one ray a pixel, up to the first of them.
#include "portable_glsl.h"
#include "contract.glsl"
#include "ray.glsl"
#include "transfer_function.glsl"
#include "accumulate.glsl"
#include "shadow.glsl"
#include "isosurface.glsl"
#include "march.glsl"
#include "triangles.glsl"

layout(location = 0) out vec4 out_color;
#if AMRTEX_COUNT
layout(location = 1) out uvec4 out_counted;
#endif

void main() {
  Accumulation a = empty_accumulation();
  bool met = false;
  out_color = march_to_triangle(gl_FragCoord.xy, a, met);
#if AMRTEX_COUNT
  out_counted = uvec4(a.counted + ivec4(0, 0, 0, met ? 1 : 0));  // of the last: 0 where the ray passes the domain
#endif
}
