#include "bench/settings/experiment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <set>

#include "bench/settings/json_file.hpp"
#include "bench/settings/orbit.hpp"
#include "renderers/scene/triangle_reader.hpp"
#include "structures/generators/analytic_fields.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using Names = std::vector<std::string_view>;
/// One value for each key of an object whose values may be axes.
using Choice = std::vector<std::pair<std::string, JsonNode>>;

constexpr int kMaxPictureEdge = 16384;
constexpr int kMaxFrames = 1000000;
constexpr int kMostLevel = 63;
constexpr double kAnyNumber = std::numeric_limits<double>::max();

constexpr auto kAvailableRenderKeys = std::to_array<std::string_view>(
    {"mode",     "sampling",     "step",        "width",      "height",      "triangles",        "skip",          "early_end",
     "consumer", "slice_target", "integrator",  "isovalues",  "iso_opacity", "surface_color",    "iso_tolerance", "shading",
     "output",   "color_field",  "point_light", "ambient",    "shadow_step", "level_of_detail",  "max_level",     "tolerance",
     "prune",    "needs",        "clip_planes", "ray_offset", "mirror",      "ambient_occlusion"});
constexpr std::array<std::string_view, 2> kNeeds = {"scene", "all"};
constexpr std::array<std::string_view, 3> kContexts = {"egl", "egl_device", "osmesa"};

/// How many lists deep one value of this key is; what lies deeper is an axis.
int value_depth(std::string_view key) {
  if (key == "extinction" || key == "color" || key == "surface_color" || key == "clip_planes") return 2;
  constexpr std::array<std::string_view, 12> lists = {"point_light", "more_fields", "eye",         "at",
                                                      "up",          "isovalues",   "iso_opacity", "root",
                                                      "ratio",       "skip_levels", "triangles",   "transfer_functions"};
  return std::find(lists.begin(), lists.end(), key) != lists.end() ? 1 : 0;
}

int list_depth(const Json& json) { return !json.is_array() ? 0 : 1 + (json.empty() ? 0 : list_depth(json.front())); }

bool is_axis(std::string_view key, const Json& json) { return list_depth(json) > value_depth(key); }

/// Runs a parser of another part of the program and adds file, line and key to its complaint.
template <class F>
auto located(const JsonNode& node, F&& parse) {
  try {
    return parse();
  } catch (const Error& e) {
    node.fail(e.what());
  }
}

Json to_object(const Choice& choice) {
  Json object = Json::object();
  for (const auto& [key, node] : choice) object[key] = node.json();
  return object;
}

const JsonNode* find(const Choice& choice, std::string_view key) {
  for (const auto& [name, node] : choice)
    if (name == key) return &node;
  return nullptr;
}

/// Drops elements whose text was there before, and keeps the order.
template <class T>
void remove_repeated(std::vector<T>& list, const std::function<std::string(const T&)>& text) {
  std::set<std::string> seen;
  std::erase_if(list, [&](const T& item) { return !seen.insert(text(item)).second; });
}

/// `render_json` without names: a new name is no new measurement.
Json unnamed_render_json(const RenderPoint& render) {
  Json json = render_json(render);
  json.erase("view_name");
  json.erase("transfer_function_name");
  if (!render.settings.prune) json.erase("prune");  // older records keep their names
  if (!render.settings.everything) json.erase("needs");
  if (!render.settings.ray_offset) json.erase("ray_offset");
  if (json.contains("triangles"))
    for (Json& object : json["triangles"]) object.erase("file");
  return json;
}

class Parser {
 public:
  Parser(const JsonFile& file, bool scene) : file_(file), root_(file.root()), scene_(scene) { experiment_.file = file.path(); }

  Experiment parse() {
    accept_root_keys();
    parse_name();
    parse_datasets();
    parse_builds();
    parse_renders();
    parse_reference();
    parse_measuring();
    if (scene_) require_one_point();
    return std::move(experiment_);
  }

 private:
  void accept_root_keys() const {
    Names keys = {"name",       "datasets", "encodings",     "filters",           "storage",
                  "filtering",  "render",   "views",         "transfer_function", "frames",
                  "warm_up",    "seed",     "reference",     "context",           "memory_limit",
                  "check",      "baseline", "explain_error", "explain_left_out",  "transfer_functions",
                  "time_change"};
    if (scene_) keys.push_back("region");
    root_.accept_keys(keys);
  }

  /// The values of an axis, or the one value; remembers where axes are.
  std::vector<JsonNode> values(std::string_view key, const JsonNode& node) {
    if (!is_axis(key, node.json())) return {node};
    const std::vector<JsonNode> items = node.items();
    if (items.size() > 1) experiment_.axes.push_back(node.place());
    return items;
  }

  std::vector<JsonNode> values(std::string_view key) {
    const auto node = root_.find(key);
    return node ? values(key, *node) : std::vector<JsonNode>();
  }

  /// All combinations of the axes among the members; the last one varies fastest.
  std::vector<Choice> combinations(const JsonNode& object, std::span<const std::string_view> except = {}) {
    std::vector<Choice> all = {{}};
    for (const auto& [key, node] : object.members()) {
      if (std::find(except.begin(), except.end(), key) != except.end()) continue;
      std::vector<Choice> next;
      const std::vector<JsonNode> items = values(key, node);
      for (const Choice& choice : all)
        for (const JsonNode& item : items) {
          next.push_back(choice);
          next.back().emplace_back(key, item);
        }
      all = std::move(next);
    }
    return all;
  }

