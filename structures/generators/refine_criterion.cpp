#include "structures/generators/refine_criterion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "structures/generators/hash_random.hpp"

namespace amrtex {

namespace {

constexpr std::uint64_t kRefineStream = 1;

/// A sample and its six neighbours.
struct Stencil {
  double center;
  std::array<double, 2> x, y, z;
};

struct GradientScore {
  /// At least the score of all samples of cells whose stencils lie in `box`; `cell`: their edges. Both world.
  static double most(const AnalyticField& field, const WorldBox& box, const Vec3d& cell) {
    return field.steepest_in(box) * std::max({cell.x, cell.y, cell.z});
  }
  double operator()(const Stencil& s) const {
    return std::max({std::abs(s.x[1] - s.x[0]), std::abs(s.y[1] - s.y[0]), std::abs(s.z[1] - s.z[0])});
  }
};

struct MagnitudeScore {
  static double most(const AnalyticField&, const WorldBox&, const Vec3d&) { return std::numeric_limits<double>::infinity(); }
  double operator()(const Stencil& s) const { return std::abs(s.center); }
};

/// 1 where the field crosses the isovalue between two samples of the stencil, else 0.
struct SurfaceScore {
  double isovalue;
  static double most(const AnalyticField&, const WorldBox&, const Vec3d&) { return 1; }
  double operator()(const Stencil& s) const {
    const auto [low, high] = std::minmax({s.center, s.x[0], s.x[1], s.y[0], s.y[1], s.z[0], s.z[1]});
    return low <= isovalue && high > isovalue ? 1 : 0;
  }
};

/// Three planes of samples, two samples a cell along each axis and one sample round the box,
/// so that a neighbour-to-neighbour difference spans one cell and memory stays small for any block.
class SampleWindow {
 public:
  SampleWindow(const AnalyticField& field, const WorldBox& domain, const Box& cells, const Vec3i& level_cells)
      : field_(field), box_(cells), size_(2 * cells.size()) {
    for (int a = 0; a < 3; ++a)
      for (int i = -1; i <= size_[a]; ++i)
        positions_[static_cast<std::size_t>(a)].push_back(
            domain.lower[a] + domain.extent()[a] * ((2.0 * box_.lower[a] + i + 0.5) / (2.0 * level_cells[a])));
    for (auto& plane : planes_) plane.resize(positions_[0].size() * positions_[1].size());
  }

  /// Samples inside the box, along each axis.
  const Vec3i& size() const { return size_; }

  /// Evaluates plane z, from -1 to size().z, forgetting plane z - 3.
  void load(int z) {
    double* out = plane(z).data();
    const double pz = positions_[2][static_cast<std::size_t>(z + 1)];
    for (const double py : positions_[1])
      for (const double px : positions_[0]) *out++ = field_.value({px, py, pz});
  }

  /// Needs planes z - 1, z and z + 1.
  Stencil stencil(int x, int y, int z) {
    const std::size_t row = positions_[0].size();
    const std::size_t i = static_cast<std::size_t>(x + 1) + row * static_cast<std::size_t>(y + 1);
    const std::vector<double>& p = plane(z);
    return {p[i], {p[i - 1], p[i + 1]}, {p[i - row], p[i + row]}, {plane(z - 1)[i], plane(z + 1)[i]}};
  }

 private:
  std::vector<double>& plane(int z) { return planes_[static_cast<std::size_t>((z + 1) % 3)]; }

  const AnalyticField& field_;
  Box box_;
  Vec3i size_;
  std::array<std::vector<double>, 3> positions_;  ///< world, an axis
  std::array<std::vector<double>, 3> planes_;
};

/// Refines where the largest score of the samples in the unit passes the threshold.
template <class Score>
class SampledCriterion final : public RefineCriterion {
 public:
  SampledCriterion(const BlockGrid& grid, const WorldBox& domain, const AnalyticField& field, double threshold, Score score)
      : grid_(grid), domain_(domain), field_(field), threshold_(threshold), score_(score) {}

  void mark(int level, const Box& children, std::span<std::uint8_t> flags) const override {
    for_each_cell(children, [&](const Vec3i& child) { flags[children.offset(child)] = passes(level, child) ? 1 : 0; });
  }

 private:
  bool passes(int level, const Vec3i& child) const {
    const int unit = grid_.patch / grid_.ratio_between(level, level + 1);  // cells
    const Box cells = intersection({child * unit, (child + Vec3i(1)) * unit}, grid_.domain(level));
    if (surely_below(level, cells)) return false;
    SampleWindow window(field_, domain_, cells, grid_.cells(level));
    for (int z = -1; z <= window.size().z; ++z) {
      window.load(z);
      if (z >= 1 && plane_passes(window, z - 1)) return true;
    }
    return false;
  }

  bool plane_passes(SampleWindow& window, int z) const {
    for (int y = 0; y < window.size().y; ++y)
      for (int x = 0; x < window.size().x; ++x)
        if (score_(window.stencil(x, y, z)) > threshold_) return true;
    return false;
  }

