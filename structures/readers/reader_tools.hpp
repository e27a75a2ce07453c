// What readers of text formats share: the name of a data set, loading a text file
// of bounded size, and a scanner whose errors name the file and the line.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {

/// Larger text files are refused: 1 GiB holds the boxes of some ten million patches.
inline constexpr std::uint64_t kMaxTextBytes = std::uint64_t{1} << 30;
/// Longer lines are refused: 256 KiB hold a number each of ten thousand fields.
inline constexpr std::size_t kMaxLineBytes = std::size_t{1} << 18;

/// Name of a data set for tables: the path's last two components, or the last one where there is no named parent.
inline std::string dataset_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (clean.filename().empty()) clean = clean.parent_path();  // "a/b/" has an empty file name
  if (clean.empty() || clean.filename() == "." || clean.filename() == "..") {
    clean = std::filesystem::absolute(path).lexically_normal();
    if (clean.filename().empty()) clean = clean.parent_path();
  }
  const std::string parent = clean.parent_path().filename().string();
  const bool named = !parent.empty() && parent != "." && parent != ".." && parent != "/";
  return named ? parent + "/" + clean.filename().string() : clean.filename().string();
}

/// Size in bytes of a regular file, or an Error that names it. Devices and pipes are no data files.
inline std::uint64_t regular_file_size(const std::filesystem::path& path) {
  std::error_code failure;
  const auto status = std::filesystem::status(path, failure);
  if (!std::filesystem::exists(status)) throw Error(fmt::format("{}: {}", path.string(), why_absent(path)));
  if (!std::filesystem::is_regular_file(status))
    throw Error(fmt::format("{}: {}", path.string(),
                            std::filesystem::is_directory(status) ? "a folder, not a regular file" : "not a regular file"));
  const auto size = std::filesystem::file_size(path, failure);
  if (failure) throw Error(fmt::format("{}: {}", path.string(), reason_of(failure)));
  return size;
}

/// All bytes of a file of at most `max_bytes`.
inline std::string load_bytes(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const std::uint64_t size = regular_file_size(path);
  if (size > max_bytes) throw Error(fmt::format("{}: {} bytes; at most {} are read", path.string(), size, max_bytes));
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(fmt::format("{}: {}", path.string(), reason_of({errno, std::generic_category()})));
  std::string bytes(static_cast<std::size_t>(size), '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uint64_t>(in.gcount()) != size)
    throw Error(fmt::format("{}: only {} of {} bytes could be read", path.string(), in.gcount(), size));
  return bytes;
}

/// All bytes of a file or a pipe, at most `max_bytes`.
inline std::string load_stream(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const auto fail = [&](std::string_view what) -> void { throw Error(fmt::format("{}: {}", path.string(), what)); };
  if (const std::string reason = why_absent(path); !reason.empty()) fail(reason);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) fail("a folder, not a file");
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(reason_of({errno, std::generic_category()}));
  std::string bytes;
  std::array<char, std::size_t{1} << 16> block;
  while (in.read(block.data(), block.size()) || in.gcount() > 0) {
    bytes.append(block.data(), static_cast<std::size_t>(in.gcount()));
    if (bytes.size() > max_bytes) fail(fmt::format("more than {} bytes, which is the most that is read", max_bytes));
  }
  if (in.bad()) fail(reason_of({errno, std::generic_category()}));
  return bytes;
}

/// Throws Error for a line of more than `kMaxLineBytes`, which no format of ours has.
inline void check_lines(const std::filesystem::path& path, std::string_view text) {
  std::size_t line = 1;
  for (std::size_t at = 0; at < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (end - at > kMaxLineBytes)
      throw Error(
          fmt::format("{}, line {}: {} bytes; lines of at most {} are read", path.string(), line, end - at, kMaxLineBytes));
    at = end + 1;
  }
}

/// The whole text of a file of at most `max_bytes`, with lines of bounded length.
inline std::string load_text(const std::filesystem::path& path, std::uint64_t max_bytes = kMaxTextBytes) {
  std::string text = load_bytes(path, max_bytes);
  check_lines(path, text);
  return text;
}

/// Does a link below `folder` lead to this file from outside of it? What stands in such a file is not quoted: whoever made
/// the data set could else have others show what only they can read.
inline bool leads_out_of(const std::filesystem::path& folder, const std::filesystem::path& file) {
  std::error_code failure;
  const auto root = std::filesystem::canonical(folder, failure);
  if (failure) return true;
  const auto target = std::filesystem::canonical(file, failure);
  return failure || *target.lexically_relative(root).begin() == "..";
}

