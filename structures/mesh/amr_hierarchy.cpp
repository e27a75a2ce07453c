#include "structures/mesh/amr_hierarchy.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <xxhash.h>

#include <atomic>
#include <cmath>
#include <utility>

#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr int kMaxLevels = 64;
/// Cells along an axis. Boxes are grown by borders, and blocks reach beyond the domain: they fit in 31 bits, too.
constexpr std::int64_t kMaxIndex = std::numeric_limits<std::int32_t>::max() - 4096;

std::string text(const Vec3i& v) { return fmt::format("({}, {}, {})", v.x, v.y, v.z); }
std::string text(const Box& b) { return fmt::format("[{}, {})", text(b.lower), text(b.upper)); }

/// Patches of one level by bins over their common bounding box: constant-time look-up. Where patches stand in clusters far apart,
/// so many bins would be empty that only those with a patch are kept: a look-up is a binary search then.
class PatchIndex {
 public:
  explicit PatchIndex(std::span<const Patch> patches) {
    if (patches.empty()) return;
    bounds_ = patches[0].box;
    double edges = 0;
    for (const Patch& p : patches) {
      bounds_ = {glm::min(bounds_.lower, p.box.lower), glm::max(bounds_.upper, p.box.upper)};
      edges += std::cbrt(static_cast<double>(p.box.cells()));
    }
    widen_to(static_cast<int>(std::clamp(edges / static_cast<double>(patches.size()), 1.0, static_cast<double>(kWidestBin))));
    while (too_many_entries(patches)) widen_to(2 * bin_);
    const int narrow = bin_;
    while (all_bins().cells() > kMostBins) widen_to(2 * bin_);
    fill(patches);
    if (bin_ == narrow || patches_a_look_up() <= kMostPatches) return;
    widen_to(narrow);
    keep_occupied(patches);
    fill(patches);
  }

  template <class F>
  void for_candidates(const Box& box, F&& f) const {
    const Box inside = intersection(box, bounds_);
    if (inside.empty()) return;
    const Box bins = bins_of(inside);
    if (!occupied_.empty() && bins.cells() > std::ssize(occupied_)) {
      for (std::size_t i = 0; i < occupied_.size(); ++i)
        if (bins.contains(bin_at(occupied_[i]))) for_list(i, f);
    } else {
      for_each_cell(bins, [&](const Vec3i& b) { for_list(list_of(b), f); });
    }
  }

