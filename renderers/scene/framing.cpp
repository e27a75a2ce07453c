#include "renderers/scene/framing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kMargin = 0.06;     ///< of half the picture, at each side
constexpr double kFieldOfView = 30;  ///< degrees; a longer lens than a scene's default, so that boxes do not look distorted

struct Framing {
  std::string_view name;
  Vec3d toward_eye;
  Vec3d up;
};

constexpr Framing kFramings[] = {{"corner", {0.62, -1.0, 0.55}, {0, 0, 1}},
                                 {"+x", {1, 0, 0}, {0, 0, 1}},
                                 {"-x", {-1, 0, 0}, {0, 0, 1}},
                                 {"+y", {0, 1, 0}, {0, 0, 1}},
                                 {"-y", {0, -1, 0}, {0, 0, 1}},
                                 {"+z", {0, 0, 1}, {0, 1, 0}},
                                 {"-z", {0, 0, -1}, {0, 1, 0}}};

/// A slab is looked at from its flat side: the direction gets as much of the thin axis as shows the others.
Vec3d corner_direction(const Vec3d& toward_eye, const Vec3d& size) {
  constexpr double kSlab = 0.1;
  std::array<double, 3> sorted{size.x, size.y, size.z};
  std::sort(sorted.begin(), sorted.end());
  if (!(sorted[0] < kSlab * sorted[1])) return toward_eye;
  Vec3d direction = toward_eye;
  for (int axis = 0; axis < 3; ++axis)
    if (size[axis] == sorted[0]) direction[axis] = std::copysign(2.2, direction[axis]);
  return direction;
}

/// How far the eye must be for the corners to lie within `slope` of the axis, and where that axis passes.
struct Fit {
  double distance, shift;
};
Fit fit(const std::array<Vec3d, 8>& corners, int across, double slope) {
  double above = -std::numeric_limits<double>::infinity(), below = above;
  for (const Vec3d& c : corners) {  // c.z: toward the eye
    above = std::max(above, c[across] + slope * c.z);
    below = std::max(below, -c[across] + slope * c.z);
  }
  return {(above + below) / (2 * slope), (above - below) / 2};
}

double number_of(const std::string& word, const std::string& line) {
  std::istringstream in(word);
  double value = 0;
  if (!(in >> value) || !in.eof() || !std::isfinite(value))
    throw UsageError(fmt::format("--camera {}: {} is no number; accepted: ex ey ez ax ay az ux uy uz, and -fovy degrees",
                                 clipped(line), quote(word)));
  return value;
}

}  // namespace

const std::vector<std::string_view>& framing_names() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> list;
    for (const Framing& f : kFramings) list.push_back(f.name);
    return list;
  }();
  return names;
}

View framing_view(const Vec3d& lower, const Vec3d& upper, std::string_view name, double aspect) {
  const auto* framing =
      std::find_if(std::begin(kFramings), std::end(kFramings), [&](const Framing& f) { return f.name == name; });
  if (framing == std::end(kFramings))
    throw UsageError(fmt::format("no view {}; accepted: {}", quote(name), fmt::join(framing_names(), ", ")));
  const Vec3d size = upper - lower;
  const double unit = std::max({size.x, size.y, size.z});  // so that squares of any world's lengths are doubles
  const Vec3d toward_eye = glm::normalize(name == "corner" ? corner_direction(framing->toward_eye, size) : framing->toward_eye);
  const Vec3d right = glm::normalize(glm::cross(framing->up, toward_eye));
  const Vec3d up = glm::cross(toward_eye, right);
  std::array<Vec3d, 8> corners;
  for (int i = 0; i < 8; ++i) {
    const Vec3d c = Vec3d(i & 1, (i >> 1) & 1, (i >> 2) & 1) - 0.5;
    const Vec3d from_middle = c * size / unit;
    corners[static_cast<std::size_t>(i)] = {glm::dot(from_middle, right), glm::dot(from_middle, up),
                                            glm::dot(from_middle, toward_eye)};
  }
  const double slope = std::tan(kFieldOfView * 3.14159265358979323846 / 360) * (1 - kMargin);
  const Fit horizontal = fit(corners, 0, slope * aspect), vertical = fit(corners, 1, slope);
  View view;
  view.fov_y = kFieldOfView;
  view.up = framing->up;
  view.at = (lower + upper) * 0.5 + (right * horizontal.shift + up * vertical.shift) * unit;
  view.eye = view.at + toward_eye * (std::max(horizontal.distance, vertical.distance) * unit);
  return view;
}

