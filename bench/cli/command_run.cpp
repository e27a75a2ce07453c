#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "bench/cli/commands.hpp"
#include "bench/cli/interrupt_watch.hpp"
#include "bench/cli/render_arguments.hpp"
#include "bench/cli/run_arguments.hpp"
#include "bench/cli/run_progress.hpp"
#include "bench/measure/runner.hpp"
#include "bench/measure/sweep_estimate.hpp"
#include "bench/records/point_query.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/paper_tables.hpp"
#include "bench/report/repetitions.hpp"
#include "bench/report/report_files.hpp"
#include "bench/report/scatter.hpp"
#include "bench/report/verdict.hpp"
#include "bench/report/work_precision.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments : RunArguments {
  SceneArguments scene;  ///< where the input is a data set
  std::string where, process_limit;
  std::vector<std::string> only;
  std::optional<double> time_limit, time_out;
  int repeat = 1;
  bool force = false;
  bool keep_old = false;
  bool retry_failed = false;
  bool dry_run = false;
  bool list_points = false;
  bool json = false;
};

std::vector<Table> report_tables(const fs::path& folder, const std::vector<Json>& records) {
  FolderTables tables = write_tables(folder, "", one_a_point(records));
  std::vector<Table> all = std::move(tables.ordinary);
  all.insert(all.end(), tables.asked.begin(), tables.asked.end());
  return all;
}

/// The experiment's own choice of tables goes along with its records.
void copy_beside(const Experiment& experiment, const fs::path& folder, const char* name) {
  const fs::path source = experiment.file.parent_path() / name, target = folder / name;
  std::error_code absent;
  if (fs::exists(source) && !fs::equivalent(source, target, absent))
    fs::copy_file(source, target, fs::copy_options::overwrite_existing);
}

/// An error ends here, before any work.
void check_paper_tables(const Experiment& experiment) {
  const fs::path tables = experiment.file.parent_path() / "tables.json";
  if (!fs::exists(tables)) return;
  make_paper_tables(tables, {});
  make_work_precision(tables, {});
  make_scatter(tables, {});
}

void choose_points(const Arguments& a, const Experiment& experiment, RunOptions& options) {
  options.only = a.only;
  if (a.where.empty()) return;
  const auto query = std::make_shared<PointQuery>(a.where, "--where");
  options.wanted = [query, &experiment](const BuildPoint& build, const RenderPoint& render) {
    return query->holds(point_settings(experiment, build, render));
  };
}

/// Without a point there is nothing to measure: a misspelt choice must not look like a finished run.
void require_points(const Arguments& a, const Experiment& experiment, const RunOptions& options) {
  if (!options.wanted) return;
  for (const BuildPoint& build : experiment.builds)
    for (const RenderPoint& render : experiment.renders)
      if (options.wanted(build, render)) return;
  throw UsageError(fmt::format("--where {}: no point of {} is like that; `--list-points` shows all", quote(a.where), a.input));
}

std::string settings_text(const ListedPoint& p) {
  const Json& s = p.settings;
  const auto text = [&](const char* place) {
    const Json& value = value_at(s, place);
    return value.is_string() ? value.get<std::string>() : value.dump();
  };
  return printable(fmt::format("{} {} {} {} {} {} {} {} step {} {}", text("/dataset/name"), text("/encoding"),
                               text("/build_parameters"), text("/filter"), text("/storage"), text("/filtering"),
                               text("/render/mode"), text("/render/sampling"), text("/render/step"), text("/render/view_name")));
}

int list(const Experiment& experiment, const RunOptions& options, bool json) {
  Json all = Json::array();
  for (const ListedPoint& p : list_points(experiment, options)) {
    if (json)
      all.push_back({{"configuration", p.configuration}, {"status", p.status}, {"settings", p.settings}});
    else
      fmt::print("{}  {:11}  {}\n", p.configuration, p.status, settings_text(p));
  }
  if (json) fmt::print("{}\n", all.dump());
  return 0;
}

/// Points, structures, and what records of the folder tell of bytes and times.
int dry_run(const Experiment& experiment, const RunOptions& options) {
  const SweepEstimate e = estimate(list_points(experiment, options), load_known(options.folder), options.repeat);
  fmt::print("{} points of {} structures in {} data sets, {} of them open\n", e.points, e.structures, experiment.datasets.size(),
             e.open);
  if (e.largest_bytes > 0) fmt::print("largest structure that is known: {} bytes\n", e.largest_bytes);
  if (e.open == 0)
    fmt::print("nothing to do\n");
  else if (e.seconds)
    fmt::print("about {} to go, from the points that are measured\n", duration_text(*e.seconds));
  else
    fmt::print("no point is measured yet: nothing tells how long one takes\n");
  return 0;
}

