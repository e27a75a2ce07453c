#include "bench/settings/json_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

constexpr std::size_t kMostBytes = std::size_t{256} << 20;  ///< of a file: a table of a million points has some 100 MiB
/// Deeper nesting has no meaning in our files; whoever walks over the values may recurse.
constexpr std::size_t kMaxDepth = 64;
/// Objects of ours have tens of keys, and each new one is compared with all before it.
constexpr std::size_t kMostKeys = 1000;
/// Of a message behind its place: names of encodings and fields stand in it as the file has them.
constexpr std::size_t kLongestProblem = 1000;
constexpr std::size_t kLongestKey = 1000;  ///< bytes
/// Elements of lists that lie deeper have the line of what they lie in: a place is written for each of millions of them.
constexpr std::size_t kLongestPlace = 256;
/// Longer keys are none of ours, and not worth the time to look for one that is like them.
constexpr std::size_t kLongestName = 80;

using Lines = std::map<std::string, int, std::less<>>;  ///< of places

/// Where the parser is in its text.
struct Cursor {
  const char* at;
  int line = 1;
};

/// Hands the parser one character after the other and counts the lines that it has seen.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, Cursor* cursor) : at_(at), cursor_(cursor) {}
  reference operator*() const { return *at_; }
  CountingIterator& operator++() {
    if (*at_ == '\n') ++cursor_->line;
    cursor_->at = ++at_;
    return *this;
  }
  CountingIterator operator++(int) {
    const CountingIterator before = *this;
    ++*this;
    return before;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }

 private:
  const char* at_;
  Cursor* cursor_;
};

/// Puts values together as the parser finds them, and notes the line of every key and list element: one parser for both, so
/// that they cannot disagree on what the text is.
class Builder {
 public:
  /// `lines` may be null.
  Builder(std::string_view text, const std::filesystem::path& path, Cursor& cursor, Lines* lines)
      : text_(text), path_(path), cursor_(cursor), lines_(lines) {}

  Json& json() { return root_; }

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(std::int64_t value) { return add(value, true); }
  bool number_unsigned(std::uint64_t value) { return add(value, true); }
  bool number_float(double value, const std::string&) { return add(value, true); }
  bool string(std::string& value) { return add(std::move(value)); }
  bool binary(Json::binary_t&) { return false; }  // not in text
  bool start_object(std::size_t) { return open(Json::object()); }
  bool start_array(std::size_t) { return open(Json::array()); }
  bool end_object() { return close(); }
  bool end_array() { return close(); }

  bool key(std::string& name) {
    Level& level = levels_.back();
    if (name.size() > kLongestKey)
      refuse(fmt::format("the key {} has {} bytes; at most {} are read", quote(name), name.size(), kLongestKey));
    level.key = std::move(name);
    level.place = level.parent + (level.parent.empty() ? "" : ".") + level.key;
    if (level.value->contains(level.key)) refuse(fmt::format("{}: this key is given twice", clipped(level.place)));
    if (level.value->size() == kMostKeys) refuse(fmt::format("an object of more than {} keys", kMostKeys));
    note();
    return true;
  }

  bool parse_error(std::size_t position, const std::string& last_token, const nlohmann::detail::exception& e) {
    if (e.id == 406) refuse(fmt::format("the number {} is too large", clipped(last_token)));
    const std::size_t offset = std::min(position > 0 ? position - 1 : 0, text_.size());
    std::string what = e.what();  // "[json.exception...] parse error at line 1, column 2: what; last read: 'token'; expected ..."
    if (const std::size_t colon = what.find(": "); colon != std::string::npos) what = what.substr(colon + 2);
    const std::size_t read = what.find("; last read: '");
    const std::size_t expected = what.rfind("'; expected ");
    const std::string accepted = expected != std::string::npos ? what.substr(expected + 1) : "";
    if (read != std::string::npos) what = fmt::format("{}; last read: {}{}", what.substr(0, read), quote(last_token), accepted);
    throw UsageError(fmt::format("{}:{}: not valid JSON: {}", path_.string(), line_and_column(text_, offset), what));
  }

  static std::string line_and_column(std::string_view text, std::size_t offset) {
    const std::string_view before = text.substr(0, offset);
    const std::size_t start = before.rfind('\n') == std::string_view::npos ? 0 : before.rfind('\n') + 1;
    return fmt::format("{}:{}", 1 + std::count(before.begin(), before.end(), '\n'), offset - start + 1);
  }

