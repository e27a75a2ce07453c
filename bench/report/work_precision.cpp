#include "bench/report/work_precision.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "bench/numbers/pareto.hpp"
#include "bench/report/report.hpp"
#include "bench/report/scenes.hpp"
#include "bench/settings/json_file.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
constexpr double kMostDecibels = 1000;

/// What one entry of the file asks for.
struct Question {
  std::string title = "work-precision";
  std::vector<std::string> notes;
  bool common = true;              ///< `error_common`, else `error`
  std::vector<double> decibels;    ///< PSNR to be reached
  std::vector<double> tolerances;  ///< errors that 95 % of the pixels may not exceed
  std::vector<double> each_at;     ///< PSNR at which each encoding shows its fastest setting
  const char* error() const { return common ? "/error_common" : "/error"; }
};

using Scene = ComparedScene;

// --- the file ---

std::vector<double> numbers(const JsonNode& node, double most) {
  std::vector<double> list;
  for (const JsonNode& item : node.items()) list.push_back(item.number(0, most));
  return list;
}

Question read_question(const JsonNode& entry) {
  constexpr std::array<std::string_view, 3> entry_keys = {"title", "notes", "work_precision"};
  constexpr std::array<std::string_view, 4> keys = {"error", "reach", "reach_p95", "each_at"};
  constexpr std::array<std::string_view, 2> errors = {"common", "own"};
  entry.accept_keys(entry_keys);
  Question question;
  if (const auto title = entry.find("title")) question.title = title->text();
  if (const auto notes = entry.find("notes"))
    for (const JsonNode& note : notes->items()) question.notes.push_back(note.text());
  const JsonNode node = entry.require("work_precision");
  node.accept_keys(keys);
  if (const auto error = node.find("error")) question.common = error->one_of(errors) == "common";
  question.decibels = {30, 40, 50, 60};
  if (const auto reach = node.find("reach")) question.decibels = numbers(*reach, kMostDecibels);
  if (const auto reach = node.find("reach_p95")) question.tolerances = numbers(*reach, 1);
  if (const auto each = node.find("each_at")) question.each_at = numbers(*each, kMostDecibels);
  return question;
}

// --- points ---

std::vector<CostPoint> cost_points(const Records& records, const Question& question) {
  std::vector<CostPoint> points;
  for (const Json* record : records) points.push_back({time_of(*record), share_of_peak(*record, question.error())});
  return points;
}

std::vector<CostPoint> p95_points(const Records& records, const Question& question) {
  std::vector<CostPoint> points;
  for (const Json* record : records)
    points.push_back({time_of(*record), number_at(*record, std::string(question.error()) + "/p95")});
  return points;
}

// --- tables ---

/// An error that is asked for, and the points that may reach it.
struct Goal {
  std::string text;
  double bound;
  const std::vector<CostPoint>* points;
};

std::vector<Goal> goals_of(const Question& question, const std::vector<CostPoint>& psnr, const std::vector<CostPoint>& p95) {
  std::vector<Goal> goals;
  for (const double db : question.decibels) goals.push_back({fmt::format("{} dB", db), relative_rmse(db), &psnr});
  for (const double bound : question.tolerances) goals.push_back({fmt::format("{} for 95 %", bound), bound, &p95});
  return goals;
}

/// Only points of one encoding.
std::vector<CostPoint> points_of(const Records& records, const std::string& encoding, std::vector<CostPoint> points) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (records[i]->at("encoding") != encoding) points[i] = {kNotMeasured, kNotMeasured};
  return points;
}

void add_column(Table& table, std::size_t place, const Column& column, const std::vector<Cell>& cells) {
  table.columns.insert(table.columns.begin() + static_cast<std::ptrdiff_t>(place), column);
  for (std::size_t row = 0; row < cells.size(); ++row)
    table.rows[row].insert(table.rows[row].begin() + static_cast<std::ptrdiff_t>(place), cells[row]);
}

