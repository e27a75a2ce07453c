// Facts of `exabricks` alone; what every encoding must do is in tests/.
#include "structures/exabricks/exabricks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <set>

#include "renderers/bindings/scene_needs.hpp"
#include "renderers/consumers/raycaster.hpp"
#include "renderers/reference/hierarchy_reference.hpp"
#include "renderers/reference/reference_point.hpp"
#include "structures/exabricks/bricks.hpp"
#include "structures/exabricks/bvh.hpp"
#include "structures/exabricks/regions.hpp"
#include "structures/generators/random_mesh.hpp"
#include "structures/generators/synthetic.hpp"
#include "tests/leave_out_cases.hpp"

namespace amrtex {
namespace {

using namespace test;
using namespace exa;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

EncodedField exa_field(const AmrHierarchy& h, Filter filter, const Json& parameters = Json::object(),
                       const BuildOptions& options = {}) {
  return build(h, {&find_encoding("exabricks"), filter, parameters}, options);
}

AmrHierarchy small_random_mesh(std::uint64_t seed) { return AmrHierarchy(random_mesh(seed, {.max_finest_cells = 1 << 15})); }

// ---- bricks

TEST(Exabricks, BricksOfRandomMeshesHoldEveryLeafCellOnce) {
  for (std::uint64_t seed = 0; seed < 100; ++seed)
    for (const int widest : {2, 5, 32}) {
      SCOPED_TRACE(fmt::format("seed {}, {} wide", seed, widest));
      const AmrHierarchy h(random_mesh(seed));
      const BrickTree tree = build_bricks(h, widest);
      std::int64_t cells = 0;
      for (const Brick& b : tree.bricks) {
        const Vec3i n = b.cells.size();
        EXPECT_LE(std::max({n.x, n.y, n.z}), widest);
        cells += b.cells.cells();
        for_each_cell(b.cells, [&](const Vec3i& c) {
          const auto leaf = h.find_leaf(c * b.width);
          ASSERT_TRUE(leaf);
          ASSERT_EQ(leaf->level, b.level);
        });
      }
      EXPECT_EQ(cells, h.leaf_cells());
    }
}

TEST(Exabricks, SplitsLieNextToTheMiddleOfTheLongestAxisAtCoarseCells) {
  // 10 x 4 x 4 root cells, one refined: the middle of x is 5 root cells, 10 finest ones
  const AmrHierarchy h = MeshBuilder({10, 4, 4}, {2}).root(waves).patch(1, {{0, 0, 0}, {2, 2, 2}}, waves).hierarchy();
  const BrickTree tree = build_bricks(h, 32);
  EXPECT_EQ(tree.nodes[0].axis, 0);
  EXPECT_EQ(tree.nodes[0].plane, 10);
  // the upper half is one brick of 5 x 4 x 4
  const BrickNode& upper = tree.nodes[static_cast<std::size_t>(tree.nodes[0].first_child) + 1];
  ASSERT_GE(upper.brick, 0);
  EXPECT_EQ(tree.bricks[static_cast<std::size_t>(upper.brick)].cells, (Box{{5, 0, 0}, {10, 4, 4}}));
}

TEST(Exabricks, AHoleIsNoBrick) {
  // the brick's bounding box is cut free of the empty half by one plane
  const AmrHierarchy h = MeshBuilder(Vec3i(16)).patch(0, {{8, 0, 0}, {16, 16, 16}}, waves).hierarchy();
  const BrickTree tree = build_bricks(h, 32);
  EXPECT_EQ(tree.bricks.size(), 1u);
  EXPECT_EQ(tree.nodes.size(), 3u);
}

// ---- regions

struct Built {
  BrickTree tree;
  RegionSet set;
  Built(const AmrHierarchy& h, int width, int border)
      : tree(build_bricks(h, width)), set(build_regions(h, tree, {.border = border, .hats = true, .pieces = true})) {}
};

template <class F>
void for_each_build(std::uint64_t seeds, F&& f) {
  for (std::uint64_t seed = 0; seed < seeds; ++seed)
    for (const auto& [width, border] : {std::pair(32, 1), std::pair(4, 1), std::pair(3, 0)}) {
      SCOPED_TRACE(fmt::format("seed {}, {} wide, border {}", seed, width, border));
      const AmrHierarchy h = small_random_mesh(seed);
      f(h, Built(h, width, border), seed);
    }
}

TEST(ExabricksRegions, PartitionTheMesh) {
  for_each_build(60, [](const AmrHierarchy& h, const Built& b, std::uint64_t seed) {
    // volumes add up to that of the leaves ...
    std::int64_t regions = 0, leaves = 0;
    for (const Region& r : b.set.regions) regions += r.box.cells();
    for (int l = 0; l < h.level_count(); ++l) {
      const std::int64_t w = h.cell_width(l);
      leaves += h.leaf_cells(l) * w * w * w;
    }
    EXPECT_EQ(regions, leaves);
    // ... and random cells lie in one region where there is mesh, else in none
    std::mt19937_64 random(seed);
    const Vec3i domain = h.cells(h.finest_level());
    for (int i = 0; i < 50; ++i) {
      Vec3i cell;
      for (int a = 0; a < 3; ++a) cell[a] = std::uniform_int_distribution<int>(0, domain[a] - 1)(random);
      int holding = 0;
      for (const Region& r : b.set.regions) holding += r.box.contains(cell) ? 1 : 0;
      EXPECT_EQ(holding, h.find_leaf(cell) ? 1 : 0);
    }
  });
}

TEST(ExabricksRegions, PiecesAreTheLeafCellsWhoseHatsReachInEachOnce) {
  using Key = std::array<int, 4>;
  for_each_build(40, [](const AmrHierarchy& h, const Built& b, std::uint64_t) {
    for (const Region& r : b.set.regions) {
      // brute force: every leaf cell of every level whose box, half a cell larger, meets the region
      std::set<Key> expected, found;
      std::set<int> bricks;
      for (std::size_t i = 0; i < b.tree.bricks.size(); ++i)
        for_each_cell(b.tree.bricks[i].cells, [&](const Vec3i& c) {
          const int w = b.tree.bricks[i].width;
          for (int a = 0; a < 3; ++a)
            if ((2 * c[a] - 1) * w >= 2 * r.box.upper[a] || (2 * c[a] + 3) * w <= 2 * r.box.lower[a]) return;
          expected.insert({b.tree.bricks[i].level, c.x, c.y, c.z});
          bricks.insert(static_cast<int>(i));
        });
      std::size_t cells = 0;
      int finest = 0;
      for (int k = 0; k < r.pieces; ++k) {
        const Piece& piece = b.set.pieces[static_cast<std::size_t>(r.first_piece + k)];
        const int level = b.tree.bricks[static_cast<std::size_t>(piece.brick)].level;
        finest = std::max(finest, level);
        for_each_cell(piece.cells, [&](const Vec3i& c) { found.insert({level, c.x, c.y, c.z}); });
        cells += static_cast<std::size_t>(piece.cells.cells());
      }
      ASSERT_EQ(cells, found.size()) << "a cell twice";
      ASSERT_EQ(found, expected);
      EXPECT_EQ(r.active_bricks, static_cast<int>(bricks.size())) << "the paper's list";
      EXPECT_GE(r.level, finest);
      for (int a = 0; a < 3; ++a) EXPECT_EQ(r.box.lower[a] % h.cell_width(r.level), 0);
    }
  });
}

TEST(ExabricksRegions, OneLevelIsPlainWithABorderAndSumsWithout) {
  // 64 cells an axis in bricks of 32: with a border each brick is one region and one fetch
  const AmrHierarchy h = MeshBuilder(Vec3i(64)).root(waves).hierarchy();
  const Json with = exa_field(h, Filter::basis).statistics;
  EXPECT_EQ(with["bricks"], 8);
  EXPECT_EQ(with["regions"], 8);
  EXPECT_EQ(with["plain_regions"], 8);
  EXPECT_EQ(with["pieces_a_region"], 1.0);
  // without, a layer of one cell at each of the three inner faces of a brick is a region of its own, its edges and corner too
  const Json without = exa_field(h, Filter::basis, {{"border", 0}}).statistics;
  EXPECT_EQ(without["regions"], 8 * 8);
  // supports a region: 1 inside, 2 at a face, 4 at an edge, 8 at a corner
  EXPECT_EQ(without["bricks_a_region"], (1 + 3 * 2 + 3 * 4 + 8) / 8.0);
  EXPECT_EQ(without["most_pieces"], 8);
}

TEST(ExabricksRegions, NearestHasOneABrick) {
  const AmrHierarchy h = nested(waves).hierarchy();
  const Json s = exa_field(h, Filter::nearest).statistics;
  EXPECT_EQ(s["regions"], s["bricks"]);
  EXPECT_EQ(exa_field(h, Filter::nearest).find("exa_pieces"), nullptr);
  EXPECT_EQ(exa_field(h, Filter::nearest).memory().duplicated, 0);
}

TEST(ExabricksRegions, TheBvhFindsEveryBox) {
  for_each_build(10, [](const AmrHierarchy&, const Built& b, std::uint64_t) {
    std::vector<Box> boxes;
    for (const Region& r : b.set.regions) boxes.push_back(r.box);
    const std::vector<BvhNode> nodes = BvhBuilder(boxes).build();
    EXPECT_EQ(nodes.size(), 2 * boxes.size() - 1);
    std::set<int> items;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (nodes[i].item >= 0) {
        items.insert(nodes[i].item);
        EXPECT_EQ(nodes[i].box, boxes[static_cast<std::size_t>(nodes[i].item)]);
      }
      for (std::size_t k = i + 1; k < static_cast<std::size_t>(nodes[i].skip); ++k)
        ASSERT_TRUE(nodes[i].box.contains(nodes[k].box));
    }
    EXPECT_EQ(items.size(), boxes.size());
  });
}

TEST(Exabricks, ALargeMeshHasTheSameBytesAtAnyThreadCount) {
  // every other block of 2^3 root cells is refined: enough boxes for bricks to be divided as tasks (64), and bricks by the
  // thousand
  constexpr int kBlocks = 12;
  MeshBuilder mesh(Vec3i(2 * kBlocks), {2});
  mesh.root(waves);
  for_each_cell({Vec3i(0), Vec3i(kBlocks)}, [&](const Vec3i& b) {
    if ((b.x + b.y + b.z) % 2 == 0) mesh.patch(1, {b * 4, (b + 1) * 4}, waves);
  });
  const AmrHierarchy h = mesh.hierarchy();
  ASSERT_GT(leaf_boxes(h).size(), 64U);
  for (const Json& parameters : {Json::object(), Json{{"locate", "cells"}}, Json{{"border", 0}, {"traversal", "bvh"}}}) {
    SCOPED_TRACE(parameters.dump());
    std::set<std::string> contents;
    for (const std::size_t threads : {1, 2, 4}) {
      const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
      const EncodedField field = exa_field(h, Filter::basis, parameters);
      EXPECT_GT(field.statistics["bricks"], 1000);
      contents.insert(field.content_hash() + field.statistics.dump());
    }
    EXPECT_EQ(contents.size(), 1U);
  }
}

// ---- values

const std::vector<Json>& parameter_sets() {
  static const std::vector<Json> sets{Json::object(),
                                      Json{{"border", 0}},
                                      Json{{"brick_width", 2}},
                                      Json{{"brick_width", 3}, {"border", 0}},
                                      Json{{"locate", "cells"}},
                                      Json{{"traversal", "bvh"}},
                                      Json{{"traversal", "kd"}}};
  return sets;
}

TEST(Exabricks, DoubleIsTheReferenceOnRandomMeshes) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const AmrHierarchy h = small_random_mesh(seed);
    const auto positions = probe_positions(h, 40, seed);
    for (const Json& parameters : parameter_sets()) {
      SCOPED_TRACE(fmt::format("seed {}: {}", seed, parameters.dump()));
      const EncodedField field = exa_field(h, Filter::basis, parameters, {.storage = Storage::r64f});
      const Comparison result = compare_double(h, field, positions);
      EXPECT_TRUE(result) << result;
    }
  }
}

