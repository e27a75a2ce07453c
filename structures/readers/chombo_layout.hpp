// The HDF5 layout of Chombo, which AMReX's HDF5 plot files share:
//
//   /                attributes num_components, component_0 ..., num_levels
//   /Chombo_global   attribute SpaceDim
//   /level_0 ...     attributes dx, prob_domain (inclusive corners), ref_ratio (to the next finer level)
//     boxes            compounds lo_i lo_j lo_k hi_i hi_j hi_k, inclusive
//     data:offsets=0   where each patch begins in the data, counted in values; may be absent
//     data:datatype=0  one array for all patches: a patch's components one after the other, each of them with its ghost
//                      cells, x fastest
//     data_attributes  attribute outputGhost: ghost cells that are stored; absent: none
//
// Attributes may be scalars or arrays: dx and ref_ratio of one number or one an axis.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/readers/hdf5_file.hpp"
#include "structures/readers/index_box.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {

struct ChomboLevel {
  std::string group;
  IndexBox domain;
  Vec3d spacing{1};  ///< of its cells along the axes that there are, world
  std::vector<IndexBox> boxes;
  Vec3l ghosts{0};
};

struct ChomboLayout {
  Hdf5File file;
  int dimensions;  ///< 2 or 3
  std::vector<std::string> fields;
  std::vector<ChomboLevel> levels;
  std::vector<int> ratios;
};

/// How components stand in the data sets of a level.
enum class ChomboComponents {
  one_set,      ///< all of a patch after one another in `data:datatype=0`
  set_for_each  ///< component i in `data:datatype=i`; offsets count its values alone
};

/// Reads all but the values. Throws Error naming the object and what is wrong with it.
ChomboLayout scan_chombo_layout(const std::filesystem::path& path);

/// Reads these fields into a mesh over the box of the world between these corners.
MeshDescription read_chombo_layout(const ChomboLayout& layout, ChomboComponents components, const Vec3d& lower,
                                   const Vec3d& upper, const FieldChoice& fields);

}  // namespace amrtex