std::vector<std::string_view> measures_of(const Question& question) {
  if (question.common) return {"wall", "total", "psnr_common", "p95_common"};
  return {"wall", "total", "psnr", "p95_error"};
}

Table fastest_table(const Scene& scene, const Question& question) {
  const auto psnr = cost_points(scene.records, question), p95 = p95_points(scene.records, question);
  std::vector<Cell> asked, over_dense;
  Records rows;
  std::vector<std::string> notes = {what_error(scene.records, question.common),
                                    "time / dense: over that of the fastest setting of `uniform` that reaches the same"};
  for (const Goal& goal : goals_of(question, psnr, p95)) {
    const auto fastest = fastest_within(*goal.points, goal.bound);
    const auto dense_only = points_of(scene.records, "uniform", *goal.points);
    const auto dense = fastest_within(dense_only, goal.bound);
    asked.emplace_back(goal.text);
    rows.push_back(fastest ? scene.records[*fastest] : nullptr);
    over_dense.push_back(fastest && dense ? Cell((*goal.points)[*fastest].time / (*goal.points)[*dense].time) : Cell());
    if (!fastest) notes.push_back(fmt::format("no setting reaches {}", goal.text));
  }
  Table table = make_setting_table(fmt::format("{}: the fastest setting, {}", question.title, scene.name), rows, scene.records,
                                   measures_of(question));
  table.constants.emplace(table.constants.begin(), "renderer", scene.context);
  table.notes.insert(table.notes.end(), notes.begin(), notes.end());
  table.notes.insert(table.notes.end(), question.notes.begin(), question.notes.end());
  add_column(table, 0, {"asked", "asked", "", false}, asked);
  add_column(table, table.columns.size(), {"over_dense", "time / dense", "", true}, over_dense);
  return table;
}

Table front_table(const Scene& scene, const Question& question) {
  Records rows;
  const auto points = cost_points(scene.records, question);
  for (const std::size_t i : pareto_front(points)) rows.push_back(scene.records[i]);
  Table table = make_setting_table(fmt::format("{}: what no other setting beats, {}", question.title, scene.name), rows,
                                   scene.records, measures_of(question));
  table.constants.emplace(table.constants.begin(), "renderer", scene.context);
  table.notes.push_back(what_error(scene.records, question.common));
  table.notes.push_back(fmt::format("{} of {} points", rows.size(), scene.records.size()));
  return table;
}

std::set<std::string> encodings_of(const Records& records) {
  std::set<std::string> names;
  for (const Json* record : records) names.insert(text_at(*record, "/encoding"));
  return names;
}

/// The time of the fastest setting of one encoding for each error; nothing where none of its settings reaches it.
std::vector<Cell> fastest_times(const Scene& scene, const Question& question, const std::string& encoding) {
  const auto psnr = points_of(scene.records, encoding, cost_points(scene.records, question));
  const auto p95 = points_of(scene.records, encoding, p95_points(scene.records, question));
  std::vector<Cell> times;
  for (const Goal& goal : goals_of(question, psnr, p95)) {
    const auto fastest = fastest_within(*goal.points, goal.bound);
    times.push_back(fastest ? Cell((*goal.points)[*fastest].time) : Cell());
  }
  return times;
}

