// Keys of `render` that say what surfaces and light look like.
#include <fmt/format.h>

#include <limits>

#include "renderers/scene/scene_names.hpp"
#include "renderers/scene/scene_rows.hpp"
#include "renderers/scene/scene_settings.hpp"

namespace amrtex::scene_rows {
namespace {

std::string isovalues_problem(const Scene& scene) {
  const std::vector<double>& values = scene.settings.isosurfaces.values;
  for (std::size_t i = 1; i < values.size(); ++i)
    if (!(values[i] > values[i - 1])) return fmt::format("{} follows {}; isovalues must ascend", values[i], values[i - 1]);
  return "";
}

std::string opacity_problem(const Scene& scene) {
  const Isosurfaces& iso = scene.settings.isosurfaces;
  if (iso.opacity.empty() || iso.opacity.size() == iso.values.size()) return "";
  return fmt::format("{} values for {} isovalues; accepted: one number, or one a value", iso.opacity.size(), iso.values.size());
}

std::string surface_color_problem(const Scene& scene) { return color_problem(scene.settings.isosurfaces.color, false); }

Json occlusion_json(const Scene& scene) {
  const auto& around = scene.settings.isosurfaces.ambient_occlusion;
  return around ? Json{{"rays", around->rays}, {"radius", around->radius}, {"seed", around->seed}} : Json();
}

void set_occlusion(Scene& scene, const Json& json) {
  std::optional<AmbientOcclusion>& around = scene.settings.isosurfaces.ambient_occlusion;
  around.reset();
  if (json.is_null()) return;
  around.emplace();
  around->radius = json.at("radius").get<double>();
  around->rays = json.value("rays", around->rays);
  around->seed = json.value("seed", around->seed);
}

}  // namespace

Rows surface_rows() {
  Rows rows;
  rows.push_back({{.name = "isovalues",
                   .type =
                       [] {
                         ValueType type = list_of(number_type(), 0, "a list of field values, ascending");
                         type.most = kMostIsovalues;
                         return type;
                       }(),
                   .reference = AffectsReference::yes,
                   .help = "values whose surfaces are drawn",
                   .unit = "field units",
                   .required = true,
                   .recorded = Recorded::where_it_applies,
                   .column = {"isovalues"},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json { return s.settings.isosurfaces.values; },
                  [](Scene& s, const Json& v) { s.settings.isosurfaces.values = numbers(v); },
                  isovalues_problem});
  rows.push_back({{.name = "iso_opacity",
                   .type = list_of(number_above(0, 1), 0, "numbers in (0, 1], one for all or one a value"),
                   .reference = AffectsReference::yes,
                   .help = "opacity of the surfaces",
                   .default_text = "1",
                   .recorded = Recorded::where_it_applies,
                   .column = {.label = "opacity of surfaces", .only_where_given = true},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json {
                    const Isosurfaces& iso = s.settings.isosurfaces;
                    return iso.opacity.empty() ? std::vector<double>(iso.values.size(), 1.0) : iso.opacity;
                  },
                  [](Scene& s, const Json& v) {  // one stands for all; a row above has set the isovalues
                    Isosurfaces& iso = s.settings.isosurfaces;
                    iso.opacity = numbers(v);
                    if (iso.opacity.size() == 1) iso.opacity.resize(iso.values.size(), iso.opacity.front());
                  },
                  opacity_problem});
  return rows;
}

Rows surface_color_rows() {
  Rows rows;
  rows.push_back({{.name = "surface_color",
                   .type =
                       [] {
                         ValueType type = color_type().or_null();
                         type.most = kMostSurfaceColors;
                         return type;
                       }(),
                   .reference = AffectsReference::yes,
                   .help = "colours over the isovalue or the second field",
                   .default_text = "the transfer function's colours, or grey",
                   .recorded = Recorded::where_it_applies,
                   .column = {"colours of surfaces"},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json {
                    const auto& color = s.settings.isosurfaces.color;
                    return color.empty() ? Json() : list_of_points(color);
                  },
                  [](Scene& s, const Json& v) { s.settings.isosurfaces.color = color_points(v); },
                  surface_color_problem});
  rows.push_back({{.name = "color_field",
                   .type = text_type().or_null(),
                   .reference = AffectsReference::yes,
                   .help = "second field of the data set, whose value gives a surface its colour",
                   .recorded = Recorded::where_it_applies,
                   .column = {"field of colours"},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json {
                    const std::string& field = s.settings.isosurfaces.color_field;
                    return field.empty() ? Json() : Json(field);
                  },
                  [](Scene& s, const Json& v) { s.settings.isosurfaces.color_field = v.is_null() ? "" : v.get<std::string>(); }});
  return rows;
}

Rows surface_light_rows() {
  Rows rows;
  rows.push_back({{.name = "iso_tolerance",
                   .type = number_above(0, 1),
                   .reference = AffectsReference::no,
                   .help = "bound on a hit's place along the ray, in widths as `step`",
                   .unit = "cell widths",
                   .recorded = Recorded::where_it_applies,
                   .column = {.label = "place of hits within (cells)", .numeric = true, .only_where_given = true},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json { return s.settings.isosurfaces.tolerance; },
                  [](Scene& s, const Json& v) { s.settings.isosurfaces.tolerance = v.get<double>(); }});
  rows.push_back(
      {{.name = "shading",
        .type = choice_type(texts_of(kShadingNames)),
        .reference = AffectsReference::yes,
        .help = "normals of lit surfaces: `gradient` (the encoding's stored one, else central differences), `central`, `clamped` "
                "(central differences inside of the hit's region), `analytic` (the derivative of f; `exabricks` with `basis`), "
                "`none`",
        .recorded = Recorded::where_it_applies,
        .column = {"shading"},
        .takes = {of_surfaces()}},
       [](const Scene& s) -> Json { return shading_name(s.settings.isosurfaces.shading); },
       [](Scene& s, const Json& v) { s.settings.isosurfaces.shading = parse_shading(v.get<std::string>()); }});
  rows.push_back({{.name = "output",
                   .type = choice_type(texts_of(kOutputNames)),
                   .reference = AffectsReference::yes,
                   .help = "`depth`: world distance to the first surface; `normal`: the unit normal there",
                   .recorded = Recorded::where_it_applies,
                   .column = {"output"},
                   .takes = {of_surfaces()}},
                  [](const Scene& s) -> Json { return output_name(s.settings.isosurfaces.output); },
                  [](Scene& s, const Json& v) { s.settings.isosurfaces.output = parse_output(v.get<std::string>()); }});
  rows.push_back(
      {{.name = "ambient_occlusion",
        .type = object_type({{.name = "rays",
                              .type = integer_type(1, kMostOcclusionRays),
                              .reference = AffectsReference::no,
                              .help = "from each hit",
                              .default_value = AmbientOcclusion{}.rays},
                             {.name = "radius",
                              .type = number_above(0),
                              .reference = AffectsReference::yes,
                              .help = "in which surfaces are looked for",
                              .unit = "world length",
                              .required = true},
                             {.name = "seed",
                              .type = integer_type(0, std::numeric_limits<std::uint32_t>::max()),
                              .reference = AffectsReference::no,
                              .help = "of the turn of the rays around the normal",
                              .default_value = AmbientOcclusion{}.seed}})
                    .or_null(),
        .reference = AffectsReference::yes,
        .help = "a surface's colour is multiplied by the share of the rays from a hit that meet no isosurface within the radius",
        .recorded = Recorded::where_given,
        .column = {"ambient occlusion"},
        .takes = {of_surfaces(), only_with("output", {"color"}, "it darkens colours")}},
       occlusion_json,
       set_occlusion});
  return rows;
}

Rows light_rows() {
  Rows rows;
  rows.push_back(
      {{.name = "ray_offset",
        .type = boolean_type(),
        .reference = AffectsReference::no,
        .help = "the intervals of each ray are moved by a random part of one, from the pixel and the experiment's `seed`",
        .column = {.label = "offset of rays", .only_where_given = true},
        .takes = {only_with("integrator", {"exponential_midpoint", "euler"},
                            "it moves intervals that are sampled in their middle"),
                  drawn_by({"raycast", "multipass"}, "slices lie where they lie for all rays")}},
       [](const Scene& s) -> Json { return s.settings.ray_offset.has_value(); },
       [](Scene& s, const Json& v) {  // the seed is the experiment's
         s.settings.ray_offset = v.get<bool>() ? std::optional<std::uint32_t>(0) : std::nullopt;
       }});
  rows.push_back(
      {{.name = "point_light",
        .type = vector_type().or_null(),
        .reference = AffectsReference::yes,
        .help =
            "a lamp, inside of the domain or not: what is emitted is multiplied by ambient + (1 − ambient) exp(−optical depth on "
            "the way to the lamp)",
        .unit = "world",
        .recorded = Recorded::where_given,
        .column = {"lamp"},
        .takes = {only_with("mode", {"dvr", "dvr_iso"}, "it lights a volume"),
                  only_with("output", {"color"}, "it lights a volume"),
                  only_with("integrator", {"exponential_midpoint"}, "light of a lamp changes inside of an interval"),
                  drawn_by({"raycast"}, "in single passes a secondary ray would leave its box")}},
       [](const Scene& s) -> Json { return s.settings.point_light ? list(s.settings.point_light->position) : Json(); },
       [](Scene& s, const Json& v) {
         s.settings.point_light.reset();
         if (!v.is_null()) s.settings.point_light.emplace().position = vector(v);
       }});
  rows.push_back({{.name = "ambient",
                   .type = number_type(0, 1),
                   .reference = AffectsReference::yes,
                   .help = "light where the lamp does not reach",
                   .recorded = Recorded::where_it_applies,
                   .column = {.label = "ambient light", .numeric = true, .only_where_given = true},
                   .takes = {{"point_light", {}, Otherwise::belongs}}},
                  [](const Scene& s) -> Json { return s.settings.point_light.value_or(PointLight{}).ambient; },
                  [](Scene& s, const Json& v) {
                    if (s.settings.point_light) s.settings.point_light->ambient = v.get<double>();
                  }});
  rows.push_back({{.name = "shadow_step",
                   .type = number_above(0),
                   .reference = AffectsReference::no,
                   .help = "of the secondary rays, in cells of each region",
                   .unit = "cell widths",
                   .recorded = Recorded::where_it_applies,
                   .column = {.label = "step to the lamp (cells)", .numeric = true, .only_where_given = true},
                   .takes = {{"point_light", {}, Otherwise::belongs}}},
                  [](const Scene& s) -> Json { return s.settings.point_light.value_or(PointLight{}).shadow_step; },
                  [](Scene& s, const Json& v) {
                    if (s.settings.point_light) s.settings.point_light->shadow_step = v.get<double>();
                  }});
  return rows;
}

}  // namespace amrtex::scene_rows
