#include <fmt/format.h>

#include "bench/settings/experiment_parser.hpp"
#include "bench/settings/orbit.hpp"

namespace amrtex {

std::vector<RenderPoint> parse_views(ExperimentParser& parser) {
  const JsonNode key = parser.root.require("views");
  const Depths depth = depths_of(section_of("views").keys);
  std::vector<RenderPoint> points;
  const std::vector<JsonNode> nodes = parser.axes.values(key, 0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for_each_named(parser, nodes[i], depth, fmt::format("view {}", i + 1), [&](const Json& json, const std::string& name) {
      const auto views = orbit_views(json, name);
      if (views.size() > 1) parser.axes.add(nodes[i].place() + ".orbit");
      for (const auto& [view, view_name] : views) {
        RenderPoint point;
        point.view = parse_view(view);
        camera_frame(point.view, 1, 1);  // throws where the view is degenerate
        point.view_name = view_name;
        points.push_back(point);
      }
    });
  return points;
}

}  // namespace amrtex
