// A point's picture as it is kept beside its record: half floats over the picture's own range.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "structures/mesh/npz_file.hpp"
#include "renderers/scene/picture.hpp"

namespace amrtex {

/// value = offset + scale x half, halves in [-1, 1]. The range is that of the finite values; what is not finite stays so.
struct HalfPicture {
  NpyArray halves;  ///< (height, width, channels)
  double scale = 1;
  double offset = 0;
};

/// Half the range is the scale, its middle the offset: off by at most 2^-12 of the range (a half float's rounding just below 1).
HalfPicture to_halves(const Picture& picture);
/// The offset is 0, so that what is equal is 0 and signs are kept.
HalfPicture to_signed_halves(const Picture& difference);
Picture from_halves(const HalfPicture& halves);

/// A picture, and its signed difference to its reference where there is one (docs/file_formats.md).
struct StoredPicture {
  Picture picture;
  std::optional<Picture> difference;  ///< picture - reference, value by value
};

/// Folder of the pictures of a folder of records.
std::filesystem::path picture_folder(const std::filesystem::path& records);
/// Where in it a point's picture lies, as numbers (".npz") or to look at (".png").
std::filesystem::path picture_path(const std::filesystem::path& records, const std::string& configuration,
                                   const std::string& extension = ".npz");

/// The signed difference of two pictures of one size.
Picture difference_of(const Picture& picture, const Picture& reference);

void write_stored_picture(const std::filesystem::path& path, const StoredPicture& stored);
/// Throws Error with the path where it is no such file.
StoredPicture read_stored_picture(const std::filesystem::path& path);

}  // namespace amrtex
