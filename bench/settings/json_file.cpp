#include "bench/settings/json_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <set>
#include <sstream>

#include "structures/mesh/error.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

/// Deeper nesting has no meaning in our files and would only cost time.
constexpr std::size_t kMaxDepth = 64;

/// Finds the line of every key and list element in a text that is already known to be valid JSON.
class LineScanner {
 public:
  LineScanner(const std::string& text, const std::filesystem::path& path) : text_(text), path_(path) {}

  std::map<std::string, int, std::less<>> scan() {
    lines_.emplace("", 1);
    while (at_ < text_.size()) step();
    return std::move(lines_);
  }

 private:
  struct Level {
    bool object;
    std::size_t index;
    std::string key;
    bool expects_key;
    std::set<std::string> keys;
  };

  void step() {
    const char c = text_[at_];
    if (std::isspace(static_cast<unsigned char>(c)) || c == ':') {
      if (c == '\n') ++line_;
      ++at_;
    } else if (c == ',') {
      next_element();
    } else if (c == '}' || c == ']') {
      levels_.pop_back();
      ++at_;
    } else if (c == '"' && !levels_.empty() && levels_.back().expects_key) {
      read_key();
    } else {
      read_value();
    }
  }

  void next_element() {
    Level& level = levels_.back();
    ++level.index;
    level.expects_key = level.object;
    ++at_;
  }

  void read_key() {
    const std::size_t begin = at_;
    skip_string();
    Level& level = levels_.back();
    level.key = Json::parse(text_.substr(begin, at_ - begin)).get<std::string>();
    level.expects_key = false;
    if (!level.keys.insert(level.key).second)
      throw UsageError(fmt::format("{}:{}: {}: this key is given twice", path_.string(), line_, place()));
    lines_.emplace(place(), line_);
  }

  void read_value() {
    if (!levels_.empty() && !levels_.back().object) lines_.emplace(place(), line_);
    const char c = text_[at_];
    if (c == '{' || c == '[') {
      if (levels_.size() == kMaxDepth)
        throw UsageError(fmt::format("{}:{}: nested more than {} deep", path_.string(), line_, kMaxDepth));
      levels_.push_back({c == '{', 0, "", c == '{', {}});
      ++at_;
    } else if (c == '"') {
      skip_string();
    } else {
      at_ = std::min(text_.find_first_of(",]} \t\r\n", at_ + 1), text_.size());
    }
  }

  void skip_string() {
    for (++at_; text_[at_] != '"'; ++at_)
      if (text_[at_] == '\\') ++at_;
    ++at_;
  }

  std::string place() const {
    std::string place;
    for (const Level& level : levels_) {
      if (!level.object)
        place += fmt::format("[{}]", level.index);
      else
        place += (place.empty() ? "" : ".") + level.key;
    }
    return place;
  }

  const std::string& text_;
  const std::filesystem::path& path_;
  std::size_t at_ = 0;
  int line_ = 1;
  std::vector<Level> levels_;
  std::map<std::string, int, std::less<>> lines_;
};

[[noreturn]] void throw_syntax_error(const std::string& text, const std::filesystem::path& path, const Json::parse_error& e) {
  const std::size_t offset = e.byte > 0 ? std::min(e.byte - 1, text.size()) : 0;
  const std::string before = text.substr(0, offset);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t line_start = before.rfind('\n') == std::string::npos ? 0 : before.rfind('\n') + 1;
  std::string what = e.what();  // "[json.exception...] parse error at line 1, column 2: what"
  if (const std::size_t colon = what.find(": "); colon != std::string::npos) what = what.substr(colon + 2);
  throw UsageError(fmt::format("{}:{}:{}: not valid JSON: {}", path.string(), line, offset - line_start + 1, what));
}

/// A value as it is quoted in messages, cut where long.
std::string shown(const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

}  // namespace

JsonFile JsonFile::read(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw Error(fmt::format("{}: this is a folder, not a JSON file", path.string()));
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) throw Error(fmt::format("{}: cannot be read, or is empty", path.string()));
  return JsonFile(text.str(), path);
}

JsonFile::JsonFile(std::string text, std::filesystem::path path) : path_(std::move(path)) {
  try {
    json_ = Json::parse(text);
  } catch (const Json::parse_error& e) {
    throw_syntax_error(text, path_, e);
  } catch (const Json::out_of_range& e) {
    throw UsageError(fmt::format("{}: a number is too large: {}", path_.string(), e.what()));
  }
  lines_ = LineScanner(text, path_).scan();
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
        throw UsageError(fmt::format("{}: no element [{}]; the list has {}", origin, step, json->is_array() ? json->size() : 0));
      json = &(*json)[index];
    } else {
      if (!json->is_object() && !json->is_null())
        throw UsageError(fmt::format("{}: '{}' has no place in {}", origin, step, shown(*json)));
      json = &(*json)[step];
    }
  }
  *json = std::move(value);
  origins_.insert_or_assign(place, origin);
}

void JsonNode::fail(std::string_view problem) const {
  throw UsageError(fmt::format("{}{}{}{}", file_->position(place_), place_, place_.empty() ? "" : ": ", problem));
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
  return json_->get<std::string>();
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
    fail(fmt::format("unknown value '{}'; accepted: {}{}", value, fmt::join(accepted, ", "), suggestion(value, accepted)));
  return value;
}

}  // namespace amrtex
