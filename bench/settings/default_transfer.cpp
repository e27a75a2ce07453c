#include "bench/settings/default_transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "structures/mesh/domain_geometry.hpp"
#include "structures/mesh/quoted.hpp"

namespace amrtex {
namespace {

constexpr int kBins = 64;
constexpr int kRays = 48;  ///< along the picture's shorter side
/// Of the volume, from which on the commonest value is a background: what is looked for lies in it.
constexpr double kBackgroundShare = 0.2;
/// Bins beside the background's belong to it while they hold this much of its share.
constexpr double kSlopeShare = 0.05;
/// Of the axis, that the transparent part reaches from the background's middle at most.
constexpr double kMostHidden = 0.15;
/// Of the largest value's magnitude: values on both sides of 0 are signed where each side reaches this far.
constexpr double kSigned = 0.2;

/// Colours and extinction over 0 to 1 of the shown range.
struct Shape {
  std::vector<std::array<double, 2>> opacity;  // place, 0 to 1
};

/// The part of the axis around the background, 0 to 1.
struct Hidden {
  double from, middle, to;
};

std::optional<Hidden> background_of(const ValueHistogram& histogram) {
  std::vector<double> share = histogram.share;
  share.front() += histogram.below;
  share.back() += histogram.above;
  const auto at = static_cast<std::size_t>(std::max_element(share.begin(), share.end()) - share.begin());
  if (share[at] < kBackgroundShare) return std::nullopt;
  std::size_t first = at, last = at;
  const auto most = static_cast<std::size_t>(kMostHidden * kBins);
  while (first > 0 && at - first < most && share[first - 1] > kSlopeShare * share[at]) --first;
  while (last + 1 < share.size() && last - at < most && share[last + 1] > kSlopeShare * share[at]) ++last;
  const auto place = [](std::size_t bin) { return static_cast<double>(bin) / kBins; };
  return Hidden{place(first), place(at) + 0.5 / kBins, place(last + 1)};
}

/// A slope from 0 at `from` to 1 at `to` that is gentle at first: faint values stay faint.
void add_slope(Shape& shape, double from, double to, double top) {
  shape.opacity.push_back({from, 0});
  shape.opacity.push_back({from + 0.5 * (to - from), 0.3 * top});
  shape.opacity.push_back({to, top});
}

Shape shape_of(const std::optional<Hidden>& background) {
  constexpr double kNear = 0.3;  // of the axis: a background this near to an end leaves nothing to see beyond it
  Shape shape;
  const Hidden hidden = background.value_or(Hidden{0, 0, 0});
  const bool falls = hidden.middle > kNear;
  const bool rises = hidden.middle < 1 - kNear;
  const double longest = std::max(falls ? hidden.from : 0, rises ? 1 - hidden.to : 0);
  if (falls) {
    add_slope(shape, hidden.from, 0, hidden.from / longest);
    std::reverse(shape.opacity.begin(), shape.opacity.end());
  }
  if (rises) add_slope(shape, hidden.to, 1, (1 - hidden.to) / longest);
  return shape;
}

/// Is the field one of differences, such as a velocity?
bool signed_values(const ShownRange& range) {
  return !range.logarithmic && !range.constant && range.lower < 0 && range.upper > 0 &&
         std::min(-range.lower, range.upper) >= kSigned * std::max(-range.lower, range.upper);
}

ShownRange range_of(const AmrHierarchy& mesh, int field, const TransferRequest& request) {
  if (request.range) {
    const auto [lower, upper] = *request.range;
    if (!std::isfinite(lower) || !std::isfinite(upper) || !(lower < upper))
      throw UsageError(fmt::format("--range {} {}: accepted: two numbers, the smaller one first", lower, upper));
    const bool logarithmic = request.logarithmic.value_or(lower > 0 && std::log10(upper) - std::log10(lower) > 3);
    if (logarithmic && lower <= 0)
      throw UsageError(fmt::format("--range {} {}: a logarithmic axis begins above 0", lower, upper));
    return {lower, upper, logarithmic, false};
  }
  ShownRange range = request.logarithmic ? shown_range(mesh, field, *request.logarithmic) : shown_range(mesh, field);
  if (request.color_map.empty() && !request.colors && signed_values(range)) {  // 0 is the middle of such a map
    range.upper = std::max(-range.lower, range.upper);
    range.lower = -range.upper;
  }
  return range;
}

/// Walks the leaves along a ray, in cells of the finest level.
template <class Visit>
void walk(const AmrHierarchy& mesh, const Vec3d& origin, const Vec3d& direction, Visit&& visit) {
  const Vec3d size(mesh.cells(mesh.finest_level()));
  const Vec3d inverse = 1.0 / direction;
  const Vec3d a = (Vec3d(0) - origin) * inverse, b = (size - origin) * inverse;
  double t = 0, end = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (origin[axis] < 0 || origin[axis] > size[axis]) return;
      continue;
    }
    t = std::max(t, std::min(a[axis], b[axis]));
    end = std::min(end, std::max(a[axis], b[axis]));
  }
  const double hole_step = std::max(1.0, std::max({size.x, size.y, size.z}) / 512);
  constexpr int kMostSteps = 100'000;
  for (int step = 0; t < end && step < kMostSteps; ++step) {
    const double nudge = 1e-9 * (1 + t);
    const Vec3d place = origin + direction * (t + nudge);
    const Vec3i cell = glm::clamp(Vec3i(glm::floor(place)), Vec3i(0), mesh.cells(mesh.finest_level()) - 1);
    const std::optional<LeafCell> leaf = mesh.find_leaf(cell);
    double next = std::min(end, t + hole_step);
    if (leaf) {
      const double width = mesh.cell_width(leaf->level);
      const Vec3d lower = Vec3d(leaf->cell) * width;
      next = end;
      for (int axis = 0; axis < 3; ++axis)
        if (direction[axis] != 0)
          next = std::min(next, ((direction[axis] > 0 ? lower[axis] + width : lower[axis]) - origin[axis]) * inverse[axis]);
      visit(*leaf, std::max(0.0, next - t));
    }
    t = std::max(next, t + nudge);
  }
}

