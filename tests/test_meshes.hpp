// Meshes that tests alone need, beside those of bench/verify/meshes.hpp.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "bench/verify/meshes.hpp"
#include "structures/mesh/process_memory.hpp"

namespace amrtex::test {

using namespace verify;

/// Another field, of another range.
inline double slopes(const Vec3d& p) { return -20 + 9 * p.x - 35 * p.y * p.z + 4 * std::cos(9 * p.z + p.x); }

/// Two fields that miss different cells: each alone, both together, in whole blocks of 32 finest cells,
/// in whole pages and here and there; and a hole.
inline MeshBuilder fields_with_gaps() {
  const auto both = [](const Vec3d& p) { return p.x >= 0.75 && p.y >= 0.5 && p.z < 0.5; };
  const auto cell = [](const Vec3d& p) { return Vec3i(p * Vec3d(32, 8, 8)); };
  const Function f = [=](const Vec3d& p) {
    return p.x < 0.5 || both(p) || cell(p) == Vec3i(21, 3, 6) || cell(p) == Vec3i(26, 5, 6) ? kNan : waves(p);
  };
  const Function g = [=](const Vec3d& p) {
    const bool gap = p.x >= 0.5 && p.x < 0.75 && p.y < 0.5;
    return gap || both(p) || cell(p) == Vec3i(9, 3, 3) || cell(p) == Vec3i(26, 5, 6) ? kNan : slopes(p);
  };
  MeshBuilder mesh({32, 8, 8}, {2});
  mesh.patch(0, {{0, 0, 0}, {30, 8, 8}}, f).patch(1, Box{{20, 2, 2}, {28, 6, 7}}.refined(2), f);
  return mesh.also("g", g);
}

/// Holes that are single cells of two levels, beside siblings: a body of which the cells inside are left out.
inline MeshBuilder hole_of_single_cells(const Function& f) {
  MeshBuilder mesh({4, 4, 4}, {2, 2});
  mesh.patch(0, {{0, 0, 0}, {4, 4, 2}}, f).patch(0, {{0, 0, 2}, {4, 2, 3}}, f);
  // of cell (1, 2, 2) of level 0 seven children, of one of these five
  mesh.patch(1, {{2, 4, 4}, {4, 6, 5}}, f).patch(1, {{2, 4, 5}, {4, 5, 6}}, f);
  mesh.patch(2, {{4, 10, 10}, {6, 12, 11}}, f).patch(2, {{4, 10, 11}, {5, 11, 12}}, f);
  return mesh.patch(1, {{5, 5, 5}, {8, 8, 8}}, f);
}

/// Two cells far apart in a domain of 2^29 x 2^20 x 2^29 cells, the second one refined.
inline AmrHierarchy two_cells_far_apart() {
  const Vec3i root(1 << 29, 1 << 20, 1 << 29);
  const Vec3i first(5, 3, 7);
  const Vec3i second = root - Vec3i(9, 1, 1);
  return MeshBuilder(root, {2})
      .patch(0, {first, first + Vec3i(1)}, constant(1))
      .patch(0, {second, second + Vec3i(1)}, constant(kPoison))
      .patch(1, {second * 2, second * 2 + Vec3i(2)}, std::vector<double>{3, 4, 5, 6, 7, 8, 9, 10})
      .hierarchy();
}

/// Most bytes that this process ever held.
inline std::int64_t peak_bytes() { return process_peak_bytes().value(); }

struct NamedMesh {
  std::string name;
  AmrHierarchy hierarchy;
};

inline std::vector<NamedMesh> conformance_meshes() {
  std::vector<NamedMesh> meshes;
  meshes.push_back({"single level, anisotropic", single_level(waves).hierarchy()});
  meshes.push_back({"nested, ratio 2", nested(waves).hierarchy()});
  meshes.push_back({"nested, ratios 4 and 2", nested(waves, {4, 2}).hierarchy()});
  meshes.push_back({"nested, ratios 3 and 2", nested(waves, {3, 2}).hierarchy()});
  meshes.push_back({"jump of two levels", jump_of_two(waves).hierarchy()});
  meshes.push_back({"holes and missing values", holes_and_missing(waves).hierarchy()});
  meshes.push_back({"holes and missing values, ratio 3", holes_and_missing(waves, 3).hierarchy()});
  meshes.push_back({"holes of single cells", hole_of_single_cells(waves).hierarchy()});
  meshes.push_back({"one cell", MeshBuilder({1, 1, 1}).root(constant(0.7)).hierarchy()});
  return meshes;
}

}  // namespace amrtex::test
