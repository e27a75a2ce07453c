// The double-precision reference against closed forms, hand-made cases and oracles made by yt.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/reference/reference_field.hpp"
#include "renderers/reference/reference_tracer.hpp"
#include "structures/generators/random_mesh.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
using Function = std::function<double(const Vec3d&)>;  // of the cell's centre, world

// ---- meshes ----

MeshDescription domain(const Vec3i& root, std::vector<int> ratios, const Vec3d& lower = Vec3d(0), const Vec3d& upper = Vec3d(1)) {
  MeshDescription mesh;
  mesh.name = "hand-made";
  mesh.domain_lower = lower;
  mesh.domain_upper = upper;
  mesh.root_cells = root;
  mesh.levels.resize(ratios.size() + 1);
  mesh.ratios = std::move(ratios);
  mesh.fields = {"f"};
  return mesh;
}

void add_patch(MeshDescription& mesh, int level, const Box& box, const Function& f) {
  Vec3d cells(mesh.root_cells);
  for (int l = 0; l < level; ++l) cells *= mesh.ratios[static_cast<std::size_t>(l)];
  std::vector<double> values;
  for_each_cell(box, [&](const Vec3i& c) {
    values.push_back(f(mesh.domain_lower + (Vec3d(c) + 0.5) / cells * (mesh.domain_upper - mesh.domain_lower)));
  });
  mesh.levels[static_cast<std::size_t>(level)].push_back({box, {CellValues(values)}});
}

/// What a file stores under finer patches must not matter.
double poison(const Vec3d&) { return 1e30; }

/// One level of n^3 cells over the unit cube.
AmrHierarchy uniform(int n, const Function& f) {
  MeshDescription mesh = domain(Vec3i(n), {});
  add_patch(mesh, 0, {Vec3i(0), Vec3i(n)}, f);
  return AmrHierarchy(std::move(mesh));
}

/// Three levels; level 0 has a patch wholly under level 1, whose values are poison.
AmrHierarchy nested(const Function& f, std::vector<int> ratios = {2, 2}, const Vec3d& lower = Vec3d(0),
                    const Vec3d& upper = Vec3d(1)) {
  const int r1 = ratios[0];
  const int r2 = ratios[1];
  MeshDescription mesh = domain(Vec3i(6), ratios, lower, upper);
  const Box middle{Vec3i(2), Vec3i(4)};
  for_each_cell(Box{Vec3i(0), Vec3i(3)}, [&](const Vec3i& b) {
    const Box box{b * 2, b * 2 + Vec3i(2)};
    add_patch(mesh, 0, box, box == middle ? Function(poison) : f);
  });
  add_patch(mesh, 1, middle.refined(r1), f);
  add_patch(mesh, 2, Box{Vec3i(2, 2, 2) * r1, Vec3i(3, 3, 4) * r1}.refined(r2), f);
  return AmrHierarchy(std::move(mesh));
}

/// Leaves of level 2 beside leaves of level 0; level 1 is empty.
AmrHierarchy jump_of_two(const Function& f) {
  MeshDescription mesh = domain(Vec3i(4), {2, 2});
  add_patch(mesh, 0, {Vec3i(0), Vec3i(4)}, f);
  add_patch(mesh, 2, {Vec3i(4), Vec3i(12, 8, 12)}, f);
  return AmrHierarchy(std::move(mesh));
}

double waves(const Vec3d& p) { return 2 + std::sin(5 * p.x + 1) * std::cos(4 * p.y) + p.z * p.z * std::sin(9 * p.x); }
double plane(const Vec3d& p) { return 1 + 2 * p.x - 3 * p.y + 0.5 * p.z; }

std::vector<FilterDefinition> all_definitions() {
  return {{Filter::nearest},           {Filter::linear_lod},    {Filter::linear_page, 4},
          {Filter::linear_page, 0, 1}, {Filter::linear_vertex}, {Filter::basis}};
}

std::string text(const FilterDefinition& d) { return fmt::format("{} {} {}", filter_name(d.filter), d.page_size, d.page_level); }

double sample(const AmrHierarchy& h, const FilterDefinition& d, const Vec3d& p) {
  return HierarchyReference(h, 0, d).sample(p).value_or(kNan);
}

std::vector<Vec3d> random_points(int n, const Vec3d& lower, const Vec3d& upper) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Vec3d> points;
  for (int i = 0; i < n; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    points.push_back(lower + Vec3d(x, y, z) * (upper - lower));
  }
  return points;
}

// ---- pictures ----

/// A picture of one pixel: the ray through `p` along `direction`, from far enough outside.
Scene one_ray(Mode mode, const Vec3d& p, const Vec3d& direction, double distance = 3) {
  Scene scene;
  scene.settings.mode = mode;
  scene.settings.width = scene.settings.height = 1;
  scene.view.orthographic = true;
  scene.view.eye = p - glm::normalize(direction) * distance;
  scene.view.at = scene.view.eye + glm::normalize(direction) * distance;
  scene.view.up = std::abs(direction.z) > 0.9 * glm::length(direction) ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
  scene.view.height = distance * 1e-3;
  return scene;
}

Scene lit_ray(const Vec3d& p, const Vec3d& direction, TransferFunction tf) {
  Scene scene = one_ray(Mode::dvr, p, direction);
  scene.transfer_function = std::move(tf);
  return scene;
}

TransferFunction constant_light(double extinction, const Vec3d& rgb = Vec3d(0.8, 0.4, 0.2)) {
  TransferFunction tf;
  tf.extinction = {{0, extinction}};
  tf.color = {{0, rgb}};
  return tf;
}

std::vector<double> draw(const AmrHierarchy& h, const FilterDefinition& d, const Scene& scene, double step = 1.0 / 16) {
  return HierarchyReference(h, 0, d).render(scene, step).values;
}

/// Length of the line through p in the unit cube.
double chord(const Vec3d& p, const Vec3d& direction) {
  const Vec3d d = glm::normalize(direction);
  double from = -kInf;
  double to = kInf;
  for (int a = 0; a < 3; ++a) {
    if (d[a] == 0) continue;
    from = std::max(from, std::min(-p[a] / d[a], (1 - p[a]) / d[a]));
    to = std::min(to, std::max(-p[a] / d[a], (1 - p[a]) / d[a]));
  }
  return to - from;
}

