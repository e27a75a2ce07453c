// A mesh of triangles, and where rays meet it first. Knows no scene and no encoding.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "structures/mesh/spaces.hpp"

namespace amrtex {

using Triangle = std::array<Vec3d, 3>;  ///< corners, world

class TriangleMesh {
 public:
  struct Hit {
    double distance = 0;  ///< from the ray's origin, in lengths of its direction; at least 0
    double cosine = 0;    ///< between the ray and the triangle's normal, 0 to 1: both sides are alike
  };

  /// Throws Error where there is no triangle, or a corner is not finite (naming the triangle).
  explicit TriangleMesh(std::vector<Triangle> triangles);

  /// The nearest triangle that the ray meets before `end`. Neighbours leave no gap between them: their common edge is
  /// met by at least one (Woop, Benthin and Wald 2013, in double). A triangle without area is never met.
  std::optional<Hit> first_hit(const Vec3d& origin, const Vec3d& direction,
                               double end = std::numeric_limits<double>::infinity()) const;

  const std::vector<Triangle>& triangles() const { return triangles_; }
  /// Of all corners, in their order.
  const std::string& content_hash() const { return hash_; }

 private:
  /// Of the tree of boxes. The first child of an inner node stands right behind it.
  struct Node {
    Vec3d lower, upper;        ///< world
    std::uint32_t begin = 0;   ///< leaf: first place in order_
    std::uint32_t count = 0;   ///< leaf: how many; 0 for an inner node
    std::uint32_t second = 0;  ///< inner node: its second child
  };
  void build(std::uint32_t begin, std::uint32_t end);

  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> order_;  ///< triangles, those of a leaf side by side
  std::vector<Node> nodes_;
  std::string hash_;
};

}  // namespace amrtex
