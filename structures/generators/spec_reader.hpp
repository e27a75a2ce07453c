// Reads one JSON object of a specification key by key; whatever is wrong becomes a
// UsageError that names the key, its value and what would be accepted.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/json.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

class SpecReader {
 public:
  /// `path` is where the object stands in the specification, "" for the whole of it. The object must outlive the reader.
  SpecReader(const Json& object, std::string path);

  /// The value, or null when the key is absent. Asking makes the key a known one.
  const Json* find(std::string_view key);

  /// A finite number for which `acceptable` holds; `accepted` says so in words.
  double number(std::string_view key, double fallback, std::string_view accepted, bool (*acceptable)(double));
  double number(std::string_view key, double fallback);
  std::int64_t integer(std::string_view key, std::int64_t fallback, std::int64_t lowest, std::int64_t highest);
  bool boolean(std::string_view key, bool fallback);
  std::string text(std::string_view key, const std::string& fallback);
  std::string choice(std::string_view key, std::string_view fallback, std::span<const std::string_view> choices);
  Vec3d vector(std::string_view key, const Vec3d& fallback);
  /// Exactly `count` finite numbers.
  std::vector<double> numbers(std::string_view key, const std::vector<double>& fallback, std::size_t count);

  /// Throws for the first key that nothing asked for, naming those that something did.
  void finish() const;

  /// The UsageError for a value that is not accepted.
  [[noreturn]] void refuse(std::string_view key, std::string_view accepted) const;
  /// The key as it is written in messages: "refine.threshold".
  std::string path_of(std::string_view key) const;

 private:
  const Json& object_;
  std::string path_;
  std::vector<std::string> known_;
};

/// For SpecReader::number.
inline bool is_any(double) { return true; }
inline bool is_positive(double v) { return v > 0; }
inline bool is_not_negative(double v) { return v >= 0; }
inline bool is_fraction(double v) { return v >= 0 && v <= 1; }

}  // namespace amrtex
