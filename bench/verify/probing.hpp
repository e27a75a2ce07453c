// Where fields are asked, and how the answers are compared. Tests use it too.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <ostream>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "bench/verify/meshes.hpp"
#include "renderers/consumers/probe.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "structures/mesh/level_values.hpp"

namespace amrtex::verify {

// ---- positions ----

/// Largest fraction that a float holds: one ulp below an upper face.
inline constexpr double kBelowOne = 0x1.fffffep-1;
/// One ulp of 1 above a lower face.
inline constexpr double kAboveZero = 0x1p-24;

/// Every leaf, or `most` of each level taken at random.
inline std::vector<LeafCell> some_leaves(const AmrHierarchy& h, std::size_t most, std::mt19937_64& random) {
  std::vector<LeafCell> all;
  for (int level = 0; level < h.level_count(); ++level) {
    std::vector<LeafCell> leaves;
    for (std::size_t k = 0; k < h.patches(level).size(); ++k) {
      const Box& box = h.patches(level)[k].box;
      const auto mask = h.leaf_mask(level, static_cast<int>(k));
      for_each_cell(box, [&](const Vec3i& c) {
        if (mask[box.offset(c)] != 0) leaves.push_back({level, static_cast<int>(k), c});
      });
    }
    std::shuffle(leaves.begin(), leaves.end(), random);
    leaves.resize(std::min(leaves.size(), most));
    all.insert(all.end(), leaves.begin(), leaves.end());
  }
  return all;
}

/// Centres of leaves, their faces and corners and the floats next to these on either side,
/// random places in them and anywhere in the domain, and the domain's last face.
inline std::vector<FinestPosition> probe_positions(const AmrHierarchy& h, std::size_t leaves_a_level, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const Box domain = h.domain(h.finest_level());
  const auto fraction = [&] { return std::min(static_cast<double>(static_cast<float>(unit(random))), kBelowOne); };
  std::vector<FinestPosition> positions;
  const auto add = [&](const FinestPosition& p) {
    if (domain.contains(p.cell)) positions.push_back(p);
  };
  const auto inside = [&](const Vec3i& lower, int width) {
    FinestPosition p{lower, Vec3d(fraction(), fraction(), fraction())};
    for (int a = 0; a < 3; ++a) p.cell[a] += std::uniform_int_distribution<int>(0, width - 1)(random);
    return p;
  };
  for (const LeafCell& leaf : some_leaves(h, leaves_a_level, random)) {
    const int w = h.cell_width(leaf.level);
    const Vec3i lower = leaf.cell * w;
    const Vec3i last = lower + Vec3i(w - 1);
    add({lower + Vec3i(w / 2), Vec3d(w % 2 == 0 ? 0 : 0.5)});
    for (int a = 0; a < 3; ++a) {
      FinestPosition p = inside(lower, w);
      const auto along_axis = [&](int cell, double f) {
        p.cell[a] = cell;
        p.fraction[a] = f;
        add(p);
      };
      along_axis(lower[a], 0);
      along_axis(lower[a], kAboveZero);
      along_axis(lower[a] - 1, kBelowOne);
      along_axis(last[a], kBelowOne);
    }
    add({lower, Vec3d(0)});
    add({lower, Vec3d(kAboveZero)});
    add({lower - Vec3i(1), Vec3d(kBelowOne)});
    add({last, Vec3d(kBelowOne)});
    add({{lower.x, last.y, lower.z - 1}, {0, kBelowOne, kBelowOne}});
    for (int i = 0; i < 3; ++i) add(inside(lower, w));
  }
  for (int i = 0; i < 200; ++i) {
    FinestPosition p{Vec3i(0), Vec3d(fraction(), fraction(), fraction())};
    for (int a = 0; a < 3; ++a) p.cell[a] = std::uniform_int_distribution<int>(0, domain.upper[a] - 1)(random);
    add(p);
  }
  add({domain.upper - Vec3i(1), Vec3d(kBelowOne)});
  return positions;
}

// ---- comparing ----

using Values = std::vector<std::optional<double>>;

inline Values reference_values(const AmrHierarchy& h, const FilterDefinition& definition,
                               std::span<const FinestPosition> positions) {
  const HierarchyReference reference(h, 0, definition);
  Values values;
  for (const FinestPosition& p : positions) values.push_back(reference.sample(p));
  return values;
}

/// Difference of the largest and smallest value; 1 for a constant.
inline double value_range(const AmrHierarchy& h) {
  const FieldStatistics& s = h.statistics(0);
  return s.max > s.min ? s.max - s.min : 1;
}

/// Of the level values and fills within two cells: what a linear filter can see, and more.
inline double local_range(const AmrHierarchy& h, int level, const FinestPosition& p) {
  const Vec3i cell = p.cell / h.cell_width(level);
  const Box box{cell - Vec3i(2), cell + Vec3i(3)};
  std::array<double, 125> values{};
  filled_level_values(h, 0, level, box, values);
  double low = kInf;
  double high = -kInf;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  return std::max(high - low, 0.0);
}

struct Comparison {
  std::size_t compared = 0;
  std::size_t failed = 0;
  double worst = 0;   ///< difference
  std::string first;  ///< failure
  explicit operator bool() const { return compared > 0 && failed == 0; }
};
inline std::ostream& operator<<(std::ostream& out, const Comparison& c) {
  return out << c.failed << " of " << c.compared << " differ, by " << c.worst << " at most; " << c.first;
}

/// The one check of all tests of fields: `tolerance(i)` is asked where values differ.
template <class Tolerance>
Comparison compare(std::span<const FinestPosition> positions, const Values& expected, std::span<const ProbeResult> got,
                   Tolerance&& tolerance) {
  Comparison result;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    ++result.compared;
    const bool has = expected[i].has_value();
    bool good = has == got[i].found;
    if (good && has && *expected[i] != got[i].value) {
      const double difference = std::abs(*expected[i] - got[i].value);
      good = difference <= tolerance(i);
      result.worst = std::max(result.worst, std::isnan(difference) ? kInf : difference);
    }
    if (good) continue;
    if (result.failed++ == 0) {
      const FinestPosition& p = positions[i];
      const auto text = [](bool found, double value) { return found ? fmt::format("{:.17g}", value) : std::string("no value"); };
      result.first =
          fmt::format("first at cell ({}, {}, {}) + ({}, {}, {}): {} instead of {}", p.cell.x, p.cell.y, p.cell.z, p.fraction.x,
                      p.fraction.y, p.fraction.z, text(got[i].found, got[i].value), text(has, has ? *expected[i] : 0));
    }
  }
  return result;
}

inline Comparison compare(std::span<const FinestPosition> positions, const Values& expected, std::span<const ProbeResult> got,
                          double tolerance) {
  return compare(positions, expected, got, [tolerance](std::size_t) { return tolerance; });
}

inline Values values_of(std::span<const ProbeResult> results) {
  Values values;
  for (const ProbeResult& r : results) values.push_back(r.found ? std::optional(r.value) : std::nullopt);
  return values;
}

/// The field in double precision against the double reference of its own definition.
inline Comparison compare_double(const AmrHierarchy& h, const EncodedField& field, std::span<const FinestPosition> positions) {
  return compare(positions, reference_values(h, field.definition, positions),
                 probe_on_cpu(h, field, Precision::double_precision, positions), 1e-12 * value_range(h));
}

}  // namespace amrtex::verify
