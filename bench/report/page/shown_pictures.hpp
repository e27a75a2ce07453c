// Pictures as pages show them: 8 bits a channel, with the reference and the signed difference to it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bench/records/stored_picture.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// Bytes of a difference: 127 is none, 0 and 254 are -scale and +scale or beyond, 255 is no number.
struct ShownPicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;         ///< sRGB, the top row first
  std::vector<std::uint8_t> reference;   ///< the same; empty where there is none
  std::vector<std::uint8_t> difference;  ///< of each pixel the channel that is off most, with its sign; empty where there is none
  double scale = 0;                      ///< 99.5 % of the pixels are off by at most this
  double largest = 0;
};

/// Averaged over blocks of pixels until neither side is longer than `most`.
ShownPicture shown_picture(const StoredPicture& stored, int most);

/// The pictures of a folder of records: pictures/<configuration>.npz, as `run` keeps them, else those of pictures.npz.
class PictureFolder {
 public:
  explicit PictureFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Nothing where the point has none. Throws Error where it cannot be read.
  std::optional<ShownPicture> find(const Json& record, int most);

 private:
  std::filesystem::path folder_;
  std::optional<std::map<std::string, NpyArray>> small_;  ///< of pictures.npz, once it was asked for
};

/// The file pictures.npz (docs/file_formats.md): by configuration, of at most this size.
inline constexpr int kMostSmallPixels = 128;
inline constexpr std::uintmax_t kMostSmallBytes = 2'000'000;
/// Of the first of these records that have pictures, as many as the file takes; returns how many. Without one there is no file.
std::size_t write_small_pictures(const std::filesystem::path& folder, std::span<const Json* const> records);

/// Files in PNG's format.
std::string picture_png(const ShownPicture& picture);
std::string reference_png(const ShownPicture& picture);
std::string difference_png(const ShownPicture& picture);
/// Colours of differences from -scale to +scale, as CSS has them; `count` of them.
std::vector<std::string> difference_colors(int count);

/// "data:image/png;base64,…".
std::string data_uri(const std::string& png);

}  // namespace amrtex
