#include <fmt/format.h>

#include "bench/settings/experiment_parser.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

/// The values of one point along the axes of a specification: " levels=4 seed=2".
std::string axis_values(const JsonNode& specification, const Choice& choice, const Depths& depth) {
  std::string text;
  for (const auto& [key, node] : choice)
    if (key != "field" && is_axis(specification.find(key)->json(), depth(key)))
      text += fmt::format(" {}={}", key, node.json().dump());
  return text;
}

/// A field is written as its type, or as an object that holds its type.
std::string field_name(const Json& specification) {
  if (specification.contains("name") && specification["name"].is_string()) return specification["name"].get<std::string>();
  const Json field = specification.value("field", Json());
  const Json type = field.is_object() ? field.value("type", Json()) : field;
  return type.is_string() ? type.get<std::string>() : "generated";
}

void parse_generated(ExperimentParser& parser, const JsonNode& node, const JsonNode& generate) {
  if (const auto field = node.find("field")) field->fail("a generated data set has one field; its name goes into 'generate'");
  const Depths depth = depths_of(section_of("generate").keys);
  for (const JsonNode& specification : generate.items())
    for (const Choice& choice : parser.axes.combinations(specification, depth)) {
      DatasetSource source;
      source.generate = to_object(choice);
      const auto name = node.find("name");
      source.name = (name ? name->text() : field_name(source.generate)) + axis_values(specification, choice, depth);
      parser.experiment.datasets.push_back(std::move(source));
    }
}

std::string file_name(const std::filesystem::path& path) {
  const auto name = path.filename();
  return (name.empty() ? path.parent_path().filename() : name).string();  // a folder may end in a slash
}

void parse_files(ExperimentParser& parser, const JsonNode& node) {
  for (const Choice& choice : parser.axes.combinations(node, depths_of(section_of("datasets").keys))) {
    DatasetSource source;
    source.file = existing_path(*find(choice, "file"), parser.file).path;
    source.written = find(choice, "file")->text();
    if (const JsonNode* field = find(choice, "field"); field != nullptr && !field->json().is_null()) source.field = field->text();
    const JsonNode* name = find(choice, "name");
    source.name = name != nullptr ? name->text() : file_name(*source.file);
    parser.experiment.datasets.push_back(std::move(source));
  }
}

}  // namespace

void parse_datasets(ExperimentParser& parser) {
  const JsonNode datasets = parser.root.require("datasets");
  for (const JsonNode& node : parser.axes.values(datasets, 0)) {
    node.accept_keys(names_of(section_of("datasets").keys));
    const auto generate = node.find("generate");
    if (node.find("file").has_value() == generate.has_value()) node.fail("one of the keys 'file' and 'generate' is needed");
    if (generate)
      parse_generated(parser, node, *generate);
    else
      parse_files(parser, node);
  }
}

void parse_held_dataset(ExperimentParser& parser) {
  DatasetSource source;
  if (const auto datasets = parser.root.find("datasets")) {
    const std::vector<JsonNode> nodes = parser.axes.values(*datasets, 0);
    if (nodes.size() > 1) datasets->fail("several data sets; accepted: none or one, for a mesh that is there already");
    nodes.front().accept_keys(names_of(section_of("datasets").keys));
    if (const auto field = nodes.front().find("field"); field && !field->json().is_null()) source.field = field->text();
    if (const auto name = nodes.front().find("name")) source.name = name->text();
  }
  parser.experiment.datasets.push_back(std::move(source));
}

ExistingPath existing_path(const JsonNode& node, const JsonFile& file) {
  const std::filesystem::path given = node.text();
  const std::filesystem::path around = file.path().has_parent_path() ? file.path().parent_path() : std::filesystem::path(".");
  const std::filesystem::path beside = file.path().parent_path() / given;  // `given` where that is absolute
  std::error_code ignored;
  if (!given.empty() && std::filesystem::exists(beside, ignored))
    return {beside, given.is_absolute() ? given.parent_path() : around};
  if (!given.empty() && std::filesystem::exists(given, ignored)) return {given, "."};
  if (given.empty()) node.fail("an empty path; accepted: a file or a folder");
  const std::filesystem::path shown = clipped(given.string());
  if (given.is_absolute()) node.fail(fmt::format("{}: {}", shown.string(), why_absent(given)));
  const auto current = std::filesystem::current_path(ignored);
  node.fail(fmt::format("{}: {}; {}: {}", (file.path().parent_path() / shown).string(), why_absent(beside),
                        (current / shown).string(), why_absent(current / given)));
}

}  // namespace amrtex
