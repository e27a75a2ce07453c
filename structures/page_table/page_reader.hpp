// Reads pages from the mesh: their values, and which of them are absent, constant or hidden.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "page_partition.hpp"
#include "structures/common/build_tools.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex::pages {

/// What one field has in one page.
struct PageContents {
  ValueRange range;  ///< of all texels, the border and fills included
  bool any = true;   ///< has any cell a value?
  bool all = true;   ///< have all of them in the domain?
};

/// Values of one page as they will be stored, of one field after the other.
class PageReader {
 public:
  PageReader(const AmrHierarchy& h, const Options& options)
      : hierarchy_(h), options_(options), values_(static_cast<std::size_t>(options.page_texels())), missing_(values_.size()) {}

  /// Fills values() from a field of the mesh.
  PageContents read(const Page& page, int field) {
    const Vec3i first = page.index_in_level * options_.page_size;
    const Box cells{first, first + Vec3i(options_.page_size)};
    box_ = options_.nodes ? Box{first, first + Vec3i(options_.edge)} : cells.grown(options_.border);
    if (options_.nodes) {
      vertex_values(hierarchy_, field, page.level, box_, values_);
      std::fill(missing_.begin(), missing_.end(), std::uint8_t{0});  // another field may have been read before
      if (hierarchy_.has_missing(field)) mark_missing(page.level, cells, field);
    } else {
      filled_level_values(hierarchy_, field, page.level, box_, values_, missing_);
    }
    return contents(intersection(cells, hierarchy_.domain(page.level)), field);
  }
  std::span<const double> values() const { return values_; }

  /// Sets the bit of each cell of the page that has a value.
  void write_validity(const Page& page, std::uint32_t* words) const {
    const Vec3i first = page.index_in_level * options_.page_size;
    std::int64_t bit = 0;
    const Box domain = hierarchy_.domain(page.level);
    for_each_cell({first, first + Vec3i(options_.page_size)}, [&](const Vec3i& c) {
      if (domain.contains(c) && !is_missing(c)) set_bit(words, bit);
      ++bit;
    });
  }

 private:
  /// In a node-centred page the missing flags belong to cells and stand at their lower vertex.
  bool is_missing(const Vec3i& cell) const { return missing_[box_.offset(cell)] != 0; }

  void mark_missing(int level, const Box& cells, int field) {
    std::vector<double> own(static_cast<std::size_t>(cells.cells()));
    level_values(hierarchy_, field, level, cells, own);
    std::size_t i = 0;
    for_each_cell(cells, [&](const Vec3i& c) { missing_[box_.offset(c)] = std::isnan(own[i++]) ? 1 : 0; });
  }

  PageContents contents(const Box& inside, int field) const {
    PageContents c;
    for (double v : values_) c.range.add(v);
    if (!hierarchy_.has_missing(field)) return c;
    c.any = false;
    for_each_cell(inside, [&](const Vec3i& cell) { (is_missing(cell) ? c.all : c.any) = !is_missing(cell); });
    return c;
  }

  const AmrHierarchy& hierarchy_;
  const Options& options_;
  Box box_;
  std::vector<double> values_;
  std::vector<std::uint8_t> missing_;
};

/// The table holds a float in the field's units: what it would lose, a page of the same storage must lose as well.
inline bool constant_is_exact(double number, Storage storage) {
  return storage == Storage::r32f || static_cast<double>(static_cast<float>(number)) == number;
}

/// A constant page is one of a single field: an entry has room for one value, and what is constant in
/// one field seldom is in the others.
inline bool is_constant(const PageContents& c, const BuildRequest& request, const ValueUnits& units) {
  return request.more_fields.empty() && c.all && c.range.min == c.range.max &&
         constant_is_exact(units.number(c.range.min), request.storage);
}

/// Which pages the scene cannot show.
class HiddenPages {
 public:
  HiddenPages(const AmrHierarchy& h, const BuildRequest& request, const Options& o)
      : request_(request), statistics_(h.statistics(request.field)), leak_(most_leaked(request, o)) {}
  ValueUnits units() const { return value_units(statistics_); }
  bool operator()(const PageContents& c) const {
    const StorageScale scale = storage_scale(request_.storage, statistics_);
    ValueRange range = c.range;
    if (!range.empty()) range = {range.min - leak_, range.max + leak_};
    return hidden(request_.needs, range, range_origin(statistics_, request_.storage, scale), request_.storage, scale);
  }

