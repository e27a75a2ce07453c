// Generated meshes against the analytic truth, and the rules that they promise to keep.
#include "structures/generators/synthetic.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <utility>

#include "structures/generators/analytic_fields.hpp"
#include "structures/generators/cluster_blocks.hpp"
#include "structures/generators/random_mesh.hpp"

namespace amrtex {
namespace {

Json parse(const char* text) { return Json::parse(text); }

AmrHierarchy make_hierarchy(const Json& specification) { return AmrHierarchy(generate_mesh(specification)); }

Vec3d cell_middle(const AmrHierarchy& mesh, int level, const Vec3i& cell) {
  return mesh.domain_lower() + (Vec3d(cell) + 0.5) * mesh.spacing(level);
}

/// Calls f(level, patch, cell, value) for every leaf cell.
template <class F>
void for_each_leaf(const AmrHierarchy& mesh, F&& f) {
  for (int level = 0; level < mesh.level_count(); ++level)
    for (std::size_t p = 0; p < mesh.patches(level).size(); ++p) {
      const Patch& patch = mesh.patches(level)[p];
      const auto mask = mesh.leaf_mask(level, static_cast<int>(p));
      for_each_cell(patch.box, [&](const Vec3i& cell) {
        const std::size_t i = patch.box.offset(cell);
        if (mask[i] != 0) f(level, static_cast<int>(p), cell, patch.values[0][i]);
      });
    }
}

bool same_bytes(const MeshDescription& a, const MeshDescription& b) {
  if (a.levels.size() != b.levels.size() || a.ratios != b.ratios || a.fields != b.fields) return false;
  for (std::size_t l = 0; l < a.levels.size(); ++l) {
    if (a.levels[l].size() != b.levels[l].size()) return false;
    for (std::size_t p = 0; p < a.levels[l].size(); ++p) {
      const Patch& x = a.levels[l][p];
      const Patch& y = b.levels[l][p];
      if (!(x.box == y.box) || x.values.size() != y.values.size()) return false;
      for (std::size_t f = 0; f < x.values.size(); ++f)
        if (const auto one = x.values[f].doubles(), other = y.values[f].doubles();
            one.size() != other.size() || std::memcmp(one.data(), other.data(), one.size() * sizeof(double)) != 0)
          return false;
    }
  }
  return true;
}

// ---------------------------------------------------------------- blobs_shell

struct KnownValue {
  int level;
  std::size_t patch;
  Vec3i cell;
  double value;
};

// Computed with numpy 1.24 from the same formula and numpy.random.RandomState(7).
const std::array<KnownValue, 11> kNumpyValues{{{0, 21, {24, 30, 19}, 0.1694029286892651},
                                               {0, 42, {45, 36, 32}, 0.66031426145559413},
                                               {1, 90, {48, 96, 24}, 0.00088796243645268634},
                                               {2, 100, {111, 79, 127}, 0.0054978378975875722},
                                               {2, 300, {143, 191, 177}, 2.8358528870183795e-06},
                                               {3, 0, {144, 176, 224}, 0.017798852111203113},
                                               {3, 400, {242, 173, 164}, 0.0025152508891422348},
                                               {3, 814, {376, 299, 283}, 0.0055406850721757394},
                                               {3, 650, {351, 198, 240}, 0.81170749549467014},
                                               {2, 223, {112, 171, 160}, 0.71599616125298771},
                                               {3, 120, {191, 352, 256}, 0.73543444473879227}}};

TEST(BlobsShell, HasThePatchesAndValuesOfTheNumpyGenerator) {
  const MeshDescription mesh = generate_mesh(parse(R"({"field": "blobs_shell"})"));
  ASSERT_EQ(mesh.levels.size(), 4u);
  EXPECT_EQ(mesh.levels[0].size(), 64u);
  EXPECT_EQ(mesh.levels[1].size(), 181u);
  EXPECT_EQ(mesh.levels[2].size(), 446u);
  EXPECT_EQ(mesh.levels[3].size(), 815u);
  for (const KnownValue& known : kNumpyValues) {
    const Patch& patch = mesh.levels[static_cast<std::size_t>(known.level)][known.patch];
    ASSERT_TRUE(patch.box.contains(known.cell)) << "level " << known.level << " patch " << known.patch;
    EXPECT_NEAR(patch.values[0][patch.box.offset(known.cell)], known.value, 1e-14 * known.value);
  }
}

TEST(BlobsShell, IsTheDefaultAndCountsItsCells) {
  const MeshDescription by_default = generate_mesh(Json::object());
  EXPECT_EQ(by_default.name, "blobs_shell");
  const MeshDescription by_name = generate_mesh(parse(
      R"({"field": {"type": "sum", "terms": [{"type": "blobs", "count": 7, "seed": 7}, {"type": "shell", "lobes": 3}]},
          "levels": 4, "root": [64, 64, 64], "ratio": [2, 2, 2], "patch": 16, "refine": {"criterion": "gradient", "threshold": 0.14},
          "level_jump": 1})"));
  for (std::size_t l = 0; l < 4; ++l) ASSERT_EQ(by_default.levels[l].size(), by_name.levels[l].size());
  EXPECT_EQ(by_default.levels[3][100].values.at(0).doubles(), by_name.levels[3][100].values.at(0).doubles());
  const AmrHierarchy mesh(by_default);
  EXPECT_EQ(mesh.stored_cells(), 6168576);
  EXPECT_EQ(mesh.leaf_cells(), 5430272);
}

// ---------------------------------------------------------------- fields

const std::map<std::string, const char*>& field_specifications() {
  static const std::map<std::string, const char*> fields{
      {"constant", R"({"type": "constant", "value": 2.5})"},
      {"linear", R"({"type": "linear", "value": 1, "gradient": [2, -3, 0.5]})"},
      {"trilinear", R"({"type": "trilinear", "coefficients": [1, 2, 3, 4, 5, 6, 7, 8]})"},
      {"blobs", R"({"type": "blobs", "count": 3, "seed": 11})"},
      {"shell", R"({"type": "shell", "radius": 0.6, "width": 0.1})"},
      {"patchy_shell", R"({"type": "shell", "radius": 0.6, "width": 0.1, "lobes": 3})"},
      {"one_lobe", R"({"type": "shell", "radius": 0.6, "width": 0.1, "lobes": 1})"},
      {"blobs_shell", R"({"type": "blobs_shell", "width": 0.05})"},
      {"step", R"({"type": "step", "normal": [1, 2, 0], "offset": 0.3, "low": -1, "high": 4})"},
      {"oscillating", R"({"type": "oscillating", "wave_number": [1, 0.5, 0], "amplitude": 3})"},
      {"sum", R"({"type": "sum", "terms": ["linear", {"type": "oscillating", "wave_number": [0, 0, 2]}]})"}};
  return fields;
}

Json small_specification(const char* field) {
  Json s = parse(R"({"levels": 3, "root": [10, 8, 6], "ratio": [2, 3], "patch": 6,
                     "domain": {"lower": [-1, 0, 2], "upper": [1, 1.5, 4]}, "refine": {"criterion": "random", "fraction": 0.3}})");
  s["field"] = parse(field);
  return s;
}

TEST(AnalyticField, EqualsTheMeshAtEveryLeafCellCentre) {
  for (const auto& [name, text] : field_specifications()) {
    const Json specification = small_specification(text);
    const auto field = make_analytic_field(specification);
    const AmrHierarchy mesh = make_hierarchy(specification);
    EXPECT_EQ(mesh.domain_lower(), Vec3d(-1, 0, 2));
    std::int64_t leaves = 0;
    double worst = 0;
    for_each_leaf(mesh, [&](int level, int, const Vec3i& cell, double value) {
      ++leaves;
      worst = std::max(worst, std::abs(value - field->value(cell_middle(mesh, level, cell))));
    });
    EXPECT_EQ(leaves, mesh.leaf_cells());
    EXPECT_LE(worst, 1e-12) << name;
  }
}

TEST(AnalyticField, GradientIsTheLimitOfDifferences) {
  const double h = 1e-5;
  for (const auto& [name, text] : field_specifications()) {
    const auto field = make_analytic_field(small_specification(text));
    double largest = 0;
    for_each_cell({Vec3i(0), Vec3i(9)}, [&](const Vec3i& i) {
      const Vec3d p = Vec3d(-1, 0, 2) + Vec3d(2, 1.5, 2) * (Vec3d(i) + 0.45) / 9.0;
      const Vec3d gradient = field->gradient(p);
      for (int a = 0; a < 3; ++a) {
        Vec3d d(0);
        d[a] = h;
        const double difference = (field->value(p + d) - field->value(p - d)) / (2 * h);
        EXPECT_NEAR(gradient[a], difference, 2e-5 * (1 + std::abs(difference))) << name << " axis " << a;
        largest = std::max(largest, std::abs(difference));
      }
    });
    EXPECT_EQ(largest > 0, name != "constant" && name != "step") << name;
  }
}

TEST(AnalyticField, ShellHasNoGradientWhereItsAngleHasNoMeaning) {
  const auto field = make_analytic_field(parse(R"({"field": {"type": "shell", "radius": 0.2, "width": 0.1, "lobes": 3}})"));
  EXPECT_EQ(field->gradient(Vec3d(0.5)), Vec3d(0));
  const Vec3d on_axis = field->gradient(Vec3d(0.5, 0.5, 0.65));
  EXPECT_EQ(on_axis.x, 0);
  EXPECT_EQ(on_axis.y, 0);
  EXPECT_GT(on_axis.z, 0);
}

// Values by hand: they do not come from the code under test.
TEST(AnalyticField, HasTheValuesOfItsFormula) {
  const auto value = [](const char* field, const Vec3d& p) {
    Json s = Json::object();
    s["field"] = parse(field);
    return make_analytic_field(s)->value(p);
  };
  EXPECT_DOUBLE_EQ(value(R"({"type": "linear", "value": 1, "gradient": [2, -3, 0.5]})", {0.5, 0.25, 2}), 2.25);
  EXPECT_DOUBLE_EQ(value(R"({"type": "trilinear", "coefficients": [1, 2, 3, 4, 5, 6, 7, 8]})", {2, 3, 5}),
                   1 + 2 * 2 + 3 * 3 + 4 * 5 + 5 * 6 + 6 * 10 + 7 * 15 + 8 * 30);
  EXPECT_DOUBLE_EQ(value(R"({"type": "step", "normal": [0, 2, 0], "offset": 0.5, "low": -1, "high": 4})", {9, 0.499, 9}), -1);
  EXPECT_DOUBLE_EQ(value(R"({"type": "step", "normal": [0, 2, 0], "offset": 0.5, "low": -1, "high": 4})", {9, 0.501, 9}), 4);
  EXPECT_DOUBLE_EQ(value(R"({"type": "oscillating", "wave_number": [1, 0, 0.5], "amplitude": 3})", {0.25, 0.7, 0.5}), 3);
  EXPECT_DOUBLE_EQ(value(R"({"type": "shell", "radius": 0.25, "width": 0.1, "amplitude": 2})", {0.75, 0.5, 0.5}), 2);
  EXPECT_DOUBLE_EQ(value(R"({"type": "shell", "radius": 0.25, "width": 0.1, "amplitude": 2})", {0.85, 0.5, 0.5}),
                   2 * std::exp(-0.5));
}

TEST(Generate, AveragedValuesAreCellMeans) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"levels": 1, "root": 8, "patch": 8, "averaged": true,
      "field": {"type": "oscillating", "wave_number": [1, 0, 0]}})"));
  // Mean of sin(2 pi x) over [a, b] = (cos(2 pi a) - cos(2 pi b)) / (2 pi (b - a)).
  const double k = 2 * std::numbers::pi;
  for_each_leaf(mesh, [&](int, int, const Vec3i& cell, double value) {
    EXPECT_NEAR(value, (std::cos(k * cell.x / 8.0) - std::cos(k * (cell.x + 1) / 8.0)) / (k / 8), 2e-7);
  });
}

