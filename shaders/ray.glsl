// Camera rays, clipped to the box that is drawn and cut by planes.
// Ray space: finest cells along each axis; lengths in units of the smallest edge of a
// finest cell, so that with cubic cells one unit is one cell.
UNIFORM(ray_vec3, u_eye)             // finest
UNIFORM(ray_vec3, u_forward)         // units; see CameraFrame (renderers/scene/scene.hpp)
UNIFORM(ray_vec3, u_right)           // units
UNIFORM(ray_vec3, u_up)              // units
UNIFORM(int, u_orthographic)
UNIFORM(ray_vec3, u_cells_per_unit)  // finest cells a unit; (1, 1, 1) for cubic cells
UNIFORM(ray_vec3, u_draw_lower)      // finest: the domain, or the sub-box to draw
UNIFORM(ray_vec3, u_draw_upper)      // finest
UNIFORM(vec2r, u_picture_size)       // pixels
UNIFORM(real, u_length_unit)         // world length of one unit of ray length; the host may take a power of two out of it

DEFINE_INT(AMRTEX_CLIP_PLANES)  // how many planes cut what is drawn; 0 leaves them out
DEFINE_INT(AMRTEX_RAY_OFFSET)   // 1 where the intervals of each ray are moved by a number of its own, else 0
DEFINE_INT(AMRTEX_MIRROR)       // 2 axis + 1, or + 2 for the upper face, where the drawn box is mirrored; 0 where it is not
DEFINE_INT(AMRTEX_OCCLUSION)    // 1 where isosurfaces take light from one another, else 0
#define AMRTEX_MIRROR_AXIS ((AMRTEX_MIRROR - 1) / 2)
#define AMRTEX_MIRROR_UPPER (AMRTEX_MIRROR % 2 == 0)

STRUCT Ray {
  ray_vec3 entry;      // finest: where it enters the drawn box, or the eye inside it
  ray_vec3 direction;  // finest cells a unit of length
  ray_real length;     // units, from entry to exit
  ray_real start;      // units, from where the camera sends it to the entry
  ray_real first;      // units, from the entry to where drawing begins: 0, or on the plane that cuts it there
  bool mirrored;       // is it the way through the mirror image, as one through the field?
  real turn;           // radians by which what is around a hit is turned; of occlusion alone
  real phase;          // intervals by which the ray's are moved; 0 without offsets
};

// 1 / v without infinities: a ray along a face, or almost along it, never ends a region through it.
vec3r safe_inverse(IN(vec3r) v) {
  vec3r sense = vec3r(greaterThanEqual(v, vec3r(0))) * real(2) - vec3r(1);
  return sense / max(abs(v), vec3r(1e-20));
}

#if AMRTEX_CPP || AMRTEX_CLIP_PLANES > 0
UNIFORM_ARRAY(ray_real, u_clip_planes, 4 * AMRTEX_CLIP_PLANES, 32)  // a, b, c, d of each: a x + b y + c z >= d is kept; finest

// Cuts a ray that begins at its entry. False where nothing is left. The entry stays, so that samples keep their places.
bool clip_ray(INOUT(Ray) ray) {
  for (int i = 0; i < AMRTEX_CLIP_PLANES; ++i) {
    ray_vec3 normal = ray_vec3(u_clip_planes[4 * i], u_clip_planes[4 * i + 1], u_clip_planes[4 * i + 2]);
    ray_real height = dot(normal, ray.entry) - u_clip_planes[4 * i + 3];
    ray_real rise = dot(normal, ray.direction);
    if (rise == ray_real(0) && height < ray_real(0)) return false;
    if (rise > ray_real(0)) ray.first = max(ray.first, -height / rise);
    if (rise < ray_real(0)) ray.length = min(ray.length, -height / rise);
  }
  return ray.length > ray.first;
}
#endif

