#include "structures/generators/spec_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {

namespace {

bool is_finite_number(const Json& value) { return value.is_number() && std::isfinite(value.get<double>()); }

bool is_list_of_numbers(const Json& value, std::size_t count) {
  return value.is_array() && value.size() == count && std::all_of(value.begin(), value.end(), is_finite_number);
}

// Unsigned values beyond 2^63 would wrap in get<int64_t>.
bool is_integer_within(const Json& value, std::int64_t lowest, std::int64_t highest) {
  if (!value.is_number_integer()) return false;
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX)) return false;
  const auto v = value.get<std::int64_t>();
  return v >= lowest && v <= highest;
}

}  // namespace

SpecReader::SpecReader(const Json& object, std::string path) : object_(object), path_(std::move(path)) {
  if (object.is_object()) return;
  throw UsageError(fmt::format("generator {}: {} is not accepted; accepted: a JSON object",
                               path_.empty() ? std::string("specification") : fmt::format("key \"{}\"", path_), shown(object)));
}

std::string SpecReader::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

const Json* SpecReader::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  const auto it = object_.find(std::string(key));
  return it == object_.end() ? nullptr : &*it;
}

void SpecReader::refuse(std::string_view key, std::string_view accepted) const {
  const auto it = object_.find(std::string(key));
  throw UsageError(fmt::format("generator key \"{}\": {} is not accepted; accepted: {}", path_of(key),
                               it == object_.end() ? std::string("the default") : shown(*it), accepted));
}

double SpecReader::number(std::string_view key, double fallback, std::string_view accepted, bool (*acceptable)(double)) {
  const Json* value = find(key);
  if (value == nullptr) return fallback;
  if (!is_finite_number(*value) || !acceptable(value->get<double>())) refuse(key, accepted);
  return value->get<double>();
}

double SpecReader::number(std::string_view key, double fallback) { return number(key, fallback, "a finite number", is_any); }

std::int64_t SpecReader::integer(std::string_view key, std::int64_t fallback, std::int64_t lowest, std::int64_t highest) {
  const Json* value = find(key);
  if (value == nullptr) return fallback;
  if (!is_integer_within(*value, lowest, highest)) refuse(key, fmt::format("an integer from {} to {}", lowest, highest));
  return value->get<std::int64_t>();
}

bool SpecReader::boolean(std::string_view key, bool fallback) {
  const Json* value = find(key);
  if (value == nullptr) return fallback;
  if (!value->is_boolean()) refuse(key, "true or false");
  return value->get<bool>();
}

std::string SpecReader::text(std::string_view key, const std::string& fallback) {
  const Json* value = find(key);
  if (value == nullptr) return fallback;
  if (!value->is_string() || value->get<std::string>().empty()) refuse(key, "a text that is not empty");
  return value->get<std::string>();
}

std::string SpecReader::choice(std::string_view key, std::string_view fallback, std::span<const std::string_view> choices) {
  const Json* value = find(key);
  if (value == nullptr) return std::string(fallback);
  const bool known = value->is_string() && std::find(choices.begin(), choices.end(), value->get<std::string>()) != choices.end();
  if (!known) refuse(key, fmt::format("one of {}", fmt::join(choices, ", ")));
  return value->get<std::string>();
}

std::vector<double> SpecReader::numbers(std::string_view key, const std::vector<double>& fallback, std::size_t count) {
  const Json* value = find(key);
  if (value == nullptr) return fallback;
  if (!is_list_of_numbers(*value, count)) refuse(key, fmt::format("a list of {} finite numbers", count));
  return value->get<std::vector<double>>();
}

Vec3d SpecReader::vector(std::string_view key, const Vec3d& fallback) {
  const std::vector<double> v = numbers(key, {fallback.x, fallback.y, fallback.z}, 3);
  return {v[0], v[1], v[2]};
}

void SpecReader::finish() const {
  for (const auto& [key, value] : object_.items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    throw UsageError(fmt::format("unknown generator key \"{}\" (value {}); accepted here: {}", clipped(path_of(key)),
                                 shown(value), fmt::join(known_, ", ")));
  }
}

}  // namespace amrtex
