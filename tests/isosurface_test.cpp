// Isosurfaces against closed forms, against the double reference, and to the bit between encodings,
// with and without skipping. Every encoding with every filter.
#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;

constexpr int kSize = 24;

Scene iso_scene(const View& view, std::vector<double> isovalues, Output output = Output::color,
                Sampling sampling = Sampling::lattice) {
  Scene scene;
  scene.view = view;
  scene.settings.mode = Mode::iso;
  scene.settings.sampling = sampling;
  scene.settings.step = 0.5;
  scene.settings.width = scene.settings.height = kSize;
  scene.settings.isosurfaces.values = std::move(isovalues);
  scene.settings.isosurfaces.output = output;
  scene.settings.isosurfaces.color = {{0, {1, 0, 0}}, {1, {0, 0, 1}}};
  return scene;
}

WorldRay ray_of(const Scene& scene, int x, int y) {
  return camera_ray(camera_frame(scene.view, kSize, kSize), x, y, kSize, kSize);
}

double along_x(const Vec3d& p) { return p.x; }

EncodedField in_double(const AmrHierarchy& h, const EncodingCase& c) { return build(h, c, {.storage = Storage::r64f}); }

bool is_nearest(const EncodingCase& c) { return c.filter == Filter::nearest; }

/// A case may refuse what the test is about (a storage, a mesh); the others are drawn.
template <class F>
void for_each_accepted(F&& f) {
  int drawn = 0;
  for_each_case([&](const EncodingCase& c) {
    try {
      f(c);
      ++drawn;
    } catch (const UnsupportedError&) {
    }
  });
  EXPECT_GT(drawn, 1);
}

// ---- hits ----

TEST(Hit, OfALinearFieldLiesInThePlane) {
  // f = x: the surface of 1/2 is the plane x = 1/2, its normal (1, 0, 0), inside the outer cells' centres
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(along_x).hierarchy();
  const View view = orthographic(Vec3d(0.5), {1, 0.3, -0.2}, 0.5);
  for_each_accepted([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    const EncodedField doubles = in_double(h, c);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      const Scene depth = iso_scene(view, {0.5}, Output::depth, sampling);
      const Scene normal = iso_scene(view, {0.5}, Output::normal, sampling);
      const Picture depths = render_on_cpu(h, doubles, depth, true);
      const Picture normals = render_on_cpu(h, doubles, normal, true);
      for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
          const WorldRay ray = ray_of(depth, x, y);
          const double exact = (0.5 - ray.origin.x) / ray.direction.x;
          ASSERT_NEAR(*depths.pixel(x, y), exact, 1e-12) << x << " " << y;
          ASSERT_NEAR(normals.pixel(x, y)[0], 1, 1e-12);
          ASSERT_EQ(normals.pixel(x, y)[3], 1);
        }
    }
  });
}

TEST(Hit, OfNearestLiesOnTheFaceBetweenTwoSides) {
  // leaves of x < 1/2 are 0, the others 1; the face is one of cells, and of levels
  const auto sides = [](const Vec3d& p) { return p.x < 0.5 ? 0.0 : 1.0; };
  const AmrHierarchy h = MeshBuilder(Vec3i(8), {2}).root(sides).patch(1, {{8, 0, 0}, {16, 16, 16}}, sides).hierarchy();
  const GlPairs on_gl(2, is_nearest);
  for_each_accepted([&](const EncodingCase& c) {
    if (!is_nearest(c)) return;
    Scene scene = iso_scene(orthographic(Vec3d(0.5), {1, 0.3, -0.2}, 0.5), {0.5}, Output::depth);
    scene.settings.isosurfaces.tolerance = 1.0 / 512;  // finest cells, 1/16 wide
    const EncodedField field = build(h, c);
    std::vector<Picture> pictures{render_on_cpu(h, field, scene, false)};
    if (on_gl.has(c)) pictures.push_back(draw(context(ContextKind::egl), h, field, scene));
    for (const Picture& depths : pictures)
      for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
          const WorldRay ray = ray_of(scene, x, y);
          ASSERT_NEAR(*depths.pixel(x, y), (0.5 - ray.origin.x) / ray.direction.x, 1.0 / 512 / 16 + 1e-6);
        }
  });
}