  int find(std::span<const Patch> patches, const Vec3i& cell) const {
    if (!bounds_.contains(cell)) return -1;
    const std::size_t i = list_of((cell - bounds_.lower) / bin_);
    for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k)
      if (patches[static_cast<std::size_t>(patch_[k])].box.contains(cell)) return patch_[k];
    return -1;
  }

 private:
  void widen_to(int cells) {
    bin_ = cells;
    bins_ = ceil_div(bounds_.size(), bin_);
  }
  Box all_bins() const { return {Vec3i(0), bins_}; }
  Box bins_of(const Box& box) const { return box.shifted(-bounds_.lower).coarsened(bin_); }

  bool too_many_entries(std::span<const Patch> patches) const {
    if (all_bins().cells() == CheckedSize::kMost) return true;
    CheckedSize entries;
    for (const Patch& p : patches) entries += bins_of(p.box).cells();
    return entries.or_most() > 16 * std::ssize(patches) + 4096;
  }

  /// Which list is the bin's; the last one, which is empty, where only occupied bins are kept and this is none.
  std::size_t list_of(const Vec3i& bin) const {
    const std::uint64_t key = all_bins().offset(bin);
    if (occupied_.empty()) return key;
    const auto at = std::lower_bound(occupied_.begin(), occupied_.end(), key);
    return at != occupied_.end() && *at == key ? static_cast<std::size_t>(at - occupied_.begin()) : occupied_.size();
  }
  Vec3i bin_at(std::uint64_t key) const {
    const auto row = static_cast<std::uint64_t>(bins_.x);
    const auto rows = static_cast<std::uint64_t>(bins_.y);
    return {static_cast<int>(key % row), static_cast<int>(key / row % rows), static_cast<int>(key / row / rows)};
  }
  template <class F>
  void for_list(std::size_t i, F&& f) const {
    for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k) f(patch_[k]);
  }

  void keep_occupied(std::span<const Patch> patches) {
    for (const Patch& p : patches)
      for_each_cell(bins_of(p.box), [&](const Vec3i& b) { occupied_.push_back(all_bins().offset(b)); });
    std::sort(occupied_.begin(), occupied_.end());
    occupied_.erase(std::unique(occupied_.begin(), occupied_.end()), occupied_.end());
  }

  void fill(std::span<const Patch> patches) {
    const std::size_t lists = occupied_.empty() ? static_cast<std::size_t>(all_bins().cells()) : occupied_.size() + 1;
    first_.assign(lists + 1, 0);
    for (const Patch& p : patches) for_each_cell(bins_of(p.box), [&](const Vec3i& b) { ++first_[list_of(b) + 1]; });
    for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
    patch_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t k = 0; k < patches.size(); ++k)
      for_each_cell(bins_of(patches[k].box), [&](const Vec3i& b) { patch_[next[list_of(b)]++] = static_cast<int>(k); });
  }

  /// Patches that one look-up tests, seen from a patch.
  double patches_a_look_up() const {
    double sum = 0;
    for (std::size_t i = 0; i + 1 < first_.size(); ++i) {
      const double n = first_[i + 1] - first_[i];
      sum += n * n;
    }
    return sum / static_cast<double>(patch_.size());
  }

  static constexpr int kWidestBin = 1 << 30;  // eight of them hold any mesh of 31 bits
  static constexpr std::int64_t kMostBins = std::int64_t{1} << 22;
  static constexpr double kMostPatches = 64;  // of a look-up, before empty bins are given up

  Box bounds_;
  Vec3i bins_{0};
  int bin_ = 1;
  std::vector<std::uint64_t> occupied_;  ///< bins with a patch, ascending; nothing where every bin has its list
  std::vector<std::uint32_t> first_;     ///< of each list, and the end
  std::vector<int> patch_;
};

struct Mean {
  double sum = 0;
  double weight = 0;  ///< share of the cell that has a value, summed over what was added
};

/// A compensated sum: it holds to 1e-12 over millions of cells.
struct LongSum {
  double sum = 0;
  double lost = 0;

  void add(double v) {
    const double y = v - lost;
    const double t = sum + y;
    lost = (t - sum) - y;
    sum = t;
  }
};

void add(FieldStatistics& s, double v) {
  s.min = std::isnan(s.min) ? v : std::min(s.min, v);
  s.max = std::isnan(s.max) ? v : std::max(s.max, v);
  if (v != 0) s.least_magnitude = s.least_magnitude > 0 ? std::min(s.least_magnitude, std::abs(v)) : std::abs(v);
}

void merge(FieldStatistics& into, const FieldStatistics& s) {
  into.cells_without_value += s.cells_without_value;
  if (std::isnan(s.min)) return;
  add(into, s.min);
  add(into, s.max);
  if (s.least_magnitude > 0) into.least_magnitude = std::min(into.least_magnitude, s.least_magnitude);
}

}  // namespace

struct AmrHierarchy::Data {
  MeshDescription mesh;
  std::vector<Vec3i> cells;                                  // a level
  std::vector<int> width;                                    // a level, in finest cells
  std::vector<PatchIndex> index;                             // a level
  std::vector<std::vector<std::vector<std::uint8_t>>> leaf;  // level, patch, cell; of a patch of leaves alone: nothing
  std::vector<std::uint8_t> ones;                            // the mask of all patches of leaves alone
  // level, patch, field, cell: share of a refined cell that has a value; only where it is not 0 or 1 for some cell
  std::vector<std::vector<std::vector<std::vector<double>>>> weight;
  std::vector<std::int64_t> leaves;  // a level
  std::vector<FieldStatistics> statistics;
  bool holes = false;

