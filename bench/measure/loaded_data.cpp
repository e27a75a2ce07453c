#include "bench/measure/loaded_data.hpp"

#include <fmt/format.h>

#include "bench/measure/scene_data.hpp"
#include "bench/records/record.hpp"
#include "renderers/scene/triangle_mesh.hpp"

namespace amrtex {

LoadedData::LoadedData(const Experiment& experiment, std::size_t dataset)
    : experiment_(experiment),
      dataset_(dataset),
      mesh_(load_dataset(experiment, experiment.datasets[dataset])),
      content_hash_(mesh_.content_hash(0)) {}

const std::string& LoadedData::exact_hash(const Scene& scene) {
  std::string key;
  for (const TriangleObject& object : scene.settings.triangles) key += object.mesh->content_hash() + " ";
  for (const int field : more_fields(mesh_, scene)) key += fmt::format(" {}", field);
  std::string& hash = exact_hashes_[key];
  if (hash.empty()) hash = exact_data_hash(mesh_, scene);
  return hash;
}

std::string LoadedData::point_hash(const BuildPoint& build, const RenderPoint& render) {
  return configuration_hash(point_configuration(experiment_, build, render, exact_hash(scene_of(experiment_, render))));
}

}  // namespace amrtex