  void parse_name() {
    const auto name = root_.find("name");
    if (!name && !scene_) root_.require("name");
    experiment_.name = name ? name->text() : file_.path().stem().string();
    if (experiment_.name.empty()) name->fail("an empty name");
  }

  // --- data sets ---

  void parse_datasets() {
    root_.require("datasets");
    for (const JsonNode& node : values("datasets")) {
      node.accept_keys(Names{"name", "file", "field", "generate"});
      const auto generate = node.find("generate");
      if (node.find("file").has_value() == generate.has_value()) node.fail("one of the keys 'file' and 'generate' is needed");
      if (generate)
        parse_generated(node, *generate);
      else
        parse_files(node);
    }
  }

  void parse_generated(const JsonNode& node, const JsonNode& generate) {
    if (const auto field = node.find("field")) field->fail("a generated data set has one field; its name goes into 'generate'");
    for (const JsonNode& specification : generate.items())
      for (const Choice& choice : combinations(specification)) {
        DatasetSource source;
        source.generate = to_object(choice);
        const auto name = node.find("name");
        source.name = (name ? name->text() : field_name(source.generate)) + axis_values(specification, choice);
        experiment_.datasets.push_back(std::move(source));
      }
  }

  /// The values of one point along the axes of a specification: " levels=4 seed=2".
  static std::string axis_values(const JsonNode& specification, const Choice& choice) {
    std::string text;
    for (const auto& [key, node] : choice)
      if (key != "field" && is_axis(key, specification.find(key)->json())) text += fmt::format(" {}={}", key, node.json().dump());
    return text;
  }

  /// A field is written as its type, or as an object that holds its type.
  static std::string field_name(const Json& specification) {
    if (specification.contains("name") && specification["name"].is_string()) return specification["name"].get<std::string>();
    const Json field = specification.value("field", Json());
    const Json type = field.is_object() ? field.value("type", Json()) : field;
    return type.is_string() ? type.get<std::string>() : "generated";
  }

  void parse_files(const JsonNode& node) {
    for (const Choice& choice : combinations(node)) {
      DatasetSource source;
      const JsonNode& file = *find(choice, "file");
      source.file = existing_path(file);
      source.written = file.text();
      if (const JsonNode* field = find(choice, "field"); field != nullptr && !field->json().is_null())
        source.field = field->text();
      const JsonNode* name = find(choice, "name");
      source.name = name != nullptr ? name->text() : file_name(*source.file);
      experiment_.datasets.push_back(std::move(source));
    }
  }

  static std::string file_name(const std::filesystem::path& path) {
    const auto name = path.filename();
    return (name.empty() ? path.parent_path().filename() : name).string();  // a folder may end in a slash
  }

  std::filesystem::path existing_path(const JsonNode& node) const {
    const std::filesystem::path given = node.text();
    const std::filesystem::path beside = file_.path().parent_path() / given;  // `given` where that is absolute
    std::error_code ignored;
    if (!given.empty() && std::filesystem::exists(beside, ignored)) return beside;
    if (!given.empty() && std::filesystem::exists(given, ignored)) return given;
    node.fail(given.is_absolute() ? fmt::format("no such file or folder: {}", given.string())
                                  : fmt::format("no such file or folder: neither {} nor {}", beside.string(),
                                                (std::filesystem::current_path(ignored) / given).string()));
  }

  // --- builds ---

  /// What encodings are built for: each list of the file, or an encoding's own.
  struct BuildAxes {
    std::vector<Filter> filters;
    std::vector<Storage> storages;
    std::vector<Filtering> filterings;
  };
  static constexpr std::array<std::string_view, 3> kBuildAxes = {"filters", "storage", "filtering"};

  BuildAxes build_axes(const JsonNode& node, const BuildAxes& otherwise) {
    return {parsed_values<Filter>(node, "filters", otherwise.filters, parse_filter),
            parsed_values<Storage>(node, "storage", otherwise.storages, parse_storage),
            parsed_values<Filtering>(node, "filtering", otherwise.filterings, parse_filtering)};
  }

  template <class T>
  std::vector<T> parsed_values(const JsonNode& object, std::string_view key, const std::vector<T>& otherwise,
                               T (*from_name)(std::string_view)) {
    const auto node = object.find(key);
    if (!node) return otherwise;
    std::vector<T> parsed;
    for (const JsonNode& item : values(key, *node)) parsed.push_back(located(item, [&] { return from_name(item.text()); }));
    return parsed;
  }

  void parse_builds() {
    root_.require("encodings");
    const BuildAxes axes = build_axes(root_, {{Filter::nearest}, {Storage::r32f}, {Filtering::hardware}});
    std::vector<BuildPoint> builds;
    for (const JsonNode& node : values("encodings")) parse_encoding_axes(node, axes, builds);
    for (std::size_t dataset = 0; dataset < experiment_.datasets.size(); ++dataset)
      for (BuildPoint build : builds) {
        build.dataset = dataset;
        experiment_.builds.push_back(build);
      }
    remove_repeated<BuildPoint>(experiment_.builds, [](const BuildPoint& b) {
      return fmt::format("{} {} {} {} {} {}", b.dataset, b.encoding, b.parameters.dump(), filter_name(b.filter),
                         format_name(b.storage), filtering_name(b.filtering));
    });
  }

