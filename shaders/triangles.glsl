// Triangles that a ray meets: it ends at the first of them, which shows through what was gathered in front of it. Where rays meet them was
// found on the host (renderers/scene/triangle_layer.hpp). Scenes without triangles do not include this file.
DEFINE_INT(AMRTEX_TRIANGLES)  // how many objects they belong to

UNIFORM_ARRAY(real, u_triangle_colors, 3 * AMRTEX_TRIANGLES, 48)  // rgb of each
// One a pixel, row by row from the lower left: distance from where the ray starts, units, rounded; what the rounding left of it; the
// light that the triangle reflects; its object, or -1 where the ray meets none.
BUFFER(vec4r, triangle_layer, triangle_layer_block)

vec4r first_triangle(IN(vec2r) pixel) {
  return triangle_layer[int(floor(pixel.y)) * int(u_picture_size.x) + int(floor(pixel.x))];
}

// Units from the ray's entry to the triangle.
ray_real triangle_place(IN(Ray) ray, IN(vec4r) first) {
  PRECISE ray_real place = (ray_real(first.x) - ray.start) + ray_real(first.y);
  return place;
}

// The triangle behind what a ray gathered; it has no place in pictures of one channel.
vec4r over_triangle(IN(vec4r) color, IN(vec4r) first) {
  if (first.w < real(0) || AMRTEX_MODE == AMRTEX_MODE_PROJECTION || AMRTEX_MODE == AMRTEX_MODE_MIP) return color;
  int object = int(first.w);
  vec3r rgb = vec3r(u_triangle_colors[3 * object], u_triangle_colors[3 * object + 1], u_triangle_colors[3 * object + 2]);
  return vec4r(vec3r(color.x, color.y, color.z) + rgb * (first.z * (real(1) - color.w)), real(1));
}

// The picture's value for a pixel; `met`: is there anything of the drawn box in front of the triangle?
vec4r march_to_triangle(IN(vec2r) pixel, INOUT(Accumulation) a, OUT(bool) met) {
  Ray ray;
  vec4r first = first_triangle(pixel);
  vec4r color = missed_picture();
  met = camera_ray(pixel, ray);
  if (met && first.w >= real(0)) {
    ray_real place = triangle_place(ray, first);
    ray.length = min(ray.length, place);
    met = ray.length > ray.first;
  }
  if (met) color = march_ray(ray, a);
  return over_triangle(color, first);
}