// ---------------------------------------------------------------- mesh rules

/// Largest level difference between cells of the finest level that touch at a face, an edge or a corner.
int largest_jump(const AmrHierarchy& mesh) {
  const Box domain = mesh.domain(mesh.finest_level());
  std::vector<int> level(static_cast<std::size_t>(domain.cells()), -1);
  for_each_cell(domain, [&](const Vec3i& cell) {
    const auto leaf = mesh.find_leaf(cell);
    if (leaf) level[domain.offset(cell)] = leaf->level;
  });
  int largest = 0;
  for_each_cell(domain, [&](const Vec3i& cell) {
    const int here = level[domain.offset(cell)];
    for_each_cell(intersection(Box{cell, cell + Vec3i(1)}.grown(1), domain), [&](const Vec3i& neighbour) {
      const int there = level[domain.offset(neighbour)];
      if (here >= 0 && there >= 0) largest = std::max(largest, std::abs(here - there));
    });
  });
  return largest;
}

Json point_like_specification(int level_jump) {
  Json s =
      parse(R"({"field": {"type": "shell", "center": [0.4, 0.45, 0.55], "radius": 0.02, "width": 0.02}, "levels": 5, "root": 8,
                     "patch": 2, "refine": {"criterion": "value", "threshold": 0.5}})");
  s["level_jump"] = level_jump;
  return s;
}

