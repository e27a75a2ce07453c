// Triangles that hide what lies behind them: files, where rays meet them, closed forms, the double reference, what is left out
// and refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "renderers/bindings/scene_bindings.hpp"
#include "renderers/consumers/box_consumer.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/scene/triangle_layer.hpp"
#include "renderers/scene/triangle_reader.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kPixels = 9;
constexpr std::array kSamplings{Sampling::lattice, Sampling::adaptive};
constexpr std::array kModes{Mode::dvr, Mode::projection, Mode::mip, Mode::iso, Mode::dvr_iso};
const Vec3d kColor(0.2, 0.9, 0.4);

// ---- files ----

const std::vector<Vec3d> kCorners{{0.25, 0.25, 0.25}, {0.75, 0.25, 0.25}, {0.25, 0.75, 0.25}, {0.25, 0.25, 0.875}};
const std::vector<Vec3i> kFaces{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

std::vector<Triangle> tetrahedron() {
  std::vector<Triangle> triangles;
  for (const Vec3i& f : kFaces)
    triangles.push_back({kCorners[static_cast<std::size_t>(f.x)], kCorners[static_cast<std::size_t>(f.y)],
                         kCorners[static_cast<std::size_t>(f.z)]});
  return triangles;
}

std::string obj_text() {
  std::string text = "# a tetrahedron\n";
  for (const Vec3d& p : kCorners) text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (const Vec3i& f : kFaces) text += fmt::format("f {} {} {}\n", f.x + 1, f.y + 1, f.z + 1);
  return text;
}

std::string ply_header(const char* format, std::size_t vertices, std::size_t faces) {
  return fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      format, vertices, faces);
}

std::string ply_text() {
  std::string text = ply_header("ascii", kCorners.size(), kFaces.size());
  for (const Vec3d& p : kCorners) text += fmt::format("{} {} {}\n", p.x, p.y, p.z);
  for (const Vec3i& f : kFaces) text += fmt::format("3 {} {} {}\n", f.x, f.y, f.z);
  return text;
}

template <class T>
void append(std::string& bytes, T value) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes.append(raw.data(), raw.size());
}

void append(std::string& bytes, const Vec3d& p) {
  for (int a = 0; a < 3; ++a) append(bytes, static_cast<float>(p[a]));
}

std::string ply_binary() {
  std::string bytes = ply_header("binary_little_endian", kCorners.size(), kFaces.size());
  for (const Vec3d& p : kCorners) append(bytes, p);
  for (const Vec3i& f : kFaces) {
    append(bytes, std::uint8_t{3});
    for (int a = 0; a < 3; ++a) append(bytes, static_cast<std::int32_t>(f[a]));
  }
  return bytes;
}

std::string stl_text() {
  std::string text = "solid tetrahedron\n";
  for (const Triangle& t : tetrahedron()) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Vec3d& p : t) text += fmt::format("vertex {} {} {}\n", p.x, p.y, p.z);
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid tetrahedron\n";
}

std::string stl_binary() {
  std::string bytes(80, ' ');
  append(bytes, static_cast<std::uint32_t>(kFaces.size()));
  for (const Triangle& t : tetrahedron()) {
    append(bytes, Vec3d(0));
    for (const Vec3d& p : t) append(bytes, p);
    append(bytes, std::uint16_t{0});
  }
  return bytes;
}

/// In an order of its own: each from its smallest corner on, then all sorted.
std::vector<Triangle> sorted(std::vector<Triangle> triangles) {
  const auto less = [](const Vec3d& a, const Vec3d& b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); };
  for (Triangle& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end(), less), t.end());
  std::sort(triangles.begin(), triangles.end(), [&](const Triangle& a, const Triangle& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), less);
  });
  return triangles;
}

class TriangleFiles : public testing::Test {
 protected:
  TriangleFiles() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("amrtex_triangles_{}_{}", info->name(), ::getpid());
    fs::create_directories(folder_);
  }
  ~TriangleFiles() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  std::string complaint(const fs::path& path) const {
    try {
      read_triangles(path);
    } catch (const Error& e) {
      return e.what();
    }
    return "accepted";
  }

  fs::path folder_;
};

