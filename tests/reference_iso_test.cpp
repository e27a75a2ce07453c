// The reference's isosurfaces against closed forms: places, normals, light, and what is no hit.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "renderers/reference/hierarchy_reference.hpp"
#include "test_meshes.hpp"

namespace amrtex {
namespace {

using namespace test;

// ---- scenes ----

constexpr int kPixels = 24;

std::vector<FilterDefinition> all_definitions() {
  return {{Filter::nearest},           {Filter::linear_lod},    {Filter::linear_page, 4},
          {Filter::linear_page, 0, 1}, {Filter::linear_vertex}, {Filter::basis}};
}
std::string text(const FilterDefinition& d) { return fmt::format("{} {} {}", filter_name(d.filter), d.page_size, d.page_level); }

/// One ray through p: orthographic, its picture plane `distance` before p.
Scene one_ray(const Vec3d& p, const Vec3d& direction, std::vector<double> isovalues, Output output = Output::color,
              double distance = 3) {
  Scene scene;
  scene.settings.mode = Mode::iso;
  scene.settings.width = scene.settings.height = 1;
  scene.settings.isosurfaces.values = std::move(isovalues);
  scene.settings.isosurfaces.output = output;
  scene.view.orthographic = true;
  scene.view.eye = p - glm::normalize(direction) * distance;
  scene.view.at = p;
  scene.view.up = std::abs(direction.z) > 0.9 * glm::length(direction) ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  return scene;
}

/// A perspective picture of the unit cube from outside.
Scene picture_of(std::vector<double> isovalues, Output output, const Vec3d& eye = {2.6, 1.9, 1.4}) {
  Scene scene = one_ray(Vec3d(0.5), Vec3d(0.5) - eye, std::move(isovalues), output);
  scene.settings.width = scene.settings.height = kPixels;
  scene.view.orthographic = false;
  scene.view.eye = eye;
  scene.view.fov_y = 22;
  return scene;
}

std::vector<double> draw(const AmrHierarchy& h, const FilterDefinition& d, const Scene& scene) {
  return HierarchyReference(h, 0, d).render(scene, 1.0 / 16).values;
}

/// World distance to the first surface; 0 where there is none.
double depth(const AmrHierarchy& h, const FilterDefinition& d, Scene scene) {
  scene.settings.isosurfaces.output = Output::depth;
  return draw(h, d, scene)[0];
}

/// How many surfaces a ray meets: each lets half of the light through.
double surfaces_met(const AmrHierarchy& h, const FilterDefinition& d, Scene scene) {
  scene.settings.isosurfaces.opacity.assign(scene.settings.isosurfaces.values.size(), 0.5);
  scene.settings.isosurfaces.output = Output::color;
  return -std::log2(1 - draw(h, d, scene)[3]);
}

/// Calls f(ray, pixel) for all pixels of a picture.
template <class F>
void for_each_pixel(const Picture& picture, const Scene& scene, F&& f) {
  const CameraFrame camera = camera_frame(scene.view, picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) f(camera_ray(camera, x, y, picture.width, picture.height), picture.pixel(x, y));
}

AmrHierarchy uniform(int n, const Function& f) { return MeshBuilder(Vec3i(n)).root(f).hierarchy(); }

/// Cells in a row along x over the unit cube.
AmrHierarchy row(const std::vector<double>& values) {
  const int n = static_cast<int>(values.size());
  MeshBuilder mesh({n, 1, 1});
  for (int i = 0; i < n; ++i)  // a NaN here is a hole, not a cell
    if (!std::isnan(values[static_cast<std::size_t>(i)]))
      mesh.patch(0, {{i, 0, 0}, {i + 1, 1, 1}}, constant(values[static_cast<std::size_t>(i)]));
  return mesh.hierarchy();
}
Scene along_row(std::vector<double> isovalues, double direction = 1) {
  return one_ray(Vec3d(0.5), {direction, 0, 0}, std::move(isovalues));
}

/// The same mesh with a second field "g".
AmrHierarchy with_second_field(const MeshBuilder& builder, const Function& g) {
  MeshDescription mesh = builder.description();
  mesh.fields.push_back("g");
  for (std::size_t level = 0; level < mesh.levels.size(); ++level)
    for (Patch& patch : mesh.levels[level]) {
      std::vector<double> values;
      for_each_cell(patch.box, [&](const Vec3i& c) { values.push_back(g(builder.centre(static_cast<int>(level), c))); });
      patch.values.emplace_back(values);
    }
  return AmrHierarchy(std::move(mesh));
}

const Vec3d kSlope(2, -3, 0.5);
double plane(const Vec3d& p) { return 1 + glm::dot(kSlope, p); }

// ---- places and normals ----

TEST(ReferenceIso, LinearFieldIsAPlaneWithOneNormal) {
  // f = 1 + g p: the ray o + t d meets f = v at t = (v - f(o)) / (g d), where the normal is g / |g|
  const AmrHierarchy h = uniform(16, plane);
  const double v = 0.8;
  const std::array<Vec3d, 2> inner{Vec3d(2.0 / 16), Vec3d(14.0 / 16)};  // no value here depends on the domain's border
  for (const auto& definition : all_definitions()) {
    if (definition.filter == Filter::nearest || definition.page_level > 0) continue;
    Scene scene = picture_of({v}, Output::depth, {2, -1.4, 1.6});
    scene.region = inner;
    const Picture depths = HierarchyReference(h, 0, definition).render(scene, 1);
    scene.settings.isosurfaces.output = Output::normal;
    const Picture normals = HierarchyReference(h, 0, definition).render(scene, 1);
    ASSERT_EQ(depths.channels, 1);
    ASSERT_EQ(normals.channels, 4);
    int hits = 0;
    const double* normal = normals.values.data();
    for_each_pixel(depths, scene, [&](const WorldRay& ray, const double* pixel) {
      const double t = (v - plane(ray.origin)) / glm::dot(kSlope, ray.direction);
      const Vec3d p = ray.origin + t * ray.direction;
      const bool hit = glm::all(glm::greaterThan(p, inner[0])) && glm::all(glm::lessThan(p, inner[1]));
      EXPECT_NEAR(*pixel, hit ? t : 0, 1e-10) << text(definition);
      const Vec3d expected = hit ? glm::normalize(kSlope) : Vec3d(0);
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(normal[a], expected[a], 1e-12) << text(definition);
      EXPECT_EQ(normal[3], hit ? 1 : 0);
      normal += 4;
      hits += hit ? 1 : 0;
    });
    EXPECT_GT(hits, kPixels * kPixels / 10);
  }
}

TEST(ReferenceIso, AnisotropicCellsFarOriginsAndHugeWorlds) {
  // the same plane in the fractions of a box of 3 x 1 x 2 times 1e24, far from the origin
  const double scale = 1e24;
  const Vec3d lower = scale * Vec3d(50, -70, 10), size = scale * Vec3d(3, 1, 2);
  const Function f = [&](const Vec3d& p) { return plane((p - lower) / size); };
  const AmrHierarchy h = MeshBuilder({16, 12, 9}, {}, lower, lower + size).root(f).hierarchy();
  const Vec3d p = lower + size * Vec3d(0.5, 0.45, 0.55);
  const Vec3d normal = glm::normalize(kSlope / (size / scale));
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis})
    for (const Vec3d& direction : {Vec3d(1, 0, 0), Vec3d(0, -1, 0), Vec3d(3, 1, 1)}) {
      Scene scene = one_ray(p, direction, {f(p)}, Output::depth, 7 * scale);
      EXPECT_NEAR(draw(h, {filter}, scene)[0] / scale, 7, 1e-10);
      scene.settings.isosurfaces.output = Output::normal;
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(draw(h, {filter}, scene)[static_cast<std::size_t>(a)], normal[a], 1e-10);
    }
}

