// What drawing needs to know of a mesh beside a structure that was built of it.
#pragma once

#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

class AmrHierarchy;

/// Where a mesh lies and how fine it is. What draws sees this much of a mesh, and no cell of it.
struct DomainGeometry {
  /// Not explicit: a mesh stands for its own geometry where nothing else of it is asked.
  DomainGeometry(const AmrHierarchy& mesh);

  Vec3d lower, upper;             ///< world
  Vec3i cells;                    ///< of the finest level
  Vec3d spacing;                  ///< widths of a finest cell along the axes, world
  std::vector<int> level_widths;  ///< width of a cell of each level, finest cells
  double longest_patch;           ///< diagonal of the largest patch, cells of its own level; 0 without patches

  int finest_level() const { return static_cast<int>(level_widths.size()) - 1; }
  Vec3d size() const { return upper - lower; }
  Vec3d middle() const { return (lower + upper) * 0.5; }
  /// Of a finest cell, world: the unit of ray length.
  double smallest_edge() const;
  Vec3d in_finest_cells(const Vec3d& p_world) const { return (p_world - lower) / spacing; }
};

}  // namespace amrtex
