// Counts what the axes of a file multiply to, before anything is made of them.
#include <fmt/format.h>

#include "bench/settings/experiment_parser.hpp"

namespace amrtex {
namespace {

/// Sum over the entries of a list, or that of one entry.
template <class Count>
double sum_over(const Json& json, int depth, Count&& count) {
  if (!is_axis(json, depth)) return count(json);
  double sum = 0;
  for (const Json& item : json) sum += count(item);
  return sum;
}

const Json& value_or_null(const Json& object, std::string_view key) {
  static const Json null;
  if (!object.is_object()) return null;
  const auto found = object.find(key);
  return found == object.end() ? null : *found;
}

double count_datasets(const Json& root) {
  const Depths generate = depths_of(section_of("generate").keys);
  return sum_over(value_or_null(root, "datasets"), 0, [&](const Json& dataset) {
    const Json& specification = value_or_null(dataset, "generate");
    if (specification.is_null()) return count_combinations(dataset, depths_of(section_of("datasets").keys));
    return sum_over(specification, 0, [&](const Json& one) { return count_combinations(one, generate); });
  });
}

double count_encodings(const Json& root) {
  return sum_over(value_or_null(root, "encodings"), 0, [&](const Json& encoding) {
    double count = count_combinations(encoding, depths_of({}));
    for (const Key* key : build_settings().keys())
      if (value_or_null(encoding, key->name).is_null()) count *= count_values(value_or_null(root, key->name), 0);
    return count;
  });
}

double count_views(const Json& root) {
  const Depths depth = depths_of(section_of("views").keys);
  return sum_over(value_or_null(root, "views"), 0, [&](const Json& view) {
    const Json& orbit = value_or_null(view, "orbit");
    const double count = count_combinations(view, depth, std::array<std::string_view, 1>{"orbit"});
    if (orbit.is_null()) return count;
    return count * sum_over(orbit, 0, [](const Json& one) {
             const Json& views = value_or_null(one, "count");
             return views.is_number() ? views.get<double>() : 1;
           });
  });
}

double count_functions(const Json& root) {
  const Json& several = value_or_null(root, "transfer_functions");
  if (!several.is_null()) return count_values(several, 1);
  const Depths depth = depths_of(section_of("transfer_function").keys);
  return sum_over(value_or_null(root, "transfer_function"), 0,
                  [&](const Json& function) { return count_combinations(function, depth); });
}

double count_pictures(const Json& root) {
  const Depths depth = depths_of(section_of("render").keys);
  double count =
      sum_over(value_or_null(root, "render"), 0, [&](const Json& render) { return count_combinations(render, depth); });
  count *= count_views(root) * count_functions(root);
  for (const Key* key : frame_settings().keys()) count *= count_values(value_or_null(root, key->name), 0);
  return count;
}

std::string count_text(double count) { return count < 1e15 ? fmt::format("{:.0f}", count) : fmt::format("{:.3g}", count); }

}  // namespace

void require_few_points(const ExperimentParser& parser, std::uint64_t most) {
  const Json& root = parser.root.json();
  const double builds = count_datasets(root) * count_encodings(root), pictures = count_pictures(root);
  if (builds * pictures <= static_cast<double>(most)) return;
  parser.root.fail(
      fmt::format("{} points, {} builds with {} pictures each; at most {} are made of one file; accepted: shorter lists, or "
                  "a larger --max-points",
                  count_text(builds * pictures), count_text(builds), count_text(pictures), most));
}

}  // namespace amrtex
