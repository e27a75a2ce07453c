#include "structures/common/parameter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace amrtex {
namespace {

/// 3 is not 3.0, nor is 1 true: a parameter is written in one way.
bool same(const Json& a, const Json& b) { return a.is_number_float() == b.is_number_float() && a == b; }

Json number(double value, bool whole) { return whole ? Json(static_cast<std::int64_t>(value)) : Json(value); }

}  // namespace

bool NumberRange::has(const Json& value) const {
  if (!value.is_number() || (whole && !value.is_number_integer())) return false;
  const auto v = value.get<double>();
  // whole numbers are read as int
  if (!(v >= first && v <= last.value_or(std::numeric_limits<int>::max()))) return false;
  return !powers_of_two || (v >= 1 && std::has_single_bit(value.get<std::uint64_t>()));
}

std::string NumberRange::text() const {
  const char* kind = powers_of_two ? "a power of two" : whole ? "an integer" : "a number";
  return last ? fmt::format("{} from {} to {}", kind, first, *last) : fmt::format("{} from {}", kind, first);
}

bool Accepted::has(const Json& value) const {
  return std::any_of(choices.begin(), choices.end(), [&](const Json& c) { return same(c, value); }) ||
         (range && range->has(value));
}

std::string Accepted::text() const {
  std::vector<std::string> words;
  for (const Json& c : choices) words.push_back(c.dump());
  if (range) words.push_back(range->text());
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    // what follows names is no name: a comma tells them apart
    const char* last = range && i > 1 ? ", or " : " or ";
    text += (i == 0 ? "" : i + 1 == words.size() ? last : ", ") + words[i];
  }
  return text;
}

std::vector<Json> Accepted::examples() const {
  std::vector<Json> values = choices;
  if (!range || !range->last) return values;
  values.push_back(number(range->first, range->whole));
  values.push_back(number(*range->last, range->whole));
  return values;
}

Accepted choices(std::vector<Json> values) { return {std::move(values)}; }

Accepted true_or_false() { return choices({true, false}); }

Accepted integers(int first, std::optional<int> last) { return {{}, NumberRange{static_cast<double>(first), last}}; }

Accepted either(std::vector<Json> values, NumberRange range) { return {std::move(values), range}; }

Json to_json(const ParameterInfo& p) {
  Json json{{"name", p.name}, {"description", p.description}, {"default", p.default_value}, {"accepted", p.accepted.text()}};
  json["choices"] = p.accepted.choices;
  json["range"] = nullptr;
  if (const auto& r = p.accepted.range)
    json["range"] = {{"first", number(r->first, r->whole)},
                     {"last", r->last ? number(*r->last, r->whole) : Json(nullptr)},
                     {"whole", r->whole},
                     {"powers_of_two", r->powers_of_two}};
  return json;
}

}  // namespace amrtex