  int levels() const { return static_cast<int>(mesh.levels.size()); }
  const std::vector<Patch>& patches(int level) const { return mesh.levels[static_cast<std::size_t>(level)]; }
  std::vector<Patch>& patches(int level) { return mesh.levels[static_cast<std::size_t>(level)]; }
  std::span<const std::uint8_t> mask(int level, std::size_t k) const {
    const auto& own = leaf[static_cast<std::size_t>(level)][k];
    if (!own.empty()) return own;
    return {ones.data(), static_cast<std::size_t>(patches(level)[k].box.cells())};
  }
  const PatchIndex& at(int level) const { return index[static_cast<std::size_t>(level)]; }
  int width_of(int level) const { return width[static_cast<std::size_t>(level)]; }
  /// Cells of `fine` a cell of `coarse`, along an axis.
  int ratio(int coarse, int fine) const { return width_of(coarse) / width_of(fine); }

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(fmt::format("data set {}: {}", clipped(mesh.name), what));
  }

  std::vector<int> patches_in(int level, const Box& box) const {
    std::vector<int> found;
    const auto& list = patches(level);
    at(level).for_candidates(box, [&](int k) {
      if (overlap(list[static_cast<std::size_t>(k)].box, box)) found.push_back(k);
    });
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  void check_levels();
  void check_patches(int level) const;
  bool cuts_stored_cell(int level, const Box& box) const;
  void mark_leaves(int level);
  void mark_all_leaves();
  std::string mark_patch(int level, std::size_t patch);
  bool covered(int level, const Box& box) const;
  void restrict_level(int level);
  void restrict_patch(int level, std::size_t patch, std::size_t field, const std::shared_ptr<const CellSet>& refined);
  Mean mean_of_leaves(int level, const Vec3i& cell, std::size_t field) const;
  void drop_non_finite();
  void count();
  FieldStatistics measure(std::size_t field) const;
  template <class F>
  void for_leaves(int level, std::size_t patch, std::size_t field, F&& f) const;
  Vec3i lower_corner(int finest) const;
};

void AmrHierarchy::Data::check_levels() {
  if (mesh.levels.empty()) refuse("no level");
  if (levels() > kMaxLevels) refuse(fmt::format("{} levels; at most {} are supported", levels(), kMaxLevels));
  if (mesh.ratios.size() + 1 != mesh.levels.size())
    refuse(fmt::format("{} levels need {} refinement ratios, {} given", levels(), levels() - 1, mesh.ratios.size()));
  if (glm::any(glm::lessThan(mesh.root_cells, Vec3i(1)))) refuse(fmt::format("a root domain of {} cells", text(mesh.root_cells)));
  for (int axis = 0; axis < 3; ++axis)
    if (!(mesh.domain_upper[axis] > mesh.domain_lower[axis]) || !std::isfinite(mesh.domain_upper[axis] - mesh.domain_lower[axis]))
      refuse(fmt::format("the domain's corners along axis {} are {} and {}; the upper one must be larger", "xyz"[axis],
                         mesh.domain_lower[axis], mesh.domain_upper[axis]));
  std::int64_t finest = std::max({mesh.root_cells.x, mesh.root_cells.y, mesh.root_cells.z});
  const auto require_index = [&](std::size_t level) {
    if (finest > kMaxIndex)
      refuse(fmt::format("level {} has {} cells along an axis; at most {} (31 bits of index) are supported", level, finest,
                         kMaxIndex));
  };
  require_index(0);
  for (std::size_t l = 0; l < mesh.ratios.size(); ++l) {
    if (mesh.ratios[l] < 2)
      refuse(fmt::format("the refinement ratio from level {} to {} is {}; at least 2 is needed", l, l + 1, mesh.ratios[l]));
    finest *= mesh.ratios[l];
    require_index(l + 1);
  }
  for (const std::string& field : mesh.fields)
    if (!is_utf8(field)) refuse(fmt::format("the name of the field {} is not UTF-8", quote(field)));
  cells.assign(mesh.levels.size(), mesh.root_cells);
  width.assign(mesh.levels.size(), 1);
  for (std::size_t l = 1; l < cells.size(); ++l) cells[l] = cells[l - 1] * mesh.ratios[l - 1];
  for (std::size_t l = cells.size() - 1; l > 0; --l) width[l - 1] = width[l] * mesh.ratios[l - 1];
}

/// Does the box hold a part only of a cell that the next coarser level stores?
bool AmrHierarchy::Data::cuts_stored_cell(int level, const Box& box) const {
  const int r = mesh.ratios[static_cast<std::size_t>(level - 1)];
  const Box touched = box.coarsened(r);
  if (touched.refined(r) == box) return false;
  const Box whole{ceil_div(box.lower, r), floor_div(box.upper, r)};
  for (int k : patches_in(level - 1, touched))
    if (!whole.contains(intersection(patches(level - 1)[static_cast<std::size_t>(k)].box, touched))) return true;
  return false;
}

