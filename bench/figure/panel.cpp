#include "bench/figure/panel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "bench/figure/overlay.hpp"
#include "bench/measure/picture_look.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/scene_drawing.hpp"
#include "bench/records/point_query.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/records/stored_picture.hpp"
#include "bench/settings/default_scene.hpp"
#include "renderers/cpu/structure_view.hpp"
#include "renderers/scene/background.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

// --- sources ---

/// The one record that a panel is about.
Json find_record(const PanelSpec& panel) {
  std::optional<PointQuery> query;
  if (!panel.where.empty()) query.emplace(panel.where, "where");
  std::vector<Json> found;
  for (Json& record : load_records(panel.records))
    if (record.at("status") == "ok" && (!query || query->holds(record))) found.push_back(std::move(record));
  if (found.size() != 1)
    throw UsageError(fmt::format("{}: {} records with a picture{}; accepted: a condition 'where' that leaves one",
                                 clipped(panel.records), found.size(),
                                 panel.where.empty() ? "" : fmt::format(" where {}", clipped(panel.where))));
  return std::move(found.front());
}

Experiment experiment_of(const Json& record, const PanelSpec& panel) {
  const auto asked = record.find("asked");
  if (asked == record.end() || !asked->is_object())
    throw UsageError(fmt::format("{}: the record does not say where its data came from; accepted: 'show' picture or error",
                                 clipped(panel.records)));
  return parse_experiment(asked->dump(), fs::path(panel.records) / "asked", {.set = panel.set});
}

Experiment experiment_of_data(const PanelSpec& panel) {
  const AmrHierarchy mesh(read_mesh(panel.data, FieldChoice::one(panel.field)));
  SceneRequest request;
  request.data = panel.data;
  request.view_name = panel.view;
  request.width = panel.size[0];
  request.height = panel.size[1];
  return parse_scene(default_scene(mesh, request).dump(1), fs::path(panel.data) / "default_scene", {.set = panel.set});
}

Experiment read_source(const PanelSpec& panel) {
  if (!panel.scene.empty()) return read_scene(panel.scene, {.set = panel.set});
  if (!panel.data.empty()) return experiment_of_data(panel);
  return experiment_of(find_record(panel), panel);
}

/// Scenes by what they were asked for, each drawn once.
class Scenes {
 public:
  SceneDrawing& of(const PanelSpec& panel) {
    const Json name = {panel.scene, panel.data, panel.records, panel.where, panel.set, panel.field, panel.view, panel.size};
    std::unique_ptr<SceneDrawing>& drawing = drawings_[name.dump()];
    if (!drawing) drawing = std::make_unique<SceneDrawing>(read_source(panel));
    return *drawing;
  }

 private:
  std::map<std::string, std::unique_ptr<SceneDrawing>> drawings_;
};

// --- what is shown ---

Vec3d background_of(const PanelSpec& panel, const Vec3d& otherwise) {
  if (panel.background == "white") return Vec3d(1);
  return panel.background == "black" ? Vec3d(0) : otherwise;
}

/// As much of a record's scene as says how its picture is shown; its data need not be there.
Scene look_of(const Json& record) {
  Scene scene;
  const Json& render = record.at("render");
  scene.settings.mode = parse_mode(render.at("mode").get<std::string>());
  if (render.at("transfer_function").is_object()) scene.transfer_function = parse_transfer_function(render["transfer_function"]);
  return scene;
}

void show_record(const PanelSpec& panel, PanelContent& content) {
  const Json record = find_record(panel);
  const fs::path file = picture_path(panel.records, record.at("configuration").get<std::string>());
  StoredPicture stored = read_stored_picture(file);
  const Scene look = look_of(record);
  if (panel.show == Show::error) {
    if (!stored.difference) throw UsageError(fmt::format("{}: the point had no reference, and has no error", file.string()));
    content.picture = largest_difference(*stored.difference);
    return;
  }
  content.picture = std::move(stored.picture);
  const bool volume = look.settings.draws_volume() && !look.transfer_function.color.empty();
  content.background = background_of(panel, volume ? background_for(look) : Vec3d(1));
  if (volume && content.picture.channels == 4) content.colors = look.transfer_function;
  const Json& field = value_at(record, "/dataset/field");
  content.quantity = shown_quantity(look, field.is_string() ? field.get<std::string>() : "value");
}

void show_file(const PanelSpec& panel, PanelContent& content) {
  content.picture = read_npy(panel.file);
  if (content.picture.channels != 1 && content.picture.channels != 4)
    throw UsageError(fmt::format("{}: {} channels; accepted: 1 or 4", clipped(panel.file), content.picture.channels));
  content.background = background_of(panel, Vec3d(1));
}

CutPlane plane_of(const PanelSpec& panel, const AmrHierarchy& mesh) {
  const int axis = panel.axis[0] - 'x';
  return {axis, panel.at.value_or((mesh.domain_lower()[axis] + mesh.domain_upper()[axis]) / 2)};
}

