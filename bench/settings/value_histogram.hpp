// How a field's values are spread over the volume: leaf cells, weighted by their volume.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex {

/// Weight of a leaf cell: its volume, or one as any other.
enum class CellWeight { volume, one };

/// What is counted of a field: all values, or those above 0.
enum class Counted { all, positive };

/// The values below which these shares of the weight lie, to 2^-36 of themselves; the smallest and the largest value where a
/// share is 0 or 1. NaN where nothing is counted. Cells without a value count nowhere.
std::vector<double> quantiles(const AmrHierarchy& mesh, int field, std::span<const double> shares, CellWeight weight,
                              Counted counted);

struct ValueHistogram {
  double lower = 0, upper = 1;  ///< of the first and last bin
  bool logarithmic = false;     ///< bins are even in log10(value)
  std::vector<double> share;    ///< of the volume of all cells that have a value
  double below = 0, above = 0;  ///< of the volume: smaller than the first bin's values, larger than the last one's

  double place(double value) const;  ///< 0 at lower, 1 at upper; not cut
  double value_at(double place) const;
};

ValueHistogram value_histogram(const AmrHierarchy& mesh, int field, double lower, double upper, bool logarithmic, int bins);

/// The range that a picture of the field shows, and how: percentiles by volume, a logarithmic axis where the positive values
/// between them span more than three decades.
struct ShownRange {
  double lower = 0, upper = 1;
  bool logarithmic = false;
  bool constant = false;  ///< there is one value, or none
};
ShownRange shown_range(const AmrHierarchy& mesh, int field);
/// The same of a given axis.
ShownRange shown_range(const AmrHierarchy& mesh, int field, bool logarithmic);

/// The histogram in one line, a character a bin.
std::string sparkline(const ValueHistogram& histogram);
/// The histogram as lines of text, `width` characters wide.
std::string histogram_text(const ValueHistogram& histogram, int width);

}  // namespace amrtex
