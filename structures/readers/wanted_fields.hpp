// Which fields of a data set are to be read.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

namespace amrtex {

/// What of a data set is to be read. Nothing said: all of its fields.
class FieldChoice {
 public:
  FieldChoice() = default;
  /// These in this order; all where none is named.
  FieldChoice(std::vector<std::string> names) : names_(std::move(names)) {}
  FieldChoice(std::initializer_list<std::string> names) : names_(names) {}
  /// The first one that the file has.
  static FieldChoice first() {
    FieldChoice choice;
    choice.first_ = true;
    return choice;
  }
  /// The one of this name, or the first one where none is named.
  static FieldChoice one(const std::string& name) { return name.empty() ? first() : FieldChoice(std::vector{name}); }

  /// Where the wanted fields stand among those there are. Throws UsageError that names the nearest name and those there are.
  std::vector<std::size_t> among(const std::filesystem::path& path, const std::vector<std::string>& there) const;

 private:
  std::vector<std::string> names_;
  bool first_ = false;
};

}  // namespace amrtex
