#include "bench/settings/settings_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bench/settings/figure_settings.hpp"
#include "bench/settings/settings_table.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::string_view kParameters = "parameters";

std::string kind_text(const ValueType& type) {
  constexpr std::array<std::string_view, 6> kNames = {"boolean", "integer", "number", "text", "text", "object"};
  std::string text(kNames[static_cast<std::size_t>(type.kind)]);
  for (int depth = 0; depth < type.depth; ++depth) text = "list of " + text;
  return type.nullable ? text + " or null" : text;
}

/// As JSON, with 1 for 1.0.
std::string plain(const Json& value) {
  if (value.is_number_float()) return fmt::format("{}", value.get<double>());
  if (!value.is_array()) return value.is_string() ? value.get<std::string>() : value.dump();
  std::vector<std::string> items;
  for (const Json& item : value) items.push_back(plain(item));
  return fmt::format("[{}]", fmt::join(items, ", "));
}

std::string code(const Json& value) { return fmt::format("`{}`", plain(value)); }

std::string default_text(const Key& key) {
  if (!key.default_text.empty()) return key.default_text;
  if (key.required) return key.takes.empty() ? "required" : "required there";
  if (key.default_value.is_null()) return key.type.nullable ? "`null`" : "none";
  return code(key.default_value);
}

std::string choices_of(const std::vector<Json>& values) {
  std::vector<std::string> texts;
  for (const Json& value : values) texts.push_back(code(value));
  return fmt::format("{}", fmt::join(texts, ", "));
}

std::string accepted_markdown(const Key& key) {
  if (key.type.kind != Kind::choice) {
    std::string text = accepted_text(key.type);
    if (text.starts_with("a string")) text.replace(0, 8, "text");
    return text;
  }
  std::vector<std::string> texts;
  for (const std::string& choice : key.type.choices) {
    texts.push_back("`" + choice + "`");
    for (const auto& [alias, meant] : key.type.aliases)
      if (meant == choice) texts.back() += fmt::format(" (or `{}`)", alias);
  }
  return fmt::format("{}{}", fmt::join(texts, ", "), key.type.nullable ? " or `null`" : "");
}

/// "with `mode` `iso`, `dvr_iso`", and "without `mirror`" where the other key must be off.
std::string condition_text(const Condition& c) {
  if (c.accepted.empty()) return fmt::format("with `{}`", c.with);
  std::string text = !c.accepted.front().is_string() ? fmt::format("without `{}`", c.with)
                                                     : fmt::format("with `{}` {}", c.with, choices_of(c.accepted));
  if (!c.when.empty()) text = fmt::format("{} {}", choices_of(c.when), text);
  if (!c.why.empty()) text += fmt::format(" ({})", c.why);
  return text;
}

std::vector<std::string> encodings_with(Capability capability) {
  std::vector<std::string> names;
  for (const Encoding* e : all_encodings())
    if (capability == Capability::pruning ? e->prunes() : e->level_of_detail().ok)
      names.push_back(fmt::format("`{}`", e->name()));
  return names;
}

/// What the key goes with: refusals, keys that are not looked at elsewhere, and records `unsupported`.
std::string takes_text(const Key& key) {
  std::vector<std::string> taken, unsupported;
  for (const Condition& c : key.takes) (c.otherwise == Otherwise::unsupported ? unsupported : taken).push_back(condition_text(c));
  if (key.capability != Capability::any)
    unsupported.push_back(fmt::format("in the encodings {}", fmt::join(encodings_with(key.capability), ", ")));
  std::string text;
  if (!taken.empty()) text += fmt::format(". {}", fmt::join(taken, "; "));
  if (!unsupported.empty())
    text += fmt::format(". Only {}: other points become records `unsupported`", fmt::join(unsupported, "; "));
  if (text.size() > 2 && text[2] == 'w') text[2] = 'W';  // "with", "without" begin the sentence
  return text;
}

std::string members_text(const Key& key) {
  std::vector<std::string> texts;
  for (const Key& m : key.type.members) {
    if (m.derived || key.name == "transfer_functions") continue;
    std::string text = fmt::format("`{}`: {}", m.name, accepted_text(m.type));
    if (!m.unit.empty()) text += fmt::format(", {}", m.unit);
    if (!m.help.empty()) text += fmt::format(", {}", m.help);
    if (!m.required) text += fmt::format(" ({})", default_text(m));
    texts.push_back(std::move(text));
  }
  return texts.empty() ? "" : fmt::format(". {}", fmt::join(texts, "; "));
}

/// A vertical bar would end the cell.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  return text;
}

std::string row(const Key& key) {
  const std::string unit = key.unit.empty() ? "" : fmt::format(", {}", key.unit);
  return fmt::format("| `{}` | {} | {}{} | {} |\n", key.name, cell(default_text(key)), cell(accepted_markdown(key)), unit,
                     cell(key.help + members_text(key) + takes_text(key)));
}

