#include "bench/figure/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderers/scene/color_map.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr Ink kBlack{0.1, 0.1, 0.1, 1};
constexpr Ink kFrame{0.45, 0.45, 0.45, 1};
constexpr double kFrameWidth = 0.15;  ///< mm, likewise below
constexpr double kBarWidth = 2.4;
constexpr double kTick = 0.7;
constexpr double kPad = 1.2;  ///< between a picture and what stands beside it
constexpr double kLeastPicture = 5;
constexpr int kBarTexels = 512;

/// 1, and with a real minus.
std::string number_text(const std::string& text) {
  std::string shown;
  for (const char c : text) shown += c == '-' ? std::string("\xE2\x88\x92") : std::string(1, c);
  return shown;
}

std::string label_of(std::size_t index) { return fmt::format("({})", static_cast<char>('a' + index)); }

/// A panel while it is laid out.
struct Cell {
  const PanelSpec* spec;
  const PanelContent* content;
  std::unique_ptr<ColorScale> scale;
  std::vector<Tick> ticks;           ///< of the bar
  std::vector<std::string> caption;  ///< lines
  Area picture;
  bool has_bar = false;
};

class Layout {
 public:
  Layout(const FigureSpec& figure, const std::vector<PanelContent>& panels)
      : figure_(figure), ruler_(figure.font, figure.font_size), columns_(static_cast<std::size_t>(figure.columns)) {
    std::vector<std::unique_ptr<ColorScale>> scales = make_scales(figure, panels);
    for (std::size_t i = 0; i < panels.size(); ++i) {
      const PanelSpec& spec = figure.panels[i];
      Cell cell{&spec, &panels[i], std::move(scales[i]), {}, {}, {}, false};
      cell.has_bar = cell.scale && spec.color_bar;
      cells_.push_back(std::move(cell));
    }
  }

  Drawing draw() {
    drawing_ = {figure_.width, 0, figure_.font, figure_.font_size, {}};
    place_columns();
    place_rows();
    drawing_.add(FilledArea{{0, 0, drawing_.width, drawing_.height}, {1, 1, 1, 1}});
    for (const Cell& cell : cells_) draw_cell(cell);
    return std::move(drawing_);
  }

 private:
  bool bars_right() const { return figure_.color_bars == "right"; }
  std::size_t rows() const { return (cells_.size() + columns_ - 1) / columns_; }
  std::string quantity(const Cell& cell) const {
    return printable(cell.spec->bar_label.empty() ? cell.content->quantity : cell.spec->bar_label);
  }

  // --- sizes ---

  void make_ticks(Cell& cell, double length) const {
    const double each = bars_right() ? 2.2 * ruler_.line_height() : 3.5 * ruler_.line_height();
    cell.ticks = cell.scale->ticks(std::clamp(static_cast<int>(length / each), 3, 8));
  }
  /// Of a bar at the right and its numbers, with the gap before it.
  double bar_space(const Cell& cell) const {
    if (!cell.has_bar || !bars_right()) return 0;
    double text = 0;
    for (const Tick& t : cell.ticks) text = std::max(text, ruler_.width(number_text(t.text)));
    return kPad + kBarWidth + kTick + 0.5 + text;
  }

