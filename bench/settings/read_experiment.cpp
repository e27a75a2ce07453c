#include "bench/settings/experiment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bench/settings/experiment_parser.hpp"
#include "bench/settings/override.hpp"

namespace amrtex {
namespace {

void accept_root_keys(const ExperimentParser& parser) {
  std::vector<std::string_view> keys = names_of(section_of("top").keys);
  if (!parser.scene) std::erase(keys, "region");
  parser.root.accept_keys(keys);
}

void require_one_point(const ExperimentParser& parser) {
  const Experiment& e = parser.experiment;
  if (e.points() == 1) return;
  parser.root.fail(fmt::format("a scene file describes one picture, this one {}; lists with several values: {}", e.points(),
                               fmt::join(e.axes, ", ")));
}

Experiment parse(JsonFile file, bool scene, const ReadOptions& options) {
  for (const std::string& text : options.set) override_setting(file, text);
  ExperimentParser parser(file, scene);
  parser.experiment.file = file.path();
  accept_root_keys(parser);
  require_few_points(parser, options.most_points);
  if (options.holds_data)
    parse_held_dataset(parser);
  else
    parse_datasets(parser);
  parse_builds(parser);
  parse_renders(parser);
  parse_measuring(parser);
  if (scene) require_one_point(parser);
  return std::move(parser.experiment);
}

}  // namespace

JsonNode culprit(const JsonNode& object, const std::string& message) {
  for (const auto& [key, node] : object.members())
    if (message.find("'" + key + "'") != std::string::npos) return node;
  return object;
}

Experiment parse_experiment(std::string text, const std::filesystem::path& path, const ReadOptions& options) {
  return parse(JsonFile(std::move(text), path), false, options);
}

Experiment read_experiment(const std::filesystem::path& path, const ReadOptions& options) {
  return parse(JsonFile::read(path), false, options);
}

Experiment parse_scene(std::string text, const std::filesystem::path& path, const ReadOptions& options) {
  return parse(JsonFile(std::move(text), path), true, options);
}

Experiment read_scene(const std::filesystem::path& path, const ReadOptions& options) {
  return parse(JsonFile::read(path), true, options);
}

}  // namespace amrtex