TEST(Hit, IsNotWhereARayEntersOrLeavesTheMesh) {
  // 0 on the left, 1 on the right, a hole or cells without a value between them: no side changes
  for (const bool hole : {true, false}) {
    const auto sides = [](const Vec3d& p) { return p.x > 0.35 && p.x < 0.65 ? kNan : p.x < 0.5 ? 0.0 : 1.0; };
    MeshBuilder mesh({10, 4, 4});
    if (hole)
      mesh.patch(0, {{0, 0, 0}, {4, 4, 4}}, constant(0)).patch(0, {{6, 0, 0}, {10, 4, 4}}, constant(1));
    else
      mesh.root(sides);
    const AmrHierarchy h = mesh.hierarchy();
    const View view = orthographic(Vec3d(0.5), {1, 0.05, 0.03}, 0.4);
    for_each_accepted([&](const EncodingCase& c) {
      const EncodedField field = build(h, c);
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
        for (const bool skip : {false, true}) {
          Scene scene = iso_scene(view, {0.5}, Output::color, sampling);
          scene.settings.skip = skip;
          EXPECT_EQ(largest(render_on_cpu(h, field, scene, true)), 0) << skip;
        }
    });
  }
}

TEST(Hit, IsNotWhereNoIsovalueIsReached) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(1).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
    const Scene scene = iso_scene(perspective({2, -1.5, 1.2}, Vec3d(0.5)), {-3, 7});
    EXPECT_EQ(largest(draw_on(gl, h, build(h, c), scene)), 0);
  });
}

// ---- what a surface adds ----

// ---- ends of rays ----

double along_y(const Vec3d& p) { return p.y; }

/// Where the ray meets y = 1/2: 0 where that is outside of the unit cube, nullopt where it is next to a face of it.
std::optional<double> exact_depth(const WorldRay& ray) {
  const double t = (0.5 - ray.origin.y) / ray.direction.y;
  const Vec3d p = ray.origin + t * ray.direction;
  for (const double face : {p.x, 1 - p.x, p.z, 1 - p.z})
    if (std::abs(face) < 1e-3) return std::nullopt;
  return p.x > 0 && p.x < 1 && p.z > 0 && p.z < 1 ? t : 0;
}

void expect_exact_depths(const Picture& depths, const Scene& scene, double tolerance) {
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      if (const auto exact = exact_depth(ray_of(scene, x, y))) {
        ASSERT_NEAR(*depths.pixel(x, y), *exact, tolerance) << x << " " << y;
      }
}

// f = y, and rays rise slowly: some meet y = 1/2 within a hundredth of a cell of where they enter or leave the mesh, and each has
// a hit there, however long its intervals are.
const View kRising = orthographic(Vec3d(0.5), {1, 0.3, 0.2}, 0.6);

TEST(Hit, NextToAnEndOfTheRayIsFound) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(along_y).hierarchy();
  for_each_accepted([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    const EncodedField doubles = in_double(h, c);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive})
      for (const double step : {0.5, 2.0}) {
        Scene scene = iso_scene(kRising, {0.5}, Output::depth, sampling);
        scene.settings.step = step;
        expect_exact_depths(render_on_cpu(h, doubles, scene, true), scene, 1e-12);
      }
  });
}

TEST(Hit, NextToAnEndOfTheRayIsFoundOnGl) {
  const AmrHierarchy h = MeshBuilder(Vec3i(4)).root(along_y).hierarchy();
  GlPairs(2, interpolating).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    const Scene scene = iso_scene(kRising, {0.5}, Output::depth, Sampling::adaptive);
    expect_exact_depths(draw(context(ContextKind::egl), h, field, scene), scene, 1e-4);
  });
}

/// Pixels with a hit in one picture alone.
int lone_hits(const Picture& a, const Picture& b) {
  int n = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) n += (a.values[i] > 0) != (b.values[i] > 0) ? 1 : 0;
  return n;
}

