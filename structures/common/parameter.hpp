// Build parameters: what they are called, what they may be, and what they are unless somebody says.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// Numbers that a parameter takes, both ends included. Without a last one, the mesh tells how far they go.
struct NumberRange {
  double first = 0;
  std::optional<double> last = {};
  bool whole = true;           ///< integers alone,
  bool powers_of_two = false;  ///< and of these powers of two alone
  bool has(const Json& value) const;
  std::string text() const;
};

/// What a parameter may be: one of the choices, or a number of the range.
struct Accepted {
  std::vector<Json> choices = {};  ///< names, numbers, true and false, null; in the order in which messages tell them
  std::optional<NumberRange> range = {};

  bool has(const Json& value) const;
  /// "\"pool\" or \"bindless\"", "an integer from 2 to 256", ...
  std::string text() const;
  /// All choices, then first and last number of the range; of a range without a last one none.
  std::vector<Json> examples() const;
};
Accepted choices(std::vector<Json> values);
Accepted true_or_false();
Accepted integers(int first, std::optional<int> last = {});
/// These values too.
Accepted either(std::vector<Json> values, NumberRange range);

/// What the command line and experiment files may say of a build.
struct ParameterInfo {
  std::string name;
  std::string description;  ///< with its unit
  Json default_value;
  Accepted accepted;
  /// Values between which the best depends on mesh and scene: what `amrtex advise` tries. Empty: the default alone.
  std::vector<Json> compared = {};
};

/// What programs read of a parameter: name, description, default, accepted (text), choices, range.
Json to_json(const ParameterInfo& parameter);

}  // namespace amrtex