TEST(ReferenceIso, DepthCountsFromTheEyeAlsoInsideTheMesh) {
  const AmrHierarchy h = uniform(16, [](const Vec3d& p) { return p.x; });
  Scene scene = one_ray({0.5, 0.5, 0.5}, {1, 0, 0}, {0.7}, Output::depth, 0.25);
  EXPECT_NEAR(draw(h, {Filter::linear_vertex}, scene)[0], 0.45, 1e-14);
  scene.view.orthographic = false;
  EXPECT_NEAR(draw(h, {Filter::linear_vertex}, scene)[0], 0.45, 1e-14);
  scene.settings.isosurfaces.values = {0.1};
  EXPECT_EQ(draw(h, {Filter::linear_vertex}, scene)[0], 0) << "behind the eye";
}

struct Errors {
  double depth = 0, normal = 0;
};

/// Largest errors on the sphere of radius 0.3 round the middle, away from its silhouette.
Errors sphere_errors(const AmrHierarchy& h, const FilterDefinition& definition, double isovalue) {
  const double radius = 0.3;
  Scene scene = picture_of({isovalue}, Output::depth);
  const Picture depths = HierarchyReference(h, 0, definition).render(scene, 1);
  scene.settings.isosurfaces.output = Output::normal;
  const Picture normals = HierarchyReference(h, 0, definition).render(scene, 1);
  Errors errors;
  const double* normal = normals.values.data();
  for_each_pixel(depths, scene, [&](const WorldRay& ray, const double* pixel) {
    const Vec3d o = ray.origin - Vec3d(0.5);
    const double b = glm::dot(o, ray.direction);
    const double square = b * b - glm::dot(o, o) + radius * radius;
    if (square > 0.25 * radius * radius) {
      const double t = -b - std::sqrt(square);
      const Vec3d outward = (o + t * ray.direction) / radius;
      errors.depth = std::max(errors.depth, std::abs(*pixel - t));
      errors.normal = std::max(errors.normal, glm::length(Vec3d(normal[0], normal[1], normal[2]) + outward));
    }
    normal += 4;
  });
  return errors;
}

TEST(ReferenceIso, SphereIsFoundWithOrderTwo) {
  // a Gaussian of standard deviation 0.3: at radius 0.3 it is e^(-1/2), and it falls outwards
  const auto gauss = [](const Vec3d& p) { return std::exp(-glm::dot(p - Vec3d(0.5), p - Vec3d(0.5)) / (2 * 0.09)); };
  const double isovalue = std::exp(-0.5);
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis}) {
    const Errors coarse = sphere_errors(uniform(24, gauss), {filter}, isovalue);
    const Errors fine = sphere_errors(uniform(48, gauss), {filter}, isovalue);
    EXPECT_LT(coarse.depth, 0.01);
    EXPECT_GT(coarse.depth / fine.depth, 3.3) << filter_name(filter);
    EXPECT_LT(coarse.normal, 0.05);
    EXPECT_GT(coarse.normal / fine.normal, 1.8) << filter_name(filter);
  }
}

