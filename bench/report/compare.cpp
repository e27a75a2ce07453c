#include "bench/report/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "bench/numbers/baseline_drift.hpp"
#include "bench/numbers/statistics.hpp"
#include "bench/records/record.hpp"
#include "bench/records/record_file.hpp"
#include "bench/report/contexts.hpp"
#include "bench/report/repetitions.hpp"
#include "bench/report/report.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

using Records = std::vector<const Json*>;

/// Bytes and what the pictures are; the same on every run of one program in one context.
constexpr const char* kBytes[] = {"/memory/total_bytes", "/memory/by_role/payload", "/memory/by_role/duplicated",
                                  "/memory/by_role/topology", "/memory/by_role/padding"};
constexpr const char* kPictures[] = {"/error/rmse",       "/error/p95",        "/error/max", "/error_common/rmse",
                                     "/error_common/p95", "/error_common/max", "/image_hash"};

std::string text_at(const Json& record, const char* pointer) {
  const Json& value = value_at(record, pointer);
  return value.is_string() ? value.get<std::string>() : "";
}

std::optional<double> above_zero(const Json& value) {
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  return std::isfinite(number) && number > 0 ? std::optional(number) : std::nullopt;
}

// --- one side ---

/// One folder by context and configuration, both in the order of the records.
struct Side {
  std::string name;
  std::vector<std::string> contexts;
  std::map<std::string, std::vector<std::string>> configurations;  ///< of each context
  std::map<std::pair<std::string, std::string>, Repetitions> points;
};

/// Points that failed before there was a context belong to the one that the others have.
std::string context_for_all(const std::vector<Json>& records) {
  std::set<std::string> keys;
  for (const Json& record : records)
    if (const std::string key = context_key(value_at(record, "/context")); !key.empty()) keys.insert(key);
  return keys.size() == 1 ? *keys.begin() : "";
}

void keep_last_programs(Side& side, std::vector<std::string>& notes) {
  std::size_t left_out = 0;
  std::set<std::string> programs;
  for (auto& [key, point] : side.points) {
    left_out += keep_last_program(point);
    programs.insert(text_at(*point.front(), "/implementation"));
  }
  if (left_out > 0) notes.push_back(fmt::format("{}: {} records of older programs are left out", side.name, left_out));
  if (programs.size() > 1) notes.push_back(fmt::format("{}: {} programs measured its points", side.name, programs.size()));
}

Side side_of(const ComparedFolder& folder, std::vector<std::string>& notes) {
  Side side{folder.name, {}, {}, {}};
  const std::string only = context_for_all(folder.records);
  for (const Json& record : folder.records) {
    const std::string configuration = text_at(record, "/configuration");
    if (configuration.empty())
      throw UsageError(
          fmt::format("{}: its records, of schema {}, do not say of which point they are; accepted: records of schema {}",
                      folder.name, quote(text_at(record, "/schema")), kRecordSchema));
    std::string context = context_key(value_at(record, "/context"));
    if (context.empty()) context = only;
    if (!side.configurations.contains(context)) side.contexts.push_back(context);
    Repetitions& point = side.points[{context, configuration}];
    if (point.empty()) side.configurations[context].push_back(configuration);
    point.push_back(&record);
  }
  if (side.points.empty())
    throw UsageError(fmt::format("{}: no records; accepted: a folder that `amrtex run` wrote", folder.name));
  keep_last_programs(side, notes);
  return side;
}

/// A context of A and the one of B that it is compared with.
struct ContextPair {
  std::string a, b;
  bool same() const { return a == b; }
};