TEST_F(TriangleFiles, OfAllFormatsHoldTheSameTriangles) {
  const struct {
    const char* name;
    std::string bytes;
  } files[] = {{"t.obj", obj_text()},     {"ascii.ply", ply_text()},    {"binary.ply", ply_binary()},
               {"ascii.stl", stl_text()}, {"binary.stl", stl_binary()}, {"LOUD.OBJ", obj_text()}};
  for (const auto& file : files)
    EXPECT_EQ(sorted(read_triangles(write(file.name, file.bytes)).triangles()), sorted(tetrahedron())) << file.name;
}

TEST_F(TriangleFiles, PolygonsAreCutAndOtherThingsLeftOut) {
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 5 5\n";
  const auto area = [&](const std::string& faces) {
    double sum = 0;
    const TriangleMesh mesh = read_triangles(write("square.obj", square + faces));
    for (const Triangle& t : mesh.triangles()) sum += glm::length(glm::cross(t[1] - t[0], t[2] - t[0])) / 2;
    return sum;
  };
  EXPECT_NEAR(area("f 1 2 3 4\n"), 1, 1e-12);
  EXPECT_NEAR(area("f -5 -4 -3\nl 1 5\n"), 0.5, 1e-12) << "counted from the end; a line";
  EXPECT_NEAR(area("o one\nf 1 2 3\no two\nusemtl none\nf 1 3 4\n"), 1, 1e-12) << "two objects in a file";
}

TEST_F(TriangleFiles, ThatAreBrokenAreRefusedByName) {
  std::string far_ply = ply_text();
  far_ply.replace(far_ply.rfind("3 1 2 3"), 7, "3 1 2 9");
  std::string nan_stl = stl_text();
  nan_stl.replace(nan_stl.find("vertex 0.25"), 11, "vertex nan");
  std::string nan_ply = ply_binary();
  nan_ply.replace(ply_header("binary_little_endian", 4, 4).size(), 4, "\xff\xff\xff\x7f");
  const struct {
    const char* name;
    std::string bytes;
    const char* problem;
  } files[] = {
      {"empty.obj", "", ""},
      {"empty.ply", "", ""},
      {"empty.stl", "", ""},
      {"words.obj", "these are no triangles\n", ""},
      {"words.ply", "these are no triangles\n", ""},
      {"points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", ""},
      {"points.ply", ply_header("ascii", 3, 0) + "0 0 0\n1 0 0\n0 1 0\n", ""},
      {"far.obj", obj_text() + "f 1 2 9\n", ""},
      {"far.ply", far_ply, ""},
      {"nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ""},
      {"nan.stl", nan_stl, ""},
      {"nan.ply", nan_ply, "not finite"},
      {"huge.obj", "v 1e39 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"},
      {"cut.stl", stl_binary().substr(0, 84 + 50 * 3 + 20), ""},
      {"cut.ply", ply_binary().substr(0, ply_binary().size() - 20), ""},
      {"short.ply", ply_text().substr(0, ply_text().rfind("3 1 2 3")), "7 lines of vertices and faces; its header tells of 8"},
      {"picture.png", "\x89PNG", "the ending '.png'"},
      {"nothing", obj_text(), "the ending ''"},
  };
  for (const auto& file : files)
    EXPECT_THAT(complaint(write(file.name, file.bytes)), AllOf(HasSubstr((folder_ / file.name).string() + ": "),
                                                               HasSubstr(file.problem), HasSubstr("accepted: OBJ, PLY or STL")));
  EXPECT_THAT(complaint(folder_ / "absent.obj"), HasSubstr("absent.obj: no such file"));
  fs::create_directories(folder_ / "folder.obj");
  EXPECT_THAT(complaint(folder_ / "folder.obj"), HasSubstr("folder.obj: a folder, not a regular file"));
}

// ---- where rays meet them ----

std::vector<Triangle> random_triangles(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> place(-1, 1);
  const auto point = [&] { return Vec3d(place(random), place(random), place(random)); };
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const Vec3d at = point();
    triangles.push_back({at, at + 0.3 * point(), at + 0.3 * point()});
  }
  triangles.push_back(triangles.front());                     // twice the same
  triangles.push_back({Vec3d(0.1), Vec3d(0.2), Vec3d(0.4)});  // without area
  return triangles;
}