/// Extinction times length along a ray from `origin` toward `target`, world; length in domain edges, or in world units.
double depth_along(const AmrHierarchy& mesh, int field, const TransferFunction& tf, const WorldRay& ray) {
  const Vec3d spacing = mesh.spacing(mesh.finest_level());
  const Vec3d size = mesh.domain_upper() - mesh.domain_lower();
  const double unit = std::max({spacing.x, spacing.y, spacing.z});
  const Vec3d along = ray.direction * (unit / spacing);  // finest cells a `unit` of world length
  const double longest = std::max({size.x, size.y, size.z});
  const double per_length = tf.length_unit == TransferFunction::LengthUnit::world ? unit : unit / longest;
  double depth = 0;
  walk(mesh, (ray.origin - mesh.domain_lower()) / spacing, along, [&](const LeafCell& leaf, double length) {
    const double value = mesh.value(leaf, field);
    if (std::isfinite(value)) depth += tf.extinction_at(value) * length * per_length;
  });
  return depth;
}

double median(std::vector<double>& depths) {
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

/// Rays through the middles of cells that have some extinction: where the picture's grid passes between them.
std::vector<double> aimed_depths(const AmrHierarchy& mesh, int field, const TransferFunction& tf, const View& view) {
  constexpr std::int64_t kMost = 512;
  std::vector<Vec3d> places;
  std::int64_t stride = 1, seen = 0;
  for (int level = mesh.finest_level(); level >= 0; --level) {
    const auto patches = mesh.patches(level);
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const auto leaf = mesh.leaf_mask(level, static_cast<int>(p));
      const auto& values = patches[p].values[static_cast<std::size_t>(field)];
      const Vec3i size = patches[p].box.size();
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (leaf[i] == 0 || !std::isfinite(values[i]) || !(tf.extinction_at(values[i]) > 0) || seen++ % stride != 0) continue;
        const auto n = static_cast<std::int64_t>(i);
        const Vec3i cell(n % size.x, n / size.x % size.y, n / size.x / size.y);
        places.push_back(mesh.domain_lower() + (Vec3d(patches[p].box.lower + cell) + 0.5) * mesh.spacing(level));
        if (static_cast<std::int64_t>(places.size()) < kMost) continue;
        for (std::size_t k = 0; 2 * k < places.size(); ++k) places[k] = places[2 * k];  // every other one
        places.resize(places.size() / 2);
        stride *= 2;
      }
    }
  }
  std::vector<double> depths;
  for (const Vec3d& place : places) {
    const double scale =
        std::max({std::abs(place.x - view.eye.x), std::abs(place.y - view.eye.y), std::abs(place.z - view.eye.z)});
    if (!(scale > 0)) continue;
    const double depth = depth_along(mesh, field, tf, {view.eye, glm::normalize((place - view.eye) / scale)});
    if (depth > 0) depths.push_back(depth);
  }
  return depths;
}

}  // namespace

