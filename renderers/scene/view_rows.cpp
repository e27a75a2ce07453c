// Keys of a view and of a transfer function.
#include "renderers/scene/scene_rows.hpp"
#include "renderers/scene/scene_settings.hpp"

namespace amrtex::scene_rows {

SettingTable<View> view_table() {
  std::vector<Setting<View>> rows;
  const auto direction = [](std::string name, std::string help, bool required, Json (*get)(const View&),
                            void (*set)(View&, const Json&)) {
    return Setting<View>{{.name = std::move(name),
                          .type = vector_type(),
                          .reference = AffectsReference::yes,
                          .help = std::move(help),
                          .required = required},
                         get,
                         set};
  };
  rows.push_back(direction(
      "eye", "where the camera is, in world units; not beside `orbit`", true, [](const View& v) { return list(v.eye); },
      [](View& v, const Json& j) { v.eye = vector(j); }));
  rows.push_back(direction(
      "at", "where it looks, another point; not beside `orbit`", true, [](const View& v) { return list(v.at); },
      [](View& v, const Json& j) { v.at = vector(j); }));
  rows.push_back(direction(
      "up", "any length, not parallel to the direction of view", false, [](const View& v) { return list(v.up); },
      [](View& v, const Json& j) { v.up = vector(j); }));
  rows.push_back({{.name = "projection",
                   .type = choice_type({"perspective", "orthographic"}),
                   .reference = AffectsReference::yes,
                   .help = "of the camera",
                   .recorded = Recorded::where_given},
                  [](const View& v) -> Json { return v.orthographic ? "orthographic" : "perspective"; },
                  [](View& v, const Json& j) { v.orthographic = j == "orthographic"; }});
  ValueType angle = number_above(0, 180);
  angle.below = true;
  rows.push_back({{.name = "fov_y",
                   .type = angle,
                   .reference = AffectsReference::yes,
                   .help = "vertical field of view",
                   .unit = "degrees",
                   .recorded = Recorded::where_it_applies,
                   .takes = {{"projection", {"perspective"}, Otherwise::belongs}}},
                  [](const View& v) -> Json { return v.fov_y; },
                  [](View& v, const Json& j) { v.fov_y = j.get<double>(); }});
  rows.push_back({{.name = "height",
                   .type = number_above(0),
                   .reference = AffectsReference::yes,
                   .help = "of the picture",
                   .unit = "world length",
                   .required = true,
                   .recorded = Recorded::where_it_applies,
                   .takes = {{"projection", {"orthographic"}, Otherwise::belongs}}},
                  [](const View& v) -> Json { return v.height; },
                  [](View& v, const Json& j) { v.height = j.get<double>(); }});
  return {"views", std::move(rows)};
}

SettingTable<TransferFunction> transfer_function_table() {
  using LengthUnit = TransferFunction::LengthUnit;
  std::vector<Setting<TransferFunction>> rows;
  rows.push_back({{.name = "extinction",
                   .type = lists_of(number_type(), 2, "points [value, extinction]"),
                   .reference = AffectsReference::yes,
                   .help = "values ascend, extinction per length is not negative; linear between points, constant beyond them",
                   .required = true},
                  [](const TransferFunction& tf) {
                    Json json = Json::array();
                    for (const auto& p : tf.extinction) json.push_back(Json::array({p.value, p.extinction}));
                    return json;
                  },
                  [](TransferFunction& tf, const Json& v) {
                    tf.extinction.clear();
                    for (const Json& p : elements(v)) tf.extinction.push_back({p[0].get<double>(), p[1].get<double>()});
                  }});
  rows.push_back({{.name = "color",
                   .type = color_type(),
                   .reference = AffectsReference::yes,
                   .help = "values ascend; linear RGB, 0 to 1",
                   .required = true},
                  [](const TransferFunction& tf) { return list_of_points(tf.color); },
                  [](TransferFunction& tf, const Json& v) { tf.color = color_points(v); }});
  rows.push_back({{.name = "scale",
                   .type = choice_type({"linear", "log"}),
                   .reference = AffectsReference::yes,
                   .help = "points are joined over the value or its log10, of values above 0"},
                  [](const TransferFunction& tf) -> Json { return tf.logarithmic ? "log" : "linear"; },
                  [](TransferFunction& tf, const Json& v) { tf.logarithmic = v == "log"; }});
  rows.push_back(
      {{.name = "length_unit",
        .type = choice_type({"longest_edge", "world"}),
        .reference = AffectsReference::yes,
        .help = "of extinction: the domain's longest edge is 1, or the file's unit"},
       [](const TransferFunction& tf) -> Json { return tf.length_unit == LengthUnit::world ? "world" : "longest_edge"; },
       [](TransferFunction& tf, const Json& v) {
         tf.length_unit = v == "world" ? LengthUnit::world : LengthUnit::longest_edge;
       }});
  return {"transfer_function", std::move(rows)};
}

}  // namespace amrtex::scene_rows
