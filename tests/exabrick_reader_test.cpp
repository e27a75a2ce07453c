// Data sets of the ExaBricks family: single leaf cells, level 0 the finest, without a header.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <random>
#include <tuple>

#include "structures/generators/random_mesh.hpp"
#include "structures/mesh/cell_boxes.hpp"
#include "structures/mesh/json.hpp"
#include "structures/readers/exabrick/exabrick.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"
#include "tests/reader_files.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

using Cells = std::vector<std::int32_t>;  // x, y, z, level each
using Scalars = std::vector<float>;

/// The cell of width 2 at (0, 0, 0) refined, the seven others of 2 x 2 x 2 not. Values count up.
Cells one_refined() {
  Cells cells;
  const auto add = [&](const Vec3i& c, int level) { cells.insert(cells.end(), {c.x, c.y, c.z, level}); };
  for_each_cell({Vec3i(0), Vec3i(2)}, [&](const Vec3i& c) { add(c, 0); });
  for_each_cell({Vec3i(0), Vec3i(2)}, [&](const Vec3i& c) {
    if (c != Vec3i(0)) add(c * 2, 1);
  });
  return cells;
}

Scalars counted(std::size_t count) {
  Scalars scalars;
  for (std::size_t i = 0; i < count; ++i) scalars.push_back(static_cast<float>(i));
  return scalars;
}

class ExaBrick : public FolderTest {
 protected:
  /// Writes a data set; its file of cells.
  fs::path write_set(const std::string& name, const Cells& cells) const {
    write_values(name + ".scalars", counted(cells.size() / 4));
    return write_values(name + ".cells", cells);
  }
  std::string refusal(const Cells& cells) const {
    const fs::path file = write_set("bad", cells);
    return message_of([&] { AmrHierarchy(read_mesh(file)).content_hash(0); });
  }
  static std::string hash(const fs::path& file) { return AmrHierarchy(read_mesh(file)).content_hash(0); }
};

TEST_F(ExaBrick, TheirLevel0IsOurFinest) {
  const AmrHierarchy mesh(read_mesh(write_set("a", one_refined())));
  EXPECT_EQ(mesh.level_count(), 2);
  EXPECT_EQ(mesh.ratio_to_finer(0), 2);
  EXPECT_EQ(mesh.leaf_cells(0), 7);
  EXPECT_EQ(mesh.leaf_cells(1), 8);
  EXPECT_FALSE(mesh.has_holes());
  EXPECT_EQ(mesh.domain_lower(), Vec3d(0));
  EXPECT_EQ(mesh.domain_upper(), Vec3d(4)) << "world units are finest cells";
  EXPECT_EQ(mesh.fields(), std::vector<std::string>{"a"});
  EXPECT_EQ(mesh.value(*mesh.find_leaf({1, 0, 0}), 0), 1);
  EXPECT_EQ(mesh.value(*mesh.find_leaf({3, 3, 3}), 0), 14);
  EXPECT_EQ(mesh.level_value(0, {0, 0, 0}, 0), 3.5) << "the mean of 0 to 7";
}

TEST_F(ExaBrick, OrderPlaceAndUnusedLevelsDoNotMatter) {
  const std::string expected = hash(write_set("a", one_refined()));
  Cells moved = one_refined();
  for (std::size_t i = 0; i < moved.size(); i += 4) {
    for (std::size_t axis = 0; axis < 3; ++axis) moved[i + axis] = 4 * moved[i + axis] - 1000 - static_cast<int>(axis);
    moved[i + 3] += 2;
  }
  EXPECT_EQ(hash(write_set("moved", moved)), expected);
  Cells reversed;
  Scalars scalars;
  const Cells cells = one_refined();
  for (std::size_t i = cells.size() / 4; i-- > 0;) {
    reversed.insert(reversed.end(), {cells[4 * i], cells[4 * i + 1], cells[4 * i + 2], cells[4 * i + 3]});
    scalars.push_back(static_cast<float>(i));
  }
  write_values("reversed.scalars", scalars);
  EXPECT_EQ(hash(write_values("reversed.cells", reversed)), expected);
}

