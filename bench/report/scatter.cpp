#include "bench/report/scatter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <optional>
#include <string>

#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_conditions.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/contexts.hpp"
#include "bench/report/report.hpp"
#include "bench/settings/json_file.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

/// A number of a record: scale * value / over.
struct Quantity {
  std::string label;  ///< with the unit in brackets
  std::string value;
  std::string over;  ///< empty = 1
  double scale = 1;
};

/// What one entry of the file asks for.
struct Question {
  std::string title;
  std::vector<std::string> notes;
  Conditions where;
  Quantity quantity;              ///< the y axis
  std::vector<Quantity> against;  ///< an x axis each
};

/// One setting from several views: a value of the quantity and of each that it is set against, a view.
struct Group {
  std::string context;
  Json setting;  ///< a record for all, whose view is their number
  std::vector<std::string> views;
  std::vector<double> y;
  std::vector<std::vector<double>> x;  ///< of each `against`
};

// --- the file ---

std::string pointer_at(const JsonNode& node) {
  check_record_pointer(node, node.text());
  return node.text();
}

Quantity read_quantity(const JsonNode& node) {
  Quantity q;
  q.label = node.require("label").text();
  q.value = pointer_at(node.require("value"));
  if (const auto over = node.find("over")) q.over = pointer_at(*over);
  if (const auto scale = node.find("scale")) q.scale = scale->positive_number();
  return q;
}

Question read_question(const JsonNode& entry) {
  constexpr std::array<std::string_view, 3> entry_keys = {"title", "notes", "scatter"};
  constexpr std::array<std::string_view, 6> keys = {"label", "value", "over", "scale", "against", "where"};
  constexpr std::array<std::string_view, 4> against_keys = {"label", "value", "over", "scale"};
  entry.accept_keys(entry_keys);
  Question question;
  question.title = entry.require("title").text();
  if (const auto notes = entry.find("notes"))
    for (const JsonNode& note : notes->items()) question.notes.push_back(note.text());
  const JsonNode node = entry.require("scatter");
  node.accept_keys(keys);
  question.quantity = read_quantity(node);
  question.where = read_conditions(node, {});
  for (const JsonNode& against : node.require("against").items()) {
    against.accept_keys(against_keys);
    question.against.push_back(read_quantity(against));
  }
  return question;
}

// --- groups ---

/// A number, or the median of a timing.
std::optional<double> number_at(const Json& record, const std::string& pointer) {
  const Json& value = value_at(record, pointer);
  const Json& number = value.is_object() ? value_at(value, "/median") : value;
  return number.is_number() ? std::optional(number.get<double>()) : std::nullopt;
}

std::optional<double> amount(const Json& record, const Quantity& q) {
  const auto value = number_at(record, q.value);
  const auto over = q.over.empty() ? std::optional(1.0) : number_at(record, q.over);
  if (!value || !over || *over == 0) return std::nullopt;
  return q.scale * *value / *over;
}

std::string text_at(const Json& record, const std::string& pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_string() ? value.get<std::string>() : "";
}

/// Everything that a setting is, but for the view.
Json setting_key(const Json& record) {
  Json render = value_at(record, "/render");
  for (const char* key : {"view", "view_name"}) render.erase(key);
  Json key = Json::array({context_key(value_at(record, "/context"))});
  for (const char* pointer : {"/experiment", "/dataset/name", "/dataset/hash", "/dataset/exact_hash", "/dataset/field",
                              "/encoding", "/build_parameters", "/filter", "/storage", "/filtering"})
    key.push_back(value_at(record, pointer));
  key.push_back(std::move(render));
  return key;
}

void add_view(const Json& record, const Question& question, Group& group) {
  const auto y = amount(record, question.quantity);
  std::vector<double> x;
  for (const Quantity& q : question.against)
    if (const auto value = amount(record, q)) x.push_back(*value);
  if (!y || x.size() < question.against.size()) return;
  group.views.push_back(text_at(record, "/render/view_name"));
  group.y.push_back(*y);
  for (std::size_t i = 0; i < x.size(); ++i) group.x[i].push_back(x[i]);
}

/// By name of the data set; `too_few`: settings of fewer than three views with all numbers.
std::vector<Group> groups_of(std::span<const Json> records, const Question& question, std::size_t& too_few) {
  std::map<std::string, Group> by_key;
  const ContextNames contexts(records);
  for (const Json& record : records) {
    if (text_at(record, "/status") != "ok" || !value_at(record, "/render").is_object() || !matches(record, question.where))
      continue;
    Group& group = by_key[setting_key(record).dump()];
    if (group.x.empty()) {
      group.context = contexts.of(record);
      group.setting = record;
      group.x.resize(question.against.size());
    }
    add_view(record, question, group);
  }
  std::vector<Group> groups;
  for (auto& [key, group] : by_key) {
    if (group.y.size() < 3) {
      ++too_few;
      continue;
    }
    group.setting["render"]["view_name"] = fmt::format("{} views", group.y.size());
    groups.push_back(std::move(group));
  }
  return groups;
}

// --- the table ---

double mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// `groups` of one context. One row a group and quantity.
Table make_table(const Question& question, const std::vector<const Group*>& groups) {
  Records rows, all;
  for (const Group* group : groups) {
    all.push_back(&group->setting);
    rows.insert(rows.end(), question.against.size(), &group->setting);
  }
  Table table = make_setting_table(question.title, rows, all, {});
  table.constants.emplace(table.constants.begin(), "renderer", groups.front()->context);
  table.notes.insert(table.notes.begin(), question.notes.begin(), question.notes.end());
  table.columns.push_back({"against", "against", "", false});
  for (const char* which : {"least", "mean", "most"}) table.columns.push_back({which, fmt::format("{} a view", which), "", true});
  table.columns.push_back({"y_mean", fmt::format("{}, mean", question.quantity.label), "", true});
  table.columns.push_back({"correlation", "correlation", "", true});
  table.columns.push_back({"slope", "slope", "", true});
  table.columns.push_back({"at_zero", "line at 0", "", true});
  std::size_t row = 0;
  for (const Group* group : groups)
    for (std::size_t i = 0; i < question.against.size(); ++i, ++row) {
      const std::vector<double>& x = group->x[i];
      const auto fit = fit_line(x, group->y);
      std::vector<Cell>& cells = table.rows[row];
      cells.insert(cells.end(), {question.against[i].label, *std::min_element(x.begin(), x.end()), mean(x),
                                 *std::max_element(x.begin(), x.end()), mean(group->y)});
      if (fit)
        cells.insert(cells.end(), {fit->correlation, fit->slope, fit->at_zero});
      else
        cells.resize(cells.size() + 3);
    }
  return table;
}

// --- the diagram ---

Json axis(const std::string& field, const std::string& title) {
  return {{"field", field}, {"type", "quantitative"}, {"title", title}, {"scale", {{"zero", false}, {"padding", 12}}}};
}

/// The line from the least to the largest x; nothing where there is none.
Json line_points(const std::vector<double>& x, const std::vector<double>& y) {
  const auto fit = fit_line(x, y);
  Json points = Json::array();
  if (!fit) return points;
  for (const double at : {*std::min_element(x.begin(), x.end()), *std::max_element(x.begin(), x.end())})
    points.push_back({{"x", at}, {"y", fit->at_zero + fit->slope * at}});
  return points;
}

Json panel(const Question& question, const Group& group, std::size_t i) {
  Json points = Json::array();
  for (std::size_t v = 0; v < group.y.size(); ++v)
    points.push_back({{"x", group.x[i][v]}, {"y", group.y[v]}, {"view", group.views[v]}});
  const Json x = axis("x", question.against[i].label), y = axis("y", question.quantity.label);
  Json tooltip = Json::array({Json{{"field", "view"}, {"type", "nominal"}}});
  tooltip.push_back({{"field", "x"}, {"type", "quantitative"}, {"title", question.against[i].label}});
  tooltip.push_back({{"field", "y"}, {"type", "quantitative"}, {"title", question.quantity.label}});
  const Json dots = {{"data", {{"values", points}}},
                     {"mark", {{"type", "point"}, {"filled", true}, {"size", 40}}},
                     {"encoding", {{"x", x}, {"y", y}, {"tooltip", tooltip}}}};
  const Json line = {{"data", {{"values", line_points(group.x[i], group.y)}}},
                     {"mark", {{"type", "line"}, {"color", "black"}, {"opacity", 0.5}}},
                     {"encoding", {{"x", x}, {"y", y}}}};
  const auto fit = fit_line(group.x[i], group.y);
  return {{"title", fit ? fmt::format("correlation {:.3f}", fit->correlation) : "no line"},
          {"width", 320},
          {"height", 280},
          {"layer", Json::array({line, dots})}};
}

/// What the table's row calls the setting, in one line: the columns that tell settings apart.
std::string setting_name(const Table& table, std::size_t row) {
  std::vector<std::string> parts;
  for (std::size_t c = 0; c < table.columns.size() && table.columns[c].key != "against"; ++c)
    parts.push_back(format_cell(table.rows[row][c]));
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string title_of(const Group& group, const Table& table, std::size_t row) {
  const std::string setting = setting_name(table, row);
  const std::string dataset = text_at(group.setting, "/dataset/name");
  return setting.find(dataset) == std::string::npos ? fmt::format("{}, {}", dataset, setting) : setting;
}

Json diagram(const Question& question, const Group& group, const std::string& title) {
  Json panels = Json::array();
  for (std::size_t i = 0; i < question.against.size(); ++i) panels.push_back(panel(question, group, i));
  return {{"$schema", kVegaLite},
          {"title", title},
          {"description", fmt::format("{}: a point a view; the line is that of least squares", question.title)},
          {"hconcat", panels}};
}

}  // namespace

Scatter make_scatter(const std::filesystem::path& path, std::span<const Json> records) {
  const JsonFile file = JsonFile::read(path);
  Scatter result;
  std::set<std::string> names;
  for (const JsonNode& entry : file.root().items()) {
    if (!entry.find("scatter")) continue;
    const Question question = read_question(entry);
    std::size_t too_few = 0;
    const std::vector<Group> groups = groups_of(records, question, too_few);
    std::map<std::string, std::vector<const Group*>> by_context;
    for (const Group& group : groups) by_context[group.context].push_back(&group);
    for (const auto& [context, members] : by_context) {
      Table table = make_table(question, members);
      if (too_few > 0) table.notes.push_back(fmt::format("{} settings with fewer than three views are left out", too_few));
      for (std::size_t i = 0; i < members.size(); ++i) {
        const std::string title = title_of(*members[i], table, i * question.against.size());
        result.diagrams.push_back({diagram_name("scatter", title, names), diagram(question, *members[i], title)});
      }
      result.tables.push_back(std::move(table));
    }
  }
  return result;
}

}  // namespace amrtex
