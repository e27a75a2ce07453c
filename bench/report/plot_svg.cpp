// Plots as SVG: no program is needed to draw them, and papers take them as they are.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bench/report/plot.hpp"
#include "renderers/scene/ticks.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kWidth = 720;
constexpr double kTop = 44, kBelow = 52, kRight = 170;  // room for title, x axis and legends
constexpr double kRow = 18;                             // of a named place
constexpr const char* kInk = "#1f2430";
constexpr const char* kFaint = "#5b6472";
constexpr const char* kGrid = "#e3e6eb";
constexpr int kMostTicks = 8;

/// Letters are about so wide, in parts of their size.
constexpr double kLetter = 0.56;

std::string shown_name(const std::string& text, std::size_t most) { return escape_markup(clipped(text, most)); }

std::size_t letters(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

/// Values to pixels along one axis.
class Scale {
 public:
  Scale(const PlotAxis& axis, double low, double high, double first, double last)
      : logarithmic_(axis.kind == AxisKind::logarithmic), low_(low), high_(high), first_(first), last_(last) {
    if (axis.kind == AxisKind::names) return;
    if (!(low_ < high_)) {  // one value, or none: room on both sides
      const double middle = std::isfinite(low_) ? low_ : 1;
      low_ = logarithmic_ ? middle / 2 : middle - 1;
      high_ = logarithmic_ ? middle * 2 : middle + 1;
    }
    const double room = 0.04 * (at(high_) - at(low_));
    low_ = logarithmic_ ? std::pow(10, at(low_) - room) : low_ == 0 ? 0 : low_ - room;
    high_ = logarithmic_ ? std::pow(10, at(high_) + room) : high_ + room;
    ticks_ = ticks(low_, high_, logarithmic_, kMostTicks);
  }
  double pixel(double value) const { return first_ + (at(value) - at(low_)) / (at(high_) - at(low_)) * (last_ - first_); }
  bool draws(double value) const { return std::isfinite(value) && (!logarithmic_ || value > 0); }
  const std::vector<Tick>& marks() const { return ticks_; }

 private:
  double at(double value) const { return logarithmic_ ? std::log10(value) : value; }

  bool logarithmic_;
  double low_, high_, first_, last_;
  std::vector<Tick> ticks_;
};

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void add(const PlotAxis& axis, double value) {
    if (!std::isfinite(value) || (axis.kind == AxisKind::logarithmic && !(value > 0))) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

std::string shape_path(const std::string& shape, double x, double y, double r) {
  if (shape == "square") return fmt::format("M{:.2f} {:.2f}h{:.2f}v{:.2f}h{:.2f}z", x - r, y - r, 2 * r, 2 * r, -2 * r);
  if (shape == "diamond")
    return fmt::format("M{:.2f} {:.2f}l{:.2f} {:.2f}l{:.2f} {:.2f}l{:.2f} {:.2f}z", x, y - 1.3 * r, 1.3 * r, 1.3 * r, -1.3 * r,
                       1.3 * r, -1.3 * r, -1.3 * r);
  if (shape == "cross") {
    const double a = 0.4 * r, b = 1.2 * r - a;
    return fmt::format("M{:.2f} {:.2f}h{:.2f}v{:.2f}h{:.2f}v{:.2f}h{:.2f}v{:.2f}h{:.2f}v{:.2f}h{:.2f}v{:.2f}h{:.2f}z", x - a,
                       y - a - b, 2 * a, b, b, 2 * a, -b, b, -2 * a, -b, -b, -2 * a, b);
  }
  if (shape == "triangle-up" || shape == "triangle-down") {
    const double s = shape == "triangle-up" ? 1 : -1;
    return fmt::format("M{:.2f} {:.2f}L{:.2f} {:.2f}L{:.2f} {:.2f}z", x, y - 1.2 * s * r, x + 1.2 * r, y + s * r, x - 1.2 * r,
                       y + s * r);
  }
  if (shape == "triangle-left" || shape == "triangle-right") {
    const double s = shape == "triangle-left" ? 1 : -1;
    return fmt::format("M{:.2f} {:.2f}L{:.2f} {:.2f}L{:.2f} {:.2f}z", x - 1.2 * s * r, y, x + s * r, y - 1.2 * r, x + s * r,
                       y + 1.2 * r);
  }
  return fmt::format("M{:.2f} {:.2f}a{:.2f} {:.2f} 0 1 0 {:.2f} 0a{:.2f} {:.2f} 0 1 0 {:.2f} 0z", x - r, y, r, r, 2 * r, r, r,
                     -2 * r);
}

std::size_t place_of(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// A plot that is being drawn.
class Drawing {
 public:
  explicit Drawing(const Plot& plot)
      : plot_(plot),
        named_(plot.y.kind == AxisKind::names),
        left_(named_ ? left_of_names() : 76),
        height_(named_ ? kRow * static_cast<double>(plot.y.names.size()) : 340),
        x_(x_scale()),
        y_(y_scale()) {}

  std::string text() {
    const double whole = kTop + height_ + kBelow + (plot_.note.empty() ? 0 : 20);
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
        "font-family=\"Helvetica, Arial, sans-serif\" font-size=\"12\" fill=\"{2}\">\n<title>{3}</title>\n"
        "<rect width=\"{0:.0f}\" height=\"{1:.0f}\" fill=\"#ffffff\"/>\n",
        kWidth, whole, kInk, escape_markup(printable(plot_.title)));
    svg += label(left_, 22, plot_.title, "start", 14, kInk, 90);
    svg += frame() + bars() + lines() + marks() + legends();
    if (!plot_.note.empty()) svg += label(14, whole - 10, plot_.note, "start", 11, kFaint, 125);
    return svg + "</svg>\n";
  }

 private:
  double right() const { return kWidth - kRight; }
  double bottom() const { return kTop + height_; }

  double left_of_names() const {
    std::size_t longest = 4;
    for (const std::string& name : plot_.y.names) longest = std::max(longest, std::min<std::size_t>(letters(name), 44));
    return 20 + 11 * kLetter * static_cast<double>(longest);
  }

  Scale x_scale() const {
    Range range;
    for (const PlotMark& m : plot_.marks) {
      range.add(plot_.x, m.x);
      range.add(plot_.x, m.x_low);
      range.add(plot_.x, m.x_high);
    }
    for (const PlotLine& line : plot_.lines)
      for (const auto& corner : line.corners) range.add(plot_.x, corner.first);
    for (const PlotBar& bar : plot_.bars) {
      range.add(plot_.x, bar.from);
      range.add(plot_.x, bar.to);
    }
    if (plot_.x.kind == AxisKind::linear) range.add(plot_.x, 0);
    return {plot_.x, range.low, range.high, left_, right()};
  }
  Scale y_scale() const {
    if (named_) return {plot_.y, -0.5, static_cast<double>(plot_.y.names.size()) - 0.5, kTop, bottom()};
    Range range;
    for (const PlotMark& m : plot_.marks) range.add(plot_.y, m.y);
    for (const PlotLine& line : plot_.lines)
      for (const auto& corner : line.corners) range.add(plot_.y, corner.second);
    if (plot_.y.kind == AxisKind::linear) range.add(plot_.y, 0);
    return {plot_.y, range.low, range.high, bottom(), kTop};
  }

  static std::string label(double x, double y, const std::string& text, const char* anchor, int size = 12,
                           const char* fill = kInk, std::size_t most = 60) {
    return fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"{}\" font-size=\"{}\" fill=\"{}\">{}</text>\n", x, y,
                       anchor, size, fill, shown_name(text, most));
  }
  static std::string rule(double x0, double y0, double x1, double y1, const std::string& stroke, double width) {
    return fmt::format("<line x1=\"{:.2f}\" y1=\"{:.2f}\" x2=\"{:.2f}\" y2=\"{:.2f}\" stroke=\"{}\" stroke-width=\"{}\"/>\n", x0,
                       y0, x1, y1, stroke, width);
  }
  std::string color_of(const std::string& name) const {
    return name.empty() || plot_.colors.empty() ? kInk : plot_.color_at(place_of(plot_.colors, name));
  }

  std::string frame() const {
    std::string svg;
    for (const Tick& t : x_.marks()) {
      svg += rule(x_.pixel(t.value), kTop, x_.pixel(t.value), bottom(), kGrid, 1);
      svg += label(x_.pixel(t.value), bottom() + 17, t.text, "middle", 11, kFaint);
    }
    for (const Tick& t : y_.marks()) {
      svg += rule(left_, y_.pixel(t.value), right(), y_.pixel(t.value), kGrid, 1);
      svg += label(left_ - 7, y_.pixel(t.value) + 4, t.text, "end", 11, kFaint);
    }
    for (std::size_t i = 0; named_ && i < plot_.y.names.size(); ++i)
      svg += label(left_ - 7, y_.pixel(static_cast<double>(i)) + 4, plot_.y.names[i], "end", 11, kInk, 44);
    svg += rule(left_, bottom(), right(), bottom(), kFaint, 1) + rule(left_, kTop, left_, bottom(), kFaint, 1);
    svg += label((left_ + right()) / 2, bottom() + 38, plot_.x.title, "middle");
    if (!plot_.y.title.empty() && !named_)
      svg +=
          fmt::format("<text transform=\"translate(16 {:.2f}) rotate(-90)\" text-anchor=\"middle\" font-size=\"12\">{}</text>\n",
                      (kTop + bottom()) / 2, shown_name(plot_.y.title, 60));
    return svg;
  }

  std::string bars() const {
    std::string svg;
    for (const PlotBar& bar : plot_.bars) {
      const double from = x_.pixel(bar.from), to = x_.pixel(bar.to), y = y_.pixel(bar.place);
      svg += fmt::format("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>\n", from, y - 6,
                         std::max(0.0, to - from), 12.0, color_of(bar.color));
    }
    return svg;
  }

  std::string lines() const {
    std::string svg;
    for (const PlotLine& line : plot_.lines) {
      std::string path;
      double last = 0;
      for (const auto& [x, y] : line.corners) {
        if (!x_.draws(x) || !y_.draws(y)) continue;
        if (!path.empty() && line.steps) path += fmt::format("L{:.2f} {:.2f}", x_.pixel(x), last);
        last = y_.pixel(y);
        path += fmt::format("{}{:.2f} {:.2f}", path.empty() ? "M" : "L", x_.pixel(x), last);
      }
      svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\" opacity=\"0.8\"{}/>\n", path,
                         color_of(line.color), line.dashed ? " stroke-dasharray=\"5 4\"" : "");
    }
    return svg;
  }

  std::string marks() const {
    std::string svg;
    for (const PlotMark& m : plot_.marks) {
      if (!x_.draws(m.x) || !y_.draws(m.y)) continue;
      const double x = x_.pixel(m.x), y = y_.pixel(m.y);
      const std::string color = color_of(m.color);
      if (x_.draws(m.x_low) && x_.draws(m.x_high)) svg += rule(x_.pixel(m.x_low), y, x_.pixel(m.x_high), y, color, 1);
      const std::string shape = m.shape.empty() ? "circle" : plot_shape(place_of(plot_.shapes, m.shape));
      svg += fmt::format("<path d=\"{}\" fill=\"{}\" fill-opacity=\"0.85\"/>\n", shape_path(shape, x, y, 3.4), color);
    }
    return svg;
  }

  std::string legends() const {
    std::string svg;
    double y = kTop + 8;
    const double x = right() + 18;
    const auto list = [&](const std::string& title, const std::vector<std::string>& names, bool shapes) {
      if (names.empty()) return;
      if (!title.empty()) svg += label(x - 5, y, title, "start", 12, kFaint, 24);
      if (!title.empty()) y += 18;
      for (std::size_t i = 0; i < names.size(); ++i, y += 17) {
        svg += fmt::format("<path d=\"{}\" fill=\"{}\"/>\n", shape_path(shapes ? plot_shape(i) : "circle", x, y - 4, 4),
                           shapes ? kFaint : plot_.color_at(i));
        svg += label(x + 10, y, names[i], "start", 11, kInk, 24);
      }
      y += 10;
    };
    list(plot_.color_title, plot_.colors, plot_.shapes == plot_.colors);
    if (plot_.shapes != plot_.colors) list(plot_.shape_title, plot_.shapes, true);
    return svg;
  }

  const Plot& plot_;
  bool named_;
  double left_, height_;
  Scale x_, y_;
};

}  // namespace

std::string to_svg(const Plot& plot) { return Drawing(plot).text(); }

}  // namespace amrtex
