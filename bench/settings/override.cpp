#include "bench/settings/override.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bench/settings/settings_table.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

using Names = std::vector<std::string_view>;

bool contains(const Names& names, std::string_view name) { return std::find(names.begin(), names.end(), name) != names.end(); }

std::vector<std::string> parameters_of(const Encoding& encoding) {
  std::vector<std::string> names;
  for (const ParameterInfo& p : encoding.parameters()) names.push_back(p.name);
  return names;
}

bool has_parameter(const Encoding& encoding, std::string_view name) {
  const std::vector<std::string> names = parameters_of(encoding);
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Up to the first "." or "[".
std::string_view head_of(std::string_view path) { return path.substr(0, path.find_first_of(".[")); }

/// Places of the objects that have a key, such as "render".
std::vector<std::string> objects_with(std::string_view key) {
  std::vector<std::string> places;
  for (const Section& section : all_sections())
    if (section.name != "top" && section.name != "generate" && contains(names_of(section.keys), key))
      places.push_back(section.place);
  const bool parameter =
      std::any_of(all_encodings().begin(), all_encodings().end(), [&](const Encoding* e) { return has_parameter(*e, key); });
  if (parameter && std::find(places.begin(), places.end(), "encodings") == places.end()) places.emplace_back("encodings");
  return places;
}

/// Every name that may stand alone.
std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const Section& section : all_sections())
    for (const std::string_view name : names_of(section.keys)) names.emplace_back(name);
  for (const Encoding* encoding : all_encodings())
    for (std::string& name : parameters_of(*encoding)) names.push_back(std::move(name));
  return names;
}

/// The path from the top level.
std::string whole_path(const std::string& path, const std::string& origin) {
  const std::string_view head = head_of(path);
  if (contains(names_of(section_of("top").keys), head)) return path;
  if (contains(names_of(section_of("render").keys), head)) return "render." + path;
  const std::vector<std::string> places = objects_with(head);
  if (places.size() == 1) return places.front() + "." + path;
  if (places.empty()) {
    const std::vector<std::string> all = all_names();
    throw UsageError(fmt::format("{}: no key {}{}; `amrtex settings` lists all", origin, quote(head),
                                 suggestion(head, Names(all.begin(), all.end()))));
  }
  std::vector<std::string> accepted;
  for (const std::string& place : places) accepted.push_back(place + "." + path);
  throw UsageError(
      fmt::format("{}: {} is a key of several objects; accepted: {}", origin, quote(head), fmt::join(accepted, ", ")));
}

/// Has this entry of `encodings` the parameter?
bool entry_has_parameter(const Json& entry, std::string_view key) {
  const Json name = entry.value("name", Json());
  for (const Encoding* encoding : all_encodings())
    if (name == encoding->name()) return has_parameter(*encoding, key);
  return true;  // an unknown encoding is refused where it is read
}

bool is_list_of_objects(const Json& json) {
  return json.is_array() && !json.empty() && std::all_of(json.begin(), json.end(), [](const Json& j) { return j.is_object(); });
}

/// Places that a path means: where it goes on below a list of objects without saying which, all of them.
void expand(const Json& json, const std::string& done, std::string_view rest, std::vector<std::string>& places) {
  if (rest.empty()) {
    places.push_back(done);
    return;
  }
  if (is_list_of_objects(json) && rest.front() != '[') {
    const std::string_view key = head_of(rest.substr(1));
    const bool parameter = done == "encodings" && !contains(names_of(section_of("encodings").keys), key);
    for (std::size_t i = 0; i < json.size(); ++i)
      if (!parameter || entry_has_parameter(json[i], key)) expand(json[i], fmt::format("{}[{}]", done, i), rest, places);
    return;
  }
  const bool element = rest.front() == '[';
  const std::size_t end = std::min(element ? rest.find(']') : rest.find_first_of(".[", 1), rest.size());
  const std::string_view step = rest.substr(1, end - 1);
  const std::size_t used = std::min(element ? end + 1 : end, rest.size());
  static const Json none;
  const Json* next = &none;
  if (json.is_object() && !element && json.contains(step)) next = &json.find(step).value();
  if (json.is_array() && element && step.size() < 9 && !step.empty() &&
      step.find_first_not_of("0123456789") == std::string_view::npos)
    if (const auto index = static_cast<std::size_t>(std::stoul(std::string(step))); index < json.size()) next = &json[index];
  expand(*next, done + std::string(rest.substr(0, used)), rest.substr(used), places);
}

}  // namespace

void override_setting(JsonFile& file, const std::string& text) {
  const std::string origin = "--set " + clipped(text);
  if (!is_utf8(text)) throw UsageError(fmt::format("{}: not UTF-8; accepted: key=value", origin));
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw UsageError(fmt::format("{}: accepted: key=value, as in render.step=0.5", origin));
  const std::string path = whole_path(text.substr(0, equals), origin);
  const std::string given = text.substr(equals + 1);
  Json value = Json::parse(given, nullptr, false);
  if (value.is_discarded()) value = given;
  std::vector<std::string> places;
  const std::string head(head_of(path));
  const Json root = file.root().json();
  expand(root.is_object() && root.contains(head) ? root[head] : Json(), head, std::string_view(path).substr(head.size()), places);
  if (places.empty())
    throw UsageError(
        fmt::format("{}: no encoding of this file has the parameter {}", origin, quote(path.substr(path.find('.') + 1))));
  for (const std::string& place : places) file.set(place, value, origin);
}

}  // namespace amrtex