 private:
  struct Level {
    Json* value;         ///< an object or a list that is being filled
    std::string parent;  ///< its own place
    std::string key;     ///< of an object: what the next value belongs to
    std::string place;   ///< of the next value
  };

  [[noreturn]] void refuse(const std::string& what) const {
    throw UsageError(fmt::format("{}:{}: {}", path_.string(), cursor_.line, what));
  }

  void note(int line_ends_read = 0) {
    if (lines_ != nullptr) lines_->emplace(levels_.back().place, cursor_.line - line_ends_read);
  }

  /// A number ends with the first character behind it, which may be that of the line's end.
  template <class T>
  bool add(T value, bool reads_on = false) {
    put(Json(std::move(value)), reads_on && cursor_.at != text_.data() && cursor_.at[-1] == '\n' ? 1 : 0);
    return true;
  }

  Json* put(Json value, int line_ends_read) {
    if (levels_.empty()) return &(root_ = std::move(value));
    Level& level = levels_.back();
    if (level.value->is_object()) return &(level.value->operator[](level.key) = std::move(value));
    if (lines_ != nullptr && level.parent.size() < kLongestPlace) {
      level.place = fmt::format("{}[{}]", level.parent, level.value->size());
      note(line_ends_read);
    }
    level.value->push_back(std::move(value));
    return &level.value->back();
  }

  bool open(Json value) {
    if (levels_.size() == kMaxDepth) refuse(fmt::format("nested more than {} deep", kMaxDepth));
    Json* const inside = put(std::move(value), 0);
    const std::string place = levels_.empty() ? "" : levels_.back().place;
    levels_.push_back({inside, place, "", place});
    return true;
  }

  bool close() {
    levels_.pop_back();
    return true;
  }

  std::string_view text_;
  const std::filesystem::path& path_;
  Cursor& cursor_;
  Json root_;
  std::vector<Level> levels_;
  Lines* lines_;
};

Json parse(std::string_view text, const std::filesystem::path& path, Lines* lines) {
  // the parser takes a NUL for the end and never sees what follows
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
    throw UsageError(fmt::format("{}:{}: not valid JSON: a NUL character", path.string(), Builder::line_and_column(text, nul)));
  Cursor cursor{text.data()};
  Builder builder(text, path, cursor, lines);
  Json::sax_parse(CountingIterator(text.data(), &cursor), CountingIterator(text.data() + text.size(), &cursor), &builder);
  return std::move(builder.json());
}

}  // namespace

Json read_json(const std::filesystem::path& path) { return parse(load_stream(path, kMostBytes), path, nullptr); }

JsonFile JsonFile::read(const std::filesystem::path& path) { return JsonFile(load_stream(path, kMostBytes), path); }

JsonFile::JsonFile(const std::string& text, std::filesystem::path path) : path_(std::move(path)), lines_{{"", 1}} {
  json_ = parse(text, path_, &lines_);
}

JsonNode JsonFile::root() const { return JsonNode(*this, json_, ""); }

int JsonFile::line(std::string_view place) const {
  for (;;) {
    if (const auto found = lines_.find(place); found != lines_.end()) return found->second;
    const std::size_t cut = place.find_last_of(".[");
    place = cut == std::string_view::npos ? std::string_view() : place.substr(0, cut);
  }
}

std::string JsonFile::position(std::string_view place) const {
  for (std::string_view around = place;;) {
    if (const auto origin = origins_.find(around); origin != origins_.end()) return origin->second + ": ";
    const std::size_t cut = around.find_last_of(".[");
    if (cut == std::string_view::npos) break;
    around = around.substr(0, cut);
  }
  return fmt::format("{}:{}: ", path_.string(), line(place));
}

