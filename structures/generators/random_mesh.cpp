#include "structures/generators/random_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "structures/generators/hash_random.hpp"

namespace amrtex {

namespace {

/// A sequence of random numbers; the distributions of <random> differ between standard libraries.
class RandomSequence {
 public:
  explicit RandomSequence(std::uint64_t seed) : state_(mix_bits(seed)) {}

  double number() { return unit_interval(mix_bits(state_++)); }
  double number(double low, double high) { return low + (high - low) * number(); }
  /// In [lowest, highest].
  int integer(int lowest, int highest) {
    return std::min(highest, lowest + static_cast<int>(number() * (static_cast<double>(highest) - lowest + 1)));
  }
  bool chance(double probability) { return number() < probability; }

 private:
  std::uint64_t state_;
};

class MeshMaker {
 public:
  MeshMaker(std::uint64_t seed, const RandomMeshOptions& options) : options_(options), random_(seed) {
    mesh_.name = fmt::format("random_{}", seed);
  }

  MeshDescription make() {
    choose_domain();
    choose_ratios();
    mesh_.levels.resize(mesh_.ratios.size() + 1);
    leaf_level_.assign(static_cast<std::size_t>(finest_domain().cells()), kNothing);
    place_root();
    for (int level = 1; level < level_count(); ++level)
      if (!(options_.empty_levels && random_.chance(0.15))) place_level(level);
    if (std::all_of(mesh_.levels.begin(), mesh_.levels.end(), [](const auto& patches) { return patches.empty(); }))
      store(0, {Vec3i(0), mesh_.root_cells});
    fill();
    return std::move(mesh_);
  }

 private:
  static constexpr std::int8_t kNothing = -1;

  int level_count() const { return static_cast<int>(mesh_.ratios.size()) + 1; }
  /// Cells of `finer` a cell of `coarser`, along an axis.
  int ratio_between(int coarser, int finer) const {
    int product = 1;
    for (int l = coarser; l < finer; ++l) product *= mesh_.ratios[static_cast<std::size_t>(l)];
    return product;
  }
  Vec3i cells(int level) const { return mesh_.root_cells * ratio_between(0, level); }
  Box finest_domain() const { return {Vec3i(0), cells(level_count() - 1)}; }

  void choose_domain() {
    const bool far = random_.chance(0.2);
    for (int a = 0; a < 3; ++a) {
      mesh_.root_cells[a] = random_.integer(1, options_.max_root_cells);
      mesh_.domain_lower[a] = far ? random_.number(-1e6, 1e6) : random_.number(-1, 1);
      mesh_.domain_upper[a] = mesh_.domain_lower[a] + mesh_.root_cells[a] * random_.number(0.25, 2);
    }
    for (int f = 0; f < options_.fields; ++f) mesh_.fields.push_back(fmt::format("f{}", f));
  }

  void choose_ratios() {
    std::int64_t finest = Box{Vec3i(0), mesh_.root_cells}.cells();
    const int levels = random_.integer(1, options_.max_levels);
    for (int l = 1; l < levels; ++l) {
      const int ratio = random_.chance(0.6) ? 2 : (options_.power_of_two_ratios || random_.chance(0.5) ? 4 : 3);
      finest *= std::int64_t{ratio} * ratio * ratio;
      if (finest > options_.max_finest_cells) return;
      mesh_.ratios.push_back(ratio);
    }
  }

  /// Level 0: the domain cut into boxes at random, some of them left out.
  void place_root() {
    if (options_.holes && options_.empty_levels && level_count() > 1 && random_.chance(0.05)) return;
    const double left_out = options_.holes && random_.chance(0.4) ? random_.number(0.05, 0.5) : 0;
    cut({Vec3i(0), mesh_.root_cells}, left_out);
  }

  void cut(const Box& box, double left_out) {
    const int axis = random_.integer(0, 2);
    if (box.size()[axis] > 1 && random_.chance(0.75)) {
      Box lower = box;
      Box upper = box;
      lower.upper[axis] = upper.lower[axis] = random_.integer(box.lower[axis] + 1, box.upper[axis] - 1);
      cut(lower, left_out);
      cut(upper, left_out);
    } else if (!random_.chance(left_out)) {
      store(0, box);
    }
  }

