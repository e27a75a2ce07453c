// What `amrtex report` writes into a folder of records.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/report/diagram.hpp"
#include "bench/report/table.hpp"

namespace amrtex {

/// All tables of a folder, and the diagrams that its tables.json asks for.
struct FolderTables {
  std::vector<Table> ordinary;  ///< all points, and errors by cause
  std::vector<Table> asked;     ///< beside a paper, work-precision, scatter
  std::vector<Diagram> work_precision, scatter;
};

/// The experiment whose committed results lie in this folder: the nearest folder above it, at most two steps, with an
/// experiment.json. Empty where there is none.
std::filesystem::path experiment_of_results(const std::filesystem::path& folder);

/// `columns`: a file, or empty: columns.json of the folder, else of the experiment whose results it holds. Throws UsageError naming file, line and key.
std::vector<Table> ordinary_tables(const std::filesystem::path& folder, std::filesystem::path columns,
                                   const std::vector<Json>& records);
/// What tables.json asks for: that of the folder, else of the experiment whose results it holds.
FolderTables asked_tables(const std::filesystem::path& folder, const std::vector<Json>& records);

/// Writes table.md, .csv, .tex and the diagrams; the ordinary tables first, so that they are there when tables.json ends in an
/// error. `records`: one a point. Throws Error where there are none.
FolderTables write_tables(const std::filesystem::path& folder, const std::string& columns, const std::vector<Json>& records);

}  // namespace amrtex
