#include "renderers/bindings/shader_assembler.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <set>

#include "renderers/bindings/shader_macros.hpp"
#include "shaders/shader_library.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using FindFile = std::function<std::optional<std::string_view>(std::string_view)>;

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

struct Directive {
  std::string_view name;  ///< "include", "if", ...; empty for any other line
  std::string_view rest;
};

Directive parse_directive(std::string_view line) {
  line = trimmed(line);
  if (line.empty() || line.front() != '#') return {};
  line = trimmed(line.substr(1));
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto end = std::find_if_not(line.begin(), line.end(), is_letter);
  const auto n = static_cast<std::size_t>(end - line.begin());
  return {line.substr(0, n), trimmed(line.substr(n))};
}

/// NAME(a, b, ...) at the start of a line, with up to three arguments.
struct Declaration {
  std::string_view macro;
  std::array<std::string_view, 3> arguments;
};

/// A declaration that portable_glsl.h spells as a macro; without one its macro is empty.
Declaration parse_declaration(std::string_view line) {
  constexpr std::array<std::string_view, 8> macros{"DEFINE_INT",     "UNIFORM",         "UNIFORM_ARRAY", "VALUE_TEXTURE",
                                                   "VALUE_TEXTURES", "INTEGER_TEXTURE", "BUFFER",        "VALUE_TEXTURE_SET"};
  line = trimmed(line);
  const std::size_t open = line.find('(');
  const std::size_t close = line.rfind(')');
  if (open == std::string_view::npos || close == std::string_view::npos) return {};
  if (std::find(macros.begin(), macros.end(), line.substr(0, open)) == macros.end()) return {};
  Declaration d{line.substr(0, open), {}};
  std::string_view rest = line.substr(open + 1, close - open - 1);
  for (std::string_view& argument : d.arguments) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    argument = trimmed(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  return d;
}

/// What stands behind `//`.
std::string_view comment_of(std::string_view line) {
  const std::size_t at = line.find("//");
  return at == std::string_view::npos ? std::string_view() : trimmed(line.substr(at + 2));
}

/// The line with its comments blanked; `inside` says whether a block comment is open.
std::string without_comments(std::string_view line, bool& inside) {
  std::string code;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::string_view two = line.substr(i, 2);
    if (inside) {
      if (two == "*/") inside = false, ++i;
    } else if (two == "/*") {
      inside = true, ++i;
      code += ' ';
    } else if (two == "//") {
      break;
    } else {
      code += line[i];
    }
  }
  return code;
}

/// Which lines of a file the #ifs around them leave in.
class Branches {
 public:
  bool active() const { return stack_.empty() || stack_.back().active; }
  bool balanced() const { return stack_.empty(); }
  /// Is the condition of an #elif asked for?
  bool undecided() const { return !stack_.empty() && stack_.back().outer && !stack_.back().taken; }

  void open(bool condition) {
    const bool outer = active();
    stack_.push_back({outer, condition, outer && condition});
  }
  /// #elif and #else. False without an #if.
  bool turn(bool condition) {
    if (stack_.empty()) return false;
    Branch& b = stack_.back();
    b.active = b.outer && !b.taken && condition;
    b.taken = b.taken || condition;
    return true;
  }
  /// False without an #if.
  bool close() {
    if (stack_.empty()) return false;
    stack_.pop_back();
    return true;
  }

 private:
  struct Branch {
    bool outer;  // is what is around it left in?
    bool taken;  // was any branch of it?
    bool active;
  };
  std::vector<Branch> stack_;
};

class Assembler {
 public:
  Assembler(const ShaderKey& key, FindFile find) : key_(key), find_(std::move(find)) {}

  AssembledShader assemble() {
    result_.files.emplace_back("(defines)");
    add_prelude();
    add_file(key_.entry, "");
    result_.hash = hash_text(result_.text);
    return std::move(result_);
  }

 private:
  struct Place {
    std::string file;
    int line = 0;
  };

  void add_line(std::string_view line) { result_.text.append(line).push_back('\n'); }

  void add_prelude() {
    add_line("#version 450 core");
    for (const std::string& name : key_.extensions) add_line(fmt::format("#extension {} : require", name));
    for (const auto& [name, text] : key_.defines) {
      add_line(fmt::format("#define {} {}", name, text));
      macros_.define(name, text);
    }
  }