Table encodings_table(const Scene& scene, const Question& question) {
  Table table{fmt::format("{}: the fastest setting of each encoding, frame, wall (ms), {}", question.title, scene.name),
              {{"renderer", scene.context}},
              {what_error(scene.records, question.common)},
              {{"encoding", "encoding", "", false}},
              {}};
  const std::vector<CostPoint> none;
  for (const Goal& goal : goals_of(question, none, none)) table.columns.push_back({goal.text, goal.text, "ms", true});
  for (const std::string& encoding : encodings_of(scene.records)) {
    std::vector<Cell> row = fastest_times(scene, question, encoding);
    row.insert(row.begin(), encoding);
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// One row an encoding: what README.md and papers show. An encoding that reaches the error nowhere has no row but a note.
Table settings_table(const Scene& scene, const Question& question, double decibels) {
  const auto points = cost_points(scene.records, question);
  Records rows;
  std::vector<std::string> notes = {what_error(scene.records, question.common)};
  for (const std::string& encoding : encodings_of(scene.records)) {
    if (const auto fastest = fastest_within(points_of(scene.records, encoding, points), relative_rmse(decibels)))
      rows.push_back(scene.records[*fastest]);
    else
      notes.push_back(fmt::format("no setting of {} reaches {} dB", encoding, decibels));
  }
  Table table = make_setting_table(fmt::format("{}: the fastest setting of each encoding at {} dB, {}", question.title, decibels,
                                               scene.name),
                                   in_table_order(rows), scene.records, measures_of(question));
  table.constants.emplace(table.constants.begin(), "renderer", scene.context);
  table.notes.insert(table.notes.end(), notes.begin(), notes.end());
  return table;
}

/// Points without a time or an error: encoding, status, reason -> how many.
std::map<std::tuple<std::string, std::string, std::string>, std::int64_t> unmeasured(const Scene& scene,
                                                                                     const Question& question) {
  std::map<std::tuple<std::string, std::string, std::string>, std::int64_t> counts;
  const auto points = cost_points(scene.records, question);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Json& record = *scene.records[i];
    const std::string status = text_at(record, "/status");
    if (status != "ok")
      ++counts[{text_at(record, "/encoding"), status, text_at(record, "/reason")}];
    else if (!std::isfinite(points[i].time))
      ++counts[{text_at(record, "/encoding"), status, "no time"}];
    else if (!std::isfinite(points[i].error))
      ++counts[{text_at(record, "/encoding"), status, "no error"}];
  }
  return counts;
}

std::optional<Table> unmeasured_table(const Scene& scene, const Question& question) {
  Table table{fmt::format("{}: points that are not in it, {}", question.title, scene.name),
              {},
              {},
              {{"encoding", "encoding", "", false},
               {"status", "status", "", false},
               {"reason", "reason", "", false},
               {"points", "points", "", true}},
              {}};
  for (const auto& [what, count] : unmeasured(scene, question))
    table.rows.push_back({std::get<0>(what), std::get<1>(what), std::get<2>(what), count});
  if (table.rows.empty()) return std::nullopt;
  return table;
}

// --- the diagram ---

Json cell_json(const Cell& cell) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  if (const auto* count = std::get_if<std::int64_t>(&cell)) return *count;
  if (const auto* number = std::get_if<double>(&cell)) return *number;
  if (const auto* spread = std::get_if<Spread>(&cell)) return spread->median;
  return nullptr;
}

/// One object a measured point: what the diagram's axes need, and every column of the tables to be read under the pointer.
/// `drawn` stands for the error on a logarithmic axis: exact pictures lie below all others there.
Json diagram_points(const Scene& scene, const Question& question) {
  const auto points = cost_points(scene.records, question);
  const auto front = pareto_front(points);
  const Table table = make_setting_table("", scene.records, scene.records, measures_of(question));
  double least = 1;
  for (const CostPoint& p : points)
    if (p.error > 0) least = std::min(least, p.error);
  Json values = Json::array();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!std::isfinite(points[i].time) || !std::isfinite(points[i].error)) continue;
    Json value = {{"time", points[i].time},
                  {"error", points[i].error},
                  {"drawn", points[i].error > 0 ? points[i].error : least / 2},
                  {"structure", scene.records[i]->at("encoding")},
                  {"reconstruction", scene.records[i]->at("filter")},
                  {"front", std::find(front.begin(), front.end(), i) != front.end()}};
    for (std::size_t c = 0; c < table.columns.size(); ++c) value[table.columns[c].label] = cell_json(table.rows[i][c]);
    values.push_back(std::move(value));
  }
  return values;
}

Json axis(const char* field, const char* title) {
  return {{"field", field},
          {"type", "quantitative"},
          {"title", title},
          {"scale", {{"type", "log"}, {"nice", false}, {"padding", 12}}}};
}