TEST_F(ExaBrick, LevelsThatHoldNothingAreLeftOut) {
  // a cell of width 8 beside one of width 2: a ratio of 4
  const AmrHierarchy mesh(read_mesh(write_set("a", {0, 0, 0, 3, 8, 2, 4, 1})));
  EXPECT_EQ(mesh.level_count(), 2);
  EXPECT_EQ(mesh.ratio_to_finer(0), 4);
  EXPECT_EQ(mesh.leaf_cells(), 2);
  EXPECT_TRUE(mesh.has_holes());
  EXPECT_EQ(mesh.domain_upper(), Vec3d(16, 8, 8));
}

TEST_F(ExaBrick, HolesMayBeSingleCellsOfAnyLevel) {
  // of the refined cell only five of eight children exist, beside unrefined siblings
  Cells cells;
  const Cells all = one_refined();
  for (std::size_t i = 0; i < all.size(); i += 4)
    if (i < 5 * 4 || all[i + 3] == 1)
      cells.insert(cells.end(), all.begin() + static_cast<std::ptrdiff_t>(i), all.begin() + static_cast<std::ptrdiff_t>(i) + 4);
  const AmrHierarchy mesh(read_mesh(write_set("a", cells)));
  EXPECT_EQ(mesh.leaf_cells(), 12);
  EXPECT_TRUE(mesh.has_holes());
  EXPECT_EQ(mesh.statistics(0).cells_without_value, 0);
  EXPECT_FALSE(mesh.find_leaf({1, 0, 1}).has_value());
  EXPECT_EQ(mesh.find_leaf({0, 0, 1})->level, 1);
  EXPECT_EQ(mesh.level_value(0, {0, 0, 0}, 0), 2) << "the mean of 0 to 4";
  EXPECT_EQ(mesh.statistics(0).volume_integral, (0 + 1 + 2 + 3 + 4) + 8.0 * (5 + 6 + 7 + 8 + 9 + 10 + 11));
}

TEST_F(ExaBrick, SeveralRootBoxesAreOneDomain) {
  Cells cells;
  for (int box = 0; box < 3; ++box)
    for (std::size_t i = 0; i < one_refined().size(); i += 4) {
      const Cells one = one_refined();
      cells.insert(cells.end(), {one[i] + 4 * box, one[i + 1], one[i + 2], one[i + 3]});
    }
  const AmrHierarchy mesh(read_mesh(write_set("a", cells)));
  EXPECT_EQ(mesh.cells(0), Vec3i(6, 2, 2));
  EXPECT_EQ(mesh.leaf_cells(), 45);
  EXPECT_FALSE(mesh.has_holes());
}

/// The mesh of one_refined() as two bricks that name cells in an order of their own, and seven of one cell.
Cells bricks_of_one_refined() {
  Cells words = {2, 2, 1, 0, 0, 0, 0, 0, 1, 2, 3, 2, 2, 1, 0, 0, 1, 0, 4, 5, 6, 7};
  std::int32_t id = 8;
  for_each_cell({Vec3i(0), Vec3i(2)}, [&](const Vec3i& c) {
    if (c != Vec3i(0)) words.insert(words.end(), {1, 1, 1, 2 * c.x, 2 * c.y, 2 * c.z, 1, id++});
  });
  return words;
}

TEST_F(ExaBrick, BricksAreTheSameMesh) {
  const std::string expected = hash(write_set("a", one_refined()));
  write_values("b.scalars", counted(15));
  EXPECT_EQ(hash(write_values("b.bricks", bricks_of_one_refined())), expected);
  EXPECT_EQ(hash(at("b.scalars")), expected) << "named by its scalars";
  EXPECT_EQ(hash(at("a.scalars")), expected);
}

TEST_F(ExaBrick, AnExaFileNamesFieldsAndTheWorld) {
  write_set("a", one_refined());
  Scalars other = counted(15);
  for (float& v : other) v = 100 - v;
  write_values("other.f32", other);
  write("a.exa",
        "# a comment\nscalar first a.scalars\nvector v other.f32 a.scalars other.f32 # three\nvalue_range 0 1\n\ncells a.cells\n"
        "remap_from 0 0 0 4 4 4\nremap_to -1 0 2 1 2 4\n");
  const AmrHierarchy mesh(read_mesh(at("a.exa")));
  EXPECT_EQ(mesh.fields(), (std::vector<std::string>{"first", "v_x", "v_y", "v_z"}));
  EXPECT_EQ(mesh.domain_lower(), Vec3d(-1, 0, 2));
  EXPECT_EQ(mesh.domain_upper(), Vec3d(1, 2, 4));
  EXPECT_EQ(mesh.value(*mesh.find_leaf({3, 3, 3}), 1), 86);
  const AmrHierarchy one(read_mesh(at("a.exa"), {"v_y"}));
  EXPECT_EQ(one.fields(), std::vector<std::string>{"v_y"});
  EXPECT_EQ(one.content_hash(0), mesh.content_hash(0));
}

