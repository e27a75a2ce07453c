#include "renderers/scene/import_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex::import_formats {

void Source::fail(std::string_view problem) const { throw UsageError(fmt::format("{}: {}", clipped(file, 200), problem)); }

Space parse_space(const std::string& name, const Source& source) {
  if (name == "RGB") return Space::rgb;
  if (name == "HSV") return Space::hsv;
  if (name == "Lab" || name == "CIELAB" || name == "Lab/CIEDE2000") return Space::lab;
  if (name == "Diverging") return Space::diverging;
  source.fail(fmt::format("the colour space {}; accepted: RGB, HSV, Lab, Diverging", quote(name)));
}

namespace {

Vec3d hsv_from_rgb(const Vec3d& c) {
  const double most = std::max({c.x, c.y, c.z}), span = most - std::min({c.x, c.y, c.z});
  if (!(span > 0)) return {0, 0, most};
  double hue = most == c.x ? (c.y - c.z) / span : most == c.y ? 2 + (c.z - c.x) / span : 4 + (c.x - c.y) / span;
  if (hue < 0) hue += 6;
  return {hue / 6, span / most, most};
}

Vec3d rgb_from_hsv(const Vec3d& c) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + 6 * c.x, 6.0);
    return c.z - c.z * c.y * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  return {channel(5), channel(3), channel(1)};
}

/// sRGB between two colours.
Vec3d between(const Vec3d& a, const Vec3d& b, double w, Space space) {
  switch (space) {
    case Space::rgb:
      return a + w * (b - a);
    case Space::diverging:
      return diverging_color(a, b, w);
    case Space::lab: {
      const Vec3d p = lab_from_linear(linear_from_srgb(a)), q = lab_from_linear(linear_from_srgb(b));
      return srgb_from_linear(linear_from_lab(p + w * (q - p)));
    }
    case Space::hsv:
      break;
  }
  Vec3d p = hsv_from_rgb(a), q = hsv_from_rgb(b);
  if (q.x - p.x > 0.5) p.x += 1;  // the shorter way around
  if (p.x - q.x > 0.5) q.x += 1;
  const Vec3d mixed = p + w * (q - p);
  return rgb_from_hsv({std::fmod(mixed.x, 1.0), mixed.y, mixed.z});
}

/// Values that ascend: one equal to that before it is moved a little.
template <class Point>
void make_ascending(std::vector<Point>& points, const char* what, const Source& source) {
  const double span = points.back().value - points.front().value;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!std::isfinite(points[i].value)) source.fail(fmt::format("{} {}: its value is not finite", what, i));
    if (i == 0 || points[i].value > points[i - 1].value) continue;
    if (!(span > 0) || points[i].value < points[i - 1].value - 1e-6 * span)
      source.fail(fmt::format("{} {}: the value {} does not lie above the one before, {}", what, i, points[i].value,
                              points[i - 1].value));
    points[i].value = points[i - 1].value + 1e-9 * std::max(span, std::abs(points[i - 1].value));
  }
}

}  // namespace

ColorPoints joined(std::vector<Node> nodes, Space space, const Source& source) {
  constexpr std::size_t kMostNodes = 65536;
  if (nodes.empty()) source.fail("no colours; accepted: at least one");
  if (nodes.size() > kMostNodes) source.fail(fmt::format("{} colours; accepted: at most {}", nodes.size(), kMostNodes));
  make_ascending(nodes, "colour", source);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (int c = 0; c < 3; ++c)
      if (!(nodes[i].srgb[c] >= 0 && nodes[i].srgb[c] <= 1))
        source.fail(fmt::format("colour {}: {}; accepted: 0 to 1", i, nodes[i].srgb[c]));
  ColorPoints dense{{nodes.front().value, linear_from_srgb(nodes.front().srgb)}};
  const std::size_t parts = std::clamp<std::size_t>(256 / nodes.size(), 1, 128);
  for (std::size_t i = 1; i < nodes.size(); ++i)
    for (std::size_t part = 1; part <= parts; ++part) {
      const double w = static_cast<double>(part) / static_cast<double>(parts);
      const double value = part == parts ? nodes[i].value : (1 - w) * nodes[i - 1].value + w * nodes[i].value;
      const Vec3d srgb = part == parts ? nodes[i].srgb : between(nodes[i - 1].srgb, nodes[i].srgb, w, space);
      if (value > dense.back().value) dense.push_back({value, linear_from_srgb(glm::clamp(srgb, Vec3d(0), Vec3d(1)))});
    }
  return fewest_points(dense, kColorBound);
}

std::vector<OpacityPoint> checked_opacity(std::vector<OpacityPoint> points, double bound, const Source& source) {
  if (points.empty()) return points;
  make_ascending(points, "opacity point", source);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!(points[i].opacity >= 0 && points[i].opacity <= 1))
      source.fail(fmt::format("opacity point {}: {}; accepted: 0 to 1", i, points[i].opacity));
  const auto fits = [&](std::size_t i, std::size_t j) {
    for (std::size_t k = i + 1; k < j; ++k) {
      const double w = (points[k].value - points[i].value) / (points[j].value - points[i].value);
      if (std::abs(points[i].opacity + w * (points[j].opacity - points[i].opacity) - points[k].opacity) > bound) return false;
    }
    return true;
  };
  constexpr std::size_t kLongest = 256;  // points left out in a row: the search takes the square of it
  std::vector<OpacityPoint> few{points.front()};
  for (std::size_t i = 0; i + 1 < points.size();) {
    std::size_t j = i + 1;
    while (j + 1 < points.size() && j - i < kLongest && fits(i, j + 1)) ++j;
    few.push_back(points[j]);
    i = j;
  }
  return few;
}

}  // namespace amrtex::import_formats
