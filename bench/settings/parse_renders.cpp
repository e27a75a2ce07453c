#include <fmt/format.h>

#include "bench/settings/experiment_parser.hpp"
#include "renderers/scene/triangle_reader.hpp"

namespace amrtex {
namespace {

/// Meshes of triangles by path: each file is read once, however many points draw it.
using TriangleMeshes = std::map<std::string, std::shared_ptr<const TriangleMesh>>;

void load_triangles(const ExperimentParser& parser, const JsonNode& node, std::vector<TriangleObject>& objects,
                    TriangleMeshes& meshes) {
  if (objects.empty()) return;
  const std::vector<JsonNode> items = node.items();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const JsonNode file = items[i].require("file");
    const ExistingPath found = existing_path(file, parser.file);
    std::shared_ptr<const TriangleMesh>& mesh = meshes[found.path.string()];
    if (!mesh) located(file, [&] { mesh = std::make_shared<const TriangleMesh>(read_triangles(found.path, found.folder)); });
    objects[i].mesh = mesh;
  }
}

std::vector<RenderSettings> parse_render(ExperimentParser& parser) {
  const auto node = parser.root.find("render");
  if (!node) return {RenderSettings{}};
  const std::vector<const Key*> keys = section_of("render").keys;
  TriangleMeshes meshes;
  std::vector<RenderSettings> points;
  for (const JsonNode& render : node->items()) {
    render.accept_keys(names_of(keys));
    for (const Choice& choice : parser.axes.combinations(render, depths_of(keys))) {
      Scene scene;
      read_settings(render, choice, scene_settings(), scene);
      if (const JsonNode* triangles = find(choice, "triangles"))
        load_triangles(parser, *triangles, scene.settings.triangles, meshes);
      points.push_back(std::move(scene.settings));
    }
  }
  return points;
}

/// Colour of the volume, and of surfaces that have no colours of their own.
bool uses_transfer_function(const RenderSettings& s) {
  return s.draws_volume() || (s.draws_surfaces() && s.isosurfaces.color.empty() && s.isosurfaces.output == Output::color);
}

/// What one transfer function hides another may show.
void require_one_function(const ExperimentParser& parser, const std::vector<RenderSettings>& settings, std::size_t functions) {
  if (functions <= 1) return;
  for (const RenderSettings& s : settings)
    if (s.prune)
      for (const char* key : {"transfer_function", "transfer_functions"})
        if (const auto node = parser.root.find(key))
          node->fail("with 'prune' the transfer function may not change: what one hides another may show; accepted: one");
}

RenderPoint combined(const ExperimentParser& parser, const RenderSettings& settings, const RenderPoint& view,
                     const RenderPoint& function) {
  RenderPoint render = view;
  render.settings = settings;
  if (uses_transfer_function(settings)) {
    render.transfer_function = function.transfer_function;
    render.transfer_function_name = function.transfer_function_name;
  }
  if (!settings.draws_volume()) return render;  // other modes draw the first field alone
  render.more_fields = function.more_fields;
  if (const auto node = parser.root.find("transfer_functions"))
    located(*node, [&] { validate_setting(scene_of(parser.experiment, render), "transfer_functions"); });
  return render;
}

/// All combinations of `frames` and `warm_up`.
std::vector<RenderPoint> parse_frames(const ExperimentParser& parser) {
  std::vector<RenderPoint> points = {RenderPoint{}};
  for (const Setting<RenderPoint>& row : frame_settings().rows()) {
    const auto node = parser.root.find(row.key.name);
    if (!node) continue;
    std::vector<RenderPoint> next;
    for (const RenderPoint& point : points)
      for (const JsonNode& value : node->items()) {
        next.push_back(point);
        read_setting(value, row, next.back());
      }
    points = std::move(next);
  }
  return points;
}

}  // namespace

void parse_renders(ExperimentParser& parser) {
  const std::vector<RenderSettings> settings = parse_render(parser);
  const std::vector<RenderPoint> views = parse_views(parser);
  const bool volume = std::any_of(settings.begin(), settings.end(), [](const RenderSettings& s) { return s.draws_volume(); });
  const std::vector<RenderPoint> functions = parse_transfer_functions(parser, volume);
  require_one_function(parser, settings, functions.size());
  const std::vector<RenderPoint> frames = parse_frames(parser);
  std::vector<RenderPoint>& all = parser.experiment.renders;
  for (const RenderPoint& view : views)
    for (const RenderPoint& function : functions)
      for (const RenderSettings& s : settings) {
        RenderPoint render = combined(parser, s, view, function);
        for (const RenderPoint& f : frames) {
          render.frames = f.frames;
          render.warm_up = f.warm_up;
          all.push_back(render);
        }
      }
  remove_repeated(all, [](const RenderPoint& r) {
    return scene_configuration(scene_of(Experiment{}, r)).dump() + frame_settings().configuration(r).dump();
  });
}

}  // namespace amrtex
