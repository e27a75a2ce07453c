#include "bench/report/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "bench/report/diagram.hpp"

namespace amrtex {
namespace {

constexpr std::array<const char*, 8> kColors = {"#7f7f7f", "#0072B2", "#D55E00", "#009E73",
                                                "#CC79A7", "#56B4E9", "#E69F00", "#8c6d31"};
constexpr std::array<const char*, 8> kShapes = {"circle",        "square", "triangle-up",   "diamond",
                                                "triangle-down", "cross",  "triangle-left", "triangle-right"};

/// Six digits are more than a screen shows; null where there is none.
Json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::stod(fmt::format("{:.6g}", value));
}

bool drawn_on(const PlotAxis& axis, double value) {
  return std::isfinite(value) && (axis.kind != AxisKind::logarithmic || value > 0);
}

Json axis_json(const PlotAxis& axis, const char* field) {
  Json json = {{"field", field}, {"type", "quantitative"}, {"title", axis.title.empty() ? Json() : Json(axis.title)}};
  if (axis.kind == AxisKind::logarithmic)
    json["scale"] = {{"type", "log"}, {"nice", false}, {"padding", 12}};
  else if (axis.kind == AxisKind::linear)
    json["scale"] = {{"zero", true}, {"nice", true}};
  if (axis.kind == AxisKind::logarithmic) json["axis"] = {{"labelOverlap", true}, {"tickCount", 6}};
  return json;
}

/// Names stand for places; an ordinal axis of places, so that two rows of one name stay two.
Json names_json(const PlotAxis& axis, const char* field) {
  Json places = Json::array();
  for (std::size_t i = 0; i < axis.names.size(); ++i) places.push_back(i);
  return {{"field", field},
          {"type", "ordinal"},
          {"title", axis.title.empty() ? Json() : Json(axis.title)},
          {"scale", {{"domain", places}}},
          {"axis", {{"labelExpr", "names[datum.value]"}, {"labelLimit", 260}, {"grid", true}}}};
}

Json y_json(const Plot& plot, const char* field) {
  return plot.y.kind == AxisKind::names ? names_json(plot.y, field) : axis_json(plot.y, field);
}

Json legend(const char* field, const std::string& title, const std::vector<std::string>& names, const Json& range) {
  return {{"field", field},
          {"type", "nominal"},
          {"title", title.empty() ? Json() : Json(title)},
          {"scale", {{"domain", names}, {"range", range}}}};
}

Json colors_json(const Plot& plot) {
  Json range = Json::array();
  for (std::size_t i = 0; i < plot.colors.size(); ++i) range.push_back(plot.color_at(i));
  return legend("color", plot.color_title, plot.colors, range);
}

Json shapes_json(const Plot& plot) {
  Json range = Json::array();
  for (std::size_t i = 0; i < plot.shapes.size(); ++i) range.push_back(plot_shape(i));
  return legend("shape", plot.shape_title, plot.shapes, range);
}

Json mark_values(const Plot& plot) {
  Json values = Json::array();
  for (const PlotMark& m : plot.marks) {
    if (!drawn_on(plot.x, m.x) || !drawn_on(plot.y, m.y)) continue;
    Json v = {{"x", rounded(m.x)}, {"y", rounded(m.y)}};
    if (drawn_on(plot.x, m.x_low) && drawn_on(plot.x, m.x_high)) {
      v["low"] = rounded(m.x_low);
      v["high"] = rounded(m.x_high);
    }
    if (!m.color.empty()) v["color"] = m.color;
    if (!m.shape.empty()) v["shape"] = m.shape;
    if (m.point >= 0) v["point"] = m.point;
    values.push_back(std::move(v));
  }
  return values;
}

Json marks_layer(const Plot& plot) {
  Json encoding = {{"x", axis_json(plot.x, "x")}, {"y", y_json(plot, "y")}};
  if (!plot.colors.empty()) encoding["color"] = colors_json(plot);
  if (!plot.shapes.empty()) encoding["shape"] = shapes_json(plot);
  encoding["tooltip"] = {{"field", "point"}, {"type", "quantitative"}};
  return {{"name", "marks"},
          {"data", {{"values", mark_values(plot)}}},
          {"mark", {{"type", "point"}, {"filled", true}, {"size", 60}, {"opacity", 0.9}, {"cursor", "pointer"}}},
          {"encoding", encoding}};
}

bool has_intervals(const Plot& plot) {
  return std::any_of(plot.marks.begin(), plot.marks.end(),
                     [](const PlotMark& m) { return std::isfinite(m.x_low) && std::isfinite(m.x_high); });
}

Json intervals_layer(const Plot& plot) {
  Json encoding = {{"x", axis_json(plot.x, "low")}, {"x2", {{"field", "high"}}}, {"y", y_json(plot, "y")}};
  if (!plot.colors.empty()) encoding["color"] = colors_json(plot);
  return {{"data", {{"values", mark_values(plot)}}},
          {"transform", Json::array({Json{{"filter", "isValid(datum.low)"}}})},
          {"mark", {{"type", "rule"}, {"opacity", 0.35}}},
          {"encoding", encoding}};
}

Json line_values(const Plot& plot, std::size_t i) {
  Json values = Json::array();
  std::size_t order = 0;
  for (const auto& [x, y] : plot.lines[i].corners)
    if (drawn_on(plot.x, x) && drawn_on(plot.y, y)) {
      Json v = {{"x", rounded(x)}, {"y", rounded(y)}, {"line", i}, {"order", order++}};
      if (!plot.lines[i].color.empty()) v["color"] = plot.lines[i].color;
      values.push_back(std::move(v));
    }
  return values;
}

/// Lines that look alike are one layer.
Json lines_layer(const Plot& plot, bool steps, bool dashed, bool ink) {
  Json values = Json::array();
  for (std::size_t i = 0; i < plot.lines.size(); ++i) {
    const PlotLine& line = plot.lines[i];
    if (line.steps != steps || line.dashed != dashed || line.color.empty() != ink) continue;
    for (Json& v : line_values(plot, i)) values.push_back(std::move(v));
  }
  if (values.empty()) return nullptr;
  Json mark = {{"type", "line"}, {"strokeWidth", steps ? 1.5 : 1.25}, {"opacity", 0.7}, {"style", ink ? "ink-line" : "line"}};
  if (steps) mark["interpolate"] = "step-after";
  if (dashed) mark["strokeDash"] = {5, 4};
  Json encoding = {{"x", axis_json(plot.x, "x")},
                   {"y", y_json(plot, "y")},
                   {"detail", {{"field", "line"}, {"type", "nominal"}}},
                   {"order", {{"field", "order"}, {"type", "quantitative"}}}};
  if (!ink) encoding["color"] = colors_json(plot);
  return {{"data", {{"values", values}}}, {"mark", mark}, {"encoding", encoding}};
}

Json bars_layer(const Plot& plot) {
  Json values = Json::array();
  for (const PlotBar& bar : plot.bars) {
    Json v = {{"y", bar.place}, {"from", rounded(bar.from)}, {"to", rounded(bar.to)}, {"color", bar.color}};
    if (bar.point >= 0) v["point"] = bar.point;
    values.push_back(std::move(v));
  }
  return {{"data", {{"values", values}}},
          {"mark", {{"type", "bar"}, {"cursor", "pointer"}}},
          {"encoding",
           {{"x", axis_json(plot.x, "from")},
            {"x2", {{"field", "to"}}},
            {"y", names_json(plot.y, "y")},
            {"color", colors_json(plot)},
            {"tooltip", {{"field", "point"}, {"type", "quantitative"}}}}}};
}

}  // namespace