/// Walks over a text. Every failure is an Error "<where>, line <n>: <what>".
class TextScanner {
 public:
  /// `where` names the file; `count_lines` is off where a line number would mean nothing.
  TextScanner(std::string where, std::string text, bool count_lines = true)
      : where_(std::move(where)), text_(std::move(text)), count_lines_(count_lines) {}

  [[noreturn]] void fail(const std::string& what) const {
    if (!count_lines_) throw Error(fmt::format("{}: {}", where_, what));
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(std::min(start_, text_.size()));
    throw Error(fmt::format("{}, line {}: {}", where_, 1 + std::count(text_.begin(), end, '\n'), what));
  }

  /// From here on, messages say nothing of what stands in the text.
  void hide_text() { hidden_ = true; }
  /// What was found, for a message: quoted, unless it is to be hidden.
  std::string found(std::string_view text) const { return hidden_ ? "something else" : quote(text); }

  /// Bytes that have not been read yet: an upper bound for every count of things that follow.
  std::int64_t remaining() const { return static_cast<std::int64_t>(text_.size() - at_); }
  std::size_t position() const { return at_; }

  /// The next character that is no white space, unread; NUL at the end.
  char peek() {
    skip_space();
    return at_ < text_.size() ? text_[at_] : '\0';
  }

  /// The rest of the line, without its end and without white space around it.
  std::string line(std::string_view what) {
    start_ = at_;
    if (at_ >= text_.size()) fail_expected(what);
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string found = text_.substr(at_, end - at_);
    at_ = std::min(end + 1, text_.size());
    const auto first = found.find_first_not_of(kSpace);
    if (first == std::string::npos) return {};
    return found.substr(first, found.find_last_not_of(kSpace) - first + 1);
  }

  /// Characters up to the next white space.
  std::string token(std::string_view what) {
    skip_space();
    start_ = at_;
    const std::size_t end = std::min(text_.find_first_of(kSpace, at_), text_.size());
    if (end == at_) fail_expected(what);
    std::string found = text_.substr(at_, end - at_);
    at_ = end;
    return found;
  }

  void expect(std::string_view literal, std::string_view what) {
    skip_space();
    start_ = at_;
    if (std::string_view(text_).substr(at_, literal.size()) != literal) fail_expected(fmt::format("'{}' of {}", literal, what));
    at_ += literal.size();
  }

  /// A decimal integer from `lowest` to `highest`.
  std::int64_t integer(std::string_view what, std::int64_t lowest, std::int64_t highest) {
    skip_space();
    start_ = at_;
    std::int64_t value = 0;
    const char* begin = text_.data() + at_;
    const auto [end, failure] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (failure != std::errc() || value < lowest || value > highest)
      fail_expected(fmt::format("{}, a whole number from {} to {}", what, lowest, highest));
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }

  double real(std::string_view what) {
    skip_space();
    start_ = at_;
    double value = 0;
    const char* begin = text_.data() + at_;
    const auto [end, failure] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (failure == std::errc::invalid_argument) fail_expected(fmt::format("{}, a number", what));
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }

 private:
  static constexpr const char* kSpace = " \t\r\n\v\f";

  void skip_space() { at_ = std::min(text_.find_first_not_of(kSpace, at_), text_.size()); }

  [[noreturn]] void fail_expected(std::string_view what) const {
    if (start_ >= text_.size()) fail(fmt::format("the text ends here; expected {}", what));
    const std::size_t end = std::min(text_.find_first_of(kSpace, start_), text_.size());
    fail(fmt::format("expected {}; found {}", what, found(std::string_view(text_).substr(start_, end - start_))));
  }

  std::string where_;
  std::string text_;
  bool count_lines_;
  bool hidden_ = false;
  std::size_t at_ = 0;
  std::size_t start_ = 0;  ///< of what is being read, for the line number of an error
};

/// A scanner over a text file of the data set in `folder`.
inline TextScanner open_text(const std::filesystem::path& path, const std::filesystem::path& folder) {
  TextScanner in(path.string(), load_text(path));
  if (leads_out_of(folder, path)) in.hide_text();
  return in;
}

}  // namespace amrtex