TEST_F(ExaBrick, AFolderOfOneDataSetNamesIt) {
  write_set("a", one_refined());
  EXPECT_EQ(hash(folder_), hash(at("a.cells")));
  write_set("b", one_refined());
  EXPECT_THAT(message_of([&] { read_mesh(folder_); }), AllOf(HasSubstr("a.cells, b.cells"), HasSubstr("name one")));
}

TEST_F(ExaBrick, IsKnownByItsSizesUnderAnyName) {
  write_set("a", one_refined());
  fs::rename(at("a.cells"), at("a.leaves"));
  EXPECT_EQ(AmrHierarchy(read_mesh(at("a.leaves"))).leaf_cells(), 15);
  write_values("a.scalars", counted(14));
  EXPECT_THAT(message_of([&] { read_mesh(at("a.leaves")); }), HasSubstr("not in a format that can be read"));
}

// ---- real data ----

struct ExaOracle {
  const char* data;
  const char* oracle;
};
void PrintTo(const ExaOracle& c, std::ostream* out) { *out << c.data; }
class ExaBrickOracle : public ::testing::TestWithParam<ExaOracle> {};

TEST_P(ExaBrickOracle, Agrees) {
  AMRTEX_NEEDS(kSharedData, GetParam().data);
  AMRTEX_NEEDS(kSharedData, GetParam().oracle);
  const Json oracle = Json::parse(bytes_of_file(kSharedData / GetParam().oracle));
  const AmrHierarchy mesh(read_mesh(kSharedData / GetParam().data));
  EXPECT_EQ(mesh.leaf_cells(), oracle.at("cells").get<std::int64_t>());
  std::vector<std::int64_t> leaves;  // theirs by level, the finest first
  for (const auto& [level, count] : oracle.at("exa_levels").items()) leaves.push_back(count.get<std::int64_t>());
  ASSERT_EQ(static_cast<std::size_t>(mesh.level_count()), leaves.size());
  for (int level = 0; level < mesh.level_count(); ++level)
    EXPECT_EQ(mesh.leaf_cells(level), leaves[static_cast<std::size_t>(mesh.finest_level() - level)]) << "level " << level;
  EXPECT_EQ(mesh.has_holes(), oracle.at("sum_cell_volume_in_finest_cells") != oracle.at("bbox_volume_in_finest_cells"));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(mesh.domain_lower()[static_cast<int>(axis)], oracle.at("bounds_lower")[axis].get<double>());
    EXPECT_EQ(mesh.domain_upper()[static_cast<int>(axis)], oracle.at("bounds_upper")[axis].get<double>());
  }
  const FieldStatistics& s = mesh.statistics(0);
  EXPECT_EQ(s.min, oracle.at("scalar_min").get<double>());
  EXPECT_EQ(s.max, oracle.at("scalar_max").get<double>());
  const double integral = oracle.at("sum_value_times_volume_in_finest_cells").get<double>();
  EXPECT_NEAR(s.volume_integral, integral, 1e-12 * std::abs(integral));
}

INSTANTIATE_TEST_SUITE_P(Sets, ExaBrickOracle,
                         ::testing::Values(ExaOracle{"amrex_tiny/exabrick/phi.cells", "amrex_tiny/exabrick/oracle.json"},
                                           ExaOracle{"amrex_tiny/exabrick/phi.bricks", "amrex_tiny/exabrick/oracle.json"},
                                           ExaOracle{"flash_sedov/exabrick/dens.cells", "flash_sedov/exabrick/oracle.json"},
                                           ExaOracle{"flash_sedov/exabrick/dens.bricks", "flash_sedov/exabrick/oracle.json"},
                                           ExaOracle{"gerris_sphere/exabrick/U.cells", "gerris_sphere/exabrick/oracle.json"},
                                           ExaOracle{"gerris_sphere/exabrick/U.bricks", "gerris_sphere/exabrick/oracle.json"},
                                           ExaOracle{"p4est_step3/p8est_step3_0024.cells", "p4est_step3/oracle.json"},
                                           ExaOracle{"p4est_step3/p8est_step3_0024.bricks", "p4est_step3/oracle.json"}));

