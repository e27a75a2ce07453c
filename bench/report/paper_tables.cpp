#include "bench/report/paper_tables.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>

#include "bench/records/record.hpp"
#include "bench/records/record_conditions.hpp"
#include "bench/report/contexts.hpp"
#include "bench/report/report.hpp"
#include "bench/settings/json_file.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

/// What is read from the records, up to the row's scale.
struct Quantity {
  JsonNode node;
  std::string label;
  Conditions where;
  std::vector<std::string> pointers;  ///< summed
  bool inverse = false;
};

struct Row {
  Quantity ours;
  std::optional<Quantity> over;
  double scale = 1;
  std::vector<Cell> paper;  ///< by data set; may be shorter
};

struct Entry {
  std::string title;
  std::vector<std::string> notes;
  std::vector<std::string> datasets;
  std::vector<Row> rows;
};

// --- the file ---

/// Without a `value` of its own it is the quantity `like`, of other records.
Quantity read_quantity(const JsonNode& node, const std::string& label, const Conditions& where, const Quantity* like) {
  Quantity quantity{node, label, read_conditions(node, where), {}, false};
  if (like != nullptr && !node.find("value")) {
    quantity.pointers = like->pointers;
    quantity.inverse = like->inverse;
  } else {
    for (const JsonNode& pointer : node.require("value").items()) {
      quantity.pointers.push_back(pointer.text());
      check_record_pointer(pointer, quantity.pointers.back());
    }
  }
  if (const auto inverse = node.find("inverse")) quantity.inverse = inverse->boolean();
  return quantity;
}

Cell paper_cell(const JsonNode& node) {
  const Json& json = node.json();
  if (json.is_null()) return std::monostate();
  if (json.is_number_integer()) return json.get<std::int64_t>();
  if (json.is_number()) return json.get<double>();
  if (json.is_string()) return json.get<std::string>();
  node.fail("a number, a text or null is expected");
}

std::vector<Cell> read_paper(const JsonNode& node, std::size_t datasets) {
  std::vector<Cell> cells;
  for (const JsonNode& value : node.items()) cells.push_back(paper_cell(value));
  if (cells.size() > datasets)
    node.fail(fmt::format("{} values for {} data sets; accepted: at most one for each", cells.size(), datasets));
  return cells;
}

Row read_row(const JsonNode& node, std::size_t datasets, const Conditions& where) {
  constexpr std::array<std::string_view, 7> keys = {"label", "where", "value", "inverse", "scale", "over", "paper"};
  constexpr std::array<std::string_view, 3> over_keys = {"where", "value", "inverse"};
  node.accept_keys(keys);
  const std::string label = node.require("label").text();
  Row row{read_quantity(node, label, where, nullptr), std::nullopt, 1, {}};
  if (const auto over = node.find("over")) {
    over->accept_keys(over_keys);
    row.over = read_quantity(*over, label, where, &row.ours);
    row.over->inverse = !row.over->inverse;  // so that the row is a product
  }
  if (const auto scale = node.find("scale")) row.scale = scale->positive_number();
  if (const auto paper = node.find("paper")) row.paper = read_paper(*paper, datasets);
  return row;
}

Entry read_entry(const JsonNode& node) {
  constexpr std::array<std::string_view, 5> keys = {"title", "notes", "datasets", "where", "rows"};
  node.accept_keys(keys);
  Entry entry;
  entry.title = node.require("title").text();
  if (const auto notes = node.find("notes"))
    for (const JsonNode& note : notes->items()) entry.notes.push_back(note.text());
  for (const JsonNode& name : node.require("datasets").items()) {
    if (std::find(entry.datasets.begin(), entry.datasets.end(), name.text()) != entry.datasets.end())
      name.fail(fmt::format("the data set {} is given twice", quote(name.text())));
    entry.datasets.push_back(name.text());
  }
  const Conditions where = read_conditions(node, {});
  for (const JsonNode& row : node.require("rows").items()) entry.rows.push_back(read_row(row, entry.datasets.size(), where));
  return entry;
}

