// A JSON file written by a person: every complaint about it names file, line and key.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "structures/common/encoding.hpp"

namespace amrtex {

class JsonNode;

class JsonFile {
 public:
  /// Throws Error when the file cannot be read, UsageError as the constructor does.
  static JsonFile read(const std::filesystem::path& path);
  /// A byte-order mark is skipped. Throws UsageError with line and column of a syntax error or a NUL, or the line of a key
  /// that is given twice, of values nested too deep and of a number too large.
  JsonFile(const std::string& text, std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  /// Replaces or adds a value at a place such as "encodings[1].page_size". Complaints about it name `origin` in place of file and
  /// line. Throws UsageError where something on the way is neither an object nor a list that has the element.
  void set(const std::string& place, Json value, const std::string& origin);
  /// "file:line: ", or the origin of a value that was set.
  std::string position(std::string_view place) const;
  JsonNode root() const;
  /// Line (from 1) of a place such as "encodings[1].page_size"; of the nearest place around it where it has none.
  int line(std::string_view place) const;

 private:
  std::filesystem::path path_;
  Json json_;
  std::map<std::string, int, std::less<>> lines_;
  std::map<std::string, std::string, std::less<>> origins_;  ///< of values that were set, by place
};

/// A value of a JsonFile and where it stands. The file must outlive it.
class JsonNode {
 public:
  JsonNode(const JsonFile& file, const Json& json, std::string place) : file_(&file), json_(&json), place_(std::move(place)) {}

  const Json& json() const { return *json_; }
  const std::string& place() const { return place_; }
  /// Throws a UsageError "file:line: place: problem".
  [[noreturn]] void fail(std::string_view problem) const;

  /// A place in this value, for complaints: "[0]", ".radius"; itself for "".
  JsonNode below(std::string_view place) const { return {*file_, *json_, place_ + std::string(place)}; }

  std::optional<JsonNode> find(std::string_view key) const;
  JsonNode require(std::string_view key) const;  ///< throws UsageError when the key is missing
  /// The elements of a list, or this value alone. Throws UsageError for an empty list.
  std::vector<JsonNode> items() const;
  /// Throws UsageError unless this is an object.
  std::vector<std::pair<std::string, JsonNode>> members() const;
  /// Throws UsageError for a key that is not accepted, proposing the one that was probably meant.
  void accept_keys(std::span<const std::string_view> keys) const;

  /// These throw UsageErrors that name what is accepted.
  std::string text() const;
  bool boolean() const;
  double number(double min, double max) const;
  double positive_number() const;
  std::int64_t integer(std::int64_t min, std::int64_t max) const;
  std::string one_of(std::span<const std::string_view> accepted) const;

 private:
  const JsonFile* file_;
  const Json* json_;
  std::string place_;
};

/// The value of a JSON file that no person writes, whose lines nobody asks for. Throws as JsonFile::read does.
Json read_json(const std::filesystem::path& path);

}  // namespace amrtex