  void place_level(int level) {
    const int attempts = random_.integer(1, 30);
    for (int i = 0; i < attempts; ++i) {
      const int base = random_.chance(0.6) ? level - 1 : random_.integer(0, level - 1);
      const Box box = random_box(cells(base));
      if (may_store(level, base, box)) store(level, box.refined(ratio_between(base, level)));
    }
  }

  Box random_box(const Vec3i& domain) {
    Box box;
    const int longest = random_.chance(0.3) ? 1 : random_.integer(1, 12);
    for (int a = 0; a < 3; ++a) {
      box.lower[a] = random_.integer(0, domain[a] - 1);
      box.upper[a] = std::min(domain[a], box.lower[a] + random_.integer(1, longest));
    }
    return box;
  }

  /// May a patch of `level` cover the box of cells of level `base`? A cell that is
  /// stored must be refined as a whole. Those from `base` on are, because the box
  /// consists of such cells; coarser ones only if they were before, so that their
  /// part in the box has finer leaves already or the place is empty.
  bool may_store(int level, int base, const Box& box) const {
    const Box at_level = box.refined(ratio_between(base, level));
    for (const Patch& patch : mesh_.levels[static_cast<std::size_t>(level)])
      if (overlap(patch.box, at_level)) return false;
    bool allowed = true;
    for_each_cell(box.refined(ratio_between(base, level_count() - 1)), [&](const Vec3i& cell) {
      const int leaf = leaf_level_[finest_domain().offset(cell)];
      const bool fills_hole = leaf == kNothing;
      if (fills_hole ? !options_.holes : leaf < base) allowed = false;
    });
    return allowed;
  }

  void store(int level, const Box& box) {
    mesh_.levels[static_cast<std::size_t>(level)].push_back({box, {}});
    for_each_cell(box.refined(ratio_between(level, level_count() - 1)),
                  [&](const Vec3i& cell) { leaf_level_[finest_domain().offset(cell)] = static_cast<std::int8_t>(level); });
  }

  void fill() {
    smooth_ = random_.chance(0.5);
    missing_ = options_.missing_values && random_.chance(0.4) ? random_.number(0.01, 0.3) : 0;
    for (int level = 0; level < level_count(); ++level)
      for (Patch& patch : mesh_.levels[static_cast<std::size_t>(level)])
        for (int field = 0; field < options_.fields; ++field) patch.values.push_back(values(level, patch.box, field));
  }

  std::vector<double> values(int level, const Box& box, int field) {
    std::vector<double> result;
    result.reserve(static_cast<std::size_t>(box.cells()));
    for_each_cell(box, [&](const Vec3i& cell) { result.push_back(value(level, cell, field)); });
    return result;
  }

  double value(int level, const Vec3i& cell, int field) {
    if (random_.chance(missing_)) return missing_value();
    if (!smooth_) return random_.number();
    const Vec3d p = (Vec3d(cell) + 0.5) / Vec3d(cells(level));  // fractions of the domain
    return 0.5 + 0.2 * (p.x * p.y + p.z) * std::sin(3.0 * p.x + field) + 0.1 * std::cos(5.0 * p.y - 2.0 * p.z);
  }

  double missing_value() {
    const double infinity = std::numeric_limits<double>::infinity();
    if (random_.chance(0.6)) return std::numeric_limits<double>::quiet_NaN();
    return random_.chance(0.5) ? infinity : -infinity;
  }

  RandomMeshOptions options_;
  RandomSequence random_;
  MeshDescription mesh_;
  std::vector<std::int8_t> leaf_level_;  ///< of each cell of the finest level
  bool smooth_ = false;
  double missing_ = 0;  ///< probability
};

}  // namespace

MeshDescription random_mesh(std::uint64_t seed, const RandomMeshOptions& options) { return MeshMaker(seed, options).make(); }

}  // namespace amrtex