  /// Pictures of all columns have one width; a column is as wide as its widest bar asks for.
  void place_columns() {
    std::vector<double> space(columns_, 0.0);
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!cells_[i].has_bar) continue;
      make_ticks(cells_[i], figure_.width / static_cast<double>(columns_) * 0.6);
      space[i % columns_] = std::max(space[i % columns_], bar_space(cells_[i]));
    }
    double left_over = figure_.width - figure_.gap * static_cast<double>(columns_ - 1) - 2 * kFrameWidth;
    for (const double s : space) left_over -= s;
    const double width = left_over / static_cast<double>(columns_);
    if (!(width >= kLeastPicture))
      throw UsageError(fmt::format(
          "{}: {} columns in {:.4g} mm leave {:.2g} mm for a picture; accepted: a larger 'width', fewer 'columns', at "
          "least {} mm",
          clipped(figure_.file.string()), columns_, figure_.width, std::max(width, 0.0), kLeastPicture));
    double left = kFrameWidth;
    for (std::size_t c = 0; c < columns_; ++c) {
      for (std::size_t i = c; i < cells_.size(); i += columns_) {
        const Picture& p = cells_[i].content->picture;
        cells_[i].picture = {left, 0, width, width * p.height / p.width};
        if (cells_[i].has_bar) make_ticks(cells_[i], bars_right() ? cells_[i].picture.height : width);
        cells_[i].caption = ruler_.wrapped(caption_of(i), width + space[c]);
      }
      left += width + space[c] + figure_.gap;
    }
  }

  std::string caption_of(std::size_t index) const {
    const std::string caption = printable(cells_[index].spec->caption);
    if (!figure_.labels || cells_.size() < 2) return caption;
    return caption.empty() ? label_of(index) : label_of(index) + " " + caption;
  }

  /// Above the picture: the quantity over a bar at the right.
  double above(const Cell& cell) const { return cell.has_bar && bars_right() ? ruler_.line_height() : 0; }
  /// Of the parts below the picture.
  double bar_below(const Cell& cell) const {
    return cell.has_bar && !bars_right() ? kPad + kBarWidth + kTick + 2.1 * ruler_.line_height() : 0;
  }
  double key_height(const Cell& cell) const { return cell.content->key.empty() ? 0 : kPad + ruler_.line_height(); }
  double caption_height(const Cell& cell) const {
    return cell.caption.empty() ? 0 : kPad + ruler_.line_height() * static_cast<double>(cell.caption.size());
  }

  void place_rows() {
    double top = kFrameWidth;
    for (std::size_t r = 0; r < rows(); ++r) {
      double before = 0, picture = 0, bar = 0, key = 0, caption = 0;
      for_row(r, [&](const Cell& c) {
        before = std::max(before, above(c));
        picture = std::max(picture, c.picture.height);
        bar = std::max(bar, bar_below(c));
        key = std::max(key, key_height(c));
        caption = std::max(caption, caption_height(c));
      });
      for_row(r, [&](Cell& c) { c.picture.top = top + before; });
      bar_top_.push_back(top + before + picture);
      key_top_.push_back(bar_top_.back() + bar);
      caption_top_.push_back(key_top_.back() + key);
      top = caption_top_.back() + caption + (r + 1 < rows() ? figure_.gap : kFrameWidth);
    }
    drawing_.height = top;
  }
  template <class Use>
  void for_row(std::size_t r, Use&& use) {
    for (std::size_t i = r * columns_; i < std::min(cells_.size(), (r + 1) * columns_); ++i) use(cells_[i]);
  }

  // --- shapes ---

  void text(Point at, const std::string& what, Anchor anchor = Anchor::start, bool bold = false) {
    drawing_.add(Text{at, what, kBlack, anchor, bold, {0, 0, 0, 0}});
  }
  void frame(const Area& a, const Ink& ink, double width) {
    drawing_.add(Line{{{a.left, a.top}, {a.right(), a.top}, {a.right(), a.bottom()}, {a.left, a.bottom()}}, true, ink, width});
  }

  void draw_cell(const Cell& cell) {
    const auto index = static_cast<std::size_t>(&cell - cells_.data());
    const auto bitmap = std::make_shared<Bitmap>(to_bitmap(
        cell.content->picture, cell.content->picture.channels == 1 ? cell.scale.get() : nullptr, cell.content->background));
    drawing_.add(Image{cell.picture, bitmap});
    for (const Line& line : cell.content->lines) draw_overlay(cell.picture, line);
    for (const InsetSpec& inset : cell.spec->insets) draw_inset(cell, *bitmap, inset);
    frame(cell.picture, kFrame, kFrameWidth);
    if (cell.spec->scale_bar) draw_scale_bar(cell);
    if (cell.has_bar) bars_right() ? draw_bar_right(cell) : draw_bar_below(cell, bar_top_[index / columns_]);
    draw_key(cell, key_top_[index / columns_]);
    draw_caption(cell, caption_top_[index / columns_]);
  }

  void draw_overlay(const Area& area, const Line& line) {
    Line placed = line;
    for (Point& p : placed.points) p = {area.left + p.x * area.width, area.top + p.y * area.height};
    drawing_.add(std::move(placed), area);
  }

  void draw_caption(const Cell& cell, double top) {
    double base = top + kPad + ruler_.ascent();
    for (const std::string& line : cell.caption) {
      text({cell.picture.left, base}, line);
      base += ruler_.line_height();
    }
  }

  void draw_key(const Cell& cell, double top) {
    const double base = top + kPad + ruler_.ascent(), swatch = ruler_.ascent();
    double x = cell.picture.left;
    if (cell.content->key.empty()) return;
    text({x, base}, "level");
    x += ruler_.width("level") + swatch;
    for (const LevelKey& key : cell.content->key) {
      const std::string number = fmt::format("{}", key.level);
      if (x + 1.4 * swatch + ruler_.width(number) > cell.picture.right()) break;
      drawing_.add(FilledArea{{x, base - swatch, swatch, swatch}, key.ink});
      text({x + 1.4 * swatch, base}, number);
      x += 2.4 * swatch + ruler_.width(number);
    }
  }

  // --- colour bars ---

  static std::shared_ptr<Bitmap> bar_bitmap(const ColorScale& scale, bool upright) {
    auto bitmap = std::make_shared<Bitmap>(Bitmap{upright ? 1 : kBarTexels, upright ? kBarTexels : 1, {}});
    for (int i = 0; i < kBarTexels; ++i) {
      const double place = (i + 0.5) / kBarTexels;
      const Vec3d srgb = srgb_from_linear(scale.at_place(upright ? 1 - place : place));
      for (int c = 0; c < 3; ++c)
        bitmap->rgb.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(srgb[c], 0.0, 1.0))));
    }
    return bitmap;
  }

  void draw_bar_right(const Cell& cell) {
    const Area bar{cell.picture.right() + kPad, cell.picture.top, kBarWidth, cell.picture.height};
    drawing_.add(Image{bar, bar_bitmap(*cell.scale, true)});
    frame(bar, kFrame, kFrameWidth);
    text({bar.right(), bar.top - 0.35 * ruler_.line_height()}, quantity(cell), Anchor::end);
    for (const Tick& t : cell.ticks) {
      const double y = bar.bottom() - cell.scale->place(t.value) * bar.height;
      drawing_.add(Line{{{bar.right(), y}, {bar.right() + kTick, y}}, false, kBlack, kFrameWidth});
      const double base = std::clamp(y + ruler_.ascent() / 2, bar.top + ruler_.ascent(), bar.bottom());
      text({bar.right() + kTick + 0.5, base}, number_text(t.text));
    }
  }

  void draw_bar_below(const Cell& cell, double top) {
    const Area bar{cell.picture.left, top + kPad, cell.picture.width, kBarWidth};
    drawing_.add(Image{bar, bar_bitmap(*cell.scale, false)});
    frame(bar, kFrame, kFrameWidth);
    const double base = bar.bottom() + kTick + 0.3 + ruler_.ascent();
    for (const Tick& t : cell.ticks) {
      const double x = bar.left + cell.scale->place(t.value) * bar.width;
      drawing_.add(Line{{{x, bar.bottom()}, {x, bar.bottom() + kTick}}, false, kBlack, kFrameWidth});
      const double half = ruler_.width(number_text(t.text)) / 2;
      text({std::clamp(x, bar.left + half, bar.right() - half), base}, number_text(t.text), Anchor::middle);
    }
    text({bar.left + bar.width / 2, base + ruler_.line_height()}, quantity(cell), Anchor::middle);
  }

  // --- insets and scale bars ---

  Area inset_area(const Cell& cell, const InsetSpec& inset) const {
    const Picture& p = cell.content->picture;
    const double width = inset.size * cell.picture.width;
    const double height = width * (inset.box[3] - inset.box[1]) * p.height / ((inset.box[2] - inset.box[0]) * p.width);
    const bool right = inset.corner.ends_with("right"), lower = inset.corner.starts_with("lower");
    return {right ? cell.picture.right() - width : cell.picture.left, lower ? cell.picture.bottom() - height : cell.picture.top,
            width, height};
  }

  void draw_inset(const Cell& cell, const Bitmap& bitmap, const InsetSpec& inset) {
    const Area area = inset_area(cell, inset);
    if (area.height > cell.picture.height)
      throw UsageError(
          fmt::format("{}: an inset of {:.3g} x {:.3g} mm is higher than its panel, {:.3g} mm; accepted: a smaller 'size'",
                      cell.spec->place, area.width, area.height, cell.picture.height));
    const Area box{cell.picture.left + inset.box[0] * cell.picture.width, cell.picture.top + inset.box[1] * cell.picture.height,
                   (inset.box[2] - inset.box[0]) * cell.picture.width, (inset.box[3] - inset.box[1]) * cell.picture.height};
    const Ink ink = ink_of(inset.color);
    // the whole picture, enlarged so that the box fills the inset: its lines too
    const double zoom = area.width / box.width;
    const Area whole{area.left - (box.left - cell.picture.left) * zoom, area.top - (box.top - cell.picture.top) * zoom,
                     cell.picture.width * zoom, cell.picture.height * zoom};
    join(box, area, ink);
    draw_part(bitmap, inset, area, whole);
    for (Line line : cell.content->lines) {
      for (Point& p : line.points) p = {whole.left + p.x * whole.width, whole.top + p.y * whole.height};
      drawing_.add(std::move(line), area);
    }
    frame(box, ink, 2 * kFrameWidth);
    frame(area, ink, 2 * kFrameWidth);
  }

  /// The pixels that the inset shows, whole ones; the inset's edges cut them.
  void draw_part(const Bitmap& bitmap, const InsetSpec& inset, const Area& area, const Area& whole) {
    const auto first = [](double part, int n) { return std::clamp(static_cast<int>(std::floor(part * n)), 0, n - 1); };
    const auto last = [](double part, int n) { return std::clamp(static_cast<int>(std::ceil(part * n)), 1, n); };
    const int x0 = first(inset.box[0], bitmap.width), x1 = last(inset.box[2], bitmap.width);
    const int y0 = first(inset.box[1], bitmap.height), y1 = last(inset.box[3], bitmap.height);
    auto part = std::make_shared<Bitmap>(Bitmap{x1 - x0, y1 - y0, {}});
    for (int y = y0; y < y1; ++y) {
      const auto row = bitmap.rgb.begin() + (static_cast<std::ptrdiff_t>(y) * bitmap.width + x0) * 3;
      part->rgb.insert(part->rgb.end(), row, row + (x1 - x0) * 3);
    }
    const double pixel_x = whole.width / bitmap.width, pixel_y = whole.height / bitmap.height;
    drawing_.add(
        Image{{whole.left + x0 * pixel_x, whole.top + y0 * pixel_y, part->width * pixel_x, part->height * pixel_y}, part}, area);
  }

  /// Lines between the corners of a box and its inset that cross neither: the two pairs on the outside.
  void join(const Area& box, const Area& inset, const Ink& ink) {
    const bool falls = (inset.left > box.left) == (inset.top < box.top);  // the inset lies to the upper right or the lower left
    const auto corner = [&](const Area& a, bool right, bool lower) {
      return Point{right ? a.right() : a.left, lower ? a.bottom() : a.top};
    };
    for (const bool right : {false, true}) {
      const bool lower = falls ? right : !right;
      drawing_.add(Line{{corner(box, right, lower), corner(inset, right, lower)}, false, ink, kFrameWidth});
    }
  }

  void draw_scale_bar(const Cell& cell) {
    const double length = *cell.spec->scale_bar / cell.content->world_width * cell.picture.width;
    const Point from{cell.picture.left + 2, cell.picture.bottom() - 2};
    const bool on_light = lightness(cell.content->background) > 50;
    const Ink rim = on_light ? Ink{1, 1, 1, 1} : Ink{0, 0, 0, 0.75}, ink = on_light ? kBlack : Ink{1, 1, 1, 1};
    drawing_.add(Line{{from, {from.x + length, from.y}}, false, rim, 1.1}, cell.picture);
    drawing_.add(Line{{from, {from.x + length, from.y}}, false, ink, 0.6}, cell.picture);
    const std::string label = printable(cell.spec->scale_label.empty() ? number_text(fmt::format("{:.4g}", *cell.spec->scale_bar))
                                                                       : cell.spec->scale_label);
    drawing_.add(Text{{from.x, from.y - 1.2}, label, ink, Anchor::start, false, rim}, cell.picture);
  }

  const FigureSpec& figure_;
  TextRuler ruler_;
  std::size_t columns_;
  std::vector<Cell> cells_;
  std::vector<double> bar_top_, key_top_, caption_top_;  ///< of rows
  Drawing drawing_;
};

}  // namespace

Drawing lay_out(const FigureSpec& figure, const std::vector<PanelContent>& panels) { return Layout(figure, panels).draw(); }

std::string figure_file(const FigureSpec& figure, const std::string& extension) {
  try {
    const TextRuler font(figure.font, figure.font_size);  // refused before anything is drawn
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", clipped(figure.file.string()), e.what()));
  }
  const Drawing drawing = lay_out(figure, make_panels(figure));
  if (extension == ".svg") return svg_file(drawing);
  return extension == ".pdf" ? pdf_file(drawing) : png_file(drawing, figure.dpi);
}

}  // namespace amrtex
