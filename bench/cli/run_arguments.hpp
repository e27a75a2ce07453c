// What `amrtex run` and the processes that it starts are given.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench/cli/context_arguments.hpp"
#include "bench/measure/run_options.hpp"

namespace CLI {
class App;
}

namespace amrtex {

/// All that says which experiment it is and where it goes.
struct RunArguments {
  std::string input, output, memory_limit;
  ContextArguments context;
  std::vector<std::string> record;  ///< a file of records, and a configuration: the experiment is that of this point
  std::vector<std::string> set;
  std::uint64_t max_points = ReadOptions{}.most_points;
  bool no_pictures = false;

  Experiment experiment() const;
  RunOptions options() const;
  /// The same as words of a command line that begins with `program`, which is amrtex, and `measure`.
  std::vector<std::string> measuring_process(const std::string& program) const;
};

void add_run_arguments(CLI::App& command, RunArguments& arguments);

}  // namespace amrtex