void AmrHierarchy::Data::check_patches(int level) const {
  const auto& list = patches(level);
  const Box domain{Vec3i(0), cells[static_cast<std::size_t>(level)]};
  for (std::size_t k = 0; k < list.size(); ++k) {
    const Box& box = list[k].box;
    if (box.empty()) refuse(fmt::format("level {}, patch {}: the box {} is empty", level, k, text(box)));
    if (!domain.contains(box))
      refuse(fmt::format("level {}, patch {}: the box {} lies outside its level, {}", level, k, text(box), text(domain)));
    if (list[k].values.size() != mesh.fields.size())
      refuse(fmt::format("level {}, patch {}: {} arrays for {} fields", level, k, list[k].values.size(), mesh.fields.size()));
    for (const auto& values : list[k].values)
      if (static_cast<std::int64_t>(values.size()) != box.cells())
        refuse(fmt::format("level {}, patch {}: {} values for {} cells", level, k, values.size(), box.cells()));
    if (level > 0 && cuts_stored_cell(level, box))
      refuse(fmt::format("level {}, patch {}: the box {} does not align with the cells of level {} (refinement ratio {})", level,
                         k, text(box), level - 1, mesh.ratios[static_cast<std::size_t>(level - 1)]));
  }
  for (std::size_t k = 0; k < list.size(); ++k)
    for (int other : patches_in(level, list[k].box))
      if (static_cast<std::size_t>(other) > k)
        refuse(fmt::format("level {}: patches {} {} and {} {} overlap", level, k, text(list[k].box), other,
                           text(list[static_cast<std::size_t>(other)].box)));
}

/// Is every part of the box covered by patches of `level` and finer ones? Boxes are cut by patches and never walked cell by
/// cell: a ratio may be so large that one cell has more children than anyone can visit.
bool AmrHierarchy::Data::covered(int level, const Box& box) const {
  std::vector<std::pair<int, Box>> open{{level, box}};
  while (!open.empty()) {
    auto [at_level, rest] = open.back();
    open.pop_back();
    const std::vector<int> found = patches_in(at_level, rest);
    if (found.empty()) {
      if (at_level + 1 == levels()) return false;
      open.emplace_back(at_level + 1, rest.refined(ratio(at_level, at_level + 1)));
      continue;
    }
    const Box inside = intersection(patches(at_level)[static_cast<std::size_t>(found.front())].box, rest);
    for (int axis = 0; axis < 3; ++axis) {  // what lies before and behind the patch, along one axis after the other
      Box before = rest;
      Box behind = rest;
      before.upper[axis] = rest.lower[axis] = inside.lower[axis];
      behind.lower[axis] = rest.upper[axis] = inside.upper[axis];
      if (!before.empty()) open.emplace_back(at_level, before);
      if (!behind.empty()) open.emplace_back(at_level, behind);
    }
  }
  return true;
}

/// Fills the patch's mask of leaves. Returns what is wrong with its first cell that is refined only in part, else "".
std::string AmrHierarchy::Data::mark_patch(int level, std::size_t k) {
  const Box& box = patches(level)[k].box;
  auto& mask = leaf[static_cast<std::size_t>(level)][k];
  for (int finer = level + 1; finer < levels(); ++finer) {
    const int r = ratio(level, finer);
    for (int other : patches_in(finer, box.refined(r))) {
      const Box& fine = patches(finer)[static_cast<std::size_t>(other)].box;
      const Box over = fine.coarsened(r);
      const bool aligned = over.refined(r) == fine;
      if (mask.empty()) mask.assign(static_cast<std::size_t>(box.cells()), 1);
      const auto cut = first_cell(intersection(over, box), [&](const Vec3i& cell) {
        std::uint8_t& is_leaf = mask[box.offset(cell)];
        const Box all{cell, cell + Vec3i(1)};
        if (is_leaf != 0 && !aligned && !fine.contains(all.refined(r)) &&
            !covered(level + 1, all.refined(ratio(level, level + 1))))
          return true;
        is_leaf = 0;
        return false;
      });
      if (cut)
        return fmt::format("level {}, patch {}: cell {} is refined only in part, by level {}, patch {}", level, k, text(*cut),
                           finer, other);
    }
  }
  return "";
}

