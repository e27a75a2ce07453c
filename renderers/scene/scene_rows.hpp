// The rows of scene_settings(), by topic, and what they share. For the sources of the table alone.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "renderers/scene/scene.hpp"
#include "renderers/scene/setting.hpp"

namespace amrtex::scene_rows {

using Rows = std::vector<Setting<Scene>>;

Rows consumer_rows();
Rows sampling_rows();
Rows picture_rows();
Rows surface_rows();
Rows surface_color_rows();
Rows surface_light_rows();
Rows light_rows();
Rows structure_rows();
Rows geometry_rows();
Rows triangle_rows();
/// Not of `render`: they stand at the top level.
Rows top_rows();

SettingTable<View> view_table();
SettingTable<TransferFunction> transfer_function_table();

// --- values ---

inline Json list(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }
inline Vec3d vector(const Json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

template <class T>
std::optional<T> optional_of(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional<T>(json.get<T>());
}

/// The elements of a list, or one element alone.
inline std::vector<Json> elements(const Json& json) {
  if (json.is_null()) return {};
  return json.is_array() ? std::vector<Json>(json.begin(), json.end()) : std::vector<Json>{json};
}

inline std::vector<double> numbers(const Json& json) {
  std::vector<double> numbers;
  for (const Json& n : elements(json)) numbers.push_back(n.get<double>());
  return numbers;
}

inline Json list_of_points(const std::vector<TransferFunction::ColorPoint>& points) {
  Json json = Json::array();
  for (const auto& p : points) json.push_back(Json::array({p.value, p.rgb.r, p.rgb.g, p.rgb.b}));
  return json;
}

inline std::vector<TransferFunction::ColorPoint> color_points(const Json& json) {
  std::vector<TransferFunction::ColorPoint> points;
  for (const Json& p : elements(json))
    points.push_back({p[0].get<double>(), {p[1].get<double>(), p[2].get<double>(), p[3].get<double>()}});
  return points;
}

inline ValueType vector_type() { return list_of(number_type(), 3, "three numbers [x, y, z]"); }
inline ValueType color_type() { return lists_of(number_type(), 4, "points [value, r, g, b]"); }

// --- what keys go with ---

inline Condition only_with(std::string key, std::vector<Json> accepted, std::string why) {
  return {std::move(key), std::move(accepted), Otherwise::refused, std::move(why)};
}
/// The other key must be off: null, false, or an empty list.
inline Condition not_with(std::string key, Json off, std::string why) {
  return {std::move(key), {std::move(off)}, Otherwise::refused, std::move(why)};
}
inline Condition means_nothing_unless(std::string key, std::vector<Json> accepted) {
  return {std::move(key), std::move(accepted), Otherwise::idle};
}
inline Condition drawn_by(std::vector<Json> consumers, std::string why) {
  return {"consumer", std::move(consumers), Otherwise::unsupported, std::move(why)};
}
inline Condition of_surfaces() { return means_nothing_unless("mode", {"iso", "dvr_iso"}); }

}  // namespace amrtex::scene_rows
