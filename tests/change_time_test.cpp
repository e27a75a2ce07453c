// A change of transfer function or isovalues: what is changed, what is uploaded, what is refused.
#include "bench/measure/change_time.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/bindings/scene_needs.hpp"
#include "structures/generators/synthetic.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::Each;
using testing::Gt;
using testing::HasSubstr;
using testing::SizeIs;

Scene blob_scene(Mode mode) {
  Scene scene = small_scene(mode, perspective({2.3, 1.9, 1.5}, Vec3d(0.5)), Sampling::adaptive, 8);
  scene.settings.skip = true;
  scene.transfer_function.extinction = {{0.1, 0}, {0.3, 0}, {0.6, 5}};
  scene.transfer_function.color = {{0.1, {1, 0, 0}}};
  scene.settings.isosurfaces.values = {0.3, 0.5};
  return scene;
}

AmrHierarchy blobs(int levels) {
  Json specification = Json::parse(R"({"field": "blobs", "root": 16, "patch": 4})");
  specification["levels"] = levels;
  return AmrHierarchy(generate_mesh(specification));
}

ChangeTimes changes(const AmrHierarchy& h, const Scene& scene, int times, const char* encoding = "exabricks",
                    Filter filter = Filter::basis) {
  BuildRequest request;
  request.needs = scene_needs(scene, filter, Filtering::hardware);
  request.parameters = complete_parameters(find_encoding(encoding), Json::object());
  request.context = context(ContextKind::egl).info();
  const EncodedField field = find_encoding(encoding).build(h, request);
  const Structure structure(context(ContextKind::egl), field);
  return time_changes(context(ContextKind::egl), h, structure, scene, times);
}

TEST(ChangedScene, HasItsPointsAndIsovaluesMovedByAHundredthOfTheirRange) {
  const Scene changed = changed_scene(blob_scene(Mode::dvr_iso));
  EXPECT_NEAR(changed.transfer_function.extinction[0].value, 0.105, 1e-15);
  EXPECT_NEAR(changed.transfer_function.extinction[2].value, 0.605, 1e-15);
  EXPECT_NEAR(changed.transfer_function.color[0].value, 0.105, 1e-15);
  EXPECT_EQ(changed.transfer_function.extinction[2].extinction, 5);
  EXPECT_NEAR(changed.settings.isosurfaces.values[0], 0.302, 1e-15);
  EXPECT_NEAR(changed.settings.isosurfaces.values[1], 0.502, 1e-15);
  Scene logarithmic = blob_scene(Mode::dvr);
  logarithmic.transfer_function.logarithmic = true;  // log10(0.6 / 0.1) is the range
  EXPECT_NEAR(changed_scene(logarithmic).transfer_function.extinction[0].value, 0.1 * std::pow(6, 0.01), 1e-15);
}

TEST(Change, UploadsTheSameFewBytesWhateverTheMesh) {
  for (const Mode mode : {Mode::dvr, Mode::iso}) {
    Scene scene = blob_scene(mode);
    scene.settings.leap = Leap::off;
    const ChangeTimes coarse = changes(blobs(2), scene, 3), fine = changes(blobs(4), scene, 3);
    EXPECT_THAT(fine.wall_ms, SizeIs(3));
    EXPECT_THAT(fine.wall_ms, Each(Gt(0)));
    EXPECT_EQ(fine.bytes, coarse.bytes);
    EXPECT_GT(fine.bytes, 0);
    EXPECT_LT(fine.bytes, 256);
  }
}

TEST(Change, UploadsHalfAByteALeafCellAtMostForLeaps) {
  for (const int levels : {2, 4}) {
    const AmrHierarchy h = blobs(levels);
    EXPECT_LE(changes(h, blob_scene(Mode::dvr), 1).bytes, 256 + h.leaf_cells() / 2);
  }
}

TEST(Change, OfASceneThatHidesNothingToOneThatDoesIsMeasured) {
  Scene scene = blob_scene(Mode::dvr);
  // blobs are not negative: only the changed scene hides something
  scene.transfer_function.extinction = {{0, 0}, {1, 5}};
  scene.transfer_function.color = {{0, {1, 0, 0}}};
  EXPECT_THAT(changes(blobs(3), scene, 2).wall_ms, SizeIs(2));
}

TEST(Change, IsRefusedWhereTheStructureWouldBeAnother) {
  const auto complaint = [&](const Scene& scene) {
    try {
      changes(blobs(2), scene, 1, "kd_tree", Filter::linear_vertex);
    } catch (const UnsupportedError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  Scene multipass = blob_scene(Mode::dvr);
  multipass.settings.consumer = ConsumerKind::multipass;
  EXPECT_THAT(complaint(multipass), HasSubstr("consumer raycast"));
  Scene pruned = blob_scene(Mode::dvr);
  pruned.settings.prune = true;
  EXPECT_THAT(complaint(pruned), HasSubstr("'prune'"));
  EXPECT_EQ(complaint(blob_scene(Mode::dvr)), "accepted");
}

}  // namespace
}  // namespace amrtex
