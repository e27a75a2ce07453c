// `amrtex measure`: what `amrtex run` starts to measure in. Nobody types it.
#include "bench/cli/commands.hpp"
#include "bench/cli/run_arguments.hpp"
#include "bench/measure/measuring_child.hpp"
#include "bench/measure/measuring_process.hpp"

namespace amrtex {

void add_run_arguments(CLI::App& command, RunArguments& a) {
  CLI::Option* input = command.add_option("experiment", a.input, "experiment file (docs/experiments.md)");
  CLI::Option* record =
      command.add_option("--from-record", a.record, "FILE HASH: the one point of a record, in place of an experiment file")
          ->expected(2);
  input->excludes(record);
  command.add_option("--out", a.output, "folder for records, pictures and tables")->required();
  add_context_options(command, a.context, "overrides the experiment's");
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
      if (options.context) experiment.context = options.context->name();
      if (options.memory_limit) experiment.memory_limit = options.memory_limit;
      return answer_questions(experiment, options, 0, kAnswers);
    };
  });
}

}  // namespace amrtex
