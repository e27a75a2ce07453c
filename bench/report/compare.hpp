// Two folders of records, point by point: what differs, and what became slower or faster.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bench/numbers/comparison.hpp"
#include "bench/report/table.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex {

/// One of the two.
struct ComparedFolder {
  std::string name;  ///< as messages call it
  std::vector<Json> records;
};

/// Something that is exact, and is not the same on both sides.
struct Difference {
  const Json* record;   ///< of the point, in A
  std::string context;  ///< of A, as tables call it
  std::string what;     ///< "status", or a JSON pointer
  Json a, b;            ///< a list where repetitions of one side differ among themselves
  bool counts;          ///< false: two drivers may differ here
};

/// Times of one point on both sides. Records live in the folders that were compared.
struct ComparedPoint {
  const Json* a;  ///< the first repetition that is `ok`, else the first
  const Json* b;
  std::string context;                 ///< of A, as tables call it
  std::optional<Comparison> relative;  ///< over the baseline beside; nothing where either side has none
  std::optional<Comparison> time;      ///< milliseconds; inside one context alone
  bool by_time = false;                ///< which of the two gives the verdict
  Verdict verdict = Verdict::cannot_tell;
  std::string reason;  ///< of cannot_tell
};

/// What many points have in common: the baseline of a data set, or an encoding.
struct ComparedLine {
  std::string name;
  std::size_t points = 0;
  Comparison comparison;
  std::string note;
};

struct FolderComparison {
  ComparisonRules rules;
  std::string name_a, name_b;
  bool one_context = true;         ///< false: only ratios to the baselines were compared
  std::vector<std::string> notes;  ///< what was left out of the comparison, and what to bear in mind
  std::vector<const Json*> only_a, only_b;
  std::vector<Difference> differences;
  std::vector<ComparedLine> baselines;  ///< milliseconds; inside one context alone
  std::vector<ComparedLine> encodings;  ///< with two points or more
  std::vector<ComparedPoint> points;    ///< as tables order them
  std::size_t smallest_repeat = 0;      ///< that can decide for so many points
};

/// Pairs points by `configuration` and context. Contexts that both have are compared with themselves; where there is none and
/// each side has one, these two are, by ratios to their own baselines alone. The result points into the folders. Throws
/// UsageError where nothing can be paired, naming both.
FolderComparison compare_folders(const ComparedFolder& a, const ComparedFolder& b, const ComparisonRules& rules);

/// Is a point, an encoding or a baseline slower, or does something that counts differ?
bool has_findings(const FolderComparison& comparison);

/// Differences first. Tables without rows are left out.
std::vector<Table> comparison_tables(const FolderComparison& comparison);
/// "12 points: 2 slower, …", and the smallest `--repeat` that can decide.
std::string comparison_summary(const FolderComparison& comparison);
Json comparison_json(const FolderComparison& comparison);

}  // namespace amrtex
