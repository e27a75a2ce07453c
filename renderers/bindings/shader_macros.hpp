// Names that #define gave to a shader's text, and the value of an #if over them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace amrtex {

class ShaderMacros {
 public:
  /// Of a name: its text; nullopt for a macro with arguments, which an expression cannot use.
  using Texts = std::map<std::string, std::optional<std::string>, std::less<>>;

  /// `definition`: what follows #define.
  void define(std::string_view definition);
  void define(std::string_view name, std::string_view text) { texts_.insert_or_assign(std::string(name), std::string(text)); }
  void undefine(std::string_view name);
  bool defined(std::string_view name) const { return texts_.contains(name); }

  /// Value of a whole-number expression as in #if. Throws Error that names the problem, and the name that is not defined: none
  /// ever counts as 0.
  std::int64_t evaluate(std::string_view expression) const;

 private:
  Texts texts_;
};

}  // namespace amrtex
