// What a figure consists of, in millimetres from its upper left corner; and the files that are made of it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace amrtex {

struct Point {
  double x = 0, y = 0;
};
struct Area {
  double left = 0, top = 0, width = 0, height = 0;
  double right() const { return left + width; }
  double bottom() const { return top + height; }
};
/// sRGB, 0 to 1.
struct Ink {
  double red = 0, green = 0, blue = 0, opacity = 1;
};
/// Of "#rrggbb".
Ink ink_of(std::string_view text);

/// Pixels without opacity, sRGB, the first row on top.
struct Bitmap {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

struct FilledArea {
  Area area;
  Ink ink;
};
struct Line {
  std::vector<Point> points;  ///< one alone is a dot
  bool closed = false;
  Ink ink;
  double width = 0.2;  ///< mm
};
enum class Anchor { start, middle, end };
struct Text {
  Point at;  ///< of the line that letters stand on
  std::string text;
  Ink ink;
  Anchor anchor = Anchor::start;
  bool bold = false;
  Ink halo{0, 0, 0, 0};  ///< around the letters, so that they are read on any picture
};
struct Image {
  Area area;
  std::shared_ptr<const Bitmap> bitmap;  ///< its pixels stay rectangles of one colour
};

struct Shape {
  std::variant<FilledArea, Line, Text, Image> what;
  std::optional<Area> within;  ///< nothing is drawn outside
};

struct Drawing {
  double width = 0, height = 0;  ///< mm
  std::string font;              ///< family
  double font_size = 8;          ///< points
  std::vector<Shape> shapes;     ///< from back to front

  template <class What>
  void add(What what, std::optional<Area> within = std::nullopt) {
    Shape& shape = shapes.emplace_back();
    shape.what.template emplace<What>(std::move(what));
    shape.within = within;
  }
};

/// Sizes of text, mm.
class TextRuler {
 public:
  /// Throws UsageError where the machine has no such font, with the one that it would take.
  TextRuler(const std::string& font, double font_size);
  ~TextRuler();
  TextRuler(const TextRuler&) = delete;
  TextRuler& operator=(const TextRuler&) = delete;

  double width(const std::string& text, bool bold = false) const;
  double ascent() const;       ///< of capital letters
  double line_height() const;  ///< from a line to the next
  /// Lines of at most this width, broken between words.
  std::vector<std::string> wrapped(const std::string& text, double width) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

/// Whole files. The same drawing gives the same bytes on one machine, whenever it is drawn. Throw Error.
std::string pdf_file(const Drawing& drawing);
std::string svg_file(const Drawing& drawing);
/// Throws UsageError where a side has more than `kMostFigurePixels`.
std::string png_file(const Drawing& drawing, double dpi);
inline constexpr int kMostFigurePixels = 20000;

}  // namespace amrtex
