#include "renderers/reference/ray_front.hpp"

#include <cmath>
#include <limits>

namespace amrtex {
namespace {

/// Integer cell of x >= 0 in units of cells; on a face, the cell that a ray of direction d enters.
int cell_of(double x, double d) {
  const int c = static_cast<int>(x);
  return d < 0 && static_cast<double>(c) == x ? c - 1 : c;
}

}  // namespace

RayFront::RayFront(const ReferenceField& field)
    : field_(&field), domain_(field.hierarchy().cells(field.hierarchy().finest_level())) {}

void RayFront::start(const IndexRay& ray) {
  ray_ = ray;
  t_ = 0;
  position_ = glm::clamp(ray.origin, Vec3d(0), domain_);
  for (int a = 0; a < 3; ++a) inverse_[a] = ray.direction[a] == 0 ? 0 : 1 / ray.direction[a];
}

void RayFront::open() {
  lower_ = Vec3d(0);
  upper_ = domain_;
}

void RayFront::clip(const Vec3d& lower, const Vec3d& upper) {
  lower_ = glm::max(lower_, lower);
  upper_ = glm::min(upper_, upper);
}

void RayFront::clip_dual(int level, const Vec3i& cell) {
  const double width = field_->width(level);
  clip((Vec3d(cell) + 0.5) * width, (Vec3d(cell) + 1.5) * width);
}

bool RayFront::enter_leaf() {
  const Vec3i cell = finest_cell();
  const ReferenceLeaf leaf = field_->find_leaf(cell, leaf_);
  if (leaf.level < 0) {
    clip(field_->empty_box(cell));
    return false;
  }
  leaf_ = leaf;
  clip(Box{leaf.cell, leaf.cell + Vec3i(1)}.refined(field_->width(leaf.level)));
  return !std::isnan(leaf.value);
}

Vec3i RayFront::finest_cell() const {
  Vec3i cell;
  for (int a = 0; a < 3; ++a) cell[a] = std::clamp(cell_of(position_[a], ray_.direction[a]), 0, static_cast<int>(domain_[a]) - 1);
  return cell;
}

Vec3i RayFront::dual_index(int level) const {
  const Vec3i cells = field_->hierarchy().cells(level);
  const double width = field_->width(level);
  Vec3i k;
  for (int a = 0; a < 3; ++a) k[a] = std::clamp(cell_of(position_[a] / width + 0.5, ray_.direction[a]) - 1, -1, cells[a] - 1);
  return k;
}

double RayFront::find_exit() {
  double exit = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 3; ++a) {
    if (ray_.direction[a] == 0) continue;
    const double t = ((ray_.direction[a] > 0 ? upper_[a] : lower_[a]) - ray_.origin[a]) * inverse_[a];
    if (t < exit) {
      exit = t;
      exit_axis_ = a;
    }
  }
  return std::max(exit, t_);
}

bool RayFront::advance(double exit) {
  t_ = exit;
  for (int a = 0; a < 3; ++a) {
    const double d = ray_.direction[a];
    const double x = ray_.origin[a] + t_ * d;
    if (d > 0) position_[a] = std::min(std::max(position_[a], x), upper_[a]);
    if (d < 0) position_[a] = std::max(std::min(position_[a], x), lower_[a]);
  }
  const bool up = ray_.direction[exit_axis_] > 0;
  position_[exit_axis_] = up ? upper_[exit_axis_] : lower_[exit_axis_];
  return up ? position_[exit_axis_] < domain_[exit_axis_] : position_[exit_axis_] > 0;
}

Cubic RayFront::rise_along(const Trilinear& f, const Vec3d& lower, double width, double from, double to) const {
  const Vec3d q = (ray_.origin + from * ray_.direction - lower) / width;
  const Vec3d d = (to - from) / width * ray_.direction;
  const auto& a = f.coefficients;
  // f = A + B y + C z + D yz, each of the four linear in s through x = q.x + s d.x
  const double a0 = a[1] * q.x, a1 = a[1] * d.x;
  const double b0 = a[2] + a[3] * q.x, b1 = a[3] * d.x;
  const double c0 = a[4] + a[5] * q.x, c1 = a[5] * d.x;
  const double d0 = a[6] + a[7] * q.x, d1 = a[7] * d.x;
  const double yz0 = q.y * q.z, yz1 = q.y * d.z + d.y * q.z, yz2 = d.y * d.z;
  return {{a0 + b0 * q.y + c0 * q.z + d0 * yz0,                                   //
           a1 + b0 * d.y + b1 * q.y + c0 * d.z + c1 * q.z + d0 * yz1 + d1 * yz0,  //
           b1 * d.y + c1 * d.z + d0 * yz2 + d1 * yz1,                             //
           d1 * yz2}};
}

}  // namespace amrtex
