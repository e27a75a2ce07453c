#include "bench/settings/default_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "renderers/scene/framing.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

double aspect_of(const SceneRequest& request) { return static_cast<double>(request.width) / request.height; }

/// As a scene file takes it.
std::string written_path(const fs::path& data) {
  std::string file = fs::absolute(data).lexically_normal().string();
  while (file.size() > 1 && file.back() == '/') file.pop_back();
  if (!is_utf8(file)) throw UsageError(fmt::format("{}: a path that is not UTF-8 cannot stand in a scene", clipped(file)));
  return file;
}

std::string name_of(const fs::path& data) { return fs::path(written_path(data)).filename().string(); }

bool draws_surfaces(const std::string& mode) { return mode == "iso" || mode == "dvr_iso"; }
bool draws_volume(const std::string& mode) { return mode == "dvr" || mode == "dvr_iso"; }

Json render_of(const AmrHierarchy& mesh, const SceneRequest& request) {
  Json render = {{"mode", request.mode}, {"width", request.width}, {"height", request.height}};
  if (!draws_surfaces(request.mode)) return render;
  render["isovalues"] = request.isovalues;
  if (request.isovalues.empty()) {
    const ShownRange range = shown_range(mesh, 0);
    const ValueHistogram axis{range.lower, range.upper, range.logarithmic, {}, 0, 0};
    render["isovalues"] = {axis.value_at(0.5)};
  }
  if (request.isovalues.size() > 1) {  // what lies inside is seen through the others
    std::vector<double> opacity(request.isovalues.size(), 0.35);
    opacity.back() = 1;
    render["iso_opacity"] = opacity;
  }
  return render;
}

/// What scene and experiment share.
Json common(const AmrHierarchy& mesh, const SceneRequest& request) {
  Json file;
  file["name"] = name_of(request.data);
  file["datasets"] = Json::array({{{"file", written_path(request.data)}, {"field", mesh.fields().front()}}});
  file["render"] = render_of(mesh, request);
  Json view = to_json(default_view(mesh, request));
  view["name"] = request.view ? "camera" : request.view_name;
  file["views"] = view;
  if (draws_volume(request.mode) || draws_surfaces(request.mode))
    file["transfer_function"] = to_json(default_transfer(mesh, request));
  return file;
}

}  // namespace

bool is_data_set(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return true;
  if (!fs::is_regular_file(path, ignored) || path.extension() == ".json") return false;
  std::ifstream in(path, std::ios::binary);
  std::string head(4096, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  if (head.find('\0') != std::string::npos) return true;
  const std::size_t first = head.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  return first == std::string::npos || (head[first] != '{' && head[first] != '[');
}

View default_view(const AmrHierarchy& mesh, const SceneRequest& request) {
  return request.view ? *request.view
                      : framing_view(mesh.domain_lower(), mesh.domain_upper(), request.view_name, aspect_of(request));
}

TransferFunction default_transfer(const AmrHierarchy& mesh, const SceneRequest& request) {
  if (request.transfer_function) return *request.transfer_function;
  return default_transfer(mesh, 0, default_view(mesh, request), aspect_of(request), request.transfer);
}

Json default_scene(const AmrHierarchy& mesh, const SceneRequest& request) {
  Json scene = common(mesh, request);
  scene["render"]["step"] = 0.5;
  scene["encodings"] = Json::array({{{"name", request.encoding.empty() ? "kd_tree" : request.encoding}}});
  if (!request.filter.empty())
    scene["filters"] = request.filter;
  else if (request.encoding.empty())
    scene["filters"] = "linear_vertex";
  return scene;
}

Json default_experiment(const AmrHierarchy& mesh, const SceneRequest& request) {
  Json experiment = common(mesh, request);
  experiment["encodings"] = Json::parse(R"([
    {"name": "uniform", "filters": "linear_vertex"},
    {"name": "page_table", "filters": "linear_page"},
    {"name": "page_table", "centring": "node", "filters": "linear_vertex"},
    {"name": "octree", "filters": "linear_lod", "filtering": "manual"},
    {"name": "kd_tree", "filters": ["linear_lod", "linear_vertex"]},
    {"name": "exabricks", "filters": "basis"}])");
  if (!request.encoding.empty()) experiment["encodings"] = Json::array({{{"name", request.encoding}}});
  if (!request.filter.empty()) {
    for (Json& encoding : experiment["encodings"]) encoding.erase("filters");
    experiment["filters"] = request.filter;
  }
  experiment["storage"] = {"r32f", "r16", "r8"};
  experiment["render"]["step"] = {2, 1};
  experiment["frames"] = 5;
  experiment["warm_up"] = 1;
  experiment["memory_limit"] = std::int64_t{2} << 30;
  experiment["reference"] = {{"filter", "linear_vertex"}};
  experiment["check"] = {{"psnr_db", 15},
                         {"why", "8 bits and a step of two cells are on the axes: their error is what is asked"}};
  return experiment;
}

}  // namespace amrtex
