#include <fmt/format.h>

#include "bench/cli/commands.hpp"
#include "bench/settings/experiment.hpp"
#include "renderers/bindings/transfer_bindings.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/raw_volume/raw_volume.hpp"
#include "structures/readers/write_mesh.hpp"

namespace amrtex {
namespace {

struct Arguments {
  std::string input, output, field, format, transfer_function;
  CoarsenCriterion criterion;
  bool states_criterion = false;
};

std::vector<std::string> fields_of(const Arguments& a) {
  return a.field.empty() ? std::vector<std::string>() : std::vector{a.field};
}

/// A volume of equal cells, made into a mesh by what the command line says.
MeshDescription coarsened(const Arguments& a) {
  CoarsenCriterion criterion = a.criterion;
  if (!a.transfer_function.empty())
    criterion.hidden = invisible_ranges(parse_transfer_function(read_json_argument(a.transfer_function, "--transfer-function")));
  validate(criterion);
  Volume volume = read_volume(a.input);
  if (!a.field.empty() && a.field != volume.field)
    throw UsageError(fmt::format("{}: no field {}; its field is {}", a.input, quote(a.field), quote(volume.field)));
  return coarsen_volume(std::move(volume), criterion);
}

int convert(const Arguments& a) {
  require_writable_format(a.output, a.format);
  if (!a.states_criterion) {
    write_mesh(AmrHierarchy(read_mesh(a.input, fields_of(a))), a.output, a.format);
    return 0;
  }
  if (!is_raw_volume(a.input) && why_absent(a.input).empty())
    throw UsageError(fmt::format(
        "{}: --tolerance, --levels, --block and --transfer-function are for volumes of equal cells: .raw, NRRD, .npy", a.input));
  write_mesh(AmrHierarchy(coarsened(a)), a.output, a.format);
  return 0;
}

}  // namespace

void add_convert_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("convert", "a data set of any readable format, in a format that is written");
  c->add_option("in", a->input, "data set")->required();
  c->add_option("out", a->output,
                "what to write; must not exist. Its ending says the format, a name without one is a plotfile's folder")
      ->required();
  c->add_option("--field", a->field, "only this field");
  c->add_option("--format", a->format, "whatever the ending: " + written_formats());
  const std::vector<CLI::Option*> criterion = {
      c->add_option(
          "--tolerance", a->criterion.tolerance,
          "of a volume of equal cells: a block becomes coarse where no value differs from its coarse cell's by more than "
          "this share of the range (default 1/256)"),
      c->add_option("--transfer-function", a->transfer_function,
                    "of a volume: a block becomes coarse where this hides all its values as well; JSON or a file of it"),
      c->add_option("--levels", a->criterion.levels, "of a volume: at most, 1 to 16 (default 5)"),
      c->add_option("--block", a->criterion.block, "of a volume: cells along an axis that become coarse together (default 8)")};
  c->footer(
      "Example: amrtex convert data/amrex_tiny/plt00008 out/copy.cells\nValues under finer patches become the means of what "
      "covers "
      "them.");
  c->callback([a, criterion, &chosen] {
    for (const CLI::Option* option : criterion) a->states_criterion = a->states_criterion || option->count() > 0;
    chosen = [a] { return convert(*a); };
  });
}

}  // namespace amrtex