TEST_F(ExaBrick, OneMeshInTwoFormatsHasOneHash) {
  AMRTEX_NEEDS(kSharedData, "amrex_tiny/exabrick/phi.cells");
  EXPECT_EQ(hash(kSharedData / "amrex_tiny/exabrick/phi.cells"), hash(fs::path(AMRTEX_SOURCE_DIR) / "data/amrex_tiny/plt00008"));
}

// ---- boxes ----

TEST(CellBoxes, HoldEachCellOnce) {
  std::mt19937 random(3);
  for (int turn = 0; turn < 50; ++turn) {
    std::vector<Vec3i> cells;
    for_each_cell({Vec3i(-2), Vec3i(4)}, [&](const Vec3i& c) {
      if (random() % 4 != 0) cells.push_back(c);
    });
    std::vector<Vec3i> seen;
    for (const Box& box : boxes_of_cells(cells)) for_each_cell(box, [&](const Vec3i& c) { seen.push_back(c); });
    std::sort(seen.begin(), seen.end(), array_order);
    EXPECT_EQ(seen, cells);
  }
}

TEST(CellBoxes, OfABoxAreOne) {
  std::vector<Vec3i> cells;
  for_each_cell({{1, 2, 3}, {5, 9, 4}}, [&](const Vec3i& c) { cells.push_back(c); });
  EXPECT_THAT(boxes_of_cells(cells), ElementsAre(Box{{1, 2, 3}, {5, 9, 4}}));
  EXPECT_TRUE(boxes_of_cells({}).empty());
}

TEST(CellBoxes, PartsAreNoWiderThanIsAsked) {
  const std::array<Box, 2> boxes{Box{{1, 2, 3}, {131, 66, 5}}, Box{{-9, 0, 0}, {-8, 1, 1}}};
  EXPECT_THAT(parts_of(boxes, 64), ElementsAre(Box{{1, 2, 3}, {65, 66, 5}}, Box{{65, 2, 3}, {129, 66, 5}},
                                               Box{{129, 2, 3}, {131, 66, 5}}, Box{{-9, 0, 0}, {-8, 1, 1}}));
}

TEST(CellBoxes, OfRunsAreThoseOfTheirCells) {
  std::mt19937 random(4);
  for (int turn = 0; turn < 20; ++turn) {
    std::vector<Vec3i> cells;
    std::vector<Box> runs;
    for_each_cell({Vec3i(0), Vec3i(9, 4, 4)}, [&](const Vec3i& c) {
      if (random() % 4 == 0) return;
      cells.push_back(c);
      if (!runs.empty() && runs.back().upper == c + Vec3i(0, 1, 1))
        ++runs.back().upper.x;
      else
        runs.push_back({c, c + Vec3i(1)});
    });
    std::shuffle(runs.begin(), runs.end(), random);
    EXPECT_EQ(boxes_of_runs(runs), boxes_of_cells(cells)) << "turn " << turn;
  }
}

// ---- against single cells ----

struct Leaf {
  Vec3i lower;  // finest cells of the file
  int level;
  float value;
};

/// Trees over root cells of level `top`, each cell split by 2^step or left out by chance.
std::vector<Leaf> random_leaves(std::mt19937& random, int top, int step) {
  constexpr std::size_t kMost = 5000;
  std::vector<Leaf> leaves;
  const auto split = 20 + random() % 50;  // percent
  const auto left_out = random() % 3 * 10;
  std::vector<Leaf> open;
  const Vec3i roots(1 + random() % 5, 1 + random() % 5, 1 + random() % 5);
  const Vec3i apart(8 << top, 0, 3 << top);
  for (const Vec3i& root : {Vec3i(-7), Vec3i(-7) + apart})  // two boxes
    for_each_cell({Vec3i(0), roots}, [&](const Vec3i& c) { open.push_back({root + c * (1 << top), top, 0}); });
  while (!open.empty()) {
    const Leaf cell = open.back();
    open.pop_back();
    if (cell.level >= step && leaves.size() + open.size() < kMost && random() % 100 < split)
      for_each_cell({Vec3i(0), Vec3i(1 << step)}, [&](const Vec3i& c) {
        open.push_back({cell.lower + c * (1 << (cell.level - step)), cell.level - step, 0});
      });
    else if (random() % 100 >= left_out || leaves.empty())
      leaves.push_back(cell);
  }
  std::shuffle(leaves.begin(), leaves.end(), random);
  for (std::size_t i = 0; i < leaves.size(); ++i) leaves[i].value = static_cast<float>(i);
  return leaves;
}

