#include "bench/measure/scene_data.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "bench/records/record.hpp"
#include "renderers/scene/triangle_mesh.hpp"
#include "structures/mesh/exact_hash.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {

AmrHierarchy load_dataset(const Experiment& experiment, const DatasetSource& source) {
  if (!source.file) return AmrHierarchy(generate_mesh(source.generate));
  std::vector<std::string> fields;
  const auto need = [&](const std::string& name) {
    if (!name.empty() && std::find(fields.begin(), fields.end(), name) == fields.end()) fields.push_back(name);
  };
  if (source.field) need(*source.field);
  for (const RenderPoint& render : experiment.renders) {
    need(render.settings.isosurfaces.color_field);
    for (const FieldTransfer& other : render.more_fields) need(other.field);
  }
  if (!source.field) return AmrHierarchy(read_mesh(*source.file, fields.empty() ? FieldChoice::first() : FieldChoice()));
  return AmrHierarchy(read_mesh(*source.file, fields));
}

std::unique_ptr<AnalyticField> analytic_field(const DatasetSource& source) {
  return source.file ? nullptr : make_analytic_field(source.generate);
}

std::vector<int> more_fields(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<int> others;
  for (const FieldTransfer& other : scene.more_fields) others.push_back(hierarchy.field_index(other.field));
  if (!others.empty()) return others;
  const std::string& color = scene.settings.isosurfaces.color_field;
  if (!scene.settings.draws_surfaces() || color.empty()) return {};
  return {hierarchy.field_index(color)};
}

std::string exact_data_hash(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<int> fields = {0};
  for (const int field : more_fields(hierarchy, scene)) fields.push_back(field);
  const std::string mesh = exact_hash(hierarchy, fields);
  if (scene.settings.triangles.empty()) return mesh;
  Json parts = {{"mesh", mesh}, {"triangles", Json::array()}};
  for (const TriangleObject& object : scene.settings.triangles) parts["triangles"].push_back(object.mesh->content_hash());
  return configuration_hash(parts);
}

std::vector<std::string> scene_warnings(const AmrHierarchy& hierarchy, const Scene& scene) {
  std::vector<std::string> warnings;
  if (!scene.settings.draws_surfaces()) return warnings;
  const FieldStatistics& range = hierarchy.statistics(0);
  for (const double isovalue : scene.settings.isosurfaces.values)
    if (!(isovalue >= range.min && isovalue <= range.max))
      warnings.push_back(fmt::format("isovalue {} lies outside the range of {}, {} to {}: it has no surface", isovalue,
                                     clipped(hierarchy.fields().front()), range.min, range.max));
  return warnings;
}

}  // namespace amrtex