const std::vector<Vec3d> kDirections{{1, 0, 0},  {0, -1, 0}, {0, 0, 1},   {1, 1, 0},
                                     {-1, 1, 1}, {1, 2, 3},  {-3, 1, -2}, {1, 1e-9, -1e-7}};

// ---- light ----

TEST(ReferenceLight, ConstantSlabFaceOnAndOblique) {
  // C = c (1 - exp(-k L)), A = 1 - exp(-k L)
  const AmrHierarchy h = nested([](const Vec3d&) { return 1.0; });
  const double k = 7;
  for (const auto& definition : all_definitions())
    for (const Vec3d& direction : kDirections) {
      const Vec3d p(0.4, 0.55, 0.47);
      const auto pixel = draw(h, definition, lit_ray(p, direction, constant_light(k)));
      const double a = -std::expm1(-k * chord(p, direction));
      EXPECT_NEAR(pixel[3], a, 1e-12) << text(definition);
      EXPECT_NEAR(pixel[0], 0.8 * a, 1e-12) << text(definition);
    }
}

TEST(ReferenceLight, LengthUnitIsLongestEdgeOrWorld) {
  MeshDescription mesh = domain({4, 2, 2}, {}, {-3, 0, 1}, {5, 4, 5});  // edges 8, 4, 4
  add_patch(mesh, 0, {Vec3i(0), {4, 2, 2}}, [](const Vec3d&) { return 1.0; });
  const AmrHierarchy h(std::move(mesh));
  Scene scene = one_ray(Mode::dvr, {1, 2, 3}, {0, 1, 0}, 20);
  scene.transfer_function = constant_light(3);
  EXPECT_NEAR(draw(h, {}, scene)[3], -std::expm1(-3 * 4.0 / 8), 1e-14);
  scene.transfer_function.length_unit = TransferFunction::LengthUnit::world;
  EXPECT_NEAR(draw(h, {}, scene)[3], -std::expm1(-3 * 4.0), 1e-14);
}

TEST(ReferenceLight, LinearExtinctionAndColorAlongTheRay) {
  // f = x; k = a x, c = x on [x0, x1]: C = x0 - x1 T + e^(a x0^2 / 2) sqrt(pi / 2a) (erf(x1 sqrt(a/2)) - erf(x0 sqrt(a/2)))
  const AmrHierarchy h = uniform(4, [](const Vec3d& p) { return p.x; });
  const double a = 9;
  TransferFunction tf;
  tf.extinction = {{0, 0}, {1, a}};
  tf.color = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
  Scene scene = lit_ray({0.5, 0.4, 0.45}, {1, 0, 0}, tf);
  const double x0 = 0.125;
  const double x1 = 0.875;
  scene.region = {Vec3d(x0, 0, 0), Vec3d(x1, 1, 1)};
  const double t = std::exp(-a * (x1 * x1 - x0 * x0) / 2);
  const double c = x0 - x1 * t +
                   std::exp(a * x0 * x0 / 2) * std::sqrt(std::numbers::pi / (2 * a)) *
                       (std::erf(x1 * std::sqrt(a / 2)) - std::erf(x0 * std::sqrt(a / 2)));
  std::vector<double> errors;
  for (const double step : {1.0, 0.5, 0.25, 0.0625}) {
    const auto pixel = draw(h, {Filter::linear_lod}, scene, step);
    EXPECT_NEAR(pixel[3], 1 - t, 1e-14) << "two Gauss points are exact for the optical depth";
    errors.push_back(std::abs(pixel[0] - c));
  }
  EXPECT_LT(errors[3], 1e-8);
  EXPECT_GT(errors[0] / errors[1], 12) << "order 4";
  EXPECT_GT(errors[1] / errors[2], 12) << "order 4";
}

TEST(ReferenceLight, PeakNarrowerThanACellIsNotMissed) {
  // over f = x a triangle of half width w and height k has optical depth k w, wherever it lies
  const AmrHierarchy h = uniform(8, [](const Vec3d& p) { return p.x; });
  for (const double at : {0.31, 0.4375, 0.5, 0.6123}) {
    TransferFunction tf = constant_light(0);
    tf.extinction = {{at - 1e-3, 0}, {at, 900}, {at + 1e-3, 0}};
    EXPECT_NEAR(draw(h, {Filter::linear_lod}, lit_ray({0.5, 0.4, 0.45}, {1, 0, 0}, tf), 4)[3], -std::expm1(-0.9), 1e-11);
  }
}

TEST(ReferenceLight, StiffEmptyAndInfiniteExtinction) {
  const AmrHierarchy h = nested(waves);
  for (const auto& definition : all_definitions()) {
    double last = 0;
    for (const double k : {0.0, 1.0, 1e3, 1e6, 1e300, kInf}) {
      TransferFunction tf = constant_light(k);
      tf.extinction = {{0, 0}, {2, k}};
      tf.color = {{0, {0, 0, 0}}, {4, {1, 1, 1}}};
      const auto pixel = draw(h, definition, lit_ray({0.4, 0.55, 0.47}, {1, 2, 3}, tf));
      for (const double v : pixel) EXPECT_TRUE(v >= 0 && v <= 1) << text(definition) << " " << k << " " << v;
      EXPECT_GE(pixel[3], last - 1e-12);
      last = pixel[3];
    }
    EXPECT_NEAR(last, 1, 1e-12);
  }
}

TEST(ReferenceLight, ConvergedAtUsualSteps) {
  const AmrHierarchy h = nested(waves);
  TransferFunction tf;
  tf.extinction = {{0.5, 0}, {1.5, 3}, {2.2, 1}, {3, 30}};
  tf.color = {{0, {1, 0, 0}}, {2, {0, 1, 0.3}}, {4, {0, 0.5, 1}}};
  for (const bool logarithmic : {false, true}) {
    tf.logarithmic = logarithmic;
    if (logarithmic) tf.color[0].value = 0.1;
    for (const auto& definition : all_definitions()) {
      const Scene scene = lit_ray({0.42, 0.55, 0.47}, {1, 2, 3}, tf);
      const auto coarse = draw(h, definition, scene, 0.125);
      const auto fine = draw(h, definition, scene, 1.0 / 64);
      for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(coarse[c], fine[c], 1e-8) << text(definition);
    }
  }
}

