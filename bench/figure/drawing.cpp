#include "bench/figure/drawing.hpp"

#include <cairo-ft.h>
#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <csetjmp>
#include <cstring>
#include <limits>
#include <sstream>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;

struct SurfaceDeleter {
  void operator()(cairo_surface_t* s) const { cairo_surface_destroy(s); }
};
struct ContextDeleter {
  void operator()(cairo_t* c) const { cairo_destroy(c); }
};
using SurfacePointer = std::unique_ptr<cairo_surface_t, SurfaceDeleter>;
using CairoPointer = std::unique_ptr<cairo_t, ContextDeleter>;

void check(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) throw Error(fmt::format("drawing a figure: {}", cairo_status_to_string(status)));
}

void select_font(cairo_t* cairo, const std::string& font, double size_mm, bool bold) {
  cairo_select_font_face(cairo, font.c_str(), CAIRO_FONT_SLANT_NORMAL, bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo, size_mm);
}

/// The picture as Cairo holds it.
SurfacePointer image_surface(const Bitmap& bitmap) {
  SurfacePointer surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, bitmap.width, bitmap.height));
  check(cairo_surface_status(surface.get()));
  unsigned char* data = cairo_image_surface_get_data(surface.get());
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface.get()));
  const std::uint8_t* from = bitmap.rgb.data();
  for (int y = 0; y < bitmap.height; ++y)
    for (int x = 0; x < bitmap.width; ++x, from += 3) {
      const std::uint32_t pixel = static_cast<std::uint32_t>(from[0]) << 16U | static_cast<std::uint32_t>(from[1]) << 8U |
                                  static_cast<std::uint32_t>(from[2]);
      std::memcpy(data + static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(x) * 4, &pixel, 4);
    }
  cairo_surface_mark_dirty(surface.get());
  return surface;
}

/// Each pixel `times` times along both axes: not every program that shows a figure keeps enlarged pixels sharp.
Bitmap repeated(const Bitmap& bitmap, int times) {
  Bitmap large{bitmap.width * times, bitmap.height * times, {}};
  large.rgb.reserve(bitmap.rgb.size() * static_cast<std::size_t>(times * times));
  for (int y = 0; y < large.height; ++y)
    for (int x = 0; x < large.width; ++x) {
      const auto from =
          (static_cast<std::size_t>(y / times) * static_cast<std::size_t>(bitmap.width) + static_cast<std::size_t>(x / times)) *
          3;
      large.rgb.insert(large.rgb.end(), bitmap.rgb.begin() + static_cast<std::ptrdiff_t>(from),
                       bitmap.rgb.begin() + static_cast<std::ptrdiff_t>(from) + 3);
    }
  return large;
}

/// Draws shapes; one unit is a millimetre.
class Painter {
 public:
  Painter(cairo_t* cairo, const Drawing& drawing, double pixels_per_mm)
      : cairo_(cairo), drawing_(drawing), pixels_per_mm_(pixels_per_mm) {}

  void paint() {
    for (const Shape& shape : drawing_.shapes) {
      cairo_save(cairo_);
      if (shape.within) {
        cairo_rectangle(cairo_, shape.within->left, shape.within->top, shape.within->width, shape.within->height);
        cairo_clip(cairo_);
      }
      std::visit([&](const auto& what) { draw(what); }, shape.what);
      cairo_restore(cairo_);
    }
    check(cairo_status(cairo_));
  }

 private:
  void use(const Ink& ink) { cairo_set_source_rgba(cairo_, ink.red, ink.green, ink.blue, ink.opacity); }

