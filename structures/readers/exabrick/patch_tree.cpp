#include "structures/readers/exabrick/patch_tree.hpp"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <numeric>

namespace amrtex {
namespace {

int widest_axis(const Box& box) {
  const Vec3i size = box.size();
  const int axis = size.x >= size.y ? 0 : 1;
  return size[axis] >= size.z ? axis : 2;
}

}  // namespace

PatchTree::PatchTree(std::span<const Patch> patches) : patches_(patches), order_(patches.size()) {
  if (patches.empty()) return;
  std::iota(order_.begin(), order_.end(), 0U);
  std::size_t nodes = 1;
  for (std::size_t most = order_.size(); most > kLeaf; most = (most + 1) / 2) nodes = 2 * nodes + 1;
  bounds_.resize(nodes);
  build(0, 0, order_.size());
}

void PatchTree::build(std::size_t node, std::size_t begin, std::size_t end) {
  Box around = box(begin);
  for (std::size_t i = begin + 1; i < end; ++i)
    around = {glm::min(around.lower, box(i).lower), glm::max(around.upper, box(i).upper)};
  bounds_[node] = around;
  if (end - begin <= kLeaf) return;
  const int axis = widest_axis(around);
  const std::size_t middle = (begin + end) / 2;
  const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end),
                   [&](std::uint32_t a, std::uint32_t b) { return patches_[a].box.lower[axis] < patches_[b].box.lower[axis]; });
  const auto left = [&] { build(2 * node + 1, begin, middle); };
  const auto right = [&] { build(2 * node + 2, middle, end); };
  constexpr std::size_t kWorthTasks = 4096;
  if (end - begin > kWorthTasks) {
    tbb::parallel_invoke(left, right);
  } else {
    left();
    right();
  }
}

int PatchTree::find(const Vec3i& cell, std::size_t node, std::size_t begin, std::size_t end) const {
  if (!bounds_[node].contains(cell)) return -1;
  if (end - begin <= kLeaf) {
    for (std::size_t i = begin; i < end; ++i)
      if (box(i).contains(cell)) return static_cast<int>(order_[i]);
    return -1;
  }
  const std::size_t middle = (begin + end) / 2;
  const int left = find(cell, 2 * node + 1, begin, middle);
  return left >= 0 ? left : find(cell, 2 * node + 2, middle, end);
}

}  // namespace amrtex