TEST(ReferenceLight, AgreesWithPlainMarchingThroughSample) {
  // a second route to the same picture: many short steps of sample(), split nowhere
  const AmrHierarchy h = nested(waves, {2, 4});
  TransferFunction tf;
  tf.extinction = {{0.5, 0}, {1.5, 3}, {3, 9}};
  tf.color = {{0, {1, 0, 0}}, {4, {0, 1, 0.3}}};
  const Vec3d p(0.42, 0.55, 0.47);
  const Vec3d direction = glm::normalize(Vec3d(1, 2, 3));
  const double length = chord(p, direction);
  const double from = std::max({-p.x / direction.x, -p.y / direction.y, -p.z / direction.z});
  constexpr int kSteps = 40000;
  for (const auto& definition : all_definitions()) {
    const HierarchyReference reference(h, 0, definition);
    double integral = 0, most = -kInf, transmittance = 1;
    Vec3d color(0);
    for (int i = 0; i < kSteps; ++i) {
      const double f = reference.sample(p + direction * (from + (i + 0.5) / kSteps * length)).value();
      const double opacity = -std::expm1(-tf.extinction_at(f) * length / kSteps);
      integral += f * length / kSteps;
      most = std::max(most, f);
      color += transmittance * opacity * tf.color_at(f);
      transmittance *= 1 - opacity;
    }
    const bool continuous = definition.filter == Filter::linear_vertex || definition.filter == Filter::basis;
    const double tolerance = continuous ? 1e-8 : 3e-4;  // a jump is misplaced by up to half a step
    EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, p, direction))[0], integral, tolerance) << text(definition);
    EXPECT_NEAR(draw(h, definition, one_ray(Mode::mip, p, direction))[0], most, continuous ? 1e-4 : 3e-4) << text(definition);
    const auto pixel = draw(h, definition, lit_ray(p, direction, tf));
    EXPECT_NEAR(pixel[3], 1 - transmittance, tolerance) << text(definition);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[static_cast<std::size_t>(c)], color[c], tolerance) << text(definition);
  }
}

// ---- the way of a ray ----

TEST(ReferenceRay, PiecesAddUpToTheChordAlsoInFacesEdgesAndCorners) {
  const AmrHierarchy h = nested([](const Vec3d&) { return 1.0; });
  for (const auto& definition : all_definitions())
    for (const Vec3d& p : {Vec3d(0.5), Vec3d(1.0 / 3, 0.5, 0.5), Vec3d(5.0 / 12, 2.0 / 3, 0.4375), Vec3d(0.3, 0.9, 0.01)})
      for (const Vec3d& direction : kDirections)
        EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, p, direction))[0], chord(p, direction), 1e-12)
            << text(definition) << " " << direction.x << " " << direction.y << " " << direction.z;
}

TEST(ReferenceRay, InTheDomainsFacesAndOutside) {
  const AmrHierarchy h = nested([](const Vec3d& p) { return p.y < 0.5 ? 1.0 : 2.0; });
  const auto integral = [&](double y) { return draw(h, {}, one_ray(Mode::projection, {0.5, y, 0.7}, {1, 0, 0}))[0]; };
  EXPECT_DOUBLE_EQ(integral(0), 1);
  EXPECT_DOUBLE_EQ(integral(1), 2) << "the domain's last face belongs to its last cell";
  EXPECT_DOUBLE_EQ(integral(0.5), 2) << "a face belongs to the upper cell";
  EXPECT_EQ(integral(-1e-12), 0);
  EXPECT_EQ(integral(1 + 1e-12), 0);
}

TEST(ReferenceRay, StartsAtTheEyeInsideTheMesh) {
  const AmrHierarchy h = nested([](const Vec3d&) { return 1.0; });
  Scene scene = one_ray(Mode::projection, {0.5, 0.5, 0.5}, {1, 0, 0}, 0.25);
  EXPECT_NEAR(draw(h, {Filter::linear_vertex}, scene)[0], 0.75, 1e-14);
  scene.view.orthographic = false;
  EXPECT_NEAR(draw(h, {Filter::linear_vertex}, scene)[0], 0.75, 1e-14);
}

TEST(ReferenceRay, FarOriginsHugeCellsAndAnisotropy) {
  const Vec3d size(3e24, 1e24, 2e24);
  const AmrHierarchy h =
      nested([](const Vec3d&) { return 1.0; }, {2, 2}, 1e24 * Vec3d(50, -70, 10), 1e24 * Vec3d(50, -70, 10) + size);
  for (const auto& definition : all_definitions()) {
    const Vec3d p = h.domain_lower() + size * 0.45;
    EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, p, {0, 1, 0}, 1e25))[0] / size.y, 1, 1e-12);
    EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, p, size, 1e25))[0] / glm::length(size), 1, 1e-12);
  }
}

TEST(ReferenceRay, RegionCutsWithoutChangingTheField) {
  const AmrHierarchy h = nested(waves);
  for (const auto& definition : all_definitions()) {
    Scene scene = one_ray(Mode::projection, {0.45, 0.55, 0.5}, {1, 0.2, 0.1});
    const double all = draw(h, definition, scene)[0];
    scene.region = {Vec3d(-1, -1, -1), Vec3d(0.4321, 2, 2)};
    const double left = draw(h, definition, scene)[0];
    scene.region = {Vec3d(0.4321, -1, -1), Vec3d(2, 2, 2)};
    EXPECT_NEAR(left + draw(h, definition, scene)[0], all, 1e-12) << text(definition);
  }
}

TEST(ReferenceRay, SameBitsAtAnyThreadCount) {
  const AmrHierarchy h = nested(waves);
  Scene scene;
  scene.settings.width = 70;
  scene.settings.height = 50;
  scene.view.eye = {2, 1.4, 1.1};
  scene.view.at = Vec3d(0.5);
  scene.transfer_function = constant_light(1);
  scene.transfer_function.extinction = {{1, 0}, {3, 20}};
  for (const auto& definition : all_definitions()) {
    const HierarchyReference reference(h, 0, definition);
    const Picture all = reference.render(scene, 0.5);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(reference.render(scene, 0.5).values, all.values) << text(definition);
  }
}

