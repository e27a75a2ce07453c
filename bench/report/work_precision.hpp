// Work-precision: the error of every setting against its frame time, scene by scene, from records alone. An entry
// {"work_precision": {…}} of the file tables.json asks for it (format: docs/experiments.md).
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "bench/report/diagram.hpp"
#include "bench/report/table.hpp"

namespace amrtex {

/// A scene is what may be compared: data set, view, transfer function, mode, size, lamp and surfaces, and the filter that errors
/// are measured against. For each scene and context: the fastest setting that reaches each error asked for, the front that no
/// setting beats, the points without a time and why, and a diagram.
struct WorkPrecision {
  std::vector<Table> tables;
  std::vector<Diagram> diagrams;
};

/// Of the entries of the file that ask for it; without records the file is only checked. Throws UsageError naming file, line
/// and key.
WorkPrecision make_work_precision(const std::filesystem::path& path, std::span<const Json> records);

}  // namespace amrtex
