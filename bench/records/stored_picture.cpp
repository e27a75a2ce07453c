#include "bench/records/stored_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>
#include <limits>
#include <map>
#include <vector>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

struct Range {
  double min = 0, max = 0;
};

Range range_of(const Picture& picture) {
  Range range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const double v : picture.values) {
    if (!std::isfinite(v)) continue;
    range = {std::min(range.min, v), std::max(range.max, v)};
  }
  return range.min <= range.max ? range : Range{};
}

HalfPicture scaled(const Picture& picture, double scale, double offset) {
  HalfPicture result;
  result.scale = scale > 0 ? scale : 1;
  result.offset = offset;
  std::vector<std::uint16_t> halves;
  halves.reserve(picture.values.size());
  // divided first: the range of two values near the ends of double's has no double
  for (const double v : picture.values)
    halves.push_back(glm::packHalf1x16(static_cast<float>(v / result.scale - result.offset / result.scale)));
  result.halves = NpyArray::of<std::uint16_t>("<f2", {picture.height, picture.width, picture.channels}, halves);
  return result;
}

void add(std::map<std::string, NpyArray>& arrays, const std::string& name, const HalfPicture& half) {
  arrays[name] = half.halves;
  arrays[name + "_scale"] = NpyArray::of<double>("<f8", {2}, std::array{half.scale, half.offset});
}

HalfPicture taken(const std::map<std::string, NpyArray>& arrays, const std::string& name, const std::filesystem::path& path) {
  const auto halves = arrays.find(name), scale = arrays.find(name + "_scale");
  if (halves == arrays.end() || scale == arrays.end() || halves->second.type != "<f2" || halves->second.shape.size() != 3 ||
      scale->second.type != "<f8" || scale->second.bytes.size() != 2 * sizeof(double))
    throw Error(fmt::format("{}: has no {} of half floats with {}_scale: accepted is what `amrtex run` keeps of a point",
                            path.string(), name, name));
  std::array<double, 2> numbers{};
  std::memcpy(numbers.data(), scale->second.bytes.data(), sizeof numbers);
  return {halves->second, numbers[0], numbers[1]};
}

}  // namespace

HalfPicture to_halves(const Picture& picture) {
  const Range range = range_of(picture);
  return scaled(picture, range.max / 2 - range.min / 2, range.max / 2 + range.min / 2);
}

HalfPicture to_signed_halves(const Picture& difference) {
  const Range range = range_of(difference);
  return scaled(difference, std::max(std::abs(range.min), std::abs(range.max)), 0);
}

Picture from_halves(const HalfPicture& half) {
  const auto& shape = half.halves.shape;
  Picture picture(static_cast<int>(shape[1]), static_cast<int>(shape[0]), static_cast<int>(shape[2]));
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, half.halves.bytes.data() + i * sizeof bits, sizeof bits);
    picture.values[i] = half.offset + half.scale * static_cast<double>(glm::unpackHalf1x16(bits));
  }
  return picture;
}

std::filesystem::path picture_folder(const std::filesystem::path& records) { return records / "pictures"; }

std::filesystem::path picture_path(const std::filesystem::path& records, const std::string& configuration,
                                   const std::string& extension) {
  return picture_folder(records) / (configuration + extension);
}

Picture difference_of(const Picture& picture, const Picture& reference) {
  assert(picture.values.size() == reference.values.size());
  Picture difference = picture;
  for (std::size_t i = 0; i < difference.values.size(); ++i) difference.values[i] -= reference.values[i];
  return difference;
}

void write_stored_picture(const std::filesystem::path& path, const StoredPicture& stored) {
  std::map<std::string, NpyArray> arrays;
  add(arrays, "picture", to_halves(stored.picture));
  if (stored.difference) add(arrays, "difference", to_signed_halves(*stored.difference));
  write_npz(path, arrays);
}

StoredPicture read_stored_picture(const std::filesystem::path& path) {
  const std::map<std::string, NpyArray> arrays = read_npz(path);
  StoredPicture stored{from_halves(taken(arrays, "picture", path)), std::nullopt};
  if (arrays.contains("difference")) stored.difference = from_halves(taken(arrays, "difference", path));
  return stored;
}

}  // namespace amrtex