void AmrHierarchy::Data::mark_leaves(int level) {
  auto& masks = leaf[static_cast<std::size_t>(level)];
  masks.resize(patches(level).size());
  std::vector<std::string> problems(masks.size());
  std::atomic<std::size_t> first = masks.size();  // patch with a problem: the same one at each run
  tbb::parallel_for(std::size_t{0}, masks.size(), [&](std::size_t k) {
    if (k > first) return;
    problems[k] = mark_patch(level, k);
    if (problems[k].empty()) return;
    for (std::size_t known = first; k < known && !first.compare_exchange_weak(known, k);) {
    }
  });
  if (first < masks.size()) refuse(problems[first]);
}

void AmrHierarchy::Data::mark_all_leaves() {
  leaf.resize(mesh.levels.size());
  for (int l = 0; l < levels(); ++l) mark_leaves(l);
  std::int64_t most = 0;
  for (int l = 0; l < levels(); ++l)
    for (std::size_t k = 0; k < patches(l).size(); ++k)
      if (leaf[static_cast<std::size_t>(l)][k].empty()) most = std::max(most, patches(l)[k].box.cells());
  ones.assign(static_cast<std::size_t>(most), 1);
}

void AmrHierarchy::Data::drop_non_finite() {
  for (auto& level : mesh.levels)
    tbb::parallel_for(std::size_t{0}, level.size(), [&](std::size_t k) {
      for (CellValues& values : level[k].values)
        values.visit_stored([](auto& stored) {
          for (auto& v : stored)
            if (!std::isfinite(v)) v = std::numeric_limits<std::decay_t<decltype(v)>>::quiet_NaN();
        });
    });
}

Mean AmrHierarchy::Data::mean_of_leaves(int level, const Vec3i& cell, std::size_t field) const {
  Mean mean;
  for (int finer = level + 1; finer < levels(); ++finer) {
    const int r = ratio(level, finer);
    const double share = 1.0 / (static_cast<double>(r) * r * r);
    const Box inside = Box{cell, cell + Vec3i(1)}.refined(r);
    for (int k : patches_in(finer, inside)) {
      const Patch& patch = patches(finer)[static_cast<std::size_t>(k)];
      const auto is_leaf = mask(finer, static_cast<std::size_t>(k));
      patch.values[field].visit([&](const auto& values) {
        for_each_cell(intersection(patch.box, inside), [&](const Vec3i& c) {
          const std::size_t i = patch.box.offset(c);
          const double v = values[i];
          if (is_leaf[i] == 0 || std::isnan(v)) return;
          mean.sum += v * share;
          mean.weight += share;
        });
      });
    }
  }
  return mean;
}

void AmrHierarchy::Data::restrict_patch(int level, std::size_t k, std::size_t field,
                                        const std::shared_ptr<const CellSet>& refined) {
  Patch& patch = patches(level)[k];
  const auto is_leaf = mask(level, k);
  CellValues& values = patch.values[field];
  values.hold_means(refined);
  std::vector<double> shares;
  const int r = ratio(level, level + 1);
  const double share = 1.0 / (static_cast<double>(r) * r * r);
  const auto put = [&](std::size_t i, const Mean& mean) {
    values.set_mean(i, mean.weight > 0 ? mean.sum / mean.weight : std::numeric_limits<double>::quiet_NaN());
    if (mean.weight > 0 && mean.weight < 1 - 1e-9) {
      if (shares.empty()) shares.assign(values.size(), 1.0);
      shares[i] = mean.weight;
    }
  };
  std::vector<std::uint8_t> done;
  for (int other : patches_in(level + 1, patch.box.refined(r))) {
    const Patch& fine = patches(level + 1)[static_cast<std::size_t>(other)];
    const auto& fine_shares = weight[static_cast<std::size_t>(level) + 1][static_cast<std::size_t>(other)][field];
    if (done.empty()) done.assign(values.size(), 0);
    fine.values[field].visit([&](const auto& fine_values) {
      for_each_cell(intersection(fine.box.coarsened(r), patch.box), [&](const Vec3i& cell) {
        Mean mean;
        for_each_cell(Box{cell, cell + Vec3i(1)}.refined(r), [&](const Vec3i& child) {
          const std::size_t j = fine.box.offset(child);
          const double v = fine_values[j];
          if (std::isnan(v)) return;
          const double w = fine_shares.empty() ? share : share * fine_shares[j];
          mean.sum += v * w;
          mean.weight += w;
        });
        done[patch.box.offset(cell)] = 1;
        put(patch.box.offset(cell), mean);
      });
    });
  }
  // what is refined by levels further down only
  for_each_cell(patch.box, [&](const Vec3i& cell) {
    const std::size_t i = patch.box.offset(cell);
    if (is_leaf[i] == 0 && (done.empty() || done[i] == 0)) put(i, mean_of_leaves(level, cell, field));
  });
  weight[static_cast<std::size_t>(level)][k][field] = std::move(shares);
}

