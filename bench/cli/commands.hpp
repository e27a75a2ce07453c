// The subcommands of `amrtex`. Each adds itself to the parser; the chosen one runs and
// returns an exit code (0 ok, 1 the work failed). Exceptions are told in main.cpp.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "bench/settings/bytes_text.hpp"
#include "structures/common/encoding.hpp"

namespace amrtex {

using Command = std::function<int()>;

/// Each sets `chosen` when its subcommand was given.
void add_mesh_commands(CLI::App& app, Command& chosen);     // info, generate
void add_convert_command(CLI::App& app, Command& chosen);
void add_context_commands(CLI::App& app, Command& chosen);  // encodings, doctor
void add_sample_command(CLI::App& app, Command& chosen);
void add_structure_command(CLI::App& app, Command& chosen);
void add_render_command(CLI::App& app, Command& chosen);
void add_figure_commands(CLI::App& app, Command& chosen);  // figure, slice
void add_run_commands(CLI::App& app, Command& chosen);
void add_report_command(CLI::App& app, Command& chosen);
void add_measure_command(CLI::App& app, Command& chosen);
void add_compare_commands(CLI::App& app, Command& chosen);  // compare, merge
void add_verify_command(CLI::App& app, Command& chosen);
void add_advise_command(CLI::App& app, Command& chosen);
void add_settings_command(CLI::App& app, Command& chosen);
/// `--set key=value`, any number of times (bench/settings/override.hpp).
void add_set_option(CLI::App& command, std::vector<std::string>& set);

/// On stderr, a line each.
void print_warnings(const std::vector<std::string>& warnings);

/// A JSON file, or the JSON itself. Throws UsageError naming the file, or `what` for JSON without one, and the line.
Json read_json_argument(const std::string& text, const char* what);
/// Build parameters from texts NAME=VALUE. Throws UsageError.
Json parse_parameters(const std::vector<std::string>& given);
/// Throws UnsupportedError with the encoding's reason where this context cannot hold it.
void require_support(const Encoding& encoding, const ContextInfo& context);

}  // namespace amrtex