TEST(ReferenceIso, ShellIsMetOnEachOfItsFourSides) {
  // exp(-((r - R) / w)^2 / 2) = v at r = R -+ w sqrt(-2 ln v)
  const double radius = 0.3, width = 0.05, v = 0.6;
  const double half = width * std::sqrt(-2 * std::log(v));
  const AmrHierarchy h =
      uniform(96, [&](const Vec3d& p) { return std::exp(-std::pow((glm::length(p - Vec3d(0.5)) - radius) / width, 2) / 2); });
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis})
    for (const double y : {0.0, 0.1, 0.2, 0.31}) {
      const Scene scene = one_ray({0.5, 0.5 + y, 0.5}, {1, 0, 0}, {v});
      EXPECT_NEAR(surfaces_met(h, {filter}, scene), y < radius - half ? 4 : 2, 1e-12);
      EXPECT_NEAR(depth(h, {filter}, scene), 3 - std::sqrt((radius + half) * (radius + half) - y * y), 2e-3);
    }
}

TEST(ReferenceIso, ThreeHitsInOnePiece) {
  // (x - a)(y - b)(z - c) is trilinear; on the diagonal it is a cubic with the roots a, b and c
  const Vec3d root(0.58, 0.4, 0.47);
  const AmrHierarchy h = uniform(2, [&](const Vec3d& p) { return (p.x - root.x) * (p.y - root.y) * (p.z - root.z); });
  for (const Filter filter : {Filter::linear_lod, Filter::basis}) {
    Scene scene = one_ray(Vec3d(0.5), Vec3d(1), {0});
    scene.region = {Vec3d(0.25), Vec3d(0.75)};  // between the cells' centres
    EXPECT_NEAR(surfaces_met(h, {filter}, scene), 3, 1e-12);
    EXPECT_NEAR(depth(h, {filter}, scene), 3 - 0.1 * std::sqrt(3.0), 1e-14);
    scene.settings.isosurfaces.values = {-1e-6, 0, 1e-6};  // each three times, and in order
    EXPECT_NEAR(surfaces_met(h, {filter}, scene), 9, 1e-12);
  }
}

TEST(ReferenceIso, TorusIsFoundWithOrderTwo) {
  // distance to a ring of radius R round z; the tube of radius r is met in its middle plane at x = -sqrt((R + r)^2 - y^2)
  const double ring = 0.25, tube = 0.1;
  const auto f = [&](const Vec3d& p) {
    const Vec3d d = p - Vec3d(0.5);
    return std::hypot(std::hypot(d.x, d.y) - ring, d.z);
  };
  const auto error = [&](int n, Filter filter) {
    const AmrHierarchy h = uniform(n, f);
    double most = 0;
    for (double y = -0.25; y < 0.3; y += 0.013) {
      const Scene scene = one_ray({0.5, 0.5 + y, 0.5}, {1, 0, 0}, {tube});
      most = std::max(most, std::abs(depth(h, {filter}, scene) - 3 + std::sqrt((ring + tube) * (ring + tube) - y * y)));
      EXPECT_NEAR(surfaces_met(h, {filter}, scene), std::abs(y) < ring - tube ? 4 : 2, 1e-12) << y;
    }
    return most;
  };
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis})
    EXPECT_GT(error(32, filter) / error(64, filter), 3) << filter_name(filter);
}

TEST(ReferenceIso, NearestIsHitOnFacesOfCells) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const Vec3d cells(h.cells(h.finest_level()));
  const HierarchyReference reference(h, 0, {Filter::nearest});
  const double v = 0.55;
  const Scene scene = picture_of({v}, Output::depth);
  int hits = 0;
  for_each_pixel(reference.render(scene, 1), scene, [&](const WorldRay& ray, const double* pixel) {
    if (*pixel == 0) return;
    ++hits;
    const Vec3d p = (ray.origin + *pixel * ray.direction) * cells;
    const Vec3d off = glm::abs(p - glm::round(p));
    EXPECT_LT(std::min({off.x, off.y, off.z}), 1e-10);
    const double before = reference.sample(ray.origin + (*pixel - 1e-9) * ray.direction).value();
    const double behind = reference.sample(ray.origin + (*pixel + 1e-9) * ray.direction).value();
    EXPECT_NE(before >= v, behind >= v);
  });
  EXPECT_GT(hits, kPixels * kPixels / 10);
}