TEST(Hit, IsWhereTheReferenceHasOneWhateverTheRegionThatARayEnters) {
  // f rises along every axis, and so does each ray: a surface is met once. Where f jumps at a face of levels it may fall back
  // there, and then a step sees neither crossing
  const auto rising = [](const Vec3d& p) { return p.y + 0.1 * p.x + 0.2 * p.z; };
  for (const MeshBuilder& mesh : {nested(rising), jump_of_two(rising)}) {
    const AmrHierarchy h = mesh.hierarchy();
    for_each_accepted([&](const EncodingCase& c) {
      if (!interpolating(c)) return;
      const EncodedField doubles = in_double(h, c);
      for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
        const Scene scene = iso_scene(kRising, {0.55}, Output::depth, sampling);
        const Picture reference = HierarchyReference(h, 0, doubles.definition).render(scene, 0.0625);
        EXPECT_LE(lone_hits(render_on_cpu(h, doubles, scene, true), reference),
                  doubles.definition.continuous_everywhere() ? 0 : 2)
            << sampling_name(sampling);
      }
    });
  }
}

TEST(Surfaces, OneBehindAnotherAddUpInOrder) {
  // a1 c1 + (1 - a1) a2 c2, whichever side the ray comes from; surfaces of one interval too
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(along_x).hierarchy();
  for_each_accepted([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    const EncodedField field = in_double(h, c);
    for (const double direction : {1.0, -1.0})
      for (const double distance : {0.25, 0.01})
        for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
          Scene scene =
              iso_scene(orthographic(Vec3d(0.5), {direction, 0, 0}, 0.5), {0.5, 0.5 + distance}, Output::color, sampling);
          Isosurfaces& iso = scene.settings.isosurfaces;
          iso.shading = Shading::none;
          iso.opacity = {0.25, 0.5};
          iso.color = {{0.5, {1, 0, 0}}, {0.5 + distance, {0, 1, 0}}};
          const Picture picture = render_on_cpu(h, field, scene, true);
          const double red = direction > 0 ? 0.25 : 0.5 * 0.25;
          const double green = direction > 0 ? 0.75 * 0.5 : 0.5;
          EXPECT_NEAR(picture.pixel(5, 7)[0], red, 1e-12);
          EXPECT_NEAR(picture.pixel(5, 7)[1], green, 1e-12);
          EXPECT_NEAR(picture.pixel(5, 7)[3], 1 - 0.75 * 0.5, 1e-12);
        }
  });
}

TEST(Surfaces, InAVolumeSplitItWhereTheyLie) {
  // constant k and c before, behind: C = (1 - e^(-k L1)) c + e^(-k L1) (a s + (1 - a) (1 - e^(-k L2)) c), for any step
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(along_x).hierarchy();
  const double k = 3;
  for_each_accepted([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    const EncodedField field = in_double(h, c);
    for (const double a : {0.5, 1.0})
      for (const double isovalue : {0.5, 0.52, 0.541})
        for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
          Scene scene = iso_scene(orthographic(Vec3d(0.5), {1, 0, 0}, 0.5), {isovalue}, Output::color, sampling);
          scene.settings.mode = Mode::dvr_iso;
          scene.settings.step = 0.7;
          scene.settings.isosurfaces.shading = Shading::none;
          scene.settings.isosurfaces.opacity = {a};
          scene.settings.isosurfaces.color = {{0, {0, 1, 0}}};
          scene.transfer_function = constant_light(k);
          const double through = std::exp(-k * isovalue);
          const double behind = 1 - std::exp(-k * (1 - isovalue));
          const Picture picture = render_on_cpu(h, field, scene, true);
          EXPECT_NEAR(picture.pixel(5, 7)[0], 0.75 * (1 - through + through * (1 - a) * behind), 1e-12);
          EXPECT_NEAR(picture.pixel(5, 7)[1], 0.5 * (1 - through + through * (1 - a) * behind) + through * a, 1e-12);
        }
  });
}

TEST(Surfaces, OfGlAreThoseOfTheDoubleBuild) {
  // depth, and light in a volume, of a linear field: no silhouettes, so every pixel agrees
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).root(along_x).hierarchy();
  GlPairs(2, interpolating).for_each([&](const EncodingCase& c) {
    const EncodedField doubles = build(h, c, {.storage = Storage::r64f});
    const EncodedField floats = build(h, c);
    for (const Sampling sampling : {Sampling::lattice, Sampling::adaptive}) {
      Scene scene = iso_scene(orthographic(Vec3d(0.5), {1, 0.3, -0.2}, 0.5), {0.541}, Output::depth, sampling);
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, floats, scene), render_on_cpu(h, doubles, scene, true)), 1e-5);
      scene.settings.mode = Mode::dvr_iso;
      scene.settings.isosurfaces.output = Output::color;
      scene.settings.isosurfaces.opacity = {0.5};
      scene.transfer_function = constant_light(3);
      EXPECT_LE(difference(draw(context(ContextKind::egl), h, floats, scene), render_on_cpu(h, doubles, scene, true)), 1e-5);
    }
  });
}

