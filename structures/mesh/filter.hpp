// Filters: the mathematics that defines a field from leaf cells alone.
#pragma once

#include <span>
#include <string_view>

namespace amrtex {

/// The field that is reconstructed from the leaf cells (shaders/README.md).
enum class Filter { nearest, linear_lod, linear_page, linear_vertex, basis };
std::string_view filter_name(Filter filter);
/// Throws a UsageError that names all filters.
Filter parse_filter(std::string_view name);
std::span<const Filter> all_filters();

/// Which field f(p) exactly: the filter and, for `linear_page`, its pages.
struct FilterDefinition {
  Filter filter = Filter::nearest;
  int page_size = 0;   ///< cells along an edge of a page; 0 = the whole domain is one page
  int page_level = 0;  ///< level of that one page (page_size 0 only)
  bool operator==(const FilterDefinition&) const = default;
};

}  // namespace amrtex
