// Active brick regions (Wald et al. 2020, sections 3.2.2 and 3.2.3): parts of a brick's box into all of which the hats of the
// same cells reach, as far as faces of cells allow; and the pieces of bricks that a sample in one of them reads.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "bricks.hpp"

namespace amrtex::exa {

/// A box of leaf cells of one level whose values lie side by side in one brick's texels.
struct Piece {
  int brick = 0;
  Box cells;  ///< space of the brick's level; at most a border outside of the brick
};

struct Region {
  Box box;             ///< finest cells, inside one brick's
  int brick = 0;       ///< that one
  int level = 0;       ///< whose cell faces its faces are; none of its pieces is finer
  bool plain = false;  ///< the texels of its brick give f, without a sum of hats
  bool own = false;    ///< they give its first piece's values, without clamping to its outer cells
  int first_piece = 0;
  int pieces = 0;
  int active_bricks = 0;  ///< bricks whose supports reach in, its own included: the paper's list
};

/// A texel of a brick's border that no leaf cell of its level owns repeats another's value.
struct Repeat {
  Vec3i cell, source;  ///< space of the brick's level
};

struct RegionNode {
  int first_child = 0;  ///< 0: a leaf
  int axis = 0;
  int plane = 0;    ///< finest cells
  int region = -1;  ///< of a leaf; -1: no mesh
};

/// As start_grid.hpp asks.
inline int plane_of(const AmrHierarchy& /*h*/, const RegionNode& n, const Box& /*box*/) { return n.plane; }
inline bool is_drawn(const RegionNode& n) { return n.region >= 0; }

struct RegionSet {
  std::vector<RegionNode> nodes;  ///< over the whole domain, children after their parent
  std::vector<Region> regions;    ///< brick by brick
  std::vector<Piece> pieces;
  std::vector<std::size_t> first_region;     ///< of each brick, and the end
  std::vector<std::vector<Repeat>> repeats;  ///< of each brick
  int depth = 0;
  std::int64_t empty = 0;  ///< leaves without mesh
};

struct RegionOptions {
  int border = 0;      ///< texels around a brick that hold its neighbours' values; then neighbours of one level are one piece
  bool hats = true;    ///< false: each brick is one region (filter nearest)
  bool pieces = true;  ///< false: the regions' cells are searched and not kept (Wald et al. 2017)
};

/// Divides one brick's box. One object a thread; a brick is one thread's.
class BrickRegions {
 public:
  BrickRegions(const AmrHierarchy& h, const BrickTree& tree, const RegionOptions& options)
      : hierarchy_(h), tree_(tree), options_(options) {}

  struct Result {
    std::vector<RegionNode> nodes;
    std::vector<Region> regions;
    std::vector<Piece> pieces;
    std::vector<Repeat> repeats;
    int depth = 0;
  };

  Result divide(int brick) {
    result_ = {};
    own_ = brick;
    const Brick& b = at(brick);
    repeated_.clear();
    result_.nodes.emplace_back();
    std::vector<int> others;
    if (options_.hats)
      for_each_reaching(tree_.nodes, b.box(), [&](const BrickNode& n) {
        if (n.brick != brick) others.push_back(n.brick);
      });
    refine(0, b.box(), others, 0);
    return std::move(result_);
  }

 private:
  struct Plane {
    int axis = -1;
    int at = 0;
  };
  struct Part {
    Box cells;
    int brick;
  };
  /// A plane closer to the face of a brick's own cells takes this many finest cells off what sums hats, or is not taken.
  static constexpr int kWorthAPlane = 3;

  const Brick& at(int brick) const { return tree_.bricks[static_cast<std::size_t>(brick)]; }
  bool foreign(const Brick& b) const { return options_.border == 0 || b.level != at(own_).level; }

