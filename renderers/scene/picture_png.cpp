// Pictures to look at: 8-bit sRGB, one-channel ones through a colour map.
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "renderers/scene/color_map.hpp"
#include "renderers/scene/dot_font.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/ticks.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

using Rgb = std::array<double, 3>;

constexpr int kGlyphGap = 1;  // dots between letters

/// An 8-bit picture that is drawn into.
struct Canvas {
  int width, height;
  std::vector<std::uint8_t> bytes;  // RGBA, sRGB

  Canvas(int w, int h) : width(w), height(h), bytes(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * 4) {}
  void set(int x, int y, const Rgb& srgb, double alpha = 1) {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const std::size_t i = (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * 4;
    for (std::size_t c = 0; c < 3; ++c) bytes[i + c] = byte(srgb[c]);
    bytes[i + 3] = byte(alpha);
  }
  void fill(int left, int top, int w, int h, const Rgb& srgb) {
    for (int y = top; y < top + h; ++y)
      for (int x = left; x < left + w; ++x) set(x, y, srgb);
  }

 private:
  static std::uint8_t byte(double v) { return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.0, 1.0))); }
};

Rgb display(const Rgb& linear) { return {srgb_from_linear(linear[0]), srgb_from_linear(linear[1]), srgb_from_linear(linear[2])}; }

/// Colours over an axis, linear between them.
class Scale {
 public:
  Scale(std::vector<PngColor> colors, bool logarithmic) : colors_(std::move(colors)), logarithmic_(logarithmic) {}
  bool empty() const { return colors_.size() < 2 || !(first() < last()); }
  double first() const { return colors_.front().value; }
  double last() const { return colors_.back().value; }
  bool logarithmic() const { return logarithmic_; }
  /// 0 at the first value, 1 at the last one.
  double place(double value) const { return (axis(value) - axis(first())) / (axis(last()) - axis(first())); }
  Rgb at_place(double place) const {
    const double x = axis(first()) + place * (axis(last()) - axis(first()));
    std::size_t k = 1;
    while (k + 1 < colors_.size() && x >= axis(colors_[k].value)) ++k;
    const double a = axis(colors_[k - 1].value), b = axis(colors_[k].value);
    const double w = std::clamp((x - a) / (b - a), 0.0, 1.0);
    Rgb linear{};
    for (std::size_t c = 0; c < 3; ++c) linear[c] = colors_[k - 1].rgb[c] + w * (colors_[k].rgb[c] - colors_[k - 1].rgb[c]);
    return display(linear);
  }

 private:
  double axis(double v) const { return logarithmic_ ? std::log10(v) : v / 2; }  // half: the extent of all doubles is one

  std::vector<PngColor> colors_;
  bool logarithmic_;
};

Scale unit_scale(const PngOptions& options) {
  std::vector<PngColor> colors = options.colors;
  if (colors.empty())
    for (const auto& p : color_map("viridis")) colors.push_back({p.value, {p.rgb.x, p.rgb.y, p.rgb.z}});
  return {std::move(colors), false};
}

/// Sizes in pixels; larger beside larger pictures.
struct BarLayout {
  int dot, bar, gap, tick;
  explicit BarLayout(int height) : dot(std::clamp((height + 320) / 384, 1, 8)), bar(10 * dot), gap(5 * dot), tick(3 * dot) {}
  int text_height() const { return kDotRows * dot; }
  int text_width(std::size_t letters) const { return static_cast<int>(letters) * (kDotColumns + kGlyphGap) * dot; }
};

void draw_text(Canvas& canvas, int x, int y, int dot, std::string_view text, const Rgb& ink) {
  for (const char ch : text) {
    const auto columns = dot_glyph(ch);
    for (int column = 0; column < kDotColumns; ++column)
      for (int row = 0; row < kDotRows; ++row)
        if (((columns[static_cast<std::size_t>(column)] >> row) & 1) != 0)
          canvas.fill(x + column * dot, y + row * dot, dot, dot, ink);
    x += (kDotColumns + kGlyphGap) * dot;
  }
}

