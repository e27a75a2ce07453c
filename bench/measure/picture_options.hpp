// What a picture may be asked for beside its scene: an error, the rule of its reference, and who draws it where nobody says.
#pragma once

#include <exception>
#include <optional>

#include "bench/settings/experiment.hpp"

namespace amrtex {

/// An error asked for, of full scale, replaces the scene's step. Throws UsageError where the scene cannot have it.
Scene with_tolerance(Scene scene, const std::optional<double>& tolerance);

/// Of the call, else of the scene: a step in widths of the finest cells, or the largest error of full scale. Throws UsageError.
ReferenceRule reference_rule(const Experiment& scene, const std::optional<double>& step, const std::optional<double>& tolerance);

/// What a data set is drawn by where nobody says.
inline constexpr const char* kFirstChoice = "kd_tree";

/// Makes `build` the next choice after this many have failed; false behind the last. All of them filter linearly.
bool choose_encoding(BuildPoint& build, std::size_t failed);

/// Calls draw(); where nobody said which encoding (`free`) and this one cannot hold the data, with the others in `build` until
/// one draws. Throws what the first one threw.
template <class F>
void draw_by_first(BuildPoint& build, bool free, F&& draw) {
  std::exception_ptr first;
  const auto keep = [&] {
    if (!first) first = std::current_exception();
  };
  for (std::size_t failed = 0;; ++failed) {
    if (failed > 0 && !(free && choose_encoding(build, failed))) std::rethrow_exception(first);
    try {
      return draw();
    } catch (const UnsupportedError&) {
      keep();
    } catch (const BudgetError&) {
      keep();
    }
  }
}

}  // namespace amrtex