void AmrHierarchy::Data::restrict_level(int level) {
  weight[static_cast<std::size_t>(level)].assign(patches(level).size(), std::vector<std::vector<double>>(mesh.fields.size()));
  tbb::parallel_for(std::size_t{0}, patches(level).size(), [&](std::size_t k) {
    const auto& own = leaf[static_cast<std::size_t>(level)][k];
    if (own.empty()) return;
    const auto refined = std::make_shared<const CellSet>(own);
    for (std::size_t field = 0; field < mesh.fields.size(); ++field) restrict_patch(level, k, field, refined);
  });
}

void AmrHierarchy::Data::count() {
  leaves.assign(mesh.levels.size(), 0);
  double covered = 0;  // of the domain, in finest cells
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    for (std::size_t k = 0; k < leaf[l].size(); ++k) {
      const auto& own = leaf[l][k];
      leaves[l] += own.empty() ? mesh.levels[l][k].box.cells() : std::count(own.begin(), own.end(), std::uint8_t{1});
    }
    covered += static_cast<double>(leaves[l]) * std::pow(static_cast<double>(width[l]), 3);
  }
  const Vec3d finest(cells.back());
  holes = covered < finest.x * finest.y * finest.z * (1 - 1e-14);
}

/// Calls f(offset in the patch, value) for each leaf of a patch.
template <class F>
void AmrHierarchy::Data::for_leaves(int level, std::size_t k, std::size_t field, F&& f) const {
  const CellValues& values = patches(level)[k].values[field];
  const auto is_leaf = mask(level, k);
  values.visit([&](const auto& view) {
    for (std::size_t i = 0; i < is_leaf.size(); ++i)
      if (is_leaf[i] != 0) f(i, view[i]);
  });
}

FieldStatistics AmrHierarchy::Data::measure(std::size_t field) const {
  FieldStatistics all;
  LongSum integral;
  for (int l = 0; l < levels(); ++l) {
    const Vec3d h = (mesh.domain_upper - mesh.domain_lower) / Vec3d(cells[static_cast<std::size_t>(l)]);
    std::vector<FieldStatistics> of_patch(patches(l).size());
    std::vector<LongSum> sums(patches(l).size());
    tbb::parallel_for(std::size_t{0}, patches(l).size(), [&](std::size_t k) {
      FieldStatistics s;
      LongSum sum;
      for_leaves(l, k, field, [&](std::size_t, double v) {
        if (std::isnan(v)) {
          ++s.cells_without_value;
          return;
        }
        add(s, v);
        sum.add(v);
      });
      of_patch[k] = s;
      sums[k] = sum;
    });
    LongSum sum;
    for (std::size_t k = 0; k < sums.size(); ++k) {
      merge(all, of_patch[k]);
      sum.add(sums[k].sum);
      sum.add(-sums[k].lost);
    }
    integral.add(sum.sum * (h.x * h.y * h.z));
  }
  all.volume_integral = integral.sum;
  return all;
}

