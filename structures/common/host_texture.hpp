// What an encoding builds, what the uploader sends to GL, and what the CPU samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "structures/mesh/checked.hpp"
#include "structures/mesh/spaces.hpp"
#include "structures/mesh/value_units.hpp"

namespace amrtex {

enum class TexelFormat { r8, r16, r16f, r32f, r64f, r32ui, rg32ui, rgba32ui, rg32f, rgba32f };

int texel_bytes(TexelFormat format);
std::string_view format_name(TexelFormat format);

/// Formats in which values may be stored: the `storage` of a record. All hold (v - a) / b with a, b in the
/// record, of r32f the field's own units (value_units.hpp); r64f holds the same in double, exists on the CPU only and
/// separates the error of the encoding from that of its storage.
using Storage = TexelFormat;
/// Throws a UsageError that names r8, r16, r16f, r32f.
Storage parse_storage(std::string_view name);

/// Bytes by role. payload: one texel a cell of the structure; duplicated: borders;
/// topology: tables, trees, validity, ranges; padding: texels that hold nothing.
struct MemoryByRole {
  std::int64_t payload = 0;
  std::int64_t duplicated = 0;
  std::int64_t topology = 0;
  std::int64_t padding = 0;
  std::int64_t total() const { return payload + duplicated + topology + padding; }
  MemoryByRole& operator+=(const MemoryByRole& other);
  bool operator==(const MemoryByRole&) const = default;
};

/// A 3D texture, or a buffer that the shader reads as an array (std430).
struct HostTexture {
  enum class Kind { texture_3d, buffer };
  std::string name;  ///< of the sampler or buffer in the encoding's GLSL
  Kind kind = Kind::texture_3d;
  TexelFormat format = TexelFormat::r32f;
  Vec3i size{0};                 ///< texels; a buffer has its elements in x (y = z = 1)
  bool hardware_linear = false;  ///< filtered by the sampler rather than fetched texel by texel
  bool holds_values = false;     ///< counts towards texels_per_cell
  /// Buffer of rg32ui that receives this texture's 64-bit handle, lower half first, as element `handle_index`; the texture
  /// is one of a set that shares its name (texture_handles.hpp). Empty: bound to the sampler of its name.
  std::string handles;
  std::int64_t handle_index = 0;
  MemoryByRole roles;           ///< sums to bytes()
  std::vector<std::byte> data;  ///< x fastest

  std::int64_t texels() const { return (CheckedSize(size.x) * size.y * size.z).or_most(); }
  std::int64_t bytes() const { return (CheckedSize(texels()) * texel_bytes(format)).or_most(); }
  template <class T>
  T* as() {
    return reinterpret_cast<T*>(data.data());
  }
  template <class T>
  const T* as() const {
    return reinterpret_cast<const T*>(data.data());
  }
};

/// Gives the memory of bytes [first, last) of the data back to the system, as far as it fills whole pages, and all of it with the last
/// byte. What stood there is lost.
void give_back(HostTexture& texture, std::size_t first, std::size_t last);

/// Name of element i of an array of textures: `name`, `name[1]`, ...
std::string element_name(std::string_view name, int i);

/// How values are stored: code = (value - offset) / scale.
struct StorageScale {
  double offset = 0;  ///< a
  double scale = 1;   ///< b
  ValueUnits units;   ///< of the numbers that shaders make of codes

  double value(double code) const { return offset == 0 ? scale * code : offset + scale * code; }
  /// a, b of number = a + b code.
  StorageScale in_units() const { return {units.number(offset), scale / units.scale, {}}; }
};

/// Codes are numbers in the field's units for r32f and r64f; others map [min, max] to [0, 1].
StorageScale storage_scale(Storage storage, const FieldStatistics& statistics);
/// Writes one value, rounded to nearest, as texel `index` of `data`.
void store_value(Storage storage, StorageScale scale, double value, std::byte* data, std::size_t index);
/// The value that texel `index` stands for.
double load_value(Storage storage, StorageScale scale, const std::byte* data, std::size_t index);

}  // namespace amrtex
