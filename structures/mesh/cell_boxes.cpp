#include "structures/mesh/cell_boxes.hpp"

#include <tbb/parallel_sort.h>

#include <tuple>

namespace amrtex {
namespace {

/// Joins boxes that touch along the axis and have the same extent along the others.
void join_along(int axis, std::vector<Box>& boxes) {
  const int b = (axis + 1) % 3;
  const int c = (axis + 2) % 3;
  const auto key = [&](const Box& box) {
    return std::tuple(box.lower[b], box.upper[b], box.lower[c], box.upper[c], box.lower[axis]);
  };
  tbb::parallel_sort(boxes.begin(), boxes.end(), [&](const Box& p, const Box& q) { return key(p) < key(q); });
  std::size_t last = 0;
  for (std::size_t i = 1; i < boxes.size(); ++i) {
    Box& open = boxes[last];
    const Box& next = boxes[i];
    Box joined = open;
    joined.lower[axis] = next.lower[axis];
    joined.upper[axis] = next.upper[axis];
    if (open.upper[axis] == next.lower[axis] && joined == next)
      open.upper[axis] = next.upper[axis];
    else
      boxes[++last] = next;
  }
  if (!boxes.empty()) boxes.resize(last + 1);
}

}  // namespace

std::vector<Box> boxes_of_cells(std::span<const Vec3i> cells) {
  std::vector<Box> boxes;
  for (const Vec3i& cell : cells) {
    const bool goes_on =
        !boxes.empty() && boxes.back().upper.x == cell.x && boxes.back().lower.y == cell.y && boxes.back().lower.z == cell.z;
    if (goes_on)
      ++boxes.back().upper.x;
    else
      boxes.push_back({cell, cell + Vec3i(1)});
  }
  return boxes_of_runs(std::move(boxes));
}

std::vector<Box> boxes_of_runs(std::vector<Box> runs) {
  join_along(1, runs);
  join_along(2, runs);
  tbb::parallel_sort(runs.begin(), runs.end(), [](const Box& p, const Box& q) { return array_order(p.lower, q.lower); });
  return runs;
}

std::vector<Box> parts_of(std::span<const Box> boxes, int edge) {
  std::vector<Box> parts;
  for (const Box& box : boxes)
    for_each_cell({Vec3i(0), ceil_div(box.size(), edge)}, [&](const Vec3i& part) {
      const Vec3i lower = box.lower + part * edge;
      parts.push_back({lower, lower + glm::min(Vec3i(edge), box.upper - lower)});
    });
  return parts;
}

}  // namespace amrtex
