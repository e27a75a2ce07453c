#include "bench/cli/render_arguments.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "renderers/scene/framing.hpp"
#include "renderers/scene/transfer_import.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

bool is_map_name(const std::string& name) {
  const auto& names = color_map_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// A map that another program wrote: its colours, and its opacity where it has one.
void import_map(const SceneArguments& a, const AmrHierarchy& mesh, SceneRequest& request) {
  const ImportedTransfer imported = import_transfer(a.color_map);
  const double length = a.opacity_length.value_or(opacity_length(mesh));
  if (!imported.relative && a.range.empty()) {
    request.transfer.range = imported.range();
    if (!a.logarithmic) request.transfer.logarithmic = imported.logarithmic;
  }
  if (!imported.colors.empty()) request.transfer.colors = imported.unit_colors();
  if (imported.opacity.empty()) return;
  TransferFunction tf = default_transfer(mesh, request);
  tf.extinction = extinction_of(imported.unit_opacity(), length);
  const double lower = tf.color.front().value, upper = tf.color.back().value;
  const ValueHistogram axis{lower, upper, tf.logarithmic, {}, 0, 0};
  for (auto& p : tf.extinction) p.value = axis.value_at(p.value);
  tf.length_unit = TransferFunction::LengthUnit::world;
  request.transfer_function = tf;
}

}  // namespace

std::vector<std::string> SceneArguments::of_data_alone() const {
  std::vector<std::string> names;
  if (!color_map.empty()) names.emplace_back("--colormap");
  if (!range.empty()) names.emplace_back("--range");
  if (logarithmic) names.emplace_back("--log");
  if (!view.empty()) names.emplace_back("--view");
  if (opacity_length) names.emplace_back("--opacity-length");
  return names;
}

View SceneArguments::camera_view() const {
  std::vector<std::string> words = camera;
  if (fov_y) words.insert(words.end(), {"-fovy", fmt::format("{}", *fov_y)});
  return parse_camera_line(words);
}

std::vector<std::string> SceneArguments::overrides() const {
  std::vector<std::string> set;
  if (!field.empty()) set.push_back(fmt::format("datasets.field={}", Json(field).dump()));
  if (!mode.empty()) set.push_back("render.mode=" + mode);
  if (!encoding.empty()) set.push_back(fmt::format("encodings={}", Json{{"name", encoding}}.dump()));
  if (!filter.empty()) set.push_back("filters=" + filter);
  if (!isovalues.empty()) set.push_back("render.isovalues=" + Json(isovalues).dump());
  if (!size.empty()) {
    set.push_back(fmt::format("render.width={}", size[0]));
    set.push_back(fmt::format("render.height={}", size[1]));
  }
  if (!camera.empty()) set.push_back("views=" + to_json(camera_view()).dump());
  return set;
}

std::string SceneArguments::experiment_of(const std::string& input, const std::string& folder) const {
  if (!is_data_set(input)) {
    if (!of_data_alone().empty() || !overrides().empty())
      throw UsageError(fmt::format("{}: an experiment says itself what is drawn; accepted: --set, or a data set in its place",
                                   clipped(input)));
    return input;
  }
  if (folder.empty()) throw UsageError("--out is missing: the folder for the experiment of the data set and its records");
  const AmrHierarchy mesh = read_data_set(input, field);
  SceneRequest wanted = request(input, mesh);
  if (size.empty()) wanted.width = wanted.height = 256;  // times compare as well, and references take their time
  const std::filesystem::path file = std::filesystem::path(folder) / "experiment.json";
  make_folder(folder);
  write_atomically(file, default_experiment(mesh, wanted).dump(1) + "\n");
  return file.string();
}

SceneRequest SceneArguments::request(const std::string& data, const AmrHierarchy& mesh) const {
  SceneRequest request;
  request.data = data;
  request.encoding = encoding;
  request.filter = filter;
  request.isovalues = isovalues;
  request.mode = !mode.empty() ? mode : isovalues.empty() ? "dvr" : "iso";
  parse_mode(request.mode);
  if (!size.empty()) {
    request.width = size[0];
    request.height = size[1];
  }
  if (!view.empty()) request.view_name = view;
  if (!camera.empty()) request.view = camera_view();
  if (!range.empty()) request.transfer.range = {range[0], range[1]};
  if (logarithmic) request.transfer.logarithmic = true;
  if (color_map.empty() || is_map_name(color_map))
    request.transfer.color_map = color_map;
  else
    import_map(*this, mesh, request);
  return request;
}

AmrHierarchy read_data_set(const std::string& data, const std::string& field) {
  return AmrHierarchy(read_mesh(data, FieldChoice::one(field)));
}

}  // namespace amrtex
