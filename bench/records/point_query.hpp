// Which points something is about, as people write it: encoding = kd_tree and step <= 1 (docs/experiments.md, "Choosing points").
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// A condition over the settings of a point. KEY OP VALUE with = != < <= > >=, KEY in (VALUE, ...), joined by not, and, or and
/// parentheses; `and` binds closer than `or`. KEY is a name of the settings table, a build parameter, or encoding, dataset,
/// filter. VALUE is a word, a number, or a text between quotes. Two numbers are compared as such, anything else as text.
class PointQuery {
 public:
  /// Throws UsageError that begins with `what` and names the place in the text, and what is accepted there.
  PointQuery(std::string_view text, std::string_view what);
  ~PointQuery();
  PointQuery(PointQuery&&) noexcept;
  PointQuery& operator=(PointQuery&&) noexcept;

  /// `point`: a record, or as much of one as says what was asked for. A key that the point does not have is equal to nothing.
  bool holds(const Json& point) const;

  struct Node;

 private:
  std::unique_ptr<const Node> root_;
};

/// Where the value of a key stands in a record; empty where no key has this name.
std::string place_in_record(std::string_view key);
/// Every name that place_in_record() knows.
std::vector<std::string> queried_keys();

}  // namespace amrtex
