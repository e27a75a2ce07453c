// Stiff media whose light has a closed form, for the reference that all else is judged by. Tests use them too.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "bench/verify/meshes.hpp"
#include "renderers/reference/hierarchy_reference.hpp"

namespace amrtex::verify {

inline constexpr double kFrom = 0.125, kTo = 0.875, kWay = kTo - kFrom;  // between the outer centres of 4 cells f = x exactly

/// A medium over f = x, and what a ray through it from kFrom to kTo must be.
struct Medium {
  std::string name;
  TransferFunction tf;
  double color, opacity;
};

inline TransferFunction curve(std::vector<TransferFunction::ExtinctionPoint> extinction, double dark, double bright,
                              bool logarithmic = false) {
  TransferFunction tf;
  tf.extinction = std::move(extinction);
  tf.color = {{dark, Vec3d(0)}, {bright, Vec3d(1)}};
  tf.logarithmic = logarithmic;
  return tf;
}

/// Dawson's integral exp(-x^2) int_0^x exp(t^2) dt (G. B. Rybicki, Computers in Physics 3, 1989; off by exp(-61) at this width).
inline double dawson(double x) {
  constexpr double kWidth = 0.2;
  const double n0 = 2 * std::round(0.5 * x / kWidth);
  double sum = 0;
  for (int k = -61; k <= 61; k += 2) {
    const double away = x - (n0 + k) * kWidth;
    sum += std::exp(-away * away) / (n0 + k);
  }
  return sum / std::sqrt(std::numbers::pi);
}

/// k = K u / w, c = u / w on [0, w]: C = 1/w (sqrt(pi / 2a) erf(w sqrt(a / 2)) - w exp(-a w^2 / 2)), a = K / w.
inline double rising(double k, double w) {
  const double a = k / w;
  return std::sqrt(std::numbers::pi / (2 * a)) * std::erf(w * std::sqrt(a / 2)) / w - std::exp(-a * w * w / 2);
}
/// k = K (1 - u / w), c = u / w on [0, w]: C = 1/w sqrt(2 / a) D(w sqrt(a / 2)) - exp(-a w^2 / 2), D Dawson's integral.
inline double falling(double k, double w) {
  const double a = k / w;
  return std::sqrt(2 / a) * dawson(w * std::sqrt(a / 2)) / w - std::exp(-a * w * w / 2);
}
/// k = K, c = u / w on [0, w]: C = (1 - exp(-K w) (1 + K w)) / (K w).
inline double level(double k, double w) { return (1 - std::exp(-k * w) * (1 + k * w)) / (k * w); }

inline Medium ramp(double k) {
  return {"ramp", curve({{kFrom, 0}, {kTo, k}}, kFrom, kTo), rising(k, kWay), -std::expm1(-k * kWay / 2)};
}
inline Medium falling_ramp(double k) {
  return {"falling ramp", curve({{kFrom, k}, {kTo, 0}}, kFrom, kTo), falling(k, kWay), -std::expm1(-k * kWay / 2)};
}
inline Medium constant_medium(double k) {
  return {"constant", curve({{0, k}}, kFrom, kTo), level(k, kWay), -std::expm1(-k * kWay)};
}
/// Nothing before x = 0.55, k behind; colours rise all along.
inline Medium step_medium(double k) {
  const double at = 0.55;
  const double behind = kTo - at;
  const double a = -std::expm1(-k * behind);
  return {"step", curve({{at, 0}, {std::nextafter(at, 1.0), k}}, kFrom, kTo),
          (at - kFrom) / kWay * a + behind / kWay * level(k, behind), a};
}
/// A triangle of half width w around x = 0.55; colours rise across it: 0 to 1/2 on its first half.
inline Medium peak(double k, double w) {
  const double at = 0.55;
  const double through = std::exp(-k * w / 2);
  const double behind = 0.5 * (1 - through) + 0.5 * falling(k, w);
  return {fmt::format("peak of half width {}", w), curve({{at - w, 0}, {at, k}, {at + w, 0}}, at - w, at + w),
          0.5 * rising(k, w) + through * behind, -std::expm1(-k * w)};
}

inline std::vector<Medium> stiff_media() {
  std::vector<Medium> media;
  for (const double k : {1.0, 30.0, 1e3, 1e4, 1e5, 1e6})
    for (const Medium& m : {ramp(k), falling_ramp(k), constant_medium(k), step_medium(k), peak(k, 0.05), peak(k, 1e-4)}) {
      media.push_back(m);
      media.back().name += fmt::format(", extinction {}", k);
    }
  return media;
}

/// The ray through the middle of a 4^3 mesh along x, from kFrom to kTo.
inline Scene one_ray(TransferFunction tf) {
  Scene scene;
  scene.settings.mode = Mode::dvr;
  scene.settings.width = scene.settings.height = 1;
  scene.view.orthographic = true;
  scene.view.eye = {-2, 0.4, 0.45};
  scene.view.at = {0, 0.4, 0.45};
  scene.view.up = {0, 0, 1};
  scene.view.height = 1e-3;
  scene.region = {Vec3d(kFrom, 0, 0), Vec3d(kTo, 1, 1)};
  scene.transfer_function = std::move(tf);
  return scene;
}

inline AmrHierarchy column(const Function& f) { return MeshBuilder(Vec3i(4)).root(f).hierarchy(); }
inline AmrHierarchy column() {
  return column([](const Vec3d& p) { return p.x; });
}

/// Of one channel.
inline double off(const ReferencePicture& drawn, const Medium& m) {
  const double* pixel = drawn.picture.pixel(0, 0);
  return std::max(std::abs(pixel[0] - m.color), std::abs(pixel[3] - m.opacity));
}

/// Over the whole suite: the worst error and all evaluations.
inline std::pair<double, std::int64_t> over_stiff_media(const HierarchyReference& reference, const ReferenceRule& rule) {
  std::pair<double, std::int64_t> all{0, 0};
  for (const Medium& m : stiff_media()) {
    const ReferencePicture drawn = reference.draw(one_ray(m.tf), rule);
    all.first = std::max(all.first, off(drawn, m));
    all.second += drawn.evaluations;
  }
  return all;
}

}  // namespace amrtex::verify