TEST(ReferenceRay, ProjectionAndMaximumInClosedForm) {
  // f = x y on the diagonal x = 1/2 + s, y = 1/2 - s is 1/4 - s^2
  const AmrHierarchy h = uniform(8, [](const Vec3d& p) { return p.x * p.y; });
  const double half = 0.25;  // s at the region's border
  Scene scene = one_ray(Mode::projection, Vec3d(0.5, 0.5, 0.4), {1, -1, 0});
  scene.region = {Vec3d(0.5 - half, 0.5 - half, 0), Vec3d(0.5 + half, 0.5 + half, 1)};
  const double integral = std::sqrt(2.0) * (2 * half * 0.25 - 2 * std::pow(half, 3) / 3);
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene, 4)[0], integral, 1e-14);
  scene.settings.mode = Mode::mip;
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, scene, 4)[0], 0.25, 1e-14);
  EXPECT_NEAR(draw(h, {Filter::linear_lod}, one_ray(Mode::mip, {0.5, 0.5, 2}, {1, -1, 0}))[0], 0, 0) << "no mesh";
}

TEST(ReferenceRay, MaximumOfNegativeValuesIsNegative) {
  const AmrHierarchy h = nested([](const Vec3d& p) { return -1 - p.x; });
  EXPECT_NEAR(draw(h, {}, one_ray(Mode::mip, {0.5, 0.1, 0.1}, {1, 0, 0}))[0], -1 - 1.0 / 12, 1e-14);
}

TEST(ReferenceRay, RefusesBadStepsAndPictures) {
  const AmrHierarchy h = nested(waves);
  EXPECT_THROW(draw(h, {}, one_ray(Mode::mip, Vec3d(0.5), {1, 0, 0}), 0), Error);
  Scene scene = one_ray(Mode::mip, Vec3d(0.5), {1, 0, 0});
  scene.settings.width = 0;
  EXPECT_THROW(draw(h, {}, scene), Error);
  EXPECT_THROW(HierarchyReference(h, 0, {Filter::linear_page, 0, 3}), Error);
  EXPECT_THROW(HierarchyReference(h, 0, {Filter::linear_page, -1}), Error);
}

// ---- filters ----

TEST(ReferenceFilter, ConstantsAreReproducedAcrossLevels) {
  const auto constant = [](const Vec3d&) { return 3.7; };
  for (const AmrHierarchy& h : {nested(constant), nested(constant, {4, 2}), nested(constant, {2, 4}), jump_of_two(constant)})
    for (const auto& definition : all_definitions()) {
      const HierarchyReference reference(h, 0, definition);
      for (const Vec3d& p : random_points(300, Vec3d(0), Vec3d(1))) {
        if (definition.filter == Filter::basis)
          EXPECT_DOUBLE_EQ(reference.sample(p).value(), 3.7);
        else
          EXPECT_EQ(reference.sample(p).value(), 3.7) << text(definition);
      }
    }
}

TEST(ReferenceFilter, LinearFieldsAreReproducedInsideALevel) {
  const AmrHierarchy h = uniform(8, plane);
  for (const Filter filter : {Filter::linear_lod, Filter::linear_page, Filter::linear_vertex, Filter::basis})
    for (const Vec3d& p : random_points(200, Vec3d(0.125), Vec3d(0.875)))
      EXPECT_NEAR(sample(h, {filter, filter == Filter::linear_page ? 4 : 0}, p), plane(p), 1e-13) << filter_name(filter);
  const AmrHierarchy levels = nested(plane, {4, 2});
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex})
    for (const Vec3d& p : random_points(200, Vec3d(0.375), Vec3d(0.45)))  // two finest cells from any coarser one
      EXPECT_NEAR(sample(levels, {filter}, p), plane(p), 1e-13) << filter_name(filter);
}

TEST(ReferenceFilter, ValuesStayWithinTheMeshsRange) {
  const AmrHierarchy h = nested(waves, {4, 2});
  for (const auto& definition : all_definitions()) {
    const HierarchyReference reference(h, 0, definition);
    for (const Vec3d& p : random_points(500, Vec3d(0), Vec3d(1))) {
      EXPECT_GE(reference.sample(p).value(), h.statistics(0).min - 1e-12);
      EXPECT_LE(reference.sample(p).value(), h.statistics(0).max + 1e-12);
    }
  }
}

/// Largest jump of f across the faces of the box (world), at random points of these.
double largest_jump(const AmrHierarchy& h, Filter filter, const Vec3d& lower, const Vec3d& upper) {
  const HierarchyReference reference(h, 0, {filter});
  double jump = 0;
  for (const Vec3d& p : random_points(200, lower, upper))
    for (int a = 0; a < 3; ++a)
      for (const double face : {lower[a], upper[a]}) {
        Vec3d before = p;
        Vec3d behind = p;
        before[a] = face - 1e-13;
        behind[a] = face + 1e-13;
        jump = std::max(jump, std::abs(reference.sample(before).value() - reference.sample(behind).value()));
      }
  return jump;
}

TEST(ReferenceFilter, VertexAndBasisAreContinuousAcrossLevelsAndOthersAreNot) {
  const auto check = [](const AmrHierarchy& h, const Vec3d& lower, const Vec3d& upper) {
    for (const Filter filter : {Filter::linear_vertex, Filter::basis})
      EXPECT_LT(largest_jump(h, filter, lower, upper), 1e-9) << filter_name(filter);
    for (const Filter filter : {Filter::nearest, Filter::linear_lod})
      EXPECT_GT(largest_jump(h, filter, lower, upper), 1e-3) << filter_name(filter);
  };
  for (const std::vector<int>& ratios : {std::vector<int>{2, 2}, {4, 2}, {2, 4}, {3, 2}, {8, 8}}) {
    const AmrHierarchy h = nested(waves, ratios);
    check(h, Vec3d(2.0 / 6), Vec3d(4.0 / 6));                    // level 0 to 1 and to 2
    check(h, Vec3d(2.0 / 6), Vec3d(3.0 / 6, 3.0 / 6, 4.0 / 6));  // all three
  }
  check(jump_of_two(waves), Vec3d(0.25), {0.75, 0.5, 0.75});
}

