#include <fmt/format.h>

#include <algorithm>

#include "bench/settings/experiment_parser.hpp"
#include "structures/generators/analytic_fields.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

/// Lists of transfer functions, each of a field: one list, or an axis of them.
class FunctionsOfFields {
 public:
  explicit FunctionsOfFields(ExperimentParser& parser) : parser_(parser) {}

  std::vector<RenderPoint> parse(const JsonNode& key) {
    if (const auto other = parser_.root.find("transfer_function"))
      other->fail("with 'transfer_functions' beside it; accepted: one of both");
    std::vector<RenderPoint> points;
    const std::vector<JsonNode> lists = parser_.axes.values(key, scene_settings().find("transfer_functions")->key.type.depth);
    for (std::size_t i = 0; i < lists.size(); ++i) {
      RenderPoint point = parse_list(lists[i]);
      point.transfer_function_name = fmt::format("transfer functions {}", i + 1);
      points.push_back(std::move(point));
    }
    return points;
  }

 private:
  /// [{"field": name, "extinction": ..., "color": ...}, ...]; the first belongs to the field of the data sets.
  RenderPoint parse_list(const JsonNode& list) {
    RenderPoint point;
    std::vector<std::string> names;
    for (const JsonNode& node : list.items()) {
      const JsonNode field = node.require("field");
      const std::string name = field.text();
      if (std::find(names.begin(), names.end(), name) != names.end())
        field.fail(fmt::format("{} has a transfer function already; accepted: each field once", quote(name)));
      const TransferFunction tf = parse_function(node);
      if (names.empty()) {
        point.transfer_function = tf;
        draw_first(field);
      } else {
        point.more_fields.push_back({name, tf});
      }
      names.push_back(name);
    }
    return point;
  }

  static TransferFunction parse_function(const JsonNode& node) {
    Json json = node.json();
    json.erase("field");
    try {
      return parse_transfer_function(json);
    } catch (const Error& e) {
      culprit(node, e.what()).fail(e.what());
    }
  }

  /// The field of the first transfer function is the data sets' own.
  void draw_first(const JsonNode& field) {
    for (DatasetSource& source : parser_.experiment.datasets) {
      const std::string name = source.file ? source.field.value_or(field.text()) : analytic_field_type(source.generate);
      if (name != field.text())
        field.fail(fmt::format("the data set {} draws the field {}, to which the first transfer function belongs; accepted: {}",
                               clipped(source.name), quote(name), quote(name)));
      if (source.file) source.field = name;
    }
  }

  ExperimentParser& parser_;
};

}  // namespace

std::vector<RenderPoint> parse_transfer_functions(ExperimentParser& parser, bool needed) {
  if (const auto several = parser.root.find("transfer_functions")) return FunctionsOfFields(parser).parse(*several);
  const auto key = parser.root.find("transfer_function");
  if (!key) {
    if (needed)
      parser.root.fail(
          "the key 'transfer_function' is missing: a volume needs {\"extinction\": [[value, extinction], ...], "
          "\"color\": [[value, r, g, b], ...]}");
    return {RenderPoint{}};
  }
  const Depths depth = depths_of(section_of("transfer_function").keys);
  std::vector<RenderPoint> points;
  const std::vector<JsonNode> nodes = parser.axes.values(*key, 0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for_each_named(parser, nodes[i], depth, fmt::format("transfer function {}", i + 1),
                   [&](const Json& json, const std::string& name) {
                     RenderPoint point;
                     point.transfer_function = parse_transfer_function(json);
                     point.transfer_function_name = name;
                     points.push_back(point);
                   });
  return points;
}

}  // namespace amrtex