void show_slice(const PanelSpec& panel, const SceneDrawing& drawing, PanelContent& content) {
  const AmrHierarchy& mesh = drawing.mesh();
  const CutPlane plane = plane_of(panel, mesh);
  cut_layer(mesh, plane);  // throws where it misses the domain
  const auto [right, up] = slice_axes(plane.axis);
  const Vec3d lower = mesh.domain_lower(), size = mesh.domain_upper() - lower;
  const double longer = std::max(size[right], size[up]);
  const auto pixels = [&](int axis) { return std::max(1, static_cast<int>(std::lround(panel.pixels * size[axis] / longer))); };
  content.picture = Picture(pixels(right), pixels(up), 1);
  const HierarchyReference filter = drawing.filter();
  for (int y = 0; y < content.picture.height; ++y)
    for (int x = 0; x < content.picture.width; ++x) {
      Vec3d p;
      p[plane.axis] = plane.at;
      p[right] = lower[right] + size[right] * ((x + 0.5) / content.picture.width);
      p[up] = lower[up] + size[up] * (1 - (y + 0.5) / content.picture.height);
      *content.picture.pixel(x, y) = filter.sample(p).value_or(std::numeric_limits<double>::quiet_NaN());
    }
  content.quantity = mesh.fields().front();
  content.world_width = size[right];
}

Heat heat_of(Show show) { return parse_heat(show_name(show)); }

/// World length across the picture, in the plane through the domain's middle.
double world_width(const Scene& scene, const AmrHierarchy& mesh) {
  const CameraFrame camera = camera_frame(scene.view, scene.settings.width, scene.settings.height);
  const Vec3d middle = (mesh.domain_lower() + mesh.domain_upper()) * 0.5;
  const double distance = camera.orthographic ? 1 : glm::dot(middle - camera.eye, camera.forward);
  return 2 * glm::length(camera.right) * std::max(distance, 0.0);
}

void show_scene(const PanelSpec& panel, SceneDrawing& drawing, PanelContent& content) {
  const Scene& scene = drawing.scene();
  content.world_width = world_width(scene, drawing.mesh());
  if (panel.show != Show::picture && panel.show != Show::reference) {
    content.picture = drawing.heat(heat_of(panel.show));
    return;
  }
  const Picture& picture = panel.show == Show::picture ? drawing.picture() : drawing.reference();
  content.picture = without_outside(picture, scene, drawing.mesh());
  content.background = background_of(panel, background_for(scene));
  content.colors = shown_colors(scene);
  content.quantity = shown_quantity(scene, drawing.mesh());
}

// --- overlays ---

void add_key(const OverlaySpec& overlay, const std::vector<LevelBox>& boxes, PanelContent& content) {
  for (const LevelBox& box : boxes) {
    const bool drawn =
        overlay.levels.empty() || std::find(overlay.levels.begin(), overlay.levels.end(), box.level) != overlay.levels.end();
    const bool known =
        std::any_of(content.key.begin(), content.key.end(), [&](const LevelKey& k) { return k.level == box.level; });
    if (drawn && !known) content.key.push_back({box.level, level_ink(overlay, box.level)});
  }
}

void add_overlays(const PanelSpec& panel, SceneDrawing& drawing, PanelContent& content) {
  const AmrHierarchy& mesh = drawing.mesh();
  for (const OverlaySpec& overlay : panel.overlays) {
    const bool of_structure = overlay.boxes == "regions" || overlay.boxes == "nodes";
    std::vector<LevelBox> boxes = of_structure ? structure_boxes(mesh, drawing.field(overlay.boxes == "nodes"), overlay.boxes)
                                               : mesh_boxes(mesh, overlay.boxes);
    std::vector<Line> lines;
    if (panel.show == Show::slice) {
      const CutPlane plane = plane_of(panel, mesh);
      boxes = boxes_in_layer(std::move(boxes), plane.axis, cut_layer(mesh, plane));
      lines = cut_boxes(mesh, boxes, plane.axis, overlay);
    } else {
      lines = seen_boxes(mesh, boxes, drawing.scene(), overlay);
    }
    content.lines.insert(content.lines.end(), lines.begin(), lines.end());
    if (panel.level_key && overlay.boxes != "domain") add_key(overlay, boxes, content);
  }
  std::sort(content.key.begin(), content.key.end(), [](const LevelKey& a, const LevelKey& b) { return a.level < b.level; });
}

/// In the structure that the scene draws, where nothing is skipped.
RayPlaces places_of(const RaySpec& spec, const SceneDrawing& drawing) {
  RayPlaces ray;
  for (int axis = 0; axis < 3; ++axis) {
    ray.from[axis] = spec.from[static_cast<std::size_t>(axis)];
    ray.to[axis] = spec.to[static_cast<std::size_t>(axis)];
  }
  const HierarchyReference filter = drawing.filter();
  const FieldValues values = [&](const FinestPosition& p, int) { return filter.sample(p); };
  const WorldRay line{ray.from, glm::normalize(ray.to - ray.from)};
  for (const SamplePlace& p :
       list_samples(drawing.mesh(), drawing.field(false), values, line, parse_sampling(spec.sampling), spec.step))
    ray.samples.push_back(p.position);
  return ray;
}