TEST(LevelJump, IsKeptAtFacesEdgesAndCorners) {
  for (const int jump : {1, 2, 3}) {
    const AmrHierarchy mesh = make_hierarchy(point_like_specification(jump));
    EXPECT_EQ(largest_jump(mesh), jump);
    EXPECT_FALSE(mesh.patches(4).empty());
  }
  EXPECT_EQ(largest_jump(make_hierarchy(point_like_specification(0))), 4);
  Json unlimited = point_like_specification(0);
  unlimited["level_jump"] = nullptr;
  EXPECT_EQ(largest_jump(make_hierarchy(unlimited)), 4);
}

TEST(LevelJump, AddsNoMoreThanItNeeds) {
  const auto cells = [](int jump) { return make_hierarchy(point_like_specification(jump)).stored_cells(); };
  EXPECT_GT(cells(1), cells(2));
  EXPECT_GT(cells(2), cells(3));
  EXPECT_GT(cells(3), cells(0));
}

TEST(LevelJump, HoldsAcrossHolesAndMixedRatios) {
  const AmrHierarchy mesh =
      make_hierarchy(parse(R"({"field": "constant", "levels": 4, "root": [7, 5, 4], "ratio": [2, 3, 2], "patch": 6,
      "refine": {"criterion": "random", "fraction": 0.1}, "holes": 0.3, "seed": 5})"));
  EXPECT_LE(largest_jump(mesh), 1);
}

TEST(SkipLevels, LeavesLevelsEmptyAndFinerPatchesOnMuchCoarserOnes) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": "blobs", "levels": 4, "root": 8, "patch": 4, "skip_levels": [1, 2],
      "level_jump": 0, "refine": {"criterion": "random", "fraction": 0.05}})"));
  EXPECT_TRUE(mesh.patches(1).empty());
  EXPECT_TRUE(mesh.patches(2).empty());
  EXPECT_FALSE(mesh.patches(3).empty());
  EXPECT_GT(mesh.leaf_cells(0), 0);
  EXPECT_EQ(largest_jump(mesh), 3);
}

TEST(SkipLevels, KeepsTheLevelJump) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": "blobs", "levels": 5, "root": 8, "patch": 2, "skip_levels": [2],
      "level_jump": 2, "refine": {"criterion": "random", "fraction": 0.03}})"));
  EXPECT_TRUE(mesh.patches(2).empty());
  EXPECT_FALSE(mesh.patches(4).empty());
  EXPECT_EQ(largest_jump(mesh), 2);
}

TEST(SkipLevels, MayBeTheCoarsest) {
  const AmrHierarchy mesh =
      make_hierarchy(parse(R"({"field": "blobs", "levels": 2, "root": 8, "patch": 4, "skip_levels": [0]})"));
  EXPECT_TRUE(mesh.patches(0).empty());
  EXPECT_EQ(mesh.leaf_cells(1), 16 * 16 * 16);
}

