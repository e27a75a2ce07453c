// Ambient occlusion of isosurfaces: closed forms, the double reference. Every encoding with every filter.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/scene/scene_settings.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 8;

/// White surfaces without other shading: a pixel's red is the open share.
Scene open_scene(const View& view, double isovalue, double radius, int rays = 256) {
  Scene scene = small_scene(Mode::iso, view, Sampling::adaptive, kPixels);
  scene.settings.step = 0.5;
  Isosurfaces& iso = scene.settings.isosurfaces;
  iso.values = {isovalue};
  iso.color = {{0, Vec3d(1)}};
  iso.shading = Shading::none;
  iso.ambient_occlusion = AmbientOcclusion{rays, radius, 3};
  return scene;
}

TEST(Occlusion, LeavesAPlaneItsLight) {
  const auto height = [](const Vec3d& p) { return p.z; };
  for (const AmrHierarchy& h :
       {MeshBuilder(Vec3i(16)).root(height).hierarchy(), MeshBuilder(Vec3i(8), {2}).root(height).hierarchy()})
    for_each_filter([&](const EncodingCase& c) {
      const EncodedField field = build(h, c);
      for (const Vec3d& direction : {Vec3d(0.4, 0.3, -1), Vec3d(0.4, 0.3, 1)}) {  // both sides
        const Scene scene = open_scene(orthographic(Vec3d(0.5), direction, 0.6), 0.5, 0.4);
        const Picture picture = render_on_cpu(h, field, scene, true);
        for (const double v : picture.values) EXPECT_EQ(v, 1);
      }
    });
}

/// Share of the cosine-weighted hemisphere over a floor at the distance d from a wall that meets no wall within `radius`:
/// 1 - (arccos s - s sqrt(1 - s^2)) / pi with s = d / radius. Evenly spread over the unit disk, those rays lie beyond x = s.
double beside_a_wall(double d, double radius) {
  const double s = std::min(d / radius, 1.0);
  return 1 - (std::acos(s) - s * std::sqrt(1 - s * s)) / std::acos(-1.0);
}

constexpr double kFloor = 0.25;
constexpr double kWall = 0.28;
/// Above 0 over the floor z = kFloor and before the wall x = kWall.
double corner(const Vec3d& p) { return std::min(p.z - kFloor, p.x - kWall); }

TEST(Occlusion, BesideAWallIsTheClosedForm) {
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root(corner).hierarchy();
  const double radius = 0.3;
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;  // its walls are faces of cells, up to half a cell away
    const EncodedField field = build(h, c);
    const Scene scene = open_scene(orthographic({kWall + 0.2, 0.5, kFloor}, {-0.2, 0, -1}, 0.24), 0, radius);
    const auto check = [&](const Picture& picture) {
      double least = 1;
      for (int y = 0; y < kPixels; ++y)
        for (int x = 0; x < kPixels; ++x) {
          const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
          const Vec3d hit = ray.origin + ray.direction * ((kFloor - ray.origin.z) / ray.direction.z);
          EXPECT_NEAR(picture.pixel(x, y)[0], beside_a_wall(hit.x - kWall, radius), 2e-2);
          least = std::min(least, picture.pixel(x, y)[0]);
        }
      EXPECT_LT(least, 0.8);
    };
    check(render_on_cpu(h, field, scene, true));
    check(HierarchyReference(h, 0, field.definition).render(scene, 0.5));
  });
}

TEST(Occlusion, IsNoneWhereAPlaneCutsTheWallAway) {
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root(corner).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    Scene scene = open_scene(orthographic({kWall + 0.2, 0.5, kFloor}, {-0.2, 0, -1}, 0.24), 0, 0.3, 64);
    scene.settings.clip_planes = {{{1, 0, 0}, kWall + 0.06}};
    for (const double v : render_on_cpu(h, build(h, c), scene, true).values) EXPECT_EQ(v, 1);
  });
}

TEST(Occlusion, InsideOfASphereIsAllAndOutsideNone) {
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root([](const Vec3d& p) { return glm::length(p - Vec3d(0.5)); }).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;  // of which stairs are left
    const EncodedField field = build(h, c);
    const auto mean_share = [&](const View& view, double radius) {
      const Picture picture = render_on_cpu(h, field, open_scene(view, 0.3, radius, 64), true);
      double sum = 0;
      for (int i = 0; i < kPixels * kPixels; ++i) {
        EXPECT_EQ(picture.pixel(i % kPixels, i / kPixels)[3], 1) << "a surface all over the picture";
        sum += picture.pixel(i % kPixels, i / kPixels)[0];
      }
      return sum / (kPixels * kPixels);
    };
    EXPECT_LE(mean_share(perspective(Vec3d(0.5), {0.9, 0.7, 0.6}), 1), 0.05);
    EXPECT_GE(mean_share(orthographic(Vec3d(0.5), {-1, 0.7, 0.4}, 0.3), 1), 0.95);
    // inside a chord is 2 r cos: with R = r those with cos > 1/2 are open, a share of sin^2(60 degrees) = 3/4
    EXPECT_NEAR(mean_share(perspective(Vec3d(0.5), {0.9, 0.7, 0.6}), 0.3), 0.75, 0.04);
  });
}

// ---- against none, the reference and GL ----

