#include "renderers/scene/picture.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>

#include "structures/mesh/checked.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/value_units.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

static_assert(std::endian::native == std::endian::little, "npy files are written as the memory holds them");

constexpr std::size_t kMagicBytes = 10;  // magic, version 1.0, length of the header

std::vector<float> as_floats(const Picture& picture) {
  std::vector<float> floats(picture.values.size());
  for (std::size_t i = 0; i < floats.size(); ++i) floats[i] = static_cast<float>(picture.values[i]);
  return floats;
}

/// Do 32-bit floats hold the picture: each value, or of raw ones as much as a structure's floats would (value_units.hpp)?
bool fits_floats(const Picture& picture) {
  double min = std::numeric_limits<double>::infinity(), max = -min, least = 0;
  bool exact = true;
  for (const double v : picture.values) {
    if (!std::isfinite(v)) continue;
    exact = exact && static_cast<double>(static_cast<float>(v)) == v;
    min = std::min(min, v);
    max = std::max(max, v);
    if (v != 0) least = least > 0 ? std::min(least, std::abs(v)) : std::abs(v);
  }
  return exact || picture.channels > 1 || floats_hold(min, max, least);
}

std::string npy_header(const Picture& picture, bool as_double) {
  std::string text = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}, {}, {}), }}", as_double ? "<f8" : "<f4",
                                 picture.height, picture.width, picture.channels);
  while ((kMagicBytes + text.size() + 1) % 64 != 0) text += ' ';
  text += '\n';
  std::string header("\x93NUMPY\x01\x00", 8);
  header += static_cast<char>(text.size() & 0xFF);
  header += static_cast<char>(text.size() >> 8);
  return header + text;
}

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw Error(fmt::format("{}: {}", path.string(), why));
}

/// Text between a key of the header's dictionary and the end of its value.
std::string header_value(const std::string& header, const std::string& key, const std::filesystem::path& path) {
  const auto at = header.find("'" + key + "':");
  if (at == std::string::npos) refuse(path, fmt::format("the npy header has no '{}'", key));
  const auto from = header.find_first_not_of(' ', at + key.size() + 3);
  if (from == std::string::npos) refuse(path, fmt::format("the npy header's '{}' is empty", key));
  const auto to = header.find_first_of(header[from] == '(' ? ")" : ",}", from);
  return header.substr(from, to == std::string::npos ? to : to - from);
}

Picture shape_of(const std::string& header, const std::filesystem::path& path) {
  int h = 0, w = 0, c = 0;
  const std::string shape = header_value(header, "shape", path);
  if (std::sscanf(shape.c_str(), "(%9d, %9d, %9d", &h, &w, &c) != 3 || h < 1 || w < 1 || c < 1 || c > 16)
    refuse(path, fmt::format("the npy shape is {}; accepted is (height, width, channels)", quote(shape + ")")));
  Picture picture;
  picture.width = w;
  picture.height = h;
  picture.channels = c;
  return picture;
}

template <class T>
void read_values(std::ifstream& in, Picture& picture, std::size_t count, const std::filesystem::path& path) {
  std::vector<T> values(count);
  if (!in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T))))
    refuse(path, "cannot be read");
  picture.values.assign(values.begin(), values.end());
}

}  // namespace

std::string picture_hash(const Picture& picture) {
  const auto hash_of = [](const auto& values) { return XXH3_128bits(values.data(), values.size() * sizeof(values[0])); };
  const XXH128_hash_t h = fits_floats(picture) ? hash_of(as_floats(picture)) : hash_of(picture.values);
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

void write_npy(const Picture& picture, const std::filesystem::path& path, bool as_double) {
  as_double = as_double || !fits_floats(picture);
  std::string bytes = npy_header(picture, as_double);
  const auto add = [&](const auto& values) {
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  if (as_double)
    add(picture.values);
  else
    add(as_floats(picture));
  write_atomically(path, bytes);
}

Picture read_npy(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) refuse(path, fmt::format("cannot be opened: {}", std::strerror(errno)));
  std::array<char, kMagicBytes> magic{};
  if (!in.read(magic.data(), magic.size()) || std::memcmp(magic.data(), "\x93NUMPY\x01", 7) != 0)
    refuse(path, "is no npy file of version 1");
  const std::size_t length = static_cast<unsigned char>(magic[8]) + std::size_t{256} * static_cast<unsigned char>(magic[9]);
  std::string header(length, ' ');
  if (!in.read(header.data(), static_cast<std::streamsize>(length))) refuse(path, "ends inside its npy header");
  const std::string type = header_value(header, "descr", path);
  if (type != "'<f4'" && type != "'<f8'")
    refuse(path, fmt::format("the npy type is {}; accepted are '<f4' and '<f8'", clipped(type)));
  if (header_value(header, "fortran_order", path) != "False") refuse(path, "is in Fortran order; accepted is C order");
  Picture picture = shape_of(header, path);
  const std::int64_t bytes = type == "'<f4'" ? 4 : 8;
  const CheckedSize numbers = CheckedSize(picture.width) * picture.height * picture.channels;
  const CheckedSize expected = numbers * bytes + CheckedSize::of(kMagicBytes + length);
  std::error_code failure;
  const std::uintmax_t actual = std::filesystem::file_size(path, failure);
  if (failure) refuse(path, reason_of(failure));
  if (!expected.fits() || actual != static_cast<std::uintmax_t>(expected.or_most()))
    refuse(path, fmt::format("has {} bytes; its npy header asks for {}", actual,
                             expected.fits() ? std::to_string(expected.or_most()) : "more than 2^63"));
  const auto count = static_cast<std::size_t>(numbers.or_most());
  if (bytes == 4)
    read_values<float>(in, picture, count, path);
  else
    read_values<double>(in, picture, count, path);
  return picture;
}

}  // namespace amrtex