std::string parameters_markdown() {
  std::string text = "| encoding | parameter | default | accepted | meaning |\n|---|---|---|---|---|\n";
  for (const Encoding* e : all_encodings())
    for (const ParameterInfo& p : e->parameters())
      text += fmt::format("| `{}` | `{}` | {} | {} | {} |\n", e->name(), p.name, code(p.default_value), cell(p.accepted.text()),
                          cell(p.description));
  return text;
}

Json condition_json(const Condition& c) {
  constexpr std::array<std::string_view, 4> kOtherwise = {"idle", "refused", "refused", "unsupported"};
  Json json = {{"key", c.with}, {"values", c.accepted}, {"otherwise", kOtherwise[static_cast<std::size_t>(c.otherwise)]}};
  if (!c.why.empty()) json["why"] = c.why;
  if (!c.when.empty()) json["when"] = c.when;
  return json;
}

/// Where a record holds the keys of a section; empty where it holds none of them by themselves.
std::string record_place(const Section& section) {
  if (section.name == "encodings") return "/";
  if (section.name == "render") return "/render/";
  if (section.name == "views") return "/render/view/";
  if (section.name == "transfer_function") return "/render/transfer_function/";
  return "";
}

Json record_json(const Section& section, const Key& key) {
  constexpr std::array<std::string_view, 4> kRecorded = {"always", "where it applies", "where given", "never"};
  const std::string place = record_place(section);
  if (place.empty() || key.recorded == Recorded::never || key.label) return nullptr;
  return {{"pointer", place + key.in_record()}, {"when", kRecorded[static_cast<std::size_t>(key.recorded)]}};
}

Json key_json(const Section& section, const Key& key) {
  Json json = {
      {"section", section.name}, {"key", key.name}, {"type", kind_text(key.type)}, {"accepted", accepted_text(key.type)}};
  json["default"] = key.required ? Json() : key.default_value;
  json["required"] = key.required;
  json["unit"] = key.unit.empty() ? Json() : Json(key.unit);
  json["axis_depth"] = key.type.depth;
  json["reference"] = static_cast<bool>(key.reference);
  json["record"] = record_json(section, key);
  json["column"] = key.column.label.empty() ? Json() : Json(key.column.label);
  json["takes"] = Json::array();
  for (const Condition& c : key.takes) json["takes"].push_back(condition_json(c));
  json["help"] = key.help;
  return json;
}

/// Of an experiment's file, or a figure's.
const Section& documented_section(std::string_view name) {
  std::vector<std::string> names = {std::string(kParameters)};
  for (const std::span<const Section> sections : {all_sections(), figure_sections()})
    for (const Section& section : sections) {
      if (section.name == name) return section;
      names.push_back(section.name);
    }
  throw UsageError(fmt::format("no section {}; accepted: {}", quote(name), fmt::join(names, ", ")));
}

}  // namespace

Json settings_json() {
  Json json = Json::array();
  for (const Section& section : all_sections())
    for (const Key* key : section.keys) json.push_back(key_json(section, *key));
  return json;
}

std::string settings_text() {
  std::string text;
  for (const Section& section : all_sections()) {
    if (section.name == "generate") continue;
    text += fmt::format("{}\n", section.name == "top" ? "top level" : section.name);
    for (const Key* key : section.keys)
      text += fmt::format("  {:18} {}; default {}{}\n", key->name, accepted_text(key->type), default_text(*key),
                          key->unit.empty() ? "" : ", " + key->unit);
  }
  return text;
}

std::string settings_markdown(std::string_view section) {
  if (section == kParameters) return parameters_markdown();
  std::string text = "| key | default | accepted | meaning |\n|---|---|---|---|\n";
  for (const Key* key : documented_section(section).keys) text += row(*key);
  return text;
}

std::string with_settings(const std::string& document) {
  constexpr std::string_view kBegin = "<!-- settings:", kClose = " -->";
  std::string text;
  std::size_t at = 0;
  for (;;) {
    const std::size_t begin = document.find(kBegin, at);
    if (begin == std::string::npos) return text + document.substr(at);
    const std::size_t name = begin + kBegin.size(), close = document.find(kClose, name);
    const std::string section = document.substr(name, close == std::string::npos ? close : close - name);
    const std::string ending = fmt::format("<!-- /settings:{} -->", section);
    const std::size_t end = document.find(ending, name);
    if (close == std::string::npos || end == std::string::npos)
      throw UsageError(
          fmt::format("settings:{}: the marker has no end; accepted: {}", section.substr(0, 40), ending.substr(0, 80)));
    text += document.substr(at, close + kClose.size() - at) + "\n" + settings_markdown(section);
    at = end;
  }
}

}  // namespace amrtex
