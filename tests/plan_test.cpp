// Sampling `planned`: bounds on how a field varies, the steps that follow from them, and pictures that keep the budget.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "renderers/bindings/plan_bindings.hpp"
#include "renderers/bindings/scene_bindings.hpp"
#include "structures/common/leap_grid.hpp"
#include "structures/generators/random_mesh.hpp"
#include "tests/pictures.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::HasSubstr;

std::vector<AmrHierarchy> meshes() {
  std::vector<AmrHierarchy> all;
  all.push_back(nested(waves, {2, 2}).hierarchy());
  for (const std::uint64_t seed : {51, 52, 53}) {
    RandomMeshOptions options;
    options.max_finest_cells = 1 << 15;
    all.emplace_back(random_mesh(seed, options));
  }
  return all;
}

const BlockVariation& block_at(const VariationGrid& grid, const FinestPosition& p) {
  return grid.of_blocks[Box{Vec3i(0), grid.blocks}.offset(p.cell >> grid.shift)];
}

/// Of the line between two places of one finest cell, smallest edges of such a cell.
double distance(const AmrHierarchy& h, const FinestPosition& a, const FinestPosition& b) {
  const Vec3d cell = h.spacing(h.finest_level());
  return glm::length((a.fraction - b.fraction) * cell) / std::min({cell.x, cell.y, cell.z});
}

// f is continuous inside of a leaf cell, and (f(b) - f(a)) / |b - a| is a mean of its slopes there.
TEST(VariationGrid, BoundsValuesAndSlopesOfTheTrilinearField) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const AmrHierarchy& h : meshes()) {
    const VariationGrid grid = VariationGrid::of(h, 0, {});
    ASSERT_FALSE(grid.empty());
    const std::vector<FinestPosition> places = probe_positions(h, 400);
    std::vector<FinestPosition> others = places;
    for (FinestPosition& p : others) p.fraction = Vec3d(unit(random), unit(random), unit(random));
    const Values values = reference_values(h, {.filter = Filter::linear_lod}, places);
    const Values beside = reference_values(h, {.filter = Filter::linear_lod}, others);
    const double rounding = 1e-6 * value_range(h);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (!values[i] || !beside[i]) continue;
      const BlockVariation& block = block_at(grid, places[i]);
      EXPECT_GE(*values[i], block.low - rounding);
      EXPECT_LE(*values[i], block.high + rounding);
      EXPECT_LE(std::abs(*values[i] - *beside[i]), block.slope * distance(h, places[i], others[i]) + rounding);
    }
  }
}

TEST(VariationGrid, OfAConstantIsNothing) {
  const VariationGrid grid = VariationGrid::of(nested([](const Vec3d&) { return 3.0; }).hierarchy(), 0, {});
  for (const BlockVariation& block : grid.of_blocks) EXPECT_EQ(block, (BlockVariation{3, 3, 0, 0}));
}

// f = x over a unit cube of 2^k finest cells along each edge changes by 2^-k a cell, and nowhere bends, but at the domain's faces,
// beyond which the last value goes on.
TEST(VariationGrid, OfALineIsItsSlope) {
  const AmrHierarchy h = single_level([](const Vec3d& p) { return p.x; }).hierarchy();
  const VariationGrid grid = VariationGrid::of(h, 0, {});
  const double smallest = std::min({h.spacing(0).x, h.spacing(0).y, h.spacing(0).z});
  const Box inner = Box{Vec3i(0), grid.blocks}.grown(-1);
  for_each_cell(inner, [&](const Vec3i& b) {
    const BlockVariation& block = grid.of_blocks[Box{Vec3i(0), grid.blocks}.offset(b)];
    EXPECT_NEAR(block.slope, smallest, 1e-6);
    EXPECT_NEAR(block.bend, 0, 1e-6);
  });
}

TransferFunction curves(std::vector<TransferFunction::ExtinctionPoint> extinction, std::vector<TransferFunction::ColorPoint> color) {
  TransferFunction tf;
  tf.extinction = std::move(extinction);
  tf.color = std::move(color);
  return tf;
}

