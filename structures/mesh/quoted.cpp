#include "structures/mesh/quoted.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>

namespace amrtex {
namespace {

constexpr std::size_t kMostListed = 200;  // characters of a list of names
constexpr std::size_t kMostOfAName = 40;

struct Character {
  std::size_t bytes = 1;
  char32_t code = 0;
  bool valid = false;
};

/// The character at the start of a text that is not empty (RFC 3629).
Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = byte(0);
  if (lead < 0x80) return {1, lead, true};
  const std::size_t bytes = lead >= 0xF0 ? 4 : (lead >= 0xE0 ? 3 : 2);
  if (lead < 0xC2 || lead > 0xF4 || text.size() < bytes) return {};
  char32_t code = lead & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    code = (code << 6) | (byte(i) & 0x3FU);
  }
  constexpr char32_t kLowest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool valid = code >= kLowest[bytes] && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
  return valid ? Character{bytes, code, true} : Character{};
}

/// Characters that a terminal obeys instead of showing, or that show text in another order or on another line.
bool is_obeyed(char32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x61C || (code >= 0x200B && code <= 0x200F) ||
         (code >= 0x2028 && code <= 0x202E) || (code >= 0x2060 && code <= 0x206F) || code == 0xFEFF;
}

/// Takes the first character off the text and returns it as it is shown.
std::string take_shown(std::string_view& text) {
  const Character c = first_character(text);
  const std::string_view bytes = text.substr(0, c.bytes);
  text.remove_prefix(c.bytes);
  if (c.valid && !is_obeyed(c.code)) return std::string(bytes);
  if (c.valid && c.code >= 0x80) return fmt::format("\\u{{{:x}}}", static_cast<std::uint32_t>(c.code));
  return fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes.front()));
}

/// Characters of a text that is printable, an escape counted as its letters.
std::size_t length_of(std::string_view text) {
  std::size_t count = 0;
  for (; !text.empty(); ++count) text.remove_prefix(first_character(text).bytes);
  return count;
}

std::size_t bytes_of_first(std::string_view text, std::size_t characters) {
  std::size_t bytes = 0;
  for (; characters > 0 && bytes < text.size(); --characters) bytes += first_character(text.substr(bytes)).bytes;
  return bytes;
}

}  // namespace

std::string printable(std::string_view text) {
  std::string shown;
  while (!text.empty()) shown += take_shown(text);
  return shown;
}

std::string clipped(std::string_view text, std::size_t most) {
  constexpr std::string_view kCut = "...";
  std::string kept;             // fits with what says that it is cut
  std::size_t kept_length = 0;  // characters
  std::string tail;             // fits too, where nothing follows
  std::size_t length = 0;
  while (!text.empty()) {
    const std::string next = take_shown(text);
    length += length_of(next);
    if (length > most) return kept + std::string(kCut);
    if (tail.empty() && kept_length + length_of(next) + kCut.size() <= most) {
      kept += next;
      kept_length = length;
    } else {
      tail += next;
    }
  }
  return kept + tail;
}

std::string quote(std::string_view text) { return "'" + clipped(text) + "'"; }

std::string shown(const Json& value) {
  if (value.is_string()) return "\"" + clipped(value.get_ref<const std::string&>()) + "\"";
  if (value.is_number_float()) return fmt::format("{}", value.get<double>());  // JSON has no name for NaN
  return clipped(value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

std::string listed(std::span<const std::string> names) {
  std::string list;
  std::size_t length = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = clipped(names[i], kMostOfAName);
    length += length_of(name) + 2;
    if (i > 0 && length > kMostListed) return fmt::format("{} and {} more", list, names.size() - i);
    list += (i > 0 ? ", " : "") + name;
  }
  return list;
}

std::string one_line(std::string_view text, std::size_t most) {
  constexpr std::string_view kLeftOut = " ... ";
  std::string flat(text);
  std::replace(flat.begin(), flat.end(), '\n', ' ');  // a compiler's log, say
  const std::string line = printable(flat);
  const std::size_t length = length_of(line);
  if (length <= most) return line;
  // the file's name stands at the front and what is accepted at the end
  const std::size_t front = (most - kLeftOut.size()) * 3 / 5;
  const std::size_t end = most - kLeftOut.size() - front;
  return line.substr(0, bytes_of_first(line, front)) + std::string(kLeftOut) + line.substr(bytes_of_first(line, length - end));
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const Character c = first_character(text);
    if (!c.valid) return false;
    text.remove_prefix(c.bytes);
  }
  return true;
}

std::string reason_of(const std::error_code& failure) {
  std::string reason = failure.message();
  if (!reason.empty()) reason.front() = static_cast<char>(std::tolower(static_cast<unsigned char>(reason.front())));
  return reason;
}

std::string why_absent(const std::filesystem::path& path) {
  std::error_code failure;
  const auto status = std::filesystem::status(path, failure);
  if (std::filesystem::exists(status)) return "";
  return failure ? reason_of(failure) : "no such file or directory";
}

}  // namespace amrtex
