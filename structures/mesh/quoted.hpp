// Foreign text in messages and on terminals: what a file, a name or a command line says is never printed as it stands.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "structures/mesh/json.hpp"

namespace amrtex {

/// Characters of foreign text that one message quotes, at most.
inline constexpr std::size_t kMostQuoted = 80;

/// The text with its control characters, characters that turn the direction of writing, and bytes that are not UTF-8
/// written as escapes: "\x1b", "\u{202e}".
std::string printable(std::string_view text);
/// Printable, and cut behind `most` characters, which "..." then ends.
std::string clipped(std::string_view text, std::size_t most = kMostQuoted);
/// Clipped, between single quotes.
std::string quote(std::string_view text);
/// A JSON value as it is written, clipped.
std::string shown(const Json& value);
/// Names with commas between them, each and all of them clipped: "a, b, c and 97 more".
std::string listed(std::span<const std::string> names);
/// A message for a terminal: printable, on one line, of at most `most` characters; the middle is left out where it is longer.
std::string one_line(std::string_view text, std::size_t most);
/// Is all of it UTF-8, without surrogates and overlong forms?
bool is_utf8(std::string_view text);

/// The system's reason in lower case, as in "no such file or directory".
std::string reason_of(const std::error_code& failure);
/// Why there is nothing to be found under this path; empty where there is.
std::string why_absent(const std::filesystem::path& path);

}  // namespace amrtex
