// Scenes and experiments for data that nobody has described yet.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bench/settings/default_transfer.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// What a person may say of a picture of a data set; all else follows from the data.
struct SceneRequest {
  std::filesystem::path data;                         ///< stands in the scene as an absolute path
  std::string encoding, filter;                       ///< empty: kd_tree and linear_vertex
  std::string mode = "dvr";                           ///< see docs/experiments.md
  std::vector<double> isovalues;                      ///< modes iso and dvr_iso; empty: the middle of the shown range
  int width = 768, height = 768;                      ///< pixels
  std::string view_name = "corner";                   ///< see framing_names()
  std::optional<View> view;                           ///< in its place
  std::optional<TransferFunction> transfer_function;  ///< in place of a default one
  TransferRequest transfer;
};

/// Is this a data set, and no scene or experiment file? A folder is, and a file that is no JSON. Throws nothing.
bool is_data_set(const std::filesystem::path& path);

View default_view(const AmrHierarchy& mesh, const SceneRequest& request);
TransferFunction default_transfer(const AmrHierarchy& mesh, const SceneRequest& request);

/// A scene file of field 0 of the mesh, as `amrtex render` and `amrtex run` take it.
Json default_scene(const AmrHierarchy& mesh, const SceneRequest& request);

/// An experiment: every encoding with its filters, storages of 32, 16 and 8 bits, one step, this scene.
Json default_experiment(const AmrHierarchy& mesh, const SceneRequest& request);

}  // namespace amrtex
