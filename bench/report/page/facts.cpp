#include "bench/report/page/facts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "bench/numbers/pareto.hpp"
#include "bench/report/plot.hpp"
#include "bench/report/report.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

constexpr double kMebibyte = 1048576.0;

double bytes_of(const Json& record) { return number_at(record, "/memory/total_bytes"); }

bool is_ok(const Json& record) { return text_at(record, "/status") == "ok"; }

std::vector<CostPoint> points_of(const Records& records, bool common, double (*cost)(const Json&)) {
  std::vector<CostPoint> points;
  for (const Json* record : records) {
    const bool ok = is_ok(*record);
    points.push_back({ok ? cost(*record) : kNoValue, ok ? share_of_peak(*record, error_pointer(common)) : kNoValue});
  }
  return points;
}

std::string decibels_text(double decibels) {
  if (std::isinf(decibels)) return "exact";
  return fmt::format("{:.1f} dB", decibels);
}

/// Numbers that are not there are left out.
std::string cost_text(const Json& record, bool common) {
  std::vector<std::string> parts;
  if (const double bytes = bytes_of(record); std::isfinite(bytes))
    parts.push_back(fmt::format("{} MiB", format_number(bytes / kMebibyte)));
  if (const double ms = time_of(record); std::isfinite(ms)) parts.push_back(fmt::format("{} ms", format_number(ms)));
  if (const double decibels = decibels_of(record, common); !std::isnan(decibels)) parts.push_back(decibels_text(decibels));
  return fmt::format("{}", fmt::join(parts, ", "));
}

/// A word speaks for itself; a number needs its name.
std::string part_text(const Column& column, const std::string& cell) {
  const bool bare = !column.numeric && cell != "true" && cell != "false";
  return bare ? cell : fmt::format("{} {}", column.label.substr(0, column.label.find(" (")), cell);
}

/// Of the records that were drawn, the one of the fewest bytes, of equal ones the fastest.
std::optional<std::size_t> smallest_of(const Records& records) {
  std::optional<std::size_t> best;
  const auto key = [&](std::size_t i) {
    const double ms = time_of(*records[i]);
    return std::pair(bytes_of(*records[i]), std::isfinite(ms) ? ms : std::numeric_limits<double>::infinity());
  };
  for (std::size_t i = 0; i < records.size(); ++i)
    if (is_ok(*records[i]) && std::isfinite(bytes_of(*records[i])) && (!best || key(i) < key(*best))) best = i;
  return best;
}

Answer answer(std::string asked, std::optional<std::size_t> record, const Records& records, const SceneFacts& facts) {
  if (!record) return {std::move(asked), record, "", ""};
  return {std::move(asked), record, facts.settings[*record], cost_text(*records[*record], facts.common)};
}

std::string smallest_sentence(const SceneFacts& facts) {
  const Answer& a = facts.answers.front();
  if (!a.record) return "Nothing was drawn, so nothing can be compared.";
  return fmt::format("The smallest is {}: {}.", a.setting, a.cost);
}

/// Errors whose answer is the same setting stand together.
std::string fastest_sentence(const SceneFacts& facts, bool judged, bool timed) {
  if (!facts.answers.front().record) return "";
  if (!judged) return "Errors were not measured, so nothing is said of which setting is exact enough.";
  if (!timed) return "Times were not measured, so nothing is said of which setting is the fastest.";
  std::vector<std::string> parts, unreached;
  for (std::size_t i = 1; i < facts.answers.size(); ++i) {
    const Answer& a = facts.answers[i];
    if (!a.record) {
      unreached.push_back(a.asked);
      continue;
    }
    std::vector<std::string> asked = {a.asked};
    while (i + 1 < facts.answers.size() && facts.answers[i + 1].record == a.record) asked.push_back(facts.answers[++i].asked);
    parts.push_back(fmt::format("at {} {} ({})", fmt::join(asked, " and "), a.setting, a.cost));
  }
  std::string text = parts.empty() ? "" : fmt::format("The fastest is {}", fmt::join(parts, "; "));
  if (!unreached.empty())
    text += fmt::format("{}o setting reaches {}", parts.empty() ? "N" : "; n", fmt::join(unreached, " or "));
  return text + ".";
}

}  // namespace

std::string error_pointer(bool common) { return common ? "/error_common" : "/error"; }

double decibels_of(const Json& record, bool common) {
  const double share = share_of_peak(record, error_pointer(common));
  return share == 0 ? std::numeric_limits<double>::infinity() : -20 * std::log10(share);
}

std::vector<std::string> setting_texts(const Records& records) {
  std::vector<std::string> texts;
  if (records.empty()) return texts;
  const Table table = make_setting_table("", records, records, {});
  for (const auto& row : table.rows) {
    std::vector<std::string> parts;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const Column& column = table.columns[c];
      if (column.key == "check" || std::holds_alternative<std::monostate>(row[c])) continue;
      parts.push_back(part_text(column, format_cell(row[c])));
    }
    texts.push_back(fmt::format("{}", fmt::join(parts, ", ")));
  }
  return texts;
}

SceneFacts facts_of(const ComparedScene& scene, bool common) {
  SceneFacts facts;
  facts.common = common;
  facts.settings = setting_texts(scene.records);
  const auto by_time = points_of(scene.records, common, time_of), by_bytes = points_of(scene.records, common, bytes_of);
  facts.time_front = pareto_front(by_time);
  facts.byte_front = pareto_front(by_bytes);
  facts.answers.push_back(answer("smallest", smallest_of(scene.records), scene.records, facts));
  for (const double decibels : kAskedDecibels)
    facts.answers.push_back(
        answer(fmt::format("{} dB", decibels), fastest_within(by_time, relative_rmse(decibels)), scene.records, facts));
  facts.smallest = smallest_sentence(facts);
  facts.fastest = fastest_sentence(facts, most_exact(by_bytes).has_value(), !facts.time_front.empty());
  return facts;
}

}  // namespace amrtex
