// compare, merge
#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "bench/cli/commands.hpp"
#include "bench/records/merge_records.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/compare.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string a, b, out;
  std::vector<std::string> inputs;
  ComparisonRules rules;
  bool exit_code = false;
  bool json = false;
};

/// What cannot be read is bad usage here: exit code 1 is that of a finding.
ComparedFolder read_folder(const std::string& folder) {
  try {
    RecordLines lines = load_record_lines(folder);
    print_warnings(lines.warnings);
    return {folder, std::move(lines.records)};
  } catch (const Error& error) {
    throw UsageError(error.what());
  }
}

void check_rules(const ComparisonRules& rules) {
  if (!(rules.effect >= 0 && rules.effect <= 1))
    throw UsageError(fmt::format("--effect {}: accepted: a share from 0 to 1, as 0.02", rules.effect));
  if (!(rules.level >= 1e-6 && rules.level <= 0.5))
    throw UsageError(fmt::format("--level {}: accepted: a probability from 1e-6 to 0.5, as 0.05", rules.level));
}

int compare(const Arguments& a) {
  check_rules(a.rules);
  const ComparedFolder first = read_folder(a.a), second = read_folder(a.b);
  const FolderComparison comparison = compare_folders(first, second, a.rules);
  if (a.json) {
    fmt::print("{}\n", comparison_json(comparison).dump(-1, ' ', false, Json::error_handler_t::replace));
  } else {
    fmt::print("A: {}\nB: {}\n", printable(a.a), printable(a.b));
    if (!comparison.one_context) fmt::print("two contexts: only ratios to the baselines are compared, and no picture\n");
    for (const std::string& note : comparison.notes) fmt::print("{}\n", printable(note));
    fmt::print("\n");
    for (const Table& table : comparison_tables(comparison)) fmt::print("{}\n", to_markdown(table));
    fmt::print("{}", comparison_summary(comparison));
  }
  return a.exit_code && has_findings(comparison) ? 1 : 0;
}

/// The choice of tables goes along with the records, unless the folder has its own.
void copy_table_choices(const fs::path& out, const std::vector<fs::path>& inputs) {
  for (const char* name : {"columns.json", "tables.json"})
    for (const fs::path& input : inputs) {
      std::error_code ignored;
      if (fs::exists(out / name, ignored) || !fs::exists(input / name, ignored)) continue;
      fs::copy_file(input / name, out / name);
    }
}

int merge(const Arguments& a) {
  const std::vector<fs::path> inputs(a.inputs.begin(), a.inputs.end());
  const MergedRecords merged = merge_records(a.out, inputs);
  print_warnings(merged.warnings);
  copy_table_choices(a.out, inputs);
  if (a.json)
    fmt::print("{}\n", Json{{"added", merged.added}, {"present", merged.present}, {"renumbered", merged.renumbered}, {"pictures", merged.pictures}}.dump());
  else
    fmt::print("{}: {} records added, {} of them as further repetitions; {} were there; pictures of {} points taken along\n",
               printable(a.out), merged.added, merged.renumbered, merged.present, merged.pictures);
  return 0;
}

}  // namespace

void add_compare_commands(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("compare", "two folders of records: what differs, what became faster or slower");
  c->add_option("a", a->a, "what `amrtex run --repeat 5` wrote: the old program, or the other machine")->required();
  c->add_option("b", a->b, "the same of the new one")->required();
  c->add_option("--effect", a->rules.effect, "share by which a time may change and still be the same")->capture_default_str();
  c->add_option("--level", a->rules.level, "probability that a comparison of equals calls any point faster or slower")
      ->capture_default_str();
  c->add_flag("--exit-code", a->exit_code, "exit 1 where something is slower, or bytes, errors, pictures or statuses differ");
  c->add_flag("--json", a->json, "print everything for programs");
  c->footer("Example: amrtex compare out/before out/after --exit-code   (docs/comparing.md says how many repetitions)");
  c->callback([a, &chosen] { chosen = [a] { return compare(*a); }; });

  CLI::App* m = app.add_subcommand("merge", "add the records of folders, of other machines perhaps, to those of another");
  m->add_option("out", a->out, "folder that gets them; made where it is not there")->required();
  m->add_option("in", a->inputs, "folders that `amrtex run` wrote; they stay as they are")->required();
  m->add_flag("--json", a->json, "print counts for programs");
  m->footer("Example: amrtex merge out/all out/laptop out/workstation");
  m->callback([a, &chosen] { chosen = [a] { return merge(*a); }; });
}

}  // namespace amrtex
