#include "bench/settings/orbit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr std::array<std::string_view, 5> kKeys = {"at", "radius", "count", "axis", "elevation"};
constexpr int kMostViews = 10000;

struct Orbit {
  Vec3d at{0};
  double radius = 0;             ///< world
  int count = 0;                 ///< views
  Vec3d axis{0, 0, 1};           ///< unit length
  double elevation[2] = {0, 0};  ///< of the first and the last view over the plane across the axis, degrees
};

/// The place of the key stands in quotes, by which the parser of the file finds its line.
[[noreturn]] void refuse(std::string_view key, const Json& value, std::string_view accepted) {
  throw UsageError(fmt::format("'orbit': {} {}; accepted: {}", key, value.is_null() ? "is missing" : value.dump(), accepted));
}

Json value_of(const Json& orbit, const char* key) { return orbit.contains(key) ? orbit.at(key) : Json(); }

Vec3d vector_of(const Json& value, std::string_view key, std::string_view accepted) {
  const bool three = value.is_array() && value.size() == 3;
  if (!three || !std::all_of(value.begin(), value.end(), [](const Json& v) { return v.is_number(); }))
    refuse(key, value, accepted);
  return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
}

void read_elevation(const Json& value, Orbit& orbit) {
  const auto right = [](const Json& v) { return v.is_number() && std::abs(v.get<double>()) < 90; };
  if (right(value)) {
    orbit.elevation[0] = orbit.elevation[1] = value.get<double>();
    return;
  }
  if (!value.is_array() || value.size() != 2 || !right(value[0]) || !right(value[1]))
    refuse("elevation", value, "degrees between -90 and 90, or two of them [first, last]");
  for (std::size_t i = 0; i < 2; ++i) orbit.elevation[i] = value[i].get<double>();
}

Orbit read_orbit(const Json& json) {
  if (!json.is_object())
    throw UsageError(fmt::format("'orbit': {}; accepted: an object with {}", json.dump(), fmt::join(kKeys, ", ")));
  for (const auto& [key, value] : json.items())
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
      throw UsageError(fmt::format("'orbit': no key {}; accepted: {}", key, fmt::join(kKeys, ", ")));
  Orbit orbit;
  orbit.at = vector_of(value_of(json, "at"), "at", "three numbers [x, y, z]");
  const Json radius = value_of(json, "radius"), count = value_of(json, "count");
  if (!radius.is_number() || !(radius.get<double>() > 0)) refuse("radius", radius, "a world length above 0");
  orbit.radius = radius.get<double>();
  if (!count.is_number_integer() || count < 1 || count > kMostViews)
    refuse("count", count, fmt::format("an integer from 1 to {}", kMostViews));
  orbit.count = count.get<int>();
  if (json.contains("axis")) {
    orbit.axis = vector_of(json.at("axis"), "axis", "three numbers [x, y, z], not all 0");
    if (!(glm::length(orbit.axis) > 0)) refuse("axis", json.at("axis"), "three numbers [x, y, z], not all 0");
    orbit.axis = glm::normalize(orbit.axis);
  }
  if (json.contains("elevation")) read_elevation(json.at("elevation"), orbit);
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

Json list_of(const Vec3d& v) { return {v.x, v.y, v.z}; }

}  // namespace

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
    one["eye"] = list_of(eye_of(orbit, i));
    one["at"] = list_of(orbit.at);
    one["up"] = list_of(orbit.axis);
    views.emplace_back(std::move(one), fmt::format("{}_{:0{}}", name, i, digits));
  }
  return views;
}

}  // namespace amrtex