TEST(ReferenceIso, GradientOfNearestIsTheFacesNormal) {
  // a hit on the face between a coarse and a fine half: the same difference whichever is where, and whichever way the ray goes
  for (const bool fine_above : {true, false}) {
    MeshBuilder mesh({4, 4, 4}, {2});
    mesh.root([](const Vec3d& p) { return p.x < 0.5 ? 1.0 + p.x : 5.0 + p.x; });
    mesh.patch(1, fine_above ? Box{{4, 0, 0}, {8, 8, 8}} : Box{{0, 0, 0}, {4, 8, 8}},
               [](const Vec3d& p) { return (p.x < 0.5 ? 1.0 + p.x : 5.0 + p.x) + p.y; });
    const AmrHierarchy h = mesh.hierarchy();
    const double width = 1.0 / 8 / 512;
    const HierarchyReference reference(h, 0, {Filter::nearest});
    const Vec3d p(0.5, 0.55, 0.55);
    Vec3d gradient(0);
    for (int a = 0; a < 3; ++a) {
      Vec3d step(0);
      step[a] = width;
      gradient[a] = (reference.sample(p + step).value() - reference.sample(p - step).value()) / (2 * width);
    }
    // oblique rays reach the face by rounded sums, and must still lie on it
    for (int k = 0; k < 40; ++k) {
      const Vec3d direction((k % 2 == 0 ? 1 : -1) * (1 - 0.017 * k), 0.013 * k, -0.007 * k);
      const Scene scene = one_ray(p, direction, {3}, Output::normal, 1.7);
      const auto normal = draw(h, {Filter::nearest}, scene);
      EXPECT_NEAR(depth(h, {Filter::nearest}, scene), 1.7, 1e-14);
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(normal[static_cast<std::size_t>(a)], glm::normalize(gradient)[a], 1e-14);
    }
  }
}

TEST(ReferenceIso, GradientTakesTheLevelOfThePage) {
  // pages of 4^3 cells: that of the cells [0, 4)^3 falls into pages of level 1, also where its leaves are of level 0
  const AmrHierarchy h = MeshBuilder(Vec3i(8), {2}).root(waves).patch(1, {Vec3i(0), Vec3i(4)}, waves).hierarchy();
  const FilterDefinition definition{Filter::linear_page, 4};
  const HierarchyReference reference(h, 0, definition);
  const Vec3d p(0.33, 0.36, 0.4), direction(1, 0.3, -0.2);
  Scene scene = one_ray(p, direction, {reference.sample(p).value()}, Output::normal);
  scene.region = {p - Vec3d(1e-3), p + Vec3d(1e-3)};
  Vec3d gradient(0);
  for (int a = 0; a < 3; ++a) {
    Vec3d step(0);
    step[a] = 1.0 / 16;
    gradient[a] = reference.sample(p + step).value() - reference.sample(p - step).value();
  }
  const auto normal = draw(h, definition, scene);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(normal[static_cast<std::size_t>(a)], glm::normalize(gradient)[a], 1e-9);
}

TEST(ReferenceIso, GradientAtBordersAndHolesIsOneSided) {
  // f = x + y, linear between centres: one cell thick along z (both sides missing: 0), p.y - h outside, p.x + h in a hole
  MeshBuilder mesh({8, 2, 1});
  mesh.patch(0, {{0, 0, 0}, {4, 2, 1}}, [](const Vec3d& p) { return p.x + p.y; });
  const AmrHierarchy h = mesh.hierarchy();
  // beyond the last centre, 7/16 and 3/4, f is clamped: (7/16 - 0.325) / h along x, (3/4 - 0.3) / h along y, both 0.9
  const auto normal = draw(h, {Filter::linear_lod}, one_ray({0.45, 0.3, 0.5}, {0, 1, 0}, {0.4375 + 0.3}, Output::normal));
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(normal[static_cast<std::size_t>(a)], a < 2 ? std::sqrt(0.5) : 0, 1e-14);
}

// ---- light ----

TEST(ReferenceIso, TransparentSurfacesCompositeFrontToBack) {
  // f = x: C = a1 c1 + (1 - a1) a2 c2 with the surfaces in the ray's order, A = 1 - (1 - a1)(1 - a2)
  const AmrHierarchy h = uniform(16, [](const Vec3d& p) { return p.x; });
  const Vec3d c1(1, 0.2, 0), c2(0, 0.4, 0.9);
  const double a1 = 0.3, a2 = 0.6;
  for (const Filter filter : {Filter::nearest, Filter::linear_lod, Filter::linear_vertex, Filter::basis})
    for (const bool forward : {true, false})
      for (const Shading shading : {Shading::none, Shading::gradient})
        for (const Vec3d& axis : {Vec3d(1, 0, 0), Vec3d(2, 1, 0)}) {
          Scene scene = one_ray(Vec3d(0.5), forward ? axis : -axis, {0.3, 0.6});
          scene.settings.isosurfaces.opacity = {a1, a2};
          scene.settings.isosurfaces.color = {{0.3, c1}, {0.6, c2}};
          scene.settings.isosurfaces.shading = shading;
          const double light = shading == Shading::none ? 1 : surface_light(axis.x / glm::length(axis));
          const Vec3d c = light * (forward ? a1 * c1 + (1 - a1) * a2 * c2 : a2 * c2 + (1 - a2) * a1 * c1);
          const auto pixel = draw(h, {filter}, scene);
          for (int k = 0; k < 3; ++k) EXPECT_NEAR(pixel[static_cast<std::size_t>(k)], c[k], 1e-14) << filter_name(filter);
          EXPECT_NEAR(pixel[3], 1 - (1 - a1) * (1 - a2), 1e-14);
        }
}