TEST(MaxPatch, JoinsBlocksIntoPatchesOfMixedSizesAndChangesNoCell) {
  Json specification = parse(R"({"field": "blobs", "levels": 3, "root": [20, 16, 12], "patch": 4,
                                 "refine": {"criterion": "surface", "isovalue": 0.3}})");
  const AmrHierarchy blocks = make_hierarchy(specification);
  specification["max_patch"] = 14;  // three blocks
  const AmrHierarchy joined = make_hierarchy(specification);
  std::map<std::array<int, 4>, double> cells;
  for_each_leaf(blocks, [&](int level, int, const Vec3i& c, double value) { cells[{level, c.x, c.y, c.z}] = value; });
  for_each_leaf(joined, [&](int level, int, const Vec3i& c, double value) {
    EXPECT_EQ(cells.at({level, c.x, c.y, c.z}), value);
    cells.erase({level, c.x, c.y, c.z});
  });
  EXPECT_TRUE(cells.empty());
  std::set<std::array<int, 3>> sizes;
  for (int level = 0; level < joined.level_count(); ++level) {
    EXPECT_LT(joined.patches(level).size(), blocks.patches(level).size() / 2);
    for (const Patch& patch : joined.patches(level)) {
      const Vec3i size = patch.box.size();
      sizes.insert({size.x, size.y, size.z});
      EXPECT_LE(std::max({size.x, size.y, size.z}), 12);
    }
  }
  EXPECT_GE(sizes.size(), 8u);
}

TEST(MaxPatch, FindsTheBoxesThatBlocksWereMadeFrom) {
  // two boxes that touch at an edge only, and one apart from them
  const std::vector<Box> boxes{{{0, 0, 0}, {3, 2, 2}}, {{3, 2, 0}, {5, 6, 2}}, {{8, 0, 0}, {9, 1, 4}}};
  BlockList blocks;
  for (const Box& box : boxes) for_each_cell(box, [&](const Vec3i& b) { blocks.push_back(b); });
  EXPECT_EQ(cluster_blocks(blocks, {8, 1}), boxes);
}

TEST(Efficiency, MakesFewerPatchesOfWhichAtLeastThatShareWasWanted) {
  // an L of three blocks fills 3/4 of the box around it
  const BlockList blocks{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(cluster_blocks(blocks, {8, 0.75}), (std::vector<Box>{{{0, 0, 0}, {2, 2, 1}}}));
  EXPECT_EQ(cluster_blocks(blocks, {8, 0.76}).size(), 2u);
  Json specification = parse(R"({"field": "blobs", "levels": 4, "root": 16, "patch": 4, "max_patch": 32,
                                 "refine": {"criterion": "surface", "isovalue": 0.3}})");
  const AmrHierarchy exact = make_hierarchy(specification);
  specification["efficiency"] = 0.7;
  const AmrHierarchy generous = make_hierarchy(specification);  // whose constructor checks the nesting of patches
  EXPECT_LT(generous.patches(3).size(), exact.patches(3).size() / 2);
  EXPECT_LE(static_cast<double>(generous.leaf_cells(3)), static_cast<double>(exact.leaf_cells(3)) / 0.7);
}

TEST(Generate, ClipsBlocksAtTheDomain) {
  const AmrHierarchy mesh =
      make_hierarchy(parse(R"({"field": "constant", "levels": 3, "root": [9, 5, 1], "ratio": [2, 4], "patch": 8,
      "refine": {"criterion": "random", "fraction": 0.5}})"));
  EXPECT_EQ(mesh.cells(2), Vec3i(72, 40, 8));
  EXPECT_EQ(mesh.patches(0)[0].box.size(), Vec3i(8, 5, 1));
  EXPECT_NEAR(mesh.statistics(0).volume_integral, 1, 1e-12);
}

TEST(Generate, MixedRatiosFillTheDomainOnce) {
  const AmrHierarchy mesh =
      make_hierarchy(parse(R"({"field": {"type": "constant", "value": 3}, "levels": 4, "root": 6, "ratio": [4, 2, 3],
      "patch": 12, "refine": {"criterion": "random", "fraction": 0.1}, "domain": {"lower": [0, 0, 0], "upper": [2, 1, 0.5]}})"));
  EXPECT_FALSE(mesh.has_holes());
  EXPECT_NEAR(mesh.statistics(0).volume_integral, 3, 1e-11);
  EXPECT_EQ(mesh.ratio_to_finer(0), 4);
  EXPECT_EQ(mesh.ratio_to_finer(2), 3);
}

// ---------------------------------------------------------------- criteria

TEST(Refine, SurfaceReachesTheFinestLevelWhereverTheFieldCrosses) {
  const Json specification = parse(R"({"field": {"type": "linear", "gradient": [1, 1, 0]}, "levels": 3, "root": 8, "patch": 4,
      "refine": {"criterion": "surface", "isovalue": 0.9}})");
  const AmrHierarchy mesh = make_hierarchy(specification);
  for_each_leaf(mesh, [&](int level, int, const Vec3i&, double value) {
    const double half_range = mesh.spacing(level).x;  // of x + y over the cell
    const bool crosses = std::abs(value - 0.9) < half_range * 0.99;
    EXPECT_TRUE(level == 2 || !crosses) << "level " << level << ", value " << value;
  });
  EXPECT_GT(mesh.leaf_cells(0), 0);
}

TEST(Refine, GradientFollowsTheDifferenceOverOneCell) {
  // x / 10 differs by 0.1 * width over a cell: 1/80, 1/160, 1/320 on levels 0, 1, 2.
  const char* text = R"({"field": {"type": "linear", "gradient": [0.1, 0, 0]}, "levels": 4, "root": 8, "patch": 4,
      "refine": {"criterion": "gradient", "threshold": 0.004}})";
  const AmrHierarchy mesh = make_hierarchy(parse(text));
  EXPECT_EQ(mesh.leaf_cells(), mesh.domain(2).cells());
  EXPECT_TRUE(mesh.patches(3).empty());
}

