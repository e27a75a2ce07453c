// The limit to measure `uniform` against: a march through one dense texture with nothing
// of the contract: one filtered fetch and one transfer-function look-up a sample.
#include "portable_glsl.h"

uniform ivec3 u_domain_cells;
struct Position {  // what ray.glsl needs of contract.glsl
  ivec3 cell;
  vec3 fraction;
};
#include "ray.glsl"

uniform sampler3D tex_dense;
uniform sampler2D tex_transfer;  // one row: rgb, extinction per unit of length
uniform vec2 u_transfer_axis;    // texture coordinate = value * y + x
uniform float u_step;            // finest cells

layout(location = 0) out vec4 out_color;

void main() {
  Ray ray;
  out_color = vec4(0);
  if (!camera_ray(gl_FragCoord.xy, ray)) return;
  vec3 to_texture = 1.0 / vec3(u_domain_cells);
  vec3 p = (ray.entry + ray.direction * (0.5 * u_step)) * to_texture;
  vec3 dp = ray.direction * u_step * to_texture;
  int n = int(ray.length / u_step);
  vec3 color = vec3(0);
  float transmittance = 1.0;
  for (int i = 0; i < n; ++i) {
    float value = textureLod(tex_dense, p, 0.0).x;
    vec4 light = textureLod(tex_transfer, vec2(value * u_transfer_axis.y + u_transfer_axis.x, 0.5), 0.0);
    float passed = exp(-light.w * u_step);
    color += light.rgb * (transmittance * (1.0 - passed));
    transmittance *= passed;
    p += dp;
  }
  out_color = vec4(color, 1.0 - transmittance);
}
