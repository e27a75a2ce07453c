// Regions and sample places as `amrtex structure` lists them.
#include "renderers/cpu/structure_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/verify/encoding_cases.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/error.hpp"

namespace amrtex {
namespace {

using testing::Each;
using testing::HasSubstr;

/// Places are what these tests look at.
const FieldValues kOnes = [](const FinestPosition&, int) { return 1.0; };

AmrHierarchy small_mesh() {
  return AmrHierarchy(
      generate_mesh({{"field", {{"type", "shell"}, {"center", {0.1, 0.1, 0.25}}, {"radius", 0.62}, {"width", 0.07}}},
                     {"levels", 3},
                     {"root", {8, 8, 4}},
                     {"patch", 4},
                     {"domain", {{"lower", {0, 0, 0}}, {"upper", {1, 1, 0.5}}}},
                     {"refine", {{"criterion", "gradient"}, {"threshold", 0.2}}}}));
}

EncodedField built(const AmrHierarchy& mesh, const std::string& encoding, Filter filter) {
  BuildRequest request;
  request.needs = {filter, Filtering::manual, true};
  request.parameters = complete_parameters(find_encoding(encoding), Json::object());
  return find_encoding(encoding).build(mesh, request);
}

TEST(StructureView, RegionsOfEveryEncodingAndFilterDivideTheDomain) {
  const AmrHierarchy mesh = small_mesh();
  const Box domain = mesh.domain(mesh.finest_level());
  for (const verify::EncodingCase& c : verify::make_encoding_cases({})) {
    SCOPED_TRACE(c.name());
    if (!verify::accepted(mesh, c)) continue;
    std::vector<int> covered(static_cast<std::size_t>(domain.cells()));
    for (const FieldRegion& r : list_regions(mesh, verify::build(mesh, c))) {
      EXPECT_TRUE(r.holds_mesh);
      EXPECT_TRUE(domain.contains(r.cells));
      for_each_cell(r.cells, [&](const Vec3i& cell) { ++covered[domain.offset(cell)]; });
    }
    EXPECT_THAT(covered, Each(1));
  }
}

TEST(StructureView, RegionsOfADenseTextureAreOneAndThoseOfAnOctreeAreTheLeafCells) {
  const AmrHierarchy mesh = small_mesh();
  const std::vector<FieldRegion> dense = list_regions(mesh, built(mesh, "uniform", Filter::nearest));
  ASSERT_EQ(dense.size(), 1U);
  EXPECT_EQ(dense[0].cells, mesh.domain(mesh.finest_level()));
  const std::vector<FieldRegion> cells = list_regions(mesh, built(mesh, "octree", Filter::nearest));
  EXPECT_EQ(static_cast<std::int64_t>(cells.size()), mesh.leaf_cells());
  for (const FieldRegion& r : cells) EXPECT_EQ(r.level, mesh.find_leaf(r.cells.lower)->level);
}

TEST(StructureView, DomainsThatAreTooLargeAreRefusedWithTheNumber) {
  const AmrHierarchy mesh(generate_mesh({{"field", "constant"}, {"levels", 8}, {"root", 8}, {"patch", 4}, {"refine", "nested"}}));
  try {
    list_regions(mesh, built(mesh, "octree", Filter::nearest));
    FAIL() << "not refused";
  } catch (const UnsupportedError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("1073741824"), HasSubstr("16777216")));
  }
}

TEST(StructureView, LatticeSamplesLieInTheMiddlesOfEqualIntervals) {
  const AmrHierarchy mesh = small_mesh();
  const double cell = mesh.spacing(mesh.finest_level()).x;
  const WorldRay ray{{-1, 0.51, 0.26}, {1, 0, 0}};
  const std::vector<SamplePlace> places =
      list_samples(mesh, built(mesh, "kd_tree", Filter::linear_lod), kOnes, ray, Sampling::lattice, 2);
  ASSERT_EQ(places.size(), 16U);  // 32 finest cells
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_NEAR(places[i].position.x, (2 * static_cast<double>(i) + 1) * cell, cell / 2048);
    EXPECT_NEAR(places[i].position.y, 0.51, cell / 2048);
    EXPECT_TRUE(places[i].value.has_value());
  }
}

TEST(StructureView, AdaptiveSamplesDivideEachRegionIntoEqualIntervals) {
  const AmrHierarchy mesh = small_mesh();
  const EncodedField field = built(mesh, "octree", Filter::nearest);
  const WorldRay ray{{-1, 0.51, 0.26}, {1, 0, 0}};
  const std::vector<SamplePlace> places = list_samples(mesh, field, kOnes, ray, Sampling::adaptive, 0.5);
  const double cell = mesh.spacing(mesh.finest_level()).x;
  std::size_t next = 0;
  for (const FieldRegion& r : list_regions(mesh, field)) {
    const Vec3i probe(r.cells.lower.x, static_cast<int>(0.51 / cell), static_cast<int>(0.26 / cell));
    if (!r.cells.contains(probe)) continue;
    const double width = r.cells.size().x * cell;
    for (const double part : {0.25, 0.75}) {
      double nearest = 1;
      for (const SamplePlace& p : places)
        nearest = std::min(nearest, std::abs(p.position.x - (r.cells.lower.x * cell + part * width)));
      EXPECT_LT(nearest, cell / 2048);
      ++next;
    }
  }
  EXPECT_EQ(places.size(), next);
}

TEST(StructureView, ARayBesideTheDomainHasNoSamples) {
  const AmrHierarchy mesh = small_mesh();
  const EncodedField field = built(mesh, "uniform", Filter::nearest);
  EXPECT_TRUE(list_samples(mesh, field, kOnes, {{-1, 3, 0.2}, {1, 0, 0}}, Sampling::lattice, 1).empty());
}

}  // namespace
}  // namespace amrtex
