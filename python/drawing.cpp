#include "python/drawing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "bench/measure/error_split.hpp"
#include "bench/measure/picture_options.hpp"
#include "bench/measure/scene_data.hpp"
#include "bench/measure/value_resolution.hpp"
#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/make_consumer.hpp"
#include "renderers/consumers/probe.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

std::vector<std::string> together(std::vector<std::string> first, const std::vector<std::string>& then) {
  first.insert(first.end(), then.begin(), then.end());
  return first;
}

/// The drawn field, and those that the scene fetches beside it.
std::vector<std::string> fields_of(const Experiment& experiment, const AmrHierarchy& mesh) {
  std::vector<std::string> names = {experiment.datasets.front().field.value_or(mesh.fields().front())};
  const auto add = [&](const std::string& name) {
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  const RenderPoint& render = experiment.renders.front();
  add(render.settings.isosurfaces.color_field);
  for (const FieldTransfer& other : render.more_fields) add(other.field);
  return names;
}

Experiment scene_given(const PictureRequest& request, bool holds_data) {
  if (const std::vector<std::string> names = request.arguments.of_data_alone(); !names.empty())
    throw UsageError(fmt::format("{}: with a scene, which holds its own view and transfer function; accepted: set, or no scene",
                                 fmt::join(names, ", ")));
  const ReadOptions options{.set = together(request.arguments.overrides(), request.set), .holds_data = holds_data};
  return parse_scene(request.scene, request.scene_name, options);
}

Experiment scene_of_data(HeldMesh& held, const PictureRequest& request) {
  const std::string& field = request.arguments.field;
  const auto mesh = field.empty() ? held.with_fields({held.mesh().fields().front()}) : held.with_fields({field});
  const Json json = default_scene(*mesh, request.arguments.request(mesh->name(), *mesh));
  return parse_scene(json.dump(1), std::filesystem::path(held.source()) / "default_scene",
                     {.set = request.set, .holds_data = true});
}

/// What the call says beside the scene.
void settle(PlannedPicture& planned, const PictureRequest& request) {
  if (request.memory_limit) planned.experiment.memory_limit = request.memory_limit;
  planned.scene = with_tolerance(scene_of(planned.experiment, planned.experiment.renders.front()), request.tolerance);
  planned.scene.settings.prune = planned.scene.settings.prune || request.prune;
}

FilterDefinition definition_of(const BuildPoint& build, const AmrHierarchy& mesh) {
  BuildRequest request;
  request.parameters = build.parameters;
  request.needs.filter = build.filter;
  return find_encoding(build.encoding).definition(mesh, request);
}

Picture draw_with(Context& context, const Structure& structure, const PlannedPicture& planned) {
  const auto consumer = make_consumer(context, *planned.mesh, structure, planned.scene);
  consumer->draw();
  return consumer->read();
}

DrawnPicture draw_built(const PlannedPicture& planned, const Structure& structure, Context& context) {
  DrawnPicture drawn{{}, scene_warnings(*planned.mesh, planned.scene)};
  drawn.warnings = together(drawn.warnings, value_resolution(structure.field, planned.scene).warnings());
  drawn.picture = draw_with(context, structure, planned);
  return drawn;
}

}  // namespace

Context& Contexts::at(const std::string& name) {
  std::unique_ptr<Context>& context = made_[name];
  if (!context) context = make_context(parse_context(name));
  return *context;
}

PlannedPicture plan_picture(HeldMesh& held, const PictureRequest& request) {
  PlannedPicture planned;
  planned.experiment = request.scene.empty() ? scene_of_data(held, request) : scene_given(request, true);
  planned.mesh = held.with_fields(fields_of(planned.experiment, held.mesh()));
  planned.free_encoding = request.scene.empty() && request.arguments.encoding.empty() && request.arguments.filter.empty() &&
                          planned.experiment.builds.front().encoding == kFirstChoice;
  settle(planned, request);
  return planned;
}

PlannedPicture plan_scene(const PictureRequest& request) {
  PlannedPicture planned;
  planned.experiment = scene_given(request, false);
  planned.mesh = std::make_shared<const AmrHierarchy>(load_dataset(planned.experiment, planned.experiment.datasets.front()));
  settle(planned, request);
  return planned;
}

DrawnPicture draw_picture(PlannedPicture planned, const PictureRequest& request, Contexts& contexts) {
  if (request.reference) {
    const HierarchyReference reference(*planned.mesh, 0, definition_of(planned.experiment.builds.front(), *planned.mesh));
    const ReferenceRule rule = reference_rule(planned.experiment, request.reference_step, request.reference_tolerance);
    return {reference.render(planned.scene, rule), scene_warnings(*planned.mesh, planned.scene)};
  }
  Context& context = contexts.at(request.context.empty() ? planned.experiment.context : request.context);
  BuildPoint& build = planned.experiment.builds.front();
  DrawnPicture drawn;
  draw_by_first(build, planned.free_encoding, [&] {
    const auto built = build_structure(planned.experiment, build, *planned.mesh, planned.scene, context);
    drawn = draw_built(planned, built->structure, context);
  });
  return drawn;
}

