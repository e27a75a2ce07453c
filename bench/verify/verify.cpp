#include "bench/verify/verify.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace amrtex::verify {
namespace {

constexpr std::array<Suite, 7> kSuites{{
    {"analytic", "pictures and values with a closed form, continuity", analytic_suite},
    {"convergence", "observed orders in step, cells, pixels and isosurfaces", convergence_suite},
    {"stiff", "extinction from 0 to infinity, steps and spikes, thin shells", stiff_suite},
    {"extreme", "24 levels, jumps of 4096, any scale of space and values, what has no value", extreme_suite},
    {"geometry", "rays from anywhere in any direction; segments sum to the chord", geometry_suite},
    {"differential", "encodings against the reference, each other, GL and memory", differential_suite},
    {"metamorphic", "pictures that a change of the input must leave alone", metamorphic_suite},
}};

std::string parameters_text(const Json& parameters) {
  std::string text;
  for (const auto& [key, value] : parameters.items())
    text += fmt::format("{}{}={}", text.empty() ? "" : " ", key, value.is_string() ? value.get<std::string>() : value.dump());
  return text;
}

Cell text_or_none(const std::string& text) { return text.empty() ? Cell() : Cell(text); }

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
  EncodedField field = verify::build(mesh, c, options);
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
  for (const EncodingCase& c : cases) try {
      if (const auto check = body(c)) add(name, &c, *check);
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
  throw UsageError(fmt::format("no suite '{}'; accepted: {}", name, fmt::join(names, ", ")));
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
  std::vector<Table> tables;
  for (const Suite& suite : kSuites) {
    Table table;
    table.title = fmt::format("{}: {}", suite.name, suite.asks);
    table.columns = {
        {"name", "case", "", false},     {"encoding", "encoding", "", false}, {"parameters", "parameters", "", false},
        {"filter", "filter", "", false}, {"expected", "expected", "", false}, {"observed", "observed", "", false},
        {"pass", "pass", "", false}};
    for (const Outcome& o : report.cases)
      if (o.suite == suite.name)
        table.rows.push_back({o.name, text_or_none(o.encoding), text_or_none(parameters_text(o.parameters)),
                              text_or_none(o.filter), o.check.expected, o.check.observed,
                              std::string(o.check.pass ? "yes" : "NO")});
    if (!table.rows.empty()) tables.push_back(std::move(table));
  }
  Table skipped;
  skipped.title = "skipped";
  skipped.columns = {{"suite", "suite", "", false},
                     {"name", "case", "", false},
                     {"encoding", "encoding", "", false},
                     {"filter", "filter", "", false},
                     {"reason", "reason", "", false}};
  for (const Skipped& s : report.skipped)
    skipped.rows.push_back({s.suite, s.name, text_or_none(s.encoding), text_or_none(s.filter), s.reason});
  if (!skipped.rows.empty()) tables.push_back(std::move(skipped));
  return tables;
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
