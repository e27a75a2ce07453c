// Values stay in the type of their file, and nobody who reads them sees it.
#include "structures/mesh/cell_values.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "structures/generators/random_mesh.hpp"
#include "structures/mesh/exact_hash.hpp"
#include "structures/mesh/level_values.hpp"
#include "structures/mesh/vertex_values.hpp"

namespace amrtex {
namespace {

using testing::ElementsAre;

TEST(CellSet, NumbersItsCells) {
  std::vector<std::uint8_t> mask(200, 1);
  const std::vector<std::size_t> cells = {0, 1, 63, 64, 130, 199};
  for (const std::size_t cell : cells) mask[cell] = 0;
  const CellSet set(mask);
  EXPECT_EQ(set.count(), cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    EXPECT_TRUE(set.holds(cells[i]));
    EXPECT_EQ(set.rank(cells[i]), i);
  }
  EXPECT_FALSE(set.holds(2));
  EXPECT_FALSE(set.holds(198));
}

TEST(CellValues, OfFloatsTakeFourBytesAndAreReadAsDoubles) {
  const CellValues values(CellArray<float>{0.1F, -2.5F, 3e38F});
  EXPECT_EQ(values.type(), RealType::float32);
  EXPECT_EQ(values[0], static_cast<double>(0.1F));
  EXPECT_THAT(values.doubles(), ElementsAre(static_cast<double>(0.1F), -2.5, static_cast<double>(3e38F)));
  EXPECT_EQ(CellValues(std::vector<double>{0.1})[0], 0.1);
}

TEST(CellMemory, HoldsArraysBehindOneAnotherAsLongAsOneOfThemLives) {
  // 10 doubles take 80 bytes, 128 with what aligns them; 3 such arrays fit, the fourth is on its own
  auto memory = std::make_shared<CellMemory>(3 * CellMemory::taken(10 * sizeof(double)));
  EXPECT_EQ(CellMemory::taken(10 * sizeof(double)), 128U);
  const std::weak_ptr<CellMemory> watched = memory;
  std::vector<CellValues> arrays;
  for (int i = 0; i < 4; ++i) {
    arrays.emplace_back(RealType::float64, std::size_t{10}, memory);
    for (std::size_t cell = 0; cell < 10; ++cell) arrays.back().set(cell, i);
  }
  const auto place = [&](std::size_t i) {
    return arrays[i].visit_stored([](const auto& stored) { return reinterpret_cast<const std::byte*>(stored.data()); });
  };
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(memory->holds(place(i)), i < 3);
    EXPECT_EQ(arrays[i].doubles(), std::vector<double>(10, static_cast<double>(i)));
  }
  EXPECT_EQ(place(1) - place(0), 128);
  const CellValues copy = arrays[1];
  memory.reset();
  arrays[0] = std::move(arrays[2]);
  EXPECT_EQ(arrays[0][9], 2);
  EXPECT_FALSE(watched.expired());
  arrays.clear();
  EXPECT_TRUE(watched.expired()) << "a copy is an array of its own";
  EXPECT_EQ(copy[9], 1);
}

TEST(CellMemory, BeyondTheAddressSpaceIsNotThere) {
  EXPECT_THROW(CellMemory(std::numeric_limits<std::size_t>::max()), std::bad_alloc);
  EXPECT_THROW(CellMemory(std::size_t{1} << 62), std::bad_alloc);
}

TEST(CellValues, HoldMeansThatNoFloatHolds) {
  CellValues values(CellArray<float>{1, 2, 3, 4});
  const std::vector<std::uint8_t> mask = {1, 0, 1, 0};
  values.hold_means(std::make_shared<const CellSet>(mask));
  values.set_mean(1, 0.1);
  values.set_mean(3, 1e300);
  const std::vector<double> expected = {1, 0.1, 3, 1e300};
  EXPECT_EQ(values.doubles(), expected);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(values[i], expected[i]);
  const CellValues copy = values;
  values.set_mean(1, 7);
  EXPECT_EQ(copy[1], 0.1) << "a copy has means of its own";
}

/// The same mesh with values that floats hold, as floats or as doubles.
AmrHierarchy with_type(std::uint64_t seed, RealType type) {
  RandomMeshOptions options;
  options.fields = 2;
  MeshDescription mesh = random_mesh(seed, options);
  for (auto& level : mesh.levels)
    for (Patch& patch : level)
      for (CellValues& values : patch.values) {
        CellArray<float> rounded;
        for (const double v : values) rounded.push_back(static_cast<float>(v));
        values = type == RealType::float32 ? CellValues(std::move(rounded))
                                           : CellValues(CellArray<double>(rounded.begin(), rounded.end()));
      }
  return AmrHierarchy(std::move(mesh));
}

TEST(CellValues, OfFloatsMakeTheSameMeshToTheBit) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const AmrHierarchy narrow = with_type(seed, RealType::float32);
    const AmrHierarchy wide = with_type(seed, RealType::float64);
    const std::vector<int> fields = {0, 1};
    EXPECT_EQ(exact_hash(narrow, fields), exact_hash(wide, fields)) << seed;
    for (const int field : fields) {
      EXPECT_EQ(narrow.content_hash(field), wide.content_hash(field)) << seed;
      EXPECT_EQ(narrow.statistics(field).volume_integral, wide.statistics(field).volume_integral) << seed;
      for (int level = 0; level < wide.level_count(); ++level) {
        const Box box = intersection(wide.domain(level), {Vec3i(0), Vec3i(12)}).grown(1);
        const auto read = [&](const AmrHierarchy& mesh, auto&& function) {
          std::vector<double> values(static_cast<std::size_t>(box.cells()));
          function(mesh, field, level, box, values);
          for (double& v : values) v = std::isnan(v) ? -1e300 : v;
          return values;
        };
        EXPECT_EQ(read(narrow, level_values), read(wide, level_values)) << seed;
        EXPECT_EQ(read(narrow, vertex_values), read(wide, vertex_values)) << seed;
      }
    }
    for (int level = 0; level < narrow.level_count(); ++level)
      for (const Patch& patch : narrow.patches(level)) EXPECT_EQ(patch.values[0].type(), RealType::float32);
  }
}

TEST(CellValues, WithoutAValueStayWithoutOne) {
  MeshDescription mesh;
  mesh.name = "gaps";
  mesh.root_cells = Vec3i(3, 1, 1);
  mesh.fields = {"f"};
  mesh.levels = {{Patch{
      {Vec3i(0), {3, 1, 1}},
      {CellValues(CellArray<float>{1, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()})}}}};
  const AmrHierarchy h(std::move(mesh));
  EXPECT_EQ(h.statistics(0).cells_without_value, 2);
  EXPECT_EQ(h.statistics(0).max, 1);
}

}  // namespace
}  // namespace amrtex
