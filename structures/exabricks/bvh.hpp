// A bounding volume hierarchy over boxes that share no cell, to find the one that holds a cell.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex::exa {

struct BvhNode {
  Box box;        ///< finest cells
  int item = -1;  ///< of a leaf; -1: an inner node, whose first child is the next node
  int skip = 0;   ///< the node after all that is below this one
};

/// Splits at the median of the centres along the axis where they spread the most. Nodes stand depth first.
class BvhBuilder {
 public:
  explicit BvhBuilder(const std::vector<Box>& boxes) : boxes_(boxes) {}

  std::vector<BvhNode> build() {
    order_.resize(boxes_.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<int>(i);
    nodes_.reserve(2 * boxes_.size());
    if (!boxes_.empty()) add(0, order_.size());
    return std::move(nodes_);
  }

 private:
  const Box& at(int i) const { return boxes_[static_cast<std::size_t>(i)]; }
  std::int64_t twice_centre(int i, int axis) const { return std::int64_t{at(i).lower[axis]} + at(i).upper[axis]; }

  void add(std::size_t begin, std::size_t end) {
    const std::size_t node = nodes_.size();
    nodes_.emplace_back();
    Box box = at(order_[begin]);
    for (std::size_t i = begin; i < end; ++i)
      box = {glm::min(box.lower, at(order_[i]).lower), glm::max(box.upper, at(order_[i]).upper)};
    if (end - begin == 1) {
      nodes_[node] = {box, order_[begin], static_cast<int>(nodes_.size())};
      return;
    }
    const int axis = widest_axis(begin, end);
    const std::size_t middle = begin + (end - begin) / 2;
    const auto first = order_.begin();
    std::nth_element(first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(middle),
                     first + static_cast<std::ptrdiff_t>(end),
                     [&](int a, int b) { return std::pair(twice_centre(a, axis), a) < std::pair(twice_centre(b, axis), b); });
    add(begin, middle);
    add(middle, end);
    nodes_[node] = {box, -1, static_cast<int>(nodes_.size())};
  }

  int widest_axis(std::size_t begin, std::size_t end) const {
    int widest = 0;
    std::int64_t most = -1;
    for (int axis = 0; axis < 3; ++axis) {
      std::int64_t low = twice_centre(order_[begin], axis), high = low;
      for (std::size_t i = begin; i < end; ++i) {
        low = std::min(low, twice_centre(order_[i], axis));
        high = std::max(high, twice_centre(order_[i], axis));
      }
      if (high - low > most) {
        most = high - low;
        widest = axis;
      }
    }
    return widest;
  }

  const std::vector<Box>& boxes_;
  std::vector<int> order_;
  std::vector<BvhNode> nodes_;
};

}  // namespace amrtex::exa