std::vector<ContextPair> context_pairs(const Side& a, const Side& b, std::vector<std::string>& notes) {
  std::vector<ContextPair> pairs;
  const auto leave_out = [&](const Side& side, const Side& other) {
    const auto left = std::count_if(side.contexts.begin(), side.contexts.end(),
                                    [&](const std::string& key) { return !other.configurations.contains(key); });
    if (left > 0) notes.push_back(fmt::format("{}: {} contexts that {} lacks are left out", side.name, left, other.name));
  };
  for (const std::string& key : a.contexts)
    if (b.configurations.contains(key)) pairs.push_back({key, key});
  if (!pairs.empty()) {
    leave_out(a, b);
    leave_out(b, a);
    return pairs;
  }
  if (a.contexts.size() == 1 && b.contexts.size() == 1) return {{a.contexts.front(), b.contexts.front()}};
  throw UsageError(
      fmt::format("{} holds {} contexts and {} {}, none of them in both; accepted: folders with a context in common, or "
                  "with one each",
                  a.name, a.contexts.size(), b.name, b.contexts.size()));
}

// --- what is exact ---

/// The one value of all repetitions, or a list of those there are; null where none has one.
Json value_of(const Repetitions& point, const char* pointer) {
  Json values = Json::array();
  for (const Json* record : point)
    if (const Json& value = value_at(*record, pointer);
        !value.is_null() && std::find(values.begin(), values.end(), value) == values.end())
      values.push_back(value);
  if (values.empty()) return nullptr;
  return values.size() == 1 ? values.front() : values;
}

/// A point that failed once in eight is not one that is ok.
Json status_of(const Repetitions& point) {
  std::map<std::string, int> counts;
  for (const Json* record : point) ++counts[text_at(*record, "/status")];
  if (counts.size() == 1) return counts.begin()->first;
  std::vector<std::string> parts;
  for (const auto& [status, count] : counts) parts.push_back(fmt::format("{} {}", count, status));
  return fmt::format("{}", fmt::join(parts, ", "));
}

void add_differences(std::vector<Difference>& list, const Repetitions& a, const Repetitions& b, bool one_context) {
  const Json* record = &representative(a);
  const auto add = [&](const char* what, Json of_a, Json of_b, bool counts) {
    list.push_back({record, "", what, std::move(of_a), std::move(of_b), counts});
  };
  if (const Json of_a = status_of(a), of_b = status_of(b); of_a != of_b) add("status", of_a, of_b, true);
  const auto compare = [&](const char* pointer, bool counts) {
    const Json of_a = value_of(a, pointer), of_b = value_of(b, pointer);
    if (of_a.is_null() || of_b.is_null()) return;  // the status says so, or one run had no reference
    if (of_a != of_b || of_a.is_array()) add(pointer, of_a, of_b, counts);
  };
  for (const char* pointer : kBytes) compare(pointer, true);
  for (const char* pointer : kPictures)
    if (one_context || std::string_view(pointer) != "/image_hash") compare(pointer, one_context);
}

// --- times ---

/// Values of a point, a repetition each, and what its baselines were.
struct Times {
  std::map<int, double> relative, wall_ms, baseline_ms;
  std::size_t drifted = 0;
  bool has_baseline = false;
};

Times times_of(const Repetitions& point) {
  Times times;
  for (const Json* record : point) {
    const auto wall = above_zero(value_at(*record, "/frame/wall_ms/median"));
    if (!wall) continue;
    const Json& number = value_at(*record, "/repetition");
    const int repetition = number.is_number_integer() ? number.get<int>() : 0;
    const auto before = above_zero(value_at(*record, "/frame/baseline_ms/0"));
    const auto after = above_zero(value_at(*record, "/frame/baseline_ms/1"));
    if (before && after) {
      times.has_baseline = true;
      if (!baselines_agree(*before, *after)) {
        ++times.drifted;
        continue;
      }
      times.baseline_ms[repetition] = (*before + *after) / 2;
      if (const auto relative = above_zero(value_at(*record, "/frame/relative"))) times.relative[repetition] = *relative;
    }
    times.wall_ms[repetition] = *wall;
  }
  return times;
}

/// A pair of points, before verdicts.
struct Pair {
  const Json *a, *b;
  Times times_a, times_b;
  bool one_context;
};

RepeatedRow repeated(const Pair& pair, std::map<int, double> Times::*what) { return {pair.times_a.*what, pair.times_b.*what}; }

