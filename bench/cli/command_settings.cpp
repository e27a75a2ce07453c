#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "bench/cli/commands.hpp"
#include "bench/settings/settings_text.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::string markdown, write;
  bool json = false;
};

void write_document(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) throw Error(fmt::format("{}: cannot be read, or is empty", path));
  write_atomically(path, with_settings(text.str()));
}

int run(const Arguments& a) {
  if (!a.write.empty())
    write_document(a.write);
  else if (a.json)
    fmt::print("{}\n", settings_json().dump(2));
  else
    fmt::print("{}", a.markdown.empty() ? settings_text() : settings_markdown(a.markdown));
  return 0;
}

}  // namespace

void add_settings_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("settings", "the keys of experiment and scene files");
  c->add_flag("--json", a->json, "for programs");
  c->add_option("--markdown", a->markdown, "the table of one object, such as render, or of the encodings' parameters");
  c->add_option("--write", a->write, "replace the tables between the markers of a Markdown file (docs/experiments.md)");
  c->footer("Example: amrtex settings --markdown render");
  c->callback([a, &chosen] { chosen = [a] { return run(*a); }; });
}

}  // namespace amrtex
