#include "structures/readers/raw_volume/volume_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>

#include "structures/mesh/npy.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct TypeName {
  std::string_view name;
  ValueType type;
};

/// As the names of raw files have them.
constexpr std::array kRawTypes = {
    TypeName{"uint8", ValueType::u1},   TypeName{"int8", ValueType::i1},    TypeName{"uint16", ValueType::u2},
    TypeName{"int16", ValueType::i2},   TypeName{"uint32", ValueType::u4},  TypeName{"int32", ValueType::i4},
    TypeName{"float32", ValueType::f4}, TypeName{"float64", ValueType::f8}, TypeName{"float", ValueType::f4},
    TypeName{"double", ValueType::f8},
};

[[noreturn]] void refuse(const fs::path& path, const std::string& what) {
  throw Error(fmt::format("{}: {}", path.string(), what));
}

/// The numbers of "WxHxD", or nothing.
std::vector<std::int64_t> numbers_between_x(std::string_view text) {
  std::vector<std::int64_t> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at != end) {
    std::int64_t number = 0;
    const auto [next, failure] = std::from_chars(at, end, number);
    if (failure == std::errc::invalid_argument || (next != end && *next != 'x') || next + 1 == end) return {};
    numbers.push_back(failure == std::errc() ? number : std::numeric_limits<std::int64_t>::max());
    at = next == end ? end : next + 1;
  }
  return numbers;
}

}  // namespace

int bytes_of(ValueType type) {
  switch (type) {
    case ValueType::u1:
    case ValueType::i1:
      return 1;
    case ValueType::u2:
    case ValueType::i2:
      return 2;
    case ValueType::u4:
    case ValueType::i4:
    case ValueType::f4:
      return 4;
    case ValueType::f8:
      return 8;
  }
  return 0;
}

RealType real_type_of(ValueType type) {
  return bytes_of(type) <= 2 || type == ValueType::f4 ? RealType::float32 : RealType::float64;
}

Vec3i volume_shape(const fs::path& path, const std::vector<std::int64_t>& sizes) {
  if (sizes.size() != 3) refuse(path, fmt::format("{} axes; a volume has 3", sizes.size()));
  for (const std::int64_t n : sizes)
    if (n < 1 || n > std::numeric_limits<std::int32_t>::max())
      refuse(path, fmt::format("a shape of {}; accepted along an axis: 1 to {}", fmt::join(sizes, " x "),
                               std::numeric_limits<std::int32_t>::max()));
  return {static_cast<int>(sizes[0]), static_cast<int>(sizes[1]), static_cast<int>(sizes[2])};
}

std::optional<VolumeFile> describe_raw(const fs::path& path) {
  if (path.extension() != ".raw") return std::nullopt;
  const std::string stem = path.stem().string();
  const std::size_t last = stem.rfind('_');
  if (last == std::string::npos || last == 0) return std::nullopt;
  const std::size_t before = stem.rfind('_', last - 1);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  const std::vector<std::int64_t> sizes = numbers_between_x(std::string_view(stem).substr(begin, last - begin));
  if (sizes.size() < 2) return std::nullopt;
  VolumeFile file;
  file.data = path;
  file.cells = volume_shape(path, sizes);
  file.field = before == std::string::npos || before == 0 ? "value" : stem.substr(0, before);
  const std::string type = stem.substr(last + 1);
  const auto found = std::find_if(kRawTypes.begin(), kRawTypes.end(), [&](const TypeName& t) { return t.name == type; });
  if (found == kRawTypes.end()) {
    std::string names;
    for (const TypeName& known : kRawTypes) names += fmt::format("{}{}", names.empty() ? "" : ", ", known.name);
    refuse(path, fmt::format("the type in its name is {}; accepted: {}", quote(type), names));
  }
  file.type = found->type;
  return file;
}

VolumeFile describe_npy(const fs::path& path) {
  const std::uint64_t size = regular_file_size(path);
  std::string head(static_cast<std::size_t>(std::min<std::uint64_t>(size, kMostNpyHeaderBytes)), '\0');
  std::ifstream(path, std::ios::binary).read(head.data(), static_cast<std::streamsize>(head.size()));
  const std::vector<std::string> types = {"|u1", "|i1", "<u2", "<i2", "<u4", "<i4", "<f4", "<f8"};
  const NpyHeader header = parse_npy_header(head, path.string(), types);
  require_npy_bytes(header, size - header.bytes, path.string());
  VolumeFile file;
  file.data = path;
  file.offset = header.bytes;
  std::vector<std::int64_t> sizes = header.shape;
  std::reverse(sizes.begin(), sizes.end());  // the last axis is the fastest
  file.cells = volume_shape(path, sizes);
  constexpr std::array kTypes = {ValueType::u1, ValueType::i1, ValueType::u2, ValueType::i2,
                                 ValueType::u4, ValueType::i4, ValueType::f4, ValueType::f8};
  file.type = kTypes[static_cast<std::size_t>(std::find(types.begin(), types.end(), header.type) - types.begin())];
  file.field = path.stem().string();
  return file;
}

}  // namespace amrtex