/// The bar right of a picture: its title above, ticks and numbers at its right.
class Bar {
 public:
  Bar(Scale scale, std::string title, int height)
      : scale_(std::move(scale)), title_(std::move(title)), layout_(height), height_(height) {
    if (scale_.empty()) return;
    const int room = std::max(0, bottom() - top());
    ticks_ = ticks(scale_.first(), scale_.last(), scale_.logarithmic(), std::clamp(room / (4 * layout_.text_height()), 2, 8));
  }
  int width() const {
    if (scale_.empty()) return 0;
    std::size_t letters = 0;
    for (const Tick& t : ticks_) letters = std::max(letters, t.text.size());
    const int beside = layout_.bar + 2 * layout_.tick + layout_.text_width(letters);
    return 2 * layout_.gap + std::max(beside, layout_.text_width(title_.size()));
  }
  void draw(Canvas& canvas, int left, const Rgb& ink) const {
    if (scale_.empty()) return;
    const int x = left + layout_.gap;
    draw_text(canvas, x, layout_.gap, layout_.dot, title_, ink);
    const int rows = std::max(1, bottom() - top() - 1);
    for (int y = top(); y < bottom(); ++y)
      canvas.fill(x, y, layout_.bar, 1, scale_.at_place(static_cast<double>(bottom() - 1 - y) / rows));
    const int line = std::max(1, layout_.dot / 2);
    for (const Tick& t : ticks_) {
      const int y = bottom() - 1 - static_cast<int>(std::lround(scale_.place(t.value) * rows));
      canvas.fill(x + layout_.bar, y - line / 2, layout_.tick, line, ink);
      draw_text(canvas, x + layout_.bar + 2 * layout_.tick, y - layout_.text_height() / 2, layout_.dot, t.text, ink);
    }
  }

 private:
  int top() const {
    return title_.empty() ? layout_.gap + layout_.text_height() / 2 : 2 * layout_.gap + 3 * layout_.text_height() / 2;
  }
  int bottom() const { return height_ - layout_.gap - layout_.text_height() / 2; }

  Scale scale_;
  std::string title_;
  BarLayout layout_;
  int height_;
  std::vector<Tick> ticks_;
};

Rgb ink_on(const Rgb& background, bool transparent) {
  if (transparent) return {0.5, 0.5, 0.5};  // is read on white and on black
  return lightness(Vec3d(background[0], background[1], background[2])) < 50 ? Rgb{1, 1, 1} : Rgb{0, 0, 0};
}

Canvas with_bar(const Picture& picture, const Bar& bar, const PngOptions& options) {
  Canvas canvas(picture.width + (options.color_bar ? bar.width() : 0), picture.height);
  if (!options.transparent) canvas.fill(0, 0, canvas.width, canvas.height, display(options.background));
  if (options.color_bar) bar.draw(canvas, picture.width, ink_on(options.background, options.transparent));
  return canvas;
}

/// How much of each pixel the lines cover.
std::vector<double> coverage(const Picture& picture, const std::vector<PngLine>& lines) {
  std::vector<double> covered(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  const double half = std::max(0.5, picture.height / 1500.0);  // of the line's width
  for (const PngLine& line : lines) {
    const double dx = line.x1 - line.x0, dy = line.y1 - line.y0;
    const double length = std::hypot(dx, dy);
    if (!(length > 0) || !std::isfinite(length)) continue;
    const auto first = [&](double a, double b) { return static_cast<int>(std::max(0.0, std::floor(std::min(a, b) - 2 * half))); };
    const auto last = [&](double a, double b, int most) {
      return static_cast<int>(std::clamp(std::ceil(std::max(a, b) + 2 * half), 0.0, static_cast<double>(most)));
    };
    for (int y = first(line.y0, line.y1); y < last(line.y0, line.y1, picture.height); ++y)
      for (int x = first(line.x0, line.x1); x < last(line.x0, line.x1, picture.width); ++x) {
        const double px = x + 0.5 - line.x0, py = y + 0.5 - line.y0;
        const double along = std::clamp((px * dx + py * dy) / length, 0.0, length);
        const double away = std::hypot(px - along * dx / length, py - along * dy / length);
        double& c = covered[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x)];
        c = std::max(c, std::clamp(half + 0.5 - away, 0.0, 1.0));
      }
  }
  return covered;
}