/// The mesh has these leaves and no others, with these values.
void expect_leaves(const AmrHierarchy& mesh, int field, const std::vector<Leaf>& leaves) {
  ASSERT_EQ(mesh.leaf_cells(), std::ssize(leaves));
  int finest = leaves.front().level;
  Vec3i lower = leaves.front().lower;
  for (const Leaf& leaf : leaves) {
    finest = std::min(finest, leaf.level);
    lower = glm::min(lower, leaf.lower);
  }
  EXPECT_LT(glm::length(mesh.domain_lower() - Vec3d(lower)), 2 * mesh.cell_width(0) << finest);
  int wrong = 0;
  for (const Leaf& leaf : leaves) {
    const auto found = mesh.find_leaf(Vec3i(Vec3d(leaf.lower) - mesh.domain_lower()) / (1 << finest));
    const bool same =
        found && mesh.cell_width(found->level) == 1 << (leaf.level - finest) && mesh.value(*found, field) == leaf.value;
    wrong += same ? 0 : 1;
  }
  EXPECT_EQ(wrong, 0);
}

/// Scalars in random order, bricks of rows of cells where the leaves have them.
void write_bricks(const fs::path& bricks, const fs::path& scalars, const std::vector<Leaf>& leaves, std::mt19937& random) {
  std::vector<std::int32_t> ids(leaves.size());
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<std::int32_t>(i);
  std::shuffle(ids.begin(), ids.end(), random);
  Scalars values(leaves.size());
  std::vector<std::size_t> order(leaves.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    order[i] = i;
    values[static_cast<std::size_t>(ids[i])] = leaves[i].value;
  }
  const auto key = [&](std::size_t i) {
    const Leaf& leaf = leaves[i];
    return std::tuple(leaf.level, leaf.lower.z, leaf.lower.y, leaf.lower.x);
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
  Cells words;
  for (std::size_t i = 0; i < order.size();) {
    const Leaf& first = leaves[order[i]];
    std::size_t end = i;
    for (; end < order.size(); ++end) {
      const Vec3i expected = first.lower + Vec3i(static_cast<int>(end - i) << first.level, 0, 0);
      if (leaves[order[end]].level != first.level || leaves[order[end]].lower != expected) break;
    }
    words.insert(words.end(), {static_cast<int>(end - i), 1, 1, first.lower.x, first.lower.y, first.lower.z, first.level});
    for (; i < end; ++i) words.push_back(ids[order[i]]);
  }
  write_bytes(bricks, {reinterpret_cast<const char*>(words.data()), words.size() * sizeof(std::int32_t)});
  write_bytes(scalars, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
}

TEST_F(ExaBrick, LeavesAndValuesAreThoseOfTheFile) {
  std::mt19937 random(5);
  for (int turn = 0; turn < 30; ++turn) {
    SCOPED_TRACE(turn);
    const int step = 1 + turn % 3;  // levels between are skipped: ratios of 2, 4 and 8
    const std::vector<Leaf> leaves = random_leaves(random, 2 * step + turn % 2, step);
    Cells cells;
    Scalars scalars;
    for (const Leaf& leaf : leaves) {
      cells.insert(cells.end(), {leaf.lower.x, leaf.lower.y, leaf.lower.z, leaf.level});
      scalars.push_back(leaf.value);
    }
    write_values("a.scalars", scalars);
    expect_leaves(AmrHierarchy(read_mesh(write_values("a.cells", cells))), 0, leaves);
    write_bricks(at("b.bricks"), at("b.scalars"), leaves, random);
    expect_leaves(AmrHierarchy(read_mesh(at("b.bricks"))), 0, leaves);
  }
}

/// A million cells: 96^3, and 64^3 of half their width in place of 32^3 at the lower corner.
template <class F>
void for_each_of_a_million(F&& f) {
  for_each_cell({Vec3i(0), Vec3i(64)}, [&](const Vec3i& c) { f(c, 0); });
  for_each_cell({Vec3i(0), Vec3i(96)}, [&](const Vec3i& c) {
    if (glm::any(glm::greaterThanEqual(c, Vec3i(32)))) f(2 * c, 1);
  });
}

TEST_F(ExaBrick, ManyCellsInRandomOrderFindTheirValues) {
  std::vector<Leaf> leaves;
  for_each_of_a_million([&](const Vec3i& c, int level) { leaves.push_back({c, level, static_cast<float>(leaves.size())}); });
  std::mt19937 random(6);
  write_bricks(at("b.u.bricks"), at("b.u.scalars"), leaves, random);
  fs::rename(at("b.u.bricks"), at("b.bricks"));
  fs::copy(at("b.u.scalars"), at("b.v.scalars"));
  const AmrHierarchy mesh(read_mesh(at("b.bricks")));
  ASSERT_EQ(mesh.fields(), (std::vector<std::string>{"u", "v"}));
  for (int field = 0; field < 2; ++field) expect_leaves(mesh, field, leaves);
}

TEST_F(ExaBrick, OneBrickMayBeLongerThanAnyChunk) {
  // a row of 200000 cells, whose scalars stand in reverse
  constexpr int kLength = 200000;
  Cells words = {kLength, 1, 1, 3, 0, 0, 0};
  for (int i = kLength; i-- > 0;) words.push_back(i);
  write_values("b.scalars", counted(kLength));
  const AmrHierarchy mesh(read_mesh(write_values("b.bricks", words)));
  ASSERT_EQ(mesh.leaf_cells(), kLength);
  for (int i = 0; i < kLength; i += 101) EXPECT_EQ(mesh.value(*mesh.find_leaf({i, 0, 0}), 0), kLength - 1 - i);
}

TEST_F(ExaBrick, TheFirstOfSeveralFaultsIsNamed) {
  // far more cells than are read at once, of which two have no level, and two places are taken twice
  Cells cells;
  for (int i = 0; i < 300000; ++i) cells.insert(cells.end(), {i, 0, 0, 0});
  const auto level_of = [&](std::size_t cell) -> std::int32_t& { return cells[4 * cell + 3]; };
  cells[4 * 299999] = 7;
  cells[4 * 250000] = 7;
  cells[4 * 70001] = 70000;
  EXPECT_THAT(refusal(cells), HasSubstr("cells 7 and 250000 overlap"));
  level_of(280000) = level_of(140000) = 31;
  EXPECT_THAT(refusal(cells), HasSubstr("cell 140000 has level 31"));
}

TEST_F(ExaBrick, CellsAreNotHeld) {
  std::size_t count = 0;
  {
    std::ofstream cells(at("m.cells"), std::ios::binary);
    std::ofstream scalars(at("m.scalars"), std::ios::binary);
    for_each_of_a_million([&](const Vec3i& c, int level) {
      const std::array<std::int32_t, 4> cell{c.x, c.y, c.z, level};
      const float value = static_cast<float>(++count);
      cells.write(reinterpret_cast<const char*>(&cell), sizeof cell);
      scalars.write(reinterpret_cast<const char*>(&value), sizeof value);
    });
  }
  const std::int64_t before = peak_bytes();
  const MeshDescription mesh = read_mesh(at("m.cells"));
  // the file has 16 bytes a cell, the mesh 4; each of the 17 chunks of 64 Ki cells may be in the hands of a thread
  EXPECT_LE(peak_bytes() - before, 32 * static_cast<std::int64_t>(count));
  ASSERT_EQ(mesh.levels.size(), 2U);
  // leaf masks and means are made a patch at a time
  for (const auto& level : mesh.levels)
    for (const Patch& patch : level) EXPECT_TRUE(glm::all(glm::lessThanEqual(patch.box.size(), Vec3i(kWidestPatch))));
}

// ---- bad input ----

TEST_F(ExaBrick, CellsThatAreNoneAreRefused) {
  EXPECT_THAT(refusal({0, 0, 0, -1}), AllOf(HasSubstr("bad.cells"), HasSubstr("cell 0 has level -1"), HasSubstr("0 to 30")));
  EXPECT_THAT(refusal({0, 0, 0, 0, 0, 0, 0, 31}), HasSubstr("cell 1 has level 31"));
  EXPECT_THAT(refusal({0, 0, 0, 1, 3, 0, 0, 1}),
              HasSubstr("cell 1 (3, 0, 0) of level 1 does not lie on a multiple of its width, 2"));
  EXPECT_THAT(refusal({0, 0, 0, 1, 2, 0, 0, 1, 0, 0, 0, 1}), AllOf(HasSubstr("cells 0 and 2 overlap")));
  EXPECT_THAT(refusal({0, 0, 0, 1, 1, 1, 0, 0}),
              AllOf(HasSubstr("1 cells overlap finer ones"), HasSubstr("2 finest cells wide")));
  EXPECT_THAT(refusal({0, 0, 0, 2, 1, 1, 0, 0, 8, 0, 0, 1}), HasSubstr("1 cells overlap finer ones")) << "two levels apart";
  EXPECT_THAT(refusal({2147483647, 0, 0, 0, -2147483647, 0, 0, 0}), HasSubstr("31 bits"));
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("bad.scalars"), HasSubstr("empty")));
}