AmrHierarchy::AmrHierarchy(MeshDescription description) : data_(std::make_unique<Data>()) {
  Data& d = *data_;
  d.mesh = std::move(description);
  d.mesh.units.resize(d.mesh.fields.size());
  if (d.mesh.fields_there.empty()) d.mesh.fields_there = d.mesh.fields;
  d.check_levels();
  for (const auto& level : d.mesh.levels) d.index.emplace_back(level);
  for (int l = 0; l < d.levels(); ++l) d.check_patches(l);
  std::int64_t stored = 0;
  for (int l = 0; l < d.levels(); ++l) stored += stored_cells(l);
  if (stored == 0) d.refuse("no cell");
  d.weight.resize(d.mesh.levels.size());
  d.mark_all_leaves();
  d.drop_non_finite();
  for (int l = d.levels() - 1; l >= 0; --l) d.restrict_level(l);
  d.count();
  for (std::size_t f = 0; f < d.mesh.fields.size(); ++f) d.statistics.push_back(d.measure(f));
}

AmrHierarchy::~AmrHierarchy() = default;
AmrHierarchy::AmrHierarchy(AmrHierarchy&&) noexcept = default;
AmrHierarchy& AmrHierarchy::operator=(AmrHierarchy&&) noexcept = default;

const std::string& AmrHierarchy::name() const { return data_->mesh.name; }
int AmrHierarchy::level_count() const { return data_->levels(); }
int AmrHierarchy::ratio_to_finer(int level) const {
  return level == finest_level() ? 1 : data_->mesh.ratios[static_cast<std::size_t>(level)];
}
int AmrHierarchy::cell_width(int level) const { return data_->width_of(level); }
Vec3i AmrHierarchy::cells(int level) const { return data_->cells[static_cast<std::size_t>(level)]; }
Vec3d AmrHierarchy::domain_lower() const { return data_->mesh.domain_lower; }
Vec3d AmrHierarchy::domain_upper() const { return data_->mesh.domain_upper; }
Vec3d AmrHierarchy::spacing(int level) const { return (domain_upper() - domain_lower()) / Vec3d(cells(level)); }
std::array<bool, 3> AmrHierarchy::periodic() const { return data_->mesh.periodic; }
int AmrHierarchy::dimensions() const { return data_->mesh.dimensions; }
const std::vector<std::string>& AmrHierarchy::fields() const { return data_->mesh.fields; }
const std::vector<std::string>& AmrHierarchy::fields_there() const { return data_->mesh.fields_there; }
const std::string& AmrHierarchy::unit(int field) const { return data_->mesh.units[static_cast<std::size_t>(field)]; }

int AmrHierarchy::field_index(const std::string& field) const {
  const auto& all = fields();
  const auto it = std::find(all.begin(), all.end(), field);
  if (it == all.end())
    throw UsageError(fmt::format("data set {}: no field {}; its fields are {}", clipped(name()), quote(field), listed(all)));
  return static_cast<int>(it - all.begin());
}

std::span<const Patch> AmrHierarchy::patches(int level) const { return data_->patches(level); }
int AmrHierarchy::find_patch(int level, const Vec3i& cell) const { return data_->at(level).find(data_->patches(level), cell); }
std::vector<int> AmrHierarchy::patches_in(int level, const Box& box) const { return data_->patches_in(level, box); }
std::span<const std::uint8_t> AmrHierarchy::leaf_mask(int level, int patch) const {
  return data_->mask(level, static_cast<std::size_t>(patch));
}

bool AmrHierarchy::refined_within(int level, const Box& box) const {
  for (int finer = level + 1; finer < level_count(); ++finer) {
    const Box fine = box.refined(data_->ratio(level, finer));
    const auto& list = data_->patches(finer);
    bool found = false;
    data_->at(finer).for_candidates(fine, [&](int k) { found = found || overlap(list[static_cast<std::size_t>(k)].box, fine); });
    if (found) return true;
  }
  return false;
}

std::optional<LeafCell> AmrHierarchy::find_leaf(const Vec3i& finest_cell) const {
  if (!domain(finest_level()).contains(finest_cell)) return std::nullopt;
  for (int level = finest_level(); level >= 0; --level) {
    const Vec3i cell = finest_cell / cell_width(level);
    const int patch = find_patch(level, cell);
    if (patch >= 0) return LeafCell{level, patch, cell};
  }
  return std::nullopt;
}

double AmrHierarchy::value(const LeafCell& leaf, int field) const {
  const Patch& patch = data_->patches(leaf.level)[static_cast<std::size_t>(leaf.patch)];
  return patch.values[static_cast<std::size_t>(field)][patch.box.offset(leaf.cell)];
}

