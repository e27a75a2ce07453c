// Entry point of the raycaster: one ray a pixel through the contract.
#include "portable_glsl.h"
#include "contract.glsl"
#include "ray.glsl"
#include "transfer_function.glsl"
#include "accumulate.glsl"
#include "shadow.glsl"
#include "isosurface.glsl"
#include "march.glsl"

layout(location = 0) out vec4 out_color;
#if AMRTEX_COUNT
layout(location = 1) out uvec4 out_counted;
#endif

void main() {
  Accumulation a = empty_accumulation();
  Ray ray;
  vec4 color = missed_picture();
  bool met = camera_ray(gl_FragCoord.xy, ray);
  if (met) color = march_ray(ray, a);
  out_color = color;
#if AMRTEX_COUNT
  out_counted = uvec4(a.counted + ivec4(0, 0, 0, met ? 1 : 0));  // of the last: 0 where the ray passes the domain
#endif
}
