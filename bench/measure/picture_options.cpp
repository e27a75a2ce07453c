#include "bench/measure/picture_options.hpp"

#include <fmt/format.h>

#include <array>

#include "bench/settings/settings_table.hpp"
#include "renderers/scene/scene_settings.hpp"

namespace amrtex {

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

ReferenceRule reference_rule(const Experiment& scene, const std::optional<double>& step, const std::optional<double>& tolerance) {
  if (step && tolerance) throw UsageError("--reference-step stands in place of --reference-tolerance; accepted: one of both");
  ReferenceSettings settings = scene.reference.value_or(ReferenceSettings{});
  if (tolerance) settings.step.reset();
  const auto set = [&](const char* key, const char* option, const std::optional<double>& value) {
    if (!value) return;
    const Setting<ReferenceSettings>& row = *reference_settings().find(key);
    if (const auto problem = value_problem(*value, row.key.type))
      throw UsageError(fmt::format("{} {}: {}", option, *value, problem->text));
    row.set(settings, *value);
  };
  set("step", "--reference-step", step);
  set("tolerance", "--reference-tolerance", tolerance);
  return settings.rule();
}

bool choose_encoding(BuildPoint& build, std::size_t failed) {
  struct Choice {
    const char* encoding;
    Filter filter;
  };
  constexpr std::array<Choice, 3> choices = {
      Choice{kFirstChoice, Filter::linear_vertex}, {"exabricks", Filter::basis}, {"octree", Filter::linear_lod}};
  if (failed >= choices.size()) return false;
  build.encoding = choices[failed].encoding;
  build.filter = choices[failed].filter;
  build.parameters = Json::object();
  return true;
}

}  // namespace amrtex
