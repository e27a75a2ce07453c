// Float pictures: what consumers and references return and what metrics compare.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace amrtex {

/// Linear values, first row on top. 4 channels: premultiplied RGBA, or a normal and 1;
/// 1 channel: the raw value of the modes projection and mip. Pictures of the GL
/// context are floats where the field's units are plain (value_units.hpp), else such times a power of two, and an offset.
struct Picture {
  int width = 0;
  int height = 0;
  int channels = 4;
  std::vector<double> values;  ///< channel fastest, then x, then y

  Picture() = default;
  Picture(int w, int h, int c)
      : width(w),
        height(h),
        channels(c),
        values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c)) {}
  double* pixel(int x, int y) {
    return &values[(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
                   static_cast<std::size_t>(channels)];
  }
  const double* pixel(int x, int y) const { return const_cast<Picture*>(this)->pixel(x, y); }
};

/// Hash of the values as 32-bit floats, or as doubles where floats do not hold them.
std::string picture_hash(const Picture& picture);

/// NumPy format, shape (height, width, channels); 64-bit where `as_double`, for references, or where floats do not hold the
/// values. Written to a temporary name first. Throws Error with the path.
void write_npy(const Picture& picture, const std::filesystem::path& path, bool as_double);
Picture read_npy(const std::filesystem::path& path);

/// 32-bit floats, no compression that loses any: channels R, G, B and A, premultiplied, or Y. Throws Error with the path.
void write_exr(const Picture& picture, const std::filesystem::path& path);

/// A colour of a bar; linear RGB.
struct PngColor {
  double value;
  std::array<double, 3> rgb;
};

/// A line of the picture's background, pixels from its upper left corner.
struct PngLine {
  double x0, y0, x1, y1;
};

struct PngOptions {
  std::array<double, 3> background{0, 0, 0};  ///< linear RGB behind premultiplied colour
  bool transparent = false;                   ///< the picture's own alpha in its place
  bool color_bar = false;                     ///< a bar with ticks beside the picture, where there is something to show in it
  bool logarithmic = false;                   ///< colours are joined over log10(value)
  std::string title;                          ///< above the bar
  /// Four channels: what the bar shows, over values. One channel: a map over 0 to 1, which is laid over `range`; empty: viridis.
  std::vector<PngColor> colors;
  std::optional<std::array<double, 2>> range;  ///< of one channel; absent: the picture's
  std::vector<PngLine> lines;  ///< behind four-channel pictures with a background, a faint colour that it sets off
};
/// 8-bit sRGB to look at; one-channel pictures through a colour map over their range.
void write_png(const Picture& picture, const std::filesystem::path& path, const PngOptions& options = {});

}  // namespace amrtex
