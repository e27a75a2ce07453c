// Small pictures: views, drawing, comparing. Tests use it too.
#pragma once

#include <algorithm>
#include <cmath>

#include "bench/verify/meshes.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "renderers/cpu/cpu_picture.hpp"

namespace amrtex::verify {

inline View orthographic(const Vec3d& at, const Vec3d& direction, double height) {
  View view;
  view.at = at;
  view.eye = at - direction * 3.0;
  view.up = std::abs(direction.z) > 0.9 * glm::length(direction) ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  view.orthographic = true;
  view.height = height;
  return view;
}

inline View perspective(const Vec3d& eye, const Vec3d& at) {
  View view;
  view.eye = eye;
  view.at = at;
  return view;
}

inline TransferFunction constant_light(double extinction) {
  TransferFunction tf;
  tf.extinction = {{0, extinction}};
  tf.color = {{0, {0.75, 0.5, 0.25}}};
  return tf;
}

/// Few pixels, no skipping.
inline Scene small_scene(Mode mode, const View& view, Sampling sampling, int pixels = 16) {
  Scene scene;
  scene.view = view;
  scene.settings.mode = mode;
  scene.settings.sampling = sampling;
  scene.settings.width = scene.settings.height = pixels;
  scene.settings.skip = false;
  return scene;
}

/// Peaks and gaps over values around 0.5, as of `waves`.
inline TransferFunction peaks() {
  TransferFunction tf;
  tf.extinction = {{0.3, 0}, {0.55, 0}, {0.65, 25}, {0.75, 3}, {1.0, 60}};
  tf.color = {{0.4, {1, 0.2, 0}}, {0.7, {0, 1, 0.3}}, {0.9, {0.1, 0.2, 1}}};
  return tf;
}

/// World length of the pixel's ray inside the box.
inline double chord(const Scene& scene, int x, int y, const Vec3d& lower, const Vec3d& upper) {
  const RenderSettings& s = scene.settings;
  const WorldRay ray = camera_ray(camera_frame(scene.view, s.width, s.height), x, y, s.width, s.height);
  double from = 0;
  double to = kInf;
  for (int a = 0; a < 3; ++a) {
    if (ray.direction[a] == 0) {
      if (ray.origin[a] < lower[a] || ray.origin[a] > upper[a]) return 0;
      continue;
    }
    const double t0 = (lower[a] - ray.origin[a]) / ray.direction[a];
    const double t1 = (upper[a] - ray.origin[a]) / ray.direction[a];
    from = std::max(from, std::min(t0, t1));
    to = std::min(to, std::max(t0, t1));
  }
  return std::max(to - from, 0.0);
}

inline Picture draw(Context& gl, const AmrHierarchy& h, const EncodedField& field, const Scene& scene,
                    WorkCounts* counts = nullptr) {
  const Structure structure(gl, field);
  Raycaster raycaster(gl, h, structure, scene);
  raycaster.draw();
  Picture picture = raycaster.read();
  if (counts != nullptr) *counts = raycaster.count();
  return picture;
}

/// Largest difference; infinite where sizes differ or a value is NaN.
inline double difference(const Picture& a, const Picture& b) {
  if (a.values.size() != b.values.size() || a.values.empty()) return kInf;
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double d = std::abs(a.values[i] - b.values[i]);
    largest = std::max(largest, std::isnan(d) ? kInf : d);
  }
  return largest;
}

/// Root of the mean square of the difference; NaN counts as infinite.
inline double rms_difference(const Picture& a, const Picture& b) {
  if (a.values.size() != b.values.size() || a.values.empty()) return kInf;
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += (a.values[i] - b.values[i]) * (a.values[i] - b.values[i]);
  return std::isnan(sum) ? kInf : std::sqrt(sum / static_cast<double>(a.values.size()));
}

inline double largest(const Picture& p) { return *std::max_element(p.values.begin(), p.values.end()); }

}  // namespace amrtex::verify
