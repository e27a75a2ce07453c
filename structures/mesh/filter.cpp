#include "structures/mesh/filter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <vector>

#include "structures/mesh/error.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr std::array<Filter, 5> kFilters{Filter::nearest, Filter::linear_lod, Filter::linear_page, Filter::linear_vertex,
                                         Filter::basis};

}  // namespace

std::string_view filter_name(Filter filter) {
  switch (filter) {
    case Filter::nearest:
      return "nearest";
    case Filter::linear_lod:
      return "linear_lod";
    case Filter::linear_page:
      return "linear_page";
    case Filter::linear_vertex:
      return "linear_vertex";
    case Filter::basis:
      return "basis";
  }
  return "";
}

std::span<const Filter> all_filters() { return kFilters; }

Filter parse_filter(std::string_view name) {
  for (Filter f : kFilters)
    if (filter_name(f) == name) return f;
  std::vector<std::string_view> names;
  for (Filter f : kFilters) names.push_back(filter_name(f));
  throw UsageError(fmt::format("no filter {}; accepted: {}", quote(name), fmt::join(names, ", ")));
}

}  // namespace amrtex