TEST(TriangleMesh, FindsTheNearestOfAllTriangles) {
  std::mt19937 random(7);
  const std::vector<Triangle> triangles = random_triangles(300, random);
  const TriangleMesh all(triangles);
  std::uniform_real_distribution<double> place(-2, 2);
  int met = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3d origin(place(random), place(random), place(random));
    Vec3d direction(place(random), place(random), place(random));
    if (i % 3 == 0) direction[i / 3 % 3] = 0;
    if (i % 9 == 0) direction = Vec3d(i % 2, (i + 1) % 2, 0);
    double nearest = kInf;
    for (const Triangle& t : triangles)
      if (const auto hit = TriangleMesh({t}).first_hit(origin, direction)) nearest = std::min(nearest, hit->distance);
    const auto hit = all.first_hit(origin, direction);
    EXPECT_EQ(hit ? hit->distance : kInf, nearest);
    if (!hit) continue;
    ++met;
    EXPECT_FALSE(all.first_hit(origin, direction, nearest)) << "nothing in front of the nearest";
  }
  EXPECT_GT(met, 200);
}

TEST(TriangleMesh, MeetsAPlaneWhereItLies) {
  // t = (d - n.o) / n.w, cosine |n.w| / |n| |w|
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-1, 1);
  for (int i = 0; i < 500; ++i) {
    const auto point = [&] { return Vec3d(place(random), place(random), place(random)); };
    const Triangle t{point(), point(), point()};
    const Vec3d inside = 0.5 * t[0] + 0.3 * t[1] + 0.2 * t[2];
    const Vec3d origin = 3.0 * point();
    const auto hit = TriangleMesh({t}).first_hit(origin, inside - origin);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance, 1, 1e-9);
    const Vec3d normal = glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0]));
    EXPECT_NEAR(hit->cosine, std::abs(glm::dot(normal, glm::normalize(inside - origin))), 1e-12);
    EXPECT_FALSE(TriangleMesh({t}).first_hit(origin, origin - inside)) << "it lies behind";
  }
}

/// A grid of n x n squares over the unit square at z = height(x, y), each of two triangles.
template <class Height>
std::vector<Triangle> sheet(int n, Height&& height) {
  std::vector<Triangle> triangles;
  const auto point = [&](int i, int j) {
    const double x = static_cast<double>(i) / n;
    const double y = static_cast<double>(j) / n;
    return Vec3d(x, y, height(x, y));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      triangles.push_back({point(i, j), point(i + 1, j), point(i + 1, j + 1)});
      triangles.push_back({point(i, j), point(i + 1, j + 1), point(i, j + 1)});
    }
  return triangles;
}

TEST(TriangleMesh, HasNoGapsAtItsEdges) {
  const TriangleMesh mesh(sheet(7, [](double x, double y) { return 0.3 + 0.1 * x * y; }));
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-3, 3);
  for (int i = 0; i < 3000; ++i) {  // through corners, and through places on edges
    const std::vector<Triangle>& all = mesh.triangles();
    const Triangle& t = all[static_cast<std::size_t>(i * 31) % all.size()];
    const Vec3d at = i % 2 == 0 ? t[0] : t[0] + (t[1] - t[0]) * std::abs(place(random) / 3);
    if (at.x < 1e-9 || at.y < 1e-9 || at.x > 1 - 1e-9 || at.y > 1 - 1e-9) continue;
    const Vec3d origin(place(random), place(random), 4);
    EXPECT_TRUE(mesh.first_hit(origin, at - origin)) << i;
  }
}

// ---- pictures ----

TriangleObject object(std::vector<Triangle> triangles, const Vec3d& color = kColor) {
  return {std::make_shared<const TriangleMesh>(std::move(triangles)), color, ""};
}