TEST(ReferenceIso, ColorComesFromTheSurfaceOrTheTransferFunction) {
  const AmrHierarchy h = uniform(8, [](const Vec3d& p) { return p.x; });
  Scene scene = one_ray(Vec3d(0.5), {1, 0, 0}, {0.5});
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene)[1], 0.8, 1e-14) << "neither";
  scene.transfer_function.color = {{0, {0, 0, 0}}, {1, {1, 0.5, 0}}};
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene)[1], 0.25, 1e-14);
  scene.settings.isosurfaces.color = {{0, {0, 0.9, 0}}};
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene)[1], 0.9, 1e-14);
  EXPECT_EQ(draw(h, {Filter::linear_lod}, scene)[3], 1);
}

TEST(ReferenceIso, WhereTheGradientIsZeroThereIsNoShade) {
  // linear between centres: f crosses 2 at x = 1/2, where a cell width to either side it is (4 + 1) / 2 = (3 + 2) / 2
  const AmrHierarchy h = row({4, 1, 3, 2});
  Scene scene = one_ray({0.5, 0.5, 0.5}, {1, 0, 0}, {2}, Output::normal);
  scene.region = {Vec3d(0.45, 0, 0), Vec3d(0.55, 1, 1)};
  EXPECT_EQ(draw(h, {Filter::linear_lod}, scene), (std::vector<double>{0, 0, 0, 1}));
  scene.settings.isosurfaces.output = Output::color;
  EXPECT_EQ(draw(h, {Filter::linear_lod}, scene)[0], 0.8) << "light 1";
}

TransferFunction constant_light(double extinction, const Vec3d& rgb) {
  TransferFunction tf;
  tf.extinction = {{0, extinction}};
  tf.color = {{0, rgb}};
  return tf;
}

TEST(ReferenceIso, SurfaceInsideASlab) {
  // constant extinction k: C = (1 - e^(-k L1)) c + e^(-k L1) (a c_s + (1 - a) (1 - e^(-k L2)) c)
  const AmrHierarchy h = nested([](const Vec3d& p) { return p.x; }).hierarchy();
  const Vec3d c(0.8, 0.4, 0.2), cs(0.1, 0.9, 0.3);
  const double k = 3;
  for (const auto& definition : all_definitions())
    for (const double a : {1.0, 0.4})
      for (const double sign : {1.0, -1.0}) {
        Scene scene = one_ray({0.5, 0.55, 0.47}, {sign, 0, 0}, {0.53});
        scene.settings.mode = Mode::dvr_iso;
        scene.transfer_function = constant_light(k, c);
        scene.settings.isosurfaces.opacity = {a};
        scene.settings.isosurfaces.color = {{0, cs}};
        scene.settings.isosurfaces.shading = Shading::none;
        const double l1 = depth(h, definition, scene) - 2.5;
        EXPECT_NEAR(sign > 0 ? l1 : 1 - l1, 0.53, definition.filter == Filter::nearest ? 0.07 : 0.02);
        const double t1 = std::exp(-k * l1), t2 = std::exp(-k * (1 - l1));
        const Vec3d expected = (1 - t1) * c + t1 * (a * cs + (1 - a) * (1 - t2) * c);
        const auto pixel = draw(h, definition, scene);
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(pixel[static_cast<std::size_t>(i)], expected[i], 1e-13) << text(definition);
        EXPECT_NEAR(pixel[3], 1 - (1 - a) * t1 * t2, 1e-13);
      }
}

TEST(ReferenceIso, PiecesAreSplitAtTheirSurfaces) {
  // f = x, extinction m x between x0 and a surface at x1: T = e^(-m (x1^2 - x0^2) / 2), also where x1 lies inside a piece
  const AmrHierarchy h = uniform(4, [](const Vec3d& p) { return p.x; });
  const double m = 5, x0 = 0.125;
  for (const double x1 : {0.2, 0.375, 0.5, 0.61, 0.875}) {
    Scene scene = one_ray({0.5, 0.4, 0.45}, {1, 0, 0}, {x1});
    scene.region = {Vec3d(x0, 0, 0), Vec3d(0.9, 1, 1)};
    scene.settings.mode = Mode::dvr_iso;
    scene.transfer_function.extinction = {{0, 0}, {1, m}};
    scene.transfer_function.color = {{0, {0, 1, 0}}};
    scene.settings.isosurfaces.color = {{0, {1, 0, 0}}};
    const double t = std::exp(-m * (x1 * x1 - x0 * x0) / 2);
    for (const Filter filter : {Filter::linear_lod, Filter::basis}) {
      const auto pixel = draw(h, {filter}, scene);
      EXPECT_NEAR(pixel[0], t, 1e-14);
      EXPECT_NEAR(pixel[1], 1 - t, 1e-14);
    }
  }
}