TEST(Surfaces, AreLitByTheAngleBetweenTheirGradientAndTheRay) {
  // light = ambient + (1 - ambient) |cos|, cos = (1, 0, 0) . direction
  const AmrHierarchy h = MeshBuilder(Vec3i(16), {}, {0, 0, 0}, {1, 2, 4}).root(along_x).hierarchy();
  const Vec3d direction = glm::normalize(Vec3d(1, 0.8, -0.5));
  for_each_accepted([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    Scene scene = iso_scene(orthographic({0.5, 1, 2}, direction, 0.3), {0.5});
    scene.settings.isosurfaces.color = {{0, Vec3d(1)}};
    const Picture picture = render_on_cpu(h, in_double(h, c), scene, true);
    EXPECT_NEAR(picture.pixel(5, 7)[0], surface_light(direction.x), 1e-12);
    EXPECT_EQ(picture.pixel(5, 7)[3], 1);
  });
}

TEST(Surfaces, TakeTheColorOfASecondField) {
  // f = x, g = y: on the plane x = 1/2 the colour is (y, 0, 1 - y), inside the outer cells' centres
  MeshDescription mesh = MeshBuilder(Vec3i(16)).root(along_x).description();
  mesh.fields.push_back("g");
  mesh.levels[0][0].values.push_back(
      MeshBuilder(Vec3i(16)).root([](const Vec3d& p) { return p.y; }).description().levels[0][0].values[0]);
  const AmrHierarchy h(mesh);
  Scene scene = iso_scene(orthographic(Vec3d(0.5), {1, 0.3, -0.2}, 0.5), {0.5});
  scene.settings.isosurfaces.shading = Shading::none;
  scene.settings.isosurfaces.color_field = "g";
  scene.settings.isosurfaces.color = {{0, {0, 0, 1}}, {1, {1, 0, 0}}};
  const GlPairs on_gl(2, interpolating);
  for_each_filter([&](const EncodingCase& c) {
    if (!interpolating(c)) return;
    BuildRequest request;
    request.more_fields = {1};
    request.needs.filter = c.filter;
    request.parameters = c.parameters;
    const EncodedField field = c.encoding->build(h, request);
    std::vector<Picture> pictures{render_on_cpu(h, field, scene, true),
                                  HierarchyReference(h, 0, field.definition).render(scene, 0.1)};
    if (on_gl.has(c)) pictures.push_back(draw(context(ContextKind::egl), h, field, scene));
    for (const Picture& picture : pictures)
      for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
          const WorldRay ray = ray_of(scene, x, y);
          const double g = (ray.origin + (0.5 - ray.origin.x) / ray.direction.x * ray.direction).y;
          ASSERT_NEAR(picture.pixel(x, y)[0], g, 1e-5);
          ASSERT_NEAR(picture.pixel(x, y)[2], 1 - g, 1e-5);
        }
    EXPECT_THROW(render_on_cpu(h, build(h, c), scene, true), Error) << "it was built without the second field";
  });
}

/// Every case that takes 8-bit samples, those that take nothing else too.
std::vector<EncodingCase> cases_of_bytes() {
  std::vector<EncodingCase> cases;
  for (const EncodingCase& base : encoding_cases()) {
    if (!base.parameters.empty()) continue;
    for (const ParameterInfo& p : base.encoding->parameters())
      for (const Json& value : declared_values(p)) {
        EncodingCase c = base;
        c.parameters[p.name] = value;
        if (accepted(c, {.storage = Storage::r8})) cases.push_back(std::move(c));
      }
  }
  return cases;
}

