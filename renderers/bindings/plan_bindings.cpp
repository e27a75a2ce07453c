#include "renderers/bindings/plan_bindings.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "renderers/bindings/block_map.hpp"
#include "renderers/bindings/transfer_bindings.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Bounds on a piecewise linear curve over a range of its axis, the largest of its components each.
struct CurveBounds {
  double most = 0;
  double slope = 0;
  double kinks = 0;  ///< sum of what the slope changes by at its points
};

/// A curve over the transfer function's axis.
class Curve {
 public:
  void add(double x, const Vec3d& value) {
    x_.push_back(x);
    value_.push_back(value);
  }

  CurveBounds over(double from, double to) const {
    CurveBounds bounds{std::max(largest(at(from)), largest(at(to))), 0, 0};
    Vec3d before(0);  // the slope
    for (std::size_t i = 0; i < x_.size() && x_[i] <= to; ++i) {
      const Vec3d after = i + 1 < x_.size() ? (value_[i + 1] - value_[i]) / (x_[i + 1] - x_[i]) : Vec3d(0);
      if (x_[i] >= from) {
        bounds.most = std::max(bounds.most, largest(value_[i]));
        bounds.kinks += largest(after - before);
        bounds.slope = std::max(bounds.slope, largest(before));
      }
      if (i + 1 == x_.size() || x_[i + 1] > from) bounds.slope = std::max(bounds.slope, largest(after));
      before = after;
    }
    return bounds;
  }

 private:
  static double largest(const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }
  Vec3d at(double x) const {
    if (x <= x_.front()) return value_.front();
    const auto above = std::upper_bound(x_.begin(), x_.end(), x);
    if (above == x_.end()) return value_.back();
    const auto i = static_cast<std::size_t>(above - x_.begin());
    return glm::mix(value_[i - 1], value_[i], (x - x_[i - 1]) / (x_[i] - x_[i - 1]));
  }
  std::vector<double> x_;
  std::vector<Vec3d> value_;
};

/// Both curves of a transfer function.
class Light {
 public:
  Light(const TransferFunction& tf, double extinction_unit) : tf_(tf) {
    for (const auto& p : tf.extinction) extinction_.add(tf.axis(p.value), Vec3d(p.extinction * extinction_unit));
    for (const auto& p : tf.color) color_.add(tf.axis(p.value), p.rgb);
    first_ = std::min(tf.extinction.front().value, tf.color.front().value);
  }

  double error_density(const BlockVariation& block, double edge) const {
    if (!(block.low <= block.high)) return 0;
    // below the first point of an axis over logarithms nothing changes
    const double low = tf_.logarithmic ? std::max<double>(block.low, first_) : block.low;
    const double high = std::max<double>(block.high, low);
    const CurveBounds k = extinction_.over(tf_.axis(low), tf_.axis(high));
    if (k.most == 0) return 0;
    const CurveBounds c = color_.over(tf_.axis(low), tf_.axis(high));
    const double most_color = std::max(c.most, 1.0);  // opacity is a channel too
    // of the axis over the ray
    constexpr double kLn10 = 2.302585092994046;
    const double per = tf_.logarithmic ? 1 / (low * kLn10) : 1;
    const double slope = block.slope * per;
    const double bend = block.bend * per + (tf_.logarithmic ? slope * slope * kLn10 : 0);
    const double product = k.slope * most_color + k.most * c.slope;
    const double kinks = k.kinks * most_color + k.most * c.kinks;
    return (product * bend + 2 * k.slope * c.slope * slope * slope + 2 * k.most * k.most * c.slope * slope + kinks * slope / edge) / 24;
  }

 private:
  const TransferFunction& tf_;
  Curve extinction_, color_;
  double first_;
};

/// Of projections: the field itself is integrated.
double error_density(const BlockVariation& block) { return block.low <= block.high ? block.bend / 24.0 : 0; }

std::vector<double> densities(const DomainGeometry& geometry, const EncodedField& field, const Scene& stored) {
  const VariationGrid& grid = field.variation;
  std::vector<double> of_blocks(grid.of_blocks.size());
  const bool volume = stored.settings.draws_volume();
  const TransferFunction& tf = stored.transfer_function;
  std::optional<Light> light;
  if (volume) light.emplace(tf, extinction_unit(geometry, tf));
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, of_blocks.size(), 4096), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      of_blocks[i] = light ? light->error_density(grid.of_blocks[i], std::exp2(grid.shift)) : error_density(grid.of_blocks[i]);
  });
  return of_blocks;
}

