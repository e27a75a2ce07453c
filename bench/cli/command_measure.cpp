// `amrtex measure`: what `amrtex run` starts to measure in. Nobody types it.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/cli/run_arguments.hpp"
#include "bench/measure/measuring_child.hpp"
#include "bench/measure/measuring_process.hpp"

namespace amrtex {

Experiment RunArguments::experiment() const { return read_experiment(input, {.set = set, .most_points = max_points}); }

RunOptions RunArguments::options() const {
  RunOptions options;
  options.folder = output;
  options.pictures = !no_pictures;
  options.shader_cache = options.folder / "shader_cache";
  if (!context.empty()) options.context = parse_context_kind(context);
  if (!memory_limit.empty()) options.memory_limit = parse_bytes(memory_limit);
  return options;
}

std::vector<std::string> RunArguments::measuring_process() const {
  std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(), "measure", input, "--out", output,
                                    "--max-points", fmt::format("{}", max_points)};
  const auto add = [&](const char* option, const std::string& value) {
    if (!value.empty()) words.insert(words.end(), {option, value});
  };
  add("--context", context);
  add("--memory-limit", memory_limit);
  for (const std::string& s : set) add("--set", s);
  if (no_pictures) words.emplace_back("--no-pictures");
  return words;
}

void add_run_arguments(CLI::App& command, RunArguments& a) {
  command.add_option("experiment", a.input, "experiment file (docs/experiments.md)")->required();
  command.add_option("--out", a.output, "folder for records, pictures and tables")->required();
  command.add_option("--context", a.context, "egl, egl_device or osmesa; overrides the experiment's");
  command.add_option("--memory-limit", a.memory_limit, "for one structure, as 512MiB");
  add_set_option(command, a.set);
  command.add_option("--max-points", a.max_points, "points of one file, above which it is refused")->capture_default_str();
  command.add_flag("--no-pictures", a.no_pictures, "keep no pictures of the points");
}

void add_measure_command(CLI::App& app, Command& chosen) {
  auto a = std::make_shared<RunArguments>();
  CLI::App* m = app.add_subcommand("measure", "what `amrtex run` starts to measure in: reads questions, answers on descriptor 3");
  m->group("");  // shown in no help
  add_run_arguments(*m, *a);
  m->callback([a, &chosen] {
    chosen = [a] {
      Experiment experiment = a->experiment();
      const RunOptions options = a->options();
      if (options.context) experiment.context = context_kind_name(*options.context);
      if (options.memory_limit) experiment.memory_limit = options.memory_limit;
      return answer_questions(experiment, options, 0, kAnswers);
    };
  });
}

}  // namespace amrtex
