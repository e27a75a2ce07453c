#include <CLI/CLI.hpp>

#include "bench/cli/context_arguments.hpp"

namespace amrtex {

void add_context_options(CLI::App& command, ContextArguments& arguments, const std::string& otherwise) {
  command.add_option("--context", arguments.context, "egl, egl_device or osmesa; " + otherwise);
  command.add_option("--device", arguments.device, "number of the device as `amrtex doctor` lists it, of --context egl_device")
      ->check(CLI::NonNegativeNumber);
}

}  // namespace amrtex
