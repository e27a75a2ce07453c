// Hand-made meshes: small, and together with everything that is legal. Tests use them too.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex::verify {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInf = std::numeric_limits<double>::infinity();
using Function = std::function<double(const Vec3d&)>;  // of a cell's centre, world

/// What a file stores under finer patches must not matter.
inline constexpr double kPoison = 1e30;

inline Function constant(double value) {
  return [value](const Vec3d&) { return value; };
}
/// Values around 0.5 without symmetry, of a scale of their own along each axis (unit cube).
inline double waves(const Vec3d& p) {
  return 0.5 + 0.3 * std::sin(7 * p.x + 1) * std::cos(5 * p.y) + 0.2 * p.z * std::sin(11 * p.x + 3 * p.z);
}

/// A mesh as a chain of calls, ended by hierarchy().
class MeshBuilder {
 public:
  explicit MeshBuilder(const Vec3i& root, std::vector<int> ratios = {}, const Vec3d& lower = Vec3d(0),
                       const Vec3d& upper = Vec3d(1)) {
    mesh_.name = "hand-made";
    mesh_.domain_lower = lower;
    mesh_.domain_upper = upper;
    mesh_.root_cells = root;
    mesh_.levels.resize(ratios.size() + 1);
    mesh_.ratios = std::move(ratios);
    mesh_.fields = {"f"};
  }

  MeshBuilder& patch(int level, const Box& box, const Function& f) {
    std::vector<double> values;
    for_each_cell(box, [&](const Vec3i& c) { values.push_back(f(centre(level, c))); });
    return patch(level, box, values);
  }
  /// Values as given, x fastest.
  MeshBuilder& patch(int level, const Box& box, const std::vector<double>& values) {
    mesh_.levels[static_cast<std::size_t>(level)].push_back({box, {CellValues(values)}});
    return *this;
  }
  /// A further field over the patches so far.
  MeshBuilder& also(const std::string& name, const Function& f) {
    mesh_.fields.push_back(name);
    for (std::size_t level = 0; level < mesh_.levels.size(); ++level)
      for (Patch& patch : mesh_.levels[level]) {
        std::vector<double> values;
        for_each_cell(patch.box, [&](const Vec3i& c) { values.push_back(f(centre(static_cast<int>(level), c))); });
        patch.values.emplace_back(values);
      }
    return *this;
  }
  /// One patch over the whole of level 0.
  MeshBuilder& root(const Function& f) { return patch(0, {Vec3i(0), mesh_.root_cells}, f); }

  Vec3d centre(int level, const Vec3i& cell) const {
    Vec3d cells(mesh_.root_cells);
    for (int l = 0; l < level; ++l) cells *= mesh_.ratios[static_cast<std::size_t>(l)];
    return mesh_.domain_lower + (Vec3d(cell) + 0.5) / cells * (mesh_.domain_upper - mesh_.domain_lower);
  }
  const MeshDescription& description() const { return mesh_; }
  AmrHierarchy hierarchy() const { return AmrHierarchy(mesh_); }

 private:
  MeshDescription mesh_;
};

/// One level of anisotropic cells; no edge is a multiple of a page's.
inline MeshBuilder single_level(const Function& f) { return MeshBuilder({9, 8, 11}, {}, {-1, 0, 2}, {1, 1, 2.5}).root(f); }

/// Levels 0 to 2; faces between all of them, poison under finer patches.
inline MeshBuilder nested(const Function& f, const std::vector<int>& ratios = {2, 2}) {
  const Box middle{{2, 3, 2}, {5, 5, 6}};
  MeshBuilder mesh({8, 7, 8}, ratios);
  mesh.root([&](const Vec3d& p) { return middle.contains(Vec3i(p * Vec3d(8, 7, 8))) ? kPoison : f(p); });
  const Box inner = Box{{2, 3, 3}, {4, 4, 5}}.refined(ratios[0]);  // touches the middle's lower faces
  mesh.patch(1, middle.refined(ratios[0]), [&](const Vec3d& p) {
    return inner.contains(Vec3i(p * Vec3d(8, 7, 8) * static_cast<double>(ratios[0]))) ? -kPoison : f(p);
  });
  return mesh.patch(2, inner.refined(ratios[1]), f);
}

/// Leaves of level 2 beside leaves of level 0; level 1 is empty.
inline MeshBuilder jump_of_two(const Function& f) {
  return MeshBuilder({5, 4, 4}, {2, 2}).root(f).patch(2, {{4, 4, 4}, {12, 8, 16}}, f);
}

/// Holes of one and of many cells, NaN and infinite leaves on two levels, a fine patch in a hole.
inline MeshBuilder holes_and_missing(const Function& f, int ratio = 2) {
  MeshBuilder mesh({8, 8, 8}, {ratio});
  const auto with_gaps = [&](const Vec3d& p) {
    const Vec3i c(p * 8.0);
    if (c == Vec3i(3, 3, 3) || c == Vec3i(4, 3, 3)) return kNan;
    if (c == Vec3i(1, 5, 2)) return -kInf;
    return f(p);
  };
  mesh.patch(0, {{0, 0, 0}, {8, 8, 4}}, with_gaps).patch(0, {{0, 0, 4}, {4, 8, 8}}, with_gaps);  // the rest is a hole
  const auto with_nan = [&](const Vec3d& p) {
    return Vec3i(p * (8.0 * ratio)) == Vec3i(3 * ratio, 5 * ratio, ratio) ? kNan : f(p);
  };
  mesh.patch(1, Box{{2, 4, 1}, {4, 7, 3}}.refined(ratio), with_nan);
  return mesh.patch(1, Box{{5, 5, 5}, {7, 7, 8}}.refined(ratio), f);
}

/// 4^3 root cells, or 2^3; each further level refines the middle 2^3 of the 4^3 cells of the one before. Values at random.
inline AmrHierarchy deep_corner(int levels, int root = 4) {
  std::mt19937_64 random(static_cast<std::uint64_t>(levels));
  std::uniform_real_distribution<double> unit(0, 1);
  MeshBuilder mesh(Vec3i(root), std::vector<int>(static_cast<std::size_t>(levels - 1), 2));
  for (int level = 0; level < levels; ++level) {
    const Vec3i middle(root / 2 << level);
    const Vec3i half(std::min(root / 2 << level, 2));
    std::vector<double> values(static_cast<std::size_t>(Box{-half, half}.cells()));
    for (double& v : values) v = unit(random);
    mesh.patch(level, {middle - half, middle + half}, std::move(values));
  }
  return mesh.hierarchy();
}

}  // namespace amrtex::verify
