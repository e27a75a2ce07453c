#include "renderers/reference/reference_field.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "renderers/reference/exact_mean.hpp"

namespace amrtex {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

ReferenceField::ReferenceField(const AmrHierarchy& hierarchy, int field)
    : hierarchy_(hierarchy), units_(value_units(hierarchy.statistics(field))) {
  const int n = hierarchy.level_count();
  levels_.resize(static_cast<std::size_t>(n));
  std::atomic<bool> missing = hierarchy.has_holes();
  for (int l = n - 1; l >= 0; --l) {
    Level& level = levels_[static_cast<std::size_t>(l)];
    level.width = hierarchy.cell_width(l);
    const auto patches = hierarchy.patches(l);
    level.patches.resize(patches.size());
    tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t k) {
      const CellValues& values = patches[k].values[static_cast<std::size_t>(field)];
      PatchView& view = level.patches[k];
      view = {patches[k].box, &values, hierarchy.leaf_mask(l, static_cast<int>(k)).data(), {}, {}, {}};
      values.visit([&](const auto& all) {
        const std::size_t cells = values.size();
        if (!units_.plain()) view.numbers.reserve(cells);
        for (std::size_t i = 0; i < cells && !units_.plain(); ++i) view.numbers.push_back(units_.number(all[i]));
        for (std::size_t i = 0; i < cells; ++i)
          if (view.leaf[i] != 0 && !std::isfinite(all[i])) missing = true;
      });
      restrict_patch(l, view);
    });
    find_unstored(l);
  }
  has_missing_ = missing;
}

double ReferenceField::stored_value(const PatchView& patch, std::size_t offset) {
  const double v = patch.means.empty() ? patch.value(offset) : patch.means[offset];
  return std::isfinite(v) ? v : kNone;
}

const ReferenceField::PatchView* ReferenceField::find_patch(int level, const Vec3i& cell) const {
  const int k = hierarchy_.find_patch(level, cell);
  return k < 0 ? nullptr : &at(level).patches[static_cast<std::size_t>(k)];
}

/// Mean and share of a cell of which this or finer levels hold a part; nothing elsewhere.
ReferenceField::Mean ReferenceField::mean_of(int level, const Vec3i& cell) const {
  if (const PatchView* patch = find_patch(level, cell)) {
    const std::size_t i = patch->box.offset(cell);
    const double v = stored_value(*patch, i);
    return {v, std::isnan(v) ? 0 : patch->shares.empty() ? 1 : patch->shares[i]};
  }
  const auto& unstored = at(level).unstored;
  const auto it = unstored.find(cell);
  return it == unstored.end() ? Mean{} : it->second;
}

ReferenceField::Mean ReferenceField::mean_of_children(int level, const Vec3i& cell) const {
  const int r = hierarchy_.ratio_to_finer(level);
  ExactMean mean;
  for_each_cell(Box{cell, cell + Vec3i(1)}.refined(r), [&](const Vec3i& child) {
    const Mean m = mean_of(level + 1, child);
    if (m.share > 0) mean.add(m.value, m.share);
  });
  return {mean.value(), mean.weight() / (static_cast<double>(r) * r * r)};
}

/// Level values of the refined cells of a patch; what the file stores there is not used.
void ReferenceField::restrict_patch(int level, PatchView& patch) const {
  const auto n = static_cast<std::size_t>(patch.box.cells());
  if (std::find(patch.leaf, patch.leaf + n, std::uint8_t{0}) == patch.leaf + n) return;
  patch.means = patch.numbers.empty() ? patch.values->doubles() : patch.numbers;
  std::size_t i = 0;
  for_each_cell(patch.box, [&](const Vec3i& cell) {
    if (patch.leaf[i] == 0) {
      const Mean mean = mean_of_children(level, cell);
      patch.means[i] = mean.value;
      if (mean.share < 1) {
        if (patch.shares.empty()) patch.shares.assign(n, 1);
        patch.shares[i] = mean.share;
      }
    }
    ++i;
  });
}

void ReferenceField::find_unstored(int level) {
  if (level + 1 == hierarchy_.level_count()) return;
  const int r = hierarchy_.ratio_to_finer(level);
  auto& unstored = levels_[static_cast<std::size_t>(level)].unstored;
  const auto consider = [&](const Vec3i& cell) {
    if (find_patch(level, cell) == nullptr && !unstored.contains(cell)) unstored.emplace(cell, mean_of_children(level, cell));
  };
  for (const PatchView& fine : at(level + 1).patches) for_each_cell(fine.box.coarsened(r), consider);
  for (const auto& fine : at(level + 1).unstored) consider(floor_div(fine.first, r));
}

