// What the tests of `kd_tree` share.
#pragma once

#include <span>
#include <string>

#include "structures/generators/random_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/kd_tree/kd_tree.hpp"
#include "tests/leave_out_cases.hpp"

namespace amrtex::test {

inline EncodedField kd_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                             const BuildOptions& options = {}) {
  return build(h, {&find_encoding("kd_tree"), filter, parameters}, options);
}

inline std::span<const Filter> kd_filters() { return find_encoding("kd_tree").filters(); }

/// 16^3 root cells, of which 4^3 in the corner are refined.
inline AmrHierarchy refined_corner() {
  return MeshBuilder(Vec3i(16), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(8)}, waves).hierarchy();
}

/// Two subgrids of level 0 and one of level 1 over both.
inline AmrHierarchy not_nested() {
  return MeshBuilder({16, 8, 8}, {2})
      .patch(0, {{0, 0, 0}, {8, 8, 8}}, waves)
      .patch(0, {{8, 0, 0}, {16, 8, 8}}, waves)
      .patch(1, {{12, 4, 4}, {20, 12, 12}}, waves)
      .hierarchy();
}
/// The whole mesh from an oblique side, values above 1/2 visible.
inline Scene oblique_scene(const AmrHierarchy& h, int width, int height) {
  Scene scene;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  scene.view.eye = middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8);
  scene.view.at = middle;
  scene.transfer_function.extinction = {{0.5, 0}, {1, 20}};
  scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  scene.settings.width = width;
  scene.settings.height = height;
  return scene;
}

/// Small ones: leaves are compared two by two.
inline AmrHierarchy small_random_mesh(std::uint64_t seed) {
  return AmrHierarchy(random_mesh(seed, {.max_finest_cells = 1 << 15}));
}

inline std::string refusal(const AmrHierarchy& h, const BuildRequest& request) {
  try {
    find_encoding("kd_tree").build(h, request);
    return "built";
  } catch (const UsageError& e) {
    return fmt::format("usage: {}", e.what());
  } catch (const UnsupportedError& e) {
    return fmt::format("unsupported: {}", e.what());
  } catch (const BudgetError& e) {
    return fmt::format("budget: {}", e.what());
  }
}

}  // namespace amrtex::test
