#include "bench/settings/axes.hpp"

#include <algorithm>

namespace amrtex {

const JsonNode* find(const Choice& choice, std::string_view key) {
  for (const auto& [name, node] : choice)
    if (name == key) return &node;
  return nullptr;
}

Json to_object(const Choice& choice) {
  Json object = Json::object();
  for (const auto& [key, node] : choice) object[key] = node.json();
  return object;
}

Depths depths_of(std::vector<const Key*> keys) {
  return [keys = std::move(keys)](std::string_view name) {
    for (const Key* key : keys)
      if (key->name == name) return key->type.depth;
    return 0;
  };
}

std::vector<JsonNode> Axes::values(const JsonNode& node, int depth) const {
  if (!is_axis(node.json(), depth)) return {node};
  const std::vector<JsonNode> items = node.items();
  if (items.size() > 1) add(node.place());
  return items;
}

std::vector<Choice> Axes::combinations(const JsonNode& object, const Depths& depth,
                                       std::span<const std::string_view> except) const {
  std::vector<Choice> all = {{}};
  for (const auto& [key, node] : object.members()) {
    if (std::find(except.begin(), except.end(), key) != except.end()) continue;
    std::vector<Choice> next;
    const std::vector<JsonNode> items = values(node, depth(key));
    for (const Choice& choice : all)
      for (const JsonNode& item : items) {
        next.push_back(choice);
        next.back().emplace_back(key, item);
      }
    all = std::move(next);
  }
  return all;
}

double count_values(const Json& json, int depth) { return is_axis(json, depth) ? static_cast<double>(json.size()) : 1; }

double count_combinations(const Json& object, const Depths& depth, std::span<const std::string_view> except) {
  double count = 1;
  if (!object.is_object()) return count;  // refused where it is read
  for (const auto& [key, value] : object.items())
    if (std::find(except.begin(), except.end(), key) == except.end()) count *= count_values(value, depth(key));
  return count;
}

}  // namespace amrtex