#if AMRTEX_CPP || AMRTEX_RAY_OFFSET
UNIFORM(int, u_ray_seed)
#endif
#if AMRTEX_CPP || AMRTEX_OCCLUSION
UNIFORM(int, u_occlusion_seed)
#endif

#if AMRTEX_CPP || AMRTEX_RAY_OFFSET || AMRTEX_OCCLUSION
// Chris Wellons' lowbias32: each bit of v changes each of the result with nearly the same chance.
uint hash_bits(IN(uint) v) {
  uint h = (v ^ (v >> 16u)) * 0x7feb352du;
  h = (h ^ (h >> 15u)) * 0x846ca68bu;
  return h ^ (h >> 16u);
}

// In (0, 1), the same in every precision: 23 bits and a half.
real pixel_random(IN(vec2r) pixel, IN(int) seed) {
  uint h = hash_bits(uint(seed));
  h = hash_bits(h + uint(int(floor(pixel.x))));
  h = hash_bits(h + uint(int(floor(pixel.y))));
  return (real(h >> 9u) + real(0.5)) * real(1.1920928955078125e-7);
}
#endif

// False when the pixel's ray misses the box. `pixel`: centre, from the lower left.
bool camera_ray(IN(vec2r) pixel, OUT(Ray) ray) {
  ray_real u = ray_real(pixel.x) * ray_real(2) / ray_real(u_picture_size.x) - ray_real(1);
  ray_real v = ray_real(pixel.y) * ray_real(2) / ray_real(u_picture_size.y) - ray_real(1);
  ray_vec3 offset = u_right * u + u_up * v;
  ray_vec3 direction = u_forward;
  ray_vec3 origin = u_eye;
  if (u_orthographic != 0) origin += offset * u_cells_per_unit;
  else direction = normalize(u_forward + offset);
  ray.direction = direction * u_cells_per_unit;
  ray_real enter = ray_real(0);
  ray_real leave = ray_real(1e30);
  ray.entry = origin;
  ray.length = ray_real(0);
  ray.start = ray_real(0);
  ray.first = ray_real(0);
  ray.phase = real(0);
  ray.mirrored = false;
#if AMRTEX_CPP || AMRTEX_RAY_OFFSET
  if (AMRTEX_RAY_OFFSET != 0) ray.phase = pixel_random(pixel, u_ray_seed);
#endif
  ray.turn = real(0);
#if AMRTEX_CPP || AMRTEX_OCCLUSION
  if (AMRTEX_OCCLUSION != 0) ray.turn = pixel_random(pixel, u_occlusion_seed) * real(6.28318530717958648);
#endif
  ray_vec3 lower = u_draw_lower;
  ray_vec3 upper = u_draw_upper;
  if (AMRTEX_MIRROR != 0) {  // and its image
    ray_real size = upper[AMRTEX_MIRROR_AXIS] - lower[AMRTEX_MIRROR_AXIS];
    if (AMRTEX_MIRROR_UPPER) upper[AMRTEX_MIRROR_AXIS] += size;
    else lower[AMRTEX_MIRROR_AXIS] -= size;
  }
  for (int axis = 0; axis < 3; ++axis) {
    ray_real o = origin[axis];
    ray_real d = ray.direction[axis];
    if (d == ray_real(0)) {  // parallel to these faces: inside all the way, or never
      if (o < lower[axis] || o > upper[axis]) return false;
    } else {
      ray_real t0 = (lower[axis] - o) / d;
      ray_real t1 = (upper[axis] - o) / d;
      enter = max(enter, min(t0, t1));
      leave = min(leave, max(t0, t1));
    }
  }
  if (!(leave > enter)) return false;
  ray.entry = clamp(origin + ray.direction * enter, lower, upper);
  ray.length = leave - enter;
  ray.start = enter;
#if AMRTEX_CPP || AMRTEX_CLIP_PLANES > 0
  if (AMRTEX_CLIP_PLANES > 0) return clip_ray(ray);
#endif
  return true;
}

