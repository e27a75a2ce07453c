#include "renderers/scene/picture.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "structures/mesh/npy.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/value_units.hpp"
#include "structures/mesh/whole_file.hpp"
#include "structures/readers/reader_tools.hpp"

namespace amrtex {
namespace {

constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 36;  // of a file: what is larger is no picture of ours

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

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why) {
  throw Error(fmt::format("{}: {}", path.string(), why));
}

template <class T>
void copy_values(const std::string& bytes, Picture& picture) {
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  picture.values.assign(values.begin(), values.end());
}

}  // namespace

std::string picture_hash(const Picture& picture) {
  const auto hash_of = [](const auto& values) { return XXH3_128bits(values.data(), values.size() * sizeof(values[0])); };
  const XXH128_hash_t h = fits_floats(picture) ? hash_of(as_floats(picture)) : hash_of(picture.values);
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

void write_npy(const Picture& picture, const std::filesystem::path& path, bool as_double) {
  const std::vector<std::int64_t> shape = {picture.height, picture.width, picture.channels};
  if (as_double || !fits_floats(picture))
    write_atomically(path, npy_text(NpyArray::of<double>("<f8", shape, picture.values)));
  else
    write_atomically(path, npy_text(NpyArray::of<float>("<f4", shape, as_floats(picture))));
}

Picture read_npy(const std::filesystem::path& path) {
  const NpyArray array = parse_npy(load_bytes(path, kMostBytes), path.string(), {"<f4", "<f8"});
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  const auto& s = array.shape;
  if (s.size() != 3 || *std::min_element(s.begin(), s.end()) < 1 || *std::max_element(s.begin(), s.end()) > kMost || s[2] > 16)
    refuse(path, fmt::format("the npy shape is ({}); accepted is (height, width, channels)", fmt::join(s, ", ")));
  Picture picture;
  picture.height = static_cast<int>(s[0]);
  picture.width = static_cast<int>(s[1]);
  picture.channels = static_cast<int>(s[2]);
  if (array.type == "<f4")
    copy_values<float>(array.bytes, picture);
  else
    copy_values<double>(array.bytes, picture);
  return picture;
}

}  // namespace amrtex
