// The values of a volume's file: read where they stand, or unpacked once and kept as the file has them.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "structures/mesh/cell_memory.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/data_file.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/raw_volume/volume_file.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostCompression = 1100;  // deflate packs at most 1032 bytes into one
constexpr std::size_t kReadBytes = std::size_t{1} << 16;
constexpr std::size_t kPieceBytes = std::size_t{8} << 20;  // a multiple of every type's

[[noreturn]] void refuse(const fs::path& path, const std::string& what) {
  throw Error(fmt::format("{}: {}", path.string(), what));
}

/// Unpacked bytes, one after the other.
class PackedStream {
 public:
  explicit PackedStream(const VolumeFile& file) : file_(file) {
    const int descriptor = ::open(file.data.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) refuse(file.data, reason_of({errno, std::generic_category()}));
    ::lseek(descriptor, static_cast<off_t>(file.offset), SEEK_SET);
    packed_ = ::gzdopen(descriptor, "rb");
    if (packed_ != nullptr) return;
    ::close(descriptor);
    refuse(file.data, "not enough memory to unpack it");
  }
  ~PackedStream() { ::gzclose(packed_); }
  PackedStream(const PackedStream&) = delete;
  PackedStream& operator=(const PackedStream&) = delete;

  void read_exactly(std::byte* out, std::size_t bytes) {
    for (std::size_t done = 0; done < bytes;) {
      const std::size_t got = read(out + done, bytes - done);
      if (got == 0) refuse(file_.data, "ends before its last value");
      done += got;
    }
  }
  void skip(std::uint64_t bytes) {
    std::array<std::byte, kReadBytes> passed;
    for (std::uint64_t left = bytes; left > 0;) {
      const auto part = static_cast<std::size_t>(std::min<std::uint64_t>(left, passed.size()));
      read_exactly(passed.data(), part);
      left -= part;
    }
  }
  bool ends() {
    std::byte more{};
    return read(&more, 1) == 0;
  }

 private:
  /// As many bytes as there are, up to `bytes`; 0 at the end.
  std::size_t read(std::byte* out, std::size_t bytes) {
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
  gzFile packed_;
};

template <class T, bool kSwapped>
void decode(const std::byte* bytes, std::span<double> out) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    T value;
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes + i * sizeof(T), sizeof(T));
    if constexpr (kSwapped) std::reverse(raw.begin(), raw.end());
    std::memcpy(&value, raw.data(), sizeof(T));
    out[i] = static_cast<double>(value);
  }
}

template <class T>
void decode(const VolumeFile& file, const std::byte* bytes, std::span<double> out) {
  if (file.swapped)
    decode<T, true>(bytes, out);
  else
    decode<T, false>(bytes, out);
}

/// Bytes as they stand in the file to values.
void decode(const VolumeFile& file, const std::byte* bytes, std::span<double> out) {
  switch (file.type) {
    case ValueType::u1:
      return decode<std::uint8_t>(file, bytes, out);
    case ValueType::i1:
      return decode<std::int8_t>(file, bytes, out);
    case ValueType::u2:
      return decode<std::uint16_t>(file, bytes, out);
    case ValueType::i2:
      return decode<std::int16_t>(file, bytes, out);
    case ValueType::u4:
      return decode<std::uint32_t>(file, bytes, out);
    case ValueType::i4:
      return decode<std::int32_t>(file, bytes, out);
    case ValueType::f4:
      return decode<float>(file, bytes, out);
    case ValueType::f8:
      return decode<double>(file, bytes, out);
  }
}

/// Values that stand in the file as they are: read when they are asked for.
class PlainValues final : public VolumeSource {
 public:
  PlainValues(VolumeFile file, std::uint64_t begin) : file_(std::move(file)), opened_(file_.data), begin_(begin) {}

  void read(std::size_t first, std::span<double> out) const override {
    const auto width = static_cast<std::size_t>(bytes_of(file_.type));
    std::array<std::byte, kReadBytes> block;
    while (!out.empty()) {
      const std::size_t part = std::min(out.size(), block.size() / width);
      opened_.read(begin_ + first * width, block.data(), part * width);
      decode(file_, block.data(), out.first(part));
      out = out.subspan(part);
      first += part;
    }
  }

 private:
  VolumeFile file_;
  DataFile opened_;
  std::uint64_t begin_;
};

/// Packed values can be had from the beginning only, and unpacking takes longest of all: it is done once. They are kept as the
/// file has them, in pieces that are given back one by one.
class UnpackedValues final : public VolumeSource {
 public:
  UnpackedValues(VolumeFile file, std::size_t count) : file_(std::move(file)) {
    const std::size_t bytes = count * width();
    PackedStream stream(file_);
    stream.skip(file_.inner_offset);
    for (std::size_t done = 0; done < bytes; done += kPieceBytes) {
      const std::size_t part = std::min(kPieceBytes, bytes - done);
      pieces_.emplace_back(part);
      stream.read_exactly(pieces_.back().bytes, part);
    }
    if (!stream.ends()) refuse(file_.data, "holds more values than its header says");
  }

  void read(std::size_t first, std::span<double> out) const override {
    const std::size_t in_piece = kPieceBytes / width();
    while (!out.empty()) {
      const std::size_t skipped = first % in_piece;
      const std::size_t part = std::min(out.size(), in_piece - skipped);
      decode(file_, pieces_[first / in_piece].bytes + skipped * width(), out.first(part));
      out = out.subspan(part);
      first += part;
    }
  }
  bool holds_values() const override { return true; }
  void give_back_before(std::size_t end) override {
    const std::size_t whole = std::min(end * width() / kPieceBytes, pieces_.size());
    for (; given_back_ < whole; ++given_back_) pieces_[given_back_].memory.reset();
  }

 private:
  struct Piece {
    explicit Piece(std::size_t size)
        : memory(std::make_unique<CellMemory>(size)), bytes(static_cast<std::byte*>(memory->take(size))) {}

    std::unique_ptr<CellMemory> memory;
    std::byte* bytes;
  };

  std::size_t width() const { return static_cast<std::size_t>(bytes_of(file_.type)); }

  VolumeFile file_;
  std::vector<Piece> pieces_;
  std::size_t given_back_ = 0;
};

/// Throws where the file cannot hold the values; returns where they begin, or what is packed.
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

}  // namespace

std::unique_ptr<VolumeSource> open_values(const VolumeFile& file) {
  const CheckedSize count = CheckedSize(file.cells.x) * CheckedSize(file.cells.y) * CheckedSize(file.cells.z);
  const std::uint64_t begin = locate_values(file, count * CheckedSize(bytes_of(file.type)));
  require_memory(file.data, count, 1, bytes_of(real_type_of(file.type)));
  if (file.gzip) return std::make_unique<UnpackedValues>(file, static_cast<std::size_t>(count.or_most()));
  return std::make_unique<PlainValues>(file, begin);
}

}  // namespace amrtex
