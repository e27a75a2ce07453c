#include "renderers/bindings/scene_needs.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "renderers/bindings/transfer_bindings.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

void require_detail(const EncodedField& field, const RenderSettings& s) {
  const auto& defines = field.shader.defines;
  const auto it = std::find(defines.begin(), defines.end(), std::pair<std::string, int>("AMRTEX_LEVEL_OF_DETAIL", 1));
  if (s.prunes_levels() && it == defines.end())
    throw Error(fmt::format("level of detail: the structure of encoding {} was built without it", field.encoding));
}

/// A structure without the parts that one transfer function hides has no other's picture.
void require_hidden_parts(const EncodedField& field, const Scene& scene) {
  if (field.invisible.empty()) return;
  Scene pruned = scene;
  pruned.settings.prune = true;
  for (const char* key : {"prune", "transfer_functions"}) validate_setting(pruned, key);
  const auto hidden = invisible_ranges(scene.transfer_function);
  for (const auto& [from, to] : field.invisible) {
    const bool still =
        std::any_of(hidden.begin(), hidden.end(), [&](const auto& range) { return from >= range[0] && to <= range[1]; });
    if (!still)
      throw UsageError(fmt::format(
          "encoding {}: pruned for a transfer function that hides the values from {:.6g} to {:.6g}, of which this one "
          "shows some; draw it with that or build without --prune",
          field.encoding, from, to));
  }
}

void require_more_fields(const EncodedField& field, const Scene& scene) {
  if (scene.more_fields.empty()) return;
  const auto count = static_cast<int>(1 + scene.more_fields.size());
  if (count > kMostFields)
    throw UsageError(fmt::format("encoding {}: {} fields with transfer functions; at most {} are supported", field.encoding,
                                 count, kMostFields));
  if (field.field_count < count)
    throw Error(fmt::format("encoding {}: {} fields with transfer functions; the structure was built with {}", field.encoding,
                            count, field.field_count));
}

}  // namespace

SceneNeeds scene_needs(const Scene& scene, Filter filter, Filtering filtering) {
  SceneNeeds needs;
  needs.filter = filter;
  needs.filtering = interpolates(filter) ? filtering : Filtering::manual;
  needs.level_of_detail = scene.settings.prunes_levels();
  needs.draw_boxes = scene.settings.consumer != ConsumerKind::raycast;
  needs.everything = scene.settings.everything;
  needs.value_ranges = scene.settings.skip || needs.everything;
  needs.variation = scene.settings.sampling == Sampling::planned;
  needs.field_ranges = needs.value_ranges && !scene.more_fields.empty();
  const Shading shading = scene.settings.draws_surfaces() ? scene.settings.isosurfaces.shading : Shading::none;
  const bool lit =
      shading == Shading::gradient || (scene.settings.draws_surfaces() && scene.settings.isosurfaces.ambient_occlusion);
  needs.analytic_gradients = shading == Shading::analytic;
  needs.gradients = lit || needs.everything;
  for (const char* key : {"transfer_functions", "prune"}) validate_setting(scene, key);
  if (!scene.settings.prune) return needs;
  needs.invisible = invisible_ranges(scene.transfer_function);
  return needs;
}

void require_needs(const EncodedField& field, const Scene& scene) {
  require_detail(field, scene.settings);
  require_hidden_parts(field, scene);
  require_more_fields(field, scene);
}

}  // namespace amrtex