 private:
  /// Before the pool's size is known.
  double most_leaked(const BuildRequest& request, const Options& o) const {
    return o.nodes ? leaked_value(statistics_, Vec3i(request.context.max_3d_texture_size)) : 0;
  }

  const BuildRequest& request_;
  const FieldStatistics& statistics_;
  double leak_;
};

/// Sets the kind of a page, and what a constant one holds. Further fields are read only where those before have nothing.
inline void classify(PageReader& reader, const BuildRequest& request, const HiddenPages& is_hidden, Page& page) {
  PageContents c = reader.read(page, request.field);
  page.pruned = c.any && is_hidden(c);
  if (page.pruned) return;  // absent, at its own level: rays step over the same box
  for (const int other : request.more_fields)
    if (!c.any) c = reader.read(page, other);
  page.kind = !c.any                                       ? AMRTEX_PAGE_ABSENT
              : is_constant(c, request, is_hidden.units()) ? AMRTEX_PAGE_CONSTANT
                                                           : AMRTEX_PAGE_STORED;
  if (page.kind == AMRTEX_PAGE_CONSTANT)
    page.green = std::bit_cast<std::uint32_t>(static_cast<float>(is_hidden.units().number(c.range.min)));
}

/// Is a page stored, as two of its values alone tell? Two that differ make no constant; where several fields are drawn no page is
/// one.
class SurelyStored {
 public:
  SurelyStored(const AmrHierarchy& h, const BuildRequest& request, const Options& o) : h_(h), request_(request), options_(o) {}

  bool operator()(const Page& page) const {
    if (!request_.needs.invisible.empty()) return false;  // it may be hidden
    const Vec3i first = page.index_in_level * options_.page_size;
    const Box inside = intersection(Box{first, first + Vec3i(options_.page_size)}, h_.domain(page.level));
    for (int number = 0; number < request_.field_count(); ++number) {
      const int field = request_.field_at(number);
      const double a = h_.level_value(page.level, inside.lower, field);
      const double b = h_.level_value(page.level, inside.upper - Vec3i(1), field);
      if (request_.field_count() > 1 && !(std::isnan(a) && std::isnan(b))) return true;
      if (request_.field_count() == 1 && !std::isnan(a) && !std::isnan(b) && a != b)
        return !options_.nodes || vertices_differ(page);
    }
    return false;
  }

 private:
  /// The means of cells that differ may be equal.
  bool vertices_differ(const Page& page) const {
    const Vec3i lower = page.index_in_level * options_.page_size;
    const auto at = [&](const Vec3i& vertex) {
      double value = 0;
      vertex_values(h_, request_.field, page.level, {vertex, vertex + Vec3i(1)}, {&value, 1});
      return value;
    };
    return at(lower) != at(lower + Vec3i(options_.page_size));
  }

  const AmrHierarchy& h_;
  const BuildRequest& request_;
  const Options& options_;
};

/// How many pages are surely stored; counting ends beyond `enough`, in whole blocks of pages, so that the number is the same at
/// each run.
inline std::int64_t count_surely_stored(const SurelyStored& is_stored, const std::vector<Page>& pages, std::int64_t enough) {
  constexpr std::size_t kBlock = 1 << 14;
  std::int64_t stored = 0;
  for (std::size_t first = 0; first < pages.size() && stored <= enough; first += kBlock)
    stored += tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(first, std::min(first + kBlock, pages.size()), 64), std::int64_t{0},
        [&](const auto& range, std::int64_t sum) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) sum += is_stored(pages[i]) ? 1 : 0;
          return sum;
        },
        std::plus<>());
  return stored;
}

/// Reads every page to learn what is absent or constant, then numbers the stored ones.
inline std::int64_t number_pages(const AmrHierarchy& h, const BuildRequest& request, const Options& o, std::vector<Page>& pages) {
  const HiddenPages is_hidden(h, request, o);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pages.size(), 8), [&](const auto& range) {
    PageReader reader(h, o);
    for (std::size_t i = range.begin(); i != range.end(); ++i) classify(reader, request, is_hidden, pages[i]);
  });
  std::int64_t stored = 0;
  for (Page& p : pages)
    if (p.kind == AMRTEX_PAGE_STORED) p.index = static_cast<std::uint32_t>(stored++);
  return stored;
}

}  // namespace amrtex::pages
