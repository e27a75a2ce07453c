#include <fmt/format.h>
#include <unistd.h>

#include <fstream>

#include "bench/cli/commands.hpp"
#include "bench/measure/runner.hpp"
#include "bench/records/record.hpp"
#include "bench/report/paper_tables.hpp"
#include "bench/report/report.hpp"
#include "bench/report/scatter.hpp"
#include "bench/report/work_precision.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string input, output, context, memory_limit, columns;
  std::vector<std::string> set;
  std::uint64_t max_points = ReadOptions{}.most_points;
  bool force = false;
  bool keep_old = false;
  bool json = false;
};

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw Error(fmt::format("{}: cannot be written", path.string()));
}

std::vector<Table> tables_of(const fs::path& folder, const std::string& columns) {
  const std::vector<Json> records = load_records(folder);
  if (records.empty()) throw Error(fmt::format("{}: no records; accepted: a folder that `amrtex run` wrote", folder.string()));
  ReportOptions options;
  if (columns.empty() && fs::exists(folder / "columns.json")) return tables_of(folder, (folder / "columns.json").string());
  if (!columns.empty())
    for (const Json& r : records) options.columns[r.at("experiment")] = read_columns(columns);
  return make_tables(records, options);
}

void write_tables(const fs::path& folder, const std::vector<Table>& tables) {
  std::string markdown;
  std::string csv;
  std::string latex;
  for (const Table& t : tables) {
    markdown += to_markdown(t) + "\n";
    csv += to_csv(t) + "\n";
    latex += to_latex(t) + "\n";
  }
  write_text(folder / "table.md", markdown);
  write_text(folder / "table.csv", csv);
  write_text(folder / "table.tex", latex);
}

/// Writes the ordinary tables, then those beside a paper; so the first are there when tables.json ends in an error.
std::vector<Table> write_report(const fs::path& folder, const std::string& columns) {
  std::vector<Table> tables = tables_of(folder, columns);
  write_tables(folder, tables);
  const fs::path file = folder / "tables.json";
  if (!fs::exists(file)) return tables;
  const std::vector<Json> records = load_records(folder);
  for (Table& table : make_paper_tables(file, records)) tables.push_back(std::move(table));
  const auto add = [&](const auto& made) {
    tables.insert(tables.end(), made.tables.begin(), made.tables.end());
    for (const Diagram& diagram : made.diagrams)
      write_text(folder / (diagram.name + ".vl.json"), diagram.specification.dump(1) + "\n");
  };
  add(make_work_precision(file, records));
  add(make_scatter(file, records));
  write_tables(folder, tables);
  return tables;
}

/// The experiment's own choice of tables goes along with its records.
void copy_beside(const Experiment& experiment, const fs::path& folder, const char* name) {
  const fs::path source = experiment.file.parent_path() / name, target = folder / name;
  std::error_code absent;
  if (fs::exists(source) && !fs::equivalent(source, target, absent))
    fs::copy_file(source, target, fs::copy_options::overwrite_existing);
}

int run(const Arguments& a) {
  const Experiment experiment = read_experiment(a.input, {.set = a.set, .most_points = a.max_points});
  const fs::path paper_tables = experiment.file.parent_path() / "tables.json";
  if (fs::exists(paper_tables)) {  // an error ends here, before any work
    make_paper_tables(paper_tables, {});
    make_work_precision(paper_tables, {});
    make_scatter(paper_tables, {});
  }
  RunOptions options;
  options.folder = a.output;
  options.force = a.force;
  options.keep_old = a.keep_old;
  options.shader_cache = options.folder / "shader_cache";
  if (!a.context.empty()) options.context = parse_context_kind(a.context);
  if (!a.memory_limit.empty()) options.memory_limit = parse_bytes(a.memory_limit);
  if (isatty(STDERR_FILENO) != 0) options.progress = [](const std::string& text) { fmt::print(stderr, "{}\n", printable(text)); };
  const RunSummary s = run_experiment(experiment, options);
  for (const char* name : {"columns.json", "tables.json"}) copy_beside(experiment, a.output, name);
  const std::vector<Table> tables = write_report(a.output, "");
  if (a.json) {
    const Json json{{"measured", s.measured},
                    {"kept", s.kept},
                    {"unsupported", s.unsupported},
                    {"over_budget", s.over_budget},
                    {"failed", s.failed}};
    fmt::print("{}\n", json.dump());
  } else {
    for (const Table& t : tables) fmt::print("{}\n", to_markdown(t));
    fmt::print("{} points measured, {} kept, {} unsupported, {} over budget, {} failed\n", s.measured, s.kept, s.unsupported,
               s.over_budget, s.failed);
    fmt::print("records, pictures and tables: {}\n", printable(a.output));
  }
  return s.failed > 0 ? 1 : 0;
}

int report(const Arguments& a) {
  const std::vector<Table> tables = write_report(a.input, a.columns);
  for (const Table& t : tables) fmt::print("{}\n", to_markdown(t));
  fmt::print("{0}/table.md, {0}/table.csv, {0}/table.tex\n", a.input);
  return 0;
}

}  // namespace

std::int64_t parse_bytes(const std::string& text) {
  std::size_t used = 0;
  double number = -1;
  try {
    number = std::stod(text, &used);
  } catch (const std::exception&) {
  }
  const std::string unit = text.substr(std::min(used, text.size()));
  double factor = 0;
  if (unit.empty() || unit == "B") factor = 1;
  if (unit == "KiB") factor = 1024;
  if (unit == "MiB") factor = 1024.0 * 1024;
  if (unit == "GiB") factor = 1024.0 * 1024 * 1024;
  if (!(number >= 0) || factor == 0 || number * factor > 9e18)
    throw UsageError(fmt::format("{} is no amount of memory; accepted: 500000, 64KiB, 512MiB, 2GiB", text));
  return static_cast<std::int64_t>(number * factor);
}

void add_set_option(CLI::App& command, std::vector<std::string>& set) {
  command
      .add_option(
          "--set", set,
          "key=value, as render.step=0.5 or step=0.5: replaces what the file says; JSON, or else text; `amrtex settings` lists "
          "the keys")
      ->allow_extra_args(false);
}

void add_run_commands(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* r = app.add_subcommand("run", "measure all points of an experiment; goes on where an earlier run stopped");
  r->add_option("experiment", a->input, "experiment file (docs/experiments.md)")->required();
  r->add_option("--out", a->output, "folder for records, pictures and tables")->required();
  r->add_option("--context", a->context, "egl, egl_device or osmesa; overrides the experiment's");
  r->add_option("--memory-limit", a->memory_limit, "for one structure, as 512MiB");
  add_set_option(*r, a->set);
  r->add_option("--max-points", a->max_points, "points of one file, above which it is refused")->capture_default_str();
  CLI::Option* force = r->add_flag("--force", a->force, "measure again what has a record");
  r->add_flag("--keep-old", a->keep_old, "keep records that other shaders or builders made; they are measured again otherwise")
      ->excludes(force);
  r->add_flag("--json", a->json, "print counts for programs");
  r->footer("Example: amrtex run experiments/quickstart/experiment.json --out out/quickstart");
  r->callback([a, &chosen] { chosen = [a] { return run(*a); }; });

  CLI::App* p = app.add_subcommand("report", "tables (Markdown, CSV, LaTeX) from the records of a folder");
  p->add_option("folder", a->input, "what `amrtex run` wrote")->required();
  p->add_option("--columns", a->columns, "JSON list of column keys");
  p->footer("Example: amrtex report out/quickstart");
  p->callback([a, &chosen] { chosen = [a] { return report(*a); }; });
}

}  // namespace amrtex
