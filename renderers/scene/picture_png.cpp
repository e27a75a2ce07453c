// Pictures to look at: 8-bit sRGB, one-channel ones through a colour map.
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "renderers/scene/picture.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

using Rgb = std::array<double, 3>;  // sRGB, 0 to 1

constexpr int kBarWidth = 16;  // pixels
constexpr int kBarMargin = 8;  // pixels
constexpr int kGlyphWidth = 3, kGlyphHeight = 5, kGlyphScale = 2;
constexpr int kAdvance = (kGlyphWidth + 1) * kGlyphScale;

/// An 8-bit picture that is drawn into.
struct Canvas {
  int width, height;
  std::vector<std::uint8_t> bytes;  // RGB

  Canvas(int w, int h) : width(w), height(h), bytes(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 3) {}
  void set(int x, int y, const Rgb& color) {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const std::size_t i = (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * 3;
    for (std::size_t c = 0; c < 3; ++c)
      bytes[i + c] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(color[c], 0.0, 1.0)));
  }
};

double srgb(double linear) {
  if (!(linear > 0)) return 0;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// Nine points along matplotlib's "viridis" (CC0): even steps look even, also without colour.
Rgb color_map(double x) {
  constexpr std::array<Rgb, 9> kPoints{{{0.267, 0.005, 0.329},
                                        {0.279, 0.175, 0.483},
                                        {0.230, 0.322, 0.546},
                                        {0.173, 0.449, 0.558},
                                        {0.128, 0.567, 0.551},
                                        {0.158, 0.684, 0.502},
                                        {0.369, 0.789, 0.383},
                                        {0.678, 0.864, 0.190},
                                        {0.993, 0.906, 0.144}}};
  const double at = std::clamp(x, 0.0, 1.0) * (kPoints.size() - 1);
  const std::size_t k = std::min(static_cast<std::size_t>(at), kPoints.size() - 2);
  const double w = at - static_cast<double>(k);
  Rgb color{};
  for (std::size_t c = 0; c < 3; ++c) color[c] = kPoints[k][c] + w * (kPoints[k + 1][c] - kPoints[k][c]);
  return color;
}

/// Rows of three bits from the top, as octal digits; letters are drawn as capitals.
int glyph(char ch) {
  constexpr std::string_view kChars = "0123456789-+./^ABCDEFGHIJKLMNOPQRSTUVWXYZ";
  constexpr std::array<int, 41> kRows{075557, 026227, 071747, 071717, 055711, 074717, 074757, 071111, 075757, 075717, 000700,
                                      002720, 000002, 011244, 025000, 025755, 065656, 034443, 065556, 074647, 074644, 034553,
                                      055755, 072227, 011152, 055655, 044447, 057755, 065555, 025552, 065644, 025573, 065655,
                                      034216, 072222, 055557, 055552, 055775, 055255, 055222, 071247};
  static_assert(kChars.size() == kRows.size());
  const char upper = ch >= 'a' && ch <= 'z' ? static_cast<char>(ch - 'a' + 'A') : ch;
  const auto at = kChars.find(upper);
  return at == std::string_view::npos ? 0 : kRows[at];
}

void draw_text(Canvas& canvas, int x, int y, std::string_view text, const Rgb& color) {
  for (std::size_t k = 0; k < text.size(); ++k)
    for (int row = 0; row < kGlyphHeight * kGlyphScale; ++row)
      for (int column = 0; column < kGlyphWidth * kGlyphScale; ++column) {
        const int bit = (kGlyphHeight - 1 - row / kGlyphScale) * kGlyphWidth + kGlyphWidth - 1 - column / kGlyphScale;
        if (((glyph(text[k]) >> bit) & 1) != 0) canvas.set(x + static_cast<int>(k) * kAdvance + column, y + row, color);
      }
}

struct Range {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();
  bool logarithmic;

  Range(const Picture& picture, bool log) : logarithmic(log) {
    for (const double v : picture.values)
      if (std::isfinite(v) && (!log || v > 0)) {
        min = std::min(min, v);
        max = std::max(max, v);
      }
  }
  bool empty() const { return !(min <= max); }
  double axis(double v) const { return logarithmic ? std::log10(v) : v; }
  /// Place of a value between 0 and 1; NaN where it has none.
  double place(double v) const {
    if (!std::isfinite(v) || (logarithmic && v <= 0)) return std::numeric_limits<double>::quiet_NaN();
    return max > min ? (axis(v) - axis(min)) / (axis(max) - axis(min)) : 0.5;
  }
};

struct BarText {
  std::string max, min, unit;
  int width() const { return static_cast<int>(std::max({max.size(), min.size(), unit.size()})) * kAdvance; }
};

void draw_bar(Canvas& canvas, int left, const BarText& text, const Rgb& ink) {
  const int top = kBarMargin;
  const int bottom = canvas.height - kBarMargin;
  for (int y = top; y < bottom; ++y)
    for (int x = 0; x < kBarWidth; ++x)
      canvas.set(left + kBarMargin + x, y, color_map(static_cast<double>(bottom - 1 - y) / std::max(1, bottom - 1 - top)));
  const int column = left + 2 * kBarMargin + kBarWidth;
  draw_text(canvas, column, top, text.max, ink);
  draw_text(canvas, column, (top + bottom - kGlyphHeight * kGlyphScale) / 2, text.unit, ink);
  draw_text(canvas, column, bottom - kGlyphHeight * kGlyphScale, text.min, ink);
}

Rgb display(const Rgb& linear) { return {srgb(linear[0]), srgb(linear[1]), srgb(linear[2])}; }

Canvas draw_light(const Picture& picture, const PngOptions& options) {
  Canvas canvas(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double* p = picture.pixel(x, y);
      Rgb linear{};
      for (std::size_t c = 0; c < 3; ++c) linear[c] = p[c] + (1 - p[3]) * options.background[c];
      canvas.set(x, y, display(linear));
    }
  return canvas;
}

Canvas draw_values(const Picture& picture, const PngOptions& options) {
  const Range range(picture, options.logarithmic);
  const bool bar = options.color_bar && !range.empty();
  const BarText text =
      bar ? BarText{fmt::format("{:.4g}", range.max), fmt::format("{:.4g}", range.min), options.unit} : BarText{};
  Canvas canvas(picture.width + (bar ? 3 * kBarMargin + kBarWidth + text.width() : 0), picture.height);
  const Rgb behind = display(options.background);
  for (int y = 0; y < canvas.height; ++y)
    for (int x = 0; x < canvas.width; ++x) {
      const double place = x < picture.width ? range.place(*picture.pixel(x, y)) : std::numeric_limits<double>::quiet_NaN();
      canvas.set(x, y, std::isnan(place) ? behind : color_map(place));
    }
  const double ink = behind[0] + behind[1] + behind[2] < 1.5 ? 1 : 0;
  if (bar) draw_bar(canvas, picture.width, text, {ink, ink, ink});
  return canvas;
}

}  // namespace

void write_png(const Picture& picture, const std::filesystem::path& path, const PngOptions& options) {
  if (picture.width < 1 || picture.height < 1 || (picture.channels != 1 && picture.channels != 4))
    throw Error(fmt::format("{}: a picture of {} x {} pixels and {} channels; PNG takes 1 or 4 channels", path.string(),
                            picture.width, picture.height, picture.channels));
  const Canvas canvas = picture.channels == 4 ? draw_light(picture, options) : draw_values(picture, options);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(canvas.width);
  image.height = static_cast<png_uint_32>(canvas.height);
  image.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, canvas.bytes.data(), 0, nullptr) == 0)
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), static_cast<const char*>(image.message)));
  bytes.resize(size);
  write_atomically(path, bytes);
}

}  // namespace amrtex