// --- what the records say ---

Json at(const Json& json, const std::string& pointer) { return value_at(json, pointer); }

struct Amount {
  double value;
  std::optional<double> deviation;  ///< of a timing
  bool whole;                       ///< a count, told without rounding
  bool operator==(const Amount&) const = default;
};

/// Nothing where the record has no value there.
std::optional<Amount> amount_at(const Json& record, const std::string& pointer, const JsonNode& node) {
  const Json json = at(record, pointer);
  if (json.is_null()) return std::nullopt;
  if (json.is_number()) return Amount{json.get<double>(), std::nullopt, json.is_number_integer()};
  const Json median = at(json, "/median"), mad = at(json, "/mad");
  if (!median.is_number() || !mad.is_number())
    node.fail(fmt::format("{} is no number in a record; accepted: a number, or a timing as /frame/wall_ms", clipped(pointer)));
  return Amount{median.get<double>(), mad.get<double>(), false};
}

std::optional<Amount> amount_of(const Json& record, const Quantity& quantity) {
  Amount sum{0, std::nullopt, true};
  for (const std::string& pointer : quantity.pointers) {
    const auto part = amount_at(record, pointer, quantity.node);
    if (!part) return std::nullopt;
    sum.value += part->value;
    sum.whole = sum.whole && part->whole;
    if (quantity.pointers.size() == 1) sum.deviation = part->deviation;  // a sum's spread is not that of its parts
  }
  if (!quantity.inverse) return sum;
  if (sum.value == 0) return std::nullopt;
  if (sum.deviation) *sum.deviation /= sum.value * sum.value;  // to first order
  return Amount{1 / sum.value, sum.deviation, false};
}

/// Settings by which the records could be told apart, to be named in a complaint.
std::vector<std::string> differing_settings(const Records& records) {
  std::map<std::string, std::map<std::string, std::size_t>> seen;  // pointer -> value -> records
  for (const Json* record : records) {
    Json settings;
    for (const char* key : {"dataset", "encoding", "build_parameters", "filter", "storage", "filtering", "render"})
      settings[key] = record->at(key);
    if (settings["render"].is_object())
      for (const char* key : {"view", "transfer_function", "more_transfer_functions"})
        settings["render"].erase(key);  // they have names
    const Json flat = settings.flatten();
    for (const auto& [pointer, value] : flat.items()) ++seen[pointer][value.dump()];
  }
  std::vector<std::string> differing;
  for (const auto& [pointer, values] : seen)
    if (values.begin()->second < records.size()) differing.push_back(pointer);
  if (differing.empty()) differing.emplace_back("no setting");
  return differing;
}

[[noreturn]] void fail_ambiguous(const Quantity& quantity, const std::string& dataset, const Records& matches) {
  quantity.node.fail(fmt::format("row {}, data set {}: {} records with different values match; they differ in: {}",
                                 quote(quantity.label), quote(dataset), matches.size(),
                                 fmt::join(differing_settings(matches), ", ")));
}

struct Finding {
  std::optional<Amount> amount;
  std::string status;  ///< where no record is ok
  std::string note;    ///< why there is no amount, or what it passes over
};

Finding find_amount(const Quantity& quantity, const std::string& dataset, const Records& records) {
  Conditions where = quantity.where;
  where.values.try_emplace("/dataset/name", dataset);  // a row may choose another data set for all columns
  std::map<std::string, Records> by_status;
  for (const Json* record : records)
    if (matches(*record, where)) by_status[record->at("status")].push_back(record);
  const Records ok = by_status["ok"];
  by_status.erase("ok");
  const std::string others = fmt::format("{}", fmt::join(by_status | std::views::keys, ", "));
  if (ok.empty()) return {std::nullopt, others, others.empty() ? "no record" : ""};
  const auto amount = amount_of(*ok.front(), quantity);
  for (const Json* record : ok)
    if (amount_of(*record, quantity) != amount) fail_ambiguous(quantity, dataset, ok);
  if (!amount) return {amount, "", fmt::format("no value at {}", fmt::join(quantity.pointers, " + "))};
  return {amount, "", others.empty() ? "" : "other records are " + others};
}

