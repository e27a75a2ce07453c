// Walks a ray through the pieces in which a filter's f is smooth. Private to the reference.
#pragma once

#include <algorithm>
#include <memory>

#include "renderers/reference/filter_reference.hpp"
#include "renderers/reference/ray_front.hpp"

namespace amrtex {

/// One object serves one thread. What is found does not depend on what was asked before. The filter must outlive it.
class ReferenceTracer {
 public:
  explicit ReferenceTracer(const FilterReference& filter) : front_(filter.field()), pieces_(filter.pieces()) {}

  /// Calls visit(f, from, to) for every piece with a value between t = 0 and `end`, front to
  /// back, until it returns false. Adjacent pieces join to the bit: to = from. The ray is inside the
  /// domain all the way.
  template <class Visit>
  void trace(const IndexRay& ray, double end, Visit&& visit) {
    front_.start(ray);
    pieces_->start();
    while (front_.way() < end) {
      front_.open();
      const bool has_value = pieces_->locate(front_);
      const double from = front_.way();
      const double exit = front_.find_exit();
      const double to = std::min(exit, end);
      if (has_value && to > from && !visit(pieces_->function(front_, from, to), from, to)) return;
      if (!front_.advance(exit)) return;
    }
  }

  /// Where the piece being visited starts, finest space: exactly on the plane that it starts at.
  const Vec3d& front() const { return front_.position(); }
  const Vec3d& domain() const { return front_.domain(); }

 private:
  RayFront front_;
  std::unique_ptr<FilterPieces> pieces_;
};

}  // namespace amrtex
