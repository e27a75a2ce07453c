#include "bench/report/page/page_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "bench/report/contexts.hpp"
#include "bench/report/diagram.hpp"
#include "bench/report/report.hpp"
#include "structures/common/encoding.hpp"
#include "structures/mesh/filter.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

constexpr double kMebibyte = 1048576.0;
constexpr std::size_t kMostBars = 40;

bool is_ok(const Json& record) { return text_at(record, "/status") == "ok"; }

double mebibytes_of(const Json& record) { return number_at(record, "/memory/total_bytes") / kMebibyte; }

int number_of(const PointNumbers& numbers, const Json* record) {
  const auto found = numbers.find(record);
  return found == numbers.end() ? -1 : found->second;
}

/// A JSON value as a key; text that is no UTF-8 does not matter.
std::string key_text(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Texts at a pointer in the given order, others behind by name.
std::vector<std::string> names_at(const Records& records, const char* pointer, const std::vector<std::string>& order) {
  std::set<std::string> seen;
  for (const Json* record : records)
    if (is_ok(*record)) seen.insert(text_at(*record, pointer));
  seen.erase("");
  std::vector<std::string> names;
  for (const std::string& name : order)
    if (seen.erase(name) > 0) names.push_back(name);
  names.insert(names.end(), seen.begin(), seen.end());
  return names;
}

std::vector<std::string> filters_in_order(const Records& records) {
  std::vector<std::string> order;
  for (const Filter filter : all_filters()) order.emplace_back(filter_name(filter));
  return names_at(records, "/filter", order);
}

/// Encodings keep their colours from plot to plot.
void color_by_encoding(Plot& plot, const Records& records) {
  const auto known = all_encodings();
  plot.color_title = "encoding";
  plot.colors = encodings_in_order(records);
  for (const std::string& name : plot.colors) {
    const auto place = std::find_if(known.begin(), known.end(), [&](const Encoding* e) { return e->name() == name; });
    plot.color_places.push_back(static_cast<std::size_t>(place - known.begin()));
  }
}

/// A key as a part of a JSON pointer.
std::string pointer_part(const std::string& key) {
  std::string part;
  for (const char c : key) part += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return part;
}

// --- fronts ---

/// Exact pictures have no place on a logarithmic axis: they lie below all others.
double exact_place(const ComparedScene& scene, const SceneFacts& facts) {
  double least = 1;
  for (const Json* record : scene.records)
    if (const double share = share_of_peak(*record, error_pointer(facts.common)); share > 0) least = std::min(least, share);
  return least / 2;
}

Plot front_plot(const ComparedScene& scene, const SceneFacts& facts, const PointNumbers& numbers, bool bytes) {
  Plot plot;
  plot.title = bytes ? "Error against bytes" : "Error against frame time";
  plot.x = {bytes ? "structure (MiB)" : "frame, wall (ms)", AxisKind::logarithmic, {}};
  plot.y = {"RMSE / peak (0.01 is 40 dB)", AxisKind::logarithmic, {}};
  plot.shape_title = "filter";
  color_by_encoding(plot, scene.records);
  plot.shapes = filters_in_order(scene.records);
  const double exact = exact_place(scene, facts);
  std::size_t exact_ones = 0;
  std::vector<double> place(scene.records.size(), kNoValue);
  for (std::size_t i = 0; i < scene.records.size(); ++i) {
    const Json& r = *scene.records[i];
    const double share = share_of_peak(r, error_pointer(facts.common)), x = bytes ? mebibytes_of(r) : time_of(r);
    if (!is_ok(r) || !std::isfinite(share) || !std::isfinite(x)) continue;
    if (share == 0) ++exact_ones;
    place[i] = share > 0 ? share : exact;
    PlotMark mark{x, place[i], kNoValue, kNoValue, text_at(r, "/encoding"), text_at(r, "/filter"), number_of(numbers, &r)};
    if (!bytes) {
      mark.x_low = number_at(r, "/frame/wall_ms/ci95/0");
      mark.x_high = number_at(r, "/frame/wall_ms/ci95/1");
    }
    plot.marks.push_back(std::move(mark));
  }
  PlotLine line{"", true, false, {}};
  for (const std::size_t i : bytes ? facts.byte_front : facts.time_front)
    line.corners.emplace_back(bytes ? mebibytes_of(*scene.records[i]) : time_of(*scene.records[i]), place[i]);
  if (!line.corners.empty()) plot.lines.push_back(std::move(line));
  plot.note = bytes
                  ? "Left and down is better. The line joins what no other setting beats."
                  : "Left and down is better. The line joins what no other setting beats; bars are the intervals of the medians.";
  if (exact_ones > 0) plot.note += fmt::format(" {} exact, drawn below the others.", exact_ones);
  return plot;
}

// --- curves over a build parameter ---

/// Numeric build parameters of at least three values.
std::vector<std::string> varied_parameters(const Records& records) {
  std::map<std::string, std::set<double>> values;
  for (const Json* record : records)
    if (const Json& parameters = value_at(*record, "/build_parameters"); is_ok(*record) && parameters.is_object())
      for (const auto& [key, value] : parameters.items())
        if (value.is_number()) values[key].insert(value.get<double>());
  std::vector<std::string> varied;
  for (const auto& [key, seen] : values)
    if (seen.size() >= 3) varied.push_back(key);
  return varied;
}

/// Everything that a setting is, but for what is traded away by the caller.
std::string setting_key(const Json& record) {
  Json key = Json::array();
  for (const char* pointer : {"/encoding", "/build_parameters", "/filter", "/storage", "/filtering", "/render"})
    key.push_back(value_at(record, pointer));
  return key_text(key);
}

Plot parameter_plot(const ComparedScene& scene, const PointNumbers& numbers, const std::string& parameter, bool bytes) {
  Plot plot;
  plot.title = fmt::format("{} against {}", bytes ? "Bytes" : "Frame time", parameter);
  plot.x = {parameter, AxisKind::logarithmic, {}};
  plot.y = {bytes ? "structure (MiB)" : "frame, wall (ms)", AxisKind::logarithmic, {}};
  plot.shape_title = "filter";
  std::map<std::string, std::map<double, const Json*>> curves;  // the value of the parameter -> the record
  Records shown;
  for (const Json* record : scene.records) {
    const double value = number_at(*record, "/build_parameters/" + pointer_part(parameter));
    const double cost = bytes ? mebibytes_of(*record) : time_of(*record);
    if (!is_ok(*record) || !std::isfinite(value) || !std::isfinite(cost)) continue;
    Json rest = *record;
    rest["build_parameters"].erase(parameter);
    curves[setting_key(rest)].try_emplace(value, record);
    shown.push_back(record);
  }
  color_by_encoding(plot, shown);
  plot.shapes = filters_in_order(shown);
  for (const auto& [key, curve] : curves) {
    if (curve.size() < 2) continue;
    PlotLine line{text_at(*curve.begin()->second, "/encoding"), false, false, {}};
    for (const auto& [value, record] : curve) {
      const double cost = bytes ? mebibytes_of(*record) : time_of(*record);
      line.corners.emplace_back(value, cost);
      plot.marks.push_back(
          {value, cost, kNoValue, kNoValue, line.color, text_at(*record, "/filter"), number_of(numbers, record)});
    }
    plot.lines.push_back(std::move(line));
  }
  plot.note = fmt::format("A line joins settings that differ in {} alone.", parameter);
  return plot;
}

// --- bytes by role ---

constexpr std::array<const char*, 4> kRoles = {"payload", "duplicated", "topology", "padding"};

/// One record of each structure, the smallest first: what is rendered does not change bytes.
Records structures_of(const Records& records) {
  std::map<std::string, const Json*> by_structure;
  for (const Json* record : records) {
    if (!is_ok(*record) || !std::isfinite(mebibytes_of(*record))) continue;
    Json key = Json::array();
    for (const char* pointer : {"/encoding", "/build_parameters", "/filter", "/storage", "/memory/by_role"})
      key.push_back(value_at(*record, pointer));
    by_structure.try_emplace(key_text(key), record);
  }
  Records list;
  for (const auto& [key, record] : by_structure) list.push_back(record);
  std::stable_sort(list.begin(), list.end(), [](const Json* a, const Json* b) { return mebibytes_of(*a) < mebibytes_of(*b); });
  return list;
}

Plot memory_plot(const ComparedScene& scene, const PointNumbers& numbers) {
  Plot plot;
  plot.title = "Bytes by role";
  plot.x = {"MiB", AxisKind::linear, {}};
  plot.y.kind = AxisKind::names;
  plot.color_title = "role";
  plot.colors = {"payload", "duplicated", "topology", "padding"};
  plot.color_places = {1, 6, 3, 0};  // blue, orange, green, gray
  Records list = structures_of(scene.records);
  const std::size_t all = list.size();
  if (all > kMostBars) list.resize(kMostBars);
  const std::vector<std::string> names = setting_texts(list);
  for (std::size_t i = 0; i < list.size(); ++i) {
    plot.y.names.push_back(names[i]);
    double from = 0;
    for (const char* role : kRoles) {
      const double size = number_at(*list[i], std::string("/memory/by_role/") + role) / kMebibyte;
      if (!(size > 0)) continue;
      plot.bars.push_back({static_cast<int>(i), from, from + size, role, number_of(numbers, list[i])});
      from += size;
    }
  }
  plot.note =
      "Payload: one texel a cell of the structure. Duplicated: borders. Topology: tables, ranges, validity. Padding: unused "
      "texels.";
  if (all > list.size()) plot.note = fmt::format("The {} smallest of {} structures. ", list.size(), all) + plot.note;
  return plot;
}

// --- error by cause ---

Plot cause_plot(const ComparedScene& scene, const PointNumbers& numbers) {
  constexpr std::array<const char*, 8> causes = {"step",   "encoding",  "storage",   "arithmetic",
                                                 "driver", "filtering", "early_end", "level_of_detail"};
  Plot plot;
  plot.title = "Error by cause";
  plot.x = {"RMSE of the difference that a cause makes", AxisKind::logarithmic, {}};
  plot.y.kind = AxisKind::names;
  plot.color_title = "cause";
  Records list;
  for (const Json* record : scene.records)
    if (is_ok(*record) && value_at(*record, "/error/split").is_object()) list.push_back(record);
  const std::size_t all = list.size();
  if (all > kMostBars) list.resize(kMostBars);
  const std::vector<std::string> names = setting_texts(list);
  std::set<std::string> seen;
  for (std::size_t i = 0; i < list.size(); ++i) {
    plot.y.names.push_back(names[i]);
    for (const char* cause : causes) {
      const double rmse = number_at(*list[i], fmt::format("/error/split/{}/rmse", cause));
      if (!(rmse > 0)) continue;
      seen.insert(cause);
      plot.marks.push_back({rmse, static_cast<double>(i), kNoValue, kNoValue, cause, cause, number_of(numbers, list[i])});
    }
  }
  for (const char* cause : causes)
    if (seen.contains(cause)) plot.colors.emplace_back(cause);
  plot.shapes = plot.colors;
  plot.note =
      "Each cause is let in after the other; with their signs the differences add up to the whole error. A cause that makes none "
      "has no mark.";
  if (all > list.size()) plot.note = fmt::format("{} of {} settings. ", list.size(), all) + plot.note;
  return plot;
}

// --- cost against the size of the mesh ---

struct Measure {
  const char* title;
  const char* axis;
  const char* column;
  double (*of)(const Json&);
  bool rendered;  ///< does it depend on what is drawn?
};

double build_of(const Json& record) { return number_at(record, "/build_seconds"); }

constexpr Measure kMeasures[] = {{"Build against mesh size", "build (s)", "build", build_of, false},
                                 {"Bytes against mesh size", "structure (MiB)", "bytes", mebibytes_of, false},
                                 {"Frame time against mesh size", "frame, wall (ms)", "frame", time_of, true}};

/// A record without what says which mesh it is of, and, for what does not depend on it, which picture.
Json without_mesh(const Json& record, bool rendered) {
  Json rest;
  for (const char* key : {"experiment", "encoding", "build_parameters", "filter", "storage", "filtering", "render", "context"})
    rest[key] = record.contains(key) ? record[key] : Json();
  if (rest["build_parameters"].is_object() && rest["encoding"] == "uniform")
    rest["build_parameters"].erase("level");  // the finest one of each mesh
  if (!rendered)
    rest["render"] = nullptr;
  else if (rest["render"].is_object())
    for (const char* key : {"view", "view_name", "transfer_function", "transfer_function_name", "isovalues"})
      rest["render"].erase(key);
  return rest;
}

struct SizedGroup {
  Json setting;
  std::map<double, std::vector<const Json*>> by_cells;
};

std::vector<SizedGroup> sized_groups(std::span<const Json> records, const Measure& measure) {
  std::map<std::string, SizedGroup> groups;
  for (const Json& record : records) {
    const double cells = number_at(record, "/dataset/leaf_cells"), cost = measure.of(record);
    if (!is_ok(record) || !(cells > 0) || !(cost > 0) || !std::isfinite(cost)) continue;
    Json setting = without_mesh(record, measure.rendered);
    Json key = setting;
    key.erase("context");
    SizedGroup& group = groups[key_text(key) + key_text(value_at(record, "/context/renderer"))];
    if (group.by_cells.empty()) group.setting = std::move(setting);
    group.by_cells[cells].push_back(&record);
  }
  std::vector<SizedGroup> list;
  for (auto& [key, group] : groups)
    if (group.by_cells.size() >= 3) list.push_back(std::move(group));
  return list;
}

struct PowerLaw {
  double exponent, error, factor;  ///< cost = factor * cells^exponent; a standard error, nothing of three meshes on one line
};

std::optional<PowerLaw> fit(const std::vector<std::pair<double, double>>& points) {
  std::vector<double> x, y;
  for (const auto& [cells, cost] : points) {
    x.push_back(std::log10(cells));
    y.push_back(std::log10(cost));
  }
  const auto line = fit_line(x, y);
  if (!line) return std::nullopt;
  const double r2 = line->correlation * line->correlation;
  const double error = r2 > 0 ? std::abs(line->slope) * std::sqrt((1 / r2 - 1) / (static_cast<double>(x.size()) - 2)) : kNoValue;
  return PowerLaw{line->slope, error, std::pow(10, line->at_zero)};
}

/// Of each mesh the middle of what was measured on it.
std::vector<std::pair<double, double>> medians(const SizedGroup& group, const Measure& measure) {
  std::vector<std::pair<double, double>> points;
  for (const auto& [cells, records] : group.by_cells) {
    std::vector<double> costs;
    for (const Json* record : records) costs.push_back(measure.of(*record));
    points.emplace_back(cells, median(costs));
  }
  return points;
}

/// A row a setting and measure.
struct ExponentRow {
  const Json* setting;
  const char* column;
  std::size_t meshes;
  double least, most;
  PowerLaw law;
};

Plot size_plot(const Measure& measure, const std::vector<SizedGroup>& groups, const PointNumbers& numbers,
               std::vector<ExponentRow>& rows) {
  Plot plot;
  plot.title = measure.title;
  plot.x = {"leaf cells", AxisKind::logarithmic, {}};
  plot.y = {measure.axis, AxisKind::logarithmic, {}};
  Records shown;
  for (const SizedGroup& group : groups) {
    const auto points = medians(group, measure);
    const std::string encoding = text_at(group.setting, "/encoding");
    for (const auto& [cells, cost] : points)
      plot.marks.push_back({cells, cost, kNoValue, kNoValue, encoding, "", number_of(numbers, group.by_cells.at(cells).front())});
    shown.push_back(group.by_cells.begin()->second.front());
    const auto law = fit(points);
    if (!law) continue;
    rows.push_back({&group.setting, measure.column, points.size(), points.front().first, points.back().first, *law});
    PlotLine line{encoding, false, true, {}};
    for (const double cells : {points.front().first, points.back().first})
      line.corners.emplace_back(cells, law->factor * std::pow(cells, law->exponent));
    plot.lines.push_back(std::move(line));
  }
  color_by_encoding(plot, shown);
  plot.note = "Dashed: cost = a · cellsᵇ, by least squares of the logarithms; b stands in the table.";
  return plot;
}

Table exponent_table(const std::vector<ExponentRow>& rows) {
  Table table{"Exponents of cost against mesh size", {}, {"cost = a · cells^b; ±: standard error of b"}, {}, {}};
  Records settings;
  for (const ExponentRow& row : rows) settings.push_back(row.setting);
  const std::vector<std::string> names = setting_texts(settings);
  table.columns = {{"setting", "setting", "", false},      {"cost", "cost", "", false},
                   {"meshes", "meshes", "", true},         {"least", "leaf cells, least", "", true},
                   {"most", "leaf cells, most", "", true}, {"exponent", "exponent b", "", true}};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ExponentRow& row = rows[i];
    const Cell exponent = std::isfinite(row.law.error) ? Cell(Spread{row.law.exponent, row.law.error}) : Cell(row.law.exponent);
    table.rows.push_back({names[i], std::string(row.column), static_cast<std::int64_t>(row.meshes),
                          static_cast<std::int64_t>(row.least), static_cast<std::int64_t>(row.most), exponent});
  }
  return table;
}

}  // namespace