  void draw(const FilledArea& f) {
    use(f.ink);
    cairo_rectangle(cairo_, f.area.left, f.area.top, f.area.width, f.area.height);
    cairo_fill(cairo_);
  }
  void draw(const Line& l) {
    if (l.points.empty()) return;
    use(l.ink);
    cairo_set_line_width(cairo_, l.width);
    cairo_set_line_join(cairo_, l.closed ? CAIRO_LINE_JOIN_MITER : CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_cap(cairo_, CAIRO_LINE_CAP_ROUND);
    cairo_move_to(cairo_, l.points.front().x, l.points.front().y);
    if (l.points.size() == 1) cairo_line_to(cairo_, l.points[0].x, l.points[0].y);
    for (std::size_t i = 1; i < l.points.size(); ++i) cairo_line_to(cairo_, l.points[i].x, l.points[i].y);
    if (l.closed) cairo_close_path(cairo_);
    cairo_stroke(cairo_);
  }
  void draw(const Text& t) {
    select_font(cairo_, drawing_.font, drawing_.font_size / kPointsPerMm, t.bold);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_, t.text.c_str(), &extents);
    const double before = t.anchor == Anchor::start ? 0 : t.anchor == Anchor::middle ? extents.x_advance / 2 : extents.x_advance;
    if (t.halo.opacity > 0) {
      cairo_move_to(cairo_, t.at.x - before, t.at.y);
      cairo_text_path(cairo_, t.text.c_str());
      use(t.halo);
      cairo_set_line_width(cairo_, drawing_.font_size / kPointsPerMm * 0.22);
      cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
      cairo_stroke(cairo_);
    }
    cairo_move_to(cairo_, t.at.x - before, t.at.y);
    use(t.ink);
    cairo_show_text(cairo_, t.text.c_str());
  }
  void draw(const Image& i) {
    // vectors are looked at enlarged: pixels larger than a quarter of a millimetre are repeated
    const double pixel = i.area.width / i.bitmap->width;
    const int times = pixel > 0.25 ? std::clamp(static_cast<int>(std::ceil(pixel / 0.125)), 1,
                                                1 + 4096 / std::max(i.bitmap->width, i.bitmap->height))
                                   : 1;
    const SurfacePointer surface = image_surface(times > 1 ? repeated(*i.bitmap, times) : *i.bitmap);
    cairo_translate(cairo_, i.area.left, i.area.top);
    cairo_scale(cairo_, i.area.width / (i.bitmap->width * times), i.area.height / (i.bitmap->height * times));
    cairo_set_source_surface(cairo_, surface.get(), 0, 0);
    const bool enlarged = pixels_per_mm_ * i.area.width >= i.bitmap->width;
    cairo_pattern_set_filter(cairo_get_source(cairo_), enlarged ? CAIRO_FILTER_NEAREST : CAIRO_FILTER_GOOD);
    cairo_pattern_set_extend(cairo_get_source(cairo_), CAIRO_EXTEND_PAD);  // no background at the edges
    cairo_rectangle(cairo_, 0, 0, i.bitmap->width * times, i.bitmap->height * times);
    cairo_fill(cairo_);
  }

  cairo_t* cairo_;
  const Drawing& drawing_;
  double pixels_per_mm_;  ///< infinite for vectors
};

cairo_status_t append(void* target, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(target)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

/// `make(write, target, width, height)`: a surface of so many points.
template <class Make>
std::string vector_file(const Drawing& drawing, Make&& make) {
  std::string file;
  const SurfacePointer surface(make(&append, &file, drawing.width * kPointsPerMm, drawing.height * kPointsPerMm));
  check(cairo_surface_status(surface.get()));
  {
    const CairoPointer cairo(cairo_create(surface.get()));
    cairo_scale(cairo.get(), kPointsPerMm, kPointsPerMm);
    Painter(cairo.get(), drawing, std::numeric_limits<double>::infinity()).paint();
  }
  cairo_surface_finish(surface.get());
  check(cairo_surface_status(surface.get()));
  return file;
}

void append_png(png_structp png, png_bytep data, png_size_t length) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), length);
}

/// 8 bits of RGB, with the size of its pixels. No object with a destructor is made between setjmp and longjmp.
bool encode_png(int width, int height, const std::vector<png_bytep>& rows, double dpi, std::string& file) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_set_write_fn(png, &file, append_png, nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), 8, PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  const auto per_meter = static_cast<png_uint_32>(std::lround(dpi / 0.0254));
  png_set_pHYs(png, info, per_meter, per_meter, PNG_RESOLUTION_METER);
  png_set_rows(png, info, const_cast<png_bytepp>(rows.data()));
  png_write_png(png, info, PNG_TRANSFORM_STRIP_FILLER_AFTER | PNG_TRANSFORM_BGR, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

}  // namespace

Ink ink_of(std::string_view text) {
  std::array<double, 3> channels{};
  for (std::size_t c = 0; c < 3; ++c) {
    unsigned value = 0;
    std::from_chars(text.data() + 1 + 2 * c, text.data() + 3 + 2 * c, value, 16);
    channels[c] = value / 255.0;
  }
  return {channels[0], channels[1], channels[2], 1};
}

