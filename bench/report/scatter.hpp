// One quantity of records against others, view by view, from records alone: how time goes with samples, say. An entry
// {"scatter": {…}} of the file tables.json asks for it (format: docs/experiments.md).
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "bench/report/diagram.hpp"
#include "bench/report/table.hpp"

namespace amrtex {

struct Scatter {
  std::vector<Table> tables;  ///< one for each entry and context
  std::vector<Diagram> diagrams;
};

/// Records that differ in their view alone make a row for each quantity, with the correlation and the line of least squares, and
/// a diagram of a point a view. Of the entries of the file that ask for it; without records the file is only checked. Throws
/// UsageError naming file, line and key.
Scatter make_scatter(const std::filesystem::path& path, std::span<const Json> records);

}  // namespace amrtex