HeldStructure::HeldStructure(std::shared_ptr<HeldMesh> mesh, const StructureRequest& request, Contexts& contexts)
    : held_(std::move(mesh)),
      mesh_(held_->with_fields({request.field.empty() ? held_->mesh().fields().front() : request.field})),
      context_(&contexts.at(request.context)) {
  Json entry = request.parameters;
  entry["name"] = request.encoding;
  written_["encodings"] = Json::array({entry});
  const auto give = [&](const char* key, const std::string& value) {
    if (!value.empty()) written_[key] = value;
  };
  give("filters", request.filter);
  give("storage", request.storage);
  give("filtering", request.filtering);
  if (request.memory_limit) written_["memory_limit"] = *request.memory_limit;
  Json scene = written_;  // line integrals: the least that a scene can ask for
  scene["render"] = {{"mode", "projection"}, {"width", 1}, {"height", 1}};
  SceneRequest view;
  view.width = view.height = 1;
  scene["views"] = to_json(default_view(*mesh_, view));
  experiment_ = parse_scene(scene.dump(), "encode", {.holds_data = true});
  const Scene drawn = scene_of(experiment_, experiment_.renders.front());
  built_ = build_structure(experiment_, build(), *mesh_, drawn, *context_);
}

std::vector<double> HeldStructure::sample(const std::vector<Vec3d>& points, const std::string& column) {
  if (column == "reference") return sample_reference(*held_, field(), encoded().definition, points);
  if (column != "encoding_gl" && column != "encoding_double")
    throw UsageError(fmt::format("column {}; accepted: \"encoding_gl\", \"encoding_double\", \"reference\"", quote(column)));
  std::vector<double> values(points.size(), std::numeric_limits<double>::quiet_NaN());
  std::vector<FinestPosition> inside;
  std::vector<std::size_t> where;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (const auto position = finest_position(*mesh_, points[i])) {
      inside.push_back(column == "encoding_gl" ? position_on_gl(*position) : *position);
      where.push_back(i);
    }
  std::vector<ProbeResult> found;
  if (column == "encoding_gl") {
    found = probe_on_gl(*context_, *mesh_, built_->structure, inside);
  } else {
    if (!exact_) exact_ = build_exact(find_encoding(build().encoding), *mesh_, built_->structure.request);
    found = probe_on_cpu(*mesh_, *exact_, Precision::double_precision, inside);
  }
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i].found) values[where[i]] = found[i].value;
  return values;
}

DrawnPicture HeldStructure::draw(PictureRequest request, Contexts& contexts) {
  const auto refuse = [](const char* keyword, bool given) {
    if (given) throw UsageError(fmt::format("{}: it is the structure's own; accepted: Mesh.render, or another encode", keyword));
  };
  refuse("encoding", !request.arguments.encoding.empty());
  refuse("filter", !request.arguments.filter.empty());
  refuse("field", !request.arguments.field.empty());
  refuse("context", !request.context.empty());
  refuse("memory_limit", request.memory_limit.has_value());
  request.arguments.field = field();
  std::vector<std::string> own;
  for (const auto& [key, value] : written_.items()) own.push_back(fmt::format("{}={}", key, value.dump()));
  if (!request.scene.empty()) {  // what the scene says of these is not asked
    Json scene = Json::parse(request.scene, nullptr, false);
    if (scene.is_object()) {
      for (const char* key : {"encodings", "filters", "storage", "filtering"}) scene.erase(key);
      scene.update(written_);
      if (!scene.contains("datasets")) scene["datasets"] = Json::array({{{"field", field()}}});
      request.scene = scene.dump();
    }
  }
  request.set = together(own, request.set);
  const PlannedPicture planned = plan_picture(*held_, request);
  if (request.reference) return draw_picture(planned, request, contexts);
  return draw_built(planned, structure_for(planned), *context_);
}

const Structure& HeldStructure::structure_for(const PlannedPicture& planned) {
  const BuildPoint& wanted = planned.experiment.builds.front();
  const SceneNeeds needs = scene_needs(planned.scene, wanted.filter, wanted.filtering);
  const auto serves = [&](const Built& built, const std::shared_ptr<const AmrHierarchy>& mesh) {
    const BuildRequest& request = built.structure.request;
    return mesh == planned.mesh && request.needs == needs && request.more_fields == more_fields(*mesh, planned.scene);
  };
  if (serves(*built_, mesh_)) return built_->structure;
  if (for_scene_ && serves(*for_scene_, scene_mesh_)) return for_scene_->structure;
  for_scene_.reset();  // before the next one takes its memory
  for_scene_ = build_structure(planned.experiment, wanted, *planned.mesh, planned.scene, *context_);
  scene_mesh_ = planned.mesh;
  return for_scene_->structure;
}

std::vector<double> sample_reference(HeldMesh& held, const std::string& field, const FilterDefinition& definition,
                                     const std::vector<Vec3d>& points) {
  const AmrHierarchy& mesh = held.mesh();
  const HierarchyReference reference(mesh, field.empty() ? 0 : mesh.field_index(field), definition);
  std::vector<double> values;
  values.reserve(points.size());
  for (const Vec3d& p : points) values.push_back(reference.sample(p).value_or(std::numeric_limits<double>::quiet_NaN()));
  return values;
}

}  // namespace amrtex
