// What amrtex compare says, for people and for programs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>

#include "bench/records/record.hpp"
#include "bench/report/compare.hpp"
#include "bench/report/report.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

Cell cell_of(const Json& value) {
  if (value.is_null()) return std::monostate();
  if (value.is_number_integer()) return value.get<std::int64_t>();
  if (value.is_number()) return value.get<double>();
  return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string interval_text(const Comparison& c) {
  if (c.n_a == 0 || c.n_b == 0) return "";
  return fmt::format("{:.3f} to {:.3f}", c.interval.lower, c.interval.upper);
}

std::string verdict_text(Verdict verdict, const std::string& reason) {
  return reason.empty() ? std::string(verdict_name(verdict)) : fmt::format("{}: {}", verdict_name(verdict), reason);
}

void add_column(Table& table, const char* key, const std::string& label, bool numeric, const std::vector<Cell>& cells) {
  table.columns.push_back({key, label, "", numeric});
  for (std::size_t row = 0; row < cells.size(); ++row) table.rows[row].push_back(cells[row]);
}

using Found = std::optional<Comparison>;

/// Medians of both sides and their ratio.
void add_medians(Table& table, const std::vector<const Found*>& found, const std::string& key, const std::string& what) {
  std::vector<Cell> a, b, ratio;
  for (const Found* f : found) {
    const bool both = *f && (*f)->n_a > 0 && (*f)->n_b > 0;
    a.push_back(both ? Cell((*f)->median_a) : Cell());
    b.push_back(both ? Cell((*f)->median_b) : Cell());
    ratio.push_back(both ? Cell(fmt::format("{:.3f}", (*f)->interval.ratio)) : Cell());
  }
  add_column(table, (key + "_a").c_str(), fmt::format("{}, A", what), true, a);
  add_column(table, (key + "_b").c_str(), fmt::format("{}, B", what), true, b);
  add_column(table, (key + "_ratio").c_str(), fmt::format("{}, B / A", what), true, ratio);
}

/// What the verdict goes by.
void add_decision(Table& table, const std::vector<const Comparison*>& deciding) {
  std::vector<Cell> n, interval, p;
  for (const Comparison* c : deciding) {
    n.push_back(c != nullptr ? Cell(fmt::format("{}, {}", c->n_a, c->n_b)) : Cell());
    interval.push_back(c != nullptr ? Cell(interval_text(*c)) : Cell());
    p.push_back(c != nullptr && c->adjusted_p ? Cell(fmt::format("{:.2g}", *c->adjusted_p)) : Cell());
  }
  add_column(table, "n", "n", false, n);
  add_column(table, "interval", "B / A lies in", false, interval);
  add_column(table, "p", "p (Holm)", true, p);
}

std::string level_note(const ComparisonRules& rules) {
  return fmt::format("interval of {:g} %, minimum effect {:g} %", 100 * (1 - rules.level), 100 * rules.effect);
}

const Comparison* deciding(const ComparedPoint& point) {
  const Found& found = point.by_time ? point.time : point.relative;
  return found ? &*found : nullptr;
}

Table points_table(const FolderComparison& comparison, const std::string& context,
                   const std::vector<const ComparedPoint*>& points) {
  Records records;
  std::vector<const Found*> relative, time;
  std::vector<const Comparison*> decisions;
  std::vector<Cell> verdicts;
  for (const ComparedPoint* point : points) {
    records.push_back(point->a);
    relative.push_back(&point->relative);
    time.push_back(&point->time);
    decisions.push_back(deciding(*point));
    verdicts.emplace_back(verdict_text(point->verdict, point->reason));
  }
  const auto any = [](const std::vector<const Found*>& found) {
    return std::any_of(found.begin(), found.end(), [](const Found* f) { return f->has_value(); });
  };
  Table table = make_setting_table("frame times", records, records, {});
  table.constants.emplace(table.constants.begin(), "renderer", context);
  if (any(relative)) add_medians(table, relative, "relative", "time / baseline");
  if (any(time)) add_medians(table, time, "time", "time (ms)");
  add_decision(table, decisions);
  add_column(table, "verdict", "verdict", false, verdicts);
  table.notes.push_back(level_note(comparison.rules));
  if (any(relative) && std::any_of(points.begin(), points.end(), [](const ComparedPoint* p) { return !p->by_time; }))
    table.notes.push_back(
        "n, interval, p and verdict are those of time / baseline where the point has one and its baseline did not "
        "change alone");
  return table;
}

Table lines_table(const FolderComparison& comparison, const char* title, const std::string& what,
                  const std::vector<ComparedLine>& lines) {
  Table table{title, {}, {level_note(comparison.rules)}, {{"name", "", "", false}, {"points", "points", "", true}}, {}};
  std::vector<Found> found;
  std::vector<const Comparison*> decisions;
  std::vector<Cell> verdicts;
  for (const ComparedLine& line : lines) {
    table.rows.push_back({line.name, static_cast<std::int64_t>(line.points)});
    found.emplace_back(line.comparison);
    decisions.push_back(&line.comparison);
    verdicts.emplace_back(verdict_text(line.comparison.verdict, line.note.empty() ? line.comparison.reason : line.note));
  }
  std::vector<const Found*> pointers;
  for (const Found& f : found) pointers.push_back(&f);
  add_medians(table, pointers, "median", what);
  add_decision(table, decisions);
  add_column(table, "verdict", "verdict", false, verdicts);
  return table;
}

Table differences_table(const FolderComparison& comparison) {
  Records records;
  std::vector<Cell> contexts, what, a, b;
  for (const Difference& d : comparison.differences) {
    records.push_back(d.record);
    contexts.emplace_back(d.context);
    what.emplace_back(d.counts ? d.what : d.what + " (drivers may differ here)");
    a.push_back(cell_of(d.a));
    b.push_back(cell_of(d.b));
  }
  Table table = make_setting_table("what differs", records, records, {});
  const bool several = std::any_of(comparison.differences.begin(), comparison.differences.end(),
                                   [&](const Difference& d) { return d.context != comparison.differences.front().context; });
  if (several) add_column(table, "renderer", "renderer", false, contexts);
  add_column(table, "what", "what", false, what);
  add_column(table, "a", "A", true, a);
  add_column(table, "b", "B", true, b);
  return table;
}

Json json_of(const Comparison& c) {
  const bool both = c.n_a > 0 && c.n_b > 0;
  Json json = {{"n", {c.n_a, c.n_b}}};
  json["median"] = both ? Json{c.median_a, c.median_b} : Json();
  json["ratio"] = both ? Json(c.interval.ratio) : Json();
  json["interval"] = both ? Json{c.interval.lower, c.interval.upper} : Json();
  json["coverage"] = both ? Json(c.interval.coverage) : Json();
  json["p"] = both ? Json(c.p) : Json();
  json["p_holm"] = c.adjusted_p ? Json(*c.adjusted_p) : Json();
  json["verdict"] = verdict_name(c.verdict);
  json["reason"] = c.reason.empty() ? Json() : Json(c.reason);
  return json;
}

/// What tells a point apart, for a reader who does not look its record up.
Json identity_of(const Json& record) {
  Json json = {{"configuration", value_at(record, "/configuration")},
               {"experiment", value_at(record, "/experiment")},
               {"dataset", value_at(record, "/dataset/name")}};
  for (const char* key : {"encoding", "build_parameters", "filter", "storage", "filtering"})
    json[key] = value_at(record, std::string("/") + key);
  for (const char* key : {"consumer", "mode", "sampling", "step", "view_name", "transfer_function_name"})
    json[key] = value_at(record, std::string("/render/") + key);
  return json;
}

Json json_of(const ComparedPoint& point) {
  Json json = identity_of(*point.a);
  json["context"] = point.context;
  json["relative"] = point.relative ? json_of(*point.relative) : Json();
  json["time_ms"] = point.time ? json_of(*point.time) : Json();
  json["by"] = deciding(point) == nullptr ? Json() : Json(point.by_time ? "time_ms" : "relative");
  json["verdict"] = verdict_name(point.verdict);
  json["reason"] = point.reason.empty() ? Json() : Json(point.reason);
  return json;
}

Json json_of(const std::vector<ComparedLine>& lines) {
  Json list = Json::array();
  for (const ComparedLine& line : lines) {
    Json json = {{"name", line.name}, {"points", line.points}};
    json.update(json_of(line.comparison));
    json["note"] = line.note.empty() ? Json() : Json(line.note);
    list.push_back(std::move(json));
  }
  return list;
}

std::array<std::size_t, 4> verdict_counts(const FolderComparison& comparison) {
  std::array<std::size_t, 4> counts{};
  for (const ComparedPoint& point : comparison.points) ++counts[static_cast<std::size_t>(point.verdict)];
  return counts;
}

}  // namespace