TEST(Surfaces, AreLitByStoredGradientsWhereThereAreAny) {
  // a sphere: the stored directions are off by their 8-bit angles and by the cells between which they are interpolated
  const Vec3d middle(0.5);
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root([&](const Vec3d& p) { return glm::distance(p, middle); }).hierarchy();
  const Scene scene = iso_scene(orthographic(middle, {0.3, 0.2, -1}, 0.9), {0.3}, Output::normal);
  int stored = 0;
  for (const EncodingCase& c : cases_of_bytes()) {
    SCOPED_TRACE(c.name());
    if (!interpolating(c)) continue;
    BuildRequest request;
    request.storage = Storage::r8;
    request.needs.filter = c.filter;
    request.needs.gradients = true;
    request.parameters = c.parameters;
    const EncodedField field = c.encoding->build(h, request);
    const auto& defines = field.shader.defines;
    const bool has = std::any_of(defines.begin(), defines.end(),
                                 [](const auto& d) { return d.first.ends_with("_GRADIENTS") && d.second != 0; });
    if (!has) continue;
    ++stored;
    std::vector<Picture> pictures{render_on_cpu(h, field, scene, true)};
    if (stored == 1 || full_tier()) pictures.push_back(draw(context(ContextKind::egl), h, field, scene));
    for (const Picture& picture : pictures)
      for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
          const WorldRay ray = ray_of(scene, x, y);
          const double b = glm::dot(ray.origin - middle, ray.direction);
          const double discriminant = b * b - glm::dot(ray.origin - middle, ray.origin - middle) + 0.09;
          if (discriminant < 0.01) continue;
          const Vec3d normal = (ray.origin + (-b - std::sqrt(discriminant)) * ray.direction - middle) / 0.3;
          const double* n = picture.pixel(x, y);
          ASSERT_LT(glm::distance(Vec3d(n[0], n[1], n[2]), normal), 0.05) << x << " " << y;
        }
  }
  EXPECT_GT(stored, 0);
}

// ---- spheres and tori: order of convergence ----

struct Body {
  const char* name;
  Function f;
  double isovalue;
};

std::vector<Body> bodies() {
  const Vec3d middle(0.5);
  const auto torus = [middle](const Vec3d& p) {
    const Vec3d q = p - middle;
    return std::hypot(std::hypot(q.x, q.y) - 0.27, q.z);
  };
  return {{"sphere", [middle](const Vec3d& p) { return glm::distance(p, middle); }, 0.3},
          {"torus", torus, 0.1},
          // of the two surfaces of the shell the outer one is met first
          {"shell", [middle](const Vec3d& p) { return std::exp(-0.5 * std::pow((glm::distance(p, middle) - 0.25) / 0.06, 2)); },
           0.5}};
}

/// First crossing of the analytic field along a ray from outside; none: negative.
double exact_depth(const Body& body, const WorldRay& ray) {
  const auto side = [&](double t) { return body.f(ray.origin + t * ray.direction) >= body.isovalue; };
  constexpr double kStep = 1e-3;
  const bool outside = side(0);
  for (double t = 1.5; t < 4.5; t += kStep) {
    if (side(t + kStep) == outside) continue;
    double low = t;
    double high = t + kStep;
    for (int i = 0; i < 50; ++i) (side((low + high) / 2) == outside ? low : high) = (low + high) / 2;
    return low;
  }
  return -1;
}

Vec3d exact_normal(const Body& body, const Vec3d& p) {
  constexpr double kStep = 1e-5;
  Vec3d g;
  for (int a = 0; a < 3; ++a) {
    Vec3d way(0);
    way[a] = kStep;
    g[a] = body.f(p + way) - body.f(p - way);
  }
  return glm::normalize(g);
}

struct SurfaceErrors {
  double depth = 0;   ///< world, largest
  double normal = 0;  ///< length of the difference, largest
};

/// Of pixels whose rays meet the body steeply: near a silhouette a small shift is a long way.
SurfaceErrors surface_errors(const Body& body, const AmrHierarchy& h, const EncodedField& field, const View& view) {
  const Scene depth = iso_scene(view, {body.isovalue}, Output::depth, Sampling::adaptive);
  const Picture depths = render_on_cpu(h, field, depth, true);
  const Picture normals = render_on_cpu(h, field, iso_scene(view, {body.isovalue}, Output::normal, Sampling::adaptive), true);
  SurfaceErrors errors;
  int compared = 0;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      const WorldRay ray = ray_of(depth, x, y);
      const double t = exact_depth(body, ray);
      if (t < 0) continue;
      const Vec3d exact = exact_normal(body, ray.origin + t * ray.direction);
      if (std::abs(glm::dot(exact, ray.direction)) < 0.6) continue;
      ++compared;
      errors.depth = std::max(errors.depth, std::abs(*depths.pixel(x, y) - t));
      const double* n = normals.pixel(x, y);
      errors.normal = std::max(errors.normal, glm::distance(Vec3d(n[0], n[1], n[2]), exact));
    }
  EXPECT_GT(compared, 40) << body.name;
  return errors;
}

