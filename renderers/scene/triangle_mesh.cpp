#include "renderers/scene/triangle_mesh.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

constexpr std::uint32_t kLeaf = 4;       // triangles
constexpr std::size_t kMostNodes = 128;  // open at a time: one a level, and 2^31 triangles are halved 29 times
constexpr double kSlack = 1 + 16 * std::numeric_limits<double>::epsilon();  // of where a ray leaves a box: rounding loses none

bool finite(const Vec3d& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

std::string hash_of(const std::vector<Triangle>& triangles) {
  const XXH128_hash_t h = XXH3_128bits(triangles.data(), triangles.size() * sizeof(Triangle));
  return fmt::format("{:016x}{:016x}", h.high64, h.low64);
}

void check(const std::vector<Triangle>& triangles) {
  if (triangles.empty()) throw Error("no triangle; at least one is needed");
  if (triangles.size() > std::size_t{1} << 31)
    throw Error(fmt::format("{} triangles; at most {} are supported", triangles.size(), std::size_t{1} << 31));
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (const Vec3d& p : triangles[i])
      if (!finite(p)) throw Error(fmt::format("triangle {}: the corner ({}, {}, {}) is not finite", i, p.x, p.y, p.z));
}

/// A ray as the triangle test wants it: its largest direction is the last axis, sheared onto which all others vanish.
class ShearedRay {
 public:
  ShearedRay(const Vec3d& origin, const Vec3d& direction) : origin_(origin) {
    const Vec3d size = glm::abs(direction);
    z_ = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    x_ = (z_ + 1) % 3;
    y_ = (z_ + 2) % 3;
    shear_ = {direction[x_] / direction[z_], direction[y_] / direction[z_], 1 / direction[z_]};
  }

  /// Distance to the triangle's plane where the ray meets it within its edges.
  std::optional<double> meet(const Triangle& triangle) const {
    std::array<Vec3d, 3> p;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3d from = triangle[i] - origin_;
      p[i] = {from[x_] - shear_.x * from[z_], from[y_] - shear_.y * from[z_], shear_.z * from[z_]};
    }
    // twice the areas between the ray and each edge: a neighbour sees its own with the other sign to the bit
    const double u = p[2].x * p[1].y - p[2].y * p[1].x;
    const double v = p[0].x * p[2].y - p[0].y * p[2].x;
    const double w = p[1].x * p[0].y - p[1].y * p[0].x;
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return std::nullopt;
    const double area = u + v + w;
    if (area == 0) return std::nullopt;
    return (u * p[0].z + v * p[1].z + w * p[2].z) / area;
  }

 private:
  Vec3d origin_;
  int x_, y_, z_;
  Vec3d shear_{0};
};

/// Where a ray enters a closed box; infinite where it does not before `end`.
double entry(const Vec3d& origin, const Vec3d& direction, const Vec3d& lower, const Vec3d& upper, double end) {
  double from = 0;
  double to = end;
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) {
      if (origin[a] < lower[a] || origin[a] > upper[a]) return std::numeric_limits<double>::infinity();
      continue;
    }
    const double t0 = (lower[a] - origin[a]) / direction[a];
    const double t1 = (upper[a] - origin[a]) / direction[a];
    from = std::max(from, std::min(t0, t1));
    to = std::min(to, std::max(t0, t1) * kSlack);
  }
  return from <= to ? from : std::numeric_limits<double>::infinity();
}

double cosine(const Triangle& t, const Vec3d& direction) {
  const Vec3d normal = glm::cross(t[1] - t[0], t[2] - t[0]);
  return std::min(std::abs(glm::dot(normal, direction)) / (glm::length(normal) * glm::length(direction)), 1.0);
}

}  // namespace

TriangleMesh::TriangleMesh(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
  check(triangles_);
  hash_ = hash_of(triangles_);
  order_.resize(triangles_.size());
  std::iota(order_.begin(), order_.end(), 0U);
  build(0, static_cast<std::uint32_t>(order_.size()));
}

/// Halves by the middle triangle along the longest axis of the middles' box, so that depth is the logarithm of the number.
void TriangleMesh::build(std::uint32_t begin, std::uint32_t end) {
  const std::size_t self = nodes_.size();
  nodes_.emplace_back();
  const auto middle = [this](std::uint32_t i) {
    return triangles_[i][0] / 3.0 + triangles_[i][1] / 3.0 + triangles_[i][2] / 3.0;
  };
  Vec3d lower(std::numeric_limits<double>::infinity());
  Vec3d upper = -lower;
  Vec3d first = lower;
  Vec3d last = upper;
  for (std::uint32_t k = begin; k < end; ++k) {
    for (const Vec3d& p : triangles_[order_[k]]) {
      lower = glm::min(lower, p);
      upper = glm::max(upper, p);
    }
    first = glm::min(first, middle(order_[k]));
    last = glm::max(last, middle(order_[k]));
  }
  nodes_[self].lower = lower;
  nodes_[self].upper = upper;
  if (end - begin <= kLeaf) {
    nodes_[self].begin = begin;
    nodes_[self].count = end - begin;
    return;
  }
  const Vec3d extent = last - first;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
  const std::uint32_t half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) { return middle(a)[axis] < middle(b)[axis]; });
  build(begin, half);
  nodes_[self].second = static_cast<std::uint32_t>(nodes_.size());
  build(half, end);
}

std::optional<TriangleMesh::Hit> TriangleMesh::first_hit(const Vec3d& origin, const Vec3d& direction, double end) const {
  const ShearedRay ray(origin, direction);
  const auto enter = [&](std::uint32_t node) { return entry(origin, direction, nodes_[node].lower, nodes_[node].upper, end); };
  std::array<std::pair<std::uint32_t, double>, kMostNodes> open;  // nodes to visit and where the ray enters them
  std::size_t count = 0;
  const auto push = [&](std::uint32_t node, double at) {
    if (at <= end && std::isfinite(at)) open[count++] = {node, at};
  };
  const Triangle* nearest = nullptr;
  push(0, enter(0));
  while (count > 0) {
    const auto [index, at] = open[--count];
    if (at > end) continue;
    const Node& node = nodes_[index];
    for (std::uint32_t k = node.begin; k < node.begin + node.count; ++k) {
      const Triangle& triangle = triangles_[order_[k]];
      const auto t = ray.meet(triangle);
      if (!t || *t < 0 || !(*t < end)) continue;
      end = *t;
      nearest = &triangle;
    }
    if (node.count > 0) continue;
    const std::uint32_t children[2] = {index + 1, node.second};
    const double ats[2] = {enter(children[0]), enter(children[1])};
    const int near = ats[0] <= ats[1] ? 0 : 1;  // on top
    push(children[1 - near], ats[1 - near]);
    push(children[near], ats[near]);
  }
  if (nearest == nullptr) return std::nullopt;
  return Hit{end, cosine(*nearest, direction)};
}

}  // namespace amrtex