  /// The support's face on one side of an axis, moved outwards to a multiple of `width`, finest cells.
  static int support_face(const Brick& b, int axis, bool upper, int width) {
    const Box box = b.box();
    const std::int64_t twice = upper ? 2 * std::int64_t{box.upper[axis]} + b.width : 2 * std::int64_t{box.lower[axis]} - b.width;
    const std::int64_t w = 2 * std::int64_t{width};
    std::int64_t n = twice / w;
    if (upper && n * w < twice) ++n;
    if (!upper && n * w > twice) --n;
    return static_cast<int>(n * width);
  }

  /// Keeps the plane that is nearest to the middle.
  static void consider(Plane& best, const Box& box, int axis, int at) {
    if (at <= box.lower[axis] || at >= box.upper[axis]) return;
    const auto off = [&](int p) { return std::abs(2 * std::int64_t{p} - box.lower[axis] - box.upper[axis]); };
    if (best.axis < 0 || off(at) < off(best.at) || (off(at) == off(best.at) && at < best.at)) best = {axis, at};
  }

  /// Axes from the widest extent of the box to the narrowest.
  static std::array<int, 3> axes_by_width(const Box& box) {
    const Vec3i size = box.size();
    std::array<int, 3> axes{0, 1, 2};
    std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
    return axes;
  }

  /// A face of a support: at faces of the brick's own cells first, then of finer cells where enough is won.
  Plane support_plane(const Box& box, const std::vector<int>& others) const {
    const int own = at(own_).width;
    for (const bool fine : {false, true})
      for (const int axis : axes_by_width(box)) {
        Plane best;
        for (const int i : others) {
          const Brick& b = at(i);
          if (!foreign(b) || (fine && b.width >= own)) continue;
          for (const bool upper : {false, true}) {
            const int coarse = support_face(b, axis, upper, own);
            const int place = fine ? support_face(b, axis, upper, b.width) : coarse;
            if (!fine || std::abs(coarse - place) >= kWorthAPlane) consider(best, box, axis, place);
          }
        }
        if (best.axis >= 0) return best;
      }
    return {};
  }

  /// Leaf cells of a level whose hats reach into the box, a part a brick, the own brick's first.
  std::vector<Part> parts_of(int level, const Box& box, const std::vector<int>& others) const {
    std::vector<Part> parts;
    const Box cells = reaching_cells(box, hierarchy_.cell_width(level));
    const auto add = [&](int brick) {
      const Box part = intersection(at(brick).cells, cells);
      if (at(brick).level == level && !part.empty()) parts.push_back({part, brick});
    };
    add(own_);
    for (const int i : others) add(i);
    return parts;
  }

  static Box around(const Box& a, const Box& b) { return {glm::min(a.lower, b.lower), glm::max(a.upper, b.upper)}; }

  /// The brick of one of the parts whose texels hold all of `cells`; -1: none.
  int holder(const std::vector<Part>& parts, const Box& cells) const {
    for (const Part& p : parts)
      if (at(p.brick).cells.grown(options_.border).contains(cells)) return p.brick;
    return -1;
  }

  /// The parts as one box, where they fill one that one brick holds.
  std::optional<Piece> one_piece(const std::vector<Part>& parts) const {
    Box all = parts.front().cells;
    std::int64_t cells = 0;
    for (const Part& p : parts) {
      all = around(all, p.cells);
      cells += p.cells.cells();
    }
    if (cells != all.cells()) return std::nullopt;
    const int brick = holder(parts, all);
    return brick < 0 ? std::nullopt : std::optional(Piece{brick, all});
  }

  /// Joins parts two by two while a pair fills a box that one brick holds.
  std::vector<Piece> pieces_of(const std::vector<Part>& parts) const {
    if (const auto one = one_piece(parts)) return {*one};
    std::vector<Piece> pieces;
    for (const Part& p : parts) pieces.push_back({p.brick, p.cells});
    const auto join = [&] {
      for (std::size_t i = 0; i < pieces.size(); ++i)
        for (std::size_t j = i + 1; j < pieces.size(); ++j) {
          const Box all = around(pieces[i].cells, pieces[j].cells);
          if (all.cells() != pieces[i].cells.cells() + pieces[j].cells.cells()) continue;
          const int brick = holder(parts, all);
          if (brick < 0) continue;
          pieces[i] = {brick, all};
          pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(j));
          return true;
        }
      return false;
    };
    while (options_.border > 0 && join()) {
    }
    return pieces;
  }

