#include "renderers/reference/reference_tracer.hpp"

#include <cmath>

namespace amrtex {
namespace {

std::pair<double, double> bounds(const std::array<double, 8>& values) {
  const auto [lower, upper] = std::minmax_element(values.begin(), values.end());
  return {*lower, *upper};
}

/// Integer cell of x >= 0 in units of cells; on a face, the cell that a ray of direction d enters.
int cell_of(double x, double d) {
  const int c = static_cast<int>(x);
  return d < 0 && static_cast<double>(c) == x ? c - 1 : c;
}

}  // namespace

ReferenceTracer::ReferenceTracer(const ReferenceField& field)
    : field_(field), filter_(field.definition().filter), domain_(field.hierarchy().cells(field.hierarchy().finest_level())) {
  if (filter_ == Filter::basis)
    basis_cells_.allocate();
  else
    cells_.allocate();
}

void ReferenceTracer::start(const IndexRay& ray) {
  ray_ = ray;
  t_ = 0;
  position_ = glm::clamp(ray.origin, Vec3d(0), domain_);
  for (int a = 0; a < 3; ++a) inverse_[a] = ray.direction[a] == 0 ? 0 : 1 / ray.direction[a];
  page_ = {};
}

Vec3i ReferenceTracer::finest_cell() const {
  Vec3i cell;
  for (int a = 0; a < 3; ++a) cell[a] = std::clamp(cell_of(position_[a], ray_.direction[a]), 0, static_cast<int>(domain_[a]) - 1);
  return cell;
}

/// Lower one of the two cells, a coordinate, between whose centres the front lies.
Vec3i ReferenceTracer::dual_index(int level) const {
  const Vec3i cells = field_.hierarchy().cells(level);
  const double width = field_.width(level);
  Vec3i k;
  for (int a = 0; a < 3; ++a) k[a] = std::clamp(cell_of(position_[a] / width + 0.5, ray_.direction[a]) - 1, -1, cells[a] - 1);
  return k;
}

void ReferenceTracer::clip(const Vec3d& lower, const Vec3d& upper) {
  lower_ = glm::max(lower_, lower);
  upper_ = glm::min(upper_, upper);
}

void ReferenceTracer::clip_dual(int level, const Vec3i& cell) {
  const double width = field_.width(level);
  clip((Vec3d(cell) + 0.5) * width, (Vec3d(cell) + 1.5) * width);
}

void ReferenceTracer::locate() {
  lower_ = Vec3d(0);
  upper_ = domain_;
  switch (filter_) {
    case Filter::nearest:
      return locate_nearest();
    case Filter::linear_lod:
    case Filter::linear_page:
      return locate_linear();
    case Filter::linear_vertex:
      return locate_vertex();
    case Filter::basis:
      return locate_basis();
  }
}

/// Finds the leaf at the front and clips the piece to it (or to the hole); has it a value?
bool ReferenceTracer::enter_leaf() {
  const Vec3i cell = finest_cell();
  const ReferenceLeaf leaf = field_.find_leaf(cell, leaf_);
  if (leaf.level < 0) {
    clip(field_.empty_box(cell));
    return false;
  }
  leaf_ = leaf;
  clip(Box{leaf.cell, leaf.cell + Vec3i(1)}.refined(field_.width(leaf.level)));
  return !std::isnan(leaf.value);
}

void ReferenceTracer::locate_nearest() { has_value_ = enter_leaf(); }

void ReferenceTracer::locate_linear() {
  int level = 0;
  if (filter_ == Filter::linear_page) {
    const Vec3i cell = finest_cell();
    if (!page_.contains(cell)) {
      page_level_ = field_.page_level(cell);
      page_ = field_.page_box(page_level_, cell);
    }
    level = page_level_;
    clip(page_);
    has_value_ = true;
  } else {
    has_value_ = enter_leaf();
    if (!has_value_) return;
    level = leaf_.level;
  }
  const Vec3i dual = dual_index(level);
  cell_ = &dual_cell(level, dual);
  // between leaves of one level nothing changes at their faces
  if (cell_->all_leaves && filter_ == Filter::linear_lod) {
    lower_ = Vec3d(0);
    upper_ = domain_;
  }
  clip_dual(level, dual);
  if (filter_ == Filter::linear_page && !cell_->all_leaves && field_.has_missing()) has_value_ = enter_leaf();
}

void ReferenceTracer::locate_vertex() {
  has_value_ = enter_leaf();
  if (!has_value_) return;
  Cell& cell = cells_.at(leaf_.level, leaf_.cell);
  if (cell.level != leaf_.level || cell.cell != leaf_.cell) {
    const auto values = field_.leaf_vertices(leaf_, &vertices_);
    const auto [lower, upper] = bounds(values);
    cell = {leaf_.level, leaf_.cell, false, Trilinear::through(values), lower, upper};
  }
  cell_ = &cell;
}

/// From the coarsest level down to the last whose leaves reach the front: between the dual
/// planes of all of these the quotient's two sums are polynomials.
void ReferenceTracer::locate_basis() {
  has_value_ = !field_.has_missing() || enter_leaf();
  basis_.clear();
  if (!has_value_) return;
  for (int level = 0; level < field_.hierarchy().level_count(); ++level) {
    const Vec3i dual = dual_index(level);
    const BasisCell& cell = basis_cell(level, dual);
    clip_dual(level, dual);
    if (cell.any) basis_.push_back(cell);
    if (!cell.finer) break;
  }
}

const ReferenceTracer::Cell& ReferenceTracer::dual_cell(int level, const Vec3i& cell) {
  Cell& entry = cells_.at(level, cell);
  if (entry.level != level || entry.cell != cell) {
    const auto dual = field_.dual_cell(level, cell);
    const auto [lower, upper] = bounds(dual.values);
    entry = {level, cell, dual.all_leaves, Trilinear::through(dual.values), lower, upper};
  }
  return entry;
}

const ReferenceTracer::BasisCell& ReferenceTracer::basis_cell(int level, const Vec3i& cell) {
  BasisCell& entry = basis_cells_.at(level, cell);
  if (entry.level != level || entry.cell != cell) {
    const auto basis = field_.basis_cell(level, cell);
    entry = {level, cell, basis.any, basis.finer, Trilinear::through(basis.values), Trilinear::through(basis.weights)};
    entry.lower = std::numeric_limits<double>::infinity();
    entry.upper = -entry.lower;
    for (std::size_t k = 0; k < 8; ++k) {
      if (basis.weights[k] == 0) continue;
      entry.lower = std::min(entry.lower, basis.values[k]);
      entry.upper = std::max(entry.upper, basis.values[k]);
    }
  }
  return entry;
}

double ReferenceTracer::find_exit() {
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

/// Moves the front onto the exit plane; false at the domain's end. Coordinates never go
/// back, so each call passes at least one plane and rounding cannot trap the ray.
bool ReferenceTracer::advance(double exit) {
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

/// A trilinear function is a cubic along a line.
Cubic ReferenceTracer::along(const Trilinear& f, const Vec3d& lower, double width, double from, double to) const {
  const Vec3d q = (ray_.origin + from * ray_.direction - lower) / width;
  const Vec3d d = (to - from) / width * ray_.direction;
  const auto& a = f.coefficients;
  // f = A + B y + C z + D yz, each of the four linear in s through x = q.x + s d.x
  const double a0 = a[0] + a[1] * q.x, a1 = a[1] * d.x;
  const double b0 = a[2] + a[3] * q.x, b1 = a[3] * d.x;
  const double c0 = a[4] + a[5] * q.x, c1 = a[5] * d.x;
  const double d0 = a[6] + a[7] * q.x, d1 = a[7] * d.x;
  const double yz0 = q.y * q.z, yz1 = q.y * d.z + d.y * q.z, yz2 = d.y * d.z;
  return {{a0 + b0 * q.y + c0 * q.z + d0 * yz0,                                   //
           a1 + b0 * d.y + b1 * q.y + c0 * d.z + c1 * q.z + d0 * yz1 + d1 * yz0,  //
           b1 * d.y + c1 * d.z + d0 * yz2 + d1 * yz1,                             //
           d1 * yz2}};
}

PieceFunction ReferenceTracer::function(double from, double to) const {
  PieceFunction f;
  f.denominator.c[0] = 1;
  if (filter_ == Filter::nearest) {
    f.numerator.c[0] = f.lower = f.upper = leaf_.value;
    return f;
  }
  if (filter_ != Filter::basis) {
    const double width = field_.width(cell_->level);
    const double shift = filter_ == Filter::linear_vertex ? 0 : 0.5;  // vertices, or centres
    f.numerator = along(cell_->f, (Vec3d(cell_->cell) + shift) * width, width, from, to);
    f.lower = cell_->lower;
    f.upper = cell_->upper;
    return f;
  }
  f.rational = true;
  f.denominator.c[0] = 0;
  f.lower = std::numeric_limits<double>::infinity();
  f.upper = -f.lower;
  for (const BasisCell& cell : basis_) {
    const double width = field_.width(cell.level);
    const Vec3d lower = (Vec3d(cell.cell) + 0.5) * width;
    f.numerator += along(cell.numerator, lower, width, from, to);
    f.denominator += along(cell.denominator, lower, width, from, to);
    f.lower = std::min(f.lower, cell.lower);
    f.upper = std::max(f.upper, cell.upper);
  }
  // all hats of one level add up to 1
  f.rational = f.denominator.c[0] != 1 || f.denominator.c[1] != 0 || f.denominator.c[2] != 0 || f.denominator.c[3] != 0;
  return f;
}

}  // namespace amrtex