TEST(Exabricks, ThirteenLevelsHoldTheField) {
  // 65536 cells along an axis: no start grid reaches the finest regions
  const AmrHierarchy h(generate_mesh(Json::parse(
      R"({"field": {"type": "sum", "terms": [{"type": "linear", "gradient": [1, 2, 3]}, {"type": "blobs"}]},
          "levels": 13, "root": 16, "patch": 4, "refine": {"criterion": "nested", "center": [0.51, 0.43, 0.62]}})")));
  ASSERT_EQ(h.level_count(), 13);
  const auto positions = probe_positions(h, 30);
  for (const Json& parameters : parameter_sets()) {
    SCOPED_TRACE(parameters.dump());
    const EncodedField exact = exa_field(h, Filter::basis, parameters, {.storage = Storage::r64f});
    const Comparison in_double = compare_double(h, exact, positions);
    EXPECT_TRUE(in_double) << in_double;
    const EncodedField field = exa_field(h, Filter::basis, parameters);
    const Comparison in_float = compare(positions, reference_values(h, field.definition, positions),
                                        probe_on_cpu(h, field, Precision::single_precision, positions), 1e-5 * value_range(h));
    EXPECT_TRUE(in_float) << in_float;
  }
}

TEST(Exabricks, FloatIsContinuousAcrossFacesEdgesAndCornersOfThreeLevels) {
  // one ulp to either side of every vertex of finest cells: f is continuous, so both values are the reference's there
  const AmrHierarchy h = nested(waves).hierarchy();
  std::vector<FinestPosition> above, below;
  for_each_cell({Vec3i(1), h.cells(h.finest_level())}, [&](const Vec3i& c) {
    above.push_back({c, Vec3d(0)});
    below.push_back({c - Vec3i(1), Vec3d(kBelowOne)});
  });
  for (const Json& parameters : parameter_sets()) {
    SCOPED_TRACE(parameters.dump());
    const EncodedField field = exa_field(h, Filter::basis, parameters);
    const Values expected = reference_values(h, field.definition, above);
    for (const auto& side : {above, below}) {
      const Comparison result =
          compare(side, expected, probe_on_cpu(h, field, Precision::single_precision, side), 1e-5 * value_range(h));
      EXPECT_TRUE(result) << result;
    }
  }
}

TEST(Exabricks, ThePictureDoesNotDependOnBricksOrSkipping) {
  const AmrHierarchy h = nested(waves).hierarchy();
  Scene scene;
  const Vec3d middle = (h.domain_lower() + h.domain_upper()) * 0.5;
  scene.view = perspective(middle + (h.domain_upper() - h.domain_lower()) * Vec3d(1.1, -1.7, 0.8), middle);
  scene.transfer_function.extinction = {{0.5, 0}, {1, 20}};
  scene.transfer_function.color = {{0, {1, 0.2, 0}}, {1, {0, 0.5, 1}}};
  scene.settings.width = 60;
  scene.settings.height = 48;
  scene.settings.sampling = Sampling::lattice;
  const auto draw_field = [&](const Json& parameters, bool skip, bool on_gl) {
    scene.settings.skip = skip;
    return draw_on(on_gl, h, exa_field(h, Filter::basis, parameters, {.value_ranges = skip}), scene);
  };
  for (const bool on_gl : {false, true}) {
    const Picture expected = draw_field(Json::object(), false, on_gl);
    EXPECT_GT(largest(expected), 0.01);
    for (const Json& parameters : parameter_sets()) {
      if (on_gl && !full_tier() && parameters != parameter_sets().back()) continue;  // the CPU asks all of them
      SCOPED_TRACE(parameters.dump());
      const Picture all = draw_field(parameters, false, on_gl);
      EXPECT_EQ(draw_field(parameters, true, on_gl).values, all.values) << "skipping changes no bit";
      EXPECT_LE(difference(all, expected), 1e-6);
    }
  }
}

TEST(Exabricks, ASampleTellsTheLevelOfItsLeafWhereverFinerHatsReach) {
  const AmrHierarchy h = jump_of_two(waves).hierarchy();
  const auto positions = probe_positions(h, 40);
  for (const Json& parameters : parameter_sets()) {
    SCOPED_TRACE(parameters.dump());
    const auto found = probe_on_cpu(h, exa_field(h, Filter::basis, parameters), Precision::single_precision, positions);
    for (std::size_t i = 0; i < positions.size(); ++i)
      if (const auto leaf = h.find_leaf(positions[i].cell)) {
        EXPECT_EQ(found[i].level, leaf->level);
      }
  }
}

// ---- gradients

Scene normals_of(double isovalue, Shading shading, const Vec3d& middle, int pixels) {
  Scene scene;
  scene.view = orthographic(middle, {0.3, 0.2, -1}, 0.9);
  scene.settings.mode = Mode::iso;
  scene.settings.step = 0.25;
  scene.settings.width = scene.settings.height = pixels;
  scene.settings.isosurfaces.values = {isovalue};
  scene.settings.isosurfaces.tolerance = 1e-5;
  scene.settings.isosurfaces.shading = shading;
  scene.settings.isosurfaces.output = Output::normal;
  return scene;
}

TEST(ExabricksGradients, OfTheReferenceAreTheLimitsOfDifferences) {
  // f is a quotient of trilinear functions between the planes of cell centres and faces: (f(p + e) - f(p - e)) / 2e = f'(p) +
  // O(e^2)
  const double e = 1e-5;
  for (const NamedMesh& mesh : conformance_meshes()) {
    SCOPED_TRACE(mesh.name);
    const AmrHierarchy& h = mesh.hierarchy;
    const Vec3d cell = h.spacing(h.finest_level());
    for (const Filter filter : {Filter::basis, Filter::linear_lod, Filter::linear_vertex}) {
      const auto reference = make_filter_reference(h, 0, {filter});
      ReferencePoint point(*reference);
      const auto f = [&](const Vec3d& p) {
        const auto at = position_at(h, p);
        return at ? point.value(*at) : std::nullopt;
      };
      for (const FinestPosition& at : probe_positions(h, 20)) {
        // a quarter and an eighth of a finest cell: no centre and no face of any level
        const Vec3d p = Vec3d(at.cell) + Vec3d(0.25, 0.375, 0.125);
        const auto derivative = point.derivative(p);
        for (int a = 0; derivative && a < 3; ++a) {
          Vec3d step(0);
          step[a] = e;
          const auto below = f(p - step), above = f(p + step);
          if (!below || !above) continue;
          EXPECT_NEAR((*derivative)[a] * cell[a], (*above - *below) / (2 * e), 1e-6 * value_range(h)) << filter_name(filter);
        }
      }
    }
  }
}

TEST(ExabricksGradients, AreTheReferencesNormals) {
  for (const NamedMesh& mesh : conformance_meshes()) {
    if (mesh.name == "one cell") continue;
    SCOPED_TRACE(mesh.name);
    const AmrHierarchy& h = mesh.hierarchy;
    const Scene scene = normals_of(0.55, Shading::analytic, (h.domain_lower() + h.domain_upper()) * 0.5, 24);
    for (const Json& parameters : {Json::object(), Json{{"border", 0}}, Json{{"locate", "cells"}}}) {
      SCOPED_TRACE(parameters.dump());
      BuildRequest request;
      request.storage = Storage::r64f;
      request.needs = scene_needs(scene, Filter::basis, Filtering::manual);
      request.parameters = parameters;
      const EncodedField field = find_encoding("exabricks").build(h, request);
      const Picture expected = HierarchyReference(h, 0, field.definition).render(scene, 0.0625);
      const Picture drawn = render_on_cpu(h, field, scene, true);
      int compared = 0, off = 0;
      for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 24; ++x) {
          const double *a = expected.pixel(x, y), *b = drawn.pixel(x, y);
          if (a[3] == 0 || b[3] == 0) continue;
          ++compared;
          const double distance = glm::distance(Vec3d(a[0], a[1], a[2]), Vec3d(b[0], b[1], b[2]));
          off += distance > 1e-3 ? 1 : 0;
        }
      EXPECT_GT(compared, 20);
      // silhouettes, and hits that lie by rounding on one side of a plane through cell centres, where the derivative jumps
      EXPECT_LE(off, 0.025 * compared);
    }
  }
}

