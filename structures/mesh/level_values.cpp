#include "structures/mesh/level_values.hpp"

#include <cassert>
#include <cmath>
#include <vector>

namespace amrtex {
namespace {

/// Copies patch values of `level` or coarser over the part of the box that the patch covers.
void copy_patch(const AmrHierarchy& h, int field, int level, const Box& box, int from, const Patch& patch,
                std::span<double> out) {
  const int r = h.cell_width(from) / h.cell_width(level);
  const Box part = intersection(patch.box.refined(r), box);
  const auto length = static_cast<std::size_t>(std::max(0, part.size().x));
  patch.values[static_cast<std::size_t>(field)].visit([&](const auto& values) {
    for (int z = part.lower.z; z < part.upper.z; ++z)
      for (int y = part.lower.y; y < part.upper.y; ++y) {
        double* const row = &out[box.offset({part.lower.x, y, z})];
        std::size_t source = patch.box.offset({floor_div(part.lower.x, r), floor_div(y, r), floor_div(z, r)});
        if (r == 1) {
          for (std::size_t x = 0; x < length; ++x) row[x] = values[source + x];
          continue;
        }
        int phase = part.lower.x % r;
        for (std::size_t x = 0; x < length; ++x) {
          row[x] = values[source];
          if (++phase == r) {
            phase = 0;
            ++source;
          }
        }
      }
  });
}

/// Cells that only levels above `level` store, over a coarser patch or over none.
void average_unstored(const AmrHierarchy& h, int field, int level, const Box& box, std::span<double> out) {
  const Box inside = intersection(box, h.domain(level));
  for (int finer = level + 1; finer < h.level_count(); ++finer) {
    const int r = h.cell_width(level) / h.cell_width(finer);
    for (int k : h.patches_in(finer, inside.refined(r))) {
      const Box covered = intersection(h.patches(finer)[static_cast<std::size_t>(k)].box.coarsened(r), inside);
      // a patch of `level` holds the mean already; patches are few a box, so ask cell by cell
      for_each_cell(covered, [&](const Vec3i& cell) {
        if (h.find_patch(level, cell) < 0) out[box.offset(cell)] = h.level_value(level, cell, field);
      });
    }
  }
}

bool is_nested(const AmrHierarchy& h, int level, const Box& box) {
  // every cell of the box's domain part stored at this level: nothing to average
  std::int64_t stored = 0;
  const Box inside = intersection(box, h.domain(level));
  for (int k : h.patches_in(level, inside))
    stored += intersection(h.patches(level)[static_cast<std::size_t>(k)].box, inside).cells();
  return stored == inside.cells();
}

double mean_of_neighbours(const Box& box, std::span<const double> values, const Vec3i& cell, int axes) {
  double sum = 0;
  int n = 0;
  for_each_cell(Box{Vec3i(-1), Vec3i(2)}, [&](const Vec3i& d) {
    if (std::abs(d.x) + std::abs(d.y) + std::abs(d.z) != axes || !box.contains(cell + d)) return;
    const double v = values[box.offset(cell + d)];
    if (std::isnan(v)) return;
    sum += v;
    ++n;
  });
  return n > 0 ? sum / n : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

void level_values(const AmrHierarchy& h, int field, int level, const Box& box, std::span<double> out) {
  assert(static_cast<std::int64_t>(out.size()) == box.cells());
  std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
  int first = level;  // coarser levels matter only where this one does not store the cell
  if (!is_nested(h, level, box)) first = 0;
  for (int from = first; from <= level; ++from) {
    const int r = h.cell_width(from) / h.cell_width(level);
    for (int k : h.patches_in(from, box.coarsened(r)))
      copy_patch(h, field, level, box, from, h.patches(from)[static_cast<std::size_t>(k)], out);
  }
  if (first == 0 && level > 0) average_unstored(h, field, level, box, out);
  if (level == 0 && !is_nested(h, 0, box)) average_unstored(h, field, 0, box, out);
}

void filled_level_values(const AmrHierarchy& h, int field, int level, const Box& box, std::span<double> out,
                         std::span<std::uint8_t> missing) {
  level_values(h, field, level, box, out);
  bool any = false;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const bool none = std::isnan(out[i]);
    any = any || none;
    if (!missing.empty()) missing[i] = none ? 1 : 0;
  }
  if (!any) return;
  // a fill looks one cell further and never at other fills
  const Box wide = box.grown(1);
  std::vector<double> around(static_cast<std::size_t>(wide.cells()));
  level_values(h, field, level, wide, around);
  std::size_t i = 0;
  for_each_cell(box, [&](const Vec3i& cell) {
    for (int axes = 1; axes <= 3 && std::isnan(out[i]); ++axes) out[i] = mean_of_neighbours(wide, around, cell, axes);
    ++i;
  });
}

}  // namespace amrtex
