// What records say of a point, and what tells it apart from others.
#include <algorithm>

#include "bench/settings/settings_table.hpp"
#include "structures/generators/analytic_fields.hpp"

namespace amrtex {
namespace {

/// Build parameters that are not at their default.
Json given_parameters(const BuildPoint& build) {
  Json given = build.parameters.is_null() ? Json::object() : build.parameters;
  for (const Encoding* encoding : all_encodings())
    if (encoding->name() == build.encoding)
      for (const ParameterInfo& p : encoding->parameters())
        if (given.contains(p.name) && given[p.name] == p.default_value) given.erase(p.name);
  return given;
}

/// Keys that are not at their default, as a file has them.
template <class T>
Json given_keys(const SettingTable<T>& table, const T& settings) {
  Json json = Json::object();
  for (const Setting<T>& row : table.rows()) {
    if (!table.applies(row, settings)) continue;
    Json own = row.get(settings);
    if (own != row.key.default_value || row.key.required)
      json[row.key.name] = kept_members(std::move(own), row.key.type, [](const Key& member) { return !member.derived; });
  }
  return json;
}

Json dataset_of(const DatasetSource& source) {
  Json dataset = {{"name", source.name}};
  if (source.field) dataset["field"] = *source.field;
  if (!source.file) {
    dataset["generate"] = source.generate;
    return dataset;
  }
  const std::filesystem::path below = std::filesystem::proximate(*source.file);
  dataset["file"] = below.string().starts_with("..") ? source.file->string() : below.string();
  return dataset;
}

/// `transfer_function`, or with several fields `transfer_functions`.
void add_transfer_functions(Json& file, const DatasetSource& source, const RenderPoint& render) {
  if (render.transfer_function_name.empty()) return;
  Json first = given_keys(transfer_function_settings(), render.transfer_function);
  if (render.more_fields.empty()) {
    first["name"] = render.transfer_function_name;
    file["transfer_function"] = std::move(first);
    return;
  }
  first["field"] =
      source.file ? source.field.value() : analytic_field_type(source.generate);  // parse_transfer_functions() sees to both
  Json list = Json::array({std::move(first)});
  for (const FieldTransfer& f : render.more_fields) {
    list.push_back(given_keys(transfer_function_settings(), f.transfer_function));
    list.back()["field"] = f.field;
  }
  file["transfer_functions"] = std::move(list);
}

}  // namespace

Json point_experiment(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render) {
  Json file = given_keys(experiment_settings(), experiment);
  file["name"] = experiment.name;
  file["datasets"] = dataset_of(experiment.datasets[build.dataset]);
  file["encodings"] = {{"name", build.encoding}};
  file["encodings"].update(build.parameters.is_null() ? Json::object() : build.parameters);
  file.update(given_keys(build_settings(), build));
  file.update(given_keys(frame_settings(), render));
  const Json scene = given_keys(scene_settings(), scene_of(experiment, render));
  file["render"] = Json::object();
  for (const auto& [key, value] : scene.items())
    (is_top_level(scene_settings().find(key)->key) ? file : file["render"])[key] = value;
  file["views"] = given_keys(view_settings(), render.view);
  file["views"]["name"] = render.view_name;
  file.erase("transfer_functions");  // the scene knows those behind the first
  add_transfer_functions(file, experiment.datasets[build.dataset], render);
  file["reference"] = experiment.reference ? given_keys(reference_settings(), *experiment.reference) : Json();
  return file;
}

Scene scene_of(const Experiment& experiment, const RenderPoint& render) {
  return Scene{render.view, render.transfer_function, render.settings, experiment.region, render.more_fields};
}

Json render_json(const RenderPoint& render) {
  Json json = scene_record({render.view, render.transfer_function, render.settings, std::nullopt, render.more_fields});
  json["view_name"] = render.view_name;
  json["transfer_function"] = nullptr;
  json["transfer_function_name"] = nullptr;
  if (!render.transfer_function_name.empty()) {
    json["transfer_function"] = to_json(render.transfer_function);
    json["transfer_function_name"] = render.transfer_function_name;
  }
  if (!render.more_fields.empty()) json["more_transfer_functions"] = to_json(render.more_fields);
  if (render.settings.ray_offset) json["seed"] = *render.settings.ray_offset;
  return json;
}

Json point_configuration(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render,
                         std::string_view dataset_hash) {
  Json configuration = {{"experiment", experiment.name},
                        {"dataset", dataset_hash},
                        {"encoding", build.encoding},
                        {"build_parameters", given_parameters(build)},
                        {"build", build_settings().configuration(build)},
                        {"scene", scene_configuration(scene_of(experiment, render))},
                        {"frames", frame_settings().configuration(render)},
                        {"measuring", experiment_settings().configuration(experiment)}};
  configuration["reference"] = experiment.reference ? reference_settings().configuration(*experiment.reference) : Json();
  return configuration;
}

}  // namespace amrtex
