// What records say of a point, and what tells it apart from others.
#include <algorithm>

#include "bench/settings/settings_table.hpp"

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

}  // namespace

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