TEST(ExabricksGradients, OfASphereConvergeInEveryKind) {
  const Vec3d middle(0.5);
  const auto distance = [&](const Vec3d& p) { return glm::distance(p, middle); };
  for (const Shading shading : {Shading::analytic, Shading::central, Shading::clamped}) {
    std::vector<double> errors;
    for (const int n : {16, 32, 64}) {
      // two levels that meet across the sphere
      const AmrHierarchy h =
          MeshBuilder(Vec3i(n), {2}).root(distance).patch(1, {{0, 0, 0}, {n, 2 * n, 2 * n}}, distance).hierarchy();
      const Scene scene = normals_of(0.3, shading, middle, 32);
      BuildRequest request;
      request.needs = scene_needs(scene, Filter::basis, Filtering::hardware);
      const EncodedField field = find_encoding("exabricks").build(h, request);
      const Picture picture = draw(context(ContextKind::egl), h, field, scene);
      double sum = 0;
      int count = 0;
      for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x) {
          const WorldRay ray = camera_ray(camera_frame(scene.view, 32, 32), x, y, 32, 32);
          const double b = glm::dot(ray.origin - middle, ray.direction);
          const double discriminant = b * b - glm::dot(ray.origin - middle, ray.origin - middle) + 0.09;
          if (discriminant < 0.01) continue;
          const Vec3d exact = (ray.origin + (-b - std::sqrt(discriminant)) * ray.direction - middle) / 0.3;
          const double* p = picture.pixel(x, y);
          sum += std::pow(glm::distance(Vec3d(p[0], p[1], p[2]), exact), 2);
          ++count;
        }
      errors.push_back(std::sqrt(sum / count));
    }
    SCOPED_TRACE(fmt::format("{}: {:.2e} {:.2e} {:.2e}", shading_name(shading), errors[0], errors[1], errors[2]));
    RecordProperty(std::string(shading_name(shading)), fmt::format("{:.3e}", errors[2]));
    EXPECT_LT(errors[2], 0.05);
    EXPECT_GE(std::log2(errors[0] / errors[2]) / 2, 0.45)
        << "a share of the pixels lies where levels meet, and the kinks of f stay there";
  }
}

