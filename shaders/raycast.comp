// Entry point of the raycaster as a compute shader: the rays of raycast.frag and raycast_triangles.frag, a tile of 8 x 8
// pixels a work group (`render.dispatch` compute).
#include "portable_glsl.h"
#include "contract.glsl"
#include "ray.glsl"
#include "transfer_function.glsl"
#include "accumulate.glsl"
#include "shadow.glsl"
#include "isosurface.glsl"
#include "march.glsl"
#if AMRTEX_TRIANGLES
#include "triangles.glsl"
#endif

layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f, binding = 0) writeonly uniform image2D img_color;
#if AMRTEX_COUNT
layout(rgba32ui, binding = 1) writeonly uniform uimage2D img_counted;
#endif

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(img_color)))) return;
  vec2 middle = vec2(pixel) + vec2(0.5);  // gl_FragCoord.xy of a fragment
  Accumulation a = empty_accumulation();
  bool met = false;
#if AMRTEX_TRIANGLES
  vec4 color = march_to_triangle(middle, a, met);
#else
  Ray ray;
  vec4 color = missed_picture();
  met = camera_ray(middle, ray);
  if (met) color = march_ray(ray, a);
#endif
  imageStore(img_color, pixel, color);
#if AMRTEX_COUNT
  imageStore(img_counted, pixel, uvec4(a.counted + ivec4(0, 0, 0, met ? 1 : 0)));
#endif
}
