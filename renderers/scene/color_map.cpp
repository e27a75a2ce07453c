#include "renderers/scene/color_map.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kPi = 3.14159265358979323846;

// --- CIELAB under D65 ---

constexpr Vec3d kWhite{0.95047, 1, 1.08883};

Vec3d xyz_from_linear(const Vec3d& c) {
  return {0.4124564 * c.x + 0.3575761 * c.y + 0.1804375 * c.z, 0.2126729 * c.x + 0.7151522 * c.y + 0.0721750 * c.z,
          0.0193339 * c.x + 0.1191920 * c.y + 0.9503041 * c.z};
}

Vec3d linear_from_xyz(const Vec3d& p) {
  return {3.2404542 * p.x - 1.5371385 * p.y - 0.4985314 * p.z, -0.9692660 * p.x + 1.8760108 * p.y + 0.0415560 * p.z,
          0.0556434 * p.x - 0.2040259 * p.y + 1.0572252 * p.z};
}

double lab_curve(double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; }
double lab_curve_back(double f) { return f > 6.0 / 29 ? f * f * f : (116 * f - 16) * 27 / 24389; }

}  // namespace

Vec3d lab_from_linear(const Vec3d& linear) {
  const Vec3d p = xyz_from_linear(linear) / kWhite;
  const double x = lab_curve(p.x), y = lab_curve(p.y), z = lab_curve(p.z);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Vec3d linear_from_lab(const Vec3d& lab) {
  const double y = (lab.x + 16) / 116;
  const Vec3d p(lab_curve_back(y + lab.y / 500), lab_curve_back(y), lab_curve_back(y - lab.z / 200));
  return glm::clamp(linear_from_xyz(p * kWhite), Vec3d(0), Vec3d(1));
}

namespace {

/// Lab in polar form: magnitude, saturation and hue as angles.
struct Msh {
  double m, s, h;
};

Msh msh_from_srgb(const Vec3d& srgb) {
  const Vec3d lab = lab_from_linear(linear_from_srgb(srgb));
  const double m = glm::length(lab);
  return {m, m > 0.001 ? std::acos(lab.x / m) : 0, std::atan2(lab.z, lab.y)};
}

Vec3d srgb_from_msh(const Msh& c) {
  const Vec3d lab(c.m * std::cos(c.s), c.m * std::sin(c.s) * std::cos(c.h), c.m * std::sin(c.s) * std::sin(c.h));
  return srgb_from_linear(linear_from_lab(lab));
}

/// Hue of an unsaturated colour beside a saturated one, turned so that the way between them looks straight.
double adjusted_hue(const Msh& saturated, double unsaturated_m) {
  if (saturated.m >= unsaturated_m) return saturated.h;
  const double spin =
      saturated.s * std::sqrt(unsaturated_m * unsaturated_m - saturated.m * saturated.m) / (saturated.m * std::sin(saturated.s));
  return saturated.h > -kPi / 3 ? saturated.h + spin : saturated.h - spin;
}

// --- reduction ---

/// May the points between i and j be left out?
bool joins(const ColorPoints& dense, const std::vector<Vec3d>& srgb, std::size_t i, std::size_t j, double bound) {
  const auto fits = [&](std::size_t k) {
    const double w = (dense[k].value - dense[i].value) / (dense[j].value - dense[i].value);
    const Vec3d off = glm::abs(srgb_from_linear(dense[i].rgb + w * (dense[j].rgb - dense[i].rgb)) - srgb[k]);
    return std::max({off.x, off.y, off.z}) <= bound;
  };
  if (j - i > 2 && !fits(i + (j - i) / 2)) return false;  // most that do not fit show it there
  for (std::size_t k = i + 1; k < j; ++k)
    if (!fits(k)) return false;
  return true;
}

ColorPoints fewest_of_block(const ColorPoints& dense, double bound) {
  constexpr std::size_t kFar = std::numeric_limits<std::size_t>::max();
  std::vector<Vec3d> srgb;
  for (const auto& p : dense) srgb.push_back(srgb_from_linear(p.rgb));
  // of each point: how many are needed from it to the end, and the next of them
  std::vector<std::size_t> count(dense.size(), kFar), next(dense.size(), 0);
  count.back() = 1;
  for (std::size_t i = dense.size() - 1; i-- > 0;)
    for (std::size_t j = dense.size() - 1; j > i; --j)
      if (count[j] + 1 < count[i] && joins(dense, srgb, i, j, bound)) {
        count[i] = count[j] + 1;
        next[i] = j;
      }
  ColorPoints points{dense.front()};
  for (std::size_t i = 0; i + 1 < dense.size(); i = next[i]) points.push_back(dense[next[i]]);
  return points;
}

// --- the maps ---

/// A point of a map of 256 colours: its number, and sRGB.
struct Entry {
  int index;
  double r, g, b;
};

/// Each is what `fewest_points` leaves of the 256 colours that matplotlib 3.6.3 has (`_cm_listed.py`); color_map_test makes them
/// again from there. viridis, inferno, magma, plasma: Nathaniel J. Smith, Stefan van der Walt and Eric Firing, CC0. turbo: Anton
/// Mikhailov, Google LLC, Apache License 2.0. None of them has a formula, and a build should not want a plotting library for a
/// hundred numbers.
constexpr Entry kViridis[] = {
    {0, 0.2670, 0.0049, 0.3294},   {14, 0.2814, 0.0843, 0.4074},  {33, 0.2780, 0.1804, 0.4867},  {61, 0.2355, 0.3095, 0.5429},
    {104, 0.1607, 0.4785, 0.5581}, {141, 0.1195, 0.6148, 0.5377}, {157, 0.1466, 0.6731, 0.5089}, {170, 0.2080, 0.7187, 0.4729},
    {183, 0.2965, 0.7616, 0.4242}, {196, 0.4040, 0.8003, 0.3626}, {210, 0.5356, 0.8358, 0.2819}, {225, 0.6889, 0.8654, 0.1827},
    {236, 0.8042, 0.8820, 0.1150}, {245, 0.8963, 0.8936, 0.0963}, {253, 0.9744, 0.9036, 0.1302}, {255, 0.9932, 0.9062, 0.1439}};
constexpr Entry kInferno[] = {{0, 0.0015, 0.0005, 0.0139},   {7, 0.0117, 0.0094, 0.0635},   {16, 0.0423, 0.0281, 0.1411},
                              {26, 0.0930, 0.0456, 0.2344},  {38, 0.1696, 0.0425, 0.3409},  {53, 0.2713, 0.0409, 0.4120},
                              {75, 0.4101, 0.0879, 0.4331},  {99, 0.5596, 0.1413, 0.4101},  {128, 0.7357, 0.2159, 0.3302},
                              {149, 0.8467, 0.2976, 0.2441}, {168, 0.9232, 0.3994, 0.1552}, {185, 0.9673, 0.5091, 0.0687},
                              {195, 0.9819, 0.5794, 0.0262}, {203, 0.9873, 0.6379, 0.0349}, {211, 0.9871, 0.6979, 0.0877},
                              {220, 0.9800, 0.7668, 0.1664}, {228, 0.9680, 0.8285, 0.2500}, {236, 0.9532, 0.8889, 0.3514},
                              {243, 0.9464, 0.9372, 0.4586}, {253, 0.9765, 0.9898, 0.6168}, {255, 0.9884, 0.9984, 0.6449}};
constexpr Entry kMagma[] = {
    {0, 0.0015, 0.0005, 0.0139},   {8, 0.0137, 0.0118, 0.0687},   {18, 0.0481, 0.0366, 0.1503},  {29, 0.0978, 0.0615, 0.2485},
    {42, 0.1717, 0.0673, 0.3708},  {57, 0.2720, 0.0610, 0.4657},  {79, 0.4086, 0.1079, 0.5041},  {103, 0.5566, 0.1633, 0.5052},
    {129, 0.7228, 0.2172, 0.4733}, {152, 0.8633, 0.2837, 0.4124}, {168, 0.9372, 0.3649, 0.3686}, {185, 0.9782, 0.4836, 0.3660},
    {203, 0.9943, 0.6170, 0.4229}, {223, 0.9970, 0.7624, 0.5288}, {243, 0.9913, 0.9058, 0.6613}, {255, 0.9871, 0.9914, 0.7495}};
constexpr Entry kPlasma[] = {{0, 0.0504, 0.0298, 0.5280},   {14, 0.1789, 0.0193, 0.5841},  {33, 0.3062, 0.0089, 0.6337},
                             {57, 0.4537, 0.0028, 0.6603},  {73, 0.5462, 0.0390, 0.6470},  {90, 0.6360, 0.1121, 0.6052},
                             {112, 0.7360, 0.2094, 0.5279}, {139, 0.8368, 0.3291, 0.4309}, {167, 0.9207, 0.4584, 0.3362},
                             {194, 0.9764, 0.5966, 0.2448}, {220, 0.9944, 0.7470, 0.1638}, {238, 0.9780, 0.8614, 0.1428},
                             {253, 0.9442, 0.9619, 0.1469}, {255, 0.9400, 0.9752, 0.1313}};
constexpr Entry kTurbo[] = {
    {0, 0.1900, 0.0718, 0.2322},   {4, 0.2086, 0.1180, 0.3461},   {10, 0.2324, 0.1860, 0.5000},  {21, 0.2628, 0.3064, 0.7297},
    {35, 0.2770, 0.4515, 0.9235},  {45, 0.2688, 0.5500, 0.9930},  {53, 0.2329, 0.6292, 0.9920},  {65, 0.1517, 0.7447, 0.9142},
    {75, 0.1003, 0.8296, 0.8139},  {84, 0.0996, 0.8904, 0.7239},  {91, 0.1439, 0.9268, 0.6545},  {98, 0.2214, 0.9569, 0.5691},
    {105, 0.3201, 0.9797, 0.4765}, {113, 0.4432, 0.9955, 0.3735}, {121, 0.5603, 0.9987, 0.2862}, {129, 0.6539, 0.9878, 0.2283},
    {140, 0.7661, 0.9463, 0.2031}, {163, 0.9504, 0.7882, 0.2283}, {177, 0.9944, 0.6639, 0.1997}, {193, 0.9811, 0.4810, 0.1233},
    {204, 0.9408, 0.3557, 0.0703}, {214, 0.8869, 0.2615, 0.0375}, {226, 0.7997, 0.1706, 0.0152}, {238, 0.6860, 0.0954, 0.0048},
    {250, 0.5458, 0.0359, 0.0064}, {255, 0.4796, 0.0158, 0.0106}};

ColorPoints decoded(std::span<const Entry> entries) {
  ColorPoints points;
  for (const Entry& e : entries) points.push_back({e.index / 255.0, linear_from_srgb(Vec3d(e.r, e.g, e.b))});
  return points;
}

/// Of 256 colours that a function of the share gives in sRGB.
template <class Color>
ColorPoints reduced(Color&& color) {
  ColorPoints dense;
  for (int i = 0; i < 256; ++i) dense.push_back({i / 255.0, linear_from_srgb(color(i / 255.0))});
  return fewest_points(dense, kColorBound);
}

ColorPoints cool_warm() {
  const Vec3d blue = Vec3d(59, 76, 192) / 255.0, red = Vec3d(180, 4, 38) / 255.0;
  return reduced([&](double share) { return diverging_color(blue, red, share); });
}

ColorPoints gray() {
  return reduced([](double share) { return Vec3d(share); });
}

struct NamedMap {
  std::string_view name;
  ColorPoints (*points)();
};
constexpr NamedMap kMaps[] = {{"viridis", [] { return decoded(kViridis); }},
                              {"inferno", [] { return decoded(kInferno); }},
                              {"magma", [] { return decoded(kMagma); }},
                              {"plasma", [] { return decoded(kPlasma); }},
                              {"turbo", [] { return decoded(kTurbo); }},
                              {"cool_warm", cool_warm},
                              {"gray", gray}};

}  // namespace

const std::vector<std::string_view>& color_map_names() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const NamedMap& map : kMaps) list.push_back(map.name);
    return list;
  }();
  return names;
}

