// amrtex: the command line. Exit codes: 0 ok, 1 the work failed, 2 bad usage.
#include <fmt/format.h>

#include <cstdio>

#include "bench/commands.hpp"
#include "structures/error.hpp"

int main(int argc, char** argv) {
  CLI::App app{"amrtex: GPU encodings of AMR data, compared by memory, frame time and image error"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "amrtex 0.1.0");
  app.footer("Example: amrtex run experiments/quickstart/experiment.json --out out/quickstart");
  amrtex::Command chosen;
  amrtex::add_context_commands(app, chosen);
  amrtex::add_mesh_commands(app, chosen);
  amrtex::add_sample_command(app, chosen);
  amrtex::add_render_command(app, chosen);
  amrtex::add_run_commands(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return chosen();
  } catch (const amrtex::UsageError& error) {
    fmt::print(stderr, "amrtex: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "amrtex: {}\n", error.what());
    return 1;
  }
}
