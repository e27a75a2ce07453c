// Which records something is about, as people write it into tables.json (docs/experiments.md, "Conditions").
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/records/point_query.hpp"
#include "bench/settings/json_file.hpp"

namespace amrtex {

struct Conditions {
  /// JSON pointer -> the value that a record has there, or a list of such values. Not ordered_json, which tells
  /// objects apart by the order of their keys.
  std::map<std::string, nlohmann::json> values;
  /// Texts, each of which must hold as well.
  std::vector<std::shared_ptr<const PointQuery>> queries;
};

/// Throws UsageError unless `text` begins as a place in a record does: a misspelt pointer matches nothing, silently.
void check_record_pointer(const JsonNode& node, const std::string& text);

/// The key `where` of an object: an object replaces the given conditions pointer by pointer; a text joins them.
Conditions read_conditions(const JsonNode& node, Conditions where);

bool matches(const Json& record, const Conditions& where);

}  // namespace amrtex