Scene wave_scene(Mode mode, std::optional<double> radius, int rays = 64) {
  Scene scene = open_scene(perspective({2.2, -1.4, 1.6}, Vec3d(0.5)), 0.5, radius.value_or(1), rays);
  scene.settings.mode = mode;
  scene.settings.isosurfaces.values = {0.45, 0.6};
  scene.settings.isosurfaces.opacity = {0.6, 0.8};
  scene.settings.isosurfaces.shading = Shading::gradient;
  scene.transfer_function = peaks();
  if (!radius) scene.settings.isosurfaces.ambient_occlusion.reset();
  return scene;
}

TEST(Occlusion, WithinNoDistanceChangesNothingButAtJumps) {
  // f jumps where levels meet and at faces of nearest: there a ray may begin behind the surface, in a pixel or two
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : {Mode::iso, Mode::dvr_iso}) {
      const Picture picture = render_on_cpu(h, field, wave_scene(mode, 1e-7), false);
      const Picture plain = render_on_cpu(h, field, wave_scene(mode, std::nullopt), false);
      int off = 0;
      for (int i = 0; i < kPixels * kPixels; ++i)
        off += picture.pixel(i % kPixels, i / kPixels)[1] != plain.pixel(i % kPixels, i / kPixels)[1] ? 1 : 0;
      EXPECT_LE(off, 3);
    }
  });
}

/// Pixels whose colour differs by more than `bound`.
int pixels_off(const Picture& a, const Picture& b, double bound) {
  int off = 0;
  for (int i = 0; i < kPixels * kPixels; ++i)
    off += std::abs(a.pixel(i % kPixels, i / kPixels)[1] - b.pixel(i % kPixels, i / kPixels)[1]) > bound ? 1 : 0;
  return off;
}

TEST(Occlusion, ConvergesToTheReferenceInEveryFilter) {
  // a ray that grazes a surface meets it or does not, which is a whole pixel of 64; others have the error of 256 rays
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for_each_filter([&](const EncodingCase& c) {
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      for (const Mode mode : {Mode::iso, Mode::dvr_iso}) {
        SCOPED_TRACE(mode_name(mode));
        Scene scene = wave_scene(mode, 0.3, 256);
        scene.settings.step = 0.1;
        scene.settings.isosurfaces.shading = Shading::none;
        const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.5);
        const int off = pixels_off(render_on_cpu(h, field, scene, true), reference, 0.06);
        EXPECT_LE(off, 5);
        scene.settings.isosurfaces.ambient_occlusion.reset();
        EXPECT_GE(pixels_off(render_on_cpu(h, field, scene, true), reference, 0.06), std::max(8, 3 * off)) << "control: off";
      }
    });
}

TEST(Occlusion, IsTheSameOnGl) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const Scene scene = wave_scene(Mode::iso, 0.3, 16);
    const Picture on_gl = draw(context(ContextKind::egl), h, field, scene);
    EXPECT_LE(rms_difference(on_gl, render_on_cpu(h, field, scene, true)), 3e-2);
    EXPECT_EQ(on_gl.values, draw(context(ContextKind::egl), h, field, scene).values);
  });
}

// ---- leaving out, and bad input ----

TEST(Occlusion, IsLeftOutOfScenesWithoutIt) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front());
  const auto bound = [&](const Scene& scene) {
    const SceneBindings b = bind_scene(h, field, scene);
    const auto define =
        std::find_if(b.defines.begin(), b.defines.end(), [](const auto& d) { return d.first == "AMRTEX_OCCLUSION"; });
    const bool uniforms =
        std::any_of(b.uniforms.begin(), b.uniforms.end(), [](const auto& u) { return u.name == "u_occlusion_rays"; });
    EXPECT_EQ(uniforms, define->second == 1);
    return define->second;
  };
  EXPECT_EQ(bound(wave_scene(Mode::iso, 0.3)), 1);
  EXPECT_EQ(bound(wave_scene(Mode::iso, std::nullopt)), 0);
  EXPECT_EQ(bound(wave_scene(Mode::dvr, 0.3)), 0) << "no surfaces";
}

TEST(Occlusion, IsRefusedByNameWithWhatIsAccepted) {
  const auto complaint = [](const std::function<void(Isosurfaces&)>& spoil) {
    Scene scene = wave_scene(Mode::iso, 0.3);
    spoil(scene.settings.isosurfaces);
    try {
      validate(scene);
    } catch (const UsageError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  for (const double bad : {0.0, -1.0, kNan, kInf})
    EXPECT_THAT(complaint([&](Isosurfaces& iso) { iso.ambient_occlusion->radius = bad; }),
                AllOf(HasSubstr("'ambient_occlusion'"), HasSubstr("above 0")));
  for (const int bad : {0, 1025})
    EXPECT_THAT(complaint([&](Isosurfaces& iso) { iso.ambient_occlusion->rays = bad; }), HasSubstr("1 to 1024"));
  EXPECT_THAT(complaint([](Isosurfaces& iso) { iso.output = Output::normal; }),
              AllOf(HasSubstr("output color"), HasSubstr("normal")));
  Scene mirrored = wave_scene(Mode::iso, 0.3);
  mirrored.settings.mirror = Mirror{0, true};
  EXPECT_THROW(validate_setting(mirrored, "mirror"), UsageError);
}

}  // namespace
}  // namespace amrtex