/// What the estimates of a ray's intervals may come to, in budgets: they take the worst place of a block for all of it, and errors
/// cancel in part. Measured (tests/plan_test.cpp): of pictures of values without rule the largest error is 0.3 of the sum at most.
constexpr double kSumOfEstimates = 2;

/// What a ray's intervals may be off by together, in what is integrated.
double total_budget(const DomainGeometry& geometry, const EncodedField& field, const Scene& stored) {
  const double budget = kSumOfEstimates * stored.settings.budget;
  if (stored.settings.draws_volume()) return budget;
  const Vec3d size = geometry.size();
  const double longest = std::max({size.x, size.y, size.z}) / geometry.smallest_edge();
  const double range = (field.values.front().max - field.values.front().min) / field.scale.units.scale;
  return budget * std::abs(range) * longest;
}

/// Steps that meet the budget on a ray as long as a ball of what can be seen with the fewest samples: for sum h^2 A dl <= budget the
/// sum of dl / h is least where h goes as A^(-1/3).
std::vector<double> steps_of(const std::vector<double>& densities, double block_volume, double budget) {
  double roots = 0;
  std::int64_t seen = 0;
  for (const double density : densities)
    if (density > 0) {
      roots += std::cbrt(density);
      ++seen;
    }
  const double length = std::cbrt(static_cast<double>(seen) * block_volume);
  const double scale = seen > 0 ? std::sqrt(budget / (length * (roots / static_cast<double>(seen)))) : 1;
  std::vector<double> steps(densities.size());
  std::transform(densities.begin(), densities.end(), steps.begin(),
                 [&](double density) { return density > 0 ? scale / std::cbrt(density) : kInfinity; });
  return steps;
}

/// As planned_step() in shaders/plan.glsl reads it; a step between two codes is the shorter one.
std::uint8_t code_of(double step) {
  if (std::isinf(step)) return AMRTEX_PLAN_CONSTANT;
  const double code = std::floor(AMRTEX_PLAN_CODES_AN_OCTAVE * (std::log2(step) + AMRTEX_PLAN_OCTAVES_BELOW_ONE));
  return static_cast<std::uint8_t>(std::clamp(code, 0.0, AMRTEX_PLAN_CONSTANT - 1.0));
}

/// Neighbours along one axis, there and back.
void smooth_line(double* first, std::ptrdiff_t way, int count, double edge) {
  for (int i = 1; i < count; ++i) first[i * way] = std::min(first[i * way], first[(i - 1) * way] + edge);
  for (int i = count - 2; i >= 0; --i) first[i * way] = std::min(first[i * way], first[(i + 1) * way] + edge);
}

}  // namespace

double error_density(const BlockVariation& block, const TransferFunction& tf, double extinction_unit, double edge) {
  return Light(tf, extinction_unit).error_density(block, edge);
}

void smooth_steps(const Vec3i& blocks, double edge, std::vector<double>& steps) {
  const std::array<std::ptrdiff_t, 3> way{1, blocks.x, std::ptrdiff_t{blocks.x} * blocks.y};
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    tbb::parallel_for(0, blocks[c], [&](int k) {
      for (int j = 0; j < blocks[b]; ++j) smooth_line(&steps[0] + k * way[c] + j * way[b], way[axis], blocks[axis], edge);
    });
  }
}

void add_plan(const DomainGeometry& geometry, const EncodedField& field, const Scene& stored, SceneBindings& b) {
  const bool planned = stored.settings.sampling == Sampling::planned;
  b.define("AMRTEX_PLANNED", planned ? 1 : 0);
  if (!planned) return;
  const VariationGrid& grid = field.variation;
  if (grid.empty())
    throw UnsupportedError(fmt::format("sampling planned: the structure of encoding {} was built without how its field varies", field.encoding));
  const double edge = std::exp2(grid.shift);
  std::vector<double> steps = steps_of(densities(geometry, field, stored), edge * edge * edge, total_budget(geometry, field, stored));
  smooth_steps(grid.blocks, edge, steps);
  std::vector<std::uint8_t> codes(steps.size());
  std::transform(steps.begin(), steps.end(), codes.begin(), code_of);
  b.buffers.push_back(block_map("planned_steps", codes));
  b.uniforms.push_back({"u_plan_blocks", std::vector<int>{grid.blocks.x, grid.blocks.y, grid.blocks.z}});
  b.set("u_plan_shift", grid.shift);
}

}  // namespace amrtex