/// A square of half edge `size` around `at`, across `normal`.
std::vector<Triangle> square(const Vec3d& at, const Vec3d& normal, double size = 20) {
  const Vec3d n = glm::normalize(normal);
  const Vec3d u = glm::normalize(glm::cross(n, std::abs(n.x) < 0.7 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0))) * size;
  const Vec3d v = glm::cross(n, u);
  return {{at - u - v, at + u - v, at + u + v}, {at - u - v, at + u + v, at - u + v}};
}

Scene triangle_scene(Mode mode, Sampling sampling, std::vector<TriangleObject> triangles, const View& view) {
  Scene scene = small_scene(mode, view, sampling, kPixels);
  scene.settings.step = 0.6;
  scene.settings.triangles = std::move(triangles);
  scene.transfer_function = peaks();
  scene.transfer_function.length_unit = TransferFunction::LengthUnit::world;
  scene.settings.isosurfaces.values = {0.45, 0.6};
  scene.settings.isosurfaces.opacity = {0.5, 0.7};
  scene.settings.isosurfaces.shading = Shading::none;
  return scene;
}

View oblique() { return perspective({2.6, -1.9, 1.7}, Vec3d(0.5)); }

/// Premultiplied colour of a constant medium over the plane through `at`: c (1 - T) + T l rgb with T = exp(-k d), d what lies in
/// the box before the plane and l = 0.1 + 0.9 |n.w|.
double off_beer_lambert(const Picture& picture, const Scene& scene, double extinction, const Vec3d& at, const Vec3d& normal,
                        const Vec3d& lower = Vec3d(0), const Vec3d& upper = Vec3d(1)) {
  const Vec3d medium(0.75, 0.5, 0.25);  // constant_light
  const Vec3d n = glm::normalize(normal);
  double worst = 0;
  for (int y = 0; y < kPixels; ++y)
    for (int x = 0; x < kPixels; ++x) {
      const WorldRay ray = camera_ray(camera_frame(scene.view, kPixels, kPixels), x, y, kPixels, kPixels);
      const double plane = glm::dot(at - ray.origin, n) / glm::dot(ray.direction, n);
      double from = 0;
      double to = plane;
      for (int a = 0; a < 3; ++a) {
        const double t0 = (lower[a] - ray.origin[a]) / ray.direction[a];
        const double t1 = (upper[a] - ray.origin[a]) / ray.direction[a];
        from = std::max(from, std::min(t0, t1));
        to = std::min(to, std::max(t0, t1));
      }
      const double left = std::exp(-extinction * std::max(to - from, 0.0));
      const double light = 0.1 + 0.9 * std::abs(glm::dot(n, ray.direction));
      for (int c = 0; c < 3; ++c)
        worst = std::max(worst, std::abs(picture.pixel(x, y)[c] - (medium[c] * (1 - left) + left * light * kColor[c])));
      worst = std::max(worst, std::abs(picture.pixel(x, y)[3] - 1));
    }
  return worst;
}

TEST(TriangleLayer, HasDistanceAndLightOfEachPixelsRay) {
  const Vec3d at(0.4, 0.5, 0.3);
  const Vec3d normal(1, -2, 0.7);
  for (const View& view : {oblique(), orthographic(Vec3d(0.5), {-1, 0.7, -0.4}, 1.4)}) {
    const Scene scene = triangle_scene(Mode::dvr, Sampling::lattice,
                                       {object(square(at, normal)), object(square({9, 9, 9}, {1, 1, 1}, 0.1))}, view);
    const TriangleLayer layer = trace_triangles(scene);
    for (int y = 0; y < kPixels; ++y)
      for (int x = 0; x < kPixels; ++x) {
        const WorldRay ray = camera_ray(camera_frame(view, kPixels, kPixels), x, y, kPixels, kPixels);
        const Vec3d n = glm::normalize(normal);
        ASSERT_EQ(layer.at(x, y).object, 0);
        EXPECT_NEAR(layer.at(x, y).distance, glm::dot(at - ray.origin, n) / glm::dot(ray.direction, n), 1e-12);
        EXPECT_NEAR(layer.at(x, y).light, surface_light(glm::dot(n, ray.direction)), 1e-12);
      }
  }
}