TEST_F(ExaBrick, SizesThatDoNotFitAreRefused) {
  write_set("a", one_refined());
  const std::string cells = bytes_of_file(at("a.cells"));
  write("a.cells", cells.substr(0, 30));
  EXPECT_THAT(message_of([&] { read_mesh(at("a.cells")); }), AllOf(HasSubstr("a.cells: 30 bytes"), HasSubstr("16 bytes")));
  write("a.cells", cells.substr(0, 32));
  EXPECT_THAT(message_of([&] { read_mesh(at("a.cells")); }), HasSubstr("a.cells: 2 cells, but its scalars are 15 values"));
  write("a.cells", cells);
  write("a.scalars", "abcde");
  EXPECT_THAT(message_of([&] { read_mesh(at("a.cells")); }), AllOf(HasSubstr("a.scalars: 5 bytes"), HasSubstr("4 bytes")));
  fs::remove(at("a.scalars"));
  EXPECT_THAT(message_of([&] { read_mesh(at("a.cells")); }), HasSubstr("no file a.scalars beside it"));
  fs::remove(at("a.cells"));
  write_values("a.scalars", counted(15));
  EXPECT_THAT(message_of([&] { read_mesh(at("a.scalars")); }), HasSubstr("no file a.cells beside it"));
}

TEST_F(ExaBrick, UnknownFieldsAreNamed) {
  const fs::path file = write_set("density", one_refined());
  EXPECT_THAT(message_of([&] { read_mesh(file, {"densty"}); }), AllOf(HasSubstr("no field 'densty'"), HasSubstr("density")));
}