TEST(ReferenceIso, VolumeBehindAndBesideSurfacesIsThatOfDvr) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Scene scene = picture_of({9}, Output::color);
  scene.transfer_function.extinction = {{0.3, 0}, {0.6, 8}, {0.7, 1}};
  scene.transfer_function.color = {{0.3, {1, 0, 0}}, {0.7, {0, 1, 1}}};
  for (const auto& definition : all_definitions()) {
    scene.settings.mode = Mode::dvr;
    const auto volume = draw(h, definition, scene);
    scene.settings.mode = Mode::dvr_iso;
    EXPECT_EQ(draw(h, definition, scene), volume) << "no surface: the same to the bit, " << text(definition);
    // invisible surfaces split the pieces, and so refine the integral, and change nothing else
    scene.settings.isosurfaces.values = {0.45, 0.55};
    scene.settings.isosurfaces.opacity = {1e-300, 1e-300};
    const auto split = draw(h, definition, scene);
    for (std::size_t i = 0; i < split.size(); ++i) EXPECT_NEAR(split[i], volume[i], 1e-7) << text(definition);
    scene.settings.isosurfaces = {};
    scene.settings.isosurfaces.values = {9};
  }
}

TEST(ReferenceIso, DepthAndNormalKnowNeitherVolumeNorOpacity) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const Output output : {Output::depth, Output::normal}) {
    Scene scene = picture_of({0.5, 0.6}, output);
    const auto alone = draw(h, {Filter::linear_vertex}, scene);
    scene.settings.mode = Mode::dvr_iso;
    scene.transfer_function = constant_light(1e9, Vec3d(1));
    scene.settings.isosurfaces.opacity = {0.1, 0.2};
    EXPECT_EQ(draw(h, {Filter::linear_vertex}, scene), alone);
  }
}

// ---- a second field ----

TEST(ReferenceIso, SecondLinearFieldColorsExactly) {
  // f = x and g = y: the hit lies at p = o + t d with x = v, its colour is that of p.y
  const auto f = [](const Vec3d& p) { return p.x; };
  const AmrHierarchy h = with_second_field(MeshBuilder(Vec3i(16)).root(f), [](const Vec3d& p) { return p.y; });
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis}) {
    const HierarchyReference reference(h, 0, {filter});
    Scene scene = picture_of({0.6}, Output::color);
    scene.region = {Vec3d(0.125), Vec3d(0.875)};
    scene.settings.isosurfaces.color = {{0, {0, 1, 0}}, {1, {1, 0, 0}}};
    scene.settings.isosurfaces.color_field = "g";
    scene.settings.isosurfaces.shading = Shading::none;
    int hits = 0;
    for_each_pixel(reference.render(scene, 1), scene, [&](const WorldRay& ray, const double* pixel) {
      if (pixel[3] == 0) return;
      const double y = (ray.origin + (0.6 - ray.origin.x) / ray.direction.x * ray.direction).y;
      EXPECT_NEAR(pixel[0], y, 1e-12);
      EXPECT_NEAR(pixel[1], 1 - y, 1e-12);
      ++hits;
    });
    EXPECT_GT(hits, kPixels * kPixels / 10);
  }
}

TEST(ReferenceIso, WithoutASecondValueTheIsovalueColors) {
  const AmrHierarchy h = with_second_field(MeshBuilder(Vec3i(8)).root([](const Vec3d& p) { return p.x; }),
                                           [](const Vec3d& p) { return p.y < 0.5 ? kNan : 1.0; });
  Scene scene = one_ray({0.5, 0.7, 0.5}, {1, 0, 0}, {0.4});
  scene.settings.isosurfaces.color = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
  scene.settings.isosurfaces.color_field = "g";
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene)[0], 1, 1e-14);
  scene.view.eye.y = scene.view.at.y = 0.3;
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene)[0], 0.4, 1e-14);
}

TEST(ReferenceIso, RefusesUnknownFieldsAndMissingIsovalues) {
  const AmrHierarchy h = uniform(4, waves);
  Scene scene = one_ray(Vec3d(0.5), {1, 0, 0}, {0.5});
  scene.settings.isosurfaces.color_field = "h";
  for (const Output output : {Output::color, Output::depth}) {
    scene.settings.isosurfaces.output = output;
    EXPECT_THROW(draw(h, {}, scene), UsageError);
  }
  EXPECT_THROW(draw(h, {}, one_ray(Vec3d(0.5), {1, 0, 0}, {})), UsageError);
}

// ---- what is a hit and what is none ----

TEST(ReferenceIso, OutsideOfTheRangeThePictureIsEmpty) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const auto& definition : all_definitions())
    for (const double v : {h.statistics(0).min - 1e-6, h.statistics(0).max + 1e-6, -1e300, 1e300})
      for (const Output output : {Output::color, Output::depth, Output::normal})
        for (const double value : draw(h, definition, picture_of({v}, output))) ASSERT_EQ(value, 0) << text(definition);
}

