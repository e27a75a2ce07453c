#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "bench/commands.hpp"
#include "bench/verify/verify.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::vector<std::string> suites;
  std::string context = "egl";
  bool full = false;
  bool json = false;
};

int run(const Arguments& a) {
  std::vector<const verify::Suite*> chosen;
  for (const std::string& name : a.suites) chosen.push_back(&verify::find_suite(name));
  if (chosen.empty())
    for (const verify::Suite& s : verify::suites()) chosen.push_back(&s);
  verify::VerifyOptions options;
  options.context = parse_context_kind(a.context);
  options.full = a.full;
  const bool terminal = isatty(STDERR_FILENO) != 0;
  if (terminal) options.progress = [](const std::string& name) { fmt::print(stderr, "\r\033[K{}", name.substr(0, 100)); };
  verify::Report report;
  verify::VerifyContext context(options, report);
  for (const verify::Suite* s : chosen) {
    context.begin(std::string(s->name));
    s->run(context);
  }
  if (terminal) fmt::print(stderr, "\r\033[K");
  if (a.json) {
    fmt::print("{}\n", verify::to_json(report).dump(1));
  } else {
    for (const Table& t : verify::to_tables(report)) fmt::print("{}\n", to_markdown(t));
    fmt::print("{} cases on {}, {} failed, {} skipped\n", report.cases.size(), context.gl().info().renderer, report.failed(),
               report.skipped.size());
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
  c->add_option("--context", a->context, "egl, egl_device or osmesa");
  c->add_flag("--json", a->json, "for programs");
  c->footer("Example: amrtex verify --suite analytic --context osmesa");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
