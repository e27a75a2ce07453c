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

/// `columns`: a file, or empty: columns.json of the folder where it is there. Throws UsageError naming file, line and key.
std::vector<Table> ordinary_tables(const std::filesystem::path& folder, std::filesystem::path columns,
                                   const std::vector<Json>& records);
FolderTables asked_tables(const std::filesystem::path& folder, const std::vector<Json>& records);

/// Writes table.md, .csv, .tex and the diagrams; the ordinary tables first, so that they are there when tables.json ends in an
/// error. `records`: one a point. Throws Error where there are none.
FolderTables write_tables(const std::filesystem::path& folder, const std::string& columns, const std::vector<Json>& records);

}  // namespace amrtex
