#include "bench/settings/default_transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

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

/// How far from the background, 0 to 1, a place of the axis lies: what is far stands out.
class Distance {
 public:
  explicit Distance(const std::optional<Hidden>& background) : hidden_(background.value_or(Hidden{0, 0, 0})) {
    constexpr double kNear = 0.3;  // of the axis: a background this near to an end leaves nothing to see beyond it
    falls_ = hidden_.middle > kNear;
    rises_ = hidden_.middle < 1 - kNear;
    longest_ = std::max(falls_ ? hidden_.from : 0, rises_ ? 1 - hidden_.to : 0);
  }
  double at(double place) const {
    const double below = falls_ ? hidden_.from - place : 0, above = rises_ ? place - hidden_.to : 0;
    return std::clamp(std::max(below, above) / longest_, 0.0, 1.0);
  }
  /// Opacity from this distance on.
  Shape shape(double least) const {
    Shape shape;
    const double gap = least * longest_;
    if (falls_ && hidden_.from > gap) {
      add_slope(shape, hidden_.from - gap, 0, hidden_.from / longest_);
      std::reverse(shape.opacity.begin(), shape.opacity.end());
    }
    if (rises_ && hidden_.to + gap < 1) add_slope(shape, hidden_.to + gap, 1, (1 - hidden_.to) / longest_);
    return shape;
  }

 private:
  Hidden hidden_;
  bool falls_, rises_;
  double longest_;
};

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

/// What a ray passes through.
struct Piece {
  double value;
  double length;  ///< in the domain's longest edges
};
using Pieces = std::vector<Piece>;

Pieces pieces_along(const AmrHierarchy& mesh, int field, const WorldRay& ray) {
  const Vec3d spacing = mesh.spacing(mesh.finest_level());
  const Vec3d size = mesh.domain_upper() - mesh.domain_lower();
  const double unit = std::max({spacing.x, spacing.y, spacing.z});
  const Vec3d along = ray.direction * (unit / spacing);  // finest cells a `unit` of world length
  const double per_length = unit / std::max({size.x, size.y, size.z});
  Pieces pieces;
  walk(mesh, (ray.origin - mesh.domain_lower()) / spacing, along, [&](const LeafCell& leaf, double length) {
    const double value = mesh.value(leaf, field);
    if (std::isfinite(value) && length > 0) pieces.push_back({value, length * per_length});
  });
  return pieces;
}

/// Middles of cells that `wanted` chooses by their value, world: at most 512, spread evenly over the mesh's order.
template <class Wanted>
std::vector<Vec3d> some_cells(const AmrHierarchy& mesh, int field, Wanted&& wanted) {
  constexpr std::size_t kMost = 512;
  std::vector<Vec3d> places;
  std::int64_t stride = 1, seen = 0;
  for (int level = mesh.finest_level(); level >= 0; --level) {
    const auto patches = mesh.patches(level);
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const auto leaf = mesh.leaf_mask(level, static_cast<int>(p));
      const auto& values = patches[p].values[static_cast<std::size_t>(field)];
      const Vec3i size = patches[p].box.size();
      for (std::size_t i = 0; i < values.size(); ++i) {
        const double value = leaf[i] == 0 ? std::numeric_limits<double>::quiet_NaN() : values[i];
        if (!std::isfinite(value) || !wanted(value) || seen++ % stride != 0) continue;
        const auto n = static_cast<std::int64_t>(i);
        const Vec3i cell(n % size.x, n / size.x % size.y, n / size.x / size.y);
        places.push_back(mesh.domain_lower() + (Vec3d(patches[p].box.lower + cell) + 0.5) * mesh.spacing(level));
        if (places.size() < kMost) continue;
        for (std::size_t k = 0; 2 * k < places.size(); ++k) places[k] = places[2 * k];  // every other one
        places.resize(places.size() / 2);
        stride *= 2;
      }
    }
  }
  return places;
}

