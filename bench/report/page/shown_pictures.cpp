#include "bench/report/page/shown_pictures.hpp"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "bench/report/scenes.hpp"
#include "renderers/scene/color_map.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr double kShareInScale = 0.995;
constexpr std::uint8_t kNoNumber = 255;
constexpr int kColors = 256;

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
};

// --- sizes ---

/// Blocks of `edge` x `edge` pixels become one; what is left over at the right and below is left out.
Picture averaged(const Picture& picture, int edge) {
  if (edge == 1) return picture;
  Picture small(std::max(1, picture.width / edge), std::max(1, picture.height / edge), picture.channels);
  const int wide = std::min(edge, picture.width), tall = std::min(edge, picture.height);
  for (int y = 0; y < small.height; ++y)
    for (int x = 0; x < small.width; ++x)
      for (int c = 0; c < small.channels; ++c) {
        double sum = 0;
        for (int j = 0; j < tall; ++j)
          for (int i = 0; i < wide; ++i) sum += picture.pixel(x * edge + i, y * edge + j)[c];
        small.pixel(x, y)[c] = sum / (wide * tall);
      }
  return small;
}

int block_edge(const Picture& picture, int most) { return (std::max(picture.width, picture.height) + most - 1) / most; }

// --- colours ---

std::uint8_t byte_of(double linear) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(srgb_from_linear(std::clamp(linear, 0.0, 1.0)), 0.0, 1.0)));
}

/// Premultiplied colours over black.
std::vector<std::uint8_t> colors_of(const Picture& picture) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double v = picture.pixel(x, y)[c];
        bytes.push_back(byte_of(std::isfinite(v) ? v : 0));
      }
  return bytes;
}

/// Of a map at a place from 0 to 1, linear light.
Vec3d color_at(const ColorPoints& map, double place) {
  std::size_t k = 1;
  while (k + 1 < map.size() && place > map[k].value) ++k;
  const double a = map[k - 1].value, b = map[k].value;
  return glm::mix(map[k - 1].rgb, map[k].rgb, std::clamp((place - a) / (b - a), 0.0, 1.0));
}

/// One value a pixel, laid over a range that the picture and its reference share.
std::vector<std::uint8_t> values_of(const Picture& picture, const Range& range) {
  static const ColorPoints map = color_map("viridis");
  std::vector<std::uint8_t> bytes;
  for (const double v : picture.values) {
    const double place = range.low < range.high ? (v - range.low) / (range.high - range.low) : 0.5;
    const Vec3d rgb = std::isfinite(v) ? color_at(map, place) : Vec3d(0.0);
    for (int c = 0; c < 3; ++c) bytes.push_back(byte_of(rgb[c]));
  }
  return bytes;
}

Range range_of(const Picture& picture) {
  Range range;
  for (const double v : picture.values)
    if (std::isfinite(v)) range = {std::min(range.low, v), std::max(range.high, v)};
  return range;
}

// --- differences ---

/// Of each pixel the channel that is off most, with its sign.
std::vector<double> worst_channel(const Picture& difference) {
  std::vector<double> worst;
  for (int y = 0; y < difference.height; ++y)
    for (int x = 0; x < difference.width; ++x) {
      double most = 0;
      for (int c = 0; c < difference.channels; ++c) {
        const double d = difference.pixel(x, y)[c];
        if (std::isnan(d) || std::abs(d) > std::abs(most)) most = d;
        if (std::isnan(most)) break;
      }
      worst.push_back(most);
    }
  return worst;
}

void add_difference(ShownPicture& shown, const Picture& difference) {
  const std::vector<double> worst = worst_channel(difference);
  std::vector<double> sizes;
  for (const double d : worst)
    if (std::isfinite(d)) sizes.push_back(std::abs(d));
  std::sort(sizes.begin(), sizes.end());
  if (!sizes.empty()) {
    const auto rank = static_cast<std::size_t>(std::ceil(kShareInScale * static_cast<double>(sizes.size()))) - 1;
    shown.largest = sizes.back();
    shown.scale = sizes[rank] > 0 ? sizes[rank] : sizes.back();
  }
  for (const double d : worst) {
    const double place = shown.scale > 0 ? std::clamp(d / shown.scale, -1.0, 1.0) : 0;
    shown.difference.push_back(std::isnan(d) ? kNoNumber : static_cast<std::uint8_t>(127 + std::lround(127 * place)));
  }
}

