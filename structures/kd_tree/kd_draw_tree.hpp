// The tree's drawn leaves as boxes for consumers that draw box by box.
#pragma once

#include "kd_partition.hpp"
#include "structures/common/draw_tree.hpp"
#include "structures/common/start_grid.hpp"

namespace amrtex::kd {

inline DrawTree make_draw_tree(const AmrHierarchy& h, const Tree& tree) {
  const std::vector<Box> boxes = node_boxes(h, tree);
  DrawTree draw;
  draw.nodes.resize(tree.nodes.size());  // the same indices: children stand side by side here too
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const Node& n = tree.nodes[i];
    if (n.first_child != 0) {
      draw.nodes[i].axis = n.axis;
      draw.nodes[i].plane = boxes[n.first_child].upper[n.axis];
      draw.nodes[i].first_child = static_cast<int>(n.first_child);
    } else if (n.leaf >= 0) {
      draw.set_box(i, boxes[i], n.level);
    }
  }
  return draw;
}

}  // namespace amrtex::kd
