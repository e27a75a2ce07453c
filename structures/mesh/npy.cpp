#include "structures/mesh/npy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <charconv>

#include "structures/mesh/checked.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

static_assert(std::endian::native == std::endian::little, "npy files are written as the memory holds them");

constexpr std::size_t kMagicBytes = 10;  // magic, version 1.0, length of the header
constexpr std::string_view kMagic("\x93NUMPY\x01", 7);

[[noreturn]] void refuse(const std::string& name, const std::string& why) { throw Error(fmt::format("{}: {}", name, why)); }

/// Text between a key of the header's dictionary and the end of its value.
std::string header_value(const std::string& header, const std::string& key, const std::string& name) {
  const auto at = header.find("'" + key + "':");
  if (at == std::string::npos) refuse(name, fmt::format("the npy header has no '{}'", key));
  const auto from = header.find_first_not_of(' ', at + key.size() + 3);
  if (from == std::string::npos) refuse(name, fmt::format("the npy header's '{}' is empty", key));
  const auto to = header.find_first_of(header[from] == '(' ? ")" : ",}", from);
  return header.substr(from, to == std::string::npos ? to : to - from);
}

std::vector<std::int64_t> shape_of(const std::string& header, const std::string& name) {
  const std::string text = header_value(header, "shape", name);
  if (!text.starts_with('(')) refuse(name, fmt::format("the npy shape is {}", quote(text)));
  std::vector<std::int64_t> shape;
  const char* at = text.data() + 1;
  const char* const end = text.data() + text.size();
  while (at != end) {
    std::int64_t number = 0;
    const auto [next, failure] = std::from_chars(at, end, number);
    if (failure != std::errc() || number < 0) refuse(name, fmt::format("the npy shape is {}", quote(text + ")")));
    shape.push_back(number);
    at = std::find_if(next, end, [](char c) { return c != ',' && c != ' '; });
  }
  return shape;
}

}  // namespace

std::string npy_text(const NpyArray& array) {
  std::string text = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}", array.type, fmt::join(array.shape, ", "),
                                 array.shape.size() == 1 ? "," : "");
  while ((kMagicBytes + text.size() + 1) % 64 != 0) text += ' ';
  text += '\n';
  std::string whole(kMagic);
  whole += '\0';
  whole += static_cast<char>(text.size() & 0xFF);
  whole += static_cast<char>(text.size() >> 8);
  return whole + text + array.bytes;
}

NpyHeader parse_npy_header(std::string_view text, const std::string& name, const std::vector<std::string>& types) {
  if (text.size() < kMagicBytes || !text.starts_with(kMagic)) refuse(name, "is no npy file of version 1");
  const std::size_t length = static_cast<unsigned char>(text[8]) + std::size_t{256} * static_cast<unsigned char>(text[9]);
  if (text.size() - kMagicBytes < length) refuse(name, "ends inside its npy header");
  const std::string header(text.substr(kMagicBytes, length));
  const std::string type = header_value(header, "descr", name);
  NpyHeader found;
  found.bytes = kMagicBytes + length;
  for (const std::string& accepted : types)
    if (type == fmt::format("'{}'", accepted)) found.type = accepted;
  if (found.type.empty())
    refuse(name, fmt::format("the npy type is {}; accepted are '{}'", clipped(type), fmt::join(types, "' and '")));
  if (header_value(header, "fortran_order", name) != "False") refuse(name, "is in Fortran order; accepted is C order");
  found.shape = shape_of(header, name);
  CheckedSize expected = CheckedSize(found.type.back() - '0');
  for (const std::int64_t n : found.shape) expected = expected * n;
  found.value_bytes = expected.or_most();
  return found;
}

void require_npy_bytes(const NpyHeader& header, std::uint64_t bytes, const std::string& name) {
  const bool fits = header.value_bytes < CheckedSize::kMost;
  if (fits && bytes == static_cast<std::uint64_t>(header.value_bytes)) return;
  refuse(name, fmt::format("has {} bytes of values; the shape ({}) of its npy header asks for {}", bytes,
                           clipped(fmt::format("{}", fmt::join(header.shape, ", "))),
                           fits ? std::to_string(header.value_bytes) : "more than 2^63"));
}

NpyArray parse_npy(std::string_view text, const std::string& name, const std::vector<std::string>& types) {
  const NpyHeader header = parse_npy_header(text, name, types);
  require_npy_bytes(header, text.size() - header.bytes, name);
  return {header.type, header.shape, std::string(text.substr(header.bytes))};
}

}  // namespace amrtex
