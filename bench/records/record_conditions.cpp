#include "bench/records/record_conditions.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bench/records/record.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

bool accepts(const nlohmann::json& accepted, const nlohmann::json& value) {
  return accepted == value || (accepted.is_array() && std::find(accepted.begin(), accepted.end(), value) != accepted.end());
}

}  // namespace

void check_record_pointer(const JsonNode& node, const std::string& text) {
  std::vector<std::string> keys = {"/statistics", "/storage_scale", "/change"};
  const Json blank = blank_record(Status::ok);
  for (const auto& [key, value] : blank.items()) keys.push_back("/" + key);
  const std::string first = text.substr(0, text.find('/', 1));
  const bool escapes = text.find('~') != std::string::npos;  // no key of a record needs them
  if (!escapes && std::find(keys.begin(), keys.end(), first) != keys.end()) return;
  const std::vector<std::string_view> names(keys.begin(), keys.end());
  node.fail(fmt::format("{} is no place in a record; accepted: a JSON pointer as /render/mode that begins with one of {}{}",
                        quote(text), fmt::join(names, ", "), suggestion(first, names)));
}

Conditions read_conditions(const JsonNode& node, Conditions where) {
  if (const auto given = node.find("where"))
    for (const auto& [pointer, value] : given->members()) {
      check_record_pointer(value, pointer);
      value.items();  // refuses the empty list
      where.insert_or_assign(pointer, value.json());
    }
  return where;
}

bool matches(const Json& record, const Conditions& where) {
  return std::all_of(where.begin(), where.end(), [&](const auto& c) { return accepts(c.second, value_at(record, c.first)); });
}

}  // namespace amrtex
