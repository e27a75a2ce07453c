#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>

#include <algorithm>
#include <optional>

#include "bench/cli/commands.hpp"
#include "bench/cli/context_arguments.hpp"
#include "bench/cli/render_arguments.hpp"
#include "bench/measure/error_split.hpp"
#include "bench/measure/heat_map.hpp"
#include "bench/measure/picture_look.hpp"
#include "bench/measure/picture_options.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/value_resolution.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/background.hpp"
#include "renderers/scene/color_map.hpp"
#include "renderers/scene/framing.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments : SceneArguments {
  std::string input, output, memory_limit, save_scene, heat;
  ContextArguments context;
  std::vector<std::string> set;
  bool reference = false;
  bool color_bar = false;
  bool no_color_bar = false;
  bool outline = false;
  bool no_outline = false;
  bool transparent = false;
  bool explain_error = false;
  bool prune = false;
  bool json = false;
  std::optional<double> reference_step, reference_tolerance;
  std::optional<double> tolerance;
};

/// What the bar beside a picture shows: the scene's colours, or the map of one number a pixel.
std::vector<PngColor> bar_colors(const ColorPoints& points) {
  std::vector<PngColor> colors;
  for (const auto& p : points) colors.push_back({p.value, {p.rgb.x, p.rgb.y, p.rgb.z}});
  return colors;
}

/// What a picture tells of the mesh that it shows.
struct Shown {
  std::string quantity;
  DomainGeometry geometry;
};

Shown shown(const Scene& scene, const AmrHierarchy& mesh) { return {printable(shown_quantity(scene, mesh)), mesh}; }

void write_picture(const Arguments& a, const Picture& picture, const Scene& scene, const Shown& mesh) {
  const fs::path path = a.output;
  if (path.extension() == ".npy") return write_npy(picture, path, a.reference);
  if (path.extension() == ".exr") return write_exr(picture, path);
  PngOptions options;
  const Vec3d behind = background_for(scene);
  options.background = {behind.x, behind.y, behind.z};
  options.transparent = a.transparent;
  options.color_bar = a.color_bar;
  options.logarithmic =
      scene.settings.picture_channels() == 1 && scene.settings.draws_surfaces() ? false : scene.transfer_function.logarithmic;
  options.title = mesh.quantity;
  const bool named = std::find(color_map_names().begin(), color_map_names().end(), a.color_map) != color_map_names().end();
  options.colors = bar_colors(picture.channels == 1 ? color_map(named ? std::string_view(a.color_map) : "viridis")
                                                    : shown_colors(scene).color);
  if (a.outline)
    for (const auto& [x0, y0, x1, y1] :
         box_edges(mesh.geometry.lower, mesh.geometry.upper, scene.view, picture.width, picture.height))
      options.lines.push_back({x0, y0, x1, y1});
  write_png(without_outside(picture, scene, mesh.geometry), path, options);
}

/// What drawing took, or how far off the picture is, pixel by pixel.
void write_heat(const Arguments& a, Heat heat, const Picture& picture, const DomainGeometry& geometry) {
  const fs::path path = a.output;
  if (path.extension() == ".npy") return write_npy(picture, path, false);
  if (path.extension() == ".exr") return write_exr(picture, path);
  PngOptions options;
  options.background = {1, 1, 1};
  options.color_bar = !a.no_color_bar;
  options.title = heat_name(heat);
  options.colors = bar_colors(color_map(heat == Heat::error ? "cool_warm" : "viridis"));
  if (heat == Heat::level) options.range = {0.0, static_cast<double>(std::max(1, geometry.finest_level()))};
  if (heat == Heat::error) options.range = around_zero(picture);
  write_png(picture, path, options);
}

/// Sum of the causes' squared rmse: what shares are of.
double total_square(const ErrorSplit& split) {
  double sum = 0;
  for (const CauseError& c : split.causes)
    if (c.error) sum += c.error->rmse * c.error->rmse;
  return sum;
}