TEST(ReferenceIso, EnteringLeavingAndHolesAreNoHits) {
  for (const auto& definition : all_definitions()) {
    if (definition.page_level > 0) continue;
    EXPECT_NEAR(surfaces_met(row({1, 1, 3, 3}), definition, along_row({2})), 1, 1e-12) << text(definition);
    EXPECT_EQ(surfaces_met(row({1, 1, kNan, 3, 3}), definition, along_row({2})), 0) << "a hole, " << text(definition);
    EXPECT_EQ(surfaces_met(row({3, 3, 3}), definition, along_row({2})), 0) << text(definition);
    EXPECT_EQ(surfaces_met(row({1, kNan, 1}), definition, along_row({2})), 0) << text(definition);
    Scene scene = along_row({2});
    scene.region = {Vec3d(0.5, 0, 0), Vec3d(1)};  // a face of the drawn box is none either
    EXPECT_EQ(surfaces_met(row({1, 1, 3, 3}), {Filter::nearest}, scene), 0);
  }
  // a NaN cell is a hole, too
  const AmrHierarchy h = MeshBuilder({5, 1, 1}).patch(0, {Vec3i(0), {5, 1, 1}}, {1, 1, kNan, 3, 3}).hierarchy();
  for (const auto& definition : all_definitions())
    if (definition.page_level == 0) {
      EXPECT_EQ(surfaces_met(h, definition, along_row({2})), 0) << text(definition);
    }
}

TEST(ReferenceIso, ToTouchIsNoHit) {
  // f = x y on the diagonal x = 1/2 + s, y = 1/2 - s is 1/4 - s^2
  const AmrHierarchy h = uniform(8, [](const Vec3d& p) { return p.x * p.y; });
  for (const Filter filter : {Filter::linear_lod, Filter::basis}) {
    const auto met = [&](double v) { return surfaces_met(h, {filter}, one_ray({0.5, 0.5, 0.4}, {1, -1, 0}, {v})); };
    EXPECT_EQ(met(0.25), 0);
    EXPECT_NEAR(met(0.25 - 1e-9), 2, 1e-12);
    EXPECT_EQ(met(0.25 + 1e-9), 0);
  }
  // the middle cell's value is reached in its centre alone, between two pieces
  for (const Filter filter : {Filter::linear_lod, Filter::linear_page, Filter::basis})
    for (const double sign : {1.0, -1.0}) {
      EXPECT_EQ(surfaces_met(row({1, 2, 1}), {filter}, along_row({2}, sign)), 0) << "from below";
      EXPECT_EQ(surfaces_met(row({3, 2, 3}), {filter}, along_row({2}, sign)), 0) << "from above";
      EXPECT_NEAR(surfaces_met(row({1, 2, 3}), {filter}, along_row({2}, sign)), 1, 1e-12) << "through";
      EXPECT_NEAR(depth(row({1, 2, 3}), {filter}, along_row({2}, sign)), 3, 1e-14);
      EXPECT_NEAR(surfaces_met(row({1, 2, 1.5}), {filter}, along_row({1.5}, sign)), 1, 1e-12);
    }
}

TEST(ReferenceIso, ToTouchUpToRoundingIsNoHit) {
  // the middle cell's value again, where neither it nor the way there is a binary fraction
  for (const double v : {0.1, 0.3, 0.7, 1e5 / 3, -0.6})
    for (const double sign : {1.0, -1.0})
      for (const double y : {0.01, 0.17, -0.23, 0.31, 0.4}) {
        const AmrHierarchy h = row({v - 1.1, v - 0.3, v - 0.3, v, v - 0.7, v - 0.6, v - 1.3});
        EXPECT_EQ(surfaces_met(h, {Filter::linear_lod}, one_ray(Vec3d(0.5), {sign, y, 0.1}, {v})), 0) << v << " " << y;
      }
}

TEST(ReferenceIso, PlateausAtTheIsovalueAreAbove) {
  for (const Filter filter : {Filter::nearest, Filter::linear_lod, Filter::basis}) {
    EXPECT_NEAR(surfaces_met(row({1, 2, 2, 1}), {filter}, along_row({2})), 2, 1e-12) << filter_name(filter);
    EXPECT_NEAR(surfaces_met(row({1, 2, 2, 3}), {filter}, along_row({2})), 1, 1e-12) << filter_name(filter);
    EXPECT_EQ(surfaces_met(row({3, 2, 2, 3}), {filter}, along_row({2})), 0) << filter_name(filter);
    EXPECT_EQ(surfaces_met(row({2, 2, 2, 2}), {filter}, along_row({2})), 0) << filter_name(filter);
  }
}

TEST(ReferenceIso, SeveralIsovaluesInOneJumpComeInItsDirection) {
  // nearest, 1 | 4: all of 1.5, 2 and 3 on the face, ascending with the ray and descending against it
  const AmrHierarchy h = row({1, 1, 4, 4});
  const std::vector<double> opacity{0.5, 0.3, 0.2};
  const std::vector<Vec3d> rgb{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const bool rising : {true, false}) {
    Scene scene = along_row({1.5, 2, 3}, rising ? 1 : -1);
    scene.settings.isosurfaces.opacity = opacity;
    scene.settings.isosurfaces.color = {{1.5, rgb[0]}, {2, rgb[1]}, {3, rgb[2]}};
    Vec3d expected(0);
    double t = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t k = rising ? i : 2 - i;
      expected += t * opacity[k] * rgb[k];
      t *= 1 - opacity[k];
    }
    const auto pixel = draw(h, {}, scene);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[static_cast<std::size_t>(c)], expected[c], 1e-15);
    EXPECT_NEAR(pixel[3], 1 - t, 1e-15);
  }
}