double median_depth(const AmrHierarchy& mesh, int field, const TransferFunction& tf, const View& view, double aspect) {
  const int width = std::max(1, static_cast<int>(std::lround(kRays * std::max(1.0, std::min(aspect, 16.0)))));
  const int height = std::max(1, static_cast<int>(std::lround(kRays * std::max(1.0, std::min(1 / aspect, 16.0)))));
  const CameraFrame camera = camera_frame(view, width, height);
  std::vector<double> depths;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (const double depth = depth_along(mesh, field, tf, camera_ray(camera, x, y, width, height)); depth > 0)
        depths.push_back(depth);
  constexpr std::size_t kEnough = 24;
  if (depths.size() < kEnough)
    for (const double depth : aimed_depths(mesh, field, tf, view)) depths.push_back(depth);
  return median(depths);
}

double opacity_length(const AmrHierarchy& mesh) {
  const Vec3d size = mesh.domain_upper() - mesh.domain_lower();
  const double longest = std::max({size.x, size.y, size.z});
  return longest * glm::length(size / longest) / std::cbrt(static_cast<double>(std::max<std::int64_t>(1, mesh.leaf_cells())));
}

void scale_to_view(TransferFunction& tf, const AmrHierarchy& mesh, int field, const View& view, double aspect) {
  const double depth = median_depth(mesh, field, tf, view, aspect);
  if (!(depth > 0) || !std::isfinite(depth)) return;
  // three digits: nobody wants to read more of them in a scene
  for (auto& p : tf.extinction) p.extinction = std::stod(fmt::format("{:.3g}", p.extinction * (kMedianDepth / depth)));
}

TransferFunction default_transfer(const AmrHierarchy& mesh, int field, const View& view, double aspect,
                                  const TransferRequest& request) {
  const ShownRange range = range_of(mesh, field, request);
  const bool diverging = request.color_map.empty() && signed_values(range);
  const ColorPoints map = request.colors ? *request.colors
                                         : color_map(!request.color_map.empty() ? request.color_map
                                                     : diverging                ? "cool_warm"
                                                                                : "viridis");
  const ValueHistogram histogram = value_histogram(mesh, field, range.lower, range.upper, range.logarithmic, kBins);
  TransferFunction tf;
  tf.logarithmic = range.logarithmic;
  tf.color = stretch(map, range.lower, range.upper, range.logarithmic);
  const auto add = [&](double place, double extinction) {
    const double value = place == 0 ? range.lower : place == 1 ? range.upper : histogram.value_at(place);
    if (tf.extinction.empty() || value > tf.extinction.back().value) tf.extinction.push_back({value, extinction});
  };
  if (range.constant)
    add(0.5, 1);  // one value: its box
  else
    for (const auto& [place, opacity] : shape_of(background_of(histogram)).opacity) add(place, opacity);
  scale_to_view(tf, mesh, field, view, aspect);
  return tf;
}

}  // namespace amrtex