void JsonFile::set(const std::string& place, Json value, const std::string& origin) {
  Json* json = &json_;
  for (std::size_t at = 0; at < place.size();) {
    const bool element = place[at] == '[';
    const std::size_t begin = at + (element || place[at] == '.' ? 1 : 0);
    at = std::min(place.find_first_of(element ? "]" : ".[", begin), place.size());
    const std::string step = place.substr(begin, at - begin);
    if (element) {
      ++at;
      const auto index = step.empty() || step.find_first_not_of("0123456789") != std::string::npos || step.size() > 9
                             ? json->size()
                             : static_cast<std::size_t>(std::stoul(step));
      if (!json->is_array() || index >= json->size())
        throw UsageError(
            fmt::format("{}: no element [{}]; the list has {}", origin, clipped(step), json->is_array() ? json->size() : 0));
      json = &(*json)[index];
    } else {
      if (!json->is_object() && !json->is_null())
        throw UsageError(fmt::format("{}: {} has no place in {}", origin, quote(step), shown(*json)));
      json = &(*json)[step];
    }
  }
  *json = std::move(value);
  origins_.insert_or_assign(place, origin);
}

void JsonNode::fail(std::string_view problem) const {
  throw UsageError(fmt::format("{}{}{}{}", file_->position(place_), clipped(place_), place_.empty() ? "" : ": ",
                               one_line(problem, kLongestProblem)));
}

std::optional<JsonNode> JsonNode::find(std::string_view key) const {
  const auto found = json_->find(key);
  if (found == json_->end()) return std::nullopt;
  return JsonNode(*file_, *found, (place_.empty() ? "" : place_ + ".") + std::string(key));
}

JsonNode JsonNode::require(std::string_view key) const {
  if (auto node = find(key)) return *node;
  fail(fmt::format("the key '{}' is missing", key));
}

std::vector<JsonNode> JsonNode::items() const {
  if (!json_->is_array()) return {*this};
  if (json_->empty()) fail("an empty list gives no value");
  std::vector<JsonNode> items;
  for (std::size_t i = 0; i < json_->size(); ++i) items.emplace_back(*file_, (*json_)[i], fmt::format("{}[{}]", place_, i));
  return items;
}

std::vector<std::pair<std::string, JsonNode>> JsonNode::members() const {
  if (!json_->is_object()) fail(fmt::format("an object {{...}} is expected, not {}", shown(*json_)));
  std::vector<std::pair<std::string, JsonNode>> members;
  for (const auto& [key, value] : json_->items()) members.emplace_back(key, *find(key));
  return members;
}

void JsonNode::accept_keys(std::span<const std::string_view> keys) const {
  for (const auto& [key, node] : members())
    if (std::find(keys.begin(), keys.end(), key) == keys.end())
      node.fail(fmt::format("unknown key; accepted: {}{}", fmt::join(keys, ", "), suggestion(key, keys)));
}

std::string JsonNode::text() const {
  if (!json_->is_string()) fail(fmt::format("a string is expected, not {}", shown(*json_)));
  const auto& text = json_->get_ref<const std::string&>();
  // names of files, fields and keys end there for the system
  if (text.find('\0') != std::string::npos)
    fail(fmt::format("a string without NUL characters is expected, not {}", shown(*json_)));
  return text;
}

bool JsonNode::boolean() const {
  if (!json_->is_boolean()) fail(fmt::format("true or false is expected, not {}", shown(*json_)));
  return json_->get<bool>();
}

double JsonNode::number(double min, double max) const {
  const double value = json_->is_number() ? json_->get<double>() : std::nan("");
  if (!(value >= min && value <= max)) fail(fmt::format("a number from {} to {} is expected, not {}", min, max, shown(*json_)));
  return value;
}

double JsonNode::positive_number() const {
  const double value = json_->is_number() ? json_->get<double>() : std::nan("");
  if (!(value > 0 && std::isfinite(value))) fail(fmt::format("a number above 0 is expected, not {}", shown(*json_)));
  return value;
}

std::int64_t JsonNode::integer(std::int64_t min, std::int64_t max) const {
  const bool fits = json_->is_number_integer() &&
                    (!json_->is_number_unsigned() || json_->get<std::uint64_t>() <= static_cast<std::uint64_t>(INT64_MAX));
  if (!fits || json_->get<std::int64_t>() < min || json_->get<std::int64_t>() > max)
    fail(fmt::format("an integer from {} to {} is expected, not {}", min, max, shown(*json_)));
  return json_->get<std::int64_t>();
}

std::string JsonNode::one_of(std::span<const std::string_view> accepted) const {
  const std::string value = text();
  if (std::find(accepted.begin(), accepted.end(), value) == accepted.end())
    fail(fmt::format("unknown value {}; accepted: {}{}", quote(value), fmt::join(accepted, ", "), suggestion(value, accepted)));
  return value;
}

}  // namespace amrtex
