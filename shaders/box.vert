// Corners of a polygon on screen that belongs to one box; locates the box's region, once for all of its pixels.
#include "portable_glsl.h"
#include "contract.glsl"
#include "ray.glsl"
#include "transfer_function.glsl"
#include "accumulate.glsl"
#include "isosurface.glsl"
#include "sample.glsl"

DEFINE_INT(AMRTEX_CLAIM)  // 1 where invisible boxes keep others out of their pixels, else 0

layout(location = 0) in vec3 in_corner;  // x, y: -1 to 1 over the picture; z: number of the slice, 0 without slices
layout(location = 1) in ivec3 in_cell;   // lower cell of the box

flat out Region v_region;
flat out int v_slice;
flat out int v_visible;

void main() {
  Position p;
  p.cell = in_cell;
  p.fraction = vec3(0.5);
  Region r;
  bool visible = locate(p, r) && !region_invisible(empty_accumulation(), r);
  v_region = r;
  v_slice = int(in_corner.z);
  v_visible = visible ? 1 : 0;
  bool drawn = visible || AMRTEX_CLAIM != 0;
  gl_Position = drawn ? vec4(in_corner.x, in_corner.y, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);  // outside: nothing is left of the polygon
}
