// Plots that are written beside the tables.
#pragma once

#include <set>
#include <string>

#include "structures/common/encoding.hpp"

namespace amrtex {

struct Diagram {
  std::string name;    ///< of its file, without extension; differs from that of every other diagram
  Json specification;  ///< Vega-Lite 6, with its data
};

inline constexpr const char* kVegaLite = "https://vega.github.io/schema/vega-lite/v6.json";

/// "<kind>_<what>" in letters, digits and single underscores, with a number where that is used already.
std::string diagram_name(const std::string& kind, const std::string& what, std::set<std::string>& used);

}  // namespace amrtex
