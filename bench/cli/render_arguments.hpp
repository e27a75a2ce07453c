// What `amrtex render` and `amrtex run` are told of a scene of a data set.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/settings/default_scene.hpp"

namespace CLI {
class App;
}

namespace amrtex {

struct SceneArguments {
  std::string field, color_map, mode, encoding, filter, view;
  std::vector<double> range, isovalues;
  std::vector<int> size;
  std::vector<std::string> camera;
  std::optional<double> opacity_length, fov_y;
  bool logarithmic = false;

  /// Names of those given that a scene file does not take beside its own text: it holds a view and a transfer function.
  std::vector<std::string> of_data_alone() const;
  /// The others, as `--set` takes them.
  std::vector<std::string> overrides() const;
  View camera_view() const;
  /// Of a data set: an experiment of it, written into the folder; else the file as it is. Throws UsageError where options of a
  /// data set stand beside an experiment.
  std::string experiment_of(const std::string& input, const std::string& folder) const;
  SceneRequest request(const std::string& data, const AmrHierarchy& mesh) const;
};

void add_scene_arguments(CLI::App& command, SceneArguments& arguments);

/// The first field, or the one that is wanted.
AmrHierarchy read_data_set(const std::string& data, const std::string& field);

}  // namespace amrtex