std::vector<Table> comparison_tables(const FolderComparison& comparison) {
  std::vector<Table> tables;
  if (!comparison.differences.empty()) tables.push_back(differences_table(comparison));
  if (!comparison.baselines.empty()) tables.push_back(lines_table(comparison, "baselines", "time (ms)", comparison.baselines));
  if (!comparison.encodings.empty())
    tables.push_back(lines_table(comparison, "all points of an encoding together", "middle of its points", comparison.encodings));
  std::map<std::string, std::vector<const ComparedPoint*>> by_context;
  for (const ComparedPoint& point : comparison.points) by_context[point.context].push_back(&point);
  for (const auto& [context, points] : by_context) tables.push_back(points_table(comparison, context, points));
  return tables;
}

std::string comparison_summary(const FolderComparison& comparison) {
  const auto counts = verdict_counts(comparison);
  std::vector<std::string> parts;
  for (const Verdict verdict : {Verdict::slower, Verdict::faster, Verdict::same, Verdict::cannot_tell})
    parts.push_back(fmt::format("{} {}", counts[static_cast<std::size_t>(verdict)], verdict_name(verdict)));
  std::string text = fmt::format("{} points with times: {}; {} exact values differ", comparison.points.size(),
                                 fmt::join(parts, ", "), comparison.differences.size());
  if (!comparison.only_a.empty() || !comparison.only_b.empty())
    text += fmt::format("; {} points only in A, {} only in B", comparison.only_a.size(), comparison.only_b.size());
  text += "\n";
  if (!comparison.points.empty())
    text += fmt::format("the smallest --repeat that can decide {} points: {}\n", comparison.points.size(),
                        comparison.smallest_repeat);
  return text;
}

