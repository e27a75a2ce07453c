#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/figure/layout.hpp"
#include "bench/settings/figure_settings.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::string input, output;
};

int run(const Arguments& a) {
  const std::string extension = std::filesystem::path(a.output).extension();
  if (extension != ".svg" && extension != ".pdf" && extension != ".png")
    throw UsageError(fmt::format("-o {}: accepted: a name ending in .svg, .pdf or .png", clipped(a.output)));
  write_atomically(a.output, figure_file(read_figure(a.input), extension));
  return 0;
}

}  // namespace

void add_figure_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("figure", "panels of pictures, errors, heat maps and slices for a page of paper");
  c->add_option("input", a->input, "figure file: what stands in its panels (docs/figures.md)")->required();
  c->add_option("-o,--out", a->output, ".svg, .pdf or .png")->required();
  c->footer("Example: amrtex figure docs/images/figure_encodings.json -o figure.pdf");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