TEST(ExabricksGradients, AreRefusedWhereAnEncodingHasNone) {
  const AmrHierarchy h = nested(waves).hierarchy();
  BuildRequest request;
  request.needs.filter = Filter::nearest;
  request.needs.analytic_gradients = true;
  for (const char* name : {"exabricks", "uniform"}) {
    try {
      find_encoding(name).build(h, request);
      ADD_FAILURE() << name;
    } catch (const UnsupportedError& error) {
      EXPECT_THAT(error.what(),
                  AllOf(HasSubstr(name), HasSubstr("no analytic gradient of nearest"), HasSubstr("exabricks with basis")));
    }
  }
}

TEST(Exabricks, AdviceComparesWidthsOfBricks) {
  const std::vector<ParameterInfo> parameters = find_encoding("exabricks").parameters();
  const auto width = std::find_if(parameters.begin(), parameters.end(), [](const auto& p) { return p.name == "brick_width"; });
  ASSERT_NE(width, parameters.end());
  EXPECT_EQ(width->compared, (std::vector<Json>{16, 32, 64}));
}

// ---- refusals

TEST(Exabricks, ParametersAreRefusedByName) {
  const AmrHierarchy h = nested(waves).hierarchy();
  for (const auto& [parameters, named] :
       {std::pair(Json{{"brick_width", 1}}, "brick_width is 1"), std::pair(Json{{"brick_width", 257}}, "brick_width is 257"),
        std::pair(Json{{"border", 2}}, "border is 2"), std::pair(Json{{"traversal", "octree"}}, "traversal is \"octree\""),
        std::pair(Json{{"locate", 3}}, "locate is 3")}) {
    try {
      exa_field(h, Filter::basis, parameters);
      ADD_FAILURE() << parameters.dump();
    } catch (const UsageError& e) {
      EXPECT_THAT(e.what(), AllOf(HasSubstr("exabricks"), HasSubstr(named), HasSubstr("accepted")));
    }
  }
}

