// Filters: the mathematics that defines a field from leaf cells alone.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

namespace amrtex {

/// The field that is reconstructed from the leaf cells (docs/filters.md). The order is that of AMRTEX_FILTER_... in
/// shaders/contract.glsl.
enum class Filter { nearest, linear_lod, linear_page, linear_vertex, basis };

/// Inside of what f is continuous. A filter that jumps at every cell's faces interpolates nothing.
enum class Continuity { cell, level, page, everywhere };

struct FilterInfo {
  Filter filter;
  std::string_view name;
  Continuity continuity;
};

/// All filters, in the order of their numbers. What differs from filter to filter outside of its reference
/// (renderers/reference/filters/) and of encodings stands in its row.
inline constexpr std::array kFilterTable{
    FilterInfo{Filter::nearest, "nearest", Continuity::cell},
    FilterInfo{Filter::linear_lod, "linear_lod", Continuity::level},
    FilterInfo{Filter::linear_page, "linear_page", Continuity::page},
    FilterInfo{Filter::linear_vertex, "linear_vertex", Continuity::everywhere},
    FilterInfo{Filter::basis, "basis", Continuity::everywhere},
};

constexpr const FilterInfo& filter_info(Filter filter) { return kFilterTable[static_cast<std::size_t>(filter)]; }

/// Is every filter's row at its number?
constexpr bool filters_are_in_order() {
  for (std::size_t i = 0; i < kFilterTable.size(); ++i)
    if (kFilterTable[i].filter != static_cast<Filter>(i)) return false;
  return true;
}
static_assert(filters_are_in_order());

constexpr std::string_view filter_name(Filter filter) { return filter_info(filter).name; }
/// Does f take values between those of cells?
constexpr bool interpolates(Filter filter) { return filter_info(filter).continuity != Continuity::cell; }
/// Throws a UsageError that names all filters.
Filter parse_filter(std::string_view name);
std::span<const Filter> all_filters();
std::span<const Filter> interpolating_filters();

/// Which field f(p) exactly: the filter and, where it has them, its pages.
struct FilterDefinition {
  Filter filter = Filter::nearest;
  int page_size = 0;   ///< cells along an edge of a page; 0 = the whole domain is one page
  int page_level = 0;  ///< level of that one page (page_size 0 only)
  bool operator==(const FilterDefinition&) const = default;

  bool has_pages() const { return filter_info(filter).continuity == Continuity::page; }
  /// Also where levels meet: one page has no level beside it.
  bool continuous_everywhere() const {
    return filter_info(filter).continuity == Continuity::everywhere || (has_pages() && page_size == 0);
  }
};

}  // namespace amrtex