std::array<std::uint8_t, 3> difference_color(int byte) {
  static const ColorPoints map = color_map("cool_warm");
  if (byte == kNoNumber) return {0, 0, 0};
  const Vec3d rgb = color_at(map, byte / 254.0);
  return {byte_of(rgb[0]), byte_of(rgb[1]), byte_of(rgb[2])};
}

// --- files ---

/// A configuration names a file: digits of a hash and nothing else.
bool is_hash(const std::string& text) {
  return !text.empty() && text.size() <= 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

std::string png_of(png_uint_32 width, png_uint_32 height, png_uint_32 format, const std::vector<std::uint8_t>& bytes,
                   const std::vector<std::uint8_t>& map) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = format;
  image.colormap_entries = static_cast<png_uint_32>(map.size() / 3);
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string png(size, '\0');
  if (png_image_write_to_memory(&image, png.data(), &size, 0, bytes.data(), 0, map.empty() ? nullptr : map.data()) == 0)
    throw Error(fmt::format("a picture cannot be written as PNG: {}", static_cast<const char*>(image.message)));
  png.resize(size);
  return png;
}

std::string rgb_png(const ShownPicture& p, const std::vector<std::uint8_t>& rgb) {
  return png_of(static_cast<png_uint_32>(p.width), static_cast<png_uint_32>(p.height), PNG_FORMAT_RGB, rgb, {});
}

NpyArray bytes_array(const ShownPicture& p, const std::vector<std::uint8_t>& bytes, int channels) {
  std::vector<std::int64_t> shape = {p.height, p.width};
  if (channels > 1) shape.push_back(channels);
  return NpyArray::of<std::uint8_t>("|u1", std::move(shape), bytes);
}

/// Nothing where there is no such array; throws where it is of another kind or size.
std::vector<std::uint8_t> bytes_at(const std::map<std::string, NpyArray>& arrays, const std::string& name, std::size_t count) {
  const auto found = arrays.find(name);
  if (found == arrays.end()) return {};
  if (found->second.type != "|u1" || found->second.bytes.size() != count)
    throw Error(
        fmt::format("pictures.npz: {} is not {} bytes; accepted is what `amrtex report --keep-pictures` writes", name, count));
  return {found->second.bytes.begin(), found->second.bytes.end()};
}

std::map<std::string, NpyArray> arrays_of(const std::vector<std::pair<std::string, ShownPicture>>& pictures) {
  std::map<std::string, NpyArray> arrays;
  for (const auto& [name, p] : pictures) {
    arrays[name + "_picture"] = bytes_array(p, p.rgb, 3);
    if (!p.reference.empty()) arrays[name + "_reference"] = bytes_array(p, p.reference, 3);
    if (p.difference.empty()) continue;
    arrays[name + "_difference"] = bytes_array(p, p.difference, 1);
    arrays[name + "_scale"] = NpyArray::of<double>("<f8", {2}, std::array{p.scale, p.largest});
  }
  return arrays;
}

std::optional<ShownPicture> small_picture(const std::map<std::string, NpyArray>& arrays, const std::string& name) {
  const auto found = arrays.find(name + "_picture");
  if (found == arrays.end() || found->second.shape.size() != 3 || found->second.shape[2] != 3) return std::nullopt;
  ShownPicture p;
  p.height = static_cast<int>(found->second.shape[0]);
  p.width = static_cast<int>(found->second.shape[1]);
  if (p.width < 1 || p.height < 1) return std::nullopt;
  const std::size_t pixels = static_cast<std::size_t>(p.width) * static_cast<std::size_t>(p.height);
  p.rgb = bytes_at(arrays, name + "_picture", 3 * pixels);
  p.reference = bytes_at(arrays, name + "_reference", 3 * pixels);
  p.difference = bytes_at(arrays, name + "_difference", pixels);
  if (const auto scale = arrays.find(name + "_scale");
      scale != arrays.end() && scale->second.bytes.size() == 2 * sizeof(double)) {
    std::array<double, 2> numbers{};
    std::memcpy(numbers.data(), scale->second.bytes.data(), sizeof numbers);
    p.scale = numbers[0];
    p.largest = numbers[1];
  }
  return p;
}

}  // namespace