TEST_F(ExaBrick, BadBricksAreRefused) {
  write_values("b.scalars", counted(15));
  const auto refusal_of_bricks = [&](const Cells& words) {
    write_values("b.bricks", words);
    return message_of([&] { AmrHierarchy(read_mesh(at("b.bricks"))).content_hash(0); });
  };
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0, 0, 0, 0, 15}),
              AllOf(HasSubstr("b.bricks: brick 0"), HasSubstr("number is 15"), HasSubstr("15 values")));
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0, 0, 0, 0, -1}), HasSubstr("number is -1"));
  EXPECT_THAT(refusal_of_bricks({1, 0, 1, 0, 0, 0, 0}), HasSubstr("1 x 0 x 1"));
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0, 0, 0, 99, 1}), HasSubstr("level is 99"));
  EXPECT_THAT(refusal_of_bricks({2147483647, 2147483647, 2147483647, 0, 0, 0, 0, 1}),
              HasSubstr("need as many numbers, 1 are left"));
  EXPECT_THAT(refusal_of_bricks({1, 1, 2, 0, 0, 2147483647, 0, 1, 2}), HasSubstr("31 bits"));
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0}), HasSubstr("its head needs 28 bytes, 16 are left"));
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0, 0, 0, 0, 1}),
              HasSubstr("b.bricks: its bricks hold 1 cells, but its scalars are 15 values"));
  write_values("b.scalars", counted(2));
  EXPECT_THAT(refusal_of_bricks({1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 0}), HasSubstr("overlap"));
}

