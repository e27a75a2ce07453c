#include "structures/common/draw_tree.hpp"

namespace amrtex {

void DrawTree::set_box(std::size_t node, const Box& cells, int level) {
  nodes[node].box = static_cast<int>(boxes.size());
  boxes.push_back({cells, level});
}

std::size_t DrawTree::split(std::size_t node, int axis, int plane) {
  const std::size_t child = nodes.size();
  nodes[node].axis = axis;
  nodes[node].plane = plane;
  nodes[node].first_child = static_cast<int>(child);
  nodes.resize(child + 2);
  return child;
}

std::vector<int> front_to_back(const DrawTree& tree, const Viewpoint& v) {
  std::vector<int> order;
  if (tree.empty()) return order;
  order.reserve(tree.boxes.size());
  std::vector<int> open{0};
  while (!open.empty()) {
    const DrawNode& n = tree.nodes[static_cast<std::size_t>(open.back())];
    open.pop_back();
    if (n.axis < 0) {
      if (n.box >= 0) order.push_back(n.box);
      continue;
    }
    // rays leave the eye's side of the plane for the other one and never come back
    const bool lower_first = v.parallel ? v.direction[n.axis] >= 0 : v.eye[n.axis] < n.plane;
    open.push_back(n.first_child + (lower_first ? 1 : 0));
    open.push_back(n.first_child + (lower_first ? 0 : 1));
  }
  return order;
}

}  // namespace amrtex