TEST(ErrorDensity, IsNoneWhereWhatIsIntegratedIsConstant) {
  const TransferFunction constant = curves({{0, 7}}, {{0, {0.2, 0.4, 0.6}}});
  EXPECT_EQ(error_density({0, 1, 3, 9}, constant, 1, 8), 0) << "one value of the curves";
  const TransferFunction ramp = curves({{0, 0}, {1, 8}}, {{0, {0.2, 0.4, 0.6}}});
  EXPECT_EQ(error_density({0.5, 0.5, 0, 0}, ramp, 1, 8), 0) << "one value of the field";
  EXPECT_EQ(error_density({-3, -1, 5, 5}, ramp, 1, 8), 0) << "nothing is seen";
  EXPECT_EQ(error_density({}, ramp, 1, 8), 0) << "there is no mesh";
}

// The midpoint rule is off by h^3 / 24 g''; here g = k(f) has k' = 8 and f'' = 9 between the points of the curves.
TEST(ErrorDensity, OfALinearCurveIsThatOfTheMidpointRule) {
  const TransferFunction ramp = curves({{0, 0}, {1, 8}}, {{0, {0.2, 0.4, 0.6}}});
  EXPECT_DOUBLE_EQ(error_density({0.25F, 0.75F, 0, 9}, ramp, 1, 8), 8 * 9 / 24.0);
  EXPECT_DOUBLE_EQ(error_density({0.25F, 0.75F, 0, 9}, ramp, 0.5, 8), 4 * 9 / 24.0);
}

// A kink of 8 in k, passed with slope 3, adds 8 * 3 to g' once: 8 * 3 / edge to g'' over a block's edge.
TEST(ErrorDensity, CountsKinksOverABlock) {
  const TransferFunction tent = curves({{0, 0}, {0.5, 4}, {1, 4}}, {{0, {0.2, 0.4, 0.6}}});
  EXPECT_DOUBLE_EQ(error_density({0.25F, 0.75F, 3, 0}, tent, 1, 16), 8 * 3 / 16.0 / 24);
  EXPECT_DOUBLE_EQ(error_density({0.625F, 0.75F, 3, 0}, tent, 1, 16), 0);
}

TEST(SmoothSteps, DifferByTheirDistanceAtMost) {
  const Vec3i blocks{7, 5, 6};
  const Box all{Vec3i(0), blocks};
  std::mt19937_64 random(3);
  std::vector<double> steps;
  for (std::int64_t i = 0; i < all.cells(); ++i) steps.push_back(std::exp2(std::uniform_real_distribution(-3.0, 9.0)(random)));
  std::vector<double> expected(steps.size(), std::numeric_limits<double>::infinity());
  for_each_cell(all, [&](const Vec3i& to) {
    for_each_cell(all, [&](const Vec3i& from) {
      const Vec3i way = glm::abs(to - from);
      expected[all.offset(to)] = std::min(expected[all.offset(to)], steps[all.offset(from)] + 4.0 * (way.x + way.y + way.z));
    });
  });
  smooth_steps(blocks, 4, steps);
  for (std::size_t i = 0; i < steps.size(); ++i) EXPECT_NEAR(steps[i], expected[i], 1e-12);
}

Scene planned_scene(const AmrHierarchy& h, Mode mode, double budget) {
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  const double size = glm::length(h.domain_upper() - h.domain_lower());
  Scene scene = small_scene(mode, perspective(middle + Vec3d(0.8, -1.2, 0.5) * size, middle), Sampling::planned, 24);
  const FieldStatistics& s = h.statistics(0);
  scene.transfer_function.extinction = {{s.min, 0}, {s.min + 0.4 * (s.max - s.min), 0}, {s.max, 20}};
  scene.transfer_function.color = {{s.min, {1, 0.2, 0}}, {s.max, {0, 0.5, 1}}};
  scene.settings.skip = true;
  scene.settings.budget = budget;
  return scene;
}

Scene with_step(Scene scene, double step) {
  scene.settings.sampling = Sampling::adaptive;
  scene.settings.step = step;
  return scene;
}

