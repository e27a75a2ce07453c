#include "renderers/reference/trilinear.hpp"

namespace amrtex {

Trilinear Trilinear::through(const std::array<double, 8>& corners) {
  Trilinear f{corners};
  for (int bit = 1; bit < 8; bit *= 2)
    for (int k = 0; k < 8; ++k)
      if ((k & bit) != 0) f.coefficients[static_cast<std::size_t>(k)] -= f.coefficients[static_cast<std::size_t>(k ^ bit)];
  return f;
}

double Trilinear::operator()(const Vec3d& q) const {
  const auto& a = coefficients;
  return a[0] + a[1] * q.x + (a[2] + a[3] * q.x) * q.y + (a[4] + a[5] * q.x + (a[6] + a[7] * q.x) * q.y) * q.z;
}

void Slope::add(const Trilinear& f, const Vec3d& q, int width) {
  value += f(q);
  for (int a = 0; a < 3; ++a) {
    Vec3d low = q, high = q;
    low[a] = 0;
    high[a] = 1;
    derivative[a] += (f(high) - f(low)) / width;
  }
}

DualPlace dual_place(const FinestPosition& p, int width) {
  DualPlace place{p.cell / width, place_in_cell(p, width)};
  for (int a = 0; a < 3; ++a) {
    const bool below = place.q[a] < 0.5;
    place.lower[a] -= below ? 1 : 0;
    place.q[a] += below ? 0.5 : -0.5;
  }
  return place;
}

}  // namespace amrtex
