#include "renderers/bindings/shader_macros.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <vector>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using Tokens = std::vector<std::string>;

constexpr int kDeepest = 16;  ///< names inside of names
/// Numbers beyond it are refused, so that no product of two overflows.
constexpr std::int64_t kLargest = std::numeric_limits<std::int32_t>::max();

bool begins_name(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// Length of the name or number that `text` begins with.
std::size_t word_length(std::string_view text) {
  const auto end = std::find_if_not(text.begin(), text.end(), [](char c) { return begins_name(c) || is_digit(c); });
  return static_cast<std::size_t>(end - text.begin());
}

Tokens tokens_of(std::string_view text) {
  constexpr std::array<std::string_view, 8> pairs{"||", "&&", "==", "!=", "<=", ">=", "<<", ">>"};
  Tokens tokens;
  for (text = trimmed(text); !text.empty(); text = trimmed(text)) {
    std::size_t n = word_length(text);
    if (n == 0) n = std::find(pairs.begin(), pairs.end(), text.substr(0, 2)) != pairs.end() ? 2 : 1;
    tokens.emplace_back(text.substr(0, n));
    text.remove_prefix(n);
  }
  return tokens;
}

/// Replaces names by their texts, and defined(NAME) by 1 or 0.
class Expansion {
 public:
  explicit Expansion(const ShaderMacros::Texts& texts) : texts_(texts) {}

  Tokens expand(const Tokens& tokens, int depth = 0) const {
    Tokens expanded;
    for (std::size_t i = 0; i < tokens.size(); ++i) {
      if (tokens[i] == "defined") {
        expanded.emplace_back(texts_.contains(asked_name(tokens, i)) ? "1" : "0");
      } else if (begins_name(tokens[i].front())) {
        const Tokens inner = expand(tokens_of(text_of(tokens[i], depth)), depth + 1);
        expanded.insert(expanded.end(), inner.begin(), inner.end());
      } else {
        expanded.push_back(tokens[i]);
      }
    }
    return expanded;
  }

 private:
  /// The name that defined(NAME) or defined NAME asks for; `i` moves to its last token.
  static std::string asked_name(const Tokens& tokens, std::size_t& i) {
    const bool bracket = i + 1 < tokens.size() && tokens[i + 1] == "(";
    const std::size_t name = i + (bracket ? 2 : 1);
    const std::size_t last = name + (bracket ? 1 : 0);
    if (last >= tokens.size() || !begins_name(tokens[name].front()) || (bracket && tokens[last] != ")"))
      throw Error("defined: a name is expected");
    i = last;
    return tokens[name];
  }

  const std::string& text_of(const std::string& name, int depth) const {
    const auto text = texts_.find(name);
    if (text == texts_.end()) throw Error(fmt::format("{} is not defined", name));
    if (!text->second) throw Error(fmt::format("{} takes arguments, which an #if cannot give it", name));
    if (depth > kDeepest) throw Error(fmt::format("{} is defined through itself", name));
    return *text->second;
  }

  const ShaderMacros::Texts& texts_;
};

/// By precedence; both sides of every operator are evaluated.
class Parser {
 public:
  explicit Parser(Tokens tokens) : tokens_(std::move(tokens)) {}

  std::int64_t parse() {
    const std::int64_t value = binary(1);
    if (at_ != tokens_.size()) throw Error(fmt::format("'{}' is not expected", tokens_[at_]));
    return value;
  }

 private:
  static int precedence(std::string_view op) {
    constexpr std::array<std::pair<std::string_view, int>, 15> table{{{"||", 1},
                                                                      {"&&", 2},
                                                                      {"==", 3},
                                                                      {"!=", 3},
                                                                      {"<", 4},
                                                                      {">", 4},
                                                                      {"<=", 4},
                                                                      {">=", 4},
                                                                      {"<<", 5},
                                                                      {">>", 5},
                                                                      {"+", 6},
                                                                      {"-", 6},
                                                                      {"*", 7},
                                                                      {"/", 7},
                                                                      {"%", 7}}};
    const auto row = std::find_if(table.begin(), table.end(), [&](const auto& r) { return r.first == op; });
    return row == table.end() ? 0 : row->second;
  }

  static std::int64_t apply(std::string_view op, std::int64_t a, std::int64_t b) {
    if (op == "||") return a != 0 || b != 0 ? 1 : 0;
    if (op == "&&") return a != 0 && b != 0 ? 1 : 0;
    if (op == "==") return a == b ? 1 : 0;
    if (op == "!=") return a != b ? 1 : 0;
    if (op == "<") return a < b ? 1 : 0;
    if (op == ">") return a > b ? 1 : 0;
    if (op == "<=") return a <= b ? 1 : 0;
    if (op == ">=") return a >= b ? 1 : 0;
    if (op == "+") return a + b;
    if (op == "-") return a - b;
    if (op == "*") return a * b;
    if (op == "<<" || op == ">>") return shift(op, a, b);
    if (b == 0) throw Error("division by 0");
    return op == "/" ? a / b : a % b;
  }

  static std::int64_t shift(std::string_view op, std::int64_t a, std::int64_t b) {
    if (a < 0 || b < 0 || b > 31) throw Error(fmt::format("{} {} {}: a shift by 0 to 31 is expected", a, op, b));
    return op == "<<" ? a << b : a >> b;
  }

  std::int64_t binary(int least) {
    std::int64_t value = unary();
    while (at_ < tokens_.size() && precedence(tokens_[at_]) >= least) {
      const std::string op = tokens_[at_++];
      value = apply(op, value, binary(precedence(op) + 1));
      if (value > kLargest || value < -kLargest) throw Error(fmt::format("{} is beyond 32 bits", value));
    }
    return value;
  }

  std::int64_t unary() {
    if (at_ == tokens_.size()) throw Error("the expression ends too early");
    const std::string token = tokens_[at_++];
    if (token == "!") return unary() == 0 ? 1 : 0;
    if (token == "-") return -unary();
    if (token == "+") return unary();
    if (token != "(") return number(token);
    const std::int64_t value = binary(1);
    if (at_ == tokens_.size() || tokens_[at_] != ")") throw Error("')' is missing");
    ++at_;
    return value;
  }

  static std::int64_t number(std::string_view token) {
    std::string_view digits = token;
    if (digits.ends_with('u') || digits.ends_with('U')) digits.remove_suffix(1);
    const bool hexadecimal = digits.starts_with("0x") || digits.starts_with("0X");
    if (hexadecimal) digits.remove_prefix(2);
    std::int32_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, hexadecimal ? 16 : 10);
    if (error != std::errc() || end != digits.data() + digits.size()) throw Error(fmt::format("'{}' is not expected", token));
    return value;
  }

  Tokens tokens_;
  std::size_t at_ = 0;
};

}  // namespace

void ShaderMacros::define(std::string_view definition) {
  const std::size_t n = word_length(definition);
  const std::string_view rest = definition.substr(n);
  if (n == 0 || !begins_name(definition.front())) throw Error(fmt::format("#define {}: a name is expected", definition));
  const std::string name(definition.substr(0, n));
  if (rest.starts_with('('))
    texts_.insert_or_assign(name, std::nullopt);
  else
    define(name, trimmed(rest));
}

void ShaderMacros::undefine(std::string_view name) {
  if (const auto it = texts_.find(name); it != texts_.end()) texts_.erase(it);
}

std::int64_t ShaderMacros::evaluate(std::string_view expression) const {
  return Parser(Expansion(texts_).expand(tokens_of(expression))).parse();
}

}  // namespace amrtex
