// What a plot shows, told once: as Vega-Lite for pages, as SVG for papers.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "structures/mesh/json.hpp"

namespace amrtex {

enum class AxisKind { linear, logarithmic, names };

struct PlotAxis {
  std::string title;  ///< with its unit in brackets
  AxisKind kind = AxisKind::linear;
  std::vector<std::string> names;  ///< kind names: the places are 0, 1, 2 ..., the first on top
};

inline constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

/// A point; what is not finite, or not above 0 on a logarithmic axis, is not drawn.
struct PlotMark {
  double x = kNoValue, y = kNoValue;
  double x_low = kNoValue, x_high = kNoValue;  ///< an interval along x
  std::string color, shape;                    ///< names of the legends; empty: none
  int point = -1;                              ///< of the report's points
};

/// Joined in their order.
struct PlotLine {
  std::string color;   ///< a name of the legend; empty: ink
  bool steps = false;  ///< level to the next x, then down
  bool dashed = false;
  std::vector<std::pair<double, double>> corners;
};

/// A piece of a bar that lies along x.
struct PlotBar {
  int place = 0;  ///< along y, which has names
  double from = 0, to = 0;
  std::string color;
  int point = -1;
};

struct Plot {
  std::string name;  ///< of its file, without extension
  std::string title;
  std::string note;  ///< a sentence below it
  PlotAxis x, y;
  std::string color_title, shape_title;
  std::vector<std::string> colors, shapes;  ///< names of the legends, in their order
  std::vector<std::size_t> color_places;    ///< of `colors` among all colours, so that a name keeps its own; empty: their order
  std::vector<PlotMark> marks;
  std::vector<PlotLine> lines;
  std::vector<PlotBar> bars;

  /// Of the i-th name of `colors`.
  std::string color_at(std::size_t i) const;
  bool empty() const { return marks.empty() && lines.empty() && bars.empty(); }
};

/// Eight colours that people who see no red or no green tell apart (Okabe and Ito 2008, with a gray for their black); then again
/// from the first.
std::string plot_color(std::size_t place);
/// Eight names of Vega's shapes.
std::string plot_shape(std::size_t place);

/// Vega-Lite 6 with its data, without a theme: as wide as what holds it. Marks carry the number of their point as `point`.
Json to_vega_lite(const Plot& plot);
/// A file of its own, 720 pixels wide, black on white.
std::string to_svg(const Plot& plot);
/// For XML and HTML, in text and between quotes.
std::string escape_markup(std::string_view text);

}  // namespace amrtex