  std::string chain_text() const {
    std::string text;
    for (auto place = chain_.rbegin(); place != chain_.rend(); ++place)
      text += fmt::format("{}{}:{}", text.empty() ? "" : ", included from ", place->file, place->line);
    return text.empty() ? "shader" : text;
  }

  [[noreturn]] void fail(std::string_view problem) const { throw Error(fmt::format("{}: {}", chain_text(), problem)); }

  void add_file(const std::string& path, std::string_view wanted_as) {
    const std::optional<std::string_view> text = find_(path);
    if (!text) fail(fmt::format("no shader file '{}'{}", path, wanted_as));
    const std::size_t index = result_.files.size();
    result_.files.push_back(path);
    add_line(fmt::format("#line 1 {}", index));
    add_lines(path, *text, index);
  }

  void add_lines(const std::string& path, std::string_view text, std::size_t index) {
    Branches branches;
    bool in_comment = false;
    std::string code;  // of a line and those that a backslash joins to it
    chain_.push_back({path, 0});
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = text.substr(0, end);
      text.remove_prefix(std::min(end + 1, text.size()));
      ++chain_.back().line;
      code += without_comments(line, in_comment);
      if (code.ends_with('\\')) {
        code.back() = ' ';
        add_line(line);
        continue;
      }
      const Directive directive = parse_directive(code);
      if (directive.name == "include") {
        if (branches.active()) add_include(directive.rest);
        add_line(fmt::format("#line {} {}", chain_.back().line + 1, index));
      } else if (directive.name == "pragma" && directive.rest == "once") {
        add_line("");  // true of every file here; drivers would warn
      } else {
        add_line(line);
        if (!directive.name.empty())
          obey(directive, branches);
        else if (branches.active())
          note_declaration(parse_declaration(code), comment_of(line));
      }
      code.clear();
    }
    if (!branches.balanced()) throw Error(fmt::format("{}: #if without #endif", path));
    chain_.pop_back();
  }

  std::int64_t evaluate(std::string_view what, std::string_view expression) const {
    try {
      return macros_.evaluate(expression);
    } catch (const Error& problem) {
      fail(fmt::format("{} {}: {}", what, expression, problem.what()));
    }
  }

  /// The directives that decide which lines are left in, and the names that they ask for.
  void obey(const Directive& d, Branches& branches) {
    const bool active = branches.active();
    if (d.name == "if")
      branches.open(active && evaluate("#if", d.rest) != 0);
    else if (d.name == "ifdef")
      branches.open(macros_.defined(d.rest));
    else if (d.name == "ifndef")
      branches.open(!macros_.defined(d.rest));
    else if (d.name == "elif" && !branches.turn(branches.undecided() && evaluate("#elif", d.rest) != 0))
      fail("#elif without #if");
    else if (d.name == "else" && !branches.turn(true))
      fail("#else without #if");
    else if (d.name == "endif" && !branches.close())
      fail("#endif without #if");
    else if (active && d.name == "define")
      macros_.define(d.rest);
    else if (active && d.name == "undef")
      macros_.undefine(d.rest);
    else if (active && d.name == "error")
      fail(d.rest);
  }

  /// Notes what the host has to provide; a define has to be there already.
  void note_declaration(const Declaration& d, std::string_view meaning) {
    if (d.macro.empty()) return;
    const std::string place = fmt::format("{}:{}", chain_.back().file, chain_.back().line);
    const std::string first(d.arguments[0]);
    const std::string second(d.arguments[1]);
    if (d.macro == "DEFINE_INT") {
      if (!macros_.defined(first)) fail(fmt::format("{} is not defined{}{}", first, meaning.empty() ? "" : ": ", meaning));
    } else if (d.macro == "UNIFORM" || d.macro == "UNIFORM_ARRAY") {
      const bool array = d.macro == "UNIFORM_ARRAY";
      result_.uniforms.push_back({second, place, array ? static_cast<int>(evaluate(second, d.arguments[2])) : 1});
    } else if (d.macro == "VALUE_TEXTURES") {
      const auto count = static_cast<int>(evaluate(first, d.arguments[1]));
      for (int i = 0; i < count; ++i) result_.resources.push_back({element_name(first, i), place, 1});
    } else {
      result_.resources.push_back({d.macro == "BUFFER" ? second : first, place, 1});
    }
  }

  void add_include(std::string_view what) {
    if (what == "AMRTEX_ENCODING_FILE") {
      if (key_.encoding_file.empty()) fail("the key names no encoding's file");
      return include(key_.encoding_file, " (the encoding's file)");
    }
    const bool quoted = what.size() > 2 && what.front() == '"' && what.back() == '"';
    if (!quoted) fail(fmt::format("#include {}: \"path\" or AMRTEX_ENCODING_FILE expected", what));
    include(std::string(what.substr(1, what.size() - 2)), "");
  }

  void include(const std::string& path, std::string_view wanted_as) {
    const auto open = [&](const Place& place) { return place.file == path; };
    if (std::any_of(chain_.begin(), chain_.end(), open)) fail(fmt::format("'{}' includes itself", path));
    if (included_.insert(path).second) add_file(path, wanted_as);
  }

  const ShaderKey& key_;
  FindFile find_;
  AssembledShader result_;
  ShaderMacros macros_;
  std::vector<Place> chain_;
  std::set<std::string> included_;
};