// A ray from a place inside of what is drawn ends at the latest where that ends.
void end_where_drawn(INOUT(Ray) ray) {
  for (int axis = 0; axis < 3; ++axis) {
    ray_real d = ray.direction[axis];
    if (d > ray_real(0)) ray.length = min(ray.length, (u_draw_upper[axis] - ray.entry[axis]) / d);
    if (d < ray_real(0)) ray.length = min(ray.length, (u_draw_lower[axis] - ray.entry[axis]) / d);
  }
#if AMRTEX_CPP || AMRTEX_CLIP_PLANES > 0
  if (AMRTEX_CLIP_PLANES > 0 && !clip_ray(ray)) ray.length = ray_real(0);
#endif
  ray.first = ray_real(0);  // it begins where something is drawn, whatever rounding says
}

// From `entry` (finest), with no length yet.
Ray secondary_ray(IN(ray_vec3) entry) {
  Ray ray;
  ray.entry = entry;
  ray.direction = ray_vec3(1, 0, 0);
  ray.length = ray_real(0);
  ray.start = ray_real(0);
  ray.first = ray_real(0);
  ray.mirrored = false;
  ray.turn = real(0);
  ray.phase = real(0.5);
  return ray;
}

// Splits a point in finest space; faces belong to the upper cell, the domain's last face
// to its last cell.
Position make_position(IN(ray_vec3) p) {
  Position position;
  ray_vec3 last = ray_vec3(u_domain_cells - ivec3(1));
  ray_vec3 whole = clamp(floor(p), ray_vec3(0), last);
  position.cell = ivec3(whole);
  position.fraction = clamp(vec3r(p - whole), vec3r(0), vec3r(AMRTEX_BELOW_ONE));
  return position;
}

#if AMRTEX_CPP || AMRTEX_MIRROR
// The first (0) or second (1) part of a ray, as a ray through the drawn box itself: up to where it goes through the mirror, or from
// there on; what lies in the image is reflected. False where nothing of it is drawn. `goes_on`: does another part follow?
bool mirrored_part(IN(Ray) ray, IN(int) number, OUT(Ray) part, OUT(bool) goes_on) {
  ray_real plane = AMRTEX_MIRROR_UPPER ? u_draw_upper[AMRTEX_MIRROR_AXIS] : u_draw_lower[AMRTEX_MIRROR_AXIS];
  ray_real outward = ray_real(AMRTEX_MIRROR_UPPER ? 1 : -1);
  ray_real height = (ray.entry[AMRTEX_MIRROR_AXIS] - plane) * outward;
  ray_real rise = ray.direction[AMRTEX_MIRROR_AXIS] * outward;
  ray_real fold = rise == ray_real(0) ? ray.length : -height / rise;
  bool folds = fold > ray_real(0) && fold < ray.length;
  bool begins_in_image = height > ray_real(0) || (height == ray_real(0) && rise > ray_real(0));
  part = ray;
  goes_on = folds && number == 0;
  if (number == 1 && !folds) return false;
  ray_real begin = number == 1 ? fold : ray_real(0);
  if (number == 1) {
    part.entry = ray.entry + ray.direction * fold;
    part.entry[AMRTEX_MIRROR_AXIS] = plane;
  }
  part.length = (goes_on ? fold : ray.length) - begin;
  part.start = ray.start + begin;
  part.first = max(ray.first - begin, ray_real(0));
  part.mirrored = begins_in_image != (number == 1);
  if (part.mirrored) {
    part.entry[AMRTEX_MIRROR_AXIS] = ray_real(2) * plane - part.entry[AMRTEX_MIRROR_AXIS];
    part.direction[AMRTEX_MIRROR_AXIS] = -ray.direction[AMRTEX_MIRROR_AXIS];
  }
  part.entry = clamp(part.entry, u_draw_lower, u_draw_upper);
  return part.length > part.first;
}
#endif