std::vector<double> values(const std::map<int, double>& by_repetition) {
  std::vector<double> list;
  for (const auto& [repetition, value] : by_repetition) list.push_back(value);
  return list;
}

MeasuredRow row_of(const Pair& pair, std::map<int, double> Times::*what) {
  return {values(pair.times_a.*what), values(pair.times_b.*what), pair.times_a.drifted, pair.times_b.drifted};
}

bool has_relative(const Pair& pair) { return pair.times_a.has_baseline && pair.times_b.has_baseline; }

/// Verdicts of some of the pairs, one family.
template <class Wanted>
void compare_pairs(const std::vector<Pair>& pairs, std::vector<ComparedPoint>& points, std::map<int, double> Times::*what,
                   std::optional<Comparison> ComparedPoint::*into, const ComparisonRules& rules, Wanted wanted) {
  std::vector<std::size_t> places;
  std::vector<MeasuredRow> rows;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (wanted(pairs[i])) {
      places.push_back(i);
      rows.push_back(row_of(pairs[i], what));
    }
  std::vector<Comparison> comparisons = compare_rows(rows, rules);
  for (std::size_t i = 0; i < places.size(); ++i) points[places[i]].*into = std::move(comparisons[i]);
}

// --- lines ---

/// Pairs that have something in common.
struct Group {
  std::string name;
  std::vector<std::size_t> pairs;
};

template <class KeyOf>
std::vector<Group> groups_by(const std::vector<Pair>& pairs, KeyOf key_of_pair) {
  std::map<std::string, std::size_t> places;
  std::vector<Group> groups;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto [key, name] = key_of_pair(i);
    if (key.empty()) continue;
    const auto [place, added] = places.try_emplace(key, groups.size());
    if (added) groups.push_back({name, {}});
    groups[place->second].pairs.push_back(i);
  }
  return groups;
}

std::vector<ComparedLine> compare_lines(const std::vector<Group>& groups, const std::vector<MeasuredRow>& rows,
                                        const ComparisonRules& rules) {
  std::vector<Comparison> comparisons = compare_rows(rows, rules);
  std::vector<ComparedLine> lines;
  for (std::size_t i = 0; i < groups.size(); ++i)
    lines.push_back({groups[i].name, groups[i].pairs.size(), std::move(comparisons[i]), ""});
  return lines;
}

/// A key of some pairs, and what the line that they have together is called; no key: no part of a line.
using KeyAndName = std::pair<std::string, std::string>;

/// `name`, and the context where there are several.
KeyAndName line_key(const ComparedPoint& point, const FolderComparison& result, Json key, std::string name) {
  key.push_back(point.context);
  const bool several = std::any_of(result.points.begin(), result.points.end(),
                                   [&](const ComparedPoint& other) { return other.context != point.context; });
  if (several) name += ", " + point.context;
  return {key.dump(), name};
}

std::vector<Group> baseline_groups(const std::vector<Pair>& pairs, const FolderComparison& result) {
  return groups_by(pairs, [&](std::size_t i) -> KeyAndName {
    const Pair& pair = pairs[i];
    if (!pair.one_context || !has_relative(pair)) return {};
    const std::string name = text_at(*pair.a, "/dataset/name");
    const Json key = Json::array({value_at(*pair.a, "/dataset/exact_hash"), name});
    return line_key(result.points[i], result, key, "baseline of " + name);
  });
}

/// All readings of all points of a repetition together; readings that drifted are not among them.
MeasuredRow pooled_row(const Group& group, const std::vector<Pair>& pairs, std::map<int, double> Times::*what) {
  std::vector<RepeatedRow> rows;
  std::size_t drifted_a = 0, drifted_b = 0;
  for (const std::size_t i : group.pairs) {
    rows.push_back(repeated(pairs[i], what));
    drifted_a = std::max(drifted_a, pairs[i].times_a.drifted);
    drifted_b = std::max(drifted_b, pairs[i].times_b.drifted);
  }
  MeasuredRow row = pooled(rows);
  if (row.a.empty() || row.b.empty()) {  // else the other points' readings stand for those that drifted
    row.drifted_a = drifted_a;
    row.drifted_b = drifted_b;
  }
  return row;
}