std::vector<std::array<double, 4>> box_edges(const Vec3d& lower, const Vec3d& upper, const View& view, int width, int height) {
  const CameraFrame camera = camera_frame(view, width, height);
  struct Corner {
    double x, y;
    bool seen;
  };
  std::array<Corner, 8> corners;
  for (std::size_t i = 0; i < 8; ++i) {
    const Vec3d corner((i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z);
    const Vec3d way = corner - camera.eye;
    const double ahead = glm::dot(way, camera.forward);
    const double scale = camera.orthographic ? 1 : ahead;
    const double u = glm::dot(way, camera.right) / glm::dot(camera.right, camera.right) / scale;
    const double v = glm::dot(way, camera.up) / glm::dot(camera.up, camera.up) / scale;
    corners[i] = {(u + 1) / 2 * width, (1 - v) / 2 * height, camera.orthographic || ahead > 0};
  }
  std::vector<std::array<double, 4>> edges;
  for (std::size_t i = 0; i < 8; ++i)
    for (const std::size_t bit : {1, 2, 4}) {
      const Corner &a = corners[i], &b = corners[i | bit];
      if ((i & bit) == 0 && a.seen && b.seen) edges.push_back({a.x, a.y, b.x, b.y});
    }
  return edges;
}

bool meets_box(const WorldRay& ray, const Vec3d& lower, const Vec3d& upper) {
  double from = 0, to = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = ray.origin[axis], direction = ray.direction[axis];
    if (direction == 0 && (origin < lower[axis] || origin > upper[axis])) return false;
    if (direction == 0) continue;
    const double a = (lower[axis] - origin) / direction, b = (upper[axis] - origin) / direction;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from < to;
}

View parse_camera_line(const std::vector<std::string>& words) {
  const std::string line = fmt::format("{}", fmt::join(words, " "));
  std::vector<double> numbers;
  std::optional<double> fov;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool names_fov = words[i] == "-fovy" || words[i] == "--fovy" || words[i] == "-fov" || words[i] == "--fov";
    if (words[i] == "--camera") continue;
    if (names_fov && i + 1 < words.size())
      fov = number_of(words[++i], line);
    else
      numbers.push_back(number_of(words[i], line));
  }
  if (numbers.size() != 9)
    throw UsageError(
        fmt::format("--camera {}: {} numbers; accepted: ex ey ez ax ay az ux uy uz (eye, a point it looks at, up), and "
                    "-fovy degrees",
                    clipped(line), numbers.size()));
  View view;
  view.eye = {numbers[0], numbers[1], numbers[2]};
  view.at = {numbers[3], numbers[4], numbers[5]};
  view.up = {numbers[6], numbers[7], numbers[8]};
  if (fov) view.fov_y = *fov;
  try {
    camera_frame(view, 1, 1);
  } catch (const Error& e) {
    throw UsageError(fmt::format("--camera {}: {}", clipped(line), e.what()));
  }
  return view;
}

View parse_camera_line(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return parse_camera_line(words);
}

std::string camera_line(const View& view) {
  const auto text = [](const Vec3d& v) { return fmt::format("{} {} {}", v.x, v.y, v.z); };
  return fmt::format("--camera {} {} {} -fovy {}", text(view.eye), text(view.at), text(view.up), view.fov_y);
}

}  // namespace amrtex
