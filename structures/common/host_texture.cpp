#include "structures/common/host_texture.hpp"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/gtc/packing.hpp>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

struct FormatInfo {
  TexelFormat format;
  const char* name;
  int bytes;
};

constexpr std::array<FormatInfo, 10> kFormats{{{TexelFormat::r8, "r8", 1},
                                               {TexelFormat::r16, "r16", 2},
                                               {TexelFormat::r16f, "r16f", 2},
                                               {TexelFormat::r32f, "r32f", 4},
                                               {TexelFormat::r64f, "r64f", 8},
                                               {TexelFormat::r32ui, "r32ui", 4},
                                               {TexelFormat::rg32ui, "rg32ui", 8},
                                               {TexelFormat::rgba32ui, "rgba32ui", 16},
                                               {TexelFormat::rg32f, "rg32f", 8},
                                               {TexelFormat::rgba32f, "rgba32f", 16}}};

const FormatInfo& info(TexelFormat format) {
  for (const FormatInfo& f : kFormats)
    if (f.format == format) return f;
  assert(false);
  return kFormats[0];
}

template <class T>
void put(std::byte* data, std::size_t index, T value) {
  std::memcpy(data + index * sizeof(T), &value, sizeof(T));
}
template <class T>
T get(const std::byte* data, std::size_t index) {
  T value;
  std::memcpy(&value, data + index * sizeof(T), sizeof(T));
  return value;
}

}  // namespace

int texel_bytes(TexelFormat format) { return info(format).bytes; }
std::string_view format_name(TexelFormat format) { return info(format).name; }

Storage parse_storage(std::string_view name) {
  for (Storage s : {Storage::r8, Storage::r16, Storage::r16f, Storage::r32f})
    if (format_name(s) == name) return s;
  throw UsageError(fmt::format("no storage {}; accepted: r8, r16, r16f, r32f", quote(name)));
}

MemoryByRole& MemoryByRole::operator+=(const MemoryByRole& other) {
  payload += other.payload;
  duplicated += other.duplicated;
  topology += other.topology;
  padding += other.padding;
  return *this;
}

void give_back(HostTexture& texture, std::size_t first, std::size_t last) {
  if (last == texture.data.size()) {
    std::vector<std::byte>().swap(texture.data);  // `= {}` would keep its memory
    return;
  }
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto data = reinterpret_cast<std::uintptr_t>(texture.data.data());
  const std::uintptr_t begin = (data + first + page - 1) / page * page;
  const std::uintptr_t end = (data + last) / page * page;
  if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);  // no harm where the system does not
}

std::string element_name(std::string_view name, int i) { return i == 0 ? std::string(name) : fmt::format("{}[{}]", name, i); }

StorageScale storage_scale(Storage storage, const FieldStatistics& s) {
  const ValueUnits units = value_units(s);
  if (storage == Storage::r32f || storage == Storage::r64f) return {units.offset, units.scale, units};
  if (!(s.max > s.min)) return {std::isfinite(s.min) ? s.min : 0, units.scale, units};
  return {s.min, s.max - s.min, units};
}

void store_value(Storage storage, StorageScale scale, double value, std::byte* data, std::size_t index) {
  const double code = (value - scale.offset) / scale.scale;
  switch (storage) {
    case Storage::r8:
      put(data, index, static_cast<std::uint8_t>(std::lround(std::clamp(code, 0.0, 1.0) * 255)));
      break;
    case Storage::r16:
      put(data, index, static_cast<std::uint16_t>(std::lround(std::clamp(code, 0.0, 1.0) * 65535)));
      break;
    case Storage::r16f:
      put(data, index, glm::packHalf1x16(static_cast<float>(code)));
      break;
    case Storage::r32f:
      put(data, index, static_cast<float>(code));
      break;
    case Storage::r64f:
      put(data, index, code);
      break;
    default:
      assert(false);
  }
}

double load_value(Storage storage, StorageScale scale, const std::byte* data, std::size_t index) {
  switch (storage) {
    case Storage::r8:
      return scale.value(get<std::uint8_t>(data, index) / 255.0);
    case Storage::r16:
      return scale.value(get<std::uint16_t>(data, index) / 65535.0);
    case Storage::r16f:
      return scale.value(static_cast<double>(glm::unpackHalf1x16(get<std::uint16_t>(data, index))));
    case Storage::r32f:
      return scale.value(static_cast<double>(get<float>(data, index)));
    case Storage::r64f:
      return scale.value(get<double>(data, index));
    default:
      assert(false);
      return 0;
  }
}

}  // namespace amrtex