/// Did the baseline change and its rows did not? Then ratios to it changed, and rows go by their times. Else whatever changed,
/// the program or the machine, changed all alike, and ratios are right.
bool changed_alone(const ComparedLine& line, const Group& group, const std::vector<ComparedPoint>& points) {
  const Verdict verdict = line.comparison.verdict;
  if (verdict != Verdict::slower && verdict != Verdict::faster) return false;
  std::vector<double> logs;
  for (const std::size_t i : group.pairs)
    if (const auto& time = points[i].time; time && time->n_a > 0 && time->n_b > 0) logs.push_back(std::log(time->interval.ratio));
  if (logs.empty()) return false;
  const double rows = median(logs), baseline = std::log(line.comparison.interval.ratio);
  return std::abs(rows) < std::abs(rows - baseline);
}

/// Times of one day beside those of another.
std::string order_note(const Records& a, const Records& b) {
  const auto dates = [](const Records& records) {
    std::set<std::string> all;
    for (const Json* record : records)
      if (const std::string date = text_at(*record, "/context/date"); !date.empty()) all.insert(date);
    return all;
  };
  const std::set<std::string> of_a = dates(a), of_b = dates(b);
  if (of_a.empty() || of_b.empty()) return "";
  const bool apart = *of_a.rbegin() < *of_b.begin() || *of_b.rbegin() < *of_a.begin();
  return apart ? "one side was measured after the other: a machine that changed its speed in between looks the same" : "";
}

void judge_baselines(FolderComparison& result, const std::vector<Group>& groups, const std::vector<Pair>& pairs,
                     const std::string& order) {
  for (std::size_t g = 0; g < groups.size(); ++g) {
    ComparedLine& line = result.baselines[g];
    const Verdict verdict = line.comparison.verdict;
    if (verdict != Verdict::slower && verdict != Verdict::faster) continue;
    if (changed_alone(line, groups[g], result.points)) {
      line.note = "its points did not change with it: they go by their times";
      for (const std::size_t i : groups[g].pairs) result.points[i].by_time = true;
    } else {
      line.note = "its points changed with it: the whole program, or the machine";
      if (!order.empty()) line.note += "; " + order;
    }
  }
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (!has_relative(pairs[i])) result.points[i].by_time = true;
}

void give_verdicts(FolderComparison& result, const std::vector<Pair>& pairs) {
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    ComparedPoint& point = result.points[i];
    const std::optional<Comparison>& deciding = point.by_time ? point.time : point.relative;
    if (deciding) {
      point.verdict = deciding->verdict;
      point.reason = deciding->reason;
    } else {
      point.reason = "no baseline beside it, and times of two contexts are not compared";
    }
  }
}

std::vector<ComparedLine> compare_encodings(const FolderComparison& result, const std::vector<Pair>& pairs) {
  std::vector<Group> groups = groups_by(pairs, [&](std::size_t i) -> KeyAndName {
    const ComparedPoint& point = result.points[i];
    if (point.by_time && !pairs[i].one_context) return {};
    const std::string name = text_at(*pairs[i].a, "/encoding");
    return line_key(point, result, Json::array({name, point.by_time}), name);
  });
  std::erase_if(groups, [](const Group& group) { return group.pairs.size() < 2; });
  std::vector<MeasuredRow> rows;
  for (const Group& group : groups)
    rows.push_back(pooled_row(group, pairs, result.points[group.pairs.front()].by_time ? &Times::wall_ms : &Times::relative));
  return compare_lines(groups, rows, result.rules);
}

// --- pairs ---

Records paired(const Side& side, const std::string& context, const Side& other, const std::string& other_context, Records& only) {
  Records records;
  for (const std::string& configuration : side.configurations.at(context)) {
    const Json* record = &representative(side.points.at({context, configuration}));
    (other.points.contains({other_context, configuration}) ? records : only).push_back(record);
  }
  return records;
}

