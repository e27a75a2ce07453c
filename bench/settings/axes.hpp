// Values that are lists: axes of an experiment, their combinations, and how many there are.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench/settings/json_file.hpp"
#include "renderers/scene/setting.hpp"

namespace amrtex {

/// One value for each key of an object whose values may be axes.
using Choice = std::vector<std::pair<std::string, JsonNode>>;

const JsonNode* find(const Choice& choice, std::string_view key);
Json to_object(const Choice& choice);

/// How many lists deep one value of a key is; what lies deeper is an axis.
using Depths = std::function<int(std::string_view)>;
/// Those of a table; 0 for keys that it does not have.
Depths depths_of(std::vector<const Key*> keys);
inline bool is_axis(const Json& json, int depth) { return list_depth(json) > depth; }

/// Takes lists apart and remembers which of them have more than one value.
class Axes {
 public:
  explicit Axes(std::vector<std::string>& places) : places_(&places) {}

  /// The values of an axis, or the one value.
  std::vector<JsonNode> values(const JsonNode& node, int depth) const;
  /// All combinations of the axes among the members of an object; the last one varies fastest.
  std::vector<Choice> combinations(const JsonNode& object, const Depths& depth,
                                   std::span<const std::string_view> except = {}) const;
  void add(std::string place) const { places_->push_back(std::move(place)); }

 private:
  std::vector<std::string>* places_;
};

/// How many values; in floating point, as no integer need hold them.
double count_values(const Json& json, int depth);
/// How many combinations.
double count_combinations(const Json& object, const Depths& depth, std::span<const std::string_view> except = {});

}  // namespace amrtex
