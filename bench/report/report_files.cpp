#include "bench/report/report_files.hpp"

#include <fmt/format.h>

#include "bench/report/paper_tables.hpp"
#include "bench/report/report.hpp"
#include "bench/report/scatter.hpp"
#include "bench/report/work_precision.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

void write_texts(const fs::path& folder, const std::vector<Table>& tables) {
  std::string markdown, csv, latex;
  for (const Table& t : tables) {
    markdown += to_markdown(t) + "\n";
    csv += to_csv(t) + "\n";
    latex += to_latex(t) + "\n";
  }
  write_atomically(folder / "table.md", markdown);
  write_atomically(folder / "table.csv", csv);
  write_atomically(folder / "table.tex", latex);
}

/// A file of the folder, else of the experiment whose results it holds; empty where it is in neither.
fs::path file_of(const fs::path& folder, const char* name) {
  if (fs::exists(folder / name)) return folder / name;
  const fs::path experiment = experiment_of_results(folder);
  return !experiment.empty() && fs::exists(experiment / name) ? experiment / name : fs::path();
}

}  // namespace

fs::path experiment_of_results(const fs::path& folder) {
  std::error_code absent;
  fs::path above = fs::absolute(folder).lexically_normal();
  if (above.filename().empty()) above = above.parent_path();
  for (int steps = 0; steps < 2; ++steps) {
    above = above.parent_path();
    if (fs::exists(above / "experiment.json", absent)) return above;
  }
  return {};
}

std::vector<Table> ordinary_tables(const fs::path& folder, fs::path columns, const std::vector<Json>& records) {
  if (columns.empty()) columns = file_of(folder, "columns.json");
  ReportOptions options;
  if (!columns.empty())
    for (const Json& r : records)
      if (r.at("experiment").is_string()) options.columns[r.at("experiment")] = read_columns(columns);
  return make_tables(records, options);
}

FolderTables asked_tables(const fs::path& folder, const std::vector<Json>& records) {
  FolderTables tables;
  const fs::path file = file_of(folder, "tables.json");
  if (file.empty()) return tables;
  tables.asked = make_paper_tables(file, records);
  WorkPrecision precision = make_work_precision(file, records);
  tables.asked.insert(tables.asked.end(), precision.tables.begin(), precision.tables.end());
  tables.work_precision = std::move(precision.diagrams);
  Scatter scatter = make_scatter(file, records);
  tables.asked.insert(tables.asked.end(), scatter.tables.begin(), scatter.tables.end());
  tables.scatter = std::move(scatter.diagrams);
  return tables;
}

FolderTables write_tables(const fs::path& folder, const std::string& columns, const std::vector<Json>& records) {
  if (records.empty()) throw Error(fmt::format("{}: no records; accepted: a folder that `amrtex run` wrote", folder.string()));
  const std::vector<Table> ordinary = ordinary_tables(folder, columns, records);
  write_texts(folder, ordinary);
  FolderTables tables = asked_tables(folder, records);
  tables.ordinary = ordinary;
  std::vector<Table> all = ordinary;
  all.insert(all.end(), tables.asked.begin(), tables.asked.end());
  write_texts(folder, all);
  for (const auto* diagrams : {&tables.work_precision, &tables.scatter})
    for (const Diagram& diagram : *diagrams)
      write_atomically(folder / (diagram.name + ".vl.json"), diagram.specification.dump(1) + "\n");
  return tables;
}

}  // namespace amrtex