// The largest gradient of 4000 places of a box is never above the bound, and within a factor of 5 of it in boxes that are small
// beside what the field changes over: a bound that is always infinite would leave nothing out.
TEST(Refine, TheSteepestOfABoxIsABound) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto vector = [&] { return Vec3d(uniform(random), uniform(random), uniform(random)); };
  for (const char* text : {R"({"field": "blobs"})", R"({"field": "shell"})",
                           R"({"field": {"type": "shell", "lobes": 3, "width": 0.05}})", R"({"field": "blobs_shell"})"}) {
    const auto field = make_analytic_field(parse(text));
    int tight = 0;
    for (int i = 0; i < 60; ++i) {
      const double edge = std::exp2(-1 - 6 * uniform(random));
      const Vec3d lower = vector() * (1 - edge);
      const WorldBox box{lower, lower + Vec3d(edge)};
      const double bound = field->steepest_in(box);
      double largest = 0;
      for (int k = 0; k < 4000; ++k) largest = std::max(largest, glm::length(field->gradient(box.at(vector()))));
      EXPECT_LE(largest, bound * (1 + 1e-12)) << text << " edge " << edge;
      tight += bound <= 5 * largest ? 1 : 0;
    }
    EXPECT_GT(tight, 10) << text;
  }
  EXPECT_TRUE(std::isinf(make_analytic_field(parse(R"({"field": "oscillating"})"))->steepest_in({})));
}

TEST(Refine, ValueSelectsBothSigns) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": {"type": "linear", "gradient": [1, 0, 0]}, "levels": 2, "root": 16,
      "patch": 4, "domain": {"lower": [-1, 0, 0], "upper": [1, 1, 1]}, "refine": {"criterion": "value", "threshold": 0.75}})"));
  for_each_leaf(mesh, [&](int level, int, const Vec3i&, double value) { EXPECT_EQ(level, std::abs(value) > 0.75 ? 1 : 0); });
}

TEST(Refine, RandomTakesItsFraction) {
  const MeshDescription mesh = generate_mesh(parse(R"({"field": "constant", "levels": 2, "root": 64, "patch": 4,
      "refine": {"criterion": "random", "fraction": 0.25}})"));
  // 32768 units: standard deviation of the fraction 0.0024.
  EXPECT_NEAR(static_cast<double>(mesh.levels[1].size()) / 32768.0, 0.25, 0.012);
  EXPECT_TRUE(
      generate_mesh(parse(R"({"levels": 2, "root": 8, "refine": {"criterion": "random", "fraction": 0}})")).levels[1].empty());
}

TEST(Refine, NestedMakesDeepMeshesCheaply) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": "linear", "levels": 25, "root": 64, "refine": "nested",
      "level_jump": 1})"));
  EXPECT_EQ(mesh.level_count(), 25);
  EXPECT_EQ(mesh.cells(24), Vec3i(1 << 30));
  for (int level = 1; level < 24; ++level) EXPECT_LE(mesh.patches(level).size(), 64u) << level;
  EXPECT_EQ(mesh.patches(24).size(), 8u);
  EXPECT_LT(mesh.stored_cells(), 10000000);
}

// ---------------------------------------------------------------- seeds, holes, missing values

const char* kEverything =
    R"({"field": "blobs_shell", "levels": 3, "root": [40, 32, 24], "patch": 8, "ratio": [2, 4], "holes": 0.2,
    "nan_fraction": 0.05, "refine": {"criterion": "random", "fraction": 0.1}, "seed": 9})";

TEST(Seed, GivesTheSameBytesAtAnyThreadCount) {
  const MeshDescription first = generate_mesh(parse(kEverything));
  const MeshDescription second = generate_mesh(parse(kEverything));
  EXPECT_TRUE(same_bytes(first, second));
  EXPECT_EQ(AmrHierarchy(first).content_hash(0), AmrHierarchy(second).content_hash(0));
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same_bytes(first, generate_mesh(parse(kEverything))));
}

TEST(Seed, ChangesTheMesh) {
  Json other = parse(kEverything);
  other["seed"] = 10;
  EXPECT_NE(make_hierarchy(parse(kEverything)).content_hash(0), make_hierarchy(other).content_hash(0));
}

TEST(Holes, LeaveOutAFractionOfRootBlocks) {
  const AmrHierarchy mesh =
      make_hierarchy(parse(R"({"field": "constant", "levels": 2, "root": 40, "patch": 4, "holes": 0.3, "refine": "random"})"));
  EXPECT_TRUE(mesh.has_holes());
  EXPECT_NEAR(mesh.statistics(0).volume_integral, 0.7, 0.06);  // 1000 blocks
}

TEST(Holes, MayBeABall) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": "constant", "levels": 2, "root": 32, "patch": 2,
      "holes": {"center": [0.5, 0.5, 0.5], "radius": 0.25}, "refine": "random"})"));
  EXPECT_FALSE(mesh.find_leaf(Vec3i(32)).has_value());
  EXPECT_TRUE(mesh.find_leaf(Vec3i(4)).has_value());
  EXPECT_NEAR(mesh.statistics(0).volume_integral, 1 - 4.0 / 3 * std::numbers::pi / 64, 0.01);
}

TEST(Holes, StayEmptyWhereTheLevelJumpWouldRefineThem) {
  Json specification = parse(R"({"field": "constant", "levels": 4, "root": 16, "patch": 4, "holes": 0.3,
      "refine": {"criterion": "random", "fraction": 0.1}})");
  const AmrHierarchy refined = make_hierarchy(specification);
  specification["levels"] = 1;
  const AmrHierarchy coarse = make_hierarchy(specification);
  EXPECT_TRUE(coarse.has_holes());
  EXPECT_GT(refined.leaf_cells(3), 0);
  EXPECT_NEAR(refined.statistics(0).volume_integral, coarse.statistics(0).volume_integral, 1e-12);
}