ReferenceLeaf ReferenceField::find_leaf(const Vec3i& finest_cell, const ReferenceLeaf& hint) const {
  const auto in_patch = [&](int level, int k, const Vec3i& cell) {
    const PatchView& patch = at(level).patches[static_cast<std::size_t>(k)];
    const double v = patch.value(patch.box.offset(cell));
    return ReferenceLeaf{level, k, cell, std::isfinite(v) ? v : kNone};
  };
  if (hint.level >= 0) {
    const Vec3i cell = finest_cell / width(hint.level);
    const PatchView& patch = at(hint.level).patches[static_cast<std::size_t>(hint.patch)];
    if (patch.box.contains(cell) && patch.leaf[patch.box.offset(cell)] != 0) return in_patch(hint.level, hint.patch, cell);
  }
  const auto leaf = hierarchy_.find_leaf(finest_cell);
  return leaf ? in_patch(leaf->level, leaf->patch, leaf->cell) : ReferenceLeaf{};
}

Box ReferenceField::empty_box(const Vec3i& finest_cell) const {
  for (int level = 0; level < hierarchy_.level_count(); ++level) {
    const Vec3i cell = finest_cell / width(level);
    const Box box{cell, cell + Vec3i(1)};
    if (find_patch(level, cell) == nullptr && !hierarchy_.refined_within(level, box)) return box.refined(width(level));
  }
  return {finest_cell, finest_cell + Vec3i(1)};
}

double ReferenceField::level_value(int level, const Vec3i& cell) const {
  if (!hierarchy_.domain(level).contains(cell)) return kNone;
  if (const PatchView* patch = find_patch(level, cell)) return stored_value(*patch, patch->box.offset(cell));
  const auto& unstored = at(level).unstored;
  if (const auto it = unstored.find(cell); it != unstored.end()) return it->second.value;
  for (int coarser = level - 1; coarser >= 0; --coarser) {
    const Vec3i parent = cell / (width(coarser) / width(level));
    if (const PatchView* patch = find_patch(coarser, parent)) return stored_value(*patch, patch->box.offset(parent));
  }
  return kNone;
}

/// Mean of v_L over the neighbours that differ in `distance` coordinates (1 faces, 2 edges, 3 corners).
double ReferenceField::neighbour_mean(int level, const Vec3i& cell, int distance) const {
  ExactMean mean;
  for_each_cell(Box{Vec3i(-1), Vec3i(2)}, [&](const Vec3i& d) {
    if (std::abs(d.x) + std::abs(d.y) + std::abs(d.z) != distance) return;
    const double v = level_value(level, cell + d);
    if (!std::isnan(v)) mean.add(v);
  });
  return mean.value();
}

double ReferenceField::filled_value(int level, const Vec3i& cell) const {
  double v = level_value(level, cell);
  for (int distance = 1; distance <= 3 && std::isnan(v); ++distance) v = neighbour_mean(level, cell, distance);
  return v;
}

ReferenceField::DualCell ReferenceField::dual_cell(int level, const Vec3i& lower) const {
  DualCell dual{{}, true};
  const PatchView* patch = find_patch(level, lower);
  if (patch != nullptr && !patch->box.contains(lower + Vec3i(1))) patch = nullptr;
  for (int k = 0; k < 8; ++k) {
    const Vec3i cell = lower + corner_offset(k);
    double& v = dual.values[static_cast<std::size_t>(k)];
    const PatchView* own = patch != nullptr ? patch : find_patch(level, cell);
    const std::size_t i = own != nullptr ? own->box.offset(cell) : 0;
    v = own != nullptr ? stored_value(*own, i) : kNone;
    dual.all_leaves = dual.all_leaves && own != nullptr && own->leaf[i] != 0 && !std::isnan(v);
    if (std::isnan(v)) v = filled_value(level, cell);
  }
  return dual;
}

ReferenceField::BasisCell ReferenceField::basis_cell(int level, const Vec3i& lower) const {
  BasisCell basis{{}, {}, false, false};
  for (int k = 0; k < 8; ++k) {
    const Vec3i cell = lower + corner_offset(k);
    const PatchView* patch = find_patch(level, cell);
    if (patch == nullptr || patch->leaf[patch->box.offset(cell)] == 0) continue;
    const double v = stored_value(*patch, patch->box.offset(cell));
    if (std::isnan(v)) continue;
    basis.values[static_cast<std::size_t>(k)] = v;
    basis.weights[static_cast<std::size_t>(k)] = 1;
    basis.any = true;
  }
  // a finer leaf reaches half of its own width past its box: less than to the outer faces of these cells
  basis.finer = hierarchy_.refined_within(level, intersection({lower, lower + Vec3i(2)}, hierarchy_.domain(level)));
  return basis;
}

}  // namespace amrtex