void print_row(std::string_view cause, const std::optional<ErrorMetrics>& error, const std::string& share) {
  const auto db = [](const ErrorMetrics& e) { return e.psnr_db ? fmt::format("{:.1f}", *e.psnr_db) : std::string("–"); };
  if (error)
    fmt::print("| {} | {:.3g} | {:.3g} | {} | {} |\n", cause, error->rmse, error->max, db(*error), share);
  else
    fmt::print("| {} | – | – | – | – |\n", cause);
}

void print_split(const ErrorSplit& split, const ErrorMetrics& error) {
  const double square = total_square(split);
  fmt::print("| cause | rmse | max | dB | share |\n|---|---:|---:|---:|---:|\n");
  for (const CauseError& c : split.causes)
    print_row(c.cause, c.error,
              c.error && square > 0 ? fmt::format("{:.1f} %", 100 * c.error->rmse * c.error->rmse / square) : "");
  print_row("all", error, "");
  print_row("filter", split.filter, "");
  fmt::print(
      "\nEach row is the difference of two pictures; with their signs they add up to all, to {:.1g}. share: of the sum of the\n"
      "causes' squared rmse. filter: the reference against the analytic field, not part of all.\n",
      split.sum_closes);
}

/// The picture's error by cause, on stdout.
void explain_error(const Arguments& a, const SplitRequest& request) {
  const ErrorSplit split = split_error(request);
  const ErrorMetrics error = compare(request.picture, request.reference);
  if (!a.json) return print_split(split, error);
  Json json = {{"rmse", error.rmse}, {"max", error.max}, {"psnr_db", error.psnr_db ? Json(*error.psnr_db) : Json()}};
  json["split"] = split_json(split);
  fmt::print("{}\n", json.dump());
}

void check_arguments(const Arguments& a) {
  if (a.output.empty() && !a.explain_error && a.save_scene.empty())
    throw UsageError("-o is missing: the picture to write, .png, .exr or .npy");
  if (!a.heat.empty()) parse_heat(a.heat);
  for (const auto& [given, name] :
       {std::pair{a.reference, "--reference"}, {a.explain_error, "--explain-error"}, {a.transparent, "--transparent"}})
    if (!a.heat.empty() && given) throw UsageError(fmt::format("--heat: a picture of its own; leave out {}", name));
  if (a.reference && a.explain_error) throw UsageError("--explain-error: the reference has no error; leave out --reference");
  if (a.json && !a.explain_error) throw UsageError("--json: only with --explain-error, whose table it replaces");
  const std::string extension = fs::path(a.output).extension();
  if (!a.output.empty() && extension != ".png" && extension != ".exr" && extension != ".npy")
    throw UsageError(
        fmt::format("-o {}: accepted: a name ending in .png (to look at), .exr or .npy (floats to measure)", clipped(a.output)));
  if (!a.save_scene.empty() && fs::path(a.save_scene).extension() != ".json")
    throw UsageError(fmt::format("--save-scene {}: accepted: a name ending in .json", clipped(a.save_scene)));
}

/// A scene and the mesh that it draws.
struct Drawn {
  Experiment scene;
  std::optional<AmrHierarchy> read = {};

  /// Read again where it was given back.
  const AmrHierarchy& mesh() {
    if (!read) read = load_dataset(scene, scene.datasets[scene.builds.front().dataset]);
    return *read;
  }
  /// To the system: the allocator would keep what many small patches took.
  void give_back_mesh() {
    read.reset();
    malloc_trim(0);
  }
};

std::vector<std::string> together(std::vector<std::string> first, const std::vector<std::string>& then) {
  first.insert(first.end(), then.begin(), then.end());
  return first;
}

Drawn read_scene_file(const Arguments& a) {
  if (const std::vector<std::string> names = a.of_data_alone(); !names.empty())
    throw UsageError(
        fmt::format("{}: with a scene file, which holds its own view and transfer function; accepted: --set, or the "
                    "data set itself in place of the scene",
                    fmt::join(names, ", ")));
  Experiment scene = read_scene(a.input, {.set = together(a.overrides(), a.set)});
  AmrHierarchy mesh = load_dataset(scene, scene.datasets[scene.builds.front().dataset]);
  return {std::move(scene), std::move(mesh)};
}