std::string shares_text(const RunSummary& s) {
  if (!(s.seconds > 0)) return {};
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < kShareNames.size(); ++i)
    parts.push_back(fmt::format("{} {:.1f} %", kShareNames[i], 100 * s.shares.seconds[i] / s.seconds));
  parts.push_back(fmt::format("harness {:.1f} %", 100 * std::max(0.0, s.seconds - s.shares.sum()) / s.seconds));
  return fmt::format("{}: {}", duration_text(s.seconds), fmt::join(parts, ", "));
}

void print_summary(const Arguments& a, const RunSummary& s, const std::vector<Table>& tables) {
  if (a.json) {
    fmt::print("{}\n", to_json(s).dump());
    return;
  }
  for (const Table& t : tables) fmt::print("{}\n", to_markdown(t));
  fmt::print("{} points measured, {} kept, {} unsupported, {} over budget, {} failed\n", s.measured, s.kept, s.unsupported,
             s.over_budget, s.failed);
  if (s.left > 0) fmt::print("{} points left when the time was over; the same command goes on\n", s.left);
  fmt::print("time: {}\n", shares_text(s));
  fmt::print("records, pictures and tables: {0}; `amrtex report {0}` makes a page of them\n", printable(a.output));
}

RunSummary measure(const Arguments& a, const Experiment& experiment, RunOptions options) {
  InterruptWatch watch(fmt::format("the same command goes on in {}", a.output));
  RunProgress progress(isatty(STDERR_FILENO) != 0);
  options.measuring_process = a.measuring_process(fs::read_symlink("/proc/self/exe").string());
  options.measuring = [&](pid_t process) { watch.watch(process); };
  options.planned = [&](int points) { progress.plan(points); };
  options.progress = [&](const std::string& text) { progress.now(text); };
  options.recorded = [&](const Json&) {
    watch.count_record();
    progress.record();
  };
  return run_experiment(experiment, options);
}

int run(Arguments a) {
  const bool data = is_data_set(a.input);
  a.input = a.scene.experiment_of(a.input, a.output);
  const Experiment experiment = a.experiment();
  check_paper_tables(experiment);
  RunOptions options = a.options();
  options.force = a.force;
  options.keep_old = a.keep_old;
  options.retry_failed = a.retry_failed;
  options.repeat = a.repeat;
  options.time_limit = a.time_limit;
  options.time_out = a.time_out;
  if (!a.process_limit.empty()) options.process_limit = parse_bytes(a.process_limit);
  choose_points(a, experiment, options);
  require_points(a, experiment, options);
  if (a.list_points) return list(experiment, options, a.json);
  if (a.dry_run) return dry_run(experiment, options);
  const RunSummary s = measure(a, experiment, options);
  print_warnings(s.warnings);
  for (const char* name : {"columns.json", "tables.json"}) copy_beside(experiment, a.output, name);
  const bool any = s.measured + s.kept + s.unsupported + s.over_budget + s.failed > 0;
  const std::vector<Json> records = any ? load_records(a.output) : std::vector<Json>();
  print_summary(a, s, any ? report_tables(a.output, records) : std::vector<Table>());
  if (data && !a.json) fmt::print("\n{}\n", verdict(one_a_point(records)));
  return s.failed > 0 ? 1 : 0;
}

}  // namespace

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
  CLI::App* r = app.add_subcommand("run", "measure all points of an experiment, or the encodings of a data set; goes on where an earlier run stopped");
  add_run_arguments(*r, *a);
  add_scene_arguments(*r, a->scene);
  CLI::Option* force = r->add_flag("--force", a->force, "measure again what has a record");
  r->add_flag("--keep-old", a->keep_old, "keep records that other shaders or builders made; they are measured again otherwise")
      ->excludes(force);
  r->add_flag("--retry-failed", a->retry_failed, "measure again what failed: such a record is kept otherwise");
  r->add_option("--where", a->where, "points alone that are like that: 'encoding = kd_tree and step <= 1' (docs/experiments.md)");
  r->add_option("--only", a->only, "points alone whose configurations begin so");
  r->add_option("--repeat", a->repeat, "processes that measure each point (`amrtex compare` asks for several)")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  r->add_option("--time-limit", a->time_limit, "seconds after which no further structure is begun")->check(CLI::PositiveNumber);
  r->add_option("--time-out", a->time_out,
                "seconds of building and drawing that a point may take; else 10 times the longest, at least 60")
      ->check(CLI::PositiveNumber);
  r->add_option("--process-limit", a->process_limit, "memory that a measuring process may allocate, as 8GiB");
  r->add_flag("--list-points", a->list_points, "say which points there are and what became of them, and end");
  r->add_flag("--dry-run", a->dry_run, "say how much there is to do, and end");
  r->add_flag("--json", a->json, "print counts for programs");
  r->footer(
      "Example: amrtex run experiments/quickstart/experiment.json --out out/quickstart\n"
      "         amrtex run data/amrex_tiny/plt00008 --out out/tiny");
  r->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