  /// Where a bound tells it no sample is taken: most of a smooth field. By a margin, for what rounding does to bound and samples.
  bool surely_below(int level, const Box& cells) const {
    const Vec3d level_cells(grid_.cells(level));
    const auto at = [&](const Vec3i& corner) { return domain_.at(Vec3d(corner) / level_cells); };
    const Vec3i one(1);  // stencils reach a quarter of a cell beyond
    return score_.most(field_, {at(cells.lower - one), at(cells.upper + one)}, domain_.extent() / level_cells) <
           (1 - 1e-6) * threshold_;
  }

  const BlockGrid& grid_;
  WorldBox domain_;
  const AnalyticField& field_;
  double threshold_;
  Score score_;
};

class RandomCriterion final : public RefineCriterion {
 public:
  RandomCriterion(double fraction, std::uint64_t seed) : fraction_(fraction), seed_(seed) {}

  void mark(int level, const Box& children, std::span<std::uint8_t> flags) const override {
    for_each_cell(children, [&](const Vec3i& child) {
      flags[children.offset(child)] = cell_random(seed_, kRefineStream, level, child) < fraction_;
    });
  }

 private:
  double fraction_;
  std::uint64_t seed_;
};

/// Refines a cube of the same number of cells on every level, so that depth costs little.
class NestedCriterion final : public RefineCriterion {
 public:
  NestedCriterion(const BlockGrid& grid, const Vec3d& center, double reach) : grid_(grid), center_(center), reach_(reach) {}

  void mark(int level, const Box& children, std::span<std::uint8_t> flags) const override {
    const double unit = static_cast<double>(grid_.patch) / grid_.ratio_between(level, level + 1);  // cells
    const Vec3d center = center_ * Vec3d(grid_.cells(level));
    for_each_cell(children, [&](const Vec3i& child) {
      bool near = true;
      for (int a = 0; a < 3; ++a)
        near = near && unit * child[a] < center[a] + reach_ && unit * (child[a] + 1.0) > center[a] - reach_;
      flags[children.offset(child)] = near;
    });
  }

 private:
  const BlockGrid& grid_;
  Vec3d center_;  ///< fractions of the domain's edges
  double reach_;  ///< half the cube's edge, cells of the level that is refined
};

constexpr std::array<std::string_view, 5> kCriteria{"gradient", "value", "surface", "random", "nested"};

}  // namespace

std::unique_ptr<RefineCriterion> read_criterion(SpecReader& specification, const BlockGrid& grid, const WorldBox& domain,
                                                const AnalyticField& field, std::uint64_t seed) {
  const Json* given = specification.find("refine");
  if (given != nullptr && !given->is_string() && !given->is_object())
    specification.refuse("refine", fmt::format("one of {}, or an object with such a \"criterion\"", fmt::join(kCriteria, ", ")));
  const Json object = given == nullptr ? Json::object() : given->is_string() ? Json{{"criterion", *given}} : *given;
  SpecReader reader(object, specification.path_of("refine"));
  const std::string criterion = reader.choice("criterion", "gradient", kCriteria);
  std::unique_ptr<RefineCriterion> result;
  const auto sampled = [&](double threshold, auto score) {
    return std::make_unique<SampledCriterion<decltype(score)>>(grid, domain, field, threshold, score);
  };
  const auto threshold = [&](double fallback) {
    return reader.number("threshold", fallback, "a number from 0 up", is_not_negative);
  };
  if (criterion == "gradient") {
    result = sampled(threshold(0.14), GradientScore{});
  } else if (criterion == "value") {
    result = sampled(threshold(0.5), MagnitudeScore{});
  } else if (criterion == "surface") {
    result = sampled(0.5, SurfaceScore{reader.number("isovalue", 0.5)});
  } else if (criterion == "random") {
    result = std::make_unique<RandomCriterion>(reader.number("fraction", 0.25, "a number from 0 to 1", is_fraction), seed);
  } else {
    const Vec3d center = (reader.vector("center", domain.middle()) - domain.lower) / domain.extent();
    result = std::make_unique<NestedCriterion>(grid, center,
                                               reader.number("reach", 0.5 * grid.patch, "a number above 0", is_positive));
  }
  reader.finish();
  return result;
}

BlockList wanted_children(const BlockGrid& grid, int level, const BlockList& blocks, const RefineCriterion& criterion) {
  // One task a layer of units, since a mesh may have few, large blocks.
  const auto layers = static_cast<std::size_t>(grid.ratio_between(level, level + 1));
  std::vector<BlockList> found(blocks.size() * layers);
  tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t task) {
    Box children = grid.children(level, blocks[task / layers]);
    children.lower.z += static_cast<int>(task % layers);
    children.upper.z = std::min(children.upper.z, children.lower.z + 1);
    if (children.empty()) return;
    std::vector<std::uint8_t> flags(static_cast<std::size_t>(children.cells()), 0);
    criterion.mark(level, children, flags);
    for_each_cell(children, [&](const Vec3i& child) {
      if (flags[children.offset(child)] != 0) found[task].push_back(child);
    });
  });
  BlockList result;
  for (const BlockList& list : found) result.insert(result.end(), list.begin(), list.end());
  return result;
}

}  // namespace amrtex
