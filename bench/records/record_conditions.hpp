// Which records something is about, as people write it into tables.json (docs/experiments.md, "Conditions").
#pragma once

#include <map>
#include <string>

#include "bench/settings/json_file.hpp"

namespace amrtex {

/// JSON pointer -> the value that a record has there, or a list of such values. Not ordered_json, which tells
/// objects apart by the order of their keys.
using Conditions = std::map<std::string, nlohmann::json>;

/// Throws UsageError unless `text` begins as a place in a record does: a misspelt pointer matches nothing, silently.
void check_record_pointer(const JsonNode& node, const std::string& text);

/// The key `where` of an object; it replaces the given conditions pointer by pointer.
Conditions read_conditions(const JsonNode& node, Conditions where);

bool matches(const Json& record, const Conditions& where);

}  // namespace amrtex