// exp(-(r / 0.25)^2 / 2) is above exp(-1/2) inside of a ball of radius 1/4
const char* kBallBody =
    R"({"field": {"type": "shell", "radius": 1e-9, "width": 0.25, "amplitude": 1}, "above": 0.6065306597126334})";

TEST(Body, HoldsNoCellAndIsCutOutWithTheFinestBlocks) {
  Json specification = parse(R"({"field": {"type": "constant", "value": 1}, "levels": 4, "root": 8, "patch": 2, "refine":
      {"criterion": "random", "fraction": 0}})");
  specification["body"] = parse(kBallBody);
  for (const int level_jump : {0, 1}) {
    specification["level_jump"] = level_jump;
    const AmrHierarchy mesh = make_hierarchy(specification);
    const Box domain = mesh.domain(3);
    const auto in_body = [](const Vec3i& cell) {  // by the middle of its block of 2 cells
      return glm::length((2.0 * Vec3d(cell / 2) + 1.0) / 64.0 - 0.5) < 0.25;
    };
    int wrong = 0;
    int coarse_at_the_surface = 0;
    for_each_cell(domain, [&](const Vec3i& cell) {
      const auto leaf = mesh.find_leaf(cell);
      wrong += leaf.has_value() == in_body(cell) ? 1 : 0;
      for (int axis = 0; axis < 3; ++axis) {
        Vec3i next = cell;
        if (++next[axis] < 64 && in_body(next) != in_body(cell))
          coarse_at_the_surface += mesh.find_leaf(in_body(cell) ? next : cell)->level != 3 ? 1 : 0;
      }
    });
    EXPECT_EQ(wrong, 0) << "level_jump " << level_jump;
    EXPECT_EQ(coarse_at_the_surface, 0) << "level_jump " << level_jump;
    EXPECT_TRUE(mesh.has_holes());
    EXPECT_GT(mesh.leaf_cells(level_jump == 0 ? 0 : 1), 0);
    EXPECT_LE(largest_jump(mesh), level_jump == 0 ? 3 : 1);
    EXPECT_NEAR(mesh.statistics(0).volume_integral, 1 - 4.0 / 3 * std::numbers::pi / 64, 0.004);
  }
}

TEST(Body, LeavesTheCellsOutsideAsTheyAre) {
  Json specification = parse(R"({"field": "blobs", "levels": 3, "root": 16, "patch": 4, "max_patch": 16, "refine":
      {"criterion": "surface", "isovalue": 0.3}})");
  const AmrHierarchy whole = make_hierarchy(specification);
  specification["body"] = parse(R"({"field": {"type": "step", "offset": 0.5}, "above": 0.5})");  // the half x >= 1/2
  const AmrHierarchy half = make_hierarchy(specification);
  double worst = 0;
  for_each_cell(half.domain(2), [&](const Vec3i& cell) {
    const auto kept = half.find_leaf(cell);
    EXPECT_EQ(kept.has_value(), cell.x < 32);
    if (kept) worst = std::max(worst, static_cast<double>(whole.find_leaf(cell)->level - kept->level));
  });
  EXPECT_EQ(worst, 0) << "a body may refine what is at its surface, and nothing becomes coarser";
}

TEST(MissingValues, TakeTheirFractionOfLeafCells) {
  const AmrHierarchy mesh = make_hierarchy(parse(R"({"field": "blobs", "levels": 2, "root": 32, "patch": 8, "nan_fraction": 0.1,
      "refine": {"criterion": "random", "fraction": 0.5}})"));
  const double fraction = static_cast<double>(mesh.statistics(0).cells_without_value) / static_cast<double>(mesh.leaf_cells());
  EXPECT_NEAR(fraction, 0.1, 0.005);
  EXPECT_TRUE(mesh.has_missing(0));
  const MeshDescription all = generate_mesh(parse(R"({"field": "blobs", "levels": 1, "root": 8, "nan_fraction": 1})"));
  for (const double value : all.levels[0][0].values[0]) EXPECT_TRUE(std::isnan(value));
}

TEST(Precision, SingleIsTheDoubleMeshWithItsValuesRounded) {
  Json specification = parse(R"({"field": "blobs", "levels": 2, "root": 16, "patch": 8, "nan_fraction": 0.1})");
  const MeshDescription wide = generate_mesh(specification);
  specification["precision"] = "single";
  const MeshDescription narrow = generate_mesh(specification);
  ASSERT_EQ(narrow.levels.size(), wide.levels.size());
  for (std::size_t l = 0; l < wide.levels.size(); ++l) {
    ASSERT_EQ(narrow.levels[l].size(), wide.levels[l].size());
    for (std::size_t p = 0; p < wide.levels[l].size(); ++p) {
      const CellValues& rounded = narrow.levels[l][p].values[0];
      const CellValues& values = wide.levels[l][p].values[0];
      EXPECT_EQ(rounded.type(), RealType::float32);
      EXPECT_EQ(values.type(), RealType::float64);
      ASSERT_EQ(rounded.size(), values.size());
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (std::isnan(values[i]))
          EXPECT_TRUE(std::isnan(rounded[i]));
        else
          EXPECT_EQ(rounded[i], static_cast<double>(static_cast<float>(values[i])));
      }
    }
  }
}

// ---------------------------------------------------------------- bad specifications

struct BadSpecification {
  const char* text;
  std::vector<const char*> message;  ///< the key, the value, what is accepted
};

