// What the filter reads about the cells of a part of a patch.
#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "structures/common/build_tools.hpp"
#include "structures/common/patch_parts.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex {

/// Smallest and largest of each 3^3 values around a cell.
class WindowRanges {
 public:
  void read(const AmrHierarchy& h, int field, int level, const Box& box) {
    wide_ = box.grown(1);
    low_.resize(static_cast<std::size_t>(wide_.cells()));
    filled_level_values(h, field, level, wide_, low_);
    high_ = low_;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (double& v : low_) v = std::isnan(v) ? kInfinity : v;
    for (double& v : high_) v = std::isnan(v) ? -kInfinity : v;
    const Vec3i n = wide_.size();
    for (const std::size_t stride : {std::size_t{1}, static_cast<std::size_t>(n.x), static_cast<std::size_t>(n.x * n.y)}) {
      spread(low_, stride, [](double a, double b) { return a < b ? a : b; });
      spread(high_, stride, [](double a, double b) { return a > b ? a : b; });
    }
  }
  void add_to(ValueRange& range, const Vec3i& cell) const {
    const std::size_t i = wide_.offset(cell);
    if (low_[i] > high_[i]) return;
    range.add(low_[i]);
    range.add(high_[i]);
  }

 private:
  /// The best of three along one axis. Across the array's ends this is wrong; those cells are not read.
  template <class Best>
  void spread(std::vector<double>& v, std::size_t stride, Best&& best) {
    next_ = v;
    for (std::size_t i = stride; i + stride < v.size(); ++i) next_[i] = best(v[i], best(v[i - stride], v[i + stride]));
    v.swap(next_);
  }

  Box wide_;
  std::vector<double> low_, high_, next_;
};

}  // namespace amrtex