TEST(ReferenceFilter, HangingVerticesTakeTheCoarseFacesValue) {
  // 2^3 cells with values 1 to 8 (x fastest); the first is refined into 8 cells of 10, 20, ...
  MeshDescription mesh = domain(Vec3i(2), {2}, Vec3d(0), Vec3d(2));
  double next = 1;
  add_patch(mesh, 0, {Vec3i(0), Vec3i(2)}, [&](const Vec3d&) { return next++; });
  next = 10;
  add_patch(mesh, 1, {Vec3i(0), Vec3i(2)}, [&](const Vec3d&) { return std::exchange(next, next + 10); });
  const AmrHierarchy h(std::move(mesh));
  const std::array<double, 8> v{45, 2, 3, 4, 5, 6, 7, 8};  // v_0: the first is the mean of 10 to 80
  // vertices of the face between cells 0 and 1, clamped at the domain's border
  const double a = (v[0] + v[1]) / 2;
  const double b = (v[0] + v[1] + v[2] + v[3]) / 4;
  const double c = (v[0] + v[1] + v[4] + v[5]) / 4;
  const double d = (v[0] + v[1] + v[2] + v[3] + v[4] + v[5] + v[6] + v[7]) / 8;
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {1, 0.5, 0.5}), (a + b + c + d) / 4, 1e-13) << "middle of the coarse face";
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {1, 1, 0.5}), (b + d) / 2, 1e-13) << "middle of the coarse edge";
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {1, 1, 1}), d, 1e-13) << "the coarse vertex";
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {0.5, 0.5, 0.5}), 45, 1e-13) << "inside the fine patch: mean of the 8";
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {0.75, 0.5, 0.5}), (45 + (a + b + c + d) / 4) / 2, 1e-13);
  EXPECT_NEAR(sample(h, {Filter::linear_vertex}, {0, 0, 0}), 10, 1e-13) << "clamped at the domain's corner";
}

TEST(ReferenceFilter, BasisByHand) {
  MeshDescription mesh = domain({2, 1, 1}, {2}, Vec3d(0), {2, 1, 1});
  add_patch(mesh, 0, {Vec3i(0), {2, 1, 1}}, [](const Vec3d&) { return 8.0; });
  add_patch(mesh, 1, {Vec3i(0), Vec3i(2)}, [](const Vec3d& p) { return p.x < 0.5 ? 1.0 : 2.0; });
  const AmrHierarchy h(std::move(mesh));
  const auto f = [&](double x) { return sample(h, {Filter::basis}, {x, 0.5, 0.5}); };
  // at y = z = 1/2 the four fine cells of a layer weigh 4 (1/2)^2 = 1, times their hat along x; so does the coarse cell
  EXPECT_NEAR(f(0.1), 1, 1e-14);
  EXPECT_NEAR(f(0.5), 1.5, 1e-14);
  EXPECT_NEAR(f(0.75), (1 * 2 + 0.25 * 8) / 1.25, 1e-14);
  EXPECT_NEAR(f(0.6), (0.7 * 2 + 0.3 * 1 + 0.1 * 8) / 1.1, 1e-14);
  EXPECT_NEAR(f(1.0), (0.5 * 2 + 0.5 * 8) / 1, 1e-14);
  EXPECT_NEAR(f(1.2), (0.1 * 2 + 0.7 * 8) / 0.8, 1e-14);
  EXPECT_NEAR(f(1.25), 8, 1e-14) << "the fine cells reach half their width past their box";
  EXPECT_NEAR(f(1.9), 8, 1e-14);
}

TEST(ReferenceFilter, BasisIsTheSumOverAllLeaves) {
  const AmrHierarchy h = nested(waves, {2, 4});
  const HierarchyReference reference(h, 0, {Filter::basis});
  for (const Vec3d& p : random_points(200, Vec3d(0), Vec3d(1))) {
    double numerator = 0;
    double denominator = 0;
    for (int l = 0; l < h.level_count(); ++l)
      for (std::size_t k = 0; k < h.patches(l).size(); ++k) {
        const Patch& patch = h.patches(l)[k];
        for_each_cell(patch.box, [&](const Vec3i& c) {
          if (h.leaf_mask(l, static_cast<int>(k))[patch.box.offset(c)] == 0) return;
          const Vec3d far = glm::abs((Vec3d(c) + 0.5) - p * Vec3d(h.cells(l)));
          const double hat = std::max(1 - far.x, 0.0) * std::max(1 - far.y, 0.0) * std::max(1 - far.z, 0.0);
          numerator += hat * patch.values[0][patch.box.offset(c)];
          denominator += hat;
        });
      }
    EXPECT_NEAR(reference.sample(p).value(), numerator / denominator, 1e-13);
  }
}

TEST(ReferenceFilter, PagesMayBeFinerThanAllTheirLeaves) {
  MeshDescription mesh = domain(Vec3i(8), {2}, Vec3d(0), Vec3d(8));
  add_patch(mesh, 0, {Vec3i(0), Vec3i(8)}, waves);
  add_patch(mesh, 1, {Vec3i(0), Vec3i(4)}, waves);  // refines the cells [0, 2)^3
  const AmrHierarchy h(std::move(mesh));
  // with pages of 4^3, the page of the cells [0, 4)^3 falls into pages of level 1, all the others stay
  const FilterDefinition page{Filter::linear_page, 4};
  const double own = sample(h, {Filter::nearest}, {3.5, 3.5, 3.5});
  EXPECT_NEAR(sample(h, page, {3.3, 3.6, 3.7}), own, 1e-14)
      << "level 1 is constant between the centres of a coarse cell's children";
  EXPECT_GT(std::abs(sample(h, {Filter::linear_lod}, {3.3, 3.6, 3.7}) - own), 1e-3);
  const double beside = sample(h, {Filter::nearest}, {4.5, 3.5, 3.5});
  EXPECT_NEAR(sample(h, page, {3.9, 3.5, 3.5}), own + (beside - own) * 0.3, 1e-13)
      << "a page's border has its own level's values";
  for (const Vec3d& p : random_points(100, {4, 0, 0}, {8, 8, 8}))
    EXPECT_EQ(sample(h, page, p), sample(h, {Filter::linear_lod}, p)) << "pages and leaves of one level";
  EXPECT_EQ(sample(h, {Filter::linear_page, 2}, {3.3, 3.6, 3.7}), sample(h, {Filter::linear_lod}, {3.3, 3.6, 3.7}))
      << "smaller pages";
  for (const Vec3d& p : random_points(100, Vec3d(0), Vec3d(8))) {
    const double coarse = sample(h, {Filter::linear_page, 0, 0}, p);
    EXPECT_GE(coarse, h.statistics(0).min);
    if (glm::any(glm::greaterThan(p, Vec3d(2.5)))) {
      EXPECT_EQ(coarse, sample(h, {Filter::linear_lod}, p)) << "one page of level 0";
    }
  }
}

