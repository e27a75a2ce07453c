// Keys of a scene that say what is cut, mirrored and drawn beside the field.
#include <fmt/format.h>

#include <limits>

#include "renderers/scene/scene_names.hpp"
#include "renderers/scene/scene_rows.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex::scene_rows {
namespace {

std::string clip_plane_problem(const Scene& scene) {
  const std::vector<ClipPlane>& planes = scene.settings.clip_planes;
  for (std::size_t i = 0; i < planes.size(); ++i)
    if (planes[i].normal == Vec3d(0))
      return fmt::format(
          "plane {}: the normal (0, 0, 0) has no direction; accepted: [a, b, c, d] with a, b or c other than 0, which keeps "
          "a x + b y + c z >= d",
          i);
  return "";
}

/// Curves of several fields are evaluated as they are, not from a table.
std::string fields_problem(const Scene& scene) {
  if (scene.more_fields.empty()) return "";
  const auto too_long = [](const TransferFunction& tf, std::string_view field) -> std::string {
    const auto refuse = [&](const char* curve, std::size_t points, std::size_t most) {
      return points > most ? fmt::format("'{}' of {} has {} points; with several fields at most {} are supported", curve,
                                         clipped(field), points, most)
                           : std::string();
    };
    const std::string extinction = refuse("extinction", tf.extinction.size(), kMostExactPoints);
    return extinction.empty() ? refuse("color", tf.color.size(), kMostExactColors) : extinction;
  };
  std::string problem = too_long(scene.transfer_function, "the first field");
  for (const FieldTransfer& f : scene.more_fields) {
    validate(f.transfer_function);
    if (problem.empty()) problem = too_long(f.transfer_function, f.field);
  }
  return problem;
}

std::string region_problem(const Scene& scene) {
  if (scene.region)
    for (int axis = 0; axis < 3; ++axis)
      if (!((*scene.region)[0][axis] < (*scene.region)[1][axis]))
        return "the lower corner must lie below the upper one along every axis";
  return "";
}

Json clip_planes_json(const Scene& scene) {
  Json json = Json::array();
  for (const ClipPlane& p : scene.settings.clip_planes)
    json.push_back(Json::array({p.normal.x, p.normal.y, p.normal.z, p.distance}));
  return json;
}

void set_clip_planes(Scene& scene, const Json& json) {
  scene.settings.clip_planes.clear();
  for (const Json& p : elements(json)) scene.settings.clip_planes.push_back({vector(p), p[3].get<double>()});
}

Json triangles_json(const Scene& scene) {
  Json json = Json::array();
  for (const TriangleObject& o : scene.settings.triangles) {
    json.push_back({{"file", o.file}, {"color", list(o.color)}});
    if (!o.mesh) continue;
    json.back()["hash"] = o.mesh->content_hash();
    json.back()["triangles"] = o.mesh->triangles().size();
  }
  return json;
}

/// Without the meshes: only the parser of a file knows where its files lie.
void set_triangles(Scene& scene, const Json& json) {
  scene.settings.triangles.clear();
  for (const Json& object : elements(json)) {
    TriangleObject& o = scene.settings.triangles.emplace_back();
    o.file = object.at("file").get<std::string>();
    if (object.contains("color")) o.color = vector(object["color"]);
  }
}

Json region_json(const Scene& scene) {
  return scene.region ? Json{{"lower", list((*scene.region)[0])}, {"upper", list((*scene.region)[1])}} : Json();
}

void set_region(Scene& scene, const Json& json) {
  scene.region.reset();
  if (!json.is_null()) scene.region = {vector(json.at("lower")), vector(json.at("upper"))};
}

Json fields_json(const Scene& scene) { return to_json(scene.more_fields); }

void set_fields(Scene& scene, const Json& json) {
  scene.more_fields.clear();
  for (Json f : elements(json)) {
    const std::string field = f.at("field").get<std::string>();
    f.erase("field");
    scene.more_fields.push_back({field, parse_transfer_function(f)});
  }
}

/// A field and the keys of its transfer function.
std::vector<Key> field_keys() {
  std::vector<Key> keys{{.name = "field", .type = text_type(), .reference = AffectsReference::yes, .required = true}};
  for (const Key* key : transfer_function_settings().keys()) keys.push_back(*key);
  return keys;
}

}  // namespace

