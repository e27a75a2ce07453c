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

/// A whole file, version 1.0.
std::string npy_text(const NpyArray& array);

/// Throws Error with `name` for what is no such file, has another type than one of `types`, or is cut.
NpyArray parse_npy(std::string_view text, const std::string& name, const std::vector<std::string>& types);

}  // namespace amrtex