TEST(ReferenceFilter, RefinedCellsTakeTheMeanOfTheirLeavesAlsoWhereNoPatchStoresThem) {
  for (const bool stored : {true, false}) {
    MeshDescription mesh = domain({2, 1, 1}, {2, 2});
    if (stored)
      add_patch(mesh, 0, {Vec3i(0), {2, 1, 1}}, poison);
    else
      add_patch(mesh, 0, {{1, 0, 0}, {2, 1, 1}}, poison);
    mesh.levels[0][0].values[0].set(mesh.levels[0][0].values[0].size() - 1, 100);
    // cell 0 holds six leaves of level 1 with value 2, one of NaN, and one refined into 8 of which one is infinite
    add_patch(mesh, 1, {Vec3i(0), Vec3i(2)}, [](const Vec3d& p) { return p.x < 0.25 && p.y < 0.5 && p.z < 0.5 ? kNan : 2.0; });
    double next = 0;
    add_patch(mesh, 2, {{2, 2, 2}, {4, 4, 4}}, [&](const Vec3d&) { return next++ == 0 ? kInf : 10.0; });
    const AmrHierarchy h(std::move(mesh));
    const ReferenceField field(h, 0);
    // six cells of 2 and 7/8 of a cell of 10
    EXPECT_NEAR(field.level_value(0, {0, 0, 0}), (6 * 2 + 0.875 * 10) / 6.875, 1e-14);
    EXPECT_NEAR(field.level_value(1, {1, 1, 1}), 10, 0);
    EXPECT_EQ(field.level_value(0, {1, 0, 0}), 100);
    EXPECT_EQ(field.level_value(2, {5, 1, 3}), 100) << "inside a coarser leaf";
    EXPECT_TRUE(std::isnan(field.level_value(1, {0, 0, 0})));
    EXPECT_TRUE(std::isnan(field.level_value(1, {0, 0, -1})));
    EXPECT_TRUE(field.has_missing());
  }
}

TEST(ReferenceFilter, FillsAreFaceElseEdgeElseCornerNeighbours) {
  // 3^3 cells with value 100 z + 10 y + x, the middle one without a value, and more besides
  const auto field_without = [](const std::function<bool(const Vec3i&)>& missing) {
    return uniform(3, [&](const Vec3d& p) {
      const Vec3i c(p * 3.0);
      if (!missing(c)) return 100.0 * c.z + 10 * c.y + c.x;
      return (c.x + c.y) % 2 == 0 ? kNan : -kInf;
    });
  };
  const auto distance = [](const Vec3i& c) { return std::abs(c.x - 1) + std::abs(c.y - 1) + std::abs(c.z - 1); };
  const Vec3i middle(1);
  const AmrHierarchy only_middle = field_without([&](const Vec3i& c) { return distance(c) == 0; });
  EXPECT_DOUBLE_EQ(ReferenceField(only_middle, 0).filled_value(0, middle), 111) << "mean of six";
  const AmrHierarchy two = field_without([&](const Vec3i& c) { return distance(c) == 0 || c == Vec3i(0, 1, 1); });
  EXPECT_DOUBLE_EQ(ReferenceField(two, 0).filled_value(0, middle), (112 + 101 + 121 + 11 + 211) / 5.0) << "mean of five";
  const AmrHierarchy faces = field_without([&](const Vec3i& c) { return distance(c) <= 1 || c == Vec3i(0, 0, 1); });
  EXPECT_DOUBLE_EQ(ReferenceField(faces, 0).filled_value(0, middle), (12 * 111 - 100) / 11.0) << "mean of eleven edge neighbours";
  const AmrHierarchy edges = field_without([&](const Vec3i& c) { return distance(c) <= 2 || c == Vec3i(2); });
  EXPECT_DOUBLE_EQ(ReferenceField(edges, 0).filled_value(0, middle), (8 * 111 - 222) / 7.0) << "mean of seven corner neighbours";
  const ReferenceField field(only_middle, 0);
  EXPECT_EQ(field.filled_value(0, {-1, 2, 1}), 120) << "outside: clamped at a face";
  EXPECT_EQ(field.filled_value(0, {3, 2, 3}), 222) << "... at an edge";
  EXPECT_EQ(field.filled_value(0, {-1, -1, 3}), 200) << "... and at a corner";
  EXPECT_TRUE(std::isnan(field.filled_value(0, {-2, 0, 0}))) << "two cells out";
  EXPECT_FALSE(HierarchyReference(only_middle, 0, {Filter::linear_lod}).sample(Vec3d(0.5)))
      << "the missing cell itself has no value";
  EXPECT_NEAR(sample(only_middle, {Filter::linear_lod}, {1.0 / 3 - 1e-15, 0.5, 0.5}), (110 + 111) / 2.0, 1e-10)
      << "its neighbour sees the fill";
  EXPECT_NEAR(sample(only_middle, {Filter::basis}, {1.0 / 3 - 1e-15, 0.5, 0.5}), 110, 1e-10) << "basis leaves it out";
}