  void parse_encoding_axes(const JsonNode& node, const BuildAxes& general, std::vector<BuildPoint>& builds) {
    node.members();
    node.require("name");
    const BuildAxes axes = build_axes(node, general);
    for (const Choice& choice : combinations(node, kBuildAxes)) {
      BuildPoint build = parse_encoding(node, choice);
      for (const Filter filter : axes.filters)
        for (const Storage storage : axes.storages)
          for (const Filtering filtering : axes.filterings) {
            build.filter = filter;
            build.storage = storage;
            build.filtering = filter == Filter::nearest ? Filtering::manual : filtering;
            builds.push_back(build);
          }
    }
  }

  static BuildPoint parse_encoding(const JsonNode& node, const Choice& choice) {
    BuildPoint build;
    const JsonNode& name = *find(choice, "name");
    build.encoding = name.text();
    const Encoding* encoding = located(name, [&] { return &find_encoding(build.encoding); });
    accept_parameters(*encoding, choice);
    Json given = to_object(choice);
    given.erase("name");
    build.parameters = located(node, [&] { return complete_parameters(*encoding, given); });
    return build;
  }

  /// Here rather than in complete_parameters alone, for the line of the key.
  static void accept_parameters(const Encoding& encoding, const Choice& choice) {
    const std::vector<ParameterInfo> parameters = encoding.parameters();
    Names known = {"name"};
    known.insert(known.end(), kBuildAxes.begin(), kBuildAxes.end());
    for (const ParameterInfo& p : parameters) known.push_back(p.name);
    for (const auto& [key, node] : choice)
      if (std::find(known.begin(), known.end(), key) == known.end())
        node.fail(fmt::format("encoding {} has no such parameter; accepted: {}{}", encoding.name(), fmt::join(known, ", "),
                              suggestion(key, known)));
  }

  // --- render points ---

  void parse_renders() {
    const std::vector<RenderPoint> settings = parse_settings();
    const std::vector<RenderPoint> views = parse_views();
    const std::vector<RenderPoint> functions = parse_transfer_functions();
    for (const RenderPoint& point : settings)
      if (point.settings.prune && functions.size() > 1)
        (root_.find("transfer_function") ? root_.find("transfer_function") : root_.find("transfer_functions"))
            ->fail("with 'prune' the transfer function may not change: what one hides another may show; accepted: one");
    for (const RenderPoint& view : views)
      for (const RenderPoint& function : functions)
        for (RenderPoint render : settings) {
          render.view = view.view;
          render.view_name = view.view_name;
          if (uses_transfer_function(render.settings)) {
            render.transfer_function = function.transfer_function;
            render.transfer_function_name = function.transfer_function_name;
          }
          if (render.settings.draws_volume()) {  // other modes draw the first field alone
            render.more_fields = function.more_fields;
            if (const auto node = root_.find("transfer_functions"))
              located(*node, [&] { validate_fields(scene_of(experiment_, render)); });
          }
          add_measured(render);
        }
    remove_repeated<RenderPoint>(experiment_.renders, [](const RenderPoint& r) {
      return fmt::format("{} {} {}", unnamed_render_json(r).dump(), r.frames, r.warm_up);
    });
  }

  void add_measured(RenderPoint render) {
    for (const int frames : counts("frames", 1, render.frames))
      for (const int warm_up : counts("warm_up", 0, render.warm_up)) {
        render.frames = frames;
        render.warm_up = warm_up;
        experiment_.renders.push_back(render);
      }
  }

  std::vector<int> counts(std::string_view key, int least, int otherwise) const {
    const auto node = root_.find(key);
    if (!node) return {otherwise};
    std::vector<int> counts;
    for (const JsonNode& item : node->items()) counts.push_back(static_cast<int>(item.integer(least, kMaxFrames)));
    return counts;
  }

  std::vector<RenderPoint> parse_settings() {
    const auto node = root_.find("render");
    if (!node) return {RenderPoint{}};
    std::vector<RenderPoint> points;
    for (const JsonNode& render : node->items()) {
      render.accept_keys(kAvailableRenderKeys);
      for (const Choice& choice : combinations(render)) points.push_back(parse_setting(choice));
    }
    return points;
  }

  RenderPoint parse_setting(const Choice& choice) {
    RenderPoint point;
    for (const auto& [key, node] : choice) set(point, key, node);
    if (const JsonNode* node = find(choice, "triangles")) point.settings.triangles = triangles(*node);
    finish_integrator(point.settings, choice);
    if (!point.settings.draws_volume()) point.settings.early_end.reset();                    // no opacity to end at
    if (!point.settings.draws_slices()) point.settings.slice_target = SliceTarget::rgba32f;  // nothing is blended there
    if (point.settings.draws_surfaces())
      finish_surfaces(point.settings.isosurfaces, choice);
    else
      point.settings.isosurfaces = {};  // other modes have no use for it
    set_light(point.settings, choice);
    if (const JsonNode* mirror = find(choice, "mirror")) located(*mirror, [&] { validate_mirror(point.settings); });
    if (const JsonNode* node = find(choice, "triangles")) located(*node, [&] { validate_triangles(point.settings); });
    if (const JsonNode* offset = find(choice, "ray_offset")) located(*offset, [&] { validate_ray_offset(point.settings); });
    if (point.settings.prune) require_prunable(point.settings, *find(choice, "prune"));
    return point;
  }

