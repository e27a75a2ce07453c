#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bench/settings/experiment_parser.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

using Names = std::vector<std::string_view>;

/// The values of each key of build_settings() that is given.
using BuildAxes = std::map<std::string, std::vector<JsonNode>>;

/// An encoding's own lists, or else those of `otherwise`.
BuildAxes build_axes(const ExperimentParser& parser, const JsonNode& node, BuildAxes otherwise) {
  for (const Key* key : build_settings().keys())
    if (const auto given = node.find(key->name))
      otherwise.insert_or_assign(key->name, parser.axes.values(*given, key->type.depth));
  return otherwise;
}

/// All combinations; filtering is manual where the filter interpolates nothing.
std::vector<BuildPoint> points_of(const BuildAxes& axes) {
  std::vector<BuildPoint> points = {BuildPoint{}};
  for (const Setting<BuildPoint>& row : build_settings().rows()) {
    const auto values = axes.find(row.key.name);
    if (values == axes.end()) continue;
    std::vector<BuildPoint> next;
    for (const BuildPoint& point : points)
      for (const JsonNode& value : values->second) {
        next.push_back(point);
        read_setting(value, row, next.back());
      }
    points = std::move(next);
  }
  for (BuildPoint& point : points)
    if (!interpolates(point.filter)) point.filtering = Filtering::manual;
  return points;
}

/// Here rather than in complete_parameters alone, for the line of the key.
void accept_parameters(const Encoding& encoding, const Choice& choice) {
  const std::vector<ParameterInfo> parameters = encoding.parameters();
  Names known = names_of(section_of("encodings").keys);
  for (const ParameterInfo& p : parameters) known.push_back(p.name);
  for (const auto& [key, node] : choice)
    if (std::find(known.begin(), known.end(), key) == known.end())
      node.fail(fmt::format("encoding {} has no such parameter; accepted: {}{}", encoding.name(), fmt::join(known, ", "),
                            suggestion(key, known)));
}

/// The encoding of a choice and its parameters.
void read_encoding(const JsonNode& node, const Choice& choice, BuildPoint& build) {
  const JsonNode& name = *find(choice, "name");
  build.encoding = name.text();
  const Encoding* encoding = located(name, [&] { return &find_encoding(build.encoding); });
  accept_parameters(*encoding, choice);
  Json given = to_object(choice);
  given.erase("name");
  build.parameters = located(node, [&] { return complete_parameters(*encoding, given); });
}

void parse_encoding(const ExperimentParser& parser, const JsonNode& node, const BuildAxes& general,
                    std::vector<BuildPoint>& builds) {
  node.members();
  node.require("name");
  const std::vector<BuildPoint> points = points_of(build_axes(parser, node, general));
  for (const Choice& choice : parser.axes.combinations(node, depths_of({}), names_of(build_settings().keys()))) {
    BuildPoint encoding;
    read_encoding(node, choice, encoding);
    for (BuildPoint build : points) {
      build.encoding = encoding.encoding;
      build.parameters = encoding.parameters;
      builds.push_back(std::move(build));
    }
  }
}

}  // namespace

void parse_builds(ExperimentParser& parser) {
  const JsonNode encodings = parser.root.require("encodings");
  const BuildAxes general = build_axes(parser, parser.root, {});
  std::vector<BuildPoint> builds;
  for (const JsonNode& node : parser.axes.values(encodings, 0)) parse_encoding(parser, node, general, builds);
  std::vector<BuildPoint>& all = parser.experiment.builds;
  for (std::size_t dataset = 0; dataset < parser.experiment.datasets.size(); ++dataset)
    for (BuildPoint build : builds) {
      build.dataset = dataset;
      all.push_back(std::move(build));
    }
  remove_repeated(all, [](const BuildPoint& b) {
    return fmt::format("{} {} {} {}", b.dataset, b.encoding, b.parameters.dump(), build_settings().configuration(b).dump());
  });
}

}  // namespace amrtex