TEST(ReferenceFilter, HolesAreTransparent) {
  for (const std::vector<int>& ratios : {std::vector<int>{2, 2}, {3, 2}}) {
    MeshDescription mesh = domain(Vec3i(4), ratios);
    for_each_cell(Box{Vec3i(0), Vec3i(4)}, [&](const Vec3i& c) {
      if (c != Vec3i(1, 2, 2) && c != Vec3i(2, 2, 2)) add_patch(mesh, 0, {c, c + Vec3i(1)}, [](const Vec3d&) { return 5.0; });
    });
    add_patch(mesh, 1, Box{{2, 2, 2}, {3, 3, 3}}.refined(ratios[0]), [](const Vec3d& p) { return p.x < 0.6 ? kNan : 5.0; });
    const AmrHierarchy h(std::move(mesh));
    const double gap = 0.25 + 0.25 / ratios[0];
    for (const auto& definition : all_definitions()) {
      EXPECT_FALSE(HierarchyReference(h, 0, definition).sample({0.3, 0.6, 0.6})) << "in the hole";
      EXPECT_FALSE(HierarchyReference(h, 0, definition).sample({0.51, 0.6, 0.6})) << "in the NaN cell";
      EXPECT_NEAR(sample(h, definition, {0.2499, 0.6, 0.6}), 5, 1e-14) << text(definition);
      EXPECT_NEAR(sample(h, definition, {0.7, 0.6, 0.6}), 5, 1e-14) << text(definition);
      EXPECT_NEAR(draw(h, definition, lit_ray({0.6, 0.6, 0.6}, {1, 0, 0}, constant_light(2)))[3], -std::expm1(-2 * (1 - gap)),
                  1e-13);
      EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, {0.6, 0.6, 0.6}, {-1, 0, 0}))[0], 5 * (1 - gap), 1e-13);
    }
  }
}

TEST(ReferenceFilter, PositionsOnFacesAndAtTheDomainsEnds) {
  MeshDescription mesh = domain({4, 4, 4}, {}, {-1, 0, 2}, {1, 4, 10});
  add_patch(mesh, 0, {Vec3i(0), Vec3i(4)}, [](const Vec3d& p) { return p.x; });
  const AmrHierarchy h(std::move(mesh));
  const auto p = finest_position(h, {0, 4, 2});
  ASSERT_TRUE(p);
  EXPECT_EQ(p->cell, Vec3i(2, 3, 0)) << "a face belongs to the upper cell, the last face to the last cell";
  EXPECT_EQ(p->fraction.x, 0);
  EXPECT_LT(p->fraction.y, 1);
  EXPECT_GT(p->fraction.y, 1 - 1e-15);
  EXPECT_FALSE(finest_position(h, {0, 4.0000001, 2}));
  EXPECT_FALSE(finest_position(h, {-1.0000001, 4, 2}));
  EXPECT_FALSE(finest_position(h, {kNan, 4, 2}));
  EXPECT_EQ(sample(h, {}, {0, 1, 3}), 0.25);
  EXPECT_EQ(sample(h, {}, {1, 4, 10}), 0.75);
  for (const Filter filter : {Filter::linear_lod, Filter::linear_vertex, Filter::basis}) {
    EXPECT_NEAR(sample(h, {filter}, {1, 4, 10}), 0.75, 1e-14);
    EXPECT_NEAR(sample(h, {filter}, {-1, 0, 2}), -0.75, 1e-14);
  }
}

TEST(ReferenceFilter, ThirtyOneBitsOfIndex) {
  // 4 * 4^14 = 2^30 cells along an axis
  MeshDescription mesh = domain(Vec3i(4), std::vector<int>(14, 4));
  add_patch(mesh, 0, {Vec3i(0), Vec3i(4)}, plane);
  for (int level = 1; level < 15; ++level) {  // nested around the middle's upper corner
    const int middle = 1 << (2 * level + 1);
    add_patch(mesh, level, {Vec3i(middle), Vec3i(middle + 4)}, plane);
  }
  const AmrHierarchy h(std::move(mesh));
  const Vec3d middle(0.5 + 2 * std::pow(2.0, -30));  // of the finest patch
  for (const auto& definition : all_definitions()) {
    if (definition.page_level != 0) continue;
    const HierarchyReference reference(h, 0, definition);
    // basis: leaves of all levels reach here
    EXPECT_NEAR(reference.sample(middle).value(), plane(middle), definition.filter == Filter::basis ? 1 : 1e-7)
        << text(definition);
    EXPECT_NEAR(draw(h, definition, one_ray(Mode::projection, middle, {1, 1, 1}))[0], std::sqrt(3.0) * 0.75, 0.2)
        << text(definition);
  }
}

// ---- random meshes: everything that is legal and rare ----

TEST(ReferenceRandom, LevelValuesAndFillsAreThoseOfTheBuilders) {
  // two texts for one definition: the encodings' and the reference's
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const ReferenceField field(h, 0);
    for (int level = 0; level < h.level_count(); ++level) {
      const Vec3i middle = h.cells(level) / 2;
      const Box box = intersection(h.domain(level).grown(2), {middle - Vec3i(9), middle + Vec3i(9)});
      std::vector<double> filled(static_cast<std::size_t>(box.cells()));
      filled_level_values(h, 0, level, box, filled);
      for_each_cell(box, [&](const Vec3i& c) {
        const double expected = filled[box.offset(c)];
        const double found = field.filled_value(level, c);
        ASSERT_EQ(std::isnan(expected), std::isnan(found)) << "seed " << seed << " level " << level;
        if (!std::isnan(expected)) {
          // AmrHierarchy keeps the shares of cells that lack a part as floats
          ASSERT_NEAR(found, expected, 1e-12 * std::max(1.0, std::abs(expected))) << "seed " << seed;
        }
      });
    }
  }
}

/// Rays in all directions, also parallel to axes and through corners of cells.
IndexRay random_ray(const AmrHierarchy& h, std::mt19937_64& random) {
  const Vec3d size(h.cells(h.finest_level()));
  std::uniform_real_distribution<double> unit(0, 1);
  IndexRay ray{size * Vec3d(unit(random), unit(random), unit(random)), Vec3d(unit(random), unit(random), unit(random)) - 0.5};
  for (int a = 0; a < 3; ++a) {
    if (unit(random) < 0.3) ray.origin[a] = std::floor(ray.origin[a]);
    if (unit(random) < 0.2) ray.direction[a] = 0;
    if (unit(random) < 0.2) ray.direction[a] = std::copysign(0.25, ray.direction[a]);
  }
  return ray;
}