Canvas draw_light(const Picture& picture, const PngOptions& options) {
  Canvas canvas = with_bar(picture, Bar({options.colors, options.logarithmic}, options.title, picture.height), options);
  const std::vector<double> covered = coverage(picture, options.transparent ? std::vector<PngLine>() : options.lines);
  const double line = srgb_from_linear(options.background[1]) < 0.5 ? linear_from_srgb(0.36) : linear_from_srgb(0.72);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double* p = picture.pixel(x, y);
      const double c_line =
          covered[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x)];
      Rgb linear{};
      for (std::size_t c = 0; c < 3; ++c) {
        const double behind = options.background[c] + c_line * (line - options.background[c]);
        linear[c] = options.transparent ? (p[3] > 0 ? p[c] / p[3] : 0) : p[c] + (1 - p[3]) * behind;
      }
      canvas.set(x, y, display(linear), options.transparent ? p[3] : 1);
    }
  return canvas;
}

/// Of the values that have a place on the axis; empty where there are none.
std::optional<std::array<double, 2>> range_of(const Picture& picture, bool logarithmic) {
  std::optional<std::array<double, 2>> range;
  for (const double v : picture.values) {
    if (!std::isfinite(v) || (logarithmic && !(v > 0))) continue;
    if (!range) range = {v, v};
    (*range)[0] = std::min((*range)[0], v);
    (*range)[1] = std::max((*range)[1], v);
  }
  return range;
}

Canvas draw_values(const Picture& picture, const PngOptions& options) {
  const Scale map = unit_scale(options);
  const auto range = options.range ? options.range : range_of(picture, options.logarithmic);
  std::vector<PngColor> over_range;
  if (range && (*range)[0] < (*range)[1])
    for (int i = 0; i <= 64; ++i) {
      const double w = i / 64.0;
      const auto [low, high] = *range;
      const double value = options.logarithmic ? low * std::pow(high / low, w) : (1 - w) * low + w * high;
      const Rgb c = map.at_place(w);
      over_range.push_back({value, {linear_from_srgb(c[0]), linear_from_srgb(c[1]), linear_from_srgb(c[2])}});
    }
  const Scale scale(over_range, options.logarithmic);
  Canvas canvas = with_bar(picture, Bar(scale, options.title, picture.height), options);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const double v = *picture.pixel(x, y);
      if (!std::isfinite(v) || (options.logarithmic && !(v > 0))) continue;
      canvas.set(x, y, map.at_place(scale.empty() ? 0.5 : scale.place(v)));
    }
  return canvas;
}

std::vector<std::uint8_t> without_alpha(const std::vector<std::uint8_t>& rgba) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(rgba.size() / 4 * 3);
  for (std::size_t i = 0; i < rgba.size(); i += 4)
    rgb.insert(rgb.end(), rgba.begin() + static_cast<std::ptrdiff_t>(i), rgba.begin() + static_cast<std::ptrdiff_t>(i) + 3);
  return rgb;
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
  image.format = options.transparent ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  const std::vector<std::uint8_t> bytes_of_image = options.transparent ? canvas.bytes : without_alpha(canvas.bytes);
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, bytes_of_image.data(), 0, nullptr) == 0)
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), static_cast<const char*>(image.message)));
  bytes.resize(size);
  write_atomically(path, bytes);
}

}  // namespace amrtex
