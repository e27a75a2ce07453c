#include "renderers/scene/setting.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();

std::string text_of(const Json& value) { return value.is_string() ? clipped(value.get_ref<const std::string&>()) : shown(value); }

/// "a", "a and b", "a, b and c".
std::string enumerated(const std::vector<Json>& values) {
  std::string text;
  for (std::size_t i = 0; i < values.size(); ++i)
    text += (i == 0 ? "" : i + 1 == values.size() ? " and " : ", ") + text_of(values[i]);
  return text;
}

bool contains(const std::vector<Json>& values, const Json& value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

/// "dvr, projection" with other names in brackets.
std::string choices_text(const ValueType& type) {
  std::vector<std::string> texts;
  for (const std::string& choice : type.choices) {
    texts.push_back(choice);
    for (const auto& [alias, meant] : type.aliases)
      if (meant == choice) texts.back() += fmt::format(" (or {})", alias);
  }
  return fmt::format("{}", fmt::join(texts, ", "));
}

std::string range_text(const ValueType& type) {
  const std::string article = type.kind == Kind::integer ? "an integer" : "a number";
  const bool from = type.min > -kLargest, to = type.max < (type.kind == Kind::integer ? 0x1p63 : kLargest);
  if (!from && !to) return article;
  if (from && !to) return fmt::format("{} {} {}", article, type.above ? "above" : "of at least", type.min);
  if (type.above && type.below) return fmt::format("{} between {} and {}", article, type.min, type.max);
  if (type.above) return fmt::format("{} above {}, in ({}, {}]", article, type.min, type.min, type.max);
  if (type.kind == Kind::integer)
    return fmt::format("{} from {} to {}", article, static_cast<std::int64_t>(type.min), static_cast<std::int64_t>(type.max));
  return fmt::format("{} from {} to {}", article, type.min, type.max);
}

std::string element_text(const ValueType& type) {
  switch (type.kind) {
    case Kind::boolean:
      return "true or false";
    case Kind::integer:
    case Kind::number:
      return range_text(type);
    case Kind::text:
      return "a string";
    case Kind::choice:
      return choices_text(type);
    case Kind::object:
      break;
  }
  std::vector<std::string> names;
  for (const Key& member : type.members)
    if (!member.derived) names.push_back(member.name);
  return names.empty() ? "an object" : fmt::format("an object with {}", fmt::join(names, ", "));
}

bool in_range(double value, const ValueType& type) {
  if (!std::isfinite(value)) return false;
  return (type.above ? value > type.min : value >= type.min) && (type.below ? value < type.max : value <= type.max);
}

bool is_integer(const Json& value) {
  if (!value.is_number_integer()) return false;
  return !value.is_number_unsigned() ||
         value.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
}

std::optional<Problem> expected(const Json& value, const ValueType& type) {
  return Problem{"", fmt::format("{} is expected, not {}", element_text(type), shown(value))};
}

std::optional<Problem> choice_problem(const Json& value, const ValueType& type) {
  if (!value.is_string()) return Problem{"", fmt::format("a string is expected, not {}", shown(value))};
  const std::string name = value.get<std::string>();
  std::vector<std::string_view> known(type.choices.begin(), type.choices.end());
  for (const auto& alias : type.aliases) known.push_back(alias.first);
  if (std::find(known.begin(), known.end(), name) != known.end()) return std::nullopt;
  return Problem{"", fmt::format("unknown value {}; accepted: {}{}", shown(value), choices_text(type), suggestion(name, known))};
}

std::optional<Problem> object_problem(const Json& value, const ValueType& type) {
  if (!value.is_object()) return expected(value, type);
  std::vector<std::string_view> names;
  for (const Key& member : type.members)
    if (!member.derived) names.push_back(member.name);
  for (const auto& [key, ignored] : value.items())
    if (std::find(names.begin(), names.end(), key) == names.end())
      return Problem{"." + key, fmt::format("unknown key; accepted: {}{}", fmt::join(names, ", "), suggestion(key, names))};
  for (const Key& member : type.members) {
    const auto found = value.find(member.name);
    if (found == value.end() && member.required) return Problem{"", fmt::format("the key '{}' is missing", member.name)};
    if (found == value.end() || member.derived) continue;
    if (auto problem = value_problem(*found, member.type)) return Problem{"." + member.name + problem->place, problem->text};
  }
  return std::nullopt;
}

std::optional<Problem> element_problem(const Json& value, const ValueType& type) {
  switch (type.kind) {
    case Kind::boolean:
      return value.is_boolean() ? std::nullopt : expected(value, type);
    case Kind::integer:
      return is_integer(value) && in_range(value.get<double>(), type) ? std::nullopt : expected(value, type);
    case Kind::number:
      return value.is_number() && in_range(value.get<double>(), type) ? std::nullopt : expected(value, type);
    case Kind::text:
      return value.is_string() ? std::nullopt : expected(value, type);
    case Kind::choice:
      return choice_problem(value, type);
    case Kind::object:
      return object_problem(value, type);
  }
  return std::nullopt;
}

/// `depth`: lists that are still around the elements, this one included.
std::optional<Problem> list_problem(const Json& value, const ValueType& type, int depth) {
  const bool outermost = depth == type.depth, fixed = depth == 1 && type.width > 0;
  if (!value.is_array()) {
    if (outermost && !fixed)  // one element stands for a list of it
      return depth > 1 ? list_problem(value, type, depth - 1) : element_problem(value, type);
    return Problem{"", fmt::format("accepted: {}", type.form)};
  }
  if (value.empty())
    return type.may_be_empty && outermost ? std::nullopt : std::optional(Problem{"", "an empty list gives no value"});
  if (fixed && value.size() != type.width) return Problem{"", fmt::format("accepted: {}", type.form)};
  if (outermost && type.most > 0 && value.size() > type.most)
    return Problem{"", fmt::format("{} values; at most {} are accepted", value.size(), type.most)};
  for (std::size_t i = 0; i < value.size(); ++i)
    if (auto problem = depth > 1 ? list_problem(value[i], type, depth - 1) : element_problem(value[i], type))
      return Problem{fmt::format("[{}]{}", i, problem->place), problem->text};
  return std::nullopt;
}

}  // namespace

