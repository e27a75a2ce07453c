#include <fmt/format.h>

#include "bench/commands.hpp"
#include "bench/experiment.hpp"
#include "bench/runner.hpp"
#include "renderers/hierarchy_reference.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scene, output, context, memory_limit;
  bool reference = false;
  bool color_bar = false;
  double reference_step = 0;
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
RenderPoint with_tolerance(RenderPoint point, const std::optional<double>& tolerance) {
  if (!tolerance) return point;
  point.settings.integrator = Integrator::tolerance;
  point.settings.tolerance = *tolerance;
  try {
    validate_integrator(point.settings);
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("--tolerance: {}", e.what()));
  }
  return point;
}

int run(const Arguments& a) {
  const std::string extension = fs::path(a.output).extension();
  if (extension != ".png" && extension != ".npy")
    throw UsageError(fmt::format("-o {}: accepted: a name ending in .png (to look at) or .npy (floats to measure)", a.output));
  const Experiment scene = read_scene(a.scene);
  const BuildPoint& build = scene.builds.front();
  const AmrHierarchy mesh = load_dataset(scene, scene.datasets[build.dataset]);
  const Scene drawn = scene_of(scene, with_tolerance(scene.renders.front(), a.tolerance));
  const auto context = make_context(parse_context_kind(a.context.empty() ? scene.context : a.context));
  BuildRequest request;
  request.storage = build.storage;
  request.parameters = build.parameters;
  request.context = context->info();
  request.needs = scene_needs(drawn, build.filter, build.filtering);
  request.more_fields = more_fields(mesh, drawn);
  for (const std::string& warning : scene_warnings(mesh, drawn)) fmt::print(stderr, "warning: {}\n", warning);
  if (!a.memory_limit.empty())
    request.memory_limit = parse_bytes(a.memory_limit);
  else if (scene.memory_limit)
    request.memory_limit = *scene.memory_limit;
  const Encoding& encoding = find_encoding(build.encoding);
  require_support(encoding, request.context);
  const EncodedField field = encoding.build(mesh, request);
  if (a.reference) {
    const double step = a.reference_step > 0 ? a.reference_step
                        : scene.reference    ? scene.reference->step
                                             : ReferenceSettings{}.step;
    write_picture(a, HierarchyReference(mesh, 0, field.definition).render(drawn, step), scene, mesh);
    return 0;
  }
  const GpuField gpu(field, *context);
  const auto consumer = make_consumer(*context, mesh, field, gpu, drawn);
  consumer->draw();
  write_picture(a, consumer->read(), scene, mesh);
  return 0;
}

}  // namespace

void add_render_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("render", "one picture of a scene file");
  c->add_option("scene", a->scene, "scene file: an experiment file without axes (docs/experiments.md)")->required();
  c->add_option("-o,--out", a->output, "picture: .png to look at, .npy for the floats")->required();
  c->add_option("--context", a->context, "egl, egl_device or osmesa; overrides the scene's");
  c->add_option("--memory-limit", a->memory_limit, "for the structure, as 512MiB");
  c->add_flag("--reference", a->reference, "draw the double-precision reference of the filter instead");
  c->add_option("--reference-step", a->reference_step, "its step, in widths of the finest cells");
  c->add_option("--tolerance", a->tolerance,
                "error asked of every channel, in (0, 1]: the steps follow; volumes, adaptive sampling");
  c->add_flag("--color-bar", a->color_bar, "a bar with the range, for the modes projection and mip");
  c->footer("Example: amrtex render experiments/limits/scene.json -o picture.png");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