TEST(BadSpecification, IsAUsageErrorThatNamesKeyValueAndWhatIsAccepted) {
  const std::vector<BadSpecification> cases{
      {R"([1])", {"specification", "[1]", "a JSON object"}},
      {R"({"feld": 1})", {"\"feld\"", "1", "field", "refine", "nan_fraction"}},
      {R"({"field": "blob"})", {"\"field\"", "\"blob\"", "blobs_shell", "oscillating"}},
      {R"({"field": 3})", {"\"field\"", "3", "blobs_shell", "\"type\""}},
      {R"({"field": {"type": "cube"}})", {"\"field.type\"", "\"cube\"", "trilinear"}},
      {R"({"field": {"value": 1}})", {"\"field.type\"", "null", "trilinear"}},
      {R"({"field": {"type": "constant", "valu": 1}})", {"\"field.valu\"", "1", "type, value"}},
      {R"({"field": {"type": "constant", "value": "x"}})", {"\"field.value\"", "\"x\"", "a finite number"}},
      {R"({"field": {"type": "linear", "gradient": [1, 2]}})", {"\"field.gradient\"", "[1,2]", "a list of 3 finite numbers"}},
      {R"({"field": {"type": "trilinear", "coefficients": [1]}})", {"\"field.coefficients\"", "[1]", "a list of 8"}},
      {R"({"field": {"type": "blobs", "count": 0}})", {"\"field.count\"", "0", "an integer from 1 to 10000"}},
      {R"({"field": {"type": "blobs", "seed": -1}})", {"\"field.seed\"", "-1", "from 0 to 4294967295"}},
      {R"({"field": {"type": "shell", "width": 0}})", {"\"field.width\"", "0", "a number above 0"}},
      {R"({"field": {"type": "shell", "radius": -1}})", {"\"field.radius\"", "-1", "a number above 0"}},
      {R"({"field": {"type": "shell", "lobes": 2.5}})", {"\"field.lobes\"", "2.5", "an integer"}},
      {R"({"field": {"type": "step", "normal": [0, 0, 0]}})", {"\"field.normal\"", "[0,0,0]", "not all 0"}},
      {R"({"field": {"type": "oscillating", "wave_number": 3}})", {"\"field.wave_number\"", "3", "a list of 3"}},
      {R"({"field": {"type": "sum"}})", {"\"field.terms\"", "a list of at least one field"}},
      {R"({"field": {"type": "sum", "terms": ["blob"]}})", {"\"field.terms[0]\"", "\"blob\"", "blobs"}},
      {R"({"name": ""})", {"\"name\"", "a text that is not empty"}},
      {R"({"levels": 0})", {"\"levels\"", "0", "an integer from 1 to 30"}},
      {R"({"levels": 2.5})", {"\"levels\"", "2.5", "an integer from 1 to 30"}},
      {R"({"levels": 30})", {"\"levels\"", "30", "cells"}},
      {R"({"root": 0})", {"\"root\"", "0", "an integer from 1"}},
      {R"({"root": [8, 8]})", {"\"root\"", "[8,8]", "a list of 3"}},
      {R"({"root": 2000})", {"\"root\"", "2000", "2147483648 cells"}},
      {R"({"ratio": 1})", {"\"ratio\"", "1", "an integer from 2 to 64"}},
      {R"({"ratio": [2, 2]})", {"\"ratio\"", "[2,2]", "a list of 3"}},
      {R"({"ratio": [2, 2, 1]})", {"\"ratio\"", "[2,2,1]", "from 2"}},
      {R"({"ratio": 3})", {"\"patch\"", "the default", "\"ratio\"", "3"}},
      {R"({"patch": 0})", {"\"patch\"", "0", "an integer from 1"}},
      {R"({"patch": 5})", {"\"patch\"", "5", "\"ratio\""}},
      {R"({"root": 512, "patch": 1, "levels": 1})", {"\"patch\"", "1", "blocks"}},
      {R"({"max_patch": 8})", {"\"max_patch\"", "8", "from \"patch\" (16) to 1024"}},
      {R"({"efficiency": 0})", {"\"efficiency\"", "0", "above 0"}},
      {R"({"efficiency": 0.5, "holes": 0.1})", {"\"efficiency\"", "0.5", "holes"}},
      {R"({"domain": {"lower": [0, 0, 0], "upper": [1, 0, 1]}})", {"\"domain\"", "an upper corner above"}},
      {R"({"domain": {"lowest": [0, 0, 0]}})", {"\"domain.lowest\"", "lower, upper"}},
      {R"({"domain": 1})", {"\"domain\"", "1", "a JSON object"}},
      {R"({"refine": 1})", {"\"refine\"", "1", "gradient"}},
      {R"({"refine": "curvature"})", {"\"refine.criterion\"", "\"curvature\"", "gradient, value, surface, random, nested"}},
      {R"({"refine": {"threshold": -1}})", {"\"refine.threshold\"", "-1", "a number from 0 up"}},
      {R"({"refine": {"criterion": "random", "threshold": 1}})", {"\"refine.threshold\"", "1", "criterion, fraction"}},
      {R"({"refine": {"criterion": "random", "fraction": 1.5}})", {"\"refine.fraction\"", "1.5", "from 0 to 1"}},
      {R"({"refine": {"criterion": "surface", "isovalue": null}})", {"\"refine.isovalue\"", "null", "a finite number"}},
      {R"({"refine": {"criterion": "nested", "reach": 0}})", {"\"refine.reach\"", "0", "above 0"}},
      {R"({"refine": {"criterion": "nested", "center": 1}})", {"\"refine.center\"", "1", "a list of 3"}},
      {R"({"level_jump": -1})", {"\"level_jump\"", "-1", "0 or null"}},
      {R"({"level_jump": "any"})", {"\"level_jump\"", "\"any\"", "0 or null"}},
      {R"({"skip_levels": 1})", {"\"skip_levels\"", "1", "a list of levels"}},
      {R"({"skip_levels": [3], "level_jump": 0})", {"\"skip_levels\"", "[3]", "below 3"}},
      {R"({"skip_levels": [1, 2], "level_jump": 2})", {"\"skip_levels\"", "[1,2]", "\"level_jump\""}},
      {R"({"holes": 1.5})", {"\"holes\"", "1.5", "from 0 to 1"}},
      {R"({"holes": 1})", {"\"holes\"", "1", "at least one root block"}},
      {R"({"holes": {"radius": 1}})", {"\"holes.center\"", "a list of 3"}},
      {R"({"holes": {"center": [0, 0, 0], "radius": 0}})", {"\"holes.radius\"", "0", "above 0"}},
      {R"({"body": 1})", {"\"body\"", "1", "\"field\"", "\"above\""}},
      {R"({"body": {"above": 1}})", {"\"body.field\"", "a field"}},
      {R"({"body": {"field": "blobs"}})", {"\"body.above\"", "a finite number"}},
      {R"({"body": {"field": "blobs", "above": "x"}})", {"\"body.above\"", "\"x\"", "a finite number"}},
      {R"({"body": {"field": "blobs", "above": 1, "below": 2}})", {"\"body.below\"", "2", "field, above"}},
      {R"({"body": {"field": "blob", "above": 1}})", {"\"field\"", "\"blob\"", "blobs_shell"}},
      {R"({"body": {"field": "constant", "above": 0}})", {"\"body\"", "at least one cell"}},
      {R"({"efficiency": 0.5, "body": {"field": "blobs", "above": 1}})", {"\"efficiency\"", "0.5", "body"}},
      {R"({"nan_fraction": -0.1})", {"\"nan_fraction\"", "-0.1", "from 0 to 1"}},
      {R"({"averaged": 1})", {"\"averaged\"", "1", "true or false"}},
      {R"({"precision": "half"})", {"\"precision\"", "\"half\"", "double, single"}},
      {R"({"seed": -1})", {"\"seed\"", "-1", "an integer from 0"}},
      {R"({"seed": 18446744073709551615})", {"\"seed\"", "18446744073709551615", "an integer from 0"}},
      {R"({"root": 1024, "levels": 3, "refine": {"criterion": "random", "fraction": 1}})", {"cells", "at most 2147483648"}}};
  for (const BadSpecification& bad : cases) {
    try {
      generate_mesh(parse(bad.text));
      ADD_FAILURE() << bad.text << " was accepted";
    } catch (const UsageError& error) {
      for (const char* part : bad.message)
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos)
            << bad.text << "\n  " << error.what() << "\n  lacks " << part;
    }
  }
}