TEST(ReferenceRandom, PiecesOfARayAreTheFieldAndLeaveNothingOut) {
  for (std::uint64_t seed = 0; seed < 80; ++seed) {
    const AmrHierarchy h(random_mesh(seed));
    const Vec3d size(h.cells(h.finest_level()));
    const double scale = std::max({1.0, std::abs(h.statistics(0).min), std::abs(h.statistics(0).max)});
    for (const auto& definition : all_definitions()) {
      if (definition.page_level >= h.level_count()) continue;
      const HierarchyReference reference(h, 0, definition);
      const auto filter = make_filter_reference(h, 0, definition);
      ReferenceTracer tracer(*filter);
      std::mt19937_64 random(seed);
      for (int k = 0; k < 6; ++k) {
        const IndexRay ray = random_ray(h, random);
        double end = kInf;
        for (int a = 0; a < 3; ++a)
          if (ray.direction[a] != 0)
            end = std::min(end, ((ray.direction[a] > 0 ? size[a] : 0.0) - ray.origin[a]) / ray.direction[a]);
        if (!(end > 0) || std::isinf(end)) continue;
        const auto at = [&](double t) {
          const Vec3d p = glm::clamp(ray.origin + t * ray.direction, Vec3d(0), size);
          const Vec3i cell = glm::min(Vec3i(p), Vec3i(size) - 1);
          return reference.sample({cell, p - Vec3d(cell)});
        };
        double last = 0;
        tracer.trace(ray, end, [&](const PieceFunction& f, double from, double to) {
          EXPECT_GE(from, last);
          // what was passed over has no value
          if (from - last > 1e-9) {
            EXPECT_FALSE(at((last + from) / 2)) << "seed " << seed << " " << text(definition);
          }
          for (const double s : {0.2, 0.5, 0.9}) {
            if (to - from < 1e-9) continue;
            const auto expected = at(from + s * (to - from));
            EXPECT_TRUE(expected) << "seed " << seed << " " << text(definition);
            if (!expected) return false;
            EXPECT_NEAR(f(s), *expected, 1e-9 * scale) << "seed " << seed << " " << text(definition);
            EXPECT_TRUE(f(s) >= f.lower - 1e-9 * scale && f(s) <= f.upper + 1e-9 * scale) << "bounds";
          }
          last = to;
          return true;
        });
        if (end - last > 1e-9) {
          EXPECT_FALSE(at((last + end) / 2)) << "seed " << seed << " " << text(definition);
        }
      }
    }
  }
}

// ---- oracles made by yt ----

/// yt names fields "boxlib/phi"; readers know "phi".
std::string field_name(const std::string& name) { return name.substr(name.find('/') + 1); }

void check_points(const AmrHierarchy& h, const Json& samples) {
  const HierarchyReference reference(h, 0, {Filter::nearest});
  for (const Json& s : samples) {
    const Vec3d p(s["p"][0].get<double>(), s["p"][1].get<double>(), s["p"][2].get<double>());
    ASSERT_TRUE(reference.sample(p));
    EXPECT_NEAR(*reference.sample(p), s["value"].get<double>(), 1e-12 * std::abs(s["value"].get<double>()));
    EXPECT_EQ(h.find_leaf(finest_position(h, p)->cell)->level, s["level"].get<int>());
  }
}

void check_rays(const AmrHierarchy& h, const Json& rays) {
  const double size = glm::length(h.domain_upper() - h.domain_lower());
  for (const Json& ray : rays) {
    const int axis = ray["axis"].get<std::string>()[0] - 'x';
    Vec3d p = (h.domain_lower() + h.domain_upper()) / 2.0;
    for (int a = 0; a < 3; ++a)
      if (a != axis) p[a] = ray["through"][static_cast<std::size_t>(a)].get<double>();
    Vec3d direction(0);
    direction[axis] = 1;
    const double expected = ray["sum_value_dx"].get<double>();
    EXPECT_NEAR(draw(h, {Filter::nearest}, one_ray(Mode::projection, p, direction, size))[0], expected,
                1e-12 * std::abs(expected));
  }
}

void check_oracle(const fs::path& data, const fs::path& oracle_file) {
  const Json oracle = Json::parse(std::ifstream(oracle_file));
  for (const auto* key : {"ortho_rays", "point_samples"}) {
    if (!oracle.contains(key)) continue;
    const AmrHierarchy h(read_mesh(data, {field_name(oracle[key]["field"].get<std::string>())}));
    if (key == std::string("ortho_rays"))
      check_rays(h, oracle[key]["rays"]);
    else
      check_points(h, oracle[key]["samples"]);
  }
}

TEST(ReferenceOracle, SamplePlotfile) {
  const fs::path data = fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny";
  check_oracle(data / "plt00008", data / "oracle.json");
}

struct DataSet {
  const char* data;
  const char* oracle;
};
void PrintTo(const DataSet& d, std::ostream* out) { *out << d.data; }
class ReferenceOracleSets : public ::testing::TestWithParam<DataSet> {};

TEST_P(ReferenceOracleSets, PointSamplesAndLineIntegrals) {
  AMRTEX_NEEDS(test::kSharedData, GetParam().data);
  AMRTEX_NEEDS(test::kSharedData, GetParam().oracle);
  check_oracle(test::kSharedData / GetParam().data, test::kSharedData / GetParam().oracle);
}

INSTANTIATE_TEST_SUITE_P(Data, ReferenceOracleSets,
                         ::testing::Values(DataSet{"amrex_tiny_be32/plt00008", "amrex_tiny_be32/oracle.json"},
                                           DataSet{"amrex_tiny_multifile/plt00008", "amrex_tiny_multifile/oracle.json"},
                                           DataSet{"amrex_small/plt00020", "amrex_small/oracle.json"},
                                           DataSet{"amrex_ratio4/plt00016", "amrex_ratio4/oracle.json"},
                                           DataSet{"amrex_deep/plt00000", "amrex_deep/oracle.json"},
                                           DataSet{"amrex_hdf5/plt00012", "amrex_hdf5/oracle_plt00012.json"},
                                           DataSet{"amrex_hdf5/plt00012_h5.h5", "amrex_hdf5/oracle_plt00012.json"},
                                           DataSet{"chombo_explosion_r2/explosion.000006.3d.hdf5",
                                                   "chombo_explosion_r2/oracle.json"},
                                           DataSet{"enzo_noh_manygrids/DD0001", "enzo_noh_manygrids/oracle.json"},
                                           DataSet{"flash_sedov/sedov_forced_hdf5_plt_cnt_0000",
                                                   "flash_sedov/oracle_sedov_forced_hdf5_plt_cnt_0000.json"}));

}  // namespace
}  // namespace amrtex