std::vector<std::string> encodings_in_order(const Records& records) {
  std::vector<std::string> order;
  for (const Encoding* encoding : all_encodings()) order.emplace_back(encoding->name());
  return names_at(records, "/encoding", order);
}

std::vector<Plot> scene_plots(const ComparedScene& scene, const SceneFacts& facts, const PointNumbers& numbers) {
  std::vector<Plot> plots;
  const auto add = [&](const char* kind, Plot plot) {
    if (plot.empty()) return;
    plot.name = kind;
    plots.push_back(std::move(plot));
  };
  add("front_time", front_plot(scene, facts, numbers, false));
  add("front_bytes", front_plot(scene, facts, numbers, true));
  for (const std::string& parameter : varied_parameters(scene.records)) {
    add("parameter_time", parameter_plot(scene, numbers, parameter, false));
    add("parameter_bytes", parameter_plot(scene, numbers, parameter, true));
  }
  add("memory", memory_plot(scene, numbers));
  add("causes", cause_plot(scene, numbers));
  return plots;
}

MeshSizes mesh_sizes(std::span<const Json> records, const PointNumbers& numbers) {
  MeshSizes result;
  std::vector<ExponentRow> rows;
  std::vector<std::vector<SizedGroup>> groups;
  for (const Measure& measure : kMeasures) groups.push_back(sized_groups(records, measure));
  for (std::size_t i = 0; i < groups.size(); ++i) {
    Plot plot = size_plot(kMeasures[i], groups[i], numbers, rows);
    plot.name = fmt::format("mesh_size_{}", kMeasures[i].column);
    if (!plot.empty()) result.plots.push_back(std::move(plot));
  }
  if (!rows.empty()) result.exponents = exponent_table(rows);
  return result;
}

}  // namespace amrtex