void add_rays(const PanelSpec& panel, const SceneDrawing& drawing, PanelContent& content) {
  for (const RaySpec& spec : panel.rays) {
    const RayPlaces ray = places_of(spec, drawing);
    const std::vector<Line> lines = panel.show == Show::slice
                                        ? cut_ray(drawing.mesh(), ray, plane_of(panel, drawing.mesh()), spec)
                                        : seen_ray(ray, drawing.scene(), spec);
    content.lines.insert(content.lines.end(), lines.begin(), lines.end());
  }
}

std::string heat_quantity(Show show) {
  return show == Show::error ? "picture \xE2\x88\x92 reference" : std::string(show_name(show));
}

PanelContent make_panel(const PanelSpec& panel, Scenes& scenes) {
  PanelContent content;
  const bool stored = !panel.records.empty() && panel.set.empty() && (panel.show == Show::picture || panel.show == Show::error);
  if (!panel.file.empty())
    show_file(panel, content);
  else if (stored)
    show_record(panel, content);
  else if (panel.show == Show::slice)
    show_slice(panel, scenes.of(panel), content);
  else
    show_scene(panel, scenes.of(panel), content);
  if (panel.show != Show::picture && panel.show != Show::reference && panel.show != Show::slice)
    content.quantity = heat_quantity(panel.show);
  content.is_signed = panel.show == Show::error;
  if (panel.show == Show::level) content.finest_level = scenes.of(panel).mesh().finest_level();
  if (!panel.overlays.empty()) add_overlays(panel, scenes.of(panel), content);
  if (!panel.rays.empty()) add_rays(panel, scenes.of(panel), content);
  if (stored && panel.scale_bar) content.world_width = world_width(scenes.of(panel).scene(), scenes.of(panel).mesh());
  if (panel.scale_bar && !(*panel.scale_bar < content.world_width))
    throw UsageError(fmt::format("'scale_bar' {:.6g}: the panel shows {:.6g} world units; accepted: less", *panel.scale_bar,
                                 content.world_width));
  return content;
}

/// The same kind of error, with the panel's place.
template <class Work>
auto placed(const PanelSpec& panel, Work&& work) {
  const auto text = [&](const Error& e) { return fmt::format("{}: {}", panel.place, e.what()); };
  try {
    return work();
  } catch (const UsageError& e) {
    throw UsageError(text(e));
  } catch (const UnsupportedError& e) {
    throw UnsupportedError(text(e));
  } catch (const Error& e) {
    throw Error(text(e));
  }
}

// --- colours ---

using Range = std::array<double, 2>;

std::optional<Range> own_range(const PanelSpec& panel, const PanelContent& content) {
  if (panel.range) return panel.range;
  if (content.is_signed) return around_zero(content.picture);
  if (content.finest_level >= 0) return Range{0, std::max(1.0, static_cast<double>(content.finest_level))};
  return value_range(content.picture, panel.logarithmic);
}

/// Do two panels show numbers that one range serves?
bool same_kind(const PanelSpec& a, const PanelContent& first, const PanelSpec& b, const PanelContent& second) {
  return a.show == b.show && a.logarithmic == b.logarithmic && first.picture.channels == 1 && second.picture.channels == 1 &&
         first.quantity == second.quantity && !a.range && !b.range;
}

std::unique_ptr<ColorScale> scale_of(const PanelSpec& panel, const PanelContent& content, const std::optional<Range>& range) {
  if (content.picture.channels == 4)
    return content.colors.color.size() > 1 ? std::make_unique<ColorScale>(content.colors) : nullptr;
  if (!range) return nullptr;
  auto [first, last] = *range;
  if (!(first < last)) {  // one value alone: it is the middle of its colours
    const double around = first != 0 ? std::abs(first) / 2 : 1;
    first -= around;
    last += around;
  }
  const std::string map = !panel.color_map.empty() ? panel.color_map : content.is_signed ? "cool_warm" : "viridis";
  return std::make_unique<ColorScale>(map, first, last, panel.logarithmic, content.finest_level >= 0);
}

}  // namespace

std::vector<PanelContent> make_panels(const FigureSpec& figure) {
  Scenes scenes;
  std::vector<PanelContent> panels;
  for (const PanelSpec& panel : figure.panels) panels.push_back(placed(panel, [&] { return make_panel(panel, scenes); }));
  return panels;
}

std::vector<std::unique_ptr<ColorScale>> make_scales(const FigureSpec& figure, const std::vector<PanelContent>& panels) {
  std::vector<std::unique_ptr<ColorScale>> scales;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    std::optional<Range> range = own_range(figure.panels[i], panels[i]);
    for (std::size_t k = 0; k < panels.size(); ++k) {
      if (!figure.shared_ranges || k == i || !same_kind(figure.panels[i], panels[i], figure.panels[k], panels[k])) continue;
      const std::optional<Range> other = own_range(figure.panels[k], panels[k]);
      if (range && other) range = {std::min((*range)[0], (*other)[0]), std::max((*range)[1], (*other)[1])};
    }
    scales.push_back(scale_of(figure.panels[i], panels[i], range));
  }
  return scales;
}

}  // namespace amrtex
