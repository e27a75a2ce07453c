#include "bench/settings/value_histogram.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDecades = 3;      ///< positive values that span more are shown over their logarithm
constexpr double kMostDecades = 5;  ///< below the upper end of a logarithmic axis: tails that fall to nothing have no end
constexpr double kLowShare = 0.005, kHighShare = 0.999;  ///< high values are often the rare ones that a mesh is refined for

/// Calls visit(value, level) for each leaf cell that has a value.
template <class Visit>
void for_each_value(const AmrHierarchy& mesh, int field, Visit&& visit) {
  for (int level = 0; level < mesh.level_count(); ++level) {
    const auto patches = mesh.patches(level);
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const auto leaf = mesh.leaf_mask(level, static_cast<int>(p));
      patches[p].values[static_cast<std::size_t>(field)].visit([&](const auto& values) {
        for (std::size_t i = 0; i < leaf.size(); ++i)
          if (leaf[i] != 0 && std::isfinite(values[i])) visit(values[i], level);
      });
    }
  }
}

/// Of a cell of each level, in cells of the finest.
std::vector<double> volumes(const AmrHierarchy& mesh, CellWeight weight) {
  std::vector<double> list;
  for (int level = 0; level < mesh.level_count(); ++level)
    list.push_back(weight == CellWeight::volume ? std::pow(static_cast<double>(mesh.cell_width(level)), 3) : 1);
  return list;
}

/// Unsigned numbers in the order of the doubles that they stand for.
std::uint64_t ordered(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value + 0.0);  // -0 as 0
  return (bits >> 63) != 0 ? ~bits : bits | (std::uint64_t{1} << 63);
}
double unordered(std::uint64_t key) { return std::bit_cast<double>((key >> 63) != 0 ? key & ~(std::uint64_t{1} << 63) : ~key); }

constexpr int kDigitBits = 16;
constexpr int kDigits = 3;
using Digits = std::vector<double>;  // weight by 16 bits of a key

/// Where a share of the weight is reached: the bits of the key that are known, and the weight that is still to come.
struct Search {
  std::uint64_t prefix = 0;
  double rest = 0;
};

/// The next 16 bits.
void descend(Search& search, const Digits& digits) {
  std::uint64_t last = 0;
  double passed = 0;  // by the digits before the last one that holds weight
  for (std::uint64_t d = 0; d < digits.size(); ++d) {
    if (digits[d] == 0) continue;
    if (digits[last] > 0 && d != last) passed += digits[last];
    last = d;
    if (passed + digits[d] > search.rest) break;
  }
  search.rest -= passed;
  search.prefix = search.prefix << kDigitBits | last;
}

}  // namespace

std::vector<double> quantiles(const AmrHierarchy& mesh, int field, std::span<const double> shares, CellWeight weight,
                              Counted counted) {
  const std::vector<double> volume = volumes(mesh, weight);
  const auto visit_counted = [&](auto&& visit) {
    for_each_value(mesh, field, [&](double v, int level) {
      if (counted == Counted::all || v > 0) visit(ordered(v), volume[static_cast<std::size_t>(level)]);
    });
  };
  double total = 0;
  visit_counted([&](std::uint64_t, double w) { total += w; });
  if (!(total > 0)) return std::vector<double>(shares.size(), kNan);
  std::vector<Search> searches;
  for (const double share : shares) searches.push_back({0, share * total});
  for (int digit = 0; digit < kDigits; ++digit) {
    std::map<std::uint64_t, Digits> tables;  // by prefix: one pass serves all shares
    for (const Search& s : searches) tables.try_emplace(s.prefix, std::size_t{1} << kDigitBits);
    const int shift = 64 - kDigitBits * (digit + 1);
    Digits* table = &tables.begin()->second;
    std::uint64_t prefix = tables.begin()->first;
    visit_counted([&](std::uint64_t key, double w) {
      const std::uint64_t mine = digit == 0 ? 0 : key >> (shift + kDigitBits);
      if (mine != prefix) {
        const auto found = tables.find(mine);
        if (found == tables.end()) return;
        table = &found->second;
        prefix = mine;
      }
      (*table)[(key >> shift) & ((std::uint64_t{1} << kDigitBits) - 1)] += w;
    });
    for (Search& s : searches) descend(s, tables.at(s.prefix));
  }
  std::vector<double> values;
  const FieldStatistics& range = mesh.statistics(field);
  for (const Search& s : searches)
    values.push_back(std::clamp(unordered(s.prefix << (64 - kDigitBits * kDigits)), range.min, range.max));
  return values;
}

double ValueHistogram::place(double value) const {
  if (logarithmic)
    return value > 0 ? std::log(value / lower) / std::log(upper / lower) : -std::numeric_limits<double>::infinity();
  return (value / 2 - lower / 2) / (upper / 2 - lower / 2);
}

double ValueHistogram::value_at(double place) const {
  return logarithmic ? lower * std::exp(place * std::log(upper / lower)) : (1 - place) * lower + place * upper;
}