TEST(Triangles, InAConstantMediumFollowBeerAndLambert) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const Vec3d at(0.5, 0.45, 0.55);
  const Vec3d normal(2, -1, 0.5);
  const GlPairs on_gl(2);
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Sampling sampling : kSamplings)
      for (const View& view :
           {oblique(), perspective({0.7, 0.2, 0.8}, {0.3, 0.9, 0.4}), orthographic(Vec3d(0.5), {-1, 0.7, -0.4}, 1.6)}) {
        Scene scene = triangle_scene(Mode::dvr, sampling, {object(square(at, normal))}, view);
        scene.transfer_function = constant_light(1.5);
        // the light of a triangle is a float
        EXPECT_LE(off_beer_lambert(render_on_cpu(h, field, scene, true), scene, 1.5, at, normal), 1e-7);
      }
    Scene scene = triangle_scene(Mode::dvr, Sampling::lattice, {object(square(at, normal))}, oblique());
    scene.transfer_function = constant_light(1.5);
    EXPECT_LE(off_beer_lambert(HierarchyReference(h, 0, field.definition).render(scene, 0.5), scene, 1.5, at, normal), 1e-12);
    if (on_gl.has(c)) {
      EXPECT_LE(off_beer_lambert(draw(context(ContextKind::egl), h, field, scene), scene, 1.5, at, normal), 1e-5);
    }
  });
}

TEST(Triangles, EndRaysWhateverElseDrawsThem) {
  const AmrHierarchy h = nested(constant(1)).hierarchy();
  const Vec3d at(0.5, 0.45, 0.55);
  const Vec3d normal(2, -1, 0.5);
  const struct {
    const char* name;
    std::function<void(Scene&)> change;
    Vec3d lower = Vec3d(0);
    Vec3d upper = Vec3d(1);
    double bound = 1e-7;
  } variants[] = {
      {"skipping", [](Scene& s) { s.settings.skip = true; }},
      {"early end", [](Scene& s) { s.settings.early_end = 0.9999; }, Vec3d(0), Vec3d(1), 1e-4},
      {"offset", [](Scene& s) { s.settings.ray_offset = 5; }},
      {"region",
       [](Scene& s) {
         s.region = {{Vec3d(0.25), Vec3d(0.75)}};
       },
       Vec3d(0.25), Vec3d(0.75)},
      {"planes",
       [](Scene& s) {
         s.settings.clip_planes = {{{0, 0, -1}, -0.5}};
       },
       Vec3d(0), Vec3d(1, 1, 0.5)},
      {"mirror",
       [](Scene& s) {
         s.settings.mirror = Mirror{0, true};
       },
       Vec3d(0), Vec3d(2, 1, 1)},
      {"preintegrated", [](Scene& s) { s.settings.integrator = Integrator::preintegrated; }},
      {"double rays",
       [](Scene& s) {
         s.view = perspective({250, -150, 170}, Vec3d(0.5)), s.view.fov_y = 0.5;
       }},
  };
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const auto& variant : variants)
      for (const Sampling sampling : kSamplings) {
        SCOPED_TRACE(variant.name);
        Scene scene = triangle_scene(Mode::dvr, sampling, {object(square(at, normal, 300))}, oblique());
        scene.transfer_function = constant_light(1.5);
        variant.change(scene);
        EXPECT_LE(off_beer_lambert(render_on_cpu(h, field, scene, true), scene, 1.5, at, normal, variant.lower, variant.upper),
                  variant.bound);
      }
    if (!interpolating(c)) return;
    Scene scene = triangle_scene(Mode::dvr, Sampling::adaptive, {object(square(at, normal))}, oblique());
    scene.transfer_function = constant_light(1.5);
    scene.settings.integrator = Integrator::tolerance;
    scene.settings.tolerance = 1e-4;
    EXPECT_LE(off_beer_lambert(render_on_cpu(h, field, scene, true), scene, 1.5, at, normal), 1e-4);
  });
}

