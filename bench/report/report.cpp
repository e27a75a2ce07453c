#include "bench/report/report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <set>

#include "bench/records/record.hpp"
#include "bench/report/contexts.hpp"
#include "bench/settings/json_file.hpp"
#include "bench/settings/settings_table.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/suggestion.hpp"

namespace amrtex {
namespace {

constexpr double kMebibyte = 1048576.0;

using Records = std::vector<const Json*>;

const Json& at(const Json& json, const char* pointer) { return value_at(json, pointer); }

std::string text_of(const Json& json) {
  if (json.is_null()) return "";
  return json.is_string() ? json.get<std::string>() : json.dump();
}

Cell cell_of(const Json& json) {
  if (json.is_number_integer()) return json.get<std::int64_t>();
  if (json.is_number()) return json.get<double>();
  if (json.is_null()) return std::monostate();
  return text_of(json);
}

/// Everything a column may look at besides its own record.
struct Group {
  Records records;                                                  ///< in the order of the rows
  std::map<std::string, std::set<std::string>> varying_parameters;  ///< encoding -> keys
  std::map<std::string, Records> dense;  ///< scene_key() -> those of the encoding uniform that have a time
};

/// A setting is left out of the columns where it is the same everywhere; a measure is not.
enum class Role { setting, measure };

struct ColumnRule {
  std::string key;
  std::string label;
  std::string latex;  ///< "" = the label
  Role role;
  bool numeric;
  std::function<Cell(const Json& record, const Group& group)> cell;
};

/// A rule that no key of a file gives.
struct FixedColumn {
  const char* key;
  const char* label;
  const char* latex;
  Role role;
  bool numeric;
  Cell (*cell)(const Json& record, const Group& group);
  operator ColumnRule() const { return {key, label, latex, role, numeric, cell}; }
};

template <std::size_t N>
struct Path {
  char text[N];
  constexpr Path(const char (&path)[N]) { std::copy(path, path + N, text); }
};

template <Path path>
Cell value(const Json& record, const Group&) {
  return cell_of(at(record, path.text));
}

template <Path path>
Cell mebibytes(const Json& record, const Group&) {
  const Json& bytes = at(record, path.text);
  if (!bytes.is_number()) return std::monostate();
  return bytes.get<double>() / kMebibyte;
}

template <Path path>
Cell timing(const Json& record, const Group&) {
  const Json& time = at(record, path.text);
  const Json& median = at(time, "/median");
  const Json& deviation = at(time, "/mad");
  if (!median.is_number() || !deviation.is_number()) return std::monostate();
  return Spread{median.get<double>(), deviation.get<double>()};
}

/// A name where the record has one, else the whole value.
template <Path name_path, Path path>
Cell named(const Json& record, const Group&) {
  const Json& name = at(record, name_path.text);
  return cell_of(name.is_null() ? at(record, path.text) : name);
}

std::string parameters_text(const Json& record, const std::set<std::string>& keys) {
  std::vector<std::string> parts;
  const Json& parameters = at(record, "/build_parameters");
  if (parameters.is_object())
    for (const auto& [key, parameter] : parameters.items())
      if (keys.contains(key)) parts.push_back(fmt::format("{} {}", key, parameter.is_null() ? "default" : text_of(parameter)));
  return fmt::format("{}", fmt::join(parts, ", "));
}

Cell encoding_cell(const Json& record, const Group& group) {
  const std::string name = text_of(at(record, "/encoding"));
  const auto varying = group.varying_parameters.find(name);
  if (varying == group.varying_parameters.end()) return name;
  const std::string parameters = parameters_text(record, varying->second);
  return parameters.empty() ? name : fmt::format("{} ({})", name, parameters);
}

Cell picture_cell(const Json& record, const Group&) {
  const Json &width = at(record, "/render/width"), &height = at(record, "/render/height");
  if (width.is_null() || height.is_null()) return std::monostate();
  return fmt::format("{} x {}", text_of(width), text_of(height));
}

Cell status_cell(const Json& record, const Group&) {
  const std::string reason = text_of(at(record, "/reason"));
  const std::string status = text_of(at(record, "/status"));
  return reason.empty() ? status : fmt::format("{}: {}", status, reason);
}

bool is_unchecked(const Json& record) { return at(record, "/check").is_null() && at(record, "/check_reason").is_string(); }

/// Records of schema 1 do not say.
Cell check_cell(const Json& record, const Group&) {
  if (is_unchecked(record)) return "unchecked";
  const Json& bound = at(record, "/check/psnr_db");
  if (!bound.is_number()) return std::monostate();
  return fmt::format("{:.1f} dB ({})", bound.get<double>(), text_of(at(record, "/check/from")));
}

/// What was left out for want of need, and because it is hidden.
Cell left_out_cell(const Json& record, const Group&) {
  const Json& list = at(record, "/left_out");
  if (!list.is_array()) return std::monostate();
  double bytes = 0;
  for (const Json& item : list) bytes += item.at("bytes").get<double>();
  return bytes / kMebibyte;
}

/// What building that would have taken, as far as it was measured.
Cell left_out_seconds_cell(const Json& record, const Group&) {
  const Json& list = at(record, "/left_out");
  if (!list.is_array()) return std::monostate();
  std::optional<double> seconds;
  for (const Json& item : list)
    if (const Json& own = at(item, "/seconds"); own.is_number()) seconds = seconds.value_or(0) + own.get<double>();
  return seconds ? Cell(*seconds) : Cell(std::monostate());
}

bool is_linear(const Json& record) { return text_of(at(record, "/filter")) != "nearest"; }

bool same(const Json& a, const Json& b, const char* pointer) { return at(a, pointer) == at(b, pointer); }

/// What is drawn: only pictures of the same are compared in time.
std::string scene_key(const Json& record) {
  std::string key;
  for (const char* scene : {"/dataset/hash", "/dataset/exact_hash", "/dataset/field", "/render"})
    key += at(record, scene).dump() + "\n";
  return key;
}

std::map<std::string, Records> dense_by_scene(const Records& records) {
  std::map<std::string, Records> dense;
  for (const Json* record : records)
    if (record->at("encoding") == "uniform" && at(*record, "/frame/wall_ms/median").is_number())
      dense[scene_key(*record)].push_back(record);
  return dense;
}

/// How well `candidate`, of the same scene, serves as what `record` is measured against; 0 = not at all.
int baseline_rank(const Json& candidate, const Json& record) {
  if (!same(candidate, record, "/filter")) return is_linear(candidate) && is_linear(record) ? 1 : 0;
  if (!same(candidate, record, "/filtering")) return 2;
  return same(candidate, record, "/storage") ? 4 : 3;
}

Cell relative_cell(const Json& record, const Group& group) {
  const Json& time = at(record, "/frame/wall_ms/median");
  if (!time.is_number()) return std::monostate();
  const auto dense = group.dense.empty() ? group.dense.end() : group.dense.find(scene_key(record));
  if (dense == group.dense.end()) return std::monostate();
  const Json* baseline = nullptr;
  int best = 0;
  for (const Json* candidate : dense->second)
    if (const int rank = baseline_rank(*candidate, record); rank > best) {
      baseline = candidate;
      best = rank;
    }
  if (baseline == nullptr) return std::monostate();
  const double baseline_ms = at(*baseline, "/frame/wall_ms/median").get<double>();
  if (!(baseline_ms > 0)) return std::monostate();
  return time.get<double>() / baseline_ms;
}

/// Settings that are no key of a file, or several of them.
constexpr FixedColumn kFirstSettings[] = {
    {"dataset", "dataset", "", Role::setting, false, value<"/dataset/name">},
    {"field", "field", "", Role::setting, false, value<"/dataset/field">},
    {"leaf_cells", "leaf cells", "", Role::setting, true, value<"/dataset/leaf_cells">},
    {"encoding", "encoding", "", Role::setting, false, encoding_cell},
};
constexpr FixedColumn kLastSettings[] = {
    {"picture", "picture (pixels)", "", Role::setting, false, picture_cell},
    {"view", "view", "", Role::setting, false, named<"/render/view_name", "/render/view">},
    {"transfer_function", "transfer function", "", Role::setting, false,
     named<"/render/transfer_function_name", "/render/transfer_function">},
};

constexpr FixedColumn kMeasures[] = {
    {"total", "total (MiB)", "", Role::measure, true, mebibytes<"/memory/total_bytes">},
    {"payload", "payload (MiB)", "", Role::measure, true, mebibytes<"/memory/by_role/payload">},
    {"duplicated", "duplicated (MiB)", "", Role::measure, true, mebibytes<"/memory/by_role/duplicated">},
    {"topology", "topology (MiB)", "", Role::measure, true, mebibytes<"/memory/by_role/topology">},
    {"padding", "padding (MiB)", "", Role::measure, true, mebibytes<"/memory/by_role/padding">},
    {"texels_per_cell", "texels per cell", "", Role::measure, true, value<"/memory/texels_per_cell">},
    {"left_out", "left out (MiB)", "", Role::measure, true, left_out_cell},
    {"left_out_seconds", "left out (s)", "", Role::measure, true, left_out_seconds_cell},
    {"build", "build (s)", "", Role::measure, true, value<"/build_seconds">},
    {"upload", "upload (s)", "", Role::measure, true, value<"/upload_seconds">},
    {"wall", "frame wall (ms)", "", Role::measure, true, timing<"/frame/wall_ms">},
    {"gpu", "frame GPU (ms)", "", Role::measure, true, timing<"/frame/gpu_ms">},
    {"gpu_draws", "draws in a GPU query (above 1: throughput)", "", Role::measure, true, value<"/frame/draws_per_query">},
    {"relative", "time / uniform", "", Role::measure, true, relative_cell},
    {"change", "change of transfer function (ms)", "", Role::measure, true, timing<"/change/wall_ms">},
    {"baseline", "time / baseline", "", Role::measure, true, value<"/frame/relative">},
    {"pages", "pages", "", Role::measure, true, value<"/statistics/pages">},
    {"border_overhead", "border overhead", "", Role::measure, true, value<"/statistics/border_overhead">},
    {"border_formula", "by formula", "", Role::measure, true, value<"/statistics/border_overhead_formula">},
    {"oversampling", "oversampling", "", Role::measure, true, value<"/statistics/oversampling">},
    {"rays", "rays", "", Role::measure, true, value<"/work/rays">},
    {"samples", "samples", "", Role::measure, true, value<"/work/samples">},
    {"regions", "regions", "", Role::measure, true, value<"/work/regions">},
    {"regions_skipped", "regions skipped", "", Role::measure, true, value<"/work/regions_skipped">},
    {"passes", "passes", "", Role::measure, true, value<"/work/passes">},
    {"rmse", "RMSE", "", Role::measure, true, value<"/error/rmse">},
    {"max_error", "max error", "", Role::measure, true, value<"/error/max">},
    {"p95_error", "95th percentile", "", Role::measure, true, value<"/error/p95">},
    {"within_tolerance", "within tolerance", "", Role::measure, true, value<"/error/within_tolerance">},
    {"mrse", "MRSE", "", Role::measure, true, value<"/error/mrse">},
    {"psnr", "PSNR (dB)", "", Role::measure, true, value<"/error/psnr_db">},
    {"psnr_common", "PSNR, common (dB)", "", Role::measure, true, value<"/error_common/psnr_db">},
    {"rmse_common", "RMSE, common", "", Role::measure, true, value<"/error_common/rmse">},
    {"p95_common", "95th percentile, common", "", Role::measure, true, value<"/error_common/p95">},
    {"check", "check", "", Role::measure, false, check_cell},
    {"split_step", "step", "", Role::measure, true, value<"/error/split/step/rmse">},
    {"split_encoding", "encoding", "", Role::measure, true, value<"/error/split/encoding/rmse">},
    {"split_storage", "storage", "", Role::measure, true, value<"/error/split/storage/rmse">},
    {"split_arithmetic", "arithmetic", "", Role::measure, true, value<"/error/split/arithmetic/rmse">},
    {"split_driver", "driver", "", Role::measure, true, value<"/error/split/driver/rmse">},
    {"split_filtering", "filtering", "", Role::measure, true, value<"/error/split/filtering/rmse">},
    {"split_early_end", "early end", "", Role::measure, true, value<"/error/split/early_end/rmse">},
    {"split_level_of_detail", "level of detail", "", Role::measure, true, value<"/error/split/level_of_detail/rmse">},
    {"split_filter", "filter", "", Role::measure, true, value<"/error/split/filter/rmse">},
    {"status", "status", "", Role::measure, false, status_cell},
};

/// Columns of the keys of a table that have one; their values stand below `pointer` of a record.
template <class T>
void add_columns(std::vector<ColumnRule>& columns, const SettingTable<T>& settings, const std::string& pointer) {
  for (const Setting<T>& row : settings.rows()) {
    const Key& key = row.key;
    if (key.column.label.empty()) continue;
    const auto cell = [place = pointer + key.in_record(), &key](const Json& record, const Group&) -> Cell {
      const Json& own = value_at(record, place);
      return key.column.only_where_given && own == key.default_value ? Cell() : cell_of(own);
    };
    columns.push_back({key.in_record(), key.column.label, "", Role::setting, key.column.numeric, cell});
  }
}

std::vector<ColumnRule> make_columns() {
  std::vector<ColumnRule> columns(std::begin(kFirstSettings), std::end(kFirstSettings));
  add_columns(columns, build_settings(), "/");
  add_columns(columns, scene_settings(), "/render/");
  columns.insert(columns.end(), std::begin(kLastSettings), std::end(kLastSettings));
  columns.insert(columns.end(), std::begin(kMeasures), std::end(kMeasures));
  return columns;
}

const std::vector<ColumnRule>& all_columns() {
  static const std::vector<ColumnRule> columns = make_columns();
  return columns;
}

/// The error by cause has a table of its own.
bool is_split(const ColumnRule& rule) { return std::string_view(rule.key).starts_with("split_"); }

/// Measures that a table has unless others are chosen.
bool is_default(const ColumnRule& rule) {
  if (is_split(rule)) return false;
  constexpr auto on_demand =
      std::to_array<std::string_view>({"check", "change", "left_out", "left_out_seconds", "p95_error", "within_tolerance",
                                       "baseline", "upload", "rays", "regions_skipped", "max_error", "mrse", "rmse_common",
                                       "p95_common", "pages", "border_overhead", "border_formula", "oversampling", "passes"});
  return std::find(on_demand.begin(), on_demand.end(), rule.key) == on_demand.end();
}

const ColumnRule& find_rule(std::string_view key) {
  for (const ColumnRule& rule : all_columns())
    if (key == rule.key) return rule;
  const auto keys = column_keys();
  throw UsageError(fmt::format("no column {}; accepted: {}{}", quote(key), fmt::join(keys, ", "), suggestion(key, keys)));
}

// --- the order of rows ---

std::size_t rank_in(const std::vector<std::string_view>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

std::size_t encoding_rank(const std::string& name) {
  std::vector<std::string_view> names;
  for (const Encoding* encoding : all_encodings()) names.push_back(encoding->name());
  return rank_in(names, name);
}

std::size_t filter_rank(const std::string& name) {
  std::vector<std::string_view> names;
  for (const Filter filter : all_filters()) names.push_back(filter_name(filter));
  return rank_in(names, name);
}

/// Settings by which rows are ordered; nlohmann orders mixed kinds and numbers by value.
Json order_key(const Json& record) {
  const std::string encoding = text_of(at(record, "/encoding")), filter = text_of(at(record, "/filter"));
  Json key = Json::array({at(record, "/dataset/name"), at(record, "/dataset/hash"), encoding_rank(encoding), encoding});
  if (const Json& parameters = at(record, "/build_parameters"); parameters.is_object())
    for (const auto& [name, parameter] : parameters.items()) key.push_back(parameter);
  for (const Json& part : {Json(filter_rank(filter)), Json(filter), at(record, "/storage"), at(record, "/filtering")})
    key.push_back(part);
  for (const char* pointer : {"/render/view_name", "/render/transfer_function_name", "/render/consumer", "/render/mode",
                              "/render/sampling", "/render/step", "/render/tolerance", "/render/width", "/render/height"})
    key.push_back(at(record, pointer));
  key.push_back(record.dump(-1, ' ', false, Json::error_handler_t::replace));  // ties must not depend on the order of files
  return key;
}

Records in_order(const Records& records) {
  std::vector<std::pair<Json, const Json*>> keyed;
  for (const Json* record : records) keyed.emplace_back(order_key(*record), record);
  std::sort(keyed.begin(), keyed.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  Records sorted;
  for (const auto& [key, record] : keyed) sorted.push_back(record);
  return sorted;
}

// --- one table ---

std::map<std::string, std::set<std::string>> varying_parameters(const Records& records, bool varying) {
  std::map<std::string, std::map<std::string, std::set<std::string>>> values;
  for (const Json* record : records)
    if (const Json& parameters = at(*record, "/build_parameters"); parameters.is_object())
      for (const auto& [key, parameter] : parameters.items())
        values[text_of(at(*record, "/encoding"))][key].insert(parameter.dump());
  std::map<std::string, std::set<std::string>> keys;
  for (const auto& [encoding, by_key] : values)
    for (const auto& [key, seen] : by_key)
      if ((seen.size() > 1) == varying) keys[encoding].insert(key);
  return keys;
}

Group group_of(const Records& records) {
  Group group{in_order(records), varying_parameters(records, true), {}};
  group.dense = dense_by_scene(group.records);
  return group;
}

std::vector<Cell> column_cells(const ColumnRule& rule, const Group& group) {
  std::vector<Cell> cells;
  for (const Json* record : group.records) cells.push_back(rule.cell(*record, group));
  return cells;
}

bool all_equal(const std::vector<Cell>& cells) {
  return std::all_of(cells.begin(), cells.end(), [&](const Cell& cell) { return exact_cell(cell) == exact_cell(cells.front()); });
}

bool all_absent(const std::vector<Cell>& cells) {
  return std::all_of(cells.begin(), cells.end(), [](const Cell& cell) { return std::holds_alternative<std::monostate>(cell); });
}

void add_column(Table& table, const ColumnRule& rule, const std::vector<Cell>& cells) {
  table.columns.push_back({rule.key, rule.label, rule.latex, rule.numeric});
  for (std::size_t row = 0; row < cells.size(); ++row) table.rows[row].push_back(cells[row]);
}

/// A picture that nothing vouches for is marked, whatever columns were chosen: its time may be that of a wrong one.
void mark_unchecked(Table& table, const Group& group, std::span<const Json* const> rows) {
  const std::vector<std::string> notes = unchecked_notes(rows);
  table.notes.insert(table.notes.end(), notes.begin(), notes.end());
  const bool chosen =
      std::any_of(table.columns.begin(), table.columns.end(), [](const Column& column) { return column.key == "check"; });
  if (notes.empty() || chosen) return;
  std::vector<Cell> cells;
  for (const Json* record : rows) cells.push_back(record != nullptr ? check_cell(*record, group) : Cell());
  add_column(table, find_rule("check"), cells);
}

/// Parameters that are the same in every record of their encoding.
void add_constant_parameters(Table& table, const Group& group) {
  for (const auto& [encoding, keys] : varying_parameters(group.records, false))
    for (const Json* record : group.records)
      if (text_of(at(*record, "/encoding")) == encoding) {
        table.constants.emplace_back(encoding, parameters_text(*record, keys));
        break;
      }
}

void add_default_columns(Table& table, const Group& group) {
  std::vector<std::string> absent;
  for (const ColumnRule& rule : all_columns()) {
    const std::vector<Cell> cells = column_cells(rule, group);
    if (rule.role == Role::setting && all_equal(cells) && std::string_view(rule.key) != "encoding") {
      if (!all_absent(cells)) table.constants.emplace_back(rule.label, format_cell(cells.front()));
    } else if (rule.role == Role::measure && all_absent(cells)) {
      if (is_default(rule)) absent.emplace_back(rule.label);
    } else if (rule.role == Role::setting || is_default(rule)) {
      add_column(table, rule, cells);
    }
  }
  if (!absent.empty()) table.notes.push_back(fmt::format("no values: {}", fmt::join(absent, ", ")));
}

void add_chosen_columns(Table& table, const Group& group, const std::vector<std::string>& keys) {
  for (const std::string& key : keys) add_column(table, find_rule(key), column_cells(find_rule(key), group));
  for (const ColumnRule& rule : all_columns()) {
    if (rule.role != Role::setting || std::find(keys.begin(), keys.end(), rule.key) != keys.end()) continue;
    const std::vector<Cell> cells = column_cells(rule, group);
    if (all_equal(cells) && !all_absent(cells)) table.constants.emplace_back(rule.label, format_cell(cells.front()));
  }
}

void add_counts(Table& table, const Records& records) {
  std::map<std::string, int> counts;
  for (const Json* record : records) ++counts[text_of(at(*record, "/status"))];
  if (counts.size() == 1 && counts.begin()->first == "ok") return;
  std::vector<std::string> parts;
  for (const auto& [status, count] : counts) parts.push_back(fmt::format("{} {}", count, status));
  table.notes.push_back(fmt::format("of {} points: {}", records.size(), fmt::join(parts, ", ")));
}

Table make_table(const std::string& experiment, const std::string& renderer, const Records& records,
                 const ReportOptions& options) {
  Table table;
  table.title = experiment;
  table.constants.emplace_back("renderer", renderer);
  const Group group = group_of(records);
  table.rows.resize(records.size());
  const auto chosen = options.columns.find(experiment);
  if (chosen == options.columns.end())
    add_default_columns(table, group);
  else
    add_chosen_columns(table, group, chosen->second);
  mark_unchecked(table, group, group.records);
  add_constant_parameters(table, group);
  add_counts(table, records);
  return table;
}

/// Root mean squares of the differences that each cause makes, where records hold them; what `filter` does is no part of the
/// error.
std::optional<Table> make_split_table(const std::string& experiment, const std::string& renderer, const Records& records) {
  Records explained;
  std::copy_if(records.begin(), records.end(), std::back_inserter(explained),
               [](const Json* record) { return at(*record, "/error/split").is_object(); });
  if (explained.empty()) return std::nullopt;
  Table table;
  table.title = experiment + ": error by cause (RMSE)";
  table.constants.emplace_back("renderer", renderer);
  const Group group = group_of(explained);
  table.rows.resize(explained.size());
  for (const ColumnRule& rule : all_columns()) {
    const std::vector<Cell> cells = column_cells(rule, group);
    const bool varies = rule.role == Role::setting && !all_equal(cells);
    if (varies || std::string_view(rule.key) == "encoding" || (is_split(rule) && !all_absent(cells)))
      add_column(table, rule, cells);
  }
  add_column(table, find_rule("rmse"), column_cells(find_rule("rmse"), group));
  table.columns.back().label = "all";
  return table;
}

}  // namespace

std::vector<std::string> unchecked_notes(std::span<const Json* const> records) {
  std::map<std::string, int> reasons;
  for (const Json* record : records)
    if (record != nullptr && is_unchecked(*record)) ++reasons[text_of(at(*record, "/check_reason"))];
  std::vector<std::string> notes;
  for (const auto& [reason, count] : reasons)
    notes.push_back(fmt::format("unchecked, {} of {} points: {}", count, records.size(), reason));
  return notes;
}

std::vector<const Json*> in_table_order(std::span<const Json* const> records) {
  return in_order({records.begin(), records.end()});
}

std::vector<std::string_view> column_keys() {
  std::vector<std::string_view> keys;
  for (const ColumnRule& rule : all_columns()) keys.emplace_back(rule.key);
  return keys;
}

std::vector<Table> make_tables(std::span<const Json> records, const ReportOptions& options) {
  std::map<std::pair<std::string, std::string>, Records> groups;
  const ContextNames contexts(records);
  for (const Json& record : records) groups[{text_of(at(record, "/experiment")), contexts.of(record)}].push_back(&record);
  std::vector<Table> tables;
  for (const auto& [names, members] : groups) {
    tables.push_back(make_table(names.first, names.second, members, options));
    if (auto split = make_split_table(names.first, names.second, members)) tables.push_back(std::move(*split));
  }
  return tables;
}

Table make_setting_table(std::string title, std::span<const Json* const> rows, std::span<const Json* const> all,
                         std::span<const std::string_view> measures) {
  Table table;
  table.title = std::move(title);
  table.rows.resize(rows.size());
  const Group group = group_of({all.begin(), all.end()});
  const auto add = [&](const ColumnRule& rule) {
    std::vector<Cell> cells;
    for (const Json* record : rows) cells.push_back(record != nullptr ? rule.cell(*record, group) : Cell());
    add_column(table, rule, cells);
  };
  for (const ColumnRule& rule : all_columns()) {
    if (rule.role != Role::setting) continue;
    const std::vector<Cell> cells = column_cells(rule, group);
    if (!all_equal(cells) || std::string_view(rule.key) == "encoding")
      add(rule);
    else if (!all_absent(cells))
      table.constants.emplace_back(rule.label, format_cell(cells.front()));
  }
  for (const std::string_view key : measures) add(find_rule(key));
  mark_unchecked(table, group, rows);
  add_constant_parameters(table, group);
  return table;
}

std::vector<std::string> read_columns(const std::filesystem::path& path) {
  const JsonFile file = JsonFile::read(path);
  if (!file.root().json().is_array()) file.root().fail("a list of column keys is expected");
  const auto keys = column_keys();
  std::vector<std::string> columns;
  for (const JsonNode& node : file.root().items()) columns.push_back(node.one_of(keys));
  return columns;
}

}  // namespace amrtex
