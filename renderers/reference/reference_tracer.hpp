// Walks a ray through the pieces in which a filter's f is smooth. Private to the reference.
#pragma once

#include <vector>

#include "renderers/reference/ray_integral.hpp"
#include "renderers/reference/reference_field.hpp"

namespace amrtex {

/// A ray in finest index space; its parameter t stays the world length.
struct IndexRay {
  Vec3d origin;     ///< finest cells
  Vec3d direction;  ///< finest cells a world length
};

/// Look-ups are kept in direct-mapped caches, so one object serves one thread. What is
/// found does not depend on what was asked before.
class ReferenceTracer {
 public:
  explicit ReferenceTracer(const ReferenceField& field);

  /// Calls visit(f, from, to) for every piece with a value between t = 0 and `end`, front to
  /// back, until it returns false. Adjacent pieces join to the bit: to = from. The ray is inside the
  /// domain all the way.
  template <class Visit>
  void trace(const IndexRay& ray, double end, Visit&& visit) {
    start(ray);
    while (t_ < end) {
      locate();
      const double exit = find_exit();
      const double to = std::min(exit, end);
      if (has_value_ && to > t_ && !visit(function(t_, to), t_, to)) return;
      if (!advance(exit)) return;
    }
  }

  /// Where the piece being visited starts, finest space: exactly on the plane that it starts at.
  const Vec3d& front() const { return position_; }
  const Vec3d& domain() const { return domain_; }

 private:
  /// One trilinear function: between 8 cell centres, or between a leaf's vertices.
  struct Cell {
    int level = -1;
    Vec3i cell{0};
    bool all_leaves = false;
    Trilinear f;
    double lower = 0, upper = 0;
  };
  struct BasisCell {
    int level = -1;
    Vec3i cell{0};
    bool any = false, finer = false;
    Trilinear numerator, denominator;
    double lower = 0, upper = 0;
  };
  template <class T>
  class Cache {
   public:
    T& at(int level, const Vec3i& c) {
      // neighbouring cells never share a slot
      const auto slot = static_cast<std::uint32_t>((c.x & 31) | (c.y & 31) << 5 | (c.z & 31) << 10) ^
                        static_cast<std::uint32_t>(level) * 0x9E35U;
      return entries_[slot & (kEntries - 1)];
    }
    void allocate() { entries_.resize(kEntries); }

   private:
    static constexpr std::uint32_t kEntries = 1U << 16;
    std::vector<T> entries_;
  };

  void start(const IndexRay& ray);
  void locate();
  void locate_nearest();
  void locate_linear();
  void locate_vertex();
  void locate_basis();
  bool enter_leaf();
  double find_exit();
  bool advance(double exit);
  PieceFunction function(double from, double to) const;
  Cubic along(const Trilinear& f, const Vec3d& lower, double width, double from, double to) const;

  Vec3i finest_cell() const;
  Vec3i dual_index(int level) const;
  void clip(const Vec3d& lower, const Vec3d& upper);
  void clip(const Box& box) { clip(Vec3d(box.lower), Vec3d(box.upper)); }
  void clip_dual(int level, const Vec3i& cell);
  const Cell& dual_cell(int level, const Vec3i& cell);
  const BasisCell& basis_cell(int level, const Vec3i& cell);

  const ReferenceField& field_;
  const Filter filter_;
  const Vec3d domain_;  // finest cells
  Cache<Cell> cells_;
  Cache<BasisCell> basis_cells_;
  VertexCache vertices_;

  // the ray's front
  IndexRay ray_{};
  Vec3d inverse_{0};
  Vec3d position_{0};  // never goes back, and lies exactly on the plane crossed last
  double t_ = 0;
  int exit_axis_ = 0;

  // the piece there
  Vec3d lower_{0}, upper_{0};  // finest space
  bool has_value_ = false;
  ReferenceLeaf leaf_;
  Box page_;
  int page_level_ = 0;
  const Cell* cell_ = nullptr;
  std::vector<BasisCell> basis_;
};

}  // namespace amrtex