TEST(Triangles, BeforeTheVolumeHideItAndBehindItAreItsBackground) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const View view = orthographic(Vec3d(0.5), {-1, 0, 0}, 1.6);  // looks along -x; the field ends at x = 1
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : kModes)
      for (const Sampling sampling : kSamplings) {
        SCOPED_TRACE(mode_name(mode));
        Scene scene = triangle_scene(mode, sampling, {}, view);
        const Picture alone = render_on_cpu(h, field, scene, false);
        const bool colored = scene.settings.picture_channels() == 4;
        scene.settings.triangles = {object(square({1.5, 0, 0}, {1, 0, 0}))};
        const Picture hidden = render_on_cpu(h, field, scene, false);
        scene.settings.triangles = {object(square({-0.5, 0, 0}, {1, 0, 0}))};
        const Picture over = render_on_cpu(h, field, scene, false);
        if (!colored) {
          EXPECT_EQ(over.values, alone.values) << "no place for a colour";
          EXPECT_EQ(hidden.values, std::vector<double>(alone.values.size(), 0.0));
          continue;
        }
        double off = 0;
        for (int y = 0; y < kPixels; ++y)
          for (int x = 0; x < kPixels; ++x)
            for (int i = 0; i < 4; ++i) {
              const double rgb = i < 3 ? kColor[i] : 1.0;  // met at right angles
              off = std::max(off, std::abs(hidden.pixel(x, y)[i] - rgb));
              const double* a = alone.pixel(x, y);
              off = std::max(off, std::abs(over.pixel(x, y)[i] - (a[i] + (1 - a[3]) * rgb)));
            }
        EXPECT_LE(off, 1e-6);
      }
  });
}

TEST(Triangles, EndLineIntegralsAndMaxima) {
  // f = x: from x = 1 down to the plane at x = p the integral is (1 - p^2) / 2 and the maximum 1; from x = 0 up, p^2 / 2 and p
  const View view = orthographic(Vec3d(0.5, 0.52, 0.47), {-1, 0, 0}, 0.6);
  const double p = 0.37;
  for_each_filter([&](const EncodingCase& c) {
    const AmrHierarchy h = MeshBuilder(Vec3i(16)).root([](const Vec3d& q) { return q.x; }).hierarchy();
    const EncodedField field = build(h, c);
    for (const Mode mode : {Mode::projection, Mode::mip}) {
      Scene scene = triangle_scene(mode, Sampling::adaptive, {object(square({p, 0, 0}, {1, 0, 0}))}, view);
      scene.settings.step = 0.02;
      const Picture picture = render_on_cpu(h, field, scene, true);
      const double expected = mode == Mode::projection ? (1 - p * p) / 2 : 1;
      for (const double v : picture.values) EXPECT_NEAR(v, expected, mode == Mode::projection ? 3e-3 : 4e-2);
      scene.view = orthographic(Vec3d(0.5, 0.52, 0.47), {1, 0, 0}, 0.6);
      const Picture from_below = render_on_cpu(h, field, scene, true);
      for (const double v : from_below.values)
        EXPECT_NEAR(v, mode == Mode::projection ? p * p / 2 : p, mode == Mode::projection ? 3e-3 : 4e-2);
    }
  });
}