/// Takes the decimal number that `text` begins with.
std::optional<std::size_t> take_number(std::string_view& text) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

/// "file:line" or "file(line)" at the start of a line, perhaps after "ERROR: ".
std::string map_line(std::string_view line, const std::vector<std::string>& files) {
  std::string_view rest = line;
  std::string_view kind;
  for (std::string_view word : {"ERROR: ", "WARNING: "})
    if (rest.starts_with(word)) kind = word;
  rest.remove_prefix(kind.size());
  const std::optional<std::size_t> file = take_number(rest);
  if (!file || *file >= files.size() || rest.empty() || (rest.front() != ':' && rest.front() != '(')) return std::string(line);
  const bool bracket = rest.front() == '(';
  rest.remove_prefix(1);
  const std::optional<std::size_t> number = take_number(rest);
  if (!number || (bracket && !rest.starts_with(')'))) return std::string(line);
  if (bracket) rest.remove_prefix(1);
  return fmt::format("{}{}:{}{}", kind, files[*file], *number, rest);
}

template <class Real>
std::string literal(Real value, std::string_view suffix) {
  if (!std::isfinite(value)) throw Error(fmt::format("the number {} cannot be written in GLSL", value));
  std::array<char, 64> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  std::string text(buffer.data(), end);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text.append(suffix);
}

}  // namespace

ShaderKey& ShaderKey::define(std::string_view name, std::string_view text) {
  const auto [place, added] = defines.emplace(name, text);
  if (!added && place->second != text)
    throw Error(fmt::format("shader {}: {} is defined as {} and as {}", entry, name, place->second, text));
  return *this;
}

ShaderKey& ShaderKey::define(std::string_view name, int value) { return define(name, std::to_string(value)); }

ShaderKey& ShaderKey::use(const ShaderPart& part) {
  encoding_file = part.file;
  for (const auto& [name, value] : part.defines) define(name, value);
  extensions.insert(extensions.end(), part.extensions.begin(), part.extensions.end());
  return *this;
}

AssembledShader assemble_shader(const ShaderKey& key) {
  const auto find = [](std::string_view path) -> std::optional<std::string_view> {
    for (const ShaderFile& file : shader_files())
      if (file.path == path) return file.text;
    return std::nullopt;
  };
  return Assembler(key, find).assemble();
}

AssembledShader assemble_shader(const ShaderKey& key, const ShaderFiles& files) {
  const auto find = [&files](std::string_view path) -> std::optional<std::string_view> {
    const auto file = files.find(path);
    if (file == files.end()) return std::nullopt;
    return file->second;
  };
  return Assembler(key, find).assemble();
}

std::string map_log(std::string_view log, const std::vector<std::string>& files) {
  std::string mapped;
  while (!log.empty()) {
    const std::size_t end = std::min(log.find('\n'), log.size());
    mapped += map_line(log.substr(0, end), files) + '\n';
    log.remove_prefix(std::min(end + 1, log.size()));
  }
  while (!mapped.empty() && mapped.back() == '\n') mapped.pop_back();
  return mapped;
}

std::string hash_text(std::string_view text) {
  const XXH128_hash_t h = XXH3_128bits(text.data(), text.size());
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

std::string glsl_literal(float value) { return literal(value, ""); }
std::string glsl_literal(double value) { return literal(value, "lf"); }

}  // namespace amrtex
