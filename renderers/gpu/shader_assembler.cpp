#include "renderers/gpu/shader_assembler.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <optional>

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
  struct Place {  ///< where an include stands, or stood first
    std::string file;
    int line = 0;
    bool conditional = false;
  };

  void add_line(std::string_view line) { result_.text.append(line).push_back('\n'); }

  void add_prelude() {
    add_line("#version 450 core");
    for (const std::string& name : key_.extensions) add_line(fmt::format("#extension {} : require", name));
    for (const auto& [name, text] : key_.defines) add_line(fmt::format("#define {} {}", name, text));
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
    int depth = 0;
    bool in_comment = false;
    int number = 0;
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = text.substr(0, end);
      text.remove_prefix(std::min(end + 1, text.size()));
      ++number;
      const std::string code = without_comments(line, in_comment);
      const Directive directive = parse_directive(code);
      if (directive.name.starts_with("if")) ++depth;
      if (directive.name == "endif") --depth;
      if (directive.name == "include") {
        chain_.push_back({path, number, depth > 0});
        add_include(directive.rest);
        chain_.pop_back();
        add_line(fmt::format("#line {} {}", number + 1, index));
      } else if (directive.name == "pragma" && directive.rest == "once") {
        add_line("");  // true of every file here; drivers would warn
      } else {
        add_line(line);
      }
    }
    if (depth != 0) throw Error(fmt::format("{}: #if without #endif", path));
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
    const bool conditional = std::any_of(chain_.begin(), chain_.end(), [](const Place& place) { return place.conditional; });
    const auto [first, added] = included_.emplace(path, chain_.back());
    if (added) {
      first->second.conditional = conditional;
      add_file(path, wanted_as);
    } else if (first->second.conditional) {
      fail(fmt::format("'{}' was taken at {}:{} already, inside an #if that may have left it out", path, first->second.file,
                       first->second.line));
    }
  }

  const ShaderKey& key_;
  FindFile find_;
  AssembledShader result_;
  std::vector<Place> chain_;
  std::map<std::string, Place> included_;
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