Json tooltip(const Scene& scene, const Question& question) {
  Json list = Json::array();
  for (const Column& column : make_setting_table("", {}, scene.records, measures_of(question)).columns)
    list.push_back({{"field", column.label}, {"type", column.numeric ? "quantitative" : "nominal"}});
  return list;
}

/// What is not in the plot, as lines of text below it.
Json footnotes(const Scene& scene, const Question& question) {
  Json lines = Json::array();
  const auto add = [&](const std::string& text) { lines.push_back({{"line", lines.size()}, {"text", text}}); };
  add(what_error(scene.records, question.common));
  const auto points = cost_points(scene.records, question);
  if (const auto exact = std::count_if(points.begin(), points.end(), [](const CostPoint& p) { return p.error == 0; }); exact > 0)
    add(fmt::format("{} exact, drawn below the others", exact));
  for (const auto& [what, count] : unmeasured(scene, question))
    add(fmt::format("{} x {} {}: {}", count, std::get<0>(what), std::get<1>(what), std::get<2>(what)));
  return lines;
}

Json diagram(const Scene& scene, const Question& question) {
  const Json lines = footnotes(scene, question);
  const Json x = axis("time", "frame, wall (ms)"), y = axis("drawn", "RMSE / peak (20 dB a factor of ten)");
  const Json points = {{"mark", {{"type", "point"}, {"filled", true}, {"size", 45}}},
                       {"encoding",
                        {{"x", x},
                         {"y", y},
                         {"color", {{"field", "structure"}, {"type", "nominal"}, {"title", "encoding"}}},
                         {"shape", {{"field", "reconstruction"}, {"type", "nominal"}, {"title", "filter"}}},
                         {"tooltip", tooltip(scene, question)}}}};
  const Json front = {{"transform", Json::array({Json{{"filter", "datum.front"}}})},
                      {"mark", {{"type", "line"}, {"interpolate", "step-after"}, {"color", "black"}, {"opacity", 0.5}}},
                      {"encoding", {{"x", x}, {"y", y}, {"order", {{"field", "time"}, {"type", "quantitative"}}}}}};
  const Json plot = {{"width", 560},
                     {"height", 380},
                     {"data", {{"values", diagram_points(scene, question)}}},
                     {"layer", Json::array({front, points})}};
  const Json text = {{"width", 560},
                     {"height", 14 * lines.size()},
                     {"view", {{"stroke", nullptr}}},
                     {"data", {{"values", lines}}},
                     {"mark", {{"type", "text"}, {"align", "left"}, {"limit", 2000}, {"fontSize", 10}}},
                     {"encoding",
                      {{"x", {{"value", 0}}},
                       {"y", {{"field", "line"}, {"type", "ordinal"}, {"axis", nullptr}}},
                       {"text", {{"field", "text"}, {"type", "nominal"}}}}}};
  return {{"$schema", kVegaLite},
          {"title", scene.name},
          {"description",
           fmt::format("{}: error against frame time of every setting; the line is what no setting beats", question.title)},
          {"vconcat", Json::array({plot, text})}};
}

}  // namespace

WorkPrecision make_work_precision(const std::filesystem::path& path, std::span<const Json> records) {
  const JsonFile file = JsonFile::read(path);
  WorkPrecision result;
  std::set<std::string> names;
  for (const JsonNode& entry : file.root().items()) {
    if (!entry.find("work_precision")) continue;
    const Question question = read_question(entry);
    for (const Scene& scene : compared_scenes(records, question.common)) {
      result.tables.push_back(fastest_table(scene, question));
      result.tables.push_back(front_table(scene, question));
      result.tables.push_back(encodings_table(scene, question));
      for (const double decibels : question.each_at) result.tables.push_back(settings_table(scene, question, decibels));
      if (auto table = unmeasured_table(scene, question)) result.tables.push_back(std::move(*table));
      result.diagrams.push_back({diagram_name("work_precision", scene.name, names), diagram(scene, question)});
    }
  }
  return result;
}

}  // namespace amrtex