TEST(Convergence, OfPositionsHasOrderTwoAndOfNormalsOneAtLeast) {
  const View view = orthographic(Vec3d(0.5), {0.3, 0.2, -1}, 0.9);
  for (const Body& body : bodies()) {
    std::map<std::string, std::vector<SurfaceErrors>> errors;
    for (const int n : {24, 48, 96}) {
      const AmrHierarchy h = MeshBuilder(Vec3i(n)).root(body.f).hierarchy();
      for_each_filter([&](const EncodingCase& c) {
        if (!interpolating(c)) return;
        errors[c.name()].push_back(surface_errors(body, h, in_double(h, c), view));
      });
    }
    for (const auto& [name, e] : errors) {
      SCOPED_TRACE(fmt::format("{} {}: positions {:.2e} {:.2e} {:.2e}, normals {:.2e} {:.2e} {:.2e}", body.name, name, e[0].depth,
                               e[1].depth, e[2].depth, e[0].normal, e[1].normal, e[2].normal));
      EXPECT_GE(std::log2(e[0].depth / e[2].depth) / 2, 1.9);
      EXPECT_GE(std::log2(e[0].normal / e[2].normal) / 2, 0.9);
      EXPECT_LT(e[2].depth, 0.1 / 96) << "a tenth of a cell";
    }
  }
}

/// Isovalues, opacities and volume: everything that a surface takes part in.
Scene rich_scene(Mode mode, Sampling sampling, bool skip) {
  Scene scene = iso_scene(perspective({2, -1.5, 1.2}, Vec3d(0.5)), {0.4, 0.55, 0.7}, Output::color, sampling);
  scene.settings.mode = mode;
  scene.settings.step = 0.8;
  scene.settings.skip = skip;
  scene.settings.isosurfaces.opacity = {0.3, 0.5, 0.9};
  scene.transfer_function = constant_light(0);
  scene.transfer_function.extinction = {{0.6, 0}, {0.8, 8}};
  return scene;
}

/// Share of the numbers that differ by more than `tolerance`: at silhouettes and thin features a
/// crossing pair of samples is there or not.
double differing_share(const Picture& a, const Picture& b, double tolerance) {
  EXPECT_EQ(a.values.size(), b.values.size());
  std::size_t n = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) n += std::abs(a.values[i] - b.values[i]) <= tolerance ? 0 : 1;
  return static_cast<double>(n) / static_cast<double>(a.values.size());
}

TEST(Reference, IsWhatTheSurfacesOfEveryEncodingAre) {
  for (const NamedMesh& mesh : conformance_meshes()) {
    if (mesh.name == "one cell") continue;
    SCOPED_TRACE(mesh.name);
    for_each_filter([&](const EncodingCase& c) {
      try {
        const EncodedField field = in_double(mesh.hierarchy, c);
        for (const Mode mode : {Mode::iso, Mode::dvr_iso}) {
          Scene scene = rich_scene(mode, Sampling::lattice, true);
          const Vec3d middle = (mesh.hierarchy.domain_lower() + mesh.hierarchy.domain_upper()) * 0.5;
          scene.view = perspective(middle + Vec3d(1.5, -2, 0.7), middle);
          scene.settings.step = 0.125;
          // a page may be finer than the leaf, and differences are taken over its cells
          if (c.filter == Filter::linear_vertex) scene.settings.isosurfaces.shading = Shading::none;
          const Picture reference = HierarchyReference(mesh.hierarchy, 0, field.definition).render(scene, 0.0625);
          const Picture drawn = render_on_cpu(mesh.hierarchy, field, scene, true);
          // a volume of jumps is off by a step at each
          EXPECT_LE(differing_share(drawn, reference, mode == Mode::iso ? 4e-3 : 1.5e-2), 0.025) << mode_name(mode);
          EXPECT_GT(largest(reference), 0.1);
        }
      } catch (const UnsupportedError&) {
      }
    });
  }
}