TEST(Exabricks, TooManyRegionsAreCountedAndAWiderBrickSuggested) {
  const AmrHierarchy h = MeshBuilder(Vec3i(32)).root(waves).hierarchy();
  BuildRequest request;
  request.needs.filter = Filter::basis;
  request.parameters = {{"brick_width", 4}};
  request.memory_limit = 1000;
  try {
    find_encoding("exabricks").build(h, request);
    ADD_FAILURE() << "built";
  } catch (const BudgetError& e) {
    EXPECT_THAT(e.what(),
                AllOf(HasSubstr("512 bricks and 512 regions"), HasSubstr("brick_width above 4"), HasSubstr("1000 bytes")));
    EXPECT_GT(e.needed_bytes(), 32 * 32 * 32 * 4) << "records and advice tell how much is missing";
  }
  // the widest brick has nothing wider to be named
  request.parameters = {{"brick_width", 256}};
  try {
    find_encoding("exabricks").build(h, request);
    ADD_FAILURE() << "built";
  } catch (const BudgetError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("1 bricks and 1 regions"), Not(HasSubstr("makes fewer"))));
  }
  request.parameters = {{"brick_width", 4}};
  request.memory_limit = std::numeric_limits<std::int64_t>::max();
  request.context.max_buffer_bytes = 4096;  // 512 regions of 32 bytes take 16384
  try {
    find_encoding("exabricks").build(h, request);
    ADD_FAILURE() << "built";
  } catch (const UnsupportedError& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr(": 16384 bytes"), HasSubstr("brick_width above 4")));
  }
}