/// Rays of a picture, and where few of a grid meet what `wanted` chooses, rays through cells that it chooses.
template <class Wanted>
std::vector<Pieces> rays_of(const AmrHierarchy& mesh, int field, const View& view, double aspect, Wanted&& wanted) {
  constexpr std::size_t kEnough = 24;
  const int width = std::max(1, static_cast<int>(std::lround(kRays * std::clamp(aspect, 1.0, 16.0))));
  const int height = std::max(1, static_cast<int>(std::lround(kRays * std::clamp(1 / aspect, 1.0, 16.0))));
  const CameraFrame camera = camera_frame(view, width, height);
  std::vector<Pieces> rays;
  std::size_t hits = 0;
  const auto add = [&](const WorldRay& ray) {
    Pieces pieces = pieces_along(mesh, field, ray);
    if (pieces.empty()) return;
    if (std::any_of(pieces.begin(), pieces.end(), [&](const Piece& p) { return wanted(p.value); })) ++hits;
    rays.push_back(std::move(pieces));
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) add(camera_ray(camera, x, y, width, height));
  if (hits >= kEnough) return rays;
  for (const Vec3d& place : some_cells(mesh, field, wanted)) {
    const Vec3d way = place - view.eye;
    const double scale = std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)});
    if (scale > 0) add({view.eye, glm::normalize(way / scale)});
  }
  return rays;
}

double median(std::vector<double>& list) {
  if (list.empty()) return 0;
  const auto middle = list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2);
  std::nth_element(list.begin(), middle, list.end());
  return *middle;
}

double median_depth_of(const std::vector<Pieces>& rays, const TransferFunction& tf, double longest_edge) {
  const double per_length = tf.length_unit == TransferFunction::LengthUnit::world ? longest_edge : 1;
  std::vector<double> depths;
  for (const Pieces& ray : rays) {
    double depth = 0;
    for (const Piece& p : ray) depth += tf.extinction_at(p.value) * p.length * per_length;
    if (depth > 0) depths.push_back(depth);
  }
  return median(depths);
}

double longest_edge_of(const AmrHierarchy& mesh) {
  const Vec3d size = mesh.domain_upper() - mesh.domain_lower();
  return std::max({size.x, size.y, size.z});
}

/// Where extinction begins, as a distance from the background: so far that half of the rays which meet some reach values of the
/// upper half. A wide faint rim would hide them: a picture shows what its rays meet first.
double first_distance(const std::vector<Pieces>& rays, const Distance& distance, const ValueHistogram& axis) {
  constexpr double kReached = 0.55, kMost = 0.45, kStep = 0.025;
  std::vector<double> farthest;
  for (const Pieces& ray : rays) {
    double most = 0;
    for (const Piece& p : ray) most = std::max(most, distance.at(std::clamp(axis.place(p.value), 0.0, 1.0)));
    farthest.push_back(most);
  }
  double least = 0;
  for (; least < kMost; least += kStep) {
    std::vector<double> seen;
    std::copy_if(farthest.begin(), farthest.end(), std::back_inserter(seen), [&](double d) { return d > least; });
    if (median(seen) >= kReached) break;
  }
  return least;
}

/// Extinction whose median depth along these rays is kMedianDepth.
void scale_to_rays(TransferFunction& tf, const std::vector<Pieces>& rays, double longest_edge) {
  const double depth = median_depth_of(rays, tf, longest_edge);
  if (!(depth > 0) || !std::isfinite(depth)) return;
  // three digits: nobody wants to read more of them in a scene
  for (auto& p : tf.extinction) p.extinction = std::stod(fmt::format("{:.3g}", p.extinction * (kMedianDepth / depth)));
}

}  // namespace

double opacity_length(const AmrHierarchy& mesh) {
  const Vec3d size = mesh.domain_upper() - mesh.domain_lower();
  const double longest = std::max({size.x, size.y, size.z});
  return longest * glm::length(size / longest) / std::cbrt(static_cast<double>(std::max<std::int64_t>(1, mesh.leaf_cells())));
}

double median_depth(const AmrHierarchy& mesh, int field, const TransferFunction& tf, const View& view, double aspect) {
  const auto rays = rays_of(mesh, field, view, aspect, [&](double v) { return tf.extinction_at(v) > 0; });
  return median_depth_of(rays, tf, longest_edge_of(mesh));
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
  if (range.constant) {
    add(0.5, 1);  // one value: its box
    scale_to_rays(tf, rays_of(mesh, field, view, aspect, [](double) { return true; }), longest_edge_of(mesh));
    return tf;
  }
  constexpr double kStandsOut = 0.3;
  const Distance distance(background_of(histogram));
  const auto place = [&](double v) { return std::clamp(histogram.place(v), 0.0, 1.0); };
  const auto rays = rays_of(mesh, field, view, aspect, [&](double v) { return distance.at(place(v)) > kStandsOut; });
  for (const auto& [at, opacity] : distance.shape(first_distance(rays, distance, histogram)).opacity) add(at, opacity);
  scale_to_rays(tf, rays, longest_edge_of(mesh));
  return tf;
}

}  // namespace amrtex