EncodedField build_for(const AmrHierarchy& h, const EncodingCase& c, const Scene& scene) {
  return build(h, c, {.variation = scene.settings.sampling == Sampling::planned});
}

// Values of these meshes change without rule from cell to cell. Where the budget asks for less than an eighth of a cell, steps are as
// long, and what these leave adds to it.
TEST(Planned, PicturesKeepTheBudget) {
  for (const AmrHierarchy& h : meshes())
    for (const double budget : {0.3, 0.05, 0.01}) {
      const Scene scene = planned_scene(h, Mode::dvr, budget);
      GlPairs(1, interpolating).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
        if (!accepted(h, c)) return;
        const EncodedField field = build_for(h, c, scene);
        const Picture fine = draw_on(false, h, field, with_step(scene, 1.0 / 32));
        const double shortest = difference(draw_on(false, h, field, with_step(scene, 1.0 / 8)), fine);
        EXPECT_LE(difference(draw_on(gl, h, field, scene), fine), budget + shortest);
      });
    }
}

// A line integral of the same estimate, in parts of the field's range times the domain's longest edge.
TEST(Planned, LineIntegralsKeepTheBudget) {
  const AmrHierarchy h = nested(waves, {2, 2}).hierarchy();
  const Vec3d size = h.domain_upper() - h.domain_lower();
  const double unit = value_range(h) * std::max({size.x, size.y, size.z});
  for (const double budget : {1e-2, 1e-3}) {
    const Scene scene = planned_scene(h, Mode::projection, budget);
    GlPairs(1, interpolating).for_each_and_on_cpu([&](const EncodingCase& c, bool gl) {
      const EncodedField field = build_for(h, c, scene);
      const Picture fine = draw_on(false, h, field, with_step(scene, 1.0 / 32));
      EXPECT_LE(difference(draw_on(gl, h, field, scene), fine), budget * unit);
    });
  }
}

TEST(Planned, AConstantMediumIsOneIntervalARegion) {
  const AmrHierarchy h = nested([](const Vec3d&) { return 0.5; }).hierarchy();
  Scene scene = planned_scene(h, Mode::dvr, 1e-6);
  scene.transfer_function.extinction = {{0, 3}};
  scene.transfer_function.color = {{0, {1, 0.5, 0.25}}};
  GlPairs(1, interpolating).for_each([&](const EncodingCase& c) {
    const EncodedField field = build_for(h, c, scene);
    WorkCounts work;
    draw(context(ContextKind::egl), h, field, scene, &work);
    EXPECT_LE(work.samples, work.regions);
  });
}

TEST(Planned, IsRefusedWhereTheFieldJumpsOrItsVariationIsUnknown) {
  const AmrHierarchy h = nested(waves, {2, 2}).hierarchy();
  const Scene scene = planned_scene(h, Mode::dvr, 0.1);
  const auto complaint = [&](const EncodedField& field) {
    try {
      bind_scene(h, field, scene);
    } catch (const UnsupportedError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  for_each_encoding([&](const EncodingCase& c) {
    EncodingCase nearest = c;
    nearest.filter = Filter::nearest;
    if (accepted(h, nearest)) {
      EXPECT_THAT(complaint(build_for(h, nearest, scene)), HasSubstr("sampling planned: the filter nearest jumps"));
    }
    if (interpolating(c)) {
      EXPECT_THAT(complaint(build(h, c)), HasSubstr("built without how its field varies"));
    }
  });
}

TEST(Planned, ASmallerBudgetTakesMoreSamples) {
  const AmrHierarchy h = nested(waves, {2, 2}).hierarchy();
  GlPairs(1, interpolating).for_each([&](const EncodingCase& c) {
    std::int64_t before = 0;
    for (const double budget : {0.9, 0.2, 0.05}) {
      const Scene scene = planned_scene(h, Mode::dvr, budget);
      WorkCounts work;
      draw(context(ContextKind::egl), h, build_for(h, c, scene), scene, &work);
      EXPECT_GT(work.samples, before);
      before = work.samples;
    }
  });
}

}  // namespace
}  // namespace amrtex
