// amrtex: the command line. Exit codes: 0 ok, 1 the work failed, 2 bad usage.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <new>
#include <string>
#include <vector>

#include "bench/cli/commands.hpp"
#include "bench/cli/newer_runtime.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace {

using Names = std::vector<std::string>;

Names commands_of(const CLI::App& app) {
  Names names;
  for (const CLI::App* c : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(c->get_name());
  return names;
}

Names options_of(const CLI::App& command) {
  Names names;
  for (const CLI::Option* o : command.get_options()) names.push_back(o->get_name());
  return names;
}

/// One line: what is wrong with the command line and what is accepted there.
std::string complaint(const CLI::App& app, const CLI::ParseError& error) {
  const Names rest = app.remaining(true);
  const auto given = app.get_subcommands();
  if (given.empty())
    return fmt::format("{}; accepted: {}",
                       rest.empty() ? "no command given" : fmt::format("no command {}", amrtex::quote(rest.front())),
                       fmt::join(commands_of(app), ", "));
  const CLI::App& command = *given.front();
  if (!rest.empty())
    return fmt::format("{}: {} was not expected; accepted: {}", command.get_name(), amrtex::quote(rest.front()),
                       fmt::join(options_of(command), ", "));
  return fmt::format("{0}: {1}; see `amrtex {0} --help`", command.get_name(), amrtex::one_line(error.what(), 200));
}

/// One line on stderr, of at most 400 characters, whatever a file or a command line put into the message.
void print_error(std::string_view what) {
  constexpr std::string_view kFront = "amrtex: ";
  fmt::print(stderr, "{}{}\n", kFront, amrtex::one_line(what, 400 - kFront.size()));
}

}  // namespace

void amrtex::print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "amrtex: warning: {}\n", one_line(warning, 380));
}

int main(int argc, char** argv) {
  amrtex::prefer_newer_cpp_library(argv);
  CLI::App app{"amrtex: GPU encodings of AMR data, compared by memory, frame time and image error"};
  app.name("amrtex");
  app.require_subcommand(1);
  app.set_version_flag("--version", "amrtex 0.1.0");
  app.footer("Example: amrtex run experiments/quickstart/experiment.json --out out/quickstart");
  amrtex::Command chosen;
  amrtex::add_context_commands(app, chosen);
  amrtex::add_mesh_commands(app, chosen);
  amrtex::add_convert_command(app, chosen);
  amrtex::add_sample_command(app, chosen);
  amrtex::add_structure_command(app, chosen);
  amrtex::add_render_command(app, chosen);
  amrtex::add_figure_commands(app, chosen);
  amrtex::add_run_commands(app, chosen);
  amrtex::add_report_command(app, chosen);
  amrtex::add_measure_command(app, chosen);
  amrtex::add_compare_commands(app, chosen);
  amrtex::add_verify_command(app, chosen);
  amrtex::add_advise_command(app, chosen);
  amrtex::add_settings_command(app, chosen);
  std::vector<std::string> words(argv + 1, argv + argc);
  for (std::string& word : words)
    if (word == "-fovy" || word == "-fov") word = "--fovy";  // as the camera lines of other programs have it
  std::reverse(words.begin(), words.end());                  // the parser takes the last one first
  try {
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    print_error(complaint(app, error));
    return 2;
  }
  try {
    return chosen();
  } catch (const amrtex::UsageError& error) {
    print_error(error.what());
    return 2;
  } catch (const std::bad_alloc&) {
    print_error("this machine has not enough memory for it");
    return 1;
  } catch (const std::exception& error) {
    print_error(error.what());
    return 1;
  }
}