TEST(ReferenceIso, JumpBetweenLevelsIsAHitOnTheFace) {
  // Along x: coarse cells of 1, then from x = 1/2 fine layers of 3, 5, 5, 5. On the coarse side v_0 = 1 and the refined
  // cell's mean 4 meet at 2.5, on the fine side v_1 = 1 and 3 meet at 2: f = 2.25 is passed before, on and behind the face.
  MeshBuilder mesh({4, 4, 4}, {2});
  mesh.root(constant(1)).patch(1, {{4, 0, 0}, {8, 8, 8}}, [](const Vec3d& p) { return p.x < 0.625 ? 3.0 : 5.0; });
  const AmrHierarchy h = mesh.hierarchy();
  const FilterDefinition lod{Filter::linear_lod};
  const double first = 0.375 + 0.25 * 1.25 / 3;  // 1 + 3 (x - 3/8) / (1/4) = 2.25
  const double third = 0.5 + 0.125 * 0.25 / 2;   // 2 + 2 (x - 1/2) / (1/8) = 2.25
  const Vec3d p(0.5, 0.55, 0.55);
  EXPECT_NEAR(surfaces_met(h, lod, one_ray(p, {1, 0, 0}, {2.25})), 3, 1e-12);
  EXPECT_NEAR(depth(h, lod, one_ray(p, {1, 0, 0}, {2.25})), 2.5 + first, 1e-13);
  EXPECT_NEAR(depth(h, lod, one_ray(p, {-1, 0, 0}, {2.25})), 3.5 - third, 1e-13);
  // from between the first hit and the face, and from between the face and the third
  EXPECT_NEAR(depth(h, lod, one_ray(p, {1, 0, 0}, {2.25}, Output::depth, 0.01)), 0.01, 1e-14);
  EXPECT_NEAR(depth(h, lod, one_ray(p, {-1, 0, 0}, {2.25}, Output::depth, 0.01)), 0.01, 1e-14);
  EXPECT_NEAR(surfaces_met(h, {Filter::linear_vertex}, one_ray(p, {1, 0, 0}, {2.25})), 1, 1e-12) << "continuous";
}

// ---- a second route ----

/// Changes of side between many samples, each refined by bisection.
std::vector<double> marched_hits(const HierarchyReference& reference, const WorldRay& ray, double end, double v) {
  constexpr int kSteps = 12000;
  const auto at = [&](double t) { return reference.sample(ray.origin + t * ray.direction); };
  std::vector<double> hits;
  std::optional<double> last;
  for (int i = 0; i < kSteps; ++i) {
    const double t = end * (i + 0.5) / kSteps;
    const auto f = at(t);
    if (f && last && (*f >= v) != (*last >= v)) {
      double a = t - end / kSteps, b = t;
      for (int k = 0; k < 45; ++k) {
        const double middle = (a + b) / 2;
        const auto g = at(middle);
        (g && (*g >= v) == (*last >= v) ? a : b) = middle;
      }
      hits.push_back((a + b) / 2);
    }
    last = f;
  }
  return hits;
}

TEST(ReferenceIso, AgreesWithPlainMarchingThroughSample) {
  const std::vector<WorldRay> rays{
      {{-1, 0.1, 0.2}, {3, 1, 0.8}}, {{1.5, 1.7, -0.6}, {-1, -1.2, 1.1}}, {{0.3, 0.2, 3}, {0.1, 0.13, -1}}};
  std::size_t hits = 0;
  for (const NamedMesh& mesh : conformance_meshes()) {
    const AmrHierarchy& h = mesh.hierarchy;
    const Vec3d size = h.domain_upper() - h.domain_lower();
    for (const auto& definition : all_definitions()) {
      if (definition.page_level >= h.level_count()) continue;
      const HierarchyReference reference(h, 0, definition);
      for (const WorldRay& unit : rays) {
        const WorldRay ray{h.domain_lower() + unit.origin * size, glm::normalize(unit.direction * size)};
        for (const double v : {0.45, 0.6}) {
          Scene scene = one_ray(ray.origin + ray.direction, ray.direction, {v}, Output::color, 1);
          const auto expected = marched_hits(reference, ray, 8, v);
          const std::string where = fmt::format("{}, {}, isovalue {}", mesh.name, text(definition), v);
          EXPECT_NEAR(surfaces_met(h, definition, scene), static_cast<double>(expected.size()), 1e-9) << where;
          EXPECT_NEAR(depth(h, definition, scene), expected.empty() ? 0 : expected.front(), 1e-9) << where;
          hits += expected.size();
        }
      }
    }
  }
  EXPECT_GT(hits, 300U);
}

TEST(ReferenceIso, SameBitsAtAnyThreadCount) {
  const AmrHierarchy h = with_second_field(nested(waves), [](const Vec3d& p) { return p.y; });
  Scene scene = picture_of({0.45, 0.6}, Output::color);
  scene.settings.width = 70;
  scene.settings.isosurfaces.opacity = {0.5, 0.5};
  scene.settings.isosurfaces.color = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
  scene.settings.isosurfaces.color_field = "g";
  for (const auto& definition : all_definitions()) {
    const HierarchyReference reference(h, 0, definition);
    const Picture all = reference.render(scene, 0.5);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(reference.render(scene, 0.5).values, all.values) << text(definition);
  }
}

}  // namespace
}  // namespace amrtex
