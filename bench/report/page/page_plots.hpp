// The plots of a report.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "bench/report/page/facts.hpp"
#include "bench/report/plot.hpp"
#include "bench/report/table.hpp"

namespace amrtex {

/// Numbers of records among all points of the report.
using PointNumbers = std::map<const Json*, int>;

/// Of one scene: error against time and against bytes with what nothing beats, a curve over each numeric build parameter of at
/// least three values (page sizes) for time and for bytes, bytes by role, error by cause. Without those for which there is
/// nothing to show. Names begin with that of the scene.
std::vector<Plot> scene_plots(const ComparedScene& scene, const SceneFacts& facts, const PointNumbers& numbers);

/// Seconds to build, bytes and frame time against the number of leaf cells, where settings were measured on at least three sizes
/// of mesh, and a table of the fitted exponents.
struct MeshSizes {
  std::vector<Plot> plots;
  std::optional<Table> exponents;
};
MeshSizes mesh_sizes(std::span<const Json> records, const PointNumbers& numbers);

/// Names of encodings in the order of the registry, those that it does not know behind.
std::vector<std::string> encodings_in_order(const std::vector<const Json*>& records);

}  // namespace amrtex