TEST(Triangles, JustBehindASurfaceDoNotHideIt) {
  // f = x on 8 cells crosses 0.5 at x = 0.5 under every filter, steps are three cells: the last sample lies far before the
  // triangle
  const AmrHierarchy h = MeshBuilder(Vec3i(8)).root([](const Vec3d& q) { return q.x; }).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c, {.storage = Storage::r64f});
    for (const Mode mode : {Mode::iso, Mode::dvr_iso})
      for (const Sampling sampling : kSamplings)
        for (const bool mirrored : {false, true})
          for (const double behind : {0.01, -0.01}) {
            const double x = mirrored ? 1.5 - behind : 0.5 - behind;
            Scene scene =
                triangle_scene(mode, sampling, {object(square({x, 0, 0}, {1, 0, 0}))}, orthographic(Vec3d(0.5), {-1, 0, 0}, 0.7));
            if (mirrored) {
              scene.settings.mirror = Mirror{0, true};
              scene.view.eye = {4, 0.5, 0.5};
            }
            scene.settings.step = 3;
            scene.transfer_function = constant_light(0);
            scene.settings.isosurfaces.values = {0.5};
            scene.settings.isosurfaces.opacity = {};
            scene.settings.isosurfaces.color = {{0.5, {1, 0, 0}}};
            // in the image the sides of the surface are swapped, not the order along the ray
            const Vec3d expected = behind > 0 ? Vec3d(1, 0, 0) : kColor;
            const Picture picture = render_on_cpu(h, field, scene, true);
            SCOPED_TRACE(fmt::format("{} {} {}", mode_name(mode), sampling_name(sampling), x));
            for (int y = 0; y < kPixels; ++y)
              for (int i = 0; i < 3; ++i) EXPECT_NEAR(picture.pixel(4, y)[i], expected[i], 1e-6);
          }
  });
}

TEST(Triangles, ConvergeToTheReferenceInEveryModeAndFilter) {
  std::vector<Triangle> inside = tetrahedron();
  for (const Triangle& t : square({0.7, 0.8, 0.6}, {1, 3, 1}, 0.3)) inside.push_back(t);
  for (const AmrHierarchy& h : {nested(waves).hierarchy(), holes_and_missing(waves).hierarchy()})
    for_each_filter([&](const EncodingCase& c) {
      const EncodedField field = build(h, c, {.storage = Storage::r64f});
      for (const Mode mode : kModes)
        for (const Sampling sampling : kSamplings) {
          SCOPED_TRACE(mode_name(mode));
          Scene scene = triangle_scene(mode, sampling,
                                       {object(inside), object(square({0.2, 0.2, 0.9}, {0, 1, 1}, 0.2), {1, 0, 0})}, oblique());
          scene.settings.step = 0.02;  // crossings of a corner that are shorter are not seen
          const Picture reference = HierarchyReference(h, 0, field.definition).render(scene, 0.25);
          const Picture picture = render_on_cpu(h, field, scene, true);
          EXPECT_LE(rms_difference(picture, reference), scene.settings.draws_surfaces() ? 4e-2 : 2e-2);
          scene.settings.triangles.clear();
          EXPECT_GT(rms_difference(picture, render_on_cpu(h, field, scene, true)), mode == Mode::mip ? 1e-2 : 3e-2)
              << "control: without them";
        }
    });
}

TEST(Triangles, AreTheSameOnGl) {
  // each mode with another encoding; dvr has its closed form above
  const AmrHierarchy h = nested(waves).hierarchy();
  GlPairs(2).for_each([&](const EncodingCase& c, std::size_t pair) {
    const EncodedField field = build(h, c);
    for (const Mode mode : {Mode::projection, Mode::dvr_iso}) {
      if (!in_turn(mode == Mode::projection ? 0 : 1, pair, 2)) continue;
      const Scene scene = triangle_scene(mode, Sampling::adaptive, {object(tetrahedron())}, oblique());
      EXPECT_LE(rms_difference(draw(context(ContextKind::egl), h, field, scene), render_on_cpu(h, field, scene, true)),
                !interpolating(c) || mode == Mode::dvr_iso ? 2e-2 : 1e-4);
    }
  });
}

TEST(Triangles, SkippingChangesNoBitOfThem) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for_each_filter([&](const EncodingCase& c) {
    const EncodedField field = build(h, c);
    for (const Mode mode : kModes) {
      Scene scene = triangle_scene(mode, Sampling::lattice, {object(tetrahedron())}, oblique());
      const Picture all = render_on_cpu(h, field, scene, false);
      scene.settings.skip = true;
      EXPECT_EQ(render_on_cpu(h, field, scene, false).values, all.values) << mode_name(mode);
    }
  });
}

// ---- leaving out, and bad input ----