ValueHistogram value_histogram(const AmrHierarchy& mesh, int field, double lower, double upper, bool logarithmic, int bins) {
  ValueHistogram histogram{lower, upper, logarithmic, std::vector<double>(static_cast<std::size_t>(bins)), 0, 0};
  const std::vector<double> volume = volumes(mesh, CellWeight::volume);
  const double extent = logarithmic ? std::log(upper / lower) : upper / 2 - lower / 2;
  double total = 0;
  for_each_value(mesh, field, [&](double v, int level) {
    const double w = volume[static_cast<std::size_t>(level)];
    total += w;
    if (v < lower)
      histogram.below += w;
    else if (v > upper)
      histogram.above += w;
    else {
      const double at = bins * ((logarithmic ? std::log(v / lower) : v / 2 - lower / 2) / extent);
      histogram.share[static_cast<std::size_t>(std::clamp(at, 0.0, bins - 1.0))] += w;
    }
  });
  if (!(total > 0)) return histogram;
  for (double& s : histogram.share) s /= total;
  histogram.below /= total;
  histogram.above /= total;
  return histogram;
}

namespace {

bool wide(const std::vector<double>& ends) {
  const double span = ends[1] - ends[0];
  return span > 1e-12 * std::max(std::abs(ends[0]), std::abs(ends[1]));
}

/// The first of these that has an extent: percentiles by volume, by cells (what is refined alone differs), all values.
std::vector<double> ends_of(const AmrHierarchy& mesh, int field, Counted counted) {
  const std::array<double, 2> shares{kLowShare, kHighShare}, all{0, 1};
  for (const CellWeight weight : {CellWeight::volume, CellWeight::one}) {
    std::vector<double> ends = quantiles(mesh, field, shares, weight, counted);
    if (wide(ends)) return ends;
  }
  return quantiles(mesh, field, all, CellWeight::one, counted);
}

ShownRange logarithmic_range(std::vector<double> ends) {
  ends[0] = std::max(ends[0], ends[1] * std::pow(10, -kMostDecades));
  return {ends[0], ends[1], true, false};
}

/// Around one value: some extent, so that an axis has a length.
ShownRange around(double value) {
  const double half = value != 0 ? std::abs(value) / 2 : 0.5;
  return {value - half, value + half, false, true};
}

}  // namespace

ShownRange shown_range(const AmrHierarchy& mesh, int field, bool logarithmic) {
  const std::vector<double> ends = ends_of(mesh, field, logarithmic ? Counted::positive : Counted::all);
  if (logarithmic && std::isnan(ends[0]))
    throw UsageError(fmt::format("{}: the field {} has no value above 0; accepted: a linear axis", clipped(mesh.name()),
                                 quote(mesh.fields()[static_cast<std::size_t>(field)])));
  if (std::isnan(ends[0])) return {0, 1, false, true};
  if (!wide(ends)) {
    ShownRange range = around(ends[0]);
    range.logarithmic = logarithmic;
    return range;
  }
  return logarithmic ? logarithmic_range(ends) : ShownRange{ends[0], ends[1], false, false};
}

ShownRange shown_range(const AmrHierarchy& mesh, int field) {
  if (mesh.statistics(field).min >= 0) {
    const std::vector<double> ends = ends_of(mesh, field, Counted::positive);
    if (ends[0] > 0 && std::log10(ends[1]) - std::log10(ends[0]) > kDecades) return logarithmic_range(ends);
  }
  return shown_range(mesh, field, false);
}

namespace {

constexpr double kLeastShare = 1e-6;  ///< of the volume: bars are over its logarithm, so that rare values are seen

/// Length of a bar, 0 to 1.
double bar_length(double share, double most) {
  return share > kLeastShare ? std::clamp(std::log(share / kLeastShare) / std::log(most / kLeastShare), 0.0, 1.0) : 0;
}

double largest_share(const ValueHistogram& histogram) {
  return std::max(kLeastShare * 10, *std::max_element(histogram.share.begin(), histogram.share.end()));
}

}  // namespace

std::string sparkline(const ValueHistogram& histogram) {
  constexpr std::array<const char*, 9> kHeights{" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  std::string text;
  for (const double share : histogram.share) {
    const int eighths = static_cast<int>(std::lround(8 * bar_length(share, largest_share(histogram))));
    text += kHeights[static_cast<std::size_t>(std::max(share > 0 ? 1 : 0, eighths))];
  }
  return text;
}

std::string histogram_text(const ValueHistogram& histogram, int width) {
  constexpr std::array<const char*, 9> kEighths{"", "▏", "▎", "▍", "▌", "▋", "▊", "▉", "█"};
  const double most = largest_share(histogram);
  std::string text;
  const auto row = [&](const std::string& label, double share) {
    const double length = bar_length(share, most) * std::max(8, width - 28);
    const int eighths = std::max(share > 0 ? 1 : 0, static_cast<int>(std::lround(8 * length)));
    std::string bar;
    for (int i = 0; i < eighths / 8; ++i) bar += kEighths[8];
    bar += kEighths[static_cast<std::size_t>(eighths % 8)];
    text += fmt::format("  {:>11}  {:8.4f} %  {}\n", label, 100 * share, bar);
  };
  const auto bins = static_cast<double>(histogram.share.size());
  if (histogram.below > 0) row("below", histogram.below);
  for (std::size_t i = 0; i < histogram.share.size(); ++i)
    row(fmt::format("{:.4g}", histogram.value_at(static_cast<double>(i) / bins)), histogram.share[i]);
  row(fmt::format("{:.4g}", histogram.upper), histogram.above);
  return text;
}

}  // namespace amrtex