TEST(Exabricks, NearestVolumesHoldCellsRegionsAndTheirTreeAndFivePercent) {
  expect_nearest_holds_little_more("exabricks", [](const AmrHierarchy& h, const EncodedField& f) {
    // eight words and a range a region, two words a node, an entry and a node of the start grid
    return h.leaf_cells() * 4 + counted(f, "regions") * 36 + counted(f, "nodes") * 8 + f.find("exa_start")->bytes() +
           f.find("exa_start_nodes")->bytes();
  });
}

// ---- filtering by the texture unit

/// Of the level values within two cells of a place, whatever level's: what pieces about it are filtered between.
double widest_difference(const AmrHierarchy& h, const FinestPosition& p) {
  double widest = 0;
  for (int level = 0; level < h.level_count(); ++level) widest = std::max(widest, local_range(h, level, p));
  return widest;
}

struct PoolError {
  double texels = 0;  ///< largest error over the differences about the place: as if the texture unit had read so far off
  double bound = 0;   ///< of that
};

PoolError hardware_error(const AmrHierarchy& h, const Json& parameters) {
  const auto at = probe_positions(h, 200);
  const EncodedField field = exa_field(h, Filter::basis, parameters, {.filtering = Filtering::hardware});
  const Vec3i pool = field.find("tex_exa_pool")->size;
  Context& gl = context(ContextKind::egl);
  const auto got = probe_on_gl(gl, h, Structure(gl, field), at);
  const Values expected = reference_values(h, field.definition, at);
  PoolError error;
  error.bound = 3 * 2 * 4 * 0x1p-24 * std::max({pool.x, pool.y, pool.z});  // README.md, three axes
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!expected[i]) continue;
    // what float arithmetic loses is no matter of the texture unit
    const double off = std::abs(got[i].value - *expected[i]) - 2e-6 * value_range(h);
    if (off > 0) error.texels = std::max(error.texels, off / widest_difference(h, at[i]));
  }
  return error;
}

TEST(ExabricksHardware, ErrsByWhatThePoolsCoordinateIsRoundedBy) {
  // bricks of at most two cells: all samples lie near a brick's face, and pools are wide for what they hold
  for (const std::uint64_t seed : {0, 3, 5, 10})
    for (const int border : {0, 1}) {
      const AmrHierarchy h = seed == 0 ? nested(waves).hierarchy() : small_random_mesh(seed);
      const PoolError error = hardware_error(h, {{"border", border}, {"brick_width", 2}});
      EXPECT_LE(error.texels, error.bound) << "seed " << seed << " border " << border;
      EXPECT_GT(error.texels, 0) << "the texture unit did take part";
    }
}

}  // namespace
}  // namespace amrtex
