#include "renderers/scene/transfer_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <pugixml.hpp>

#include "renderers/scene/import_formats.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace import_formats {

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

}  // namespace import_formats

namespace {

using import_formats::Source;

constexpr const char* kFormats =
    "accepted: a colour map of ParaView (JSON, XML), .xf of the ExaBricks family, .ct of VisIt, a list of Gaussians (JSON)";

std::string bytes_of(const Source& source) {
  constexpr std::uintmax_t kMost = 64 << 20;
  std::error_code failure;
  const auto size = std::filesystem::is_regular_file(source.file, failure) ? std::filesystem::file_size(source.file, failure) : 0;
  if (const std::string reason = why_absent(source.file); !reason.empty())
    source.fail(fmt::format("{}; accepted: the name of a colour map, or a file", reason));
  if (size > kMost) source.fail(fmt::format("{} bytes; no colour map is that large", size));
  std::ifstream in(source.file, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  if (!in && bytes.empty()) source.fail("cannot be read");
  return bytes;
}

ImportedTransfer read_xml(const std::string& bytes, const Source& source) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(bytes.data(), bytes.size());
  if (!result) source.fail(fmt::format("no XML: {} at byte {}", result.description(), result.offset));
  const std::string root = document.document_element().name();
  if (root == "ColorMaps" || root == "ColorMap") return import_formats::read_paraview_xml(document, source);
  if (root == "Object") return import_formats::read_visit(document, source);
  source.fail(fmt::format("XML of the element {}; {}", quote(root), kFormats));
}

ImportedTransfer read_json(const std::string& bytes, const Source& source) {
  const Json json = Json::parse(bytes, nullptr, false);
  if (json.is_discarded()) source.fail(fmt::format("no JSON; {}", kFormats));
  if (json.is_object() && json.contains("gaussians")) return import_formats::read_gaussians(json, source);
  return import_formats::read_paraview_json(json, source);
}

ImportedTransfer read_any(const Source& source) {
  const std::string bytes = bytes_of(source);
  constexpr std::size_t kAlphas = 512;
  const bool text = bytes.find('\0') == std::string::npos;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (text && first != std::string::npos && bytes[first] == '<') return read_xml(bytes, source);
  if (text && first != std::string::npos && (bytes[first] == '{' || bytes[first] == '[')) return read_json(bytes, source);
  if (bytes.size() == kAlphas || !text) return import_formats::read_xf(bytes, source);
  source.fail(kFormats);
}

/// Extinction over 1 of an opacity.
double depth_of(double opacity) { return -std::log1p(-std::min(opacity, 1 - 0x1p-24)); }

/// Does a straight line follow depth_of between two opacities?
bool straight(double from, double to) {
  constexpr int kPlaces = 15;
  constexpr double kSafe = 0.95;  // of the bound: the places lie beside the largest difference
  for (int i = 1; i <= kPlaces; ++i) {
    const double w = static_cast<double>(i) / (kPlaces + 1);
    const double exact = depth_of(from + w * (to - from));
    const double line = (1 - w) * depth_of(from) + w * depth_of(to);
    if (std::abs(line - exact) > kSafe * std::max(kExtinctionShare * exact, kExtinctionDepth)) return false;
  }
  return true;
}

template <class Points>
Points over_unit(const Points& points, const std::array<double, 2>& range, bool logarithmic) {
  Points unit = points;
  const auto axis = [&](double v) { return logarithmic ? std::log10(v) : v / 2; };
  const double first = axis(range[0]), span = axis(range[1]) - first;
  for (auto& p : unit) p.value = span > 0 ? std::clamp((axis(p.value) - first) / span, 0.0, 1.0) : 0.5;
  return unit;
}

}  // namespace

std::array<double, 2> ImportedTransfer::range() const {
  std::array<double, 2> range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto take = [&](const auto& points) {
    if (points.empty()) return;
    range[0] = std::min(range[0], points.front().value);
    range[1] = std::max(range[1], points.back().value);
  };
  take(colors);
  take(opacity);
  return range;
}

ColorPoints ImportedTransfer::unit_colors() const { return over_unit(colors, range(), logarithmic); }
std::vector<OpacityPoint> ImportedTransfer::unit_opacity() const { return over_unit(opacity, range(), logarithmic); }

ImportedTransfer import_transfer(const std::string& file) {
  const std::size_t mark = file.rfind('#');
  const bool named = mark != std::string::npos && !std::filesystem::exists(file);
  const Source source{named ? file.substr(0, mark) : file, named ? file.substr(mark + 1) : ""};
  ImportedTransfer imported = read_any(source);
  const auto [first, last] = imported.range();
  if (!(first < last)) source.fail(fmt::format("all of it lies at the value {}; accepted: a range", first));
  if (imported.logarithmic && !(first > 0))
    source.fail(fmt::format("a logarithmic axis from {}; accepted: values above 0", first));
  return imported;
}

std::vector<TransferFunction::ExtinctionPoint> extinction_of(const std::vector<OpacityPoint>& opacity, double length) {
  std::vector<TransferFunction::ExtinctionPoint> points;
  const auto add = [&](double value, double a) {
    if (points.empty() || value > points.back().value) points.push_back({value, depth_of(a) / length});
  };
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    if (i == 0) add(opacity[0].value, opacity[0].opacity);
    if (i == 0) continue;
    const auto [v0, a0] = opacity[i - 1];
    const auto [v1, a1] = opacity[i];
    double done = 0;
    while (done < 1) {
      const auto at = [a = a0, b = a1](double w) { return a + w * (b - a); };
      double good = done, bad = 1;
      if (straight(at(done), a1)) good = 1;
      while (good < 1 && bad - good > 1e-12) {
        const double middle = (good + bad) / 2;
        (straight(at(done), at(middle)) ? good : bad) = middle;
      }
      done = good > done ? good : 1;
      add(done == 1 ? v1 : v0 + done * (v1 - v0), done == 1 ? a1 : at(done));
    }
  }
  return points;
}

}  // namespace amrtex