Pair pair_of(const Repetitions& a, const Repetitions& b, bool one_context) {
  return {&representative(a), &representative(b), times_of(a), times_of(b), one_context};
}

/// Have both sides a point with a time?
bool both_timed(const Pair& pair) {
  const auto timed = [](const Times& times) { return !times.wall_ms.empty() || times.drifted > 0; };
  return timed(pair.times_a) && timed(pair.times_b);
}

/// Fills what is exact, and returns pairs with times.
std::vector<Pair> pair_points(const Side& a, const Side& b, FolderComparison& result) {
  std::vector<Pair> pairs;
  std::size_t common = 0;
  for (const ContextPair& contexts : context_pairs(a, b, result.notes)) {
    result.one_context = result.one_context && contexts.same();
    paired(b, contexts.b, a, contexts.a, result.only_b);
    const Records records = paired(a, contexts.a, b, contexts.b, result.only_a);
    common += records.size();
    for (const Json* record : in_table_order(records)) {
      const std::string configuration = text_at(*record, "/configuration");
      const Repetitions &of_a = a.points.at({contexts.a, configuration}), &of_b = b.points.at({contexts.b, configuration});
      add_differences(result.differences, of_a, of_b, contexts.same());
      Pair pair = pair_of(of_a, of_b, contexts.same());
      if (both_timed(pair)) pairs.push_back(std::move(pair));
    }
  }
  if (common == 0)
    throw UsageError(
        fmt::format("{} and {} have no point in common, of {} and {}; accepted: two runs of one experiment, with the same "
                    "data, settings and frames",
                    a.name, b.name, a.points.size(), b.points.size()));
  return pairs;
}

Records all_records(const ComparedFolder& folder) {
  Records records;
  for (const Json& record : folder.records) records.push_back(&record);
  return records;
}

}  // namespace

FolderComparison compare_folders(const ComparedFolder& a, const ComparedFolder& b, const ComparisonRules& rules) {
  FolderComparison result;
  result.rules = rules;
  result.name_a = a.name;
  result.name_b = b.name;
  const std::vector<Pair> pairs = pair_points(side_of(a, result.notes), side_of(b, result.notes), result);
  const ContextNames contexts(a.records);
  for (Difference& difference : result.differences) difference.context = contexts.of(*difference.record);
  for (const Pair& pair : pairs)
    result.points.push_back({pair.a, pair.b, contexts.of(*pair.a), {}, {}, false, Verdict::cannot_tell, ""});
  const auto one_context = [](const Pair& pair) { return pair.one_context; };
  compare_pairs(pairs, result.points, &Times::relative, &ComparedPoint::relative, rules, has_relative);
  compare_pairs(pairs, result.points, &Times::wall_ms, &ComparedPoint::time, rules, one_context);
  const std::vector<Group> groups = baseline_groups(pairs, result);
  std::vector<MeasuredRow> rows;
  for (const Group& group : groups) rows.push_back(pooled_row(group, pairs, &Times::baseline_ms));
  result.baselines = compare_lines(groups, rows, rules);
  judge_baselines(result, groups, pairs, order_note(all_records(a), all_records(b)));
  give_verdicts(result, pairs);
  result.encodings = compare_encodings(result, pairs);
  result.smallest_repeat = smallest_repeat(pairs.size(), rules.level);
  return result;
}

bool has_findings(const FolderComparison& comparison) {
  const auto slower = [](const ComparedLine& line) { return line.comparison.verdict == Verdict::slower; };
  return std::any_of(comparison.differences.begin(), comparison.differences.end(),
                     [](const Difference& d) { return d.counts; }) ||
         std::any_of(comparison.points.begin(), comparison.points.end(),
                     [](const ComparedPoint& p) { return p.verdict == Verdict::slower; }) ||
         std::any_of(comparison.baselines.begin(), comparison.baselines.end(), slower) ||
         std::any_of(comparison.encodings.begin(), comparison.encodings.end(), slower);
}

}  // namespace amrtex