// ---------------------------------------------------------------- random meshes

TEST(RandomMesh, IsValidForManySeedsAndShowsEveryRareThing) {
  std::set<std::string> seen;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const MeshDescription description = random_mesh(seed);
    ASSERT_NO_THROW({
      const AmrHierarchy mesh(description);
      EXPECT_GT(mesh.leaf_cells(), 0);
      if (mesh.has_holes()) seen.insert("holes");
      if (mesh.statistics(0).cells_without_value > 0) seen.insert("missing values");
      if (mesh.leaf_cells() == mesh.statistics(0).cells_without_value) seen.insert("no value at all");
      if (mesh.domain(mesh.finest_level()).cells() < 60000) seen.insert(fmt::format("jump {}", largest_jump(mesh)));
    }) << "seed "
       << seed;
    if (description.levels.size() > 1 && description.levels[0].empty()) seen.insert("empty level 0");
    for (std::size_t l = 1; l + 1 < description.levels.size(); ++l)
      if (description.levels[l].empty() && !description.levels[l + 1].empty()) seen.insert("empty level");
    for (const int ratio : description.ratios) seen.insert(fmt::format("ratio {}", ratio));
    if (std::set<int>(description.ratios.begin(), description.ratios.end()).size() > 1) seen.insert("mixed ratios");
    for (const auto& patches : description.levels)
      for (const Patch& patch : patches) {
        if (patch.box.cells() == 1) seen.insert("one-cell patch");
        for (const double v : patch.values[0]) {
          if (std::isnan(v)) seen.insert("NaN");
          if (std::isinf(v)) seen.insert("infinity");
        }
      }
  }
  for (const char* thing : {"holes", "missing values", "jump 2", "jump 3", "empty level 0", "empty level", "ratio 2", "ratio 3",
                            "ratio 4", "mixed ratios", "one-cell patch", "NaN", "infinity"})
    EXPECT_TRUE(seen.contains(thing)) << thing;
}

TEST(RandomMesh, KeepsItsOptions) {
  RandomMeshOptions options;
  options.holes = false;
  options.missing_values = false;
  options.empty_levels = false;
  options.power_of_two_ratios = true;
  options.fields = 2;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const AmrHierarchy mesh(random_mesh(seed, options));
    EXPECT_EQ(mesh.fields().size(), 2u);
    EXPECT_FALSE(mesh.has_missing(0)) << seed;
    for (int level = 0; level + 1 < mesh.level_count(); ++level) EXPECT_NE(mesh.ratio_to_finer(level), 3);
  }
}

TEST(RandomMesh, IsTheSameForTheSameSeed) {
  EXPECT_TRUE(same_bytes(random_mesh(17), random_mesh(17)));
  EXPECT_FALSE(same_bytes(random_mesh(17), random_mesh(18)));
}

}  // namespace
}  // namespace amrtex
