// Entry point of the consumers that draw box by box: what one pixel's ray gathers in one box, or on one slice of it.
#include "portable_glsl.h"
#include "contract.glsl"
#include "ray.glsl"
#include "transfer_function.glsl"
#include "accumulate.glsl"
#include "isosurface.glsl"
#include "march.glsl"
#include "boxes.glsl"

flat in Region v_region;
flat in int v_slice;
flat in int v_visible;

layout(location = 0) out vec4 out_color;

void main() {
  Accumulation a = empty_accumulation();
  Ray ray;
  if (!camera_ray(gl_FragCoord.xy, ray)) discard;
#if AMRTEX_SLICES
  Position p;
  float length;
  if (!find_slice(ray, v_region, v_slice, p, length)) discard;  // another box's pixel
  if (v_visible != 0) take_slice(a, v_region, p, length);
#else
  march_box(ray, v_region, a);
#endif
#if AMRTEX_COUNT
  // added up by blending, but of the last the largest is kept: did the pixel have a sample?
  float sampled = a.counted.x > 0 ? 1.0 : 0.0;
  out_color = vec4(float(a.counted.x), sampled, 0.0, sampled);
#else
  out_color = box_picture(a);
#endif
}
