#include "bench/cli/run_arguments.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/settings/bytes_text.hpp"
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

std::vector<std::string> RunArguments::measuring_process(const std::string& program) const {
  std::vector<std::string> words = {program, "measure", "--out", output, "--max-points", fmt::format("{}", max_points)};
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

}  // namespace amrtex