ValueType ValueType::or_null() const {
  ValueType type = *this;
  type.nullable = true;
  return type;
}

ValueType boolean_type() { return {.kind = Kind::boolean}; }

ValueType integer_type(std::int64_t min, std::int64_t max) {
  return {.kind = Kind::integer, .min = static_cast<double>(min), .max = static_cast<double>(max)};
}

ValueType number_type() { return {.kind = Kind::number}; }

ValueType number_type(double min, double max) { return {.kind = Kind::number, .min = min, .max = max}; }

ValueType number_above(double min, double max) { return {.kind = Kind::number, .min = min, .max = max, .above = true}; }

ValueType text_type() { return {.kind = Kind::text}; }

ValueType choice_type(std::vector<std::string> choices) { return {.kind = Kind::choice, .choices = std::move(choices)}; }

ValueType object_type(std::vector<Key> members) { return {.kind = Kind::object, .members = std::move(members)}; }

ValueType list_of(ValueType element, std::size_t width, std::string form) {
  element.depth = 1;
  element.width = width;
  element.form = std::move(form);
  return element;
}

ValueType lists_of(ValueType element, std::size_t width, std::string form) {
  element = list_of(std::move(element), width, std::move(form));
  element.depth = 2;
  return element;
}

std::string accepted_text(const ValueType& type) {
  std::string text = type.form.empty() ? element_text(type) : type.form;
  if (type.most > 0) text += fmt::format(", at most {}", type.most);
  return type.nullable ? text + (type.most > 0 ? ", or null" : " or null") : text;
}

int list_depth(const Json& json) { return !json.is_array() ? 0 : 1 + (json.empty() ? 0 : list_depth(json.front())); }

std::optional<Problem> value_problem(const Json& value, const ValueType& type) {
  if (value.is_null() && type.nullable) return std::nullopt;
  return type.depth > 0 ? list_problem(value, type, type.depth) : element_problem(value, type);
}

std::optional<std::string> condition_problem(const Key& key, const Json& value, Otherwise otherwise,
                                             const std::function<Json(const std::string&)>& other,
                                             const std::function<Json(const std::string&)>& default_of) {
  for (const Condition& c : key.takes) {
    if (c.otherwise != otherwise || (!c.when.empty() && !contains(c.when, value))) continue;
    const Json found = other(c.with);
    if (c.accepted.empty() ? found != default_of(c.with) : contains(c.accepted, found)) continue;
    if (c.accepted.empty()) return fmt::format("belongs to the key '{}', which is not given", c.with);
    if (otherwise == Otherwise::belongs)
      return fmt::format("belongs to the {} {} and only there", c.with, enumerated(c.accepted));
    if (!c.accepted.front().is_string()) return fmt::format("{}; accepted: one of both", c.why);
    return fmt::format("{}: it accepts the {}{} {}, not {}", c.why, c.with, c.accepted.size() > 1 ? "s" : "",
                       enumerated(c.accepted), text_of(found));
  }
  return std::nullopt;
}

Problem missing(const Key& key) { return {"", fmt::format("'{}' is missing; accepted: {}", key.name, accepted_text(key.type))}; }

Json kept_members(Json value, const ValueType& type, const std::function<bool(const Key&)>& keep) {
  if (type.members.empty()) return value;
  if (value.is_array())
    for (Json& item : value) item = kept_members(std::move(item), type, keep);
  if (value.is_object())
    for (const Key& member : type.members)
      if (!keep(member)) value.erase(member.name);
  return value;
}

void throw_problem(std::string_view what, std::string_view key, const Problem& problem) {
  throw UsageError(fmt::format("{}{}'{}'{}: {}", what, what.empty() ? "" : ": ", key, clipped(problem.place), problem.text));
}

void require_keys(const Json& json, std::span<const Key* const> keys, std::string_view what) {
  std::vector<std::string_view> names;
  for (const Key* key : keys) names.push_back(key->name);
  if (!json.is_object())
    throw UsageError(
        fmt::format("{}: an object with the keys {} is expected, not {}", what, fmt::join(names, ", "), shown(json)));
  for (const auto& [key, value] : json.items())
    if (std::find(names.begin(), names.end(), key) == names.end())
      throw UsageError(fmt::format("{}: unknown key '{}'; accepted: {}{}", what, clipped(key), fmt::join(names, ", "),
                                   suggestion(key, names)));
}

}  // namespace amrtex
