#include "bench/settings/orbit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "structures/mesh/spaces.hpp"

namespace amrtex {
namespace {

constexpr int kMostViews = 10000;

struct Orbit {
  Vec3d at{0};
  double radius = 0;                         ///< world
  int count = 0;                             ///< views
  Vec3d axis{0, 0, 1};                       ///< of any length but 0
  std::array<double, 2> elevation = {0, 0};  ///< of the first and the last view over the plane across the axis, degrees
};

Json list_of_numbers(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }
Vec3d vector(const Json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }

SettingTable<Orbit> make_settings() {
  const ValueType three = list_of(number_type(), 3, "three numbers [x, y, z]");
  ValueType elevation = list_of(number_above(-90, 90), 0, "an angle between -90 and 90, or two of them [first, last]");
  elevation.below = true;
  elevation.most = 2;
  std::vector<Setting<Orbit>> rows;
  rows.push_back(
      {{.name = "at", .type = three, .reference = AffectsReference::yes, .help = "the middle", .unit = "world", .required = true},
       [](const Orbit& o) { return list_of_numbers(o.at); },
       [](Orbit& o, const Json& v) { o.at = vector(v); }});
  rows.push_back({{.name = "radius",
                   .type = number_above(0),
                   .reference = AffectsReference::yes,
                   .help = "distance of all eyes from `at`",
                   .unit = "world length",
                   .required = true},
                  [](const Orbit& o) -> Json { return o.radius; },
                  [](Orbit& o, const Json& v) { o.radius = v.get<double>(); }});
  rows.push_back({{.name = "count",
                   .type = integer_type(1, kMostViews),
                   .reference = AffectsReference::yes,
                   .help = "views, at equal angles around `axis`",
                   .required = true},
                  [](const Orbit& o) -> Json { return o.count; },
                  [](Orbit& o, const Json& v) { o.count = v.get<int>(); }});
  rows.push_back(
      {{.name = "axis", .type = three, .reference = AffectsReference::yes, .help = "not all 0; also `up` of each view"},
       [](const Orbit& o) { return list_of_numbers(o.axis); },
       [](Orbit& o, const Json& v) { o.axis = vector(v); },
       [](const Orbit& o) -> std::string { return o.axis != Vec3d(0) ? "" : "accepted: three numbers [x, y, z], not all 0"; }});
  rows.push_back({{.name = "elevation",
                   .type = elevation,
                   .reference = AffectsReference::yes,
                   .help = "angle over the plane across the axis, of all views, or of the first and the last",
                   .unit = "degrees"},
                  [](const Orbit& o) -> Json { return o.elevation; },
                  [](Orbit& o, const Json& v) {
                    const Json& first = v.is_array() ? v.front() : v;
                    const Json& last = v.is_array() ? v.back() : v;
                    o.elevation = {first.get<double>(), last.get<double>()};
                  }});
  return {"orbit", std::move(rows)};
}

const SettingTable<Orbit>& settings() {
  static const SettingTable<Orbit> settings = make_settings();
  return settings;
}

double largest_component(const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

Orbit read_orbit(const Json& json) {
  Orbit orbit = settings().parse(json, "'orbit'");
  orbit.axis = glm::normalize(orbit.axis / largest_component(orbit.axis));  // scaled first: its square may be no number
  return orbit;
}

/// The coordinate axis that lies most across the orbit's axis, made perpendicular to it: where the orbit begins.
Vec3d first_direction(const Vec3d& axis) {
  int most = 0;
  for (int a = 1; a < 3; ++a)
    if (std::abs(axis[a]) < std::abs(axis[most])) most = a;
  Vec3d across(0);
  across[most] = 1;
  return glm::normalize(across - glm::dot(across, axis) * axis);
}

Vec3d eye_of(const Orbit& orbit, int i) {
  constexpr double kDegree = std::numbers::pi / 180;
  const Vec3d first = first_direction(orbit.axis), second = glm::cross(orbit.axis, first);
  const double way = orbit.count > 1 ? static_cast<double>(i) / (orbit.count - 1) : 0;
  const double elevation = (orbit.elevation[0] + way * (orbit.elevation[1] - orbit.elevation[0])) * kDegree;
  const double around = 2 * std::numbers::pi * i / orbit.count;
  const Vec3d across = std::cos(around) * first + std::sin(around) * second;
  return orbit.at + orbit.radius * (std::cos(elevation) * across + std::sin(elevation) * orbit.axis);
}

}  // namespace

std::vector<const Key*> orbit_keys() { return settings().keys(); }

std::vector<std::pair<Json, std::string>> orbit_views(const Json& view, const std::string& name) {
  if (!view.contains("orbit")) return {{view, name}};
  for (const char* key : {"eye", "at", "up"})
    if (view.contains(key)) throw UsageError(fmt::format("view: '{}' has no place beside 'orbit', which sets it", key));
  const Orbit orbit = read_orbit(view.at("orbit"));
  const auto digits = std::max<std::size_t>(2, std::to_string(orbit.count - 1).size());
  std::vector<std::pair<Json, std::string>> views;
  for (int i = 0; i < orbit.count; ++i) {
    Json one = view;
    one.erase("orbit");
    one["eye"] = list_of_numbers(eye_of(orbit, i));
    one["at"] = list_of_numbers(orbit.at);
    one["up"] = list_of_numbers(orbit.axis);
    views.emplace_back(std::move(one), fmt::format("{}_{:0{}}", name, i, digits));
  }
  return views;
}

}  // namespace amrtex