// --- one table ---

using Notes = std::map<std::string, std::vector<std::string>>;  ///< note -> the cells that it is about

Cell cell_of(const Amount& amount, double scale) {
  if (amount.deviation) return Spread{amount.value * scale, *amount.deviation * scale};
  if (amount.whole && scale == 1) return static_cast<std::int64_t>(amount.value);
  return amount.value * scale;
}

Cell our_cell(const Row& row, const std::string& dataset, const Records& records, Notes& notes) {
  std::optional<Amount> result;
  for (const auto& [quantity, prefix] : {std::pair(&row.ours, ""), std::pair(row.over ? &*row.over : nullptr, "over: ")}) {
    if (quantity == nullptr) continue;
    const Finding found = find_amount(*quantity, dataset, records);
    if (!found.note.empty()) notes[prefix + found.note].push_back(fmt::format("{} of {}", row.ours.label, dataset));
    if (!found.status.empty()) return prefix + found.status;
    if (!found.amount) return std::monostate();
    result = result ? Amount{result->value * found.amount->value, std::nullopt, false} : *found.amount;
  }
  return cell_of(*result, row.scale);
}

void add_column(Table& table, const std::string& dataset, const std::string& whose, const std::vector<Cell>& cells) {
  table.columns.push_back({dataset + "_" + whose, dataset + ", " + whose, "", true});
  for (std::size_t row = 0; row < cells.size(); ++row) table.rows[row].push_back(cells[row]);
}

Table make_table(const Entry& entry, const std::string& context, const Records& records) {
  Table table{entry.title, {{"renderer", context}}, entry.notes, {{"row", "quantity", "", false}}, {}};
  Notes notes;
  for (const Row& row : entry.rows) table.rows.push_back({row.ours.label});
  for (std::size_t i = 0; i < entry.datasets.size(); ++i) {
    std::vector<Cell> ours, paper;
    for (const Row& row : entry.rows) {
      ours.push_back(our_cell(row, entry.datasets[i], records, notes));
      paper.push_back(i < row.paper.size() ? row.paper[i] : Cell());
    }
    add_column(table, entry.datasets[i], "ours", ours);
    const bool in_paper = std::any_of(paper.begin(), paper.end(), [](const Cell& cell) { return cell.index() != 0; });
    if (in_paper) add_column(table, entry.datasets[i], "paper", paper);
  }
  Records shown;
  std::copy_if(records.begin(), records.end(), std::back_inserter(shown), [&](const Json* record) {
    const Json name = at(*record, "/dataset/name");
    return name.is_string() &&
           std::find(entry.datasets.begin(), entry.datasets.end(), name.get<std::string>()) != entry.datasets.end();
  });
  for (const std::string& note : unchecked_notes(shown)) table.notes.push_back(note);
  for (const auto& [note, cells] : notes) table.notes.push_back(fmt::format("{}: {}", note, fmt::join(cells, "; ")));
  return table;
}

}  // namespace

std::vector<Table> make_paper_tables(const std::filesystem::path& path, std::span<const Json> records) {
  const JsonFile file = JsonFile::read(path);
  std::vector<Entry> entries;
  for (const JsonNode& node : file.root().items())
    if (!node.find("work_precision") && !node.find("scatter")) entries.push_back(read_entry(node));  // those make diagrams
  std::map<std::string, Records> by_context;
  const ContextNames contexts(records);
  for (const Json& record : records) by_context[contexts.of(record)].push_back(&record);
  std::vector<Table> tables;
  for (const Entry& entry : entries)
    for (const auto& [context, members] : by_context) tables.push_back(make_table(entry, context, members));
  return tables;
}

}  // namespace amrtex