// ---- to the bit ----

TEST(Skipping, LeavesSurfacesAsTheyAre) {
  const std::vector<NamedMesh> meshes = conformance_meshes();
  for (const NamedMesh& mesh : meshes)
    for_each_accepted([&](const EncodingCase& c) {
      SCOPED_TRACE(mesh.name);
      const EncodedField field = build(mesh.hierarchy, c);
      for (const Mode mode : {Mode::iso, Mode::dvr_iso}) {
        const Picture all = render_on_cpu(mesh.hierarchy, field, rich_scene(mode, Sampling::lattice, false), false);
        const Picture skipped = render_on_cpu(mesh.hierarchy, field, rich_scene(mode, Sampling::lattice, true), false);
        EXPECT_EQ(difference(all, skipped), 0) << mode_name(mode);
      }
    });
}

TEST(Skipping, LeavesSurfacesAsTheyAreOnGl) {
  // of one pair: every case and mesh above, and this is the dearest of all shaders
  const AmrHierarchy h = holes_and_missing(waves).hierarchy();
  GlPairs(1).for_each([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    WorkCounts all_work;
    WorkCounts skipped_work;
    const Picture all = draw(context(ContextKind::egl), h, field, rich_scene(Mode::iso, Sampling::lattice, false), &all_work);
    const Picture skipped =
        draw(context(ContextKind::egl), h, field, rich_scene(Mode::iso, Sampling::lattice, true), &skipped_work);
    EXPECT_EQ(difference(all, skipped), 0);
    EXPECT_GT(largest(all), 0.1);
    EXPECT_LE(skipped_work.samples, all_work.samples);
  });
}

TEST(Nearest, SurfacesAreTheSameToTheBitInEveryEncoding) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const Scene scene = rich_scene(Mode::dvr_iso, Sampling::lattice, true);
  const GlPairs on_gl(2, is_nearest);
  std::map<std::string, Picture> on_cpu, drawn;
  for_each_case([&](const EncodingCase& c) {
    if (!is_nearest(c)) return;
    const EncodedField field = build(h, c);
    if (field.definition.filter != Filter::nearest) return;
    on_cpu.emplace(c.name(), render_on_cpu(h, field, scene, false));
    if (on_gl.has(c)) drawn.emplace(c.name(), draw(context(ContextKind::egl), h, field, scene));
  });
  for (const auto& pictures : {on_cpu, drawn}) {
    ASSERT_GT(pictures.size(), 1u);
    for (const auto& [name, picture] : pictures) EXPECT_EQ(difference(picture, pictures.begin()->second), 0) << name;
    EXPECT_GT(largest(pictures.begin()->second), 0.1);
  }
}

TEST(Contexts, AndTheCpuDrawTheSameSurfaces) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2, interpolating).for_each([&](const EncodingCase& c) {
    const Scene scene = rich_scene(Mode::dvr_iso, Sampling::lattice, true);
    const EncodedField field = build(h, c);
    const Picture cpu = render_on_cpu(h, field, scene, false);
    const Picture egl = draw(context(ContextKind::egl), h, field, scene);
    EXPECT_LE(differing_share(cpu, egl, 1e-3), 0.01);
  });
}

// ---- left out ----

TEST(Needs, ScenesWithoutSurfacesHaveNoCodeForThem) {
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c) {
    Context& gl = context(ContextKind::egl);
    const EncodedField field = build(h, c);
    const Structure structure(gl, field);
    Scene scene = rich_scene(Mode::dvr, Sampling::lattice, true);
    EXPECT_FALSE(Raycaster(gl, h, structure, scene).program().has_uniform("u_isovalues"));
    scene.settings.mode = Mode::iso;
    const Raycaster surfaces(gl, h, structure, scene);
    EXPECT_TRUE(surfaces.program().has_uniform("u_isovalues"));
    EXPECT_FALSE(surfaces.program().has_uniform("u_extinction_points")) << "nor surfaces code for the volume";
  });
}

}  // namespace
}  // namespace amrtex