  /// Complaints name the key they are about.
  static void set_light(RenderSettings& s, const Choice& choice) {
    const JsonNode* position = find(choice, "point_light");
    const bool lit = position != nullptr && !position->json().is_null();
    for (const char* key : {"ambient", "shadow_step"})
      if (const JsonNode* node = find(choice, key); node != nullptr && !lit)
        node->fail("belongs to the key 'point_light', which accepts three numbers [x, y, z]");
    if (!lit) return;
    const std::vector<double> p = numbers(*position);
    if (!position->json().is_array() || p.size() != 3) position->fail("accepted: three numbers [x, y, z]");
    PointLight& light = s.point_light.emplace();
    light.position = {p[0], p[1], p[2]};
    if (const JsonNode* node = find(choice, "ambient")) light.ambient = node->number(0, 1);
    if (const JsonNode* node = find(choice, "shadow_step")) light.shadow_step = node->positive_number();
    located(*position, [&] { validate_light(s); });
  }

  /// A tolerance without integrator asks for the one that knows it; others have no use for it, as that has none for a step.
  static void finish_integrator(RenderSettings& s, const Choice& choice) {
    const JsonNode* tolerance = find(choice, "tolerance");
    const JsonNode* integrator = find(choice, "integrator");
    if (tolerance != nullptr && integrator == nullptr) s.integrator = Integrator::tolerance;
    if (s.integrator != Integrator::tolerance) s.tolerance = RenderSettings{}.tolerance;
    if (s.integrator == Integrator::tolerance) s.step = RenderSettings{}.step;
    try {
      validate_integrator(s);
    } catch (const Error& e) {
      (integrator != nullptr ? integrator : tolerance)->fail(e.what());
    }
  }

  /// What is not built cannot be seen later.
  static void require_prunable(const RenderSettings& s, const JsonNode& prune) {
    located(prune, [&] { validate_prune(s); });
  }

  /// One opacity stands for all isovalues; complaints name the key they are about.
  static void finish_surfaces(Isosurfaces& iso, const Choice& choice) {
    if (iso.opacity.size() == 1) iso.opacity.resize(iso.values.size(), iso.opacity.front());
    try {
      validate(iso);
    } catch (const Error& e) {
      for (const auto& [key, node] : choice)
        if (std::string_view(e.what()).find("'" + key + "'") != std::string_view::npos) node.fail(e.what());
      find(choice, "mode")->fail(e.what());
    }
  }

  /// Colour of the volume, and of surfaces that have no colours of their own.
  static bool uses_transfer_function(const RenderSettings& s) {
    return s.draws_volume() || (s.draws_surfaces() && s.isosurfaces.color.empty() && s.isosurfaces.output == Output::color);
  }

  static std::vector<double> numbers(const JsonNode& node) {
    std::vector<double> numbers;
    for (const JsonNode& item : node.items()) numbers.push_back(item.number(-kAnyNumber, kAnyNumber));
    return numbers;
  }

  /// Points [value, r, g, b].
  static std::vector<TransferFunction::ColorPoint> color_points(const JsonNode& node) {
    std::vector<TransferFunction::ColorPoint> points;
    for (const JsonNode& item : node.items()) {
      const std::vector<double> p = numbers(item);
      if (p.size() != 4) item.fail("accepted: points [value, r, g, b]");
      points.push_back({p[0], {p[1], p[2], p[3]}});
    }
    return points;
  }

  static AmbientOcclusion occlusion(const JsonNode& node) {
    node.accept_keys(Names{"rays", "radius", "seed"});
    AmbientOcclusion around;
    around.radius = node.require("radius").positive_number();
    if (const auto rays = node.find("rays")) around.rays = static_cast<int>(rays->integer(1, kMostOcclusionRays));
    if (const auto seed = node.find("seed")) around.seed = static_cast<std::uint32_t>(seed->integer(0, UINT32_MAX));
    return around;
  }

  static void set_surfaces(Isosurfaces& iso, const std::string& key, const JsonNode& node) {
    if (key == "isovalues") iso.values = numbers(node);
    if (key == "iso_opacity") iso.opacity = numbers(node);
    if (key == "surface_color") iso.color = color_points(node);
    if (key == "iso_tolerance") iso.tolerance = node.positive_number();
    if (key == "shading") iso.shading = located(node, [&] { return parse_shading(node.text()); });
    if (key == "output") iso.output = located(node, [&] { return parse_output(node.text()); });
    if (key == "ambient_occlusion" && !node.json().is_null()) iso.ambient_occlusion = occlusion(node);
    if (key == "color_field" && !node.json().is_null()) iso.color_field = node.text();
  }