  /// Where the own level's cells about the box fill no box: a plane on one side of which they do, the more of it the better.
  Plane coverage_plane(const Box& box, const std::vector<int>& others) const {
    const Brick& own = at(own_);
    const std::vector<Part> parts = parts_of(own.level, box, others);
    if (options_.border == 0 || one_piece(parts)) return {};
    Plane best;
    std::int64_t most = 0;
    const auto try_plane = [&](int axis, int place) {
      if (place <= box.lower[axis] || place >= box.upper[axis]) return;
      for (const bool upper : {false, true}) {
        Box side = box;
        (upper ? side.lower : side.upper)[axis] = place;
        if (side.cells() > most && one_piece(parts_of(own.level, side, others))) {
          most = side.cells();
          best = {axis, place};
        }
      }
    };
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<int> places;
      for (const Part& p : parts)
        for (const int face : {p.cells.lower[axis], p.cells.upper[axis]})
          for (const int d : {-1, 0, 1}) places.push_back((face + d) * own.width);
      std::sort(places.begin(), places.end());
      places.erase(std::unique(places.begin(), places.end()), places.end());
      for (const int place : places) try_plane(axis, place);
    }
    return best;
  }

  void refine(std::size_t node, const Box& box, const std::vector<int>& candidates, int depth) {
    result_.depth = std::max(result_.depth, depth);
    std::vector<int> others;
    for (const int i : candidates)
      if (reaches(at(i), box)) others.push_back(i);
    Plane plane = options_.hats ? support_plane(box, others) : Plane{};
    if (plane.axis < 0 && options_.hats) plane = coverage_plane(box, others);
    if (plane.axis < 0) return finish(node, box, others);
    const std::size_t child = result_.nodes.size();
    result_.nodes.resize(child + 2);
    result_.nodes[node] = {static_cast<int>(child), plane.axis, plane.at, -1};
    Box below = box, above = box;
    below.upper[plane.axis] = above.lower[plane.axis] = plane.at;
    refine(child, below, others, depth + 1);
    refine(child + 1, above, others, depth + 1);
  }

  /// The coarsest level that is as fine as every piece and at whose cells' faces the box ends.
  int level_of(const Box& box, int level) const {
    const auto divides = [&](int l) {
      const int w = hierarchy_.cell_width(l);
      for (int a = 0; a < 3; ++a)
        if (box.lower[a] % w != 0 || box.upper[a] % w != 0) return false;
      return true;
    };
    while (!divides(level)) ++level;  // the finest always does
    return level;
  }

  void finish(std::size_t node, const Box& box, const std::vector<int>& others) {
    result_.nodes[node].region = static_cast<int>(result_.regions.size());
    Region r;
    r.box = box;
    r.brick = own_;
    r.first_piece = static_cast<int>(result_.pieces.size());
    r.active_bricks = 1 + static_cast<int>(others.size());
    std::vector<int> levels{at(own_).level};
    for (const int i : others) levels.push_back(at(i).level);
    std::sort(levels.begin() + 1, levels.end());
    int finest = 0, own_pieces = 1;
    std::vector<int> seen;
    for (const int level : levels) {
      if (std::find(seen.begin(), seen.end(), level) != seen.end()) continue;
      seen.push_back(level);
      finest = std::max(finest, level);
      if (!options_.hats) {
        result_.pieces.push_back({own_, at(own_).cells});
        continue;
      }
      const std::vector<Part> parts = parts_of(level, box, others);
      if (parts.empty()) continue;  // only faces meet
      for (const Piece& p : pieces_of(parts)) result_.pieces.push_back(p);
      if (level == at(own_).level) own_pieces = static_cast<int>(result_.pieces.size()) - r.first_piece;
    }
    r.pieces = static_cast<int>(result_.pieces.size()) - r.first_piece;
    r.level = level_of(box, finest);
    if (options_.pieces) r.own = make_plain(r, own_pieces);
    r.plain = r.own && r.pieces == 1;
    result_.regions.push_back(r);
  }

  /// Can the region read its own level's piece from its brick's texels as they stand? The border repeats the piece's outer cells
  /// where no other region needs something else there: then interpolation is constant beyond their centres, which is what the
  /// quotient of the hats of a box is.
  bool make_plain(const Region& r, int own_pieces) {
    if (!options_.hats) return true;
    const Piece& piece = result_.pieces[static_cast<std::size_t>(r.first_piece)];
    const Brick& own = at(own_);
    if (own_pieces != 1 || piece.brick != own_) return false;
    const Box read = reaching_cells(r.box, own.width);
    if (piece.cells.contains(read)) return true;
    if (options_.border == 0) return false;
    std::vector<Repeat> wanted;
    const Box stored = own.cells.grown(options_.border);
    bool free = true;
    for_each_cell(read, [&](const Vec3i& c) {
      if (!free || piece.cells.contains(c)) return;
      const Vec3i source = glm::clamp(c, piece.cells.lower, piece.cells.upper - Vec3i(1));
      const auto known = repeated_.find(stored.offset(c));
      if (known == repeated_.end())
        wanted.push_back({c, source});
      else
        free = known->second == source;
    });
    if (!free) return false;
    for (const Repeat& w : wanted) {
      repeated_.emplace(stored.offset(w.cell), w.source);
      result_.repeats.push_back(w);
    }
    return true;
  }

  const AmrHierarchy& hierarchy_;
  const BrickTree& tree_;
  RegionOptions options_;
  int own_ = 0;
  std::map<std::size_t, Vec3i> repeated_;
  Result result_;
};

