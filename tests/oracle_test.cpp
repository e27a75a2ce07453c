// The sample data's oracle, made by another reader altogether, through every encoding on the
// GL context: point samples and axis-parallel line integrals of the filter nearest.
#include <gtest/gtest.h>

#include <fstream>

#include "renderers/consumers/probe.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

const std::string kSample = std::string(AMRTEX_SOURCE_DIR) + "/data/amrex_tiny/";

Json oracle() {
  std::ifstream file(kSample + "oracle.json");
  return Json::parse(file);
}

Structure build(const Encoding& encoding, const AmrHierarchy& mesh, Context& context) {
  BuildRequest request;
  request.needs = {Filter::nearest, Filtering::manual, true};
  request.context = context.info();
  return {context, encoding.build(mesh, request), request};
}

TEST(Oracle, PointSamplesAreThoseOfTheFileRoundedToFloat) {
  const auto context = make_context(ContextKind::egl);
  const AmrHierarchy mesh(read_mesh(kSample + "plt00008"));
  std::vector<FinestPosition> points;
  std::vector<double> values;
  const Json samples = oracle()["point_samples"]["samples"];
  for (const Json& sample : samples) {
    points.push_back(*finest_position(mesh, {sample["p"][0], sample["p"][1], sample["p"][2]}));
    values.push_back(sample["value"]);
  }
  ASSERT_FALSE(points.empty());
  for (const Encoding* encoding : all_encodings()) {
    const Structure structure = build(*encoding, mesh, *context);
    const auto found = probe_on_gl(*context, mesh, structure, points);
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_EQ(found[i].value, static_cast<double>(static_cast<float>(values[i]))) << encoding->name() << ", point " << i;
  }
}

/// One pixel that looks along an axis through the given point of the other two.
Scene along(int axis, const Vec3d& through) {
  Scene scene;
  Vec3d forward{0};
  forward[axis] = 1;
  scene.view.eye = through - forward * (through[axis] + 1);
  scene.view.at = scene.view.eye + forward;
  scene.view.up = axis == 2 ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  scene.view.orthographic = true;
  scene.view.height = 1e-6;
  scene.settings.mode = Mode::projection;
  scene.settings.sampling = Sampling::lattice;
  scene.settings.step = 0.5;
  scene.settings.width = 1;
  scene.settings.height = 1;
  return scene;
}

// the domain and all faces lie on multiples of the step, so the rule is exact for `nearest`:
// what is left are 128 roundings of a compensated float sum
TEST(Oracle, LineIntegralsHoldThroughProjection) {
  const auto context = make_context(ContextKind::egl);
  const AmrHierarchy mesh(read_mesh(kSample + "plt00008"));
  const Json rays = oracle()["ortho_rays"]["rays"];
  ASSERT_FALSE(rays.empty());
  for (const Encoding* encoding : all_encodings()) {
    const Structure structure = build(*encoding, mesh, *context);
    for (const Json& ray : rays) {
      const int axis = ray["axis"].get<std::string>()[0] - 'x';
      Vec3d through{0};
      for (int k = 0; k < 3; ++k)
        if (k != axis) through[k] = ray["through"][static_cast<std::size_t>(k)];
      Raycaster raycaster(*context, mesh, structure, along(axis, through));
      raycaster.draw();
      const double expected = ray["sum_value_dx"];
      EXPECT_NEAR(raycaster.read().values[0], expected, 2e-6 * expected) << encoding->name() << ", " << ray.dump();
    }
  }
}

}  // namespace
}  // namespace amrtex