  /// {"file", "color"}, or a list of them.
  std::vector<TriangleObject> triangles(const JsonNode& node) {
    std::vector<TriangleObject> objects;
    if (node.json().is_null() || (node.json().is_array() && node.json().empty())) return objects;
    for (const JsonNode& item : node.items()) {
      item.accept_keys(Names{"file", "color"});
      TriangleObject& object = objects.emplace_back();
      const JsonNode file = item.require("file");
      object.file = file.text();
      object.mesh = triangle_mesh(file);
      const auto color = item.find("color");
      if (!color) continue;
      const std::vector<JsonNode> rgb = color->items();
      if (!color->json().is_array() || rgb.size() != 3) color->fail("accepted: [r, g, b], each from 0 to 1");
      object.color = {rgb[0].number(0, 1), rgb[1].number(0, 1), rgb[2].number(0, 1)};
    }
    return objects;
  }

  /// Each file is read once, however many points draw it.
  std::shared_ptr<const TriangleMesh> triangle_mesh(const JsonNode& node) {
    const std::filesystem::path path = existing_path(node);
    std::shared_ptr<const TriangleMesh>& mesh = triangle_meshes_[path.string()];
    if (!mesh) located(node, [&] { mesh = std::make_shared<const TriangleMesh>(read_triangles(path)); });
    return mesh;
  }

  /// Planes [a, b, c, d].
  static std::vector<ClipPlane> clip_planes(const JsonNode& node) {
    std::vector<ClipPlane> planes;
    if (node.json().is_null() || (node.json().is_array() && node.json().empty())) return planes;
    for (const JsonNode& item : node.items()) {
      const std::vector<double> p = numbers(item);
      if (p.size() != 4) item.fail("accepted: planes [a, b, c, d], which keep a x + b y + c z >= d in world units");
      planes.push_back({{p[0], p[1], p[2]}, p[3]});
    }
    located(node, [&] { validate_clip_planes(planes); });
    return planes;
  }

  static double tolerance_of(const JsonNode& node) {
    const double tolerance = node.positive_number();
    if (tolerance > 1) node.fail(fmt::format("{} is more than a channel holds; accepted: a number in (0, 1]", tolerance));
    return tolerance;
  }

  static void set(RenderPoint& point, const std::string& key, const JsonNode& node) {
    RenderSettings& s = point.settings;
    set_surfaces(s.isosurfaces, key, node);
    if (key == "mode") s.mode = located(node, [&] { return parse_mode(node.text()); });
    if (key == "sampling") s.sampling = located(node, [&] { return parse_sampling(node.text()); });
    if (key == "clip_planes") s.clip_planes = clip_planes(node);
    if (key == "ray_offset" && node.boolean()) s.ray_offset = 0;  // its seed is the experiment's
    if (key == "mirror" && !node.json().is_null()) s.mirror = located(node, [&] { return parse_mirror(node.text()); });
    if (key == "step") s.step = node.positive_number();
    if (key == "width") s.width = static_cast<int>(node.integer(1, kMaxPictureEdge));
    if (key == "height") s.height = static_cast<int>(node.integer(1, kMaxPictureEdge));
    if (key == "skip") s.skip = node.boolean();
    if (key == "prune") s.prune = node.boolean();
    if (key == "needs") s.everything = node.one_of(kNeeds) == "all";
    if (key == "early_end" && !node.json().is_null()) s.early_end = node.number(0, 1);
    if (key == "consumer") s.consumer = located(node, [&] { return parse_consumer(node.text()); });
    if (key == "slice_target") s.slice_target = located(node, [&] { return parse_slice_target(node.text()); });
    if (key == "level_of_detail" && !node.json().is_null()) s.level_of_detail = node.positive_number();
    if (key == "max_level" && !node.json().is_null()) s.max_level = static_cast<int>(node.integer(0, kMostLevel));
    if (key == "integrator") s.integrator = located(node, [&] { return parse_integrator(node.text()); });
    if (key == "tolerance") s.tolerance = tolerance_of(node);
  }

  /// Where the parser of views or transfer functions complains about a combination.
  static JsonNode culprit(const JsonNode& object, const std::string& message) {
    for (const auto& [key, node] : object.members())
      if (message.find("'" + key + "'") != std::string::npos) return node;
    return object;
  }

  /// Calls use(object without its name, name) for every combination of an object's axes;
  /// names that stand for several combinations get a number.
  template <class F>
  void for_each_named(const JsonNode& object, const std::string& otherwise, F&& use) {
    const std::vector<Choice> choices = combinations(object);
    for (std::size_t i = 0; i < choices.size(); ++i) {
      Json json = to_object(choices[i]);
      json.erase("name");
      const JsonNode* given = find(choices[i], "name");
      std::string name = given != nullptr ? given->text() : otherwise;
      if (choices.size() > 1) name += fmt::format(".{}", i + 1);
      try {
        use(json, name);
      } catch (const Error& e) {
        culprit(object, e.what()).fail(e.what());
      }
    }
  }