/// Does the mesh hold what the scene draws? `--set` may ask for other fields than were read.
bool holds_fields(const AmrHierarchy& mesh, const Experiment& scene) {
  const auto has = [&](const std::string& name) {
    return name.empty() || std::find(mesh.fields().begin(), mesh.fields().end(), name) != mesh.fields().end();
  };
  const RenderPoint& render = scene.renders.front();
  bool all = scene.datasets.front().field == mesh.fields().front() && has(render.settings.isosurfaces.color_field);
  for (const FieldTransfer& other : render.more_fields) all = all && has(other.field);
  return all;
}

Drawn describe_data(const Arguments& a) {
  AmrHierarchy mesh = read_data_set(a.input, a.field);
  const Json json = default_scene(mesh, a.request(a.input, mesh));
  Experiment scene = parse_scene(json.dump(1), fs::path(a.input) / "default_scene", {.set = a.set});
  if (!holds_fields(mesh, scene)) mesh = load_dataset(scene, scene.datasets.front());
  return {std::move(scene), std::move(mesh)};
}

BuildRequest build_request(const Arguments& a, Drawn& d, const Scene& drawn, Context& context) {
  const BuildPoint& build = d.scene.builds.front();
  BuildRequest request;
  request.storage = build.storage;
  request.parameters = build.parameters;
  request.context = context.info();
  request.needs = scene_needs(drawn, build.filter, build.filtering);
  request.more_fields = more_fields(d.mesh(), drawn);
  if (!a.memory_limit.empty())
    request.memory_limit = parse_bytes(a.memory_limit);
  else if (d.scene.memory_limit)
    request.memory_limit = *d.scene.memory_limit;
  return request;
}

/// Is the mesh asked again once the structure is built?
bool compares(const Arguments& a) { return a.explain_error || (!a.heat.empty() && parse_heat(a.heat) == Heat::error); }

void draw(const Arguments& a, Drawn& d, const Scene& drawn, Context& context) {
  const BuildPoint& build = d.scene.builds.front();
  const BuildRequest request = build_request(a, d, drawn, context);
  const Encoding& encoding = find_encoding(build.encoding);
  require_support(encoding, request.context);
  EncodedField field = encoding.build(d.mesh(), request);
  const Shown of_mesh = shown(drawn, d.mesh());
  for (const std::string& warning : value_resolution(field, drawn).warnings()) fmt::print(stderr, "warning: {}\n", warning);
  if (a.reference) {
    write_picture(a,
                  HierarchyReference(d.mesh(), 0, field.definition)
                      .render(drawn, reference_rule(d.scene, a.reference_step, a.reference_tolerance)),
                  drawn, of_mesh);
    return;
  }
  if (!compares(a)) d.give_back_mesh();  // before the context takes as much as the structure has
  const Structure structure(context, std::move(field), request, a.explain_error ? HostArrays::keep : HostArrays::give_back);
  const auto consumer = make_consumer(context, of_mesh.geometry, structure, drawn);
  const Heat heat = a.heat.empty() ? Heat::error : parse_heat(a.heat);
  if (heat != Heat::error) {
    const RenderSettings& s = drawn.settings;
    return write_heat(a, heat, counted_picture(heat, consumer->count_pixels(), s.width, s.height), of_mesh.geometry);
  }
  consumer->draw();
  const Picture picture = consumer->read();
  if (!a.heat.empty()) {
    const HierarchyReference reference(d.mesh(), 0, structure.field.definition);
    return write_heat(
        a, heat,
        error_picture(picture, reference.render(drawn, reference_rule(d.scene, a.reference_step, a.reference_tolerance))),
        of_mesh.geometry);
  }
  if (!a.output.empty()) write_picture(a, picture, drawn, of_mesh);
  if (a.explain_error) {
    const ReferenceRule rule = reference_rule(d.scene, a.reference_step, a.reference_tolerance);
    const Picture reference = HierarchyReference(d.mesh(), 0, structure.field.definition).render(drawn, rule);
    const auto truth = analytic_field(d.scene.datasets[build.dataset]);
    explain_error(a, {d.mesh(), encoding, structure, context, drawn, reference, picture, rule, truth.get()});
  }
}

