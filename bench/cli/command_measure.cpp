// `amrtex measure`: what `amrtex run` starts to measure in. Nobody types it.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/commands.hpp"
#include "bench/cli/run_arguments.hpp"
#include "bench/measure/measuring_child.hpp"
#include "bench/measure/measuring_process.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {

namespace {

/// The record whose configuration begins with `hash`, of a file or a folder of records.
Json record_of(const std::filesystem::path& file, const std::string& hash) {
  const std::filesystem::path folder = std::filesystem::is_directory(file) ? file : file.parent_path();
  std::vector<Json> found;
  for (Json& record : load_records(folder))
    if (record.value("configuration", Json()).is_string() && record["configuration"].get<std::string>().starts_with(hash))
      if (found.empty() || found.back()["configuration"] != record["configuration"]) found.push_back(std::move(record));
  if (found.size() != 1)
    throw UsageError(fmt::format("--from-record: {} points of {} begin with {}; accepted: the beginning of one configuration",
                                 found.size(), file.string(), quote(hash)));
  return found.front();
}

Experiment experiment_of_record(const RunArguments& a) {
  const std::filesystem::path file = a.record.at(0);
  const Json record = record_of(file, a.record.at(1));
  if (!record.at("asked").is_object())
    throw UsageError(
        fmt::format("--from-record: the record {} does not say where its data came from: it is of {}; accepted: records of {}",
                    quote(a.record[1]), record.at("schema").get<std::string>(), kRecordSchema));
  return parse_experiment(record["asked"].dump(), file, {.set = a.set, .most_points = a.max_points});
}

}  // namespace

Experiment RunArguments::experiment() const {
  if (input.empty() && record.empty())
    throw UsageError("run: an experiment is required; accepted: a file, or --from-record FILE HASH");
  if (!record.empty()) return experiment_of_record(*this);
  return read_experiment(input, {.set = set, .most_points = max_points});
}

RunOptions RunArguments::options() const {
  RunOptions options;
  options.folder = output;
  options.pictures = !no_pictures;
  options.shader_cache = options.folder / "shader_cache";
  if (context.given()) options.context = context.choice("egl");
  if (!memory_limit.empty()) options.memory_limit = parse_bytes(memory_limit);
  return options;
}

std::vector<std::string> RunArguments::measuring_process() const {
  std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(),
                                    "measure",
                                    "--out",
                                    output,
                                    "--max-points",
                                    fmt::format("{}", max_points)};
  if (record.empty())
    words.push_back(input);
  else
    words.insert(words.end(), {"--from-record", record[0], record[1]});
  const auto add = [&](const char* option, const std::string& value) {
    if (!value.empty()) words.insert(words.end(), {option, value});
  };
  if (context.given()) add("--context", context.choice("egl").name());
  add("--memory-limit", memory_limit);
  for (const std::string& s : set) add("--set", s);
  if (no_pictures) words.emplace_back("--no-pictures");
  return words;
}

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