std::string plot_color(std::size_t place) { return kColors[place % kColors.size()]; }

std::string Plot::color_at(std::size_t i) const { return plot_color(i < color_places.size() ? color_places[i] : i); }

std::string plot_shape(std::size_t place) { return kShapes[place % kShapes.size()]; }

std::string escape_markup(std::string_view text) {
  std::string escaped;
  for (const char c : text) switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  return escaped;
}

Json to_vega_lite(const Plot& plot) {
  Json layers = Json::array();
  if (!plot.bars.empty()) layers.push_back(bars_layer(plot));
  if (has_intervals(plot)) layers.push_back(intervals_layer(plot));
  for (const bool steps : {false, true})
    for (const bool dashed : {false, true})
      for (const bool ink : {false, true})
        if (Json layer = lines_layer(plot, steps, dashed, ink); !layer.is_null()) layers.push_back(std::move(layer));
  if (!plot.marks.empty()) layers.push_back(marks_layer(plot));
  Json json = {{"$schema", kVegaLite},
               {"description", plot.title},
               {"width", "container"},
               {"layer", layers},
               {"autosize", {{"type", "fit-x"}, {"contains", "padding"}}}};
  if (plot.y.kind == AxisKind::names) {
    json["height"] = 18 * plot.y.names.size();  // in steps, Vega-Lite would not fit the width
    json["params"] = Json::array({Json{{"name", "names"}, {"value", plot.y.names}}});
  } else {
    json["height"] = 300;
  }
  return json;
}

}  // namespace amrtex
