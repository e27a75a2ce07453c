// Which pixels a box, or a slice of it, can touch: convex polygons on screen, computed on the host. They are a little larger than
// what they stand for, by more than rounding and the rasteriser's grid can lose; the shader decides pixel by pixel.
#pragma once

#include <array>
#include <vector>

#include "renderers/bindings/finest_camera.hpp"

namespace amrtex {

/// Corners in order, -1 to 1 over the picture; fewer than 3: nothing is seen.
using ScreenPolygon = std::vector<glm::dvec2>;

class ScreenPolygons {
 public:
  /// Width and height of the picture in pixels.
  ScreenPolygons(const FinestCamera& camera, int width, int height);

  /// Distances of the nearest and the farthest corner of a box (finest cells) from the eye, along the direction of view, in
  /// units of the smallest edge of a finest cell; only what of the box is drawn. Nearest > farthest: nothing is.
  std::array<double, 2> depths(const Box& cells) const;
  /// Every pixel whose ray meets the box in front of the eye.
  void cover_box(const Box& cells, ScreenPolygon& polygon) const;
  /// Every pixel whose ray meets the box at this depth, which must be above 0.
  void cover_slice(const Box& cells, double depth, ScreenPolygon& polygon) const;

 private:
  /// A corner: along the picture's half width and half height (times depth, with perspective), and depth.
  using Corners = std::array<Vec3d, 8>;
  struct Part {
    Vec3d lower, upper;  ///< finest cells
    bool empty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
  };

  Part drawn_part(const Box& cells) const;
  Part grown(const Part& part, double depth) const;
  Corners corners(const Part& part) const;
  glm::dvec2 on_screen(const Vec3d& corner) const;
  void finish(ScreenPolygon& points) const;

  FinestCamera camera_;
  double pixel_;     ///< units: width of a pixel at depth 1, or anywhere in parallel projection
  glm::dvec2 edge_;  ///< of the picture, a little further out
};

}  // namespace amrtex