ShownPicture shown_picture(const StoredPicture& stored, int most) {
  const int edge = block_edge(stored.picture, most);
  const Picture picture = averaged(stored.picture, edge);
  ShownPicture shown;
  shown.width = picture.width;
  shown.height = picture.height;
  std::optional<Picture> reference;
  if (stored.difference && stored.difference->values.size() == stored.picture.values.size()) {
    reference = averaged(difference_of(stored.picture, *stored.difference), edge);
    add_difference(shown, averaged(*stored.difference, edge));
  }
  if (picture.channels >= 3) {
    shown.rgb = colors_of(picture);
    if (reference) shown.reference = colors_of(*reference);
    return shown;
  }
  Range range = range_of(picture);
  if (reference) {
    const Range other = range_of(*reference);
    range = {std::min(range.low, other.low), std::max(range.high, other.high)};
  }
  shown.rgb = values_of(picture, range);
  if (reference) shown.reference = values_of(*reference, range);
  return shown;
}

std::optional<ShownPicture> PictureFolder::find(const Json& record, int most) {
  const std::string name = text_at(record, "/configuration");
  if (!is_hash(name)) return std::nullopt;
  const std::filesystem::path own = picture_path(folder_, name);
  std::error_code absent;
  if (std::filesystem::exists(own, absent)) return shown_picture(read_stored_picture(own), most);
  if (!small_) {
    small_.emplace();
    const std::filesystem::path file = folder_ / "pictures.npz";
    if (std::filesystem::exists(file, absent)) small_ = read_npz(file);
  }
  return small_picture(*small_, name);
}

std::size_t write_small_pictures(const std::filesystem::path& folder, std::span<const Json* const> records) {
  PictureFolder source(folder);
  std::vector<std::pair<std::string, ShownPicture>> pictures;
  for (const Json* record : records)
    if (auto shown = source.find(*record, kMostSmallPixels))
      pictures.emplace_back(text_at(*record, "/configuration"), std::move(*shown));
  while (!pictures.empty()) {
    const std::filesystem::path file = folder / "pictures.npz";
    write_npz(file, arrays_of(pictures));
    const std::uintmax_t bytes = std::filesystem::file_size(file);
    if (bytes <= kMostSmallBytes || pictures.size() == 1) break;
    pictures.resize(std::clamp<std::size_t>(pictures.size() * kMostSmallBytes / bytes, 1, pictures.size() - 1));
  }
  return pictures.size();
}

std::string picture_png(const ShownPicture& picture) { return rgb_png(picture, picture.rgb); }

std::string reference_png(const ShownPicture& picture) { return rgb_png(picture, picture.reference); }

std::string difference_png(const ShownPicture& picture) {
  std::vector<std::uint8_t> map;
  for (int i = 0; i < kColors; ++i)
    for (const std::uint8_t channel : difference_color(i)) map.push_back(channel);
  return png_of(static_cast<png_uint_32>(picture.width), static_cast<png_uint_32>(picture.height), PNG_FORMAT_RGB_COLORMAP,
                picture.difference, map);
}

std::vector<std::string> difference_colors(int count) {
  std::vector<std::string> colors;
  for (int i = 0; i < count; ++i) {
    const auto rgb = difference_color(static_cast<int>(std::lround(254.0 * i / std::max(1, count - 1))));
    colors.push_back(fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]));
  }
  return colors;
}

std::string data_uri(const std::string& png) {
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string uri = "data:image/png;base64,";
  for (std::size_t i = 0; i < png.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (i + k < png.size() ? static_cast<std::uint8_t>(png[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) uri += i + k > png.size() ? '=' : digits[group >> (18 - 6 * k) & 63];
  }
  return uri;
}

}  // namespace amrtex
