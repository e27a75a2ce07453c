#include "structures/mesh/filter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

/// The filters whose row `wanted` accepts.
template <class Wanted>
std::vector<Filter> filters_where(Wanted&& wanted) {
  std::vector<Filter> filters;
  for (const FilterInfo& info : kFilterTable)
    if (wanted(info.filter)) filters.push_back(info.filter);
  return filters;
}

}  // namespace

std::span<const Filter> all_filters() {
  static const std::vector<Filter> filters = filters_where([](Filter) { return true; });
  return filters;
}

std::span<const Filter> interpolating_filters() {
  static const std::vector<Filter> filters = filters_where([](Filter filter) { return interpolates(filter); });
  return filters;
}

Filter parse_filter(std::string_view name) {
  std::vector<std::string_view> names;
  for (const FilterInfo& info : kFilterTable) {
    if (info.name == name) return info.filter;
    names.push_back(info.name);
  }
  throw UsageError(fmt::format("no filter {}; accepted: {}", quote(name), fmt::join(names, ", ")));
}

}  // namespace amrtex
