#include <fmt/format.h>

#include "bench/cli/commands.hpp"
#include "bench/measure/error_split.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/value_resolution.hpp"
#include "bench/settings/experiment.hpp"
#include "bench/settings/settings_table.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scene, output, context, memory_limit;
  std::vector<std::string> set;
  bool reference = false;
  bool color_bar = false;
  bool explain_error = false;
  bool prune = false;
  bool json = false;
  std::optional<double> reference_step, reference_tolerance;
  std::optional<double> tolerance;
};

void write_picture(const Arguments& a, const Picture& picture, const Experiment& scene, const AmrHierarchy& mesh) {
  const fs::path path = a.output;
  if (path.extension() == ".npy") {
    write_npy(picture, path, a.reference);
    return;
  }
  PngOptions options;
  options.color_bar = a.color_bar;
  options.logarithmic = scene.renders.front().transfer_function.logarithmic;
  options.unit = mesh.fields().front();
  if (scene.renders.front().settings.mode == Mode::projection) options.unit += " x length";
  write_png(picture, path, options);
}

/// An error asked for replaces the scene's step.
Scene with_tolerance(Scene scene, const std::optional<double>& tolerance) {
  if (!tolerance) return scene;
  scene.settings.integrator = Integrator::tolerance;
  scene.settings.tolerance = *tolerance;
  try {
    for (const char* key : {"tolerance", "integrator"}) validate_setting(scene, key);
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("--tolerance: {}", e.what()));
  }
  return scene;
}

/// Of the command line, else of the scene.
ReferenceRule reference_rule(const Arguments& a, const Experiment& scene) {
  if (a.reference_step && a.reference_tolerance)
    throw UsageError("--reference-step stands in place of --reference-tolerance; accepted: one of both");
  ReferenceSettings settings = scene.reference.value_or(ReferenceSettings{});
  if (a.reference_tolerance) settings.step.reset();
  const auto set = [&](const char* key, const char* option, const std::optional<double>& value) {
    if (!value) return;
    const Setting<ReferenceSettings>& row = *reference_settings().find(key);
    if (const auto problem = value_problem(*value, row.key.type))
      throw UsageError(fmt::format("{} {}: {}", option, *value, problem->text));
    row.set(settings, *value);
  };
  set("step", "--reference-step", a.reference_step);
  set("tolerance", "--reference-tolerance", a.reference_tolerance);
  return settings.rule();
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

int run(const Arguments& a) {
  if (a.output.empty() && !a.explain_error) throw UsageError("-o is missing: the picture to write, .png or .npy");
  if (a.reference && a.explain_error) throw UsageError("--explain-error: the reference has no error; leave out --reference");
  if (a.json && !a.explain_error) throw UsageError("--json: only with --explain-error, whose table it replaces");
  const std::string extension = fs::path(a.output).extension();
  if (!a.output.empty() && extension != ".png" && extension != ".npy")
    throw UsageError(fmt::format("-o {}: accepted: a name ending in .png (to look at) or .npy (floats to measure)", a.output));
  const Experiment scene = read_scene(a.scene, {.set = a.set});
  const BuildPoint& build = scene.builds.front();
  const AmrHierarchy mesh = load_dataset(scene, scene.datasets[build.dataset]);
  Scene drawn = with_tolerance(scene_of(scene, scene.renders.front()), a.tolerance);
  drawn.settings.prune = drawn.settings.prune || a.prune;
  const auto context = make_context(parse_context_kind(a.context.empty() ? scene.context : a.context));
  BuildRequest request;
  request.storage = build.storage;
  request.parameters = build.parameters;
  request.context = context->info();
  request.needs = scene_needs(drawn, build.filter, build.filtering);
  request.more_fields = more_fields(mesh, drawn);
  for (const std::string& warning : scene_warnings(mesh, drawn)) fmt::print(stderr, "warning: {}\n", printable(warning));
  if (!a.memory_limit.empty())
    request.memory_limit = parse_bytes(a.memory_limit);
  else if (scene.memory_limit)
    request.memory_limit = *scene.memory_limit;
  const Encoding& encoding = find_encoding(build.encoding);
  require_support(encoding, request.context);
  EncodedField field = encoding.build(mesh, request);
  for (const std::string& warning : value_resolution(field, drawn).warnings()) fmt::print(stderr, "warning: {}\n", warning);
  if (a.reference) {
    write_picture(a, HierarchyReference(mesh, 0, field.definition).render(drawn, reference_rule(a, scene)), scene, mesh);
    return 0;
  }
  const Structure structure(*context, std::move(field), request);
  const auto consumer = make_consumer(*context, mesh, structure, drawn);
  consumer->draw();
  const Picture picture = consumer->read();
  if (!a.output.empty()) write_picture(a, picture, scene, mesh);
  if (a.explain_error) {
    const ReferenceRule rule = reference_rule(a, scene);
    const Picture reference = HierarchyReference(mesh, 0, structure.field.definition).render(drawn, rule);
    const auto truth = analytic_field(scene.datasets[build.dataset]);
    explain_error(a, {mesh, encoding, structure, *context, drawn, reference, picture, rule, truth.get()});
  }
  return 0;
}

}  // namespace

void add_render_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("render", "one picture of a scene file");
  c->add_option("scene", a->scene, "scene file: an experiment file without axes (docs/experiments.md)")->required();
  c->add_option("-o,--out", a->output, "picture: .png to look at, .npy for the floats; may be left out with --explain-error");
  c->add_option("--context", a->context, "egl, egl_device or osmesa; overrides the scene's");
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
  c->add_flag("--color-bar", a->color_bar, "a bar with the range, for the modes projection and mip");
  c->footer("Example: amrtex render experiments/limits/scene.json -o picture.png");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
