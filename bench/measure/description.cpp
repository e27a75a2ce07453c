#include "bench/measure/description.hpp"

#include <cstdint>

#include "bench/measure/environment.hpp"
#include "bench/records/record.hpp"
#include "structures/mesh/process_memory.hpp"

namespace amrtex {
namespace {

Json json_or_null(const std::optional<std::int64_t>& value) { return value ? Json(*value) : Json(); }

Json dataset_json(const Experiment& experiment, LoadedData& data, const RenderPoint& render) {
  const DatasetSource& source = data.source();
  const AmrHierarchy& mesh = data.mesh();
  std::int64_t patches = 0;
  for (int l = 0; l < mesh.level_count(); ++l) patches += static_cast<std::int64_t>(mesh.patches(l).size());
  return {{"name", source.name},
          {"source", source.file ? Json(source.written) : source.generate},
          {"hash", data.content_hash()},
          {"exact_hash", data.exact_hash(scene_of(experiment, render))},
          {"leaf_cells", mesh.leaf_cells()},
          {"stored_cells", mesh.stored_cells()},
          {"levels", mesh.level_count()},
          {"patches", patches},
          {"field", mesh.fields().front()}};
}

Json described_context(const GlContextInfo& info, const Json& shader_cache) {
  Json context = context_json();
  context["renderer"] = info.renderer;
  context["device"] = info.software ? context["cpu"] : Json(info.renderer);
  context["device_index"] = info.device >= 0 ? Json(info.device) : Json();
  context["gpu_memory_bytes"] = info.total_memory_bytes > 0 ? Json(info.total_memory_bytes) : Json();
  context["gpu_memory_free_bytes"] = info.free_memory_bytes > 0 ? Json(info.free_memory_bytes) : Json();
  context["shader_cache"] = shader_cache;
  context["gl_version"] = info.version;
  context["software"] = info.software;
  context["extensions_missing"] = Json::array();
  for (const char* name : {"GL_ARB_bindless_texture", "GL_ARB_shader_ballot"})
    if (!info.has_extension(name)) context["extensions_missing"].push_back(name);
  context["warnings"] = Json::array();
  return context;
}

}  // namespace

void describe_point(Json& record, const Experiment& experiment, LoadedData& data, const BuildPoint& build,
                    const RenderPoint& render, const GlContextInfo& context, const RunConditions& run) {
  record["experiment"] = experiment.name;
  record["configuration"] = data.point_hash(build, render);
  record["implementation"] = run.implementation;
  record["repetition"] = 0;
  record["process_peak_bytes"] = json_or_null(process_peak_bytes());
  record["asked"] = point_experiment(experiment, build, render);
  record["dataset"] = dataset_json(experiment, data, render);
  record["encoding"] = build.encoding;
  record["build_parameters"] = build.parameters;
  record["filter"] = filter_name(build.filter);
  record["storage"] = format_name(build.storage);
  record["filtering"] = filtering_name(build.filtering);
  record["render"] = render_json(render);
  record["context"] = described_context(context, run.shader_cache);
}

void describe_structure(Json& record, const Built& built, const AmrHierarchy& mesh) {
  const EncodedField& field = built.structure.field;
  record["build_parameters"] = field.build_parameters;
  record["memory"] = memory_json(field, mesh.leaf_cells());
  record["build_seconds"] = built.build_seconds;
  record["upload_seconds"] = built.upload_seconds;
  record["left_out"] = left_out_json(field);
  record["statistics"] = field.statistics;
  record["storage_scale"] = {{"a", field.scale.offset}, {"b", field.scale.scale}};
}

void warn(Json& record, const std::string& text) { record["context"]["warnings"].push_back(text); }

}  // namespace amrtex