double AmrHierarchy::level_value(int level, const Vec3i& cell, int field) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (!domain(level).contains(cell)) return kNone;
  const int own = find_patch(level, cell);
  if (own >= 0) return value({level, own, cell}, field);
  if (refined_within(level, Box{cell, cell + Vec3i(1)})) {
    const Mean mean = data_->mean_of_leaves(level, cell, static_cast<std::size_t>(field));
    return mean.weight > 0 ? mean.sum / mean.weight : kNone;
  }
  for (int coarser = level - 1; coarser >= 0; --coarser) {
    const Vec3i parent = cell / data_->ratio(coarser, level);
    const int patch = find_patch(coarser, parent);
    if (patch >= 0) return value({coarser, patch, parent}, field);
  }
  return kNone;
}

std::int64_t AmrHierarchy::leaf_cells(int level) const { return data_->leaves[static_cast<std::size_t>(level)]; }
std::int64_t AmrHierarchy::leaf_cells() const {
  std::int64_t n = 0;
  for (int l = 0; l < level_count(); ++l) n += leaf_cells(l);
  return n;
}
std::int64_t AmrHierarchy::stored_cells(int level) const {
  std::int64_t n = 0;
  for (const Patch& p : data_->patches(level)) n += p.box.cells();
  return n;
}
std::int64_t AmrHierarchy::stored_cells() const {
  std::int64_t n = 0;
  for (int l = 0; l < level_count(); ++l) n += stored_cells(l);
  return n;
}
bool AmrHierarchy::has_holes() const { return data_->holes; }
const FieldStatistics& AmrHierarchy::statistics(int field) const { return data_->statistics[static_cast<std::size_t>(field)]; }

/// The lowest corner of all leaves, in cells of the level `finest`.
Vec3i AmrHierarchy::Data::lower_corner(int finest) const {
  Vec3i corner(std::numeric_limits<int>::max());
  for (int l = 0; l <= finest; ++l)
    for (std::size_t k = 0; k < patches(l).size(); ++k) {
      const Box& box = patches(l)[k].box;
      const Vec3i lowest = box.lower * ratio(l, finest);
      if (glm::all(glm::lessThanEqual(corner, lowest))) continue;  // no cell of it lies lower along any axis
      const auto is_leaf = mask(l, k);
      std::size_t i = 0;
      for_each_cell(box, [&](const Vec3i& c) {
        if (is_leaf[i++] != 0) corner = glm::min(corner, c * ratio(l, finest));
      });
    }
  return corner;
}

std::string AmrHierarchy::content_hash(int field) const {
  struct Key {
    std::int32_t x, y, z, width;
    float value;
  };
  static_assert(sizeof(Key) == 20);
  const Data& d = *data_;
  int finest = finest_level();
  while (finest > 0 && leaf_cells(finest) == 0) --finest;
  const Vec3i corner = d.lower_corner(finest);
  std::atomic<std::uint64_t> low = 0;
  std::atomic<std::uint64_t> high = 0;
  for (int l = 0; l <= finest; ++l)
    tbb::parallel_for(std::size_t{0}, d.patches(l).size(), [&](std::size_t k) {
      const Box& box = d.patches(l)[k].box;
      const Vec3i size = box.size();
      const int width = d.ratio(l, finest);
      std::uint64_t own_low = 0;
      std::uint64_t own_high = 0;
      d.for_leaves(l, k, static_cast<std::size_t>(field), [&](std::size_t i, double v) {
        const auto n = static_cast<std::int64_t>(i);
        const Vec3i cell(n % size.x, n / size.x % size.y, n / size.x / size.y);
        const Vec3i at = (box.lower + cell) * width - corner;
        const float rounded = std::isnan(v) ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(v) + 0.0F;  // -0 is 0
        const Key key{at.x, at.y, at.z, width, rounded};
        const XXH128_hash_t h = XXH3_128bits(&key, sizeof key);
        own_low += h.low64;  // a sum, since the order of cells must not matter
        own_high += h.high64;
      });
      low += own_low;
      high += own_high;
    });
  return fmt::format("{:016x}{:016x}", high.load(), low.load());
}

}  // namespace amrtex