ColorPoints color_map(std::string_view name) {
  for (const NamedMap& map : kMaps)
    if (map.name == name) return map.points();
  throw UsageError(fmt::format("no colour map {}; accepted: {}", quote(name), fmt::join(color_map_names(), ", ")));
}

double srgb_from_linear(double linear) {
  if (!(linear > 0)) return 0;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double linear_from_srgb(double srgb) { return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4); }

Vec3d srgb_from_linear(const Vec3d& c) { return {srgb_from_linear(c.x), srgb_from_linear(c.y), srgb_from_linear(c.z)}; }
Vec3d linear_from_srgb(const Vec3d& c) { return {linear_from_srgb(c.x), linear_from_srgb(c.y), linear_from_srgb(c.z)}; }

double lightness(const Vec3d& linear) { return lab_from_linear(linear).x; }

Vec3d diverging_color(const Vec3d& first, const Vec3d& last, double share) {
  Msh a = msh_from_srgb(first);
  Msh b = msh_from_srgb(last);
  const auto hues_apart = [&] {
    const double d = std::fmod(std::abs(a.h - b.h), 2 * kPi);
    return std::min(d, 2 * kPi - d);
  };
  if (a.s > 0.05 && b.s > 0.05 && hues_apart() > kPi / 3) {  // two colours far apart meet in white
    const double middle = std::max({a.m, b.m, 88.0});
    if (share < 0.5) {
      b = {middle, 0, 0};
      share = 2 * share;
    } else {
      a = {middle, 0, 0};
      share = 2 * share - 1;
    }
  }
  if (a.s < 0.05 && b.s > 0.05) a.h = adjusted_hue(b, a.m);
  if (b.s < 0.05 && a.s > 0.05) b.h = adjusted_hue(a, b.m);
  const auto mix = [share](double from, double to) { return (1 - share) * from + share * to; };
  return srgb_from_msh({mix(a.m, b.m), mix(a.s, b.s), mix(a.h, b.h)});
}

ColorPoints fewest_points(const ColorPoints& dense, double bound) {
  if (dense.size() < 3) return dense;
  constexpr std::size_t kBlock = 512;
  ColorPoints points{dense.front()};
  for (std::size_t first = 0; first + 1 < dense.size(); first += kBlock) {
    const std::size_t last = std::min(first + kBlock, dense.size() - 1);
    const ColorPoints block(dense.begin() + static_cast<std::ptrdiff_t>(first),
                            dense.begin() + static_cast<std::ptrdiff_t>(last) + 1);
    const ColorPoints some = fewest_of_block(block, bound);
    points.insert(points.end(), some.begin() + 1, some.end());
  }
  return points;
}

ColorPoints stretch(const ColorPoints& map, double lower, double upper, bool logarithmic) {
  ColorPoints points;
  for (const auto& p : map) {
    const double w = p.value;
    double value = logarithmic ? std::exp((1 - w) * std::log(lower) + w * std::log(upper)) : (1 - w) * lower + w * upper;
    if (w == 0) value = lower;
    if (w == 1) value = upper;
    if (points.empty() || value > points.back().value) points.push_back({value, p.rgb});
  }
  return points;
}

}  // namespace amrtex
