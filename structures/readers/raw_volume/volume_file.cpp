#include "structures/readers/raw_volume/volume_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <limits>

#include "structures/mesh/npy.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostCompression = 1100;  // deflate packs at most 1032 bytes into one
constexpr std::size_t kBlockBytes = std::size_t{1} << 20;

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

/// Bytes one after the other, as they stand in the file or unpacked.
class ValueStream {
 public:
  ValueStream(const VolumeFile& file, std::uint64_t offset)
      : file_(file), descriptor_(::open(file.data.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) refuse(file.data, reason_of({errno, std::generic_category()}));
    ::lseek(descriptor_, static_cast<off_t>(offset), SEEK_SET);
    if (file.gzip) packed_ = ::gzdopen(descriptor_, "rb");
    if (file.gzip && packed_ == nullptr) {
      ::close(descriptor_);
      refuse(file.data, "not enough memory to unpack it");
    }
  }
  ~ValueStream() {
    if (packed_ != nullptr)
      ::gzclose(packed_);
    else
      ::close(descriptor_);
  }
  ValueStream(const ValueStream&) = delete;
  ValueStream& operator=(const ValueStream&) = delete;

  /// As many bytes as there are, up to `bytes`; 0 at the end.
  std::size_t read(char* out, std::size_t bytes) { return packed_ != nullptr ? unpack(out, bytes) : read_plain(out, bytes); }

  void read_exactly(char* out, std::size_t bytes) {
    for (std::size_t done = 0; done < bytes;) {
      const std::size_t got = read(out + done, bytes - done);
      if (got == 0) refuse(file_.data, "ends before its last value");
      done += got;
    }
  }

 private:
  std::size_t read_plain(char* out, std::size_t bytes) {
    ssize_t got = -1;
    do got = ::read(descriptor_, out, bytes);
    while (got < 0 && errno == EINTR);
    if (got < 0) refuse(file_.data, reason_of({errno, std::generic_category()}));
    return static_cast<std::size_t>(got);
  }
  std::size_t unpack(char* out, std::size_t bytes) {
    const int got = ::gzread(packed_, out, static_cast<unsigned>(bytes));
    if (::gzdirect(packed_) != 0) refuse(file_.data, "its header says gzip, but its values are not packed");
    int code = Z_OK;
    const char* const message = ::gzerror(packed_, &code);
    if (code == Z_BUF_ERROR) refuse(file_.data, "ends within what is packed");
    if (got < 0 || (code != Z_OK && code != Z_STREAM_END))
      refuse(file_.data, fmt::format("what is packed in it is damaged: {}", message));
    return static_cast<std::size_t>(got);
  }

  const VolumeFile& file_;
  int descriptor_;
  gzFile packed_ = nullptr;
};

template <class T>
void decode(const char* bytes, std::size_t count, bool swapped, double* out) {
  for (std::size_t i = 0; i < count; ++i) {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes + i * sizeof(T), sizeof(T));
    if (swapped) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    out[i] = static_cast<double>(value);
  }
}

void decode(ValueType type, const char* bytes, std::size_t count, bool swapped, double* out) {
  switch (type) {
    case ValueType::u1:
      return decode<std::uint8_t>(bytes, count, swapped, out);
    case ValueType::i1:
      return decode<std::int8_t>(bytes, count, swapped, out);
    case ValueType::u2:
      return decode<std::uint16_t>(bytes, count, swapped, out);
    case ValueType::i2:
      return decode<std::int16_t>(bytes, count, swapped, out);
    case ValueType::u4:
      return decode<std::uint32_t>(bytes, count, swapped, out);
    case ValueType::i4:
      return decode<std::int32_t>(bytes, count, swapped, out);
    case ValueType::f4:
      return decode<float>(bytes, count, swapped, out);
    case ValueType::f8:
      return decode<double>(bytes, count, swapped, out);
  }
}

/// Throws where the file cannot hold the values; returns where they begin.
std::uint64_t locate_values(const VolumeFile& file, CheckedSize needed) {
  const std::uint64_t size = regular_file_size(file.data);
  const std::string shape =
      fmt::format("{} x {} x {} values of {} bytes", file.cells.x, file.cells.y, file.cells.z, bytes_of(file.type));
  if (!needed.fits()) refuse(file.data, fmt::format("{} take more than 2^63 bytes", shape));
  const auto bytes = static_cast<std::uint64_t>(needed.or_most());
  const std::uint64_t there = size - std::min(size, file.offset);
  if (file.gzip) {
    if (bytes / kMostCompression > there)
      refuse(file.data, fmt::format("{} packed bytes cannot hold {}, {} bytes", there, shape, bytes));
    return file.offset;
  }
  if (there < bytes || (there > bytes && file.exact && !file.ends_with_values))
    refuse(file.data, fmt::format("{} bytes; {} are {}", there, shape, bytes));
  return file.ends_with_values ? size - bytes : file.offset;
}

void skip(ValueStream& stream, std::uint64_t bytes) {
  std::vector<char> block(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, kBlockBytes)));
  for (std::uint64_t left = bytes; left > 0;) {
    const auto part = static_cast<std::size_t>(std::min<std::uint64_t>(left, block.size()));
    stream.read_exactly(block.data(), part);
    left -= part;
  }
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

std::vector<double> load_values(const VolumeFile& file) {
  const CheckedSize count = CheckedSize(file.cells.x) * CheckedSize(file.cells.y) * CheckedSize(file.cells.z);
  const auto width = static_cast<std::size_t>(bytes_of(file.type));
  const std::uint64_t begin = locate_values(file, count * CheckedSize(static_cast<std::int64_t>(width)));
  require_memory(file.data, count, 1);
  std::vector<double> values(static_cast<std::size_t>(count.or_most()));
  ValueStream stream(file, begin);
  skip(stream, file.inner_offset);
  std::vector<char> block(kBlockBytes);
  for (std::size_t done = 0; done < values.size();) {
    const std::size_t part = std::min(values.size() - done, kBlockBytes / width);
    stream.read_exactly(block.data(), part * width);
    decode(file.type, block.data(), part, file.swapped, &values[done]);
    done += part;
  }
  char more = 0;
  if (file.gzip && stream.read(&more, 1) != 0) refuse(file.data, "holds more values than its header says");
  return values;
}

}  // namespace amrtex