  std::vector<RenderPoint> parse_views() {
    root_.require("views");
    std::vector<RenderPoint> points;
    const std::vector<JsonNode> nodes = values("views");
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for_each_named(nodes[i], fmt::format("view {}", i + 1), [&](const Json& json, const std::string& name) {
        const auto views = orbit_views(json, name);
        if (views.size() > 1) experiment_.axes.push_back(nodes[i].place() + ".orbit");
        for (const auto& [view, view_name] : views) {
          RenderPoint point;
          point.view = parse_view(view);
          camera_frame(point.view, 1, 1);  // throws where the view is degenerate
          point.view_name = view_name;
          points.push_back(point);
        }
      });
    return points;
  }

  /// Lists of transfer functions, each of a field: one list, or an axis of them.
  std::vector<RenderPoint> parse_functions_of_fields(const JsonNode& key) {
    if (const auto other = root_.find("transfer_function"))
      other->fail("with 'transfer_functions' beside it; accepted: one of both");
    std::vector<RenderPoint> points;
    const std::vector<JsonNode> lists = values("transfer_functions", key);
    for (std::size_t i = 0; i < lists.size(); ++i) {
      RenderPoint point = parse_functions(lists[i]);
      point.transfer_function_name = fmt::format("transfer functions {}", i + 1);
      points.push_back(std::move(point));
    }
    return points;
  }

  /// [{"field": name, "extinction": ..., "color": ...}, ...]; the first belongs to the field of the data sets.
  RenderPoint parse_functions(const JsonNode& list) {
    RenderPoint point;
    std::vector<std::string> names;
    for (const JsonNode& node : list.items()) {
      const JsonNode field = node.require("field");
      if (std::find(names.begin(), names.end(), field.text()) != names.end())
        field.fail(fmt::format("'{}' has a transfer function already; accepted: each field once", field.text()));
      Json json = node.json();
      json.erase("field");
      const TransferFunction tf = parse_field_function(node, json);
      if (names.empty()) {
        point.transfer_function = tf;
        draw_first(field);
      } else {
        point.more_fields.push_back({field.text(), tf});
      }
      names.push_back(field.text());
    }
    return point;
  }

  static TransferFunction parse_field_function(const JsonNode& node, const Json& json) {
    try {
      return parse_transfer_function(json);
    } catch (const Error& e) {
      culprit(node, e.what()).fail(e.what());
    }
  }

  /// The field of the first transfer function is the data sets' own.
  void draw_first(const JsonNode& field) {
    for (DatasetSource& source : experiment_.datasets) {
      const std::string name = source.file ? source.field.value_or(field.text()) : analytic_field_type(source.generate);
      if (name != field.text())
        field.fail(
            fmt::format("the data set {} draws the field '{}', to which the first transfer function belongs; accepted: '{}'",
                        source.name, name, name));
      if (source.file) source.field = name;
    }
  }

  std::vector<RenderPoint> parse_transfer_functions() {
    if (const auto several = root_.find("transfer_functions")) return parse_functions_of_fields(*several);
    if (!root_.find("transfer_function")) {
      require_no_transfer_function();
      return {RenderPoint{}};
    }
    std::vector<RenderPoint> points;
    const std::vector<JsonNode> nodes = values("transfer_function");
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for_each_named(nodes[i], fmt::format("transfer function {}", i + 1), [&](const Json& json, const std::string& name) {
        RenderPoint point;
        point.transfer_function = parse_transfer_function(json);
        validate(point.transfer_function);
        point.transfer_function_name = name;
        points.push_back(point);
      });
    return points;
  }

  void require_no_transfer_function() {
    for (const RenderPoint& point : parse_settings())
      if (point.settings.draws_volume())
        root_.fail(
            "the key 'transfer_function' is missing: a volume needs {\"extinction\": [[value, extinction], ...], "
            "\"color\": [[value, r, g, b], ...]}");
  }

  // --- the rest ---

  void parse_reference() {
    const auto node = root_.find("reference");
    if (!node) return;
    if (node->json().is_null()) {
      experiment_.reference.reset();
      return;
    }
    node->accept_keys(Names{"step", "filter", "own", "shading"});
    if (const auto shading = node->find("shading"); shading && !shading->json().is_null())
      experiment_.reference->shading = located(*shading, [&] { return parse_shading(shading->text()); });
    if (const auto step = node->find("step")) experiment_.reference->step = step->positive_number();
    if (const auto filter = node->find("filter")) experiment_.reference->common_filter = parse_common_filter(*filter);
    if (const auto own = node->find("own")) {
      experiment_.reference->own = own->boolean();
      if (!experiment_.reference->own && !experiment_.reference->common_filter)
        own->fail("without the own reference and with 'filter' own there is no reference; accepted: true, or another 'filter'");
    }
  }

  static std::optional<Filter> parse_common_filter(const JsonNode& node) {
    Names accepted = {"own"};
    for (const Filter filter : all_filters()) accepted.push_back(filter_name(filter));
    const std::string name = node.one_of(accepted);
    if (name == "own") return std::nullopt;
    return parse_filter(name);
  }

