// The front of a ray on its way through the mesh, and the box around it in which the field is one function. Private to the
// reference.
#pragma once

#include "renderers/reference/piece_function.hpp"
#include "renderers/reference/reference_field.hpp"

namespace amrtex {

/// A ray in finest index space; its parameter t stays the world length.
struct IndexRay {
  Vec3d origin;     ///< finest cells
  Vec3d direction;  ///< finest cells a world length
};

class RayFront {
 public:
  explicit RayFront(const ReferenceField& field);

  /// At the ray's origin, which lies in the domain.
  void start(const IndexRay& ray);
  /// World length of the way behind.
  double way() const { return t_; }
  /// Finest space: never goes back, and lies exactly on the plane crossed last.
  const Vec3d& position() const { return position_; }
  const Vec3d& domain() const { return domain_; }

  /// The piece is the whole domain, until it is clipped.
  void open();
  void clip(const Vec3d& lower, const Vec3d& upper);
  void clip(const Box& box) { clip(Vec3d(box.lower), Vec3d(box.upper)); }
  /// To what lies between the centres of cells c and c + 1.
  void clip_dual(int level, const Vec3i& cell);
  /// Finds the leaf at the front and clips the piece to it (or to the hole); has it a value?
  bool enter_leaf();
  /// That enter_leaf() found last.
  const ReferenceLeaf& leaf() const { return leaf_; }

  /// Cell of the finest level that the ray enters here.
  Vec3i finest_cell() const;
  /// Lower one of the two cells, a coordinate, between whose centres the front lies.
  Vec3i dual_index(int level) const;

  /// Where the ray leaves the piece, world length.
  double find_exit();
  /// Moves the front onto the exit plane; false at the domain's end. Coordinates never go
  /// back, so each call passes at least one plane and rounding cannot trap the ray.
  bool advance(double exit);

  /// A trilinear function, less its value at the lower corner, is a cubic along a line. Its unit cube: finest space.
  Cubic rise_along(const Trilinear& f, const Vec3d& lower, double width, double from, double to) const;

 private:
  const ReferenceField* field_;
  Vec3d domain_;  // finest cells
  IndexRay ray_{};
  Vec3d inverse_{0};
  Vec3d position_{0};
  double t_ = 0;
  int exit_axis_ = 0;
  Vec3d lower_{0}, upper_{0};  // of the piece, finest space
  ReferenceLeaf leaf_;
};

}  // namespace amrtex
