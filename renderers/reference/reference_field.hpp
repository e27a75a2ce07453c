// What filters are defined from (docs/filters.md), by search in the hierarchy: leaves, level values, fills. Private
// to the reference; written from the definitions and from leaf cells alone, not shared with encodings.
#pragma once

#include <array>
#include <limits>
#include <unordered_map>
#include <vector>

#include "renderers/reference/trilinear.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/value_units.hpp"

namespace amrtex {

struct CellHash {
  std::size_t operator()(const Vec3i& c) const {
    std::uint64_t h = static_cast<std::uint32_t>(c.x) * 0x9E3779B97F4A7C15ULL;
    h = (h ^ (h >> 29) ^ static_cast<std::uint32_t>(c.y)) * 0xBF58476D1CE4E5B9ULL;
    h = (h ^ (h >> 29) ^ static_cast<std::uint32_t>(c.z)) * 0x94D049BB133111EBULL;
    return static_cast<std::size_t>(h ^ (h >> 31));
  }
};

/// Offset of corner k of a cell, x fastest.
inline Vec3i corner_offset(int k) { return {k & 1, (k >> 1) & 1, k >> 2}; }

struct ReferenceLeaf {
  int level = -1;  ///< -1: no mesh here
  int patch = -1;
  Vec3i cell{0};
  double value = 0;  ///< NaN where the leaf has none
};

/// Values are numbers in the field's units, in double: then no square of one passes a double's range, and none loses digits to
/// an offset. Immutable; safe to use from several threads.
class ReferenceField {
 public:
  ReferenceField(const AmrHierarchy& hierarchy, int field);

  const AmrHierarchy& hierarchy() const { return hierarchy_; }
  const ValueUnits& units() const { return units_; }
  bool has_missing() const { return has_missing_; }
  int width(int level) const { return levels_[static_cast<std::size_t>(level)].width; }

  /// Leaf that holds a cell of the finest level, which lies in the domain. `hint` is tried first.
  ReferenceLeaf find_leaf(const Vec3i& finest_cell, const ReferenceLeaf& hint = {}) const;
  /// Largest cell around a cell of the finest level that holds no leaf (finest space).
  Box empty_box(const Vec3i& finest_cell) const;

  /// v_L; NaN where there is none.
  double level_value(int level, const Vec3i& cell) const;
  /// v_L or the fill of a missing cell; NaN where there is no neighbour either.
  double filled_value(int level, const Vec3i& cell) const;

  /// The 8 filled level values of the cells lower + {0, 1}^3.
  struct DualCell {
    std::array<double, 8> values;
    bool all_leaves;  ///< all 8 cells are leaves of this level that have a value
  };
  DualCell dual_cell(int level, const Vec3i& lower) const;

  /// The leaves with a value among the cells lower + {0, 1}^3.
  struct BasisCell {
    std::array<double, 8> values;   ///< 0 where there is none
    std::array<double, 8> weights;  ///< 1 or 0
    bool any;
    bool finer;  ///< leaves of finer levels may reach between the centres of these cells
  };
  BasisCell basis_cell(int level, const Vec3i& lower) const;

 private:
  struct Mean {
    double value = std::numeric_limits<double>::quiet_NaN();
    double share = 0;  ///< of the cell's volume that has a value
  };
  struct PatchView {
    Box box;
    const CellValues* values;  // the file's
    const std::uint8_t* leaf;
    std::vector<double> numbers;  // where the units are not plain; else empty
    std::vector<double> means;    // v_L, where the patch has refined cells; else empty
    std::vector<double> shares;   // where they are not all 1; else empty

    double value(std::size_t offset) const { return numbers.empty() ? (*values)[offset] : numbers[offset]; }
  };
  struct Level {
    int width;
    std::vector<PatchView> patches;
    std::unordered_map<Vec3i, Mean, CellHash> unstored;  // refined cells that no patch of this level stores
  };

  const Level& at(int level) const { return levels_[static_cast<std::size_t>(level)]; }
  static double stored_value(const PatchView& patch, std::size_t offset);
  const PatchView* find_patch(int level, const Vec3i& cell) const;
  Mean mean_of(int level, const Vec3i& cell) const;
  Mean mean_of_children(int level, const Vec3i& cell) const;
  void restrict_patch(int level, PatchView& patch) const;
  void find_unstored(int level);
  double neighbour_mean(int level, const Vec3i& cell, int distance) const;

  const AmrHierarchy& hierarchy_;
  ValueUnits units_;
  std::vector<Level> levels_;
  bool has_missing_ = false;
};

}  // namespace amrtex
