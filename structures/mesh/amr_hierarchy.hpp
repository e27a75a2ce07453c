// The AMR mesh that everything is built from: levels of patches of cell-centred values.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "structures/mesh/cell_values.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/spaces.hpp"

namespace amrtex {

/// A rectangular block of cells of one level as the simulation wrote it, ghost cells stripped.
struct Patch {
  Box box;                         ///< level space
  std::vector<CellValues> values;  ///< one array a field, box.cells() values each, x fastest
};

/// What a reader or generator hands over. Level 0 is the coarsest.
struct MeshDescription {
  std::string name;         ///< of the data set, for tables
  Vec3d domain_lower{0};    ///< world
  Vec3d domain_upper{1};    ///< world
  Vec3i root_cells{1};      ///< cells of the domain at level 0
  std::vector<int> ratios;  ///< ratios[l] = cells of level l+1 a cell of level l along an axis; levels - 1 of them, each >= 2
  std::vector<std::string> fields;         ///< names of the arrays in each patch
  std::vector<std::string> units;          ///< of the fields, as the file says them; empty: it says none
  std::vector<std::string> fields_there;   ///< all that the file has, read or not; empty: those above
  std::vector<std::vector<Patch>> levels;  ///< patches a level; a level may be empty
  std::array<bool, 3> periodic{false, false, false};
  int dimensions = 3;  ///< of the data: 2 for those that stand as a slab, whose values do not change along z
};

/// The leaf cell that holds a position.
struct LeafCell {
  int level;
  int patch;   ///< in patches(level)
  Vec3i cell;  ///< level space
};

/// Over the leaf cells that have a value.
struct FieldStatistics {
  double min = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
  double least_magnitude = 0;            ///< smallest magnitude above 0; 0 where there is none
  double volume_integral = 0;            ///< sum of value times cell volume, world units
  std::int64_t cells_without_value = 0;  ///< leaf cells that hold NaN or an infinity
};

/// A validated mesh. Legal: holes of any cells, patches that are not nested in one parent, any
/// level jump, empty levels. Refused with an Error that names the data set, the
/// level and the patch: boxes outside their level, overlapping patches of one level,
/// boxes that hold a part only of a cell that the next coarser level stores, cells refined only
/// in part, ratios below 2, more than 31 bits of finest index.
///
/// Values stored under finer patches are not used: on construction each refined
/// cell that a patch stores receives its level value v_L (docs/filters.md), the
/// volume-weighted mean of its leaf descendants that have a value.
class AmrHierarchy {
 public:
  explicit AmrHierarchy(MeshDescription description);
  ~AmrHierarchy();
  AmrHierarchy(AmrHierarchy&&) noexcept;
  AmrHierarchy& operator=(AmrHierarchy&&) noexcept;

  const std::string& name() const;
  int level_count() const;
  int finest_level() const { return level_count() - 1; }
  /// Cells of `level + 1` a cell of `level`, along an axis; 1 for the finest level.
  int ratio_to_finer(int level) const;
  /// Width of a cell of `level` in cells of the finest level.
  int cell_width(int level) const;
  /// Cells of the domain at `level`.
  Vec3i cells(int level) const;
  Box domain(int level) const { return {Vec3i(0), cells(level)}; }
  Vec3d domain_lower() const;      ///< world
  Vec3d domain_upper() const;      ///< world
  Vec3d spacing(int level) const;  ///< cell widths along the axes, world
  std::array<bool, 3> periodic() const;
  int dimensions() const;  ///< of the data that the mesh was read from

  const std::vector<std::string>& fields() const;
  /// Of all fields of the file that the mesh was read from, in its order.
  const std::vector<std::string>& fields_there() const;
  /// Of the field's values, as the file says it; empty where it says none.
  const std::string& unit(int field) const;
  /// Index of the field, or a UsageError that names the fields there are.
  int field_index(const std::string& field) const;

  std::span<const Patch> patches(int level) const;
  /// Patch of `level` that stores the cell, or -1.
  int find_patch(int level, const Vec3i& cell) const;
  /// Patches of `level` that overlap the box (level space), in ascending order.
  std::vector<int> patches_in(int level, const Box& box) const;
  /// One byte a cell of the patch, x fastest: 1 where the cell is a leaf, 0 where finer patches cover it.
  std::span<const std::uint8_t> leaf_mask(int level, int patch) const;
  /// Does any leaf of a level above `level` lie in the box (space of `level`)?
  bool refined_within(int level, const Box& box) const;

  /// Leaf that holds a cell of the finest level; nullopt outside the mesh.
  std::optional<LeafCell> find_leaf(const Vec3i& finest_cell) const;
  double value(const LeafCell& leaf, int field) const;

  /// v_L of one cell (docs/filters.md); NaN where the mesh or the value is missing.
  double level_value(int level, const Vec3i& cell, int field) const;

  std::int64_t leaf_cells() const;
  std::int64_t leaf_cells(int level) const;
  std::int64_t stored_cells() const;
  std::int64_t stored_cells(int level) const;
  /// Are there domain cells without a leaf?
  bool has_holes() const;
  /// Must an encoding of this field keep a validity bit a cell (holes, NaN or infinities)?
  bool has_missing(int field) const { return has_holes() || statistics(field).cells_without_value > 0; }
  const FieldStatistics& statistics(int field) const;

  /// Hex digits of a hash over the leaf cells alone (position from the mesh's lower
  /// corner and width in finest cells, value rounded to float; order does not
  /// matter), so the same mesh from two file formats has the same hash.
  std::string content_hash(int field) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace amrtex
