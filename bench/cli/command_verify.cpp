#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/cli/context_arguments.hpp"
#include "bench/measure/environment.hpp"
#include "bench/verify/verify.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::vector<std::string> suites;
  ContextArguments context;
  std::string output;
  std::size_t one_in = 1;
  bool full = false;
  bool json = false;
};

/// What the report holds, in one sentence.
std::string summary(const verify::Report& report, const Context& gl) {
  return fmt::format("{} cases on {}, {} failed, {} skipped", report.cases.size(), gl.info().renderer, report.failed(),
                     report.skipped.size());
}

/// DIR/verify.json; table.md, the list and what was skipped; cases.csv, every case.
void write_folder(const std::filesystem::path& folder, const verify::Report& report, const Json& json, const Context& gl) {
  write_atomically(folder / "verify.json", json.dump() + "\n");
  write_atomically(folder / "table.md",
                   fmt::format("{}\n\n{}\n{}\n{}\n", summary(report, gl), to_markdown(verify::coverage(report)),
                               to_markdown(verify::ranges(report)), to_markdown(verify::skipped(report))));
  write_atomically(folder / "cases.csv", to_csv(verify::all_cases(report)));
}

int run(const Arguments& a) {
  std::vector<const verify::Suite*> chosen;
  for (const std::string& name : a.suites) chosen.push_back(&verify::find_suite(name));
  if (chosen.empty())
    for (const verify::Suite& s : verify::suites()) chosen.push_back(&s);
  if (!a.output.empty()) make_folder(a.output);  // before minutes of work, not after them
  verify::VerifyOptions options;
  options.context = a.context.choice("egl");
  options.full = a.full;
  options.one_in = a.one_in;
  const bool terminal = isatty(STDERR_FILENO) != 0;
  if (terminal) options.progress = [](const std::string& name) { fmt::print(stderr, "\r\033[K{}", name.substr(0, 100)); };
  verify::Report report;
  verify::VerifyContext context(options, report);
  for (const verify::Suite* s : chosen) {
    context.begin(std::string(s->name));
    s->run(context);
  }
  if (terminal) fmt::print(stderr, "\r\033[K");
  Json json = verify::to_json(report);
  json["context"] = context_json();
  json["context"]["renderer"] = context.gl().info().renderer;
  json["context"]["gl_version"] = context.gl().info().version;
  if (!a.output.empty()) write_folder(a.output, report, json, context.gl());
  if (a.json) {
    fmt::print("{}\n", json.dump(1));
  } else {
    for (const Table& t : verify::to_tables(report)) fmt::print("{}\n", to_markdown(t));
    fmt::print("{}\n", summary(report, context.gl()));
  }
  return report.failed() == 0 && !report.cases.empty() ? 0 : 1;
}

}  // namespace

void add_verify_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  std::string names;
  for (const verify::Suite& s : verify::suites()) names += fmt::format("{}{}", names.empty() ? "" : ", ", s.name);
  CLI::App* c = app.add_subcommand("verify", "the numerical verification and stability suites, as tables");
  c->add_option("--suite", a->suites, "one suite, or several times one: " + names + " (default: all)");
  c->add_flag("--full", a->full, "more meshes, seeds and steps; takes many minutes");
  c->add_option("--one-in", a->one_in, "ask each case of one in so many encodings and filters, in turn (default: of all)")
      ->check(CLI::PositiveNumber);
  add_context_options(*c, a->context, "egl otherwise");
  c->add_flag("--json", a->json, "for programs");
  c->add_option("--out", a->output, "folder for verify.json, table.md and cases.csv as well");
  c->footer("Example: amrtex verify --suite analytic --context osmesa");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