void save_scene(const Arguments& a, const Drawn& d) {
  if (!a.save_scene.empty())
    write_atomically(a.save_scene, point_experiment(d.scene, d.scene.builds.front(), d.scene.renders.front()).dump(1) + "\n");
}

/// What `--set` and options leave open, the program may choose.
bool free_encoding(const Arguments& a, const Drawn& d) {
  return a.encoding.empty() && a.filter.empty() && d.scene.builds.front().encoding == kFirstChoice;
}

int run(Arguments a) {
  check_arguments(a);
  const bool data = is_data_set(a.input);
  Drawn d = data ? describe_data(a) : read_scene_file(a);
  a.outline = a.outline || (data && !a.no_outline);
  a.color_bar = a.color_bar || (data && !a.no_color_bar);
  if (!a.output.empty() || a.explain_error) {
    Scene drawn = with_tolerance(scene_of(d.scene, d.scene.renders.front()), a.tolerance);
    drawn.settings.prune = drawn.settings.prune || a.prune;
    const auto context = make_context(a.context.choice(d.scene.context));
    for (const std::string& warning : scene_warnings(d.mesh(), drawn)) fmt::print(stderr, "warning: {}\n", printable(warning));
    draw_by_first(d.scene.builds.front(), data && free_encoding(a, d), [&] { draw(a, d, drawn, *context); });
  }
  save_scene(a, d);
  return 0;
}

}  // namespace

void add_render_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("render", "one picture of a data set, or of a scene file");
  c->add_option("input", a->input, "data set; or a scene file: an experiment file without axes (docs/experiments.md)")
      ->required();
  c->add_option("-o,--out", a->output,
                "picture: .png to look at, .exr or .npy for the floats; may be left out with --explain-error or --save-scene");
  add_scene_arguments(*c, *a);
  c->add_option("--save-scene", a->save_scene, "scene file to write of what is drawn: `render` and `run` take it");
  c->add_option(
      "--heat", a->heat,
      fmt::format("{}: in place of the picture, what each pixel took, or picture - reference", fmt::join(heat_names(), ", ")));
  c->add_flag("--transparent", a->transparent, "the picture's own opacity in place of a background (.png)");
  CLI::Option* bar =
      c->add_flag("--color-bar", a->color_bar, "a bar with the colours' values; beside pictures of data sets anyway");
  c->add_flag("--no-color-bar", a->no_color_bar, "the picture alone")->excludes(bar);
  CLI::Option* outline = c->add_flag("--outline", a->outline, "the domain's edges behind the picture; of data sets anyway");
  c->add_flag("--no-outline", a->no_outline, "without them")->excludes(outline);
  add_context_options(*c, a->context, "overrides the scene's");
  c->add_option("--memory-limit", a->memory_limit, "for the structure, as 512MiB");
  add_set_option(*c, a->set);
  c->add_flag("--reference", a->reference, "draw the double-precision reference of the filter instead");
  c->add_option("--reference-tolerance", a->reference_tolerance, "its largest error, of full scale");
  c->add_option("--reference-step", a->reference_step, "instead, a fixed step in widths of the finest cells, to compare with");
  c->add_option("--tolerance", a->tolerance,
                "error asked of every channel, in (0, 1]: the steps follow; volumes, adaptive sampling");
  c->add_flag("--explain-error", a->explain_error, "print the picture's error by cause");
  c->add_flag("--json", a->json, "of --explain-error, for programs");
  c->add_flag("--prune", a->prune, "build nothing that the transfer function hides (mode dvr)");
  c->footer(
      "Example: amrtex render data/amrex_tiny/plt00008 -o picture.png\n"
      "         amrtex render experiments/limits/scene.json -o picture.png");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
