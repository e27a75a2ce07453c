// Colour maps as ParaView exports them: JSON, and the XML of older versions and of collections on the web.
#include <fmt/format.h>

#include <cmath>
#include <pugixml.hpp>

#include "renderers/scene/import_formats.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex::import_formats {
namespace {

std::vector<double> numbers(const Json& json, const char* key, std::size_t group, const Source& source) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array() || found->empty() || found->size() % group != 0)
    source.fail(fmt::format("'{}' is no list of {} numbers a point", key, group));
  std::vector<double> list;
  for (const Json& number : *found) {
    if (!number.is_number()) source.fail(fmt::format("'{}': {} is no number", key, shown(number)));
    list.push_back(number.get<double>());
  }
  return list;
}

/// Presets are kept from 0 to 1 or from -1 to 1 and laid over the data's range.
bool preset_range(const ImportedTransfer& transfer) {
  const auto [first, last] = transfer.range();
  return last == 1 && (first == 0 || first == -1);
}

/// What ParaView makes of a midpoint and a sharpness between two opacities (vtkPiecewiseFunction).
double shaped(double a, double b, double w, double midpoint, double sharpness) {
  double s = w < midpoint ? 0.5 * w / midpoint : 0.5 + 0.5 * (w - midpoint) / (1 - midpoint);
  if (sharpness > 0.99) return s < 0.5 ? a : b;
  if (sharpness < 0.01) return (1 - s) * a + s * b;
  const double power = 1 + 10 * sharpness;
  if (s < 0.5)
    s = 0.5 * std::pow(2 * s, power);
  else if (s > 0.5)
    s = 1 - 0.5 * std::pow(2 * (1 - s), power);
  const double ss = s * s, sss = ss * s;
  const double slope = (1 - sharpness) * (b - a);
  const double y = (2 * sss - 3 * ss + 1) * a + (3 * ss - 2 * sss) * b + (sss - 2 * ss + s) * slope + (sss - ss) * slope;
  return std::clamp(y, std::min(a, b), std::max(a, b));
}

std::vector<OpacityPoint> opacity_of(const std::vector<double>& points, const Source& source) {
  constexpr int kParts = 64;
  constexpr double kBound = 1.0 / 1024;
  std::vector<OpacityPoint> list;
  bool curved = false;
  for (std::size_t i = 0; i < points.size(); i += 4) {
    if (i > 0) {
      const double midpoint = std::clamp(points[i - 2], 1e-5, 1 - 1e-5), sharpness = std::clamp(points[i - 1], 0.0, 1.0);
      const bool straight = midpoint == 0.5 && sharpness < 0.01;
      curved = curved || !straight;
      for (int part = 1; !straight && part < kParts; ++part) {
        const double w = static_cast<double>(part) / kParts;
        list.push_back({(1 - w) * points[i - 4] + w * points[i], shaped(points[i - 3], points[i + 1], w, midpoint, sharpness)});
      }
    }
    list.push_back({points[i], points[i + 1]});
  }
  return checked_opacity(std::move(list), curved ? kBound : 1e-9, source);
}

const Json& chosen_map(const Json& json, const Source& source) {
  const Json& list = json.is_object() && json.contains("ColorMaps") ? json["ColorMaps"] : json;
  if (list.is_object()) return list;
  std::vector<std::string> names;
  if (list.is_array())
    for (const Json& map : list) {
      if (!map.is_object() || !map.contains("RGBPoints")) continue;
      const std::string name = map.contains("Name") && map["Name"].is_string() ? map["Name"].get<std::string>() : "";
      if (source.wanted.empty() || name == source.wanted) return map;
      names.push_back(name);
    }
  if (names.empty()) source.fail("no colour map with 'RGBPoints', as ParaView exports them, and no 'gaussians'");
  source.fail(fmt::format("no map {}; accepted: {}", quote(source.wanted), listed(names)));
}

}  // namespace

ImportedTransfer read_paraview_json(const Json& json, const Source& source) {
  const Json& map = chosen_map(json, source);
  const std::vector<double> rgb = numbers(map, "RGBPoints", 4, source);
  std::vector<Node> nodes;
  for (std::size_t i = 0; i < rgb.size(); i += 4) nodes.push_back({rgb[i], {rgb[i + 1], rgb[i + 2], rgb[i + 3]}});
  const Json space = map.value("ColorSpace", Json("RGB"));
  ImportedTransfer transfer;
  transfer.colors = joined(nodes, parse_space(space.is_string() ? space.get<std::string>() : space.dump(), source), source);
  if (map.contains("Points") && !map["Points"].is_null())
    transfer.opacity = opacity_of(numbers(map, "Points", 4, source), source);
  transfer.relative = preset_range(transfer);
  return transfer;
}

ImportedTransfer read_paraview_xml(const pugi::xml_document& document, const Source& source) {
  pugi::xml_node map = document.child("ColorMap");
  if (!map)
    for (map = document.child("ColorMaps").child("ColorMap"); map && !source.wanted.empty(); map = map.next_sibling("ColorMap"))
      if (source.wanted == map.attribute("name").value()) break;
  if (!map) source.fail(fmt::format("no ColorMap {}", quote(source.wanted)));
  std::vector<Node> nodes;
  std::vector<OpacityPoint> opacity;
  bool transparent = false;
  for (const pugi::xml_node point : map.children("Point")) {
    const auto number = [&](const char* key) { return point.attribute(key).as_double(std::nan("")); };
    const double x = number("x");
    nodes.push_back({x, {number("r"), number("g"), number("b")}});
    const double o = point.attribute("o").as_double(1);
    transparent = transparent || o != 1;
    opacity.push_back({x, o});
  }
  const pugi::xml_attribute space = map.attribute("space");
  ImportedTransfer transfer;
  transfer.colors = joined(nodes, parse_space(space ? space.value() : "RGB", source), source);
  if (transparent) transfer.opacity = checked_opacity(std::move(opacity), 1e-9, source);
  transfer.relative = preset_range(transfer);
  return transfer;
}

}  // namespace amrtex::import_formats