/// The regions of all bricks, under the tree of the bricks. The same for any number of threads.
inline RegionSet build_regions(const AmrHierarchy& h, const BrickTree& tree, const RegionOptions& options) {
  std::vector<BrickRegions::Result> parts(tree.bricks.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, parts.size()), [&](const auto& range) {
    BrickRegions divider(h, tree, options);
    for (std::size_t i = range.begin(); i != range.end(); ++i) parts[i] = divider.divide(static_cast<int>(i));
  });
  RegionSet set;
  for (BrickRegions::Result& part : parts) {
    set.first_region.push_back(set.regions.size());
    const int shift = static_cast<int>(set.pieces.size());
    for (Region r : part.regions) {
      r.first_piece += shift;
      set.regions.push_back(r);
    }
    set.pieces.insert(set.pieces.end(), part.pieces.begin(), part.pieces.end());
    set.repeats.push_back(std::move(part.repeats));
  }
  set.first_region.push_back(set.regions.size());
  // The brick tree's nodes keep their numbers; those of a brick follow, its root in the place of the brick's leaf.
  for (const BrickNode& n : tree.nodes) set.nodes.push_back({n.first_child, n.axis, n.plane, -1});
  set.depth = tree.depth;
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const BrickNode& n = tree.nodes[i];
    if (n.first_child != 0) continue;
    if (n.brick < 0) {
      ++set.empty;
      continue;
    }
    const auto brick = static_cast<std::size_t>(n.brick);
    const BrickRegions::Result& part = parts[brick];
    const int shift = static_cast<int>(set.nodes.size()) - 1;  // of all but the root
    for (std::size_t k = 0; k < part.nodes.size(); ++k) {
      RegionNode node = part.nodes[k];
      if (node.first_child != 0) node.first_child += shift;
      if (node.region >= 0) node.region += static_cast<int>(set.first_region[brick]);
      if (k == 0)
        set.nodes[i] = node;
      else
        set.nodes.push_back(node);
    }
    set.depth = std::max(set.depth, tree.depth + part.depth);
  }
  return set;
}

}  // namespace amrtex::exa