TEST_F(ExaBrick, BadExaFilesAreRefused) {
  write_set("a", one_refined());
  const auto refusal_of_exa = [&](const std::string& text) {
    write("x.exa", text);
    return message_of([&] { read_mesh(at("x.exa")); });
  };
  EXPECT_THAT(refusal_of_exa("scalar a a.scalars\n"), HasSubstr("names no `bricks`"));
  EXPECT_THAT(refusal_of_exa("cells a.cells\n"), HasSubstr("names no `scalar`"));
  EXPECT_THAT(refusal_of_exa("cells a.cells\nscalar a\n"),
              AllOf(HasSubstr("line 2"), HasSubstr("'scalar' takes 2 words, 1 given")));
  EXPECT_THAT(refusal_of_exa("skalar a a.scalars\n"), AllOf(HasSubstr("line 1"), HasSubstr("'skalar' is no key")));
  EXPECT_THAT(refusal_of_exa("cells a.cells\nscalar a a.scalars\nremap_from 0 0 0 1 1 x\n"), HasSubstr("found 'x'"));
  EXPECT_THAT(refusal_of_exa("cells a.cells\nscalar a a.scalars\nremap_from 0 0 0 1 1 1\n"), HasSubstr("go together"));
  EXPECT_THAT(refusal_of_exa("cells a.cells\nscalar a a.scalars\nremap_from 0 0 0 1 1 1\nremap_to 0 0 0 0 1 1\n"),
              HasSubstr("upper corners"));
  EXPECT_THAT(refusal_of_exa("cells none.cells\nscalar a a.scalars\n"), HasSubstr("none.cells: no such file"));
}

TEST_F(ExaBrick, CutFilesAreRefused) {
  write_set("a", one_refined());
  write_values("a.bricks", bricks_of_one_refined());
  for (const char* name : {"a.cells", "a.bricks", "a.scalars"}) {
    const std::string bytes = bytes_of_file(at(name));
    const fs::path named = at(name == std::string("a.scalars") ? "a.cells" : name);
    for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
      write(name, std::string_view(bytes).substr(0, cut));
      EXPECT_THAT(message_of([&] { read_mesh(named); }), HasSubstr(folder_.string())) << name << " cut to " << cut;
    }
    write(name, bytes);
  }
}

TEST_F(ExaBrick, SparseFilesCostNothing) {
  write("big.cells", "");
  write("big.scalars", "");
  fs::resize_file(at("big.cells"), std::uintmax_t{16} << 32);
  fs::resize_file(at("big.scalars"), std::uintmax_t{4} << 32);
  EXPECT_THAT(message_of([&] { read_mesh(at("big.cells")); }), HasSubstr("big.cells"));
  EXPECT_LT(peak_bytes(), std::int64_t{4} << 30);
}

// ---- writing ----

TEST_F(ExaBrick, ReadsBackWhatItWrites) {
  RandomMeshOptions options;
  options.power_of_two_ratios = true;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const AmrHierarchy mesh(random_mesh(seed, options));
    write_exabrick(mesh, at(std::to_string(seed) + ".cells"));
    const AmrHierarchy back(read_mesh(at(std::to_string(seed) + ".cells")));
    EXPECT_EQ(back.content_hash(0), mesh.content_hash(0)) << "seed " << seed;
    EXPECT_EQ(back.leaf_cells(), mesh.leaf_cells()) << "seed " << seed;
  }
}

TEST_F(ExaBrick, SeveralFieldsAreSeveralFilesOfScalars) {
  const AmrHierarchy mesh = fields_with_gaps().hierarchy();
  write_exabrick(mesh, at("m.cells"));
  EXPECT_THAT(names(), ElementsAre("m.cells", "m.f.scalars", "m.g.scalars"));
  const AmrHierarchy back(read_mesh(at("m.cells")));
  EXPECT_EQ(back.fields(), mesh.fields());
  for (int field = 0; field < 2; ++field) EXPECT_EQ(back.content_hash(field), mesh.content_hash(field));
}

TEST_F(ExaBrick, WhatItCannotHoldIsRefusedAndLeavesNothing) {
  EXPECT_THAT(message_of([&] {
                write_exabrick(nested(waves, {3, 2}).hierarchy(), at("m.cells"));
              }),
              AllOf(HasSubstr("m.cells"), HasSubstr("6 of the finest wide"), HasSubstr("2^n")));
  const AmrHierarchy large = MeshBuilder(Vec3i(2)).root(constant(1e300)).hierarchy();
  EXPECT_THAT(message_of([&] { write_exabrick(large, at("m.cells")); }), AllOf(HasSubstr("1e+300"), HasSubstr("32 bits")));
  EXPECT_TRUE(names().empty());
  write("m.scalars", "taken");
  EXPECT_THAT(message_of([&] { write_exabrick(nested(waves).hierarchy(), at("m.cells")); }),
              HasSubstr("m.scalars: exists already"));
  EXPECT_THAT(names(), ElementsAre("m.scalars"));
}

}  // namespace
}  // namespace amrtex
