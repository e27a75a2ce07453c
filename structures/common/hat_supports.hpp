// Where hats of cells reach (filter `basis`): for builders that bound values, and for samples that search the cells whose hats
// reach them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "structures/common/build_tools.hpp"

namespace amrtex {

/// Does any hat of cells of one width that fill a box reach into another (both in finest cells)? Hats end half a cell beyond
/// their cell, faces excluded.
inline bool hats_reach(const Box& cells, int width, const Box& box) {
  for (int a = 0; a < 3; ++a) {
    if (2 * std::int64_t{cells.lower[a]} - width >= 2 * std::int64_t{box.upper[a]}) return false;
    if (2 * std::int64_t{cells.upper[a]} + width <= 2 * std::int64_t{box.lower[a]}) return false;
  }
  return true;
}

/// Cells of a level, `width` finest cells wide, whose hats reach into a box (finest cells); in the level's space.
inline Box reaching_cells(const Box& box, int width) {
  Box cells;
  for (int a = 0; a < 3; ++a) {
    const std::int64_t w = width;
    const auto down = [](std::int64_t n, std::int64_t d) { return n >= 0 ? n / d : -((-n + d - 1) / d); };
    cells.lower[a] = static_cast<int>(down(2 * std::int64_t{box.lower[a]} - w, 2 * w));
    cells.upper[a] = static_cast<int>(-down(-(2 * std::int64_t{box.upper[a]} + w), 2 * w));
  }
  return cells;
}

// Trees over boxes of cells: a node has `first_child` (0: a leaf; the second child is the next node), `box` (finest cells), which
// is that of a leaf's cells, and `widest`, the width of the widest cell below it, in finest cells; 0: there is none.

/// Sets `widest` of inner nodes from the leaves'. Children stand after their parent.
template <class Node>
void find_widest(std::vector<Node>& nodes) {
  for (std::size_t i = nodes.size(); i-- > 0;) {
    if (nodes[i].first_child == 0) continue;
    const auto child = static_cast<std::size_t>(nodes[i].first_child);
    nodes[i].widest = std::max(nodes[child].widest, nodes[child + 1].widest);
  }
}

/// Calls f(leaf) for each leaf some of whose cells' hats reach into the box, in the tree's order.
template <class Node, class F>
void for_each_reaching(const std::vector<Node>& nodes, const Box& box, F&& f, std::size_t from = 0) {
  const Node& n = nodes[from];
  if (n.widest == 0 || !hats_reach(n.box, n.widest, box)) return;
  if (n.first_child == 0) return f(n);
  for (const int side : {0, 1}) for_each_reaching(nodes, box, f, static_cast<std::size_t>(n.first_child + side));
}

/// A tree depth first, each node with the box of the supports below it, outwards to whole finest cells; nodes without cells left
/// out. Two times four words a node (`basis_supports` of shaders/basis.glsl):
///
///   lower corner, code of a leaf or 0; upper corner, the node after all below this one, 0 at the end
class SupportList {
 public:
  SupportList() = default;
  /// `code(leaf)` is what the shader knows a leaf by, not 0.
  template <class Node, class Code>
  SupportList(const std::vector<Node>& nodes, Code&& code) {
    add(nodes, 0, code);
  }

  std::int64_t bytes() const { return part().bytes(); }
  Part part() const {
    return buffer_part("basis_supports", "boxes of supports", TexelFormat::rgba32ui,
                       2 * std::max<std::int64_t>(static_cast<std::int64_t>(entries_.size()), 1));
  }
  void write(HostTexture& buffer) const {
    auto* words = buffer.as<std::uint32_t>();
    for (const Entry& e : entries_) {
      write_box(e.box, e.code, e.next == entries_.size() ? 0U : static_cast<std::uint32_t>(e.next), words);
      words += 8;
    }
  }

 private:
  struct Entry {
    Box box;
    std::uint32_t code = 0;
    std::size_t next = 0;
  };

  template <class Node, class Code>
  void add(const std::vector<Node>& nodes, std::size_t node, Code& code) {
    const Node& n = nodes[node];
    if (n.widest == 0) return;
    const std::size_t i = entries_.size();
    entries_.push_back({n.box.grown((n.widest + 1) / 2), n.first_child == 0 ? code(n) : 0U});
    if (n.first_child != 0)
      for (const int side : {0, 1}) add(nodes, static_cast<std::size_t>(n.first_child + side), code);
    entries_[i].next = entries_.size();
  }

  std::vector<Entry> entries_;
};

}  // namespace amrtex
