#include "bench/records/point_query.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <map>
#include <optional>
#include <utility>

#include "bench/records/record.hpp"
#include "bench/settings/settings_table.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {

struct PointQuery::Node {
  enum class Kind { all, any, none, compare, among };
  Kind kind = Kind::compare;
  std::vector<std::unique_ptr<const Node>> parts = {};  ///< of all, any, none
  std::string place = {};                               ///< in a record
  std::string operation = {};
  std::vector<Json> values = {};

  bool holds(const Json& point) const;
};

namespace {

using Node = PointQuery::Node;
using NodePtr = std::unique_ptr<const Node>;

constexpr std::array<std::string_view, 6> kOperations = {"=", "!=", "<", "<=", ">", ">="};

/// Names of what a point is made of, and where a record has them. Plural names are those of experiment files.
std::map<std::string, std::string, std::less<>> make_places() {
  std::map<std::string, std::string, std::less<>> places;
  for (const Encoding* encoding : all_encodings())
    for (const ParameterInfo& p : encoding->parameters()) places[p.name] = "/build_parameters/" + p.name;
  const auto add = [&](std::string_view section) {
    for (const Key* key : section_of(section).keys)
      if (!is_top_level(*key)) places[key->name] = "/render/" + key->in_record();
  };
  add("render");
  const std::initializer_list<std::pair<const char*, const char*>> others = {
      {"encoding", "/encoding"},     {"encodings", "/encoding"},     {"dataset", "/dataset/name"},
      {"datasets", "/dataset/name"}, {"field", "/dataset/field"},    {"filter", "/filter"},
      {"filters", "/filter"},        {"storage", "/storage"},        {"filtering", "/filtering"},
      {"view", "/render/view_name"}, {"views", "/render/view_name"}, {"transfer_function", "/render/transfer_function_name"},
      {"status", "/status"},         {"repetition", "/repetition"}};
  for (const auto& [name, place] : others) places[name] = place;
  return places;
}

const std::map<std::string, std::string, std::less<>>& places() {
  static const auto made = make_places();
  return made;
}

std::optional<double> number_in(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

/// As it is compared where it is no number.
std::string as_text(const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

bool equal(const Json& a, const Json& b) {
  if (a.is_null() || b.is_null()) return a.is_null() && b.is_null();
  if (a.is_number() && b.is_number()) return a.get<double>() == b.get<double>();
  return as_text(a) == as_text(b);
}

bool compare(const Json& own, const std::string& operation, const Json& asked) {
  if (operation == "=") return equal(own, asked);
  if (operation == "!=") return !equal(own, asked);
  if (!own.is_number()) return false;
  const double a = own.get<double>(), b = asked.get<double>();
  if (operation == "<") return a < b;
  if (operation == "<=") return a <= b;
  return operation == ">" ? a > b : a >= b;
}

struct Token {
  enum class Kind { word, quoted, symbol, end };
  Kind kind = Kind::end;
  std::string text = {};
  std::size_t place = 0;  ///< from 1
};

class Parser {
 public:
  Parser(std::string_view text, std::string_view what) : text_(text), what_(what) { next(); }

  NodePtr parse() {
    NodePtr root = alternatives();
    if (token_.kind != Token::Kind::end) fail("`and`, `or` or the end");
    return root;
  }

 private:
  [[noreturn]] void fail(std::string_view accepted, std::string_view hint = "") const {
    const std::string found = token_.kind == Token::Kind::end ? "the end" : quote(token_.text);
    throw UsageError(
        fmt::format("{}: character {}: {} is not expected; accepted: {}{}", what_, token_.place, found, accepted, hint));
  }

  static bool is_symbol(char c) { return std::string_view("=!<>(),").find(c) != std::string_view::npos; }

  void next() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    token_ = {Token::Kind::end, {}, at_ + 1};
    if (at_ == text_.size()) return;
    const char c = text_[at_];
    if (c == '\'' || c == '"') return next_quoted(c);
    std::size_t end = at_ + 1;
    if (is_symbol(c)) {
      if (end < text_.size() && text_[end] == '=' && std::string_view("!<>=").find(c) != std::string_view::npos) ++end;
    } else {
      while (end < text_.size() && !is_symbol(text_[end]) && std::isspace(static_cast<unsigned char>(text_[end])) == 0) ++end;
    }
    token_.kind = is_symbol(c) ? Token::Kind::symbol : Token::Kind::word;
    token_.text = text_.substr(at_, end - at_);
    if (token_.text == "==") token_.text = "=";
    at_ = end;
  }

  void next_quoted(char mark) {
    const std::size_t end = text_.find(mark, at_ + 1);
    if (end == std::string_view::npos) throw UsageError(fmt::format("{}: character {}: the quote is not closed", what_, at_ + 1));
    token_ = {Token::Kind::quoted, std::string(text_.substr(at_ + 1, end - at_ - 1)), at_ + 1};
    at_ = end + 1;
  }

  bool takes(Token::Kind kind, std::string_view text) {
    if (token_.kind != kind || token_.text != text) return false;
    next();
    return true;
  }
  bool takes_word(std::string_view word) { return takes(Token::Kind::word, word); }
  bool takes_symbol(std::string_view symbol) { return takes(Token::Kind::symbol, symbol); }

  template <class Inner>
  NodePtr joined(Node::Kind kind, std::string_view word, Inner&& inner) {
    auto node = std::make_unique<Node>();
    node->kind = kind;
    node->parts.push_back(inner());
    while (takes_word(word)) node->parts.push_back(inner());
    return node;
  }
  NodePtr alternatives() {
    return joined(Node::Kind::any, "or", [&] { return joined(Node::Kind::all, "and", [&] { return factor(); }); });
  }

  NodePtr factor() {
    if (++depth_ > 100) fail("at most 100 parentheses and `not` inside each other");
    NodePtr part;
    if (takes_word("not")) {
      auto node = std::make_unique<Node>();
      node->kind = Node::Kind::none;
      node->parts.push_back(factor());
      part = std::move(node);
    } else if (takes_symbol("(")) {
      part = alternatives();
      if (!takes_symbol(")")) fail("`)`, `and` or `or`");
    } else {
      part = comparison();
    }
    --depth_;
    return part;
  }

  NodePtr comparison() {
    auto node = std::make_unique<Node>();
    node->place = key();
    if (takes_word("in")) {
      node->kind = Node::Kind::among;
      if (!takes_symbol("(")) fail("`(` before the values of `in`");
      do node->values.push_back(value());
      while (takes_symbol(","));
      if (!takes_symbol(")")) fail("`,` or `)`");
      return node;
    }
    if (token_.kind != Token::Kind::symbol || std::find(kOperations.begin(), kOperations.end(), token_.text) == kOperations.end())
      fail("=, !=, <, <=, >, >= or `in`");
    node->operation = token_.text;
    next();
    const bool ordered = node->operation != "=" && node->operation != "!=";
    if (ordered && !(token_.kind == Token::Kind::word && number_in(token_.text))) fail("a number");
    node->values.push_back(value());
    return node;
  }

  std::string key() {
    if (token_.kind != Token::Kind::word) fail("a key, `not` or `(`");
    const std::string place = place_in_record(token_.text);
    if (place.empty()) {
      const std::vector<std::string> names = queried_keys();
      const std::vector<std::string_view> accepted(names.begin(), names.end());
      fail("a key of the settings table (`amrtex settings`), a build parameter, encoding, dataset, filter",
           suggestion(token_.text, accepted));
    }
    next();
    return place;
  }

  Json value() {
    Json json;
    if (token_.kind == Token::Kind::quoted)
      json = token_.text;
    else if (token_.kind != Token::Kind::word)
      fail("a value: a word, a number, or a text between quotes");
    else if (const auto number = number_in(token_.text))
      json = *number;
    else if (token_.text == "true" || token_.text == "false")
      json = token_.text == "true";
    else if (token_.text != "null")
      json = token_.text;
    next();
    return json;
  }

  std::string_view text_;
  std::string_view what_;
  std::size_t at_ = 0;
  int depth_ = 0;
  Token token_;
};

}  // namespace

bool PointQuery::Node::holds(const Json& point) const {
  const auto part_holds = [&](const NodePtr& part) { return part->holds(point); };
  switch (kind) {
    case Kind::all:
      return std::all_of(parts.begin(), parts.end(), part_holds);
    case Kind::any:
      return std::any_of(parts.begin(), parts.end(), part_holds);
    case Kind::none:
      return !parts.front()->holds(point);
    case Kind::compare:
      return compare(value_at(point, place), operation, values.front());
    case Kind::among:
      return std::any_of(values.begin(), values.end(), [&](const Json& v) { return equal(value_at(point, place), v); });
  }
  return false;
}

PointQuery::PointQuery(std::string_view text, std::string_view what) : root_(Parser(text, what).parse()) {}
PointQuery::~PointQuery() = default;
PointQuery::PointQuery(PointQuery&&) noexcept = default;
PointQuery& PointQuery::operator=(PointQuery&&) noexcept = default;

bool PointQuery::holds(const Json& point) const { return root_->holds(point); }

std::string place_in_record(std::string_view key) {
  const auto found = places().find(key);
  return found == places().end() ? std::string() : found->second;
}

std::vector<std::string> queried_keys() {
  std::vector<std::string> names;
  for (const auto& [name, place] : places()) names.push_back(name);
  return names;
}

}  // namespace amrtex
