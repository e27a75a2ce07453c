#include "renderers/scene/background.hpp"

#include <algorithm>
#include <cmath>

#include "renderers/scene/color_map.hpp"

namespace amrtex {
namespace {

/// Mean lightness of what a volume emits, as its extinction weights it along the curves' axis.
double volume_lightness(const TransferFunction& tf) {
  constexpr int kPlaces = 256;
  const double first = tf.axis(std::min(tf.extinction.front().value, tf.color.front().value));
  const double last = tf.axis(std::max(tf.extinction.back().value, tf.color.back().value));
  double sum = 0, weight = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const double x = first + (last - first) * (i + 0.5) / kPlaces;
    const double value = tf.logarithmic ? std::pow(10, x) : x;
    const double kappa = std::min(tf.extinction_at(value), 1e30);
    sum += kappa * lightness(tf.color_at(value));
    weight += kappa;
  }
  return weight > 0 ? sum / weight : lightness(tf.color.back().rgb);
}

double surface_lightness(const Scene& scene) {
  double sum = 0;
  for (const double value : scene.settings.isosurfaces.values) sum += lightness(surface_color(scene, value));
  return scene.settings.isosurfaces.values.empty() ? 100 : sum / static_cast<double>(scene.settings.isosurfaces.values.size());
}

}  // namespace

Vec3d background_for(const Scene& scene) {
  constexpr double kLight = 55;
  const Vec3d dark = linear_from_srgb(Vec3d(0.07, 0.08, 0.10));
  const RenderSettings& s = scene.settings;
  if (s.picture_channels() == 1) return Vec3d(1);
  if (s.isosurfaces.output == Output::normal && s.draws_surfaces()) return dark;
  const TransferFunction& tf = scene.transfer_function;
  const bool volume = s.draws_volume() && !tf.extinction.empty() && !tf.color.empty();
  return (volume ? volume_lightness(tf) : surface_lightness(scene)) > kLight ? dark : Vec3d(1);
}

}  // namespace amrtex
