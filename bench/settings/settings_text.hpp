// The keys of experiment and scene files as text: for people, for programs, and for the documentation.
#pragma once

#include <string>
#include <string_view>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// [{"section", "key", "type", "accepted", "default", "required", "unit", "axis_depth", "reference", "record", "column", "takes",
/// "help"}]
Json settings_json();
/// One line a key, by section.
std::string settings_text();
/// A Markdown table of one section; "parameters": the build parameters of all encodings.
std::string settings_markdown(std::string_view section);
/// Replaces what stands between `<!-- settings:SECTION -->` and `<!-- /settings:SECTION -->`. Throws UsageError for a section
/// that there is not and a marker without its end.
std::string with_settings(const std::string& document);

}  // namespace amrtex