  void parse_measuring() {
    if (const auto seed = root_.find("seed")) experiment_.seed = static_cast<std::uint64_t>(seed->integer(0, INT64_MAX));
    for (RenderPoint& render : experiment_.renders)
      if (render.settings.ray_offset)
        render.settings.ray_offset = static_cast<std::uint32_t>(experiment_.seed ^ experiment_.seed >> 32);
    if (const auto context = root_.find("context")) experiment_.context = context->one_of(kContexts);
    if (const auto limit = root_.find("memory_limit"); limit && !limit->json().is_null())
      experiment_.memory_limit = limit->integer(1, INT64_MAX);
    if (const auto check = root_.find("check"); check && !check->json().is_null()) parse_check(*check);
    if (const auto baseline = root_.find("baseline")) experiment_.baseline = baseline->boolean();
    if (const auto explain = root_.find("explain_error")) {
      experiment_.explain_error = explain->boolean();
      if (experiment_.explain_error && !experiment_.reference)
        explain->fail("a picture without a reference has no error to explain");
      if (experiment_.explain_error && !experiment_.reference->own)
        explain->fail(
            "what is explained is the error against the own reference; accepted: false where 'reference' has 'own' false");
    }
    if (experiment_.explain_error && experiment_.reference->shading)
      root_.find("explain_error")
          ->fail("the causes are those of the picture's own shading; accepted: 'reference' without 'shading'");
    if (const auto explain = root_.find("explain_left_out")) experiment_.explain_left_out = explain->boolean();
    if (const auto change = root_.find("time_change")) experiment_.time_change = change->boolean();
    if (const auto region = root_.find("region")) parse_region(*region);
  }

  /// {"psnr_db": number, "why": text}, or {"off": why}.
  void parse_check(const JsonNode& node) {
    node.accept_keys(Names{"psnr_db", "why", "off"});
    const auto bound = node.find("psnr_db"), why = node.find("why"), off = node.find("off");
    if (bound.has_value() == off.has_value())
      node.fail("one of the keys 'psnr_db' (a bound of your own) and 'off' (why pictures are not checked) is needed");
    if (experiment_.reference && !experiment_.reference->own)
      node.fail("pictures are checked against their own reference; accepted: null where 'reference' has 'own' false");
    if (off) {
      if (why) why->fail("belongs to 'psnr_db'; accepted: the reason as the value of 'off'");
      if (off->text().empty()) off->fail("accepted: the reason why pictures are not checked");
      experiment_.unchecked_because = off->text();
      return;
    }
    experiment_.minimum_psnr_db = bound->number(0, 1000);
    if (why) experiment_.check_why = why->text();
  }

  /// {"lower": [x, y, z], "upper": [x, y, z]}, or the two corners as a list.
  void parse_region(const JsonNode& node) {
    std::array<Vec3d, 2> region;
    if (node.json().is_object()) {
      node.accept_keys(Names{"lower", "upper"});
      region = {parse_corner(node.require("lower")), parse_corner(node.require("upper"))};
    } else {
      const std::vector<JsonNode> corners = node.items();
      if (corners.size() != 2) node.fail("{\"lower\": [x, y, z], \"upper\": [x, y, z]} is expected, in world units");
      region = {parse_corner(corners[0]), parse_corner(corners[1])};
    }
    for (int axis = 0; axis < 3; ++axis)
      if (!(region[0][axis] < region[1][axis])) node.fail("the lower corner must lie below the upper one along every axis");
    experiment_.region = region;
  }

  static Vec3d parse_corner(const JsonNode& node) {
    const std::vector<JsonNode> items = node.items();
    if (items.size() != 3) node.fail("three numbers [x, y, z] are expected, in world units");
    constexpr double kLargest = std::numeric_limits<double>::max();
    return {items[0].number(-kLargest, kLargest), items[1].number(-kLargest, kLargest), items[2].number(-kLargest, kLargest)};
  }

  void require_one_point() const {
    if (experiment_.points() == 1) return;
    root_.fail(fmt::format("a scene file describes one picture, this one {}; lists with several values: {}", experiment_.points(),
                           fmt::join(experiment_.axes, ", ")));
  }

  const JsonFile& file_;
  JsonNode root_;
  bool scene_;
  Experiment experiment_;
  std::map<std::string, std::shared_ptr<const TriangleMesh>> triangle_meshes_;
};

Json json_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

}  // namespace

Experiment parse_experiment(std::string text, const std::filesystem::path& path) {
  const JsonFile file(std::move(text), path);
  return Parser(file, false).parse();
}

Experiment read_experiment(const std::filesystem::path& path) {
  const JsonFile file = JsonFile::read(path);
  return Parser(file, false).parse();
}

Experiment parse_scene(std::string text, const std::filesystem::path& path) {
  const JsonFile file(std::move(text), path);
  return Parser(file, true).parse();
}

Experiment read_scene(const std::filesystem::path& path) {
  const JsonFile file = JsonFile::read(path);
  return Parser(file, true).parse();
}

Scene scene_of(const Experiment& experiment, const RenderPoint& render) {
  return Scene{render.view, render.transfer_function, render.settings, experiment.region, render.more_fields};
}

