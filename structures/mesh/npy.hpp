// Arrays in NumPy's format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace amrtex {

/// An array as memory holds it: little-endian, the last index fastest.
struct NpyArray {
  std::string type;  ///< NumPy's: "<f2", "<f4", "<f8", "|u1"
  std::vector<std::int64_t> shape;
  std::string bytes;

  template <class T>
  static NpyArray of(std::string type, std::vector<std::int64_t> shape, std::span<const T> values) {
    return {std::move(type), std::move(shape), std::string(reinterpret_cast<const char*>(values.data()), values.size_bytes())};
  }
};

/// What stands in front of the values.
struct NpyHeader {
  std::string type;  ///< NumPy's
  std::vector<std::int64_t> shape;
  std::size_t bytes = 0;        ///< of the header: where the values begin
  std::int64_t value_bytes = 0;  ///< of all values; INT64_MAX where they take more than 63 bits
};

/// The longest header.
inline constexpr std::size_t kMostNpyHeaderBytes = 10 + 65535;

/// A whole file, version 1.0.
std::string npy_text(const NpyArray& array);

/// Reads the header at the begin of `text`. Throws Error with `name` as parse_npy() does.
NpyHeader parse_npy_header(std::string_view text, const std::string& name, const std::vector<std::string>& types);

/// Throws Error with `name` where there are not as many bytes of values as the header asks for.
void require_npy_bytes(const NpyHeader& header, std::uint64_t bytes, const std::string& name);

/// Throws Error with `name` for what is no such file, has another type than one of `types`, or is cut.
NpyArray parse_npy(std::string_view text, const std::string& name, const std::vector<std::string>& types);

}  // namespace amrtex
