// The parts of the parser of experiment files, one a source file. For experiment.cpp alone.
#pragma once

#include <fmt/format.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "bench/settings/axes.hpp"
#include "bench/settings/experiment.hpp"
#include "bench/settings/settings_table.hpp"

namespace amrtex {

/// A file while it is read, and what came of it so far.
struct ExperimentParser {
  ExperimentParser(const JsonFile& read, bool is_scene) : file(read), root(read.root()), scene(is_scene), axes(experiment.axes) {}

  const JsonFile& file;
  JsonNode root;
  bool scene;  ///< a scene file: one point, and `region`
  Experiment experiment;
  Axes axes;
};

/// Throws a UsageError that says the number where a file has more than `most` points, before any of them is made.
void require_few_points(const ExperimentParser& parser, std::uint64_t most);

void parse_datasets(ExperimentParser& parser);
/// Of a mesh that the caller has (ReadOptions::holds_data).
void parse_held_dataset(ExperimentParser& parser);
void parse_builds(ExperimentParser& parser);
void parse_renders(ExperimentParser& parser);
std::vector<RenderPoint> parse_views(ExperimentParser& parser);
/// `needed`: some render point draws a volume.
std::vector<RenderPoint> parse_transfer_functions(ExperimentParser& parser, bool needed);
/// `reference`, and keys that hold for a whole experiment. After parse_renders.
void parse_measuring(ExperimentParser& parser);

struct ExistingPath {
  std::filesystem::path path;
  std::filesystem::path folder;  ///< that a relative path begins in; else that around the file
};
/// A file or folder beside the experiment file, or else in the current folder. Throws a UsageError that names both places.
ExistingPath existing_path(const JsonNode& node, const JsonFile& file);

/// Runs a parser of another part of the program and adds file, line and key to its complaint.
template <class F>
auto located(const JsonNode& node, F&& parse) {
  try {
    return parse();
  } catch (const Error& e) {
    node.fail(e.what());
  }
}

/// Where the parser of views or transfer functions complains about a combination: the key that it quotes.
JsonNode culprit(const JsonNode& object, const std::string& message);

/// Calls use(object without its name, name) for every combination of an object's axes; names that stand for several combinations
/// get a number.
template <class F>
void for_each_named(const ExperimentParser& parser, const JsonNode& object, const Depths& depth, const std::string& otherwise,
                    F&& use) {
  const std::vector<Choice> choices = parser.axes.combinations(object, depth);
  for (std::size_t i = 0; i < choices.size(); ++i) {
    Json json = to_object(choices[i]);
    json.erase("name");
    const JsonNode* given = find(choices[i], "name");
    std::string name = given != nullptr ? given->text() : otherwise;
    if (choices.size() > 1) name += fmt::format(".{}", i + 1);
    try {
      use(json, name);
    } catch (const Error& e) {
      culprit(object, e.what()).fail(e.what());
    }
  }
}

/// Drops elements whose text was there before, and keeps the order.
template <class T, class Text>
void remove_repeated(std::vector<T>& list, Text&& text) {
  std::set<std::string> seen;
  std::erase_if(list, [&](const T& item) { return !seen.insert(text(item)).second; });
}

/// Sets one key; null stands for its default.
template <class T>
void read_setting(const JsonNode& node, const Setting<T>& row, T& target) {
  if (node.json().is_null() && row.key.type.nullable) return;
  if (const auto problem = value_problem(node.json(), row.key.type)) node.below(problem->place).fail(problem->text);
  row.set(target, node.json());
}

/// The place of a complaint about a key that need not be given: where it is given, else the key that stands for it or that it
/// goes with, else the object.
template <class T>
JsonNode place_of(const Key& key, const JsonNode& object, const Choice& choice, const SettingTable<T>& table) {
  if (const JsonNode* given = find(choice, key.name)) return *given;
  for (const Setting<T>& row : table.rows())
    if (row.key.stands_for.first == key.name)
      if (const JsonNode* given = find(choice, row.key.name)) return *given;
  for (const Condition& c : key.takes)
    if (const JsonNode* given = find(choice, c.with)) return *given;
  return object;
}

/// Sets all keys of a table that a choice gives, and checks them.
template <class T>
void read_settings(const JsonNode& object, const Choice& choice, const SettingTable<T>& table, T& target) {
  for (const Setting<T>& row : table.rows())
    if (const JsonNode* node = find(choice, row.key.name)) read_setting(*node, row, target);
  for (const Setting<T>& row : table.rows())
    if (const auto& [other, value] = row.key.stands_for; !other.empty() && find(choice, row.key.name) && !find(choice, other))
      table.find(other)->set(target, value);
  for (const Setting<T>& row : table.rows())
    if (const auto problem = table.misplaced(row, target, find(choice, row.key.name) != nullptr))
      place_of(row.key, object, choice, table).fail(problem->text);
  table.reset_idle(target);
  if (const auto found = table.complaint(target))
    place_of(*found->key, object, choice, table).below(found->problem.place).fail(found->problem.text);
}

}  // namespace amrtex