struct TextRuler::Data {
  SurfacePointer surface;
  CairoPointer cairo;
  std::string font;
  double size;  ///< mm
};

TextRuler::TextRuler(const std::string& font, double font_size) : data_(std::make_unique<Data>()) {
  data_->surface.reset(cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1));
  data_->cairo.reset(cairo_create(data_->surface.get()));
  data_->font = font;
  data_->size = font_size / kPointsPerMm;
  cairo_t* cairo = data_->cairo.get();
  cairo_scale(cairo, 1000, 1000);  // sizes are those of vectors
  select_font(cairo, font, data_->size, false);
  cairo_scaled_font_t* scaled = cairo_get_scaled_font(cairo);
  check(cairo_scaled_font_status(scaled));
  if (cairo_scaled_font_get_type(scaled) != CAIRO_FONT_TYPE_FT) return;
  FT_Face face = cairo_ft_scaled_font_lock_face(scaled);
  const std::string family = face != nullptr && face->family_name != nullptr ? face->family_name : "";
  cairo_ft_scaled_font_unlock_face(scaled);
  if (family != font)
    throw UsageError(fmt::format("font {}: this machine has none of that name and would take {}; accepted: an installed family",
                                 quote(font), quote(family)));
}

TextRuler::~TextRuler() = default;

double TextRuler::width(const std::string& text, bool bold) const {
  select_font(data_->cairo.get(), data_->font, data_->size, bold);
  cairo_text_extents_t extents;
  cairo_text_extents(data_->cairo.get(), text.c_str(), &extents);
  check(cairo_status(data_->cairo.get()));
  return extents.x_advance;
}

double TextRuler::ascent() const { return 0.73 * data_->size; }
double TextRuler::line_height() const { return 1.25 * data_->size; }

std::vector<std::string> TextRuler::wrapped(const std::string& text, double width) const {
  std::vector<std::string> lines;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::string longer = lines.empty() ? word : lines.back() + " " + word;
    if (!lines.empty() && this->width(longer) <= width)
      lines.back() = longer;
    else
      lines.push_back(word);
  }
  return lines;
}

std::string pdf_file(const Drawing& drawing) {
  return vector_file(drawing, [](cairo_write_func_t write, std::string* target, double width, double height) {
    cairo_surface_t* surface = cairo_pdf_surface_create_for_stream(write, target, width, height);
    cairo_pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATE_DATE, "");  // the same bytes tomorrow
    return surface;
  });
}

std::string svg_file(const Drawing& drawing) {
  return vector_file(drawing, [](cairo_write_func_t write, std::string* target, double width, double height) {
    return cairo_svg_surface_create_for_stream(write, target, width, height);
  });
}

std::string png_file(const Drawing& drawing, double dpi) {
  const double per_mm = dpi / 25.4;
  const double width = std::ceil(drawing.width * per_mm - 1e-6), height = std::ceil(drawing.height * per_mm - 1e-6);
  if (!(width >= 1 && height >= 1 && width <= kMostFigurePixels && height <= kMostFigurePixels))
    throw UsageError(fmt::format("{:.4g} x {:.4g} mm at {:.4g} dpi are {:.0f} x {:.0f} pixels; accepted: 1 to {} a side",
                                 drawing.width, drawing.height, dpi, width, height, kMostFigurePixels));
  const SurfacePointer surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width), static_cast<int>(height)));
  check(cairo_surface_status(surface.get()));
  const CairoPointer cairo(cairo_create(surface.get()));
  cairo_set_source_rgb(cairo.get(), 1, 1, 1);  // the last row and column may be parts of pixels
  cairo_paint(cairo.get());
  cairo_scale(cairo.get(), per_mm, per_mm);
  Painter(cairo.get(), drawing, per_mm).paint();
  cairo_surface_flush(surface.get());
  std::vector<png_bytep> rows;
  for (int y = 0; y < static_cast<int>(height); ++y)
    rows.push_back(cairo_image_surface_get_data(surface.get()) +
                   static_cast<std::ptrdiff_t>(y) * cairo_image_surface_get_stride(surface.get()));
  std::string file;
  if (!encode_png(static_cast<int>(width), static_cast<int>(height), rows, dpi, file))
    throw Error("a figure as PNG: cannot be encoded");
  return file;
}

}  // namespace amrtex
