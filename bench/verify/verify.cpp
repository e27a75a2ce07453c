#include "bench/verify/verify.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include "structures/mesh/quoted.hpp"

namespace amrtex::verify {
namespace {

constexpr std::array<Suite, 9> kSuites{{
    {"analytic", "pictures and values with a closed form, continuity", analytic_suite},
    {"convergence", "observed orders in step, cells, pixels and isosurfaces", convergence_suite},
    {"stiff", "extinction from 0 to infinity, steps and spikes, thin shells", stiff_suite},
    {"extreme", "24 levels, jumps of 4096, any scale of space and values, what has no value", extreme_suite},
    {"geometry", "rays from anywhere in any direction; segments sum to the chord", geometry_suite},
    {"differential", "encodings against the reference, each other, GL and memory", differential_suite},
    {"metamorphic", "pictures that a change of the input must leave alone", metamorphic_suite},
    {"reference", "the reference itself, which all others are judged by: stiff media in closed form", reference_suite},
    {"scales", "cells, values, products and levels of any scale; light that samples miss", scales_suite},
}};

std::string parameters_text(const Json& parameters) {
  std::string text;
  for (const auto& [key, value] : parameters.items())
    text += fmt::format("{}{}={}", text.empty() ? "" : " ", key, value.is_string() ? value.get<std::string>() : value.dump());
  return text;
}

Cell text_or_none(const std::string& text) { return text.empty() ? Cell() : Cell(text); }

std::string who(std::string_view encoding, std::string_view filter) {
  return encoding.empty() ? "" : fmt::format("{} {}", encoding, filter);
}

std::vector<Column> case_columns() {
  return {{"name", "case", "", false},     {"encoding", "encoding", "", false}, {"parameters", "parameters", "", false},
          {"filter", "filter", "", false}, {"expected", "expected", "", false}, {"observed", "observed", "", false},
          {"pass", "pass", "", false}};
}
std::vector<Cell> case_row(const Outcome& o) {
  return {o.name,           text_or_none(o.encoding), text_or_none(parameters_text(o.parameters)), text_or_none(o.filter),
          o.check.expected, o.check.observed,         std::string(o.check.pass ? "yes" : "NO")};
}

struct Tally {
  int passed = 0, failed = 0, skipped = 0;
  std::string text() const {
    if (failed > 0) return fmt::format("{} of {} FAIL", failed, passed + failed);
    if (passed > 0) return fmt::format("{}", passed);
    return skipped > 0 ? "skipped" : "";
  }
};

}  // namespace

Check at_most(double observed, double bound) {
  return {fmt::format("<= {}", format_number(bound)), format_number(observed), observed <= bound};
}
Check above(double observed, double bound) {
  return {fmt::format("> {}", format_number(bound)), format_number(observed), observed > bound};
}
Check near(double observed, double centre, double tolerance) {
  return {fmt::format("{} ± {}", format_number(centre), format_number(tolerance)), format_number(observed),
          std::abs(observed - centre) <= tolerance};
}
Check holds(bool pass, std::string expected, std::string observed) { return {std::move(expected), std::move(observed), pass}; }
Check all_of(std::span<const Check> checks) {
  const auto failed = std::find_if(checks.begin(), checks.end(), [](const Check& c) { return !c.pass; });
  return failed != checks.end() ? *failed : checks.front();
}

std::size_t Report::failed() const {
  return static_cast<std::size_t>(std::count_if(cases.begin(), cases.end(), [](const Outcome& o) { return !o.check.pass; }));
}

VerifyContext::VerifyContext(VerifyOptions options, Report& report)
    : options_(std::move(options)), report_(&report), gl_(make_context(options_.context)) {
  for (const EncodingCase& c : make_encoding_cases(handle_limits(gl_->info()))) {
    if (!variants_.empty() && variants_.back().encoding == c.encoding && variants_.back().filter == c.filter)
      filters_.back() = c;
    else
      filters_.push_back(c);
    variants_.push_back(c);
  }
}
VerifyContext::~VerifyContext() = default;

EncodedField VerifyContext::build(const AmrHierarchy& mesh, const EncodingCase& c, const BuildOptions& options) const {
  const Support support = c.encoding->supported(gl_->info());
  if (!support.ok) throw UnsupportedError(support.reason);
  BuildOptions limited = options;
  limited.memory_limit = kMemoryLimit;
  EncodedField field = verify::build(mesh, c, limited);
  if (options_.tamper) options_.tamper(field);
  return field;
}

void VerifyContext::add(const std::string& name, const EncodingCase* c, Check check) {
  report_->cases.push_back({suite_, name, c != nullptr ? std::string(c->encoding->name()) : "",
                            c != nullptr ? std::string(filter_name(c->filter)) : "", c != nullptr ? c->parameters : Json(),
                            std::move(check)});
}

void VerifyContext::skip(const std::string& name, const EncodingCase* c, std::string reason) {
  report_->skipped.push_back({suite_, name, c != nullptr ? std::string(c->encoding->name()) : "",
                              c != nullptr ? std::string(filter_name(c->filter)) : "", std::move(reason)});
}

void VerifyContext::tell(const std::string& name) const {
  if (options_.progress) options_.progress(suite_ + ": " + name);
}

void VerifyContext::for_each(const std::string& name, std::span<const EncodingCase> cases, const Body& body) {
  tell(name);
  std::size_t turn = asked_++;
  for (const EncodingCase& c : cases) try {
      if (turn++ % options_.one_in != 0) {
        skip(name, &c, fmt::format("one in {} is asked", options_.one_in));
        continue;
      }
      const Verdict verdict = options_.list ? NotAsked{"listed"} : body(c);
      if (const Check* check = std::get_if<Check>(&verdict))
        add(name, &c, *check);
      else
        skip(name, &c, std::get<NotAsked>(verdict).why);
    } catch (const UnsupportedError& e) {
      skip(name, &c, e.what());
    } catch (const BudgetError& e) {
      skip(name, &c, e.what());
    } catch (const std::exception& e) {
      add(name, &c, {"no error", e.what(), false});
    }
}

void VerifyContext::once(const std::string& name, const std::function<Check()>& body) {
  tell(name);
  if (options_.list) return skip(name, nullptr, "listed");
  try {
    add(name, nullptr, body());
  } catch (const std::exception& e) {
    add(name, nullptr, {"no error", e.what(), false});
  }
}

std::span<const Suite> suites() { return kSuites; }

const Suite& find_suite(std::string_view name) {
  std::vector<std::string_view> names;
  for (const Suite& s : kSuites) {
    if (s.name == name) return s;
    names.push_back(s.name);
  }
  throw UsageError(fmt::format("no suite {}; accepted: {}", quote(name), fmt::join(names, ", ")));
}

Json to_json(const Report& report) {
  const auto or_null = [](const std::string& text) { return text.empty() ? Json() : Json(text); };
  Json json{{"cases", Json::array()}, {"skipped", Json::array()}};
  for (const Outcome& o : report.cases)
    json["cases"].push_back({{"suite", o.suite},
                             {"name", o.name},
                             {"encoding", or_null(o.encoding)},
                             {"parameters", o.parameters},
                             {"filter", or_null(o.filter)},
                             {"expected", o.check.expected},
                             {"observed", o.check.observed},
                             {"pass", o.check.pass}});
  for (const Skipped& s : report.skipped)
    json["skipped"].push_back({{"suite", s.suite},
                               {"name", s.name},
                               {"encoding", or_null(s.encoding)},
                               {"filter", or_null(s.filter)},
                               {"reason", s.reason}});
  return json;
}

std::vector<Table> to_tables(const Report& report) {
  std::vector<Table> tables{coverage(report)};
  for (const Suite& suite : kSuites) {
    Table table;
    table.title = fmt::format("{}: {}", suite.name, suite.asks);
    table.columns = case_columns();
    for (const Outcome& o : report.cases)
      if (o.suite == suite.name) table.rows.push_back(case_row(o));
    if (!table.rows.empty()) tables.push_back(std::move(table));
  }
  if (!report.skipped.empty()) tables.push_back(skipped(report));
  return tables;
}

int list_number(std::string_view name) {
  int number = 0;
  std::from_chars(name.data(), name.data() + name.size(), number);
  return number;
}

bool is_control(std::string_view name) { return name.find(" control: ") != std::string_view::npos; }

Table coverage(const Report& report) {
  std::vector<std::string> columns;  // "" first: cases without encodings
  std::map<std::string, std::map<int, Tally>> tallies;
  const auto tally = [&](const auto& row) -> Tally& {
    const std::string column = who(row.encoding, row.filter);
    if (!tallies.contains(column)) columns.push_back(column);
    return tallies[column][list_number(row.name)];
  };
  for (const Outcome& o : report.cases) ++(o.check.pass ? tally(o).passed : tally(o).failed);
  for (const Skipped& s : report.skipped) ++tally(s).skipped;
  std::stable_partition(columns.begin(), columns.end(), [](const std::string& c) { return c.empty(); });

  Table table;
  table.title = "the list: cases passed, by number";
  table.columns = {{"number", "number", "", true}, {"controls", "of these controls", "", true}};
  for (const std::string& c : columns) table.columns.push_back({c, c.empty() ? "no encoding" : c, "", true});
  for (int number = 1; number <= kListed; ++number) {
    const auto controls = std::count_if(report.cases.begin(), report.cases.end(), [&](const Outcome& o) {
      return list_number(o.name) == number && o.check.pass && is_control(o.name);
    });
    std::vector<Cell> row{static_cast<std::int64_t>(number), controls > 0 ? Cell(static_cast<std::int64_t>(controls)) : Cell()};
    bool asked = false;
    for (const std::string& c : columns) {
      row.push_back(text_or_none(tallies[c][number].text()));
      asked = asked || row.back().index() != 0;
    }
    if (asked) table.rows.push_back(std::move(row));
  }
  return table;
}

Table skipped(const Report& report) {
  Table table;
  table.title = "skipped";
  table.columns = {{"suite", "suite", "", false},
                   {"name", "case", "", false},
                   {"who", "encodings and filters", "", false},
                   {"reason", "reason", "", false}};
  std::vector<std::pair<const Skipped*, std::vector<std::string>>> rows;
  for (const Skipped& s : report.skipped) {
    auto row = std::find_if(rows.begin(), rows.end(), [&](const auto& r) {
      return r.first->suite == s.suite && r.first->name == s.name && r.first->reason == s.reason;
    });
    if (row == rows.end()) row = rows.insert(rows.end(), {&s, {}});
    const std::string one = who(s.encoding, s.filter);
    if (std::find(row->second.begin(), row->second.end(), one) == row->second.end()) row->second.push_back(one);
  }
  for (const auto& [s, all] : rows)
    table.rows.push_back({s->suite, s->name, text_or_none(fmt::format("{}", fmt::join(all, ", "))), s->reason});
  return table;
}

Table ranges(const Report& report) {
  Table table;
  table.title = "cases over all encodings and filters";
  table.columns = {{"suite", "suite", "", false},
                   {"name", "case", "", false},
                   {"passed", "passed", "", true},
                   {"expected", "expected", "", false},
                   {"observed", "observed, first", "", false},
                   {"observed_last", "last", "", false}};
  std::map<std::string, std::size_t> rows;
  std::vector<std::array<std::int64_t, 2>> counts;
  for (const Outcome& o : report.cases) {
    const auto [row, fresh] = rows.emplace(o.suite + "/" + o.name + "/" + o.check.expected, table.rows.size());
    if (fresh) {
      table.rows.push_back({o.suite, o.name, Cell(), o.check.expected, o.check.observed, Cell()});
      counts.push_back({0, 0});
    } else {
      table.rows[row->second].back() = o.check.observed;
    }
    counts[row->second][0] += o.check.pass ? 1 : 0;
    ++counts[row->second][1];
  }
  for (std::size_t i = 0; i < counts.size(); ++i) table.rows[i][2] = fmt::format("{} of {}", counts[i][0], counts[i][1]);
  return table;
}

Table all_cases(const Report& report) {
  Table table;
  table.columns = case_columns();
  table.columns.insert(table.columns.begin(), {"suite", "suite", "", false});
  for (const Outcome& o : report.cases) {
    std::vector<Cell> row = case_row(o);
    row.insert(row.begin(), o.suite);
    table.rows.push_back(std::move(row));
  }
  return table;
}

double observed_order(std::span<const double> errors) {
  // sizes 2^-i: least squares of log2(error) over i, sign turned
  const double n = static_cast<double>(errors.size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double x = static_cast<double>(i);
    const double y = std::log2(errors[i]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  return -(n * sxy - sx * sy) / (n * sxx - sx * sx);
}

}  // namespace amrtex::verify