Rows geometry_rows() {
  Rows rows;
  ValueType planes = lists_of(number_type(), 4, "planes [a, b, c, d], which keep a x + b y + c z >= d in world units").or_null();
  planes.most = kMostClipPlanes;
  planes.may_be_empty = true;
  rows.push_back(
      {{.name = "clip_planes",
        .type = planes,
        .reference = AffectsReference::yes,
        .help = "(a, b, c) is not 0. Drawn is what every plane keeps; what is cut away casts no shadow, and a cut is no surface",
        .default_text = "none",
        .recorded = Recorded::where_given,
        .column = {.label = "clip planes", .only_where_given = true}},
       clip_planes_json,
       set_clip_planes,
       clip_plane_problem});
  rows.push_back(
      {{.name = "mirror",
        .type = choice_type(texts_of(kMirrorNames)).or_null(),
        .reference = AffectsReference::yes,
        .help = "behind that face of what is drawn (the domain or `region`) its mirror image is drawn too",
        .recorded = Recorded::where_given,
        .column = {"mirror"},
        .takes = {not_with("point_light", nullptr, "rays to the lamp of 'point_light' do not see the image"),
                  not_with("ambient_occlusion", nullptr, "rays of 'ambient_occlusion' do not see the image"),
                  not_with("level_of_detail", nullptr, "'level_of_detail' knows the sizes of cells and not of their images"),
                  drawn_by({"raycast"}, "boxes of the image are not drawn")}},
       [](const Scene& s) -> Json { return s.settings.mirror ? Json(mirror_name(*s.settings.mirror)) : Json(); },
       [](Scene& s, const Json& v) {
         s.settings.mirror = v.is_null() ? std::nullopt : std::optional(parse_mirror(v.get<std::string>()));
       }});
  return rows;
}

Rows triangle_rows() {
  Rows rows;
  ValueType objects =
      list_of(object_type({{.name = "file",
                            .type = text_type(),
                            .reference = AffectsReference::no,
                            .help = "an OBJ, PLY or STL file in world units, looked for as `datasets.file`",
                            .required = true,
                            .label = true},
                           {.name = "color",
                            .type = list_of(number_type(0, 1), 3, "[r, g, b], each from 0 to 1"),
                            .reference = AffectsReference::yes,
                            .help = "linear",
                            .default_value = list(TriangleObject{}.color)},
                           {.name = "hash", .type = text_type(), .reference = AffectsReference::yes, .derived = true},
                           {.name = "triangles",
                            .type = integer_type(0, std::numeric_limits<std::int64_t>::max()),
                            .reference = AffectsReference::yes,
                            .derived = true}}),
              0, "an object with file, color, or a list of them")
          .or_null();
  objects.most = kMostTriangleObjects;
  objects.may_be_empty = true;
  rows.push_back(
      {{.name = "triangles",
        .type = objects,
        .reference = AffectsReference::yes,
        .help =
            "rays end at the first triangle, which is seen behind what lies in front of it, lit from the eye on both sides; in "
            "`projection` and `mip` rays end there and no triangle is seen. Triangles are neither cut by `clip_planes` nor "
            "mirrored, and what `point_light` and `ambient_occlusion` light takes no notice of them. In an axis `[]` is none",
        .default_text = "none",
        .recorded = Recorded::where_given,
        .column = {.label = "triangles", .only_where_given = true},
        .takes = {only_with("output", {"color"}, "triangles are no isosurface"),
                  drawn_by({"raycast"}, "boxes are drawn whole, and rays end at triangles inside of them")}},
       triangles_json,
       set_triangles});
  return rows;
}

Rows top_rows() {
  Rows rows;
  rows.push_back(
      {{.name = "transfer_functions",
        .type = list_of(object_type(field_keys()), 0, "a list of objects with field, extinction, color"),
        .reference = AffectsReference::yes,
        .help = "in place of `transfer_function`: several fields in one volume, see below",
        .default_text = "none",
        .recorded = Recorded::never,
        .takes = {only_with("mode", {"dvr"}, "other modes draw one field"),
                  only_with("sampling", {"lattice", "adaptive"}, "steps are planned for one field"),
                  only_with("integrator", {"exponential_midpoint", "euler", "left"},
                            "others know light between two values of one field"),
                  not_with("point_light", nullptr, "rays to the lamp of 'point_light' gather the depth of one field"),
                  not_with("prune", false, "'prune' leaves out what is hidden in one field and may be seen in another"),
                  drawn_by({"raycast"}, "it draws one field")}},
       fields_json,
       set_fields,
       fields_problem});
  rows.push_back(
      {{.name = "region",
        .type = object_type({{.name = "lower", .type = vector_type(), .reference = AffectsReference::yes, .required = true},
                             {.name = "upper", .type = vector_type(), .reference = AffectsReference::yes, .required = true}})
                    .or_null(),
        .reference = AffectsReference::yes,
        .help = "scene files only: the box to draw, from its lower to its upper corner",
        .unit = "world",
        .default_text = "the whole domain",
        .recorded = Recorded::never},
       region_json,
       set_region,
       region_problem});
  return rows;
}

}  // namespace amrtex::scene_rows