TEST(Triangles, AreLeftOutOfScenesWithoutThem) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front());
  Scene scene = triangle_scene(Mode::dvr, Sampling::lattice, {}, oblique());
  const auto has = [&](const Scene& s) {
    const SceneBindings b = bind_scene(h, field, s);
    const bool define =
        std::any_of(b.defines.begin(), b.defines.end(), [](const auto& d) { return d.first == "AMRTEX_TRIANGLES"; });
    const bool uniform =
        std::any_of(b.uniforms.begin(), b.uniforms.end(), [](const auto& u) { return u.name == "u_triangle_colors"; });
    EXPECT_EQ(uniform, define);
    EXPECT_EQ(b.buffers.size(), define ? 1U : 0U);
    return define;
  };
  Context& gl = context(ContextKind::egl);
  const auto text = [&](const Scene& s, const char* entry) {
    return assemble_shader(SceneResources(gl, h, field, s).shader_key(entry, false));
  };
  EXPECT_FALSE(has(scene));
  const AssembledShader without = text(scene, "raycast.frag");
  EXPECT_EQ(without.text.find("AMRTEX_TRIANGLES"), std::string::npos);
  EXPECT_EQ(without.text.find("triangle_layer"), std::string::npos);
  const Structure structure(gl, field);
  const Raycaster plain(gl, h, structure, scene);
  ShaderKey vertex;
  vertex.entry = "fullscreen.vert";
  EXPECT_EQ(plain.shader_hash(), hash_text(assemble_shader(vertex).hash + without.hash)) << "what is drawn is that text";
  const auto cpu = make_cpu_field(field.encoding, Precision::single_precision);
  const Picture before = trace_on_cpu(*cpu, h, field, scene);

  scene.settings.triangles = {object(tetrahedron()), object(square(Vec3d(0.5), {1, 0, 0}, 0.2))};
  EXPECT_TRUE(has(scene));
  EXPECT_NE(text(scene, "raycast_triangles.frag").text.find("#define AMRTEX_TRIANGLES 2"), std::string::npos);
  EXPECT_NE(trace_on_cpu(*cpu, h, field, scene).values, before.values);
  scene.settings.triangles.clear();
  EXPECT_EQ(trace_on_cpu(*cpu, h, field, scene).values, before.values) << "nothing of them stays";
}

TEST(Triangles, AreRefusedByName) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const EncodedField field = build(h, encoding_cases().front(), {.draw_boxes = true});
  Context& gl = context(ContextKind::egl);
  const Structure structure(gl, field);
  Scene boxes = triangle_scene(Mode::dvr, Sampling::lattice, {object(tetrahedron())}, oblique());
  boxes.settings.consumer = ConsumerKind::multipass;
  try {
    BoxConsumer(gl, h, structure, boxes);
    ADD_FAILURE();
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("multipass"), HasSubstr("triangles")));
  }
  const auto complaint = [&](const Scene& scene) {
    EXPECT_THROW(HierarchyReference(h, 0, {}).render(scene, 1), UsageError);
    try {
      bind_scene(h, field, scene);
    } catch (const UsageError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  Scene scene = triangle_scene(Mode::iso, Sampling::lattice, {object(tetrahedron())}, oblique());
  scene.settings.isosurfaces.output = Output::depth;
  EXPECT_THAT(complaint(scene), AllOf(HasSubstr("'triangles'"), HasSubstr("output color"), HasSubstr("depth")));
  scene.settings.isosurfaces.output = Output::color;
  scene.settings.triangles.resize(17, scene.settings.triangles.front());
  EXPECT_THAT(complaint(scene), AllOf(HasSubstr("17"), HasSubstr("at most 16")));
  scene.settings.triangles.resize(2);
  scene.settings.triangles[1].color = {0, kNan, 0};
  EXPECT_THAT(complaint(scene), AllOf(HasSubstr("'triangles'[1].color"), HasSubstr("from 0 to 1")));
  EXPECT_THROW(TriangleMesh({}), Error);
  EXPECT_THROW(TriangleMesh({{Vec3d(0), Vec3d(kInf), Vec3d(1)}}), Error);
}

}  // namespace
}  // namespace amrtex
