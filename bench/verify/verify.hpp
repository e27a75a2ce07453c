// The frame of `amrtex verify`: what a suite is handed, what it reports. README.md lists the cases.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "bench/report/table.hpp"
#include "bench/verify/encoding_cases.hpp"
#include "renderers/context/context.hpp"

namespace amrtex::verify {

/// What one case found. A control is a case that a wrong method must fail: it passes when that is noticed.
struct Check {
  std::string expected, observed;
  bool pass = false;
};
/// "<= bound"; NaN does not pass.
Check at_most(double observed, double bound);
/// "> bound", for controls.
Check above(double observed, double bound);
/// "centre ± tolerance".
Check near(double observed, double centre, double tolerance);
/// True or not, in words.
Check holds(bool pass, std::string expected, std::string observed);
/// The first that failed, else the first; `checks` is not empty.
Check all_of(std::span<const Check> checks);

/// A case that says nothing of this encoding or filter: reported as skipped, never left out in silence.
struct NotAsked {
  std::string why;
};
using Verdict = std::variant<Check, NotAsked>;

struct Outcome {
  std::string suite, name, encoding, filter;
  Json parameters;  ///< build parameters that were given; null where no encoding takes part
  Check check;
};

struct Skipped {
  std::string suite, name, encoding, filter, reason;
};

struct Report {
  std::vector<Outcome> cases;
  std::vector<Skipped> skipped;
  std::size_t failed() const;
};

struct VerifyOptions {
  ContextChoice context = {};
  bool full = false;       ///< the experiment's size, not the one of a few minutes
  bool list = false;       ///< no case is run: all are reported as skipped, "listed"
  std::size_t one_in = 1;  ///< each case is asked of one in so many encodings and filters, the next case of the next ones
  std::function<void(EncodedField&)> tamper{};         ///< done to each built field: tests break encodings with it
  std::function<void(const std::string&)> progress{};  ///< told the name of each case before it runs
};

/// Bytes of one field: no case needs more, and a dense field of a deep mesh would take all there are.
inline constexpr std::int64_t kMemoryLimit = std::int64_t{1} << 30;

/// What suites are handed: the context, the size, the encodings, and where outcomes go.
class VerifyContext {
 public:
  /// The report must outlive this object. Throws Error where the GL context cannot be made.
  VerifyContext(VerifyOptions options, Report& report);
  ~VerifyContext();

  Context& gl() const { return *gl_; }
  bool full() const { return options_.full; }
  /// `small` by default, `large` with --full.
  template <class T>
  T size(T small, T large) const {
    return full() ? large : small;
  }
  /// One case of each encoding and filter: the last of its variants, which has the smallest structures.
  const std::vector<EncodingCase>& filters() const { return filters_; }
  /// Every variant that the parameters' descriptions declare.
  const std::vector<EncodingCase>& variants() const { return variants_; }

  /// Throws UnsupportedError with the encoding's reason, or a BudgetError above kMemoryLimit.
  EncodedField build(const AmrHierarchy& mesh, const EncodingCase& c, const BuildOptions& options = {}) const;

  void begin(std::string suite) { suite_ = std::move(suite); }
  void add(const std::string& name, const EncodingCase* c, Check check);
  void skip(const std::string& name, const EncodingCase* c, std::string reason);

  /// Runs the body for each case. What it does not ask and what the encoding refuses is skipped with the reason; any
  /// other error is a failure.
  using Body = std::function<Verdict(const EncodingCase&)>;
  void for_each(const std::string& name, std::span<const EncodingCase> cases, const Body& body);
  void for_each_filter(const std::string& name, const Body& body) { for_each(name, filters_, body); }
  /// A case without an encoding.
  void once(const std::string& name, const std::function<Check()>& body);

 private:
  VerifyOptions options_;
  Report* report_;
  std::unique_ptr<Context> gl_;
  std::vector<EncodingCase> variants_, filters_;
  void tell(const std::string& name) const;

  std::string suite_;
  std::size_t asked_ = 0;  ///< cases so far
};

struct Suite {
  std::string_view name;
  std::string_view asks;  ///< one line
  void (*run)(VerifyContext&);
};
std::span<const Suite> suites();
/// Throws a UsageError that names the suites there are.
const Suite& find_suite(std::string_view name);

/// {"cases": [...], "skipped": [...]}
Json to_json(const Report& report);
/// What was asked of whom, one table a suite, and what was skipped and why.
std::vector<Table> to_tables(const Report& report);

/// Cases of the list in README.md: their names begin with the number.
inline constexpr int kListed = 28;
/// Number of a case; 0 where it has none.
int list_number(std::string_view name);
bool is_control(std::string_view name);
/// A row a number of the list, a column an encoding and filter: how many cases passed, of how many if some failed, or that
/// all were skipped. A number without encodings stands in a column of its own.
Table coverage(const Report& report);
/// A row a case of any encodings: how many passed, what was expected, the first and last of what was observed.
Table ranges(const Report& report);
/// A row a reason.
Table skipped(const Report& report);
/// A row a case, encoding and filter.
Table all_cases(const Report& report);

/// Observed order: slope of log(error) over log(1 / size) by least squares, each size half of the one before.
double observed_order(std::span<const double> errors);

// one source file each
void analytic_suite(VerifyContext& v);
void convergence_suite(VerifyContext& v);
void stiff_suite(VerifyContext& v);
void extreme_suite(VerifyContext& v);
void geometry_suite(VerifyContext& v);
void differential_suite(VerifyContext& v);
void metamorphic_suite(VerifyContext& v);
void reference_suite(VerifyContext& v);
void scales_suite(VerifyContext& v);

}  // namespace amrtex::verify
