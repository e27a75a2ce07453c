#include "renderers/scene/scene_settings.hpp"

#include <fmt/format.h>

#include "renderers/scene/scene_rows.hpp"

namespace amrtex {
namespace {

/// In the order of columns in tables and of the documentation; isovalues before what is given one a value.
SettingTable<Scene> make_scene_settings() {
  using namespace scene_rows;
  Rows rows;
  for (Rows (*part)() : {consumer_rows, sampling_rows, picture_rows, surface_rows, surface_color_rows, surface_light_rows,
                         light_rows, structure_rows, geometry_rows, triangle_rows, top_rows})
    for (Setting<Scene>& row : part()) rows.push_back(std::move(row));
  return {"render", std::move(rows)};
}

/// What both the name of a record and that of a reference hold; `part` picks the keys of a table.
template <class Part>
Json scene_json(const Scene& scene, const SettingTable<Scene>& settings, Part part) {
  Json json = part(settings, scene);
  json["view"] = part(view_settings(), scene.view);
  if (scene.settings.draws_volume() || scene.settings.draws_surfaces())
    json["transfer_function"] = part(transfer_function_settings(), scene.transfer_function);
  return json;
}

}  // namespace

const SettingTable<Scene>& scene_settings() {
  static const SettingTable<Scene> settings = make_scene_settings();
  return settings;
}

const SettingTable<View>& view_settings() {
  static const SettingTable<View> settings = scene_rows::view_table();
  return settings;
}

const SettingTable<TransferFunction>& transfer_function_settings() {
  static const SettingTable<TransferFunction> settings = scene_rows::transfer_function_table();
  return settings;
}

bool is_top_level(const Key& key) { return key.name == "transfer_functions" || key.name == "region"; }

void validate(const Scene& scene) {
  if (const auto found = scene_settings().complaint(scene)) throw_problem("", found->key->name, found->problem);
}

void validate_setting(const Scene& scene, std::string_view key) {
  if (const auto found = scene_settings().complaint(*scene_settings().find(key), scene))
    throw_problem("", found->key->name, found->problem);
}

void require_consumer(const Scene& scene) {
  const auto found = scene_settings().unsupported(scene);
  if (!found) return;
  const std::string key = found->key->name == "consumer" ? "" : fmt::format("'{}' is not available: ", found->key->name);
  throw UnsupportedError(fmt::format("consumer {}: {}{}", consumer_name(scene.settings.consumer), key, found->problem.text));
}

Json scene_record(const Scene& scene) {
  Json json = scene_settings().record(scene);
  json["view"] = to_json(scene.view);
  return json;
}

Json scene_configuration(const Scene& scene, const SettingTable<Scene>& settings) {
  return scene_json(scene, settings, [](const auto& table, const auto& part) { return table.configuration(part); });
}

Json scene_reference(const Scene& scene, const SettingTable<Scene>& settings) {
  return scene_json(scene, settings, [](const auto& table, const auto& part) { return table.reference(part); });
}

View parse_view(const Json& json) { return view_settings().parse(json, "view"); }

TransferFunction parse_transfer_function(const Json& json) {
  TransferFunction tf = transfer_function_settings().parse(json, "transfer_function");
  validate(tf);
  return tf;
}

Json to_json(const View& view) { return view_settings().record(view); }

Json to_json(const TransferFunction& tf) { return transfer_function_settings().record(tf); }

Json to_json(const std::vector<FieldTransfer>& more_fields) {
  Json json = Json::array();
  for (const FieldTransfer& f : more_fields) {
    json.push_back({{"field", f.field}});
    json.back().update(to_json(f.transfer_function));
  }
  return json;
}

}  // namespace amrtex
