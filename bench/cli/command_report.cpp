#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "bench/cli/commands.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/page/gallery.hpp"
#include "bench/report/page/page.hpp"
#include "bench/report/page/shown_pictures.hpp"
#include "bench/report/repetitions.hpp"
#include "bench/report/report_files.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::string folder, columns, title, all, output;
  std::vector<std::string> pictures;
  bool keep_pictures = false;
};

std::size_t write_plots(const fs::path& folder, const std::vector<Json>& records) {
  const std::vector<Plot> plots = report_plots(records);
  if (!plots.empty()) make_folder(folder / "plots");
  for (const Plot& plot : plots) write_atomically(folder / "plots" / (plot.name + ".svg"), to_svg(plot));
  return plots.size();
}

void require_picked(const ReportArguments& a, const std::vector<Json>& records) {
  for (const std::string& hash : a.pictures)
    if (std::none_of(records.begin(), records.end(), [&](const Json& r) {
          return !hash.empty() && r.at("configuration").is_string() && r["configuration"].get<std::string>().starts_with(hash);
        }))
      throw UsageError(fmt::format("--picture {}: no point of {} begins with it; accepted: the beginning of a configuration",
                                   quote(hash), a.folder));
}

std::string title_of(const ReportArguments& a, const std::vector<Json>& records) {
  if (!a.title.empty()) return a.title;
  std::vector<std::string> names;
  for (const Json& r : records)
    if (r.at("experiment").is_string() && std::find(names.begin(), names.end(), r["experiment"]) == names.end())
      names.push_back(r["experiment"]);
  return names.empty() ? fs::path(a.folder).filename().string() : fmt::format("{}", fmt::join(names, ", "));
}

int report_folder(const ReportArguments& a) {
  const RecordLines lines = load_record_lines(a.folder);
  print_warnings(lines.warnings);
  const std::vector<Json> records = one_a_point(lines.records);
  require_picked(a, records);
  FolderTables tables = write_tables(a.folder, a.columns, records);
  for (const auto* list : {&tables.ordinary, &tables.asked})
    for (const Table& t : *list) fmt::print("{}\n", to_markdown(t));
  const std::size_t plots = write_plots(a.folder, records);
  const Prose prose = prose_of_results(a.folder);
  const std::vector<ReportPart> parts = {{a.folder, records, std::move(tables.asked), std::move(tables.scatter)}};
  const PageData page = page_data(parts, {title_of(a, records), prose.question, prose.conclusion, a.pictures,
                                          PageOptions{}.most_pixels, has_live_plots()});
  print_warnings(page.warnings);
  if (a.keep_pictures)
    fmt::print("{}/pictures.npz: {} pictures\n", printable(a.folder), write_small_pictures(a.folder, page.pictured));
  write_atomically(fs::path(a.folder) / "report.html", page_html(page, Scripts::inside));
  fmt::print("{0}/table.md, {0}/table.csv, {0}/table.tex, {0}/report.html, {1} plots in {0}/plots\n", printable(a.folder), plots);
  return 0;
}

int report_all(const ReportArguments& a) {
  const Gallery gallery = write_gallery(a.all, a.output);
  print_warnings(gallery.warnings);
  fmt::print("{}/index.html: {} pages", printable(a.output), gallery.pages);
  if (!gallery.without.empty()) fmt::print("; without records: {}", fmt::join(gallery.without, ", "));
  fmt::print("\n");
  return 0;
}

int report(const ReportArguments& a) {
  if (!a.all.empty()) {
    if (!a.folder.empty()) throw UsageError("report: a folder and --all; accepted: one of them");
    if (a.output.empty()) throw UsageError("report: --all needs -o, the folder of the site");
    return report_all(a);
  }
  if (a.folder.empty())
    throw UsageError("report: a folder is required; accepted: a folder that `amrtex run` wrote, or --all EXPERIMENTS -o SITE");
  if (!a.output.empty()) throw UsageError("report: -o goes with --all; the report of a folder stands in it");
  return report_folder(a);
}

}  // namespace

void add_report_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<ReportArguments>();
  CLI::App* p =
      app.add_subcommand("report", "a page (HTML), tables (Markdown, CSV, LaTeX) and plots (SVG) from the records of a folder");
  p->add_option("folder", a->folder, "what `amrtex run` wrote");
  p->add_option("--columns", a->columns, "JSON list of column keys");
  p->add_option("--title", a->title, "of the page; else the experiment's name");
  p->add_option("--picture", a->pictures, "points whose pictures the page shows first: beginnings of configurations");
  p->add_flag(
      "--keep-pictures", a->keep_pictures,
      "write those that the page shows into pictures.npz, at most 128 pixels wide and high: for results that are committed");
  p->add_option("--all", a->all, "a folder of experiments: a site with a page for each");
  p->add_option("-o,--out", a->output, "with --all: the folder of the site");
  p->footer("Example: amrtex report out/quickstart\n         amrtex report --all experiments -o site");
  p->callback([a, &chosen] { chosen = [a] { return report(*a); }; });
}

}  // namespace amrtex