Json surfaces_json(const Isosurfaces& iso) {
  Json json;
  json["isovalues"] = iso.values;
  json["iso_opacity"] = iso.opacity.empty() ? std::vector<double>(iso.values.size(), 1.0) : iso.opacity;
  json["surface_color"] = nullptr;
  for (const auto& p : iso.color) json["surface_color"].push_back({p.value, p.rgb.r, p.rgb.g, p.rgb.b});
  json["color_field"] = iso.color_field.empty() ? Json() : Json(iso.color_field);
  json["iso_tolerance"] = iso.tolerance;
  json["shading"] = shading_name(iso.shading);
  json["output"] = output_name(iso.output);
  if (const auto& around = iso.ambient_occlusion)
    json["ambient_occlusion"] = {{"rays", around->rays}, {"radius", around->radius}, {"seed", around->seed}};
  return json;
}

Json light_json(const PointLight& light) {
  const Vec3d& p = light.position;
  return {{"point_light", {p.x, p.y, p.z}}, {"ambient", light.ambient}, {"shadow_step", light.shadow_step}};
}

Json clip_planes_json(const std::vector<ClipPlane>& planes) {
  Json json = Json::array();
  for (const ClipPlane& p : planes) json.push_back({p.normal.x, p.normal.y, p.normal.z, p.distance});
  return json;
}

Json triangles_json(const std::vector<TriangleObject>& objects) {
  Json json = Json::array();
  for (const TriangleObject& o : objects)
    json.push_back({{"hash", o.mesh->content_hash()},
                    {"triangles", o.mesh->triangles().size()},
                    {"color", {o.color.r, o.color.g, o.color.b}}});
  return json;
}

Json render_json(const RenderPoint& render) {
  const RenderSettings& s = render.settings;
  const bool by_tolerance = s.integrator == Integrator::tolerance;
  Json json = {{"consumer", consumer_name(s.consumer)},
               {"mode", mode_name(s.mode)},
               {"sampling", sampling_name(s.sampling)},
               {"step", by_tolerance ? Json() : Json(s.step)},
               {"integrator", integrator_name(s.integrator)},
               {"width", s.width},
               {"height", s.height},
               {"skip", s.skip},
               {"prune", s.prune},
               {"needs", s.everything ? "all" : "scene"},
               {"early_end", json_or_null(s.early_end)},
               {"ray_offset", s.ray_offset.has_value()},
               {"view", to_json(render.view)},
               {"view_name", render.view_name},
               {"transfer_function", nullptr},
               {"transfer_function_name", nullptr}};
  if (s.draws_slices()) json["slice_target"] = slice_target_name(s.slice_target);
  if (by_tolerance) json["tolerance"] = s.tolerance;
  if (s.draws_surfaces()) json.update(surfaces_json(s.isosurfaces));
  if (s.point_light) json.update(light_json(*s.point_light));
  // only where they are in use, so that the names of other records stay
  if (s.mirror) json["mirror"] = mirror_name(*s.mirror);
  if (s.ray_offset) json["seed"] = *s.ray_offset;
  if (!s.clip_planes.empty()) json["clip_planes"] = clip_planes_json(s.clip_planes);
  if (!s.triangles.empty()) {
    json["triangles"] = triangles_json(s.triangles);
    for (std::size_t i = 0; i < s.triangles.size(); ++i) json["triangles"][i]["file"] = s.triangles[i].file;
  }
  if (s.level_of_detail) json["level_of_detail"] = *s.level_of_detail;
  if (s.max_level) json["max_level"] = *s.max_level;
  if (!render.transfer_function_name.empty()) {
    json["transfer_function"] = to_json(render.transfer_function);
    json["transfer_function_name"] = render.transfer_function_name;
  }
  if (!render.more_fields.empty()) json["more_transfer_functions"] = to_json(render.more_fields);
  return json;
}

Json point_configuration(const Experiment& experiment, const BuildPoint& build, const RenderPoint& render,
                         std::string_view dataset_hash) {
  Json region, reference;
  if (experiment.region)
    for (const Vec3d& corner : *experiment.region) region.push_back({corner.x, corner.y, corner.z});
  if (experiment.reference) {
    const auto& common = experiment.reference->common_filter;
    reference = {{"step", experiment.reference->step}, {"filter", common ? filter_name(*common) : "own"}};
    if (experiment.explain_error) reference["explain"] = true;  // absent elsewhere: older records keep their names
    if (!experiment.reference->own) reference["own"] = false;   // likewise
    if (experiment.reference->shading) reference["shading"] = shading_name(*experiment.reference->shading);
  }
  Json configuration = {{"experiment", experiment.name},
                        {"dataset", dataset_hash},
                        {"encoding", build.encoding},
                        {"build_parameters", build.parameters},
                        {"filter", filter_name(build.filter)},
                        {"storage", format_name(build.storage)},
                        {"filtering", filtering_name(build.filtering)},
                        {"render", unnamed_render_json(render)},
                        {"region", region},
                        {"frames", render.frames},
                        {"warm_up", render.warm_up},
                        {"seed", experiment.seed},
                        {"reference", reference},
                        {"baseline", experiment.baseline},
                        {"context", experiment.context},
                        {"memory_limit", experiment.memory_limit ? Json(*experiment.memory_limit) : Json()},
                        {"minimum_psnr_db", json_or_null(experiment.minimum_psnr_db)}};
  if (experiment.unchecked_because) configuration["check"] = "off";
  if (experiment.explain_left_out) configuration["explain_left_out"] = true;
  if (experiment.time_change) configuration["time_change"] = true;
  return configuration;
}

}  // namespace amrtex