Json comparison_json(const FolderComparison& comparison) {
  const auto identities = [](const Records& records) {
    Json list = Json::array();
    for (const Json* record : records) list.push_back(identity_of(*record));
    return list;
  };
  Json json = {{"a", comparison.name_a},
               {"b", comparison.name_b},
               {"effect", comparison.rules.effect},
               {"level", comparison.rules.level},
               {"one_context", comparison.one_context},
               {"notes", comparison.notes},
               {"smallest_repeat", comparison.smallest_repeat},
               {"findings", has_findings(comparison)}};
  json["differences"] = Json::array();
  for (const Difference& d : comparison.differences) {
    Json difference = identity_of(*d.record);
    difference.update({{"what", d.what}, {"a", d.a}, {"b", d.b}, {"counts", d.counts}});
    json["differences"].push_back(std::move(difference));
  }
  json["only_in_a"] = identities(comparison.only_a);
  json["only_in_b"] = identities(comparison.only_b);
  json["baselines"] = json_of(comparison.baselines);
  json["encodings"] = json_of(comparison.encodings);
  json["points"] = Json::array();
  for (const ComparedPoint& point : comparison.points) json["points"].push_back(json_of(point));
  const auto counts = verdict_counts(comparison);
  for (const Verdict verdict : {Verdict::faster, Verdict::slower, Verdict::same, Verdict::cannot_tell})
    json["counts"][std::string(verdict_name(verdict))] = counts[static_cast<std::size_t>(verdict)];
  return json;
}

}  // namespace amrtex
