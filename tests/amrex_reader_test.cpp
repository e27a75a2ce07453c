// The AMReX reader and writer: real data against oracles made by yt, hand-written
// plotfiles for every variant of the format, and bad input of every kind.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "structures/readers/amrex_plotfile/amrex_fab.hpp"
#include "structures/readers/amrex_plotfile/amrex_plotfile.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"
#include "tests/reader_files.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using test::message_of;

// ---- helpers ----

/// A folder of this test alone that is removed at its end.
class AmrexReader : public ::testing::Test {
 protected:
  AmrexReader() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("amrtex_reader_{}_{}", info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~AmrexReader() override { fs::remove_all(folder_); }
  fs::path folder_;
};

std::string read_text(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
}

/// Replaces the first occurrence; the test is wrong where there is none.
void edit(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = read_text(path);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << path << " does not hold '" << from << "'";
  write_text(path, text.replace(at, from.size(), to));
}

struct LevelSpec {
  Box domain;              ///< as in the file: any origin
  std::vector<Box> boxes;  ///< as in the file
};

/// What a hand-written plotfile looks like.
struct Spec {
  std::string version = "HyperCLaw-V1.1";
  std::vector<std::string> fields = {"phi"};
  std::vector<LevelSpec> levels;
  int cell_version = 1;
  Vec3i ghosts{0};
  bool ghosts_as_tuple = false;
  RealFormat format;
};

/// Two levels: 4 x 4 x 4 cells in two patches, the middle refined.
Spec two_levels(int ratio = 2, const Vec3i& corner = Vec3i(0)) {
  Spec spec;
  const Box root{corner, corner + Vec3i(4)};
  const Box left{corner, corner + Vec3i(2, 4, 4)};
  const Box right{corner + Vec3i(2, 0, 0), corner + Vec3i(4)};
  spec.levels.push_back({root, {left, right}});
  spec.levels.push_back({root.refined(ratio), {Box{corner + Vec3i(1), corner + Vec3i(3)}.refined(ratio)}});
  return spec;
}

/// Value of a cell, exact in float; `cell` counts from the domain's corner.
double value_at(std::size_t level, std::size_t field, const Vec3i& cell) {
  return 100000.0 * static_cast<double>(field) + 10000.0 * static_cast<double>(level) + cell.x + 16 * cell.y + 256 * cell.z + 0.5;
}
constexpr double kGhostValue = -999;

std::string box_text(const Box& b) {
  const Vec3i upper = b.upper - Vec3i(1);
  return fmt::format("(({},{},{}) ({},{},{}) (0,0,0))", b.lower.x, b.lower.y, b.lower.z, upper.x, upper.y, upper.z);
}

std::string descriptor(const RealFormat& format) {
  const bool little = format.order == std::endian::little;
  if (format.bytes == 4) return fmt::format("((8, (32 8 23 0 1 9 0 127)),(4, ({})))", little ? "4 3 2 1" : "1 2 3 4");
  return fmt::format("((8, (64 11 52 0 1 12 0 1023)),(8, ({})))", little ? "8 7 6 5 4 3 2 1" : "1 2 3 4 5 6 7 8");
}

std::string encoded(double value, const RealFormat& format) {
  std::string bytes(static_cast<std::size_t>(format.bytes), '\0');
  const auto single = static_cast<float>(value);
  std::memcpy(bytes.data(), format.bytes == 8 ? static_cast<const void*>(&value) : &single, bytes.size());
  if (format.order != std::endian::native) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

std::string fab_text(const Spec& spec, std::size_t level, const Box& box) {
  const Box stored{box.lower - spec.ghosts, box.upper + spec.ghosts};
  std::string fab;
  if (spec.cell_version == 1) fab = fmt::format("FAB {}{} {}\n", descriptor(spec.format), box_text(stored), spec.fields.size());
  for (std::size_t field = 0; field < spec.fields.size(); ++field)
    for_each_cell(stored, [&](const Vec3i& cell) {
      const double value = box.contains(cell) ? value_at(level, field, cell - spec.levels[level].domain.lower) : kGhostValue;
      fab += encoded(value, spec.format);
    });
  return fab;
}

std::string range_tables(const Spec& spec, std::size_t patches) {
  std::string row;
  for (std::size_t i = 0; i < spec.fields.size(); ++i) row += "-1.5e+00,";
  row += "\n";
  if (spec.cell_version == 2) return "";
  if (spec.cell_version == 4) return row + row;
  std::string table = fmt::format("{},{}\n", patches, patches > 0 ? spec.fields.size() : 0);
  for (std::size_t i = 0; i < patches; ++i) table += row;
  return table + "\n" + table + "\n";
}

void write_level(const fs::path& folder, const Spec& spec, std::size_t level) {
  const auto& boxes = spec.levels[level].boxes;
  std::string data;
  std::string positions;
  for (const Box& box : boxes) {
    positions += fmt::format("FabOnDisk: Cell_D_00000 {}\n", data.size());
    data += fab_text(spec, level, box);
  }
  const std::string ghosts = spec.ghosts_as_tuple ? fmt::format("({},{},{})", spec.ghosts.x, spec.ghosts.y, spec.ghosts.z)
                                                  : fmt::format("{}", spec.ghosts.x);
  std::string cells = fmt::format("{}\n1\n{}\n{}\n({} 0\n", spec.cell_version, spec.fields.size(), ghosts, boxes.size());
  for (const Box& box : boxes) cells += box_text(box) + "\n";
  cells += fmt::format(")\n{}\n{}\n{}", boxes.size(), positions, range_tables(spec, boxes.size()));
  if (spec.cell_version > 1) cells += descriptor(spec.format) + "\n";
  const fs::path level_folder = folder / fmt::format("Level_{}", level);
  fs::create_directories(level_folder);
  write_text(level_folder / "Cell_H", cells);
  write_text(level_folder / "Cell_D_00000", data);
}

/// Physical bounds are written as zeros on purpose: boxes must come from `Cell_H`.
fs::path write_plotfile(const fs::path& folder, const Spec& spec) {
  const std::size_t levels = spec.levels.size();
  std::string header = fmt::format("{}\n{}\n{}\n3\n0.25\n{}\n-1 0 0.5 \n1 2 2.5 \n", spec.version, spec.fields.size(),
                                   fmt::join(spec.fields, "\n"), levels - 1);
  for (std::size_t l = 1; l < levels; ++l)
    header += fmt::format("{} ", spec.levels[l].domain.size().x / spec.levels[l - 1].domain.size().x);
  header += "\n";
  for (const LevelSpec& level : spec.levels) header += box_text(level.domain) + " ";
  header += "\n";
  for (std::size_t l = 0; l < levels; ++l) header += "7 ";
  header += "\n";
  for (const LevelSpec& level : spec.levels) {
    const Vec3d h = Vec3d(2) / Vec3d(level.domain.size());
    header += fmt::format("{} {} {} \n", h.x, h.y, h.z);
  }
  header += "0\n0\n";
  for (std::size_t l = 0; l < levels; ++l) {
    header += fmt::format("{} {} 0.25\n7\n", l, spec.levels[l].boxes.size());
    for (std::size_t i = 0; i < 3 * spec.levels[l].boxes.size(); ++i) header += "0 0\n";
    header += fmt::format("Level_{}/Cell\n", l);
  }
  fs::create_directories(folder);
  write_text(folder / "Header", header);
  for (std::size_t l = 0; l < levels; ++l) write_level(folder, spec, l);
  return folder;
}

/// The mesh read must be the mesh written, value for value, with every domain's corner at 0.
void expect_spec(const MeshDescription& mesh, const Spec& spec, const std::vector<std::size_t>& fields) {
  ASSERT_EQ(mesh.levels.size(), spec.levels.size());
  ASSERT_EQ(mesh.fields.size(), fields.size());
  EXPECT_EQ(mesh.root_cells, spec.levels[0].domain.size());
  EXPECT_EQ(mesh.domain_lower, Vec3d(-1, 0, 0.5));
  EXPECT_EQ(mesh.domain_upper, Vec3d(1, 2, 2.5));
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    ASSERT_EQ(mesh.levels[l].size(), spec.levels[l].boxes.size());
    for (std::size_t k = 0; k < mesh.levels[l].size(); ++k) {
      const Patch& patch = mesh.levels[l][k];
      ASSERT_EQ(patch.box, spec.levels[l].boxes[k].shifted(-spec.levels[l].domain.lower));
      for (std::size_t f = 0; f < fields.size(); ++f) {
        EXPECT_EQ(mesh.fields[f], spec.fields[fields[f]]);
        ASSERT_EQ(static_cast<std::int64_t>(patch.values[f].size()), patch.box.cells());
        ASSERT_EQ(bytes_of(patch.values[f].type()), static_cast<std::size_t>(spec.format.bytes)) << "the type of the file";
        for_each_cell(patch.box, [&](const Vec3i& cell) {
          ASSERT_EQ(patch.values[f][patch.box.offset(cell)], value_at(l, fields[f], cell)) << "level " << l << ", patch " << k;
        });
      }
    }
  }
}

void expect_round(const fs::path& folder, const Spec& spec) {
  std::vector<std::size_t> all(spec.fields.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  const MeshDescription mesh = read_mesh(write_plotfile(folder, spec));
  expect_spec(mesh, spec, all);
  EXPECT_NO_THROW(AmrHierarchy(mesh).content_hash(0));
}

// ---- real data against yt ----

struct OracleCase {
  const char* data;  ///< plotfile, below the data folder
  const char* oracle;
};
void PrintTo(const OracleCase& c, std::ostream* out) { *out << c.data; }

const Json& only_field(const Json& oracle) {
  EXPECT_EQ(oracle.at("fields").size(), 1U);
  return oracle.at("fields").begin().value();
}

void expect_levels(const AmrHierarchy& mesh, const Json& oracle) {
  const Json& levels = oracle.at("levels");
  ASSERT_EQ(static_cast<std::size_t>(mesh.level_count()), levels.size());
  for (int l = 0; l < mesh.level_count(); ++l) {
    const Json& level = levels[static_cast<std::size_t>(l)];
    EXPECT_EQ(mesh.patches(l).size(), level.at("grids").get<std::size_t>()) << "level " << l;
    EXPECT_EQ(mesh.stored_cells(l), level.at("cells").get<std::int64_t>()) << "level " << l;
    EXPECT_EQ(mesh.leaf_cells(l), level.at("leaf_cells").get<std::int64_t>()) << "level " << l;
    if (l > 0) {
      EXPECT_EQ(mesh.ratio_to_finer(l - 1), oracle.at("ref_factors")[static_cast<std::size_t>(l - 1)].get<int>());
    }
  }
  EXPECT_EQ(mesh.leaf_cells(), oracle.at("total_leaf_cells").get<std::int64_t>());
  EXPECT_FALSE(mesh.has_holes());
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    EXPECT_EQ(mesh.domain_lower()[axis], oracle.at("domain_left_edge")[i].get<double>());
    EXPECT_EQ(mesh.domain_upper()[axis], oracle.at("domain_right_edge")[i].get<double>());
    EXPECT_EQ(mesh.cells(0)[axis], oracle.at("domain_dimensions_level0")[i].get<int>());
  }
}

void expect_statistics(const AmrHierarchy& mesh, const Json& field) {
  const FieldStatistics& s = mesh.statistics(0);
  EXPECT_EQ(s.min, field.at("min").get<double>());
  EXPECT_EQ(s.max, field.at("max").get<double>());
  const double integral = field.at("sum_value_times_volume_code").get<double>();
  EXPECT_NEAR(s.volume_integral, integral, 1e-12 * std::abs(integral));
  EXPECT_EQ(s.cells_without_value, field.at("nan").get<std::int64_t>());
}

void expect_points(const AmrHierarchy& mesh, const Json& samples) {
  EXPECT_GT(samples.size(), 0U);
  for (const Json& sample : samples) {
    const auto p = sample.at("p").get<std::vector<double>>();
    const Vec3d index = (Vec3d(p[0], p[1], p[2]) - mesh.domain_lower()) / mesh.spacing(mesh.finest_level());
    const auto leaf = mesh.find_leaf(Vec3i(glm::floor(index)));
    ASSERT_TRUE(leaf.has_value()) << sample.dump();
    EXPECT_EQ(leaf->level, sample.at("level").get<int>()) << sample.dump();
    EXPECT_EQ(mesh.value(*leaf, 0), sample.at("value").get<double>()) << sample.dump();
  }
}

void expect_oracle(const fs::path& data, const fs::path& oracle_path) {
  const Json oracle = Json::parse(read_text(oracle_path));
  const AmrHierarchy mesh(read_mesh(data, {"phi"}));
  expect_levels(mesh, oracle);
  expect_statistics(mesh, only_field(oracle));
  expect_points(mesh, oracle.at("point_samples").at("samples"));
}

TEST(AmrexSample, AgreesWithItsOracle) {
  const fs::path data = fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny";
  expect_oracle(data / "plt00008", data / "oracle.json");
}

TEST(AmrexSample, IsNamedByItsLastTwoFolders) {
  const fs::path data = fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny" / "plt00008";
  EXPECT_EQ(read_mesh(data).name, "amrex_tiny/plt00008");
  EXPECT_EQ(read_mesh(data / "").name, "amrex_tiny/plt00008");
  EXPECT_EQ(dataset_name("plt00008"), "plt00008");
  EXPECT_EQ(dataset_name("./plt00008/"), "plt00008");
  EXPECT_EQ(dataset_name("../plt00008"), "plt00008");
  EXPECT_EQ(dataset_name("/plt00008"), "plt00008");
}

class AmrexOracle : public ::testing::TestWithParam<OracleCase> {};

TEST_P(AmrexOracle, Agrees) {
  AMRTEX_NEEDS(test::kSharedData, GetParam().data);
  AMRTEX_NEEDS(test::kSharedData, GetParam().oracle);
  expect_oracle(test::kSharedData / GetParam().data, test::kSharedData / GetParam().oracle);
}

INSTANTIATE_TEST_SUITE_P(Sets, AmrexOracle,
                         ::testing::Values(OracleCase{"amrex_tiny/plt00008", "amrex_tiny/oracle.json"},
                                           OracleCase{"amrex_tiny_be32/plt00008", "amrex_tiny_be32/oracle.json"},
                                           OracleCase{"amrex_tiny_multifile/plt00008", "amrex_tiny_multifile/oracle.json"},
                                           OracleCase{"amrex_small/plt00020", "amrex_small/oracle.json"},
                                           OracleCase{"amrex_ratio4/plt00016", "amrex_ratio4/oracle.json"},
                                           OracleCase{"amrex_deep/plt00000", "amrex_deep/oracle.json"},
                                           OracleCase{"amrex_hdf5/plt00012", "amrex_hdf5/oracle_plt00012.json"}));

TEST(AmrexSample, OneRunInOneAndInSeveralFilesIsOneMesh) {
  AMRTEX_NEEDS(test::kSharedData, "amrex_tiny_multifile/plt00008");
  const fs::path several = test::kSharedData / "amrex_tiny_multifile/plt00008";
  const fs::path one = fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny" / "plt00008";
  EXPECT_EQ(AmrHierarchy(read_mesh(several)).content_hash(0), AmrHierarchy(read_mesh(one)).content_hash(0));
}

// ---- variants of the format, written by hand ----

TEST_F(AmrexReader, ReadsEveryCellHeaderVersionAndNumberFormat) {
  for (int version = 1; version <= 4; ++version)
    for (const RealFormat format : {RealFormat{8, std::endian::little}, RealFormat{8, std::endian::big},
                                    RealFormat{4, std::endian::little}, RealFormat{4, std::endian::big}}) {
      Spec spec = two_levels();
      spec.cell_version = version;
      spec.format = format;
      SCOPED_TRACE(fmt::format("Cell_H version {}, {}", version, descriptor(format)));
      expect_round(folder_ / "plt", spec);
    }
}

TEST_F(AmrexReader, StripsGhostCells) {
  for (int version = 1; version <= 4; ++version)
    for (const bool tuple : {false, true}) {
      Spec spec = two_levels();
      spec.fields = {"a", "b"};
      spec.cell_version = version;
      spec.ghosts = tuple ? Vec3i(1, 2, 3) : Vec3i(2);
      spec.ghosts_as_tuple = tuple;
      SCOPED_TRACE(fmt::format("Cell_H version {}, tuple {}", version, tuple));
      expect_round(folder_ / "plt", spec);
    }
}

TEST_F(AmrexReader, MovesTheDomainsCornerToZero) {
  expect_round(folder_ / "positive", two_levels(2, Vec3i(8, 16, 4)));
  expect_round(folder_ / "negative", two_levels(2, Vec3i(-5, -4, 3)));
}

TEST_F(AmrexReader, ReadsOnlyTheFieldAskedFor) {
  Spec spec = two_levels();
  spec.fields = {"density", "velocity in x", "Y(O2)"};
  expect_round(folder_ / "plt", spec);
  expect_spec(read_mesh(folder_ / "plt", {"velocity in x"}), spec, {1});
  expect_spec(read_mesh(folder_ / "plt", {"Y(O2)"}), spec, {2});
}

TEST_F(AmrexReader, ReadsTheFirstLineOfOlderCodes) {
  Spec spec = two_levels();
  const std::string hash = AmrHierarchy(read_mesh(write_plotfile(folder_ / "new", spec))).content_hash(0);
  spec.version = "NavierStokes-V1.1";
  EXPECT_EQ(AmrHierarchy(read_mesh(write_plotfile(folder_ / "old", spec))).content_hash(0), hash);
}

TEST_F(AmrexReader, TakesCellSizesOfFewDigits) {
  Spec spec = two_levels(3);
  write_plotfile(folder_ / "plt", spec);
  edit(folder_ / "plt" / "Header", "0.16666666666666666", "0.16667");
  EXPECT_NO_THROW(read_mesh(folder_ / "plt"));
}

TEST_F(AmrexReader, TakesRatiosFromTheDomains) {
  for (const auto& [first, second] : {std::pair{2, 4}, std::pair{4, 2}, std::pair{3, 2}}) {
    Spec spec = two_levels(first);
    const Box middle = Box{Vec3i(1), Vec3i(2)}.refined(first);
    spec.levels.push_back({spec.levels[1].domain.refined(second), {middle.refined(second)}});
    expect_round(folder_ / fmt::format("plt{}{}", first, second), spec);
    EXPECT_EQ(read_mesh(folder_ / fmt::format("plt{}{}", first, second)).ratios, (std::vector{first, second}));
  }
}

TEST_F(AmrexReader, ReadsOneLevelWithAnEmptyLineOfRatios) {
  Spec spec = two_levels();
  spec.levels.pop_back();
  expect_round(folder_ / "plt", spec);
}

TEST_F(AmrexReader, ReadsMoreRatiosThanLevels) {
  const Spec spec = two_levels();
  write_plotfile(folder_ / "plt", spec);
  edit(folder_ / "plt" / "Header", "2.5 \n2 \n", "2.5 \n2 2 4 \n");
  expect_spec(read_mesh(folder_ / "plt"), spec, {0});
}

TEST_F(AmrexReader, ReadsLevelsWithoutPatches) {
  Spec spec = two_levels();
  spec.levels.push_back({spec.levels[1].domain.refined(2), {}});
  for (int version = 1; version <= 4; ++version) {
    spec.cell_version = version;
    SCOPED_TRACE(version);
    expect_round(folder_ / "plt", spec);
  }
}

TEST_F(AmrexReader, ReadsCartGridAndIgnoresParticles) {
  Spec spec = two_levels();
  spec.version = "CartGrid-V2.0";
  fs::create_directories(folder_ / "plt" / "particles" / "Level_0");
  write_text(folder_ / "plt" / "particles" / "Header", "nonsense");
  expect_round(folder_ / "plt", spec);
}

// ---- sizes beyond 2^31 ----

TEST(AmrexFab, PlacesComponentsInSixtyFourBits) {
  const auto range = fab_component_range(100, Vec3l(2048), 5, 3, 8);
  ASSERT_TRUE(range.has_value());
  const std::uint64_t bytes = std::uint64_t{8} << 33;
  EXPECT_EQ(range->bytes, bytes);
  EXPECT_EQ(range->begin, 100 + 3 * bytes);
  EXPECT_EQ(range->fab_end, 100 + 5 * bytes);
  const auto just_over = fab_component_range(0, Vec3l(1024, 1024, 257), 1, 0, 8);
  ASSERT_TRUE(just_over.has_value());
  EXPECT_EQ(just_over->bytes, 2155872256U);
}

TEST(AmrexFab, RefusesSizesThatNoFileHas) {
  const std::int64_t widest = std::int64_t{1} << 31;
  EXPECT_FALSE(fab_component_range(0, Vec3l(widest), 1, 0, 8).has_value());
  EXPECT_FALSE(fab_component_range(0, Vec3l(widest, widest, 1), 2, 0, 8).has_value());
  EXPECT_FALSE(fab_component_range(std::uint64_t{1} << 62, Vec3l(widest, widest / 8, 1), 2, 0, 8).has_value());
  EXPECT_TRUE(fab_component_range(0, Vec3l(widest, widest / 16, 1), 1, 0, 8).has_value());
}

TEST_F(AmrexReader, ReadsPatchesBehindTwoGibibytes) {
  const Spec spec = two_levels();
  const fs::path level = write_plotfile(folder_ / "plt", spec) / "Level_1";
  const std::string data = read_text(level / "Cell_D_00000");
  const std::int64_t offset = (std::int64_t{5} << 30) + 3;
  std::error_code failure;
  fs::resize_file(level / "Cell_D_00000", static_cast<std::uintmax_t>(offset), failure);
  if (failure) GTEST_SKIP() << "no sparse file of 5 GiB can be made here: " << failure.message();
  std::ofstream(level / "Cell_D_00000", std::ios::binary | std::ios::app) << data;
  edit(level / "Cell_H", "Cell_D_00000 0", fmt::format("Cell_D_00000 {}", offset));
  expect_spec(read_mesh(folder_ / "plt"), spec, {0});
}

TEST_F(AmrexReader, RefusesMoreValuesThanTheMachineHolds) {
  Spec spec;
  spec.cell_version = 2;
  spec.levels.push_back({Box{Vec3i(0), Vec3i(1)}, {Box{Vec3i(0), Vec3i(1)}}});
  write_plotfile(folder_ / "plt", spec);
  const std::string small = "(0,0,0) (0,0,0)";
  edit(folder_ / "plt" / "Header", small, "(0,0,0) (8191,8191,8191)");
  edit(folder_ / "plt" / "Header", "\n2 2 2 \n", "\n0.000244140625 0.000244140625 0.000244140625 \n");
  edit(folder_ / "plt" / "Level_0" / "Cell_H", small, "(0,0,0) (8191,8191,8191)");
  std::error_code failure;
  fs::resize_file(folder_ / "plt" / "Level_0" / "Cell_D_00000", std::uintmax_t{8} << 39, failure);
  if (failure) GTEST_SKIP() << "no sparse file of 4 TiB can be made here: " << failure.message();
  const std::string message = message_of<BudgetError>([&] { read_mesh(folder_ / "plt"); });
  EXPECT_NE(message.find("4.398e+12 bytes"), std::string::npos) << message;
}

// ---- bad input ----

struct BadCase {
  const char* name;
  std::function<void(const fs::path&)> damage;
  std::vector<std::string> message;  ///< parts that the Error must have
};

std::function<void(const fs::path&)> edits(std::string file, std::string from, std::string to) {
  return [=](const fs::path& plt) { edit(plt / file, from, to); };
}
std::function<void(const fs::path&)> removes(std::string file) {
  return [=](const fs::path& plt) { fs::remove_all(plt / file); };
}
std::function<void(const fs::path&)> truncates(std::string file, std::size_t bytes) {
  return [=](const fs::path& plt) { fs::resize_file(plt / file, bytes); };
}

std::vector<BadCase> bad_cases() {
  const std::string h = "Header";
  const std::string c = "Level_1/Cell_H";
  const std::string d = "Level_1/Cell_D_00000";
  const std::string fine = "((0,0,0) (7,7,7) (0,0,0))";
  const std::string box = "((2,2,2) (5,5,5) (0,0,0))";
  return {
      {"no Header", removes(h), {"plt/Header", "no such file"}},
      {"empty Header", truncates(h, 0), {"plt/Header, line 1", "HyperCLaw-V1.1", "CartGrid-V2.0"}},
      {"half a Header", truncates(h, 118), {"plt/Header, line", "the text ends here"}},
      {"no plotfile", edits(h, "HyperCLaw-V1.1", "something"), {"plt/Header, line 1", "not an AMReX plotfile", "'something'"}},
      {"checkpoint", edits(h, "HyperCLaw-V1.1", "CheckPointVersion_1.0"), {"plt/Header", "a checkpoint"}},
      {"a directory for Header",
       [](const fs::path& p) {
         fs::remove(p / "Header");
         fs::create_directory(p / "Header");
       },
       {"plt/Header", "not a regular file"}},
      {"no fields", edits(h, "1\nphi", "0"), {"plt/Header, line 2", "no fields"}},
      {"too many fields", edits(h, "1\nphi", "2000000000\nphi"), {"plt/Header, line 2", "2000000000 fields are announced"}},
      {"a field name too few",
       edits(h, "1\nphi", "2\nphi"),
       {"plt/Header, line 5", "the dimension behind the names of 2 fields"}},
      {"one dimension", edits(h, "phi\n3", "phi\n1"), {"plt/Header, line 4", "1-dimensional", "2 and 3 dimensions"}},
      {"too many levels", edits(h, "0.25\n1\n", "0.25\n64\n"), {"plt/Header, line 6", "from 0 to 63"}},
      {"upside-down domain", edits(h, "-1 0 0.5", "-1 3 0.5"), {"plt/Header, line 8", "upper corner"}},
      {"infinite domain", edits(h, "-1 0 0.5", "-inf 0 0.5"), {"plt/Header, line 7", "not finite"}},
      {"no ratio", edits(h, "2.5 \n2 \n", "2.5 \n\n"), {"plt/Header", "0 refinement ratios for 2 levels"}},
      {"ratio of 1", edits(h, fine, "((0,0,0) (3,3,3) (0,0,0))"), {"plt/Header, line 10", "ratio is 1", "at least 2"}},
      {"ratio stated wrongly", edits(h, "2.5 \n2 \n", "2.5 \n4 \n"), {"plt/Header, line 10", "stated as 4", "make it 2"}},
      {"anisotropic ratio",
       edits(h, fine, "((0,0,0) (7,7,3) (0,0,0))"),
       {"plt/Header, line 10", "differs between the axes", "(2,2,1)"}},
      {"broken ratio", edits(h, fine, "((0,0,0) (6,7,7) (0,0,0))"), {"plt/Header, line 10", "no whole refinement ratio"}},
      {"domain moved", edits(h, fine, "((1,0,0) (8,7,7) (0,0,0))"), {"plt/Header, line 10", "no whole refinement ratio"}},
      {"empty domain", edits(h, fine, "((0,0,0) (-1,7,7) (0,0,0))"), {"plt/Header, line 10", "is empty"}},
      {"huge domain",
       edits(h, fine, "((-2147483648,0,0) (2147483647,7,7) (0,0,0))"),
       {"plt/Header, line 10", "wider than 2147483647"}},
      {"nodal domain", edits(h, fine, "((0,0,0) (7,7,7) (1,1,1))"), {"plt/Header, line 10", "cell-centred"}},
      {"cell sizes of another domain",
       edits(h, "0.25 0.25 0.25", "0.25 0.26 0.25"),
       {"plt/Header, line 13", "cells of level 1 are said to be 0.26 wide along y", "its 8 cells make them 0.25"}},
      {"cell sizes that are no numbers", edits(h, "0.25 0.25 0.25", "0.25 nan 0.25"), {"plt/Header, line 13", "nan wide"}},
      {"a name that is not UTF-8",
       edits(h, "phi", "p\xffi"),
       {"plt/Header, line 3", "the name of field 1 of 1, 'p\\xffi', is not UTF-8"}},
      {"a first line of escapes", edits(h, "HyperCLaw-V1.1", "\x1b[31m"), {"plt/Header, line 1", "'\\x1b[31m'"}},
      {"cylindrical", edits(h, "\n0\n0\n0 2", "\n1\n0\n0 2"), {"plt/Header, line 14", "cylindrical", "only 0 (Cartesian)"}},
      {"spherical", edits(h, "\n0\n0\n0 2", "\n2\n0\n0 2"), {"plt/Header, line 14", "spherical"}},
      {"boundary regions", edits(h, "\n0\n0\n0 2", "\n0\n1\n0 2"), {"plt/Header, line 15", "boundary regions"}},
      {"wrong level number", edits(h, "1 1 0.25", "2 1 0.25"), {"plt/Header", "the number 1 of the level", "found '2'"}},
      {"too many grids", edits(h, "1 1 0.25", "1 1000000 0.25"), {"plt/Header", "1000000 grids are announced"}},
      {"a grid too many", edits(h, "0 2 0.25", "0 3 0.25"), {"plt/Header", "a bound of a grid", "found 'Level_0/Cell'"}},
      {"level path climbs",
       edits(h, "Level_1/Cell", "../Level_1/Cell"),
       {"plt/Header", "'../Level_1/Cell'", "no path below the plotfile"}},
      {"level path absolute", edits(h, "Level_1/Cell", "/etc/Cell"), {"plt/Header", "'/etc/Cell'", "no path below the plotfile"}},
      {"level path elsewhere", edits(h, "Level_1/Cell", "Level_9/Cell"), {"Level_9/Cell_H", "no such file"}},

      {"no Cell_H", removes(c), {"Level_1/Cell_H", "no such file"}},
      {"empty Cell_H", truncates(c, 0), {"Level_1/Cell_H, line 1", "the text ends here"}},
      {"Cell_H without tables", truncates(c, 69), {"Level_1/Cell_H, line 10", "the text ends here", "the table of minima"}},
      {"unknown Cell_H version", edits(c, "1\n1\n1\n0", "5\n1\n1\n0"), {"Level_1/Cell_H, line 1", "the version", "from 1 to 4"}},
      {"components disagree", edits(c, "1\n1\n1\n0", "1\n1\n2\n0"), {"Level_1/Cell_H, line 3", "2 components", "1 fields"}},
      {"negative ghosts", edits(c, "1\n1\n1\n0", "1\n1\n1\n-1"), {"Level_1/Cell_H, line 4", "ghost cells"}},
      {"ghosts that are not there",
       edits(c, "1\n1\n1\n0", "1\n1\n1\n1"),
       {"Level_1/Cell_D_00000", "FAB at byte 0", "Cell_H makes it ((1,1,1) (6,6,6))"}},
      {"boxes disagree",
       edits(c, "(1 0\n" + box, "(2 0\n" + box + "\n" + box),
       {"Level_1/Cell_H, line 5", "2 boxes", "1 grids in level 1"}},
      {"a box too few", edits(c, box + "\n", ""), {"Level_1/Cell_H, line 6", "a box"}},
      {"box outside",
       edits(c, box, "((2,2,2) (5,5,8) (0,0,0))"),
       {"Level_1/Cell_H, line 6", "((2,2,2) (5,5,8))", "outside the domain ((0,0,0) (7,7,7)) of level 1"}},
      {"box far outside", edits(c, box, "((2,2,2) (2147483647,5,5) (0,0,0))"), {"Level_1/Cell_H, line 6", "outside the domain"}},
      {"index of 33 bits",
       edits(c, box, "((2,2,2) (4294967296,5,5) (0,0,0))"),
       {"Level_1/Cell_H, line 6", "found '4294967296,5,5)'"}},
      {"empty box", edits(c, box, "((2,2,2) (1,5,5) (0,0,0))"), {"Level_1/Cell_H, line 6", "is empty"}},
      {"nodal box", edits(c, box, "((2,2,2) (5,5,5) (1,0,0))"), {"Level_1/Cell_H, line 6", "cell-centred"}},
      {"flat box", edits(c, box, "((2,2) (5,5) (0,0))"), {"Level_1/Cell_H, line 6", "expected ','"}},
      {"positions disagree",
       edits(c, "\n1\nFabOnDisk", "\n0\nFabOnDisk"),
       {"Level_1/Cell_H, line 8", "0 data positions", "1 boxes"}},
      {"data name climbs",
       edits(c, "Cell_D_00000", "../Level_0/Cell_D_00000"),
       {"Level_1/Cell_H, line 9", "'../Level_0/Cell_D_00000'", "not a plain name"}},
      {"data name is a folder", edits(c, "Cell_D_00000", ".."), {"Level_1/Cell_H, line 9", "'..'", "not a plain name"}},
      {"negative offset", edits(c, "Cell_D_00000 0", "Cell_D_00000 -8"), {"Level_1/Cell_H, line 9", "the offset"}},
      {"offset behind the end",
       edits(c, "Cell_D_00000 0", "Cell_D_00000 99999999999"),
       {"Level_1/Cell_D_00000", "begin at byte 99999999999"}},
      {"offset of 65 bits",
       edits(c, "Cell_D_00000 0", "Cell_D_00000 36893488147419103232"),
       {"Level_1/Cell_H, line 9", "the offset"}},
      {"offset off by one", edits(c, "Cell_D_00000 0", "Cell_D_00000 1"), {"Level_1/Cell_D_00000, FAB at byte 1", "'FAB'"}},
      {"tables disagree", edits(c, "\n1,1\n", "\n2,1\n"), {"Level_1/Cell_H", "the table of minima has 2 by 1"}},

      {"no data file", removes(d), {"Level_1/Cell_D_00000", "no such file"}},
      {"empty data file", truncates(d, 0), {"Level_1/Cell_D_00000", "the file has only 0"}},
      {"data file cut in the line", truncates(d, 60), {"Level_1/Cell_D_00000, FAB at byte 0", "ends here"}},
      {"data file cut in the values", truncates(d, 200), {"Level_1/Cell_D_00000: too short, 200 bytes", "512 bytes"}},
      {"a byte missing",
       [](const fs::path& p) {
         const fs::path f = p / "Level_1/Cell_D_00000";
         fs::resize_file(f, fs::file_size(f) - 1);
       },
       {"Level_1/Cell_D_00000: too short"}},
      {"FAB of another box",
       edits(d, box, "((2,2,2) (5,5,4) (0,0,0))"),
       {"Level_1/Cell_D_00000, FAB at byte 0", "((2,2,2) (5,5,4))", "((2,2,2) (5,5,5))"}},
      {"FAB of more components", edits(d, ") 1\n", ") 2\n"), {"Level_1/Cell_D_00000, FAB at byte 0", "2 components"}},
      {"unknown numbers",
       edits(d, "64 11 52", "80 15 63"),
       {"Level_1/Cell_D_00000, FAB at byte 0", "80 15 63", "IEEE float32 and float64"}},
      {"mixed byte order",
       edits(d, "8 7 6 5 4 3 2 1", "2 1 4 3 6 5 8 7"),
       {"Level_1/Cell_D_00000, FAB at byte 0", "2 1 4 3 6 5 8 7"}},
      {"ASCII FAB", edits(d, "FAB ((8", "FAB: 1 (8"), {"Level_1/Cell_D_00000, FAB at byte 0", "real descriptor"}},
      {"shared bytes",
       edits("Level_0/Cell_H", "\n((2,0,0) (3,3,3)", "\n((0,0,0) (1,3,3)"),
       {"Level_0/Cell_D_00000, FAB at byte"}},
  };
}

TEST_F(AmrexReader, NamesFileAndFaultOfBadInput) {
  for (const BadCase& bad : bad_cases()) {
    SCOPED_TRACE(bad.name);
    const fs::path plt = write_plotfile(folder_ / "plt", two_levels());
    bad.damage(plt);
    if (HasFatalFailure()) return;
    const std::string message = message_of([&] { read_mesh(plt); });
    for (const std::string& part : bad.message) EXPECT_NE(message.find(part), std::string::npos) << message;
    fs::remove_all(plt);
  }
}

TEST_F(AmrexReader, RefusesPatchesThatShareTheirBytes) {
  Spec spec = two_levels();
  spec.cell_version = 2;
  write_plotfile(folder_ / "plt", spec);
  const fs::path level = folder_ / "plt" / "Level_0";
  edit(level / "Cell_H", "Cell_D_00000 256", "Cell_D_00000 0");
  fs::resize_file(level / "Cell_D_00000", 256);
  const std::string message = message_of([&] { read_mesh(folder_ / "plt"); });
  EXPECT_NE(message.find("Level_0/Cell_H: its patches take 512 bytes, but the data files have only 256"), std::string::npos)
      << message;
}

TEST_F(AmrexReader, NamesTheFieldsThereAre) {
  Spec spec = two_levels();
  spec.fields = {"density", "velocity in x"};
  write_plotfile(folder_ / "plt", spec);
  const std::string message = message_of<UsageError>([&] { read_mesh(folder_ / "plt", {"phi"}); });
  EXPECT_NE(message.find("no field 'phi'; its fields are density, velocity in x"), std::string::npos) << message;
  EXPECT_NE(message.find("plt"), std::string::npos) << message;
}

TEST_F(AmrexReader, NamesPathsOfNoKnownFormat) {
  write_text(folder_ / "notes.txt", "hello");
  for (const fs::path& path : {folder_ / "notes.txt", folder_}) {
    const std::string message = message_of([&] { read_mesh(path); });
    EXPECT_NE(message.find(path.string()), std::string::npos) << message;
    EXPECT_NE(message.find("AMReX plotfile"), std::string::npos) << message;
  }
  const std::string message = message_of([&] { read_mesh(folder_ / "absent"); });
  EXPECT_NE(message.find("absent: no such file or directory"), std::string::npos) << message;
}

// ---- writing ----

MeshDescription mesh_with_missing_values(const fs::path& folder) {
  Spec spec = two_levels(4, Vec3i(-3, 0, 5));
  spec.fields = {"density", "velocity in x"};
  MeshDescription mesh = read_mesh(write_plotfile(folder, spec));
  mesh.levels[0][0].values[0].set(0, std::numeric_limits<double>::quiet_NaN());
  mesh.levels[1][0].values[1].set(7, std::numeric_limits<double>::infinity());
  CellValues& all = mesh.levels[0][1].values[1];
  for (std::size_t i = 0; i < all.size(); ++i) all.set(i, std::numeric_limits<double>::quiet_NaN());
  return mesh;
}

void expect_same_mesh(const AmrHierarchy& a, const AmrHierarchy& b) {
  EXPECT_EQ(a.fields(), b.fields());
  EXPECT_EQ(a.domain_lower(), b.domain_lower());
  EXPECT_EQ(a.domain_upper(), b.domain_upper());
  ASSERT_EQ(a.level_count(), b.level_count());
  for (int l = 0; l < a.level_count(); ++l) EXPECT_EQ(a.patches(l).size(), b.patches(l).size());
  for (int f = 0; f < static_cast<int>(a.fields().size()); ++f) {
    EXPECT_EQ(a.content_hash(f), b.content_hash(f));
    EXPECT_EQ(a.statistics(f).volume_integral, b.statistics(f).volume_integral);
    EXPECT_EQ(a.statistics(f).cells_without_value, b.statistics(f).cells_without_value);
  }
}

TEST_F(AmrexReader, ReadsBackWhatItWrites) {
  const AmrHierarchy sample(read_mesh(fs::path(AMRTEX_SOURCE_DIR) / "data" / "amrex_tiny" / "plt00008"));
  write_amrex_plotfile(sample, folder_ / "copy");
  expect_same_mesh(sample, AmrHierarchy(read_mesh(folder_ / "copy")));
  const AmrHierarchy missing(mesh_with_missing_values(folder_ / "missing"));
  write_amrex_plotfile(missing, folder_ / "missing_copy" / "");
  expect_same_mesh(missing, AmrHierarchy(read_mesh(folder_ / "missing_copy")));
}

// Four bytes a value, in the file as in memory.
TEST_F(AmrexReader, WritesSinglePrecisionAsSinglePrecision) {
  MeshDescription mesh = read_mesh(write_plotfile(folder_ / "plt", two_levels()));
  const AmrHierarchy wide(mesh);
  for (std::vector<Patch>& level : mesh.levels)
    for (Patch& patch : level)
      for (CellValues& values : patch.values) {
        CellValues narrow(RealType::float32, values.size());
        for (std::size_t i = 0; i < values.size(); ++i) narrow.set(i, values[i]);
        values = std::move(narrow);
      }
  const AmrHierarchy narrow(std::move(mesh));
  write_amrex_plotfile(wide, folder_ / "wide");
  write_amrex_plotfile(narrow, folder_ / "narrow");
  const MeshDescription read = read_mesh(folder_ / "narrow");
  EXPECT_EQ(read.levels[1][0].values[0].type(), RealType::float32);
  expect_same_mesh(narrow, AmrHierarchy(read));
  for (const char* level : {"Level_0", "Level_1"}) {
    const auto patches = static_cast<std::int64_t>(wide.patches(level[6] - '0').size());
    const std::int64_t saved = static_cast<std::int64_t>(fs::file_size(folder_ / "wide" / level / "Cell_D_00000")) -
                               static_cast<std::int64_t>(fs::file_size(folder_ / "narrow" / level / "Cell_D_00000"));
    const std::int64_t values = wide.stored_cells(level[6] - '0') * std::ssize(wide.fields());
    EXPECT_EQ(saved, 4 * values + 11 * patches) << "a header that says float32 has eleven letters less";
  }
}

TEST_F(AmrexReader, LeavesNothingBehindWhenWritingFails) {
  const AmrHierarchy mesh(read_mesh(write_plotfile(folder_ / "plt", two_levels())));
  fs::create_directory(folder_ / "taken");
  write_text(folder_ / "file", "");
  EXPECT_NE(message_of([&] { write_amrex_plotfile(mesh, folder_ / "taken"); }).find("exists already"), std::string::npos);
  EXPECT_NE(message_of([&] { write_amrex_plotfile(mesh, folder_ / "no" / "such"); }).find("no/such"), std::string::npos);
  EXPECT_NE(message_of([&] { write_amrex_plotfile(mesh, folder_ / "file" / "below"); }).find("file/below"), std::string::npos);
  MeshDescription unnameable = read_mesh(folder_ / "plt");
  unnameable.fields = {"two\nlines"};
  const AmrHierarchy refused(std::move(unnameable));
  EXPECT_NE(message_of([&] { write_amrex_plotfile(refused, folder_ / "out"); }).find("field name"), std::string::npos);
  std::vector<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder_)) left.push_back(entry.path().filename().string());
  std::sort(left.begin(), left.end());
  EXPECT_EQ(left, (std::vector<std::string>{"file", "plt", "taken"}));
  EXPECT_TRUE(fs::is_empty(folder_ / "taken"));
}

/// What yt finds in a plotfile of one field `phi`; exit code 77 says that there is no yt.
constexpr const char* kYtScript = R"(
import json, sys
try:
    import yt
except ImportError:
    sys.exit(77)
yt.set_log_level(50)
ds = yt.load(sys.argv[1])
ad = ds.all_data()
v, w = ad[('boxlib', 'phi')], ad[('index', 'cell_volume')].to('code_length**3')
grids = [int(g) for g in ds.index.level_stats['numgrids'][:ds.index.max_level + 1]]
json.dump({'grids': grids, 'leaves': int(v.size), 'min': float(v.min()), 'max': float(v.max()), 'integral': float((v * w).sum())},
          open(sys.argv[2], 'w'))
)";

TEST_F(AmrexReader, WritesWhatYtReads) {
  const AmrHierarchy mesh(read_mesh(write_plotfile(folder_ / "plt", two_levels())));
  write_amrex_plotfile(mesh, folder_ / "copy");
  write_text(folder_ / "check.py", kYtScript);
  int code = 77;
  for (const char* python : {"python3", "/usr/bin/python3"}) {
    const std::string command =
        fmt::format("{0} '{1}/check.py' '{1}/copy' '{1}/out.json' > '{1}/log' 2>&1", python, folder_.string());
    code = WEXITSTATUS(std::system(command.c_str()));
    if (code == 0) break;
  }
  if (code == 77 || code == 127)
    GTEST_SKIP() << "no python3 here can import yt (Debian: python3-yt); what we write is not checked by another reader";
  ASSERT_EQ(code, 0) << read_text(folder_ / "log");
  const Json seen = Json::parse(read_text(folder_ / "out.json"));
  EXPECT_EQ(seen.at("grids"), Json({2, 1}));
  EXPECT_EQ(seen.at("leaves").get<std::int64_t>(), mesh.leaf_cells());
  EXPECT_EQ(seen.at("min").get<double>(), mesh.statistics(0).min);
  EXPECT_EQ(seen.at("max").get<double>(), mesh.statistics(0).max);
  EXPECT_NEAR(seen.at("integral").get<double>(), mesh.statistics(0).volume_integral, 1e-12 * mesh.statistics(0).volume_integral);
}

// ---- properties ----

std::vector<fs::path> files_below(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());  // directory order differs between machines, the test must not
  return files;
}

/// Hash of the mesh, or nothing where it was refused with an Error; anything else ends the test.
std::optional<std::string> hash_or_refusal(const fs::path& plt) {
  try {
    return AmrHierarchy(read_mesh(plt)).content_hash(0);
  } catch (const Error& refused) {
    EXPECT_NE(std::string(refused.what()).find("plt"), std::string::npos) << refused.what();
    return std::nullopt;
  }
}

TEST_F(AmrexReader, TruncatedFilesAreRefusedOrHarmless) {
  constexpr int kCutsPerFile = 60;
  std::mt19937 random(1);
  for (int version = 1; version <= 4; ++version) {
    Spec spec = two_levels();
    spec.cell_version = version;
    const fs::path plt = write_plotfile(folder_ / "plt", spec);
    const std::string whole = AmrHierarchy(read_mesh(plt)).content_hash(0);
    for (const fs::path& file : files_below(plt)) {
      const std::string text = read_text(file);
      for (int i = 0; i < kCutsPerFile; ++i) {
        const std::size_t cut = random() % text.size();
        write_text(file, text.substr(0, cut));
        const auto hash = hash_or_refusal(plt);
        EXPECT_TRUE(!hash || *hash == whole)
            << file << " cut to " << cut << " of " << text.size() << " bytes, Cell_H version " << version;
      }
      write_text(file, text);
    }
  }
}

TEST_F(AmrexReader, DamagedFilesAreReadOrRefused) {
  constexpr int kChangesPerFile = 150;
  const std::string hostile("0123456789-+.,() \n/eF\0\xff", 24);
  std::mt19937 random(2);
  for (int version = 1; version <= 4; ++version) {
    Spec spec = two_levels();
    spec.cell_version = version;
    const fs::path plt = write_plotfile(folder_ / "plt", spec);
    for (const fs::path& file : files_below(plt)) {
      const std::string text = read_text(file);
      for (int i = 0; i < kChangesPerFile; ++i) {
        std::string damaged = text;
        const std::size_t at = random() % text.size();
        const char with = hostile[random() % hostile.size()];
        if (i % 2 == 0)
          damaged[at] = with;
        else
          damaged.insert(at, 1, with);
        write_text(file, damaged);
        hash_or_refusal(plt);  // whatever it holds now: a mesh or one Error
      }
      write_text(file, text);
    }
  }
}

TEST_F(AmrexReader, WithoutANameReadsTheFirstFieldAndKnowsTheOthers) {
  Spec spec = two_levels();
  spec.fields = {"density", "velocity in x", "Y(O2)"};
  const MeshDescription mesh = read_mesh(write_plotfile(folder_ / "plt", spec), FieldChoice::first());
  expect_spec(mesh, spec, {0});
  EXPECT_EQ(mesh.fields_there, spec.fields);
}

/// 4 x 2 cells, of which the two in the middle of the lower row are refined by 2. Values are x + 10 y of each level's cells.
fs::path write_flat_plotfile(const fs::path& folder) {
  const auto level = [&](int number, const Vec3i& lower, const Vec3i& size) {
    const Vec3i upper = lower + size - 1;
    const std::string box = fmt::format("(({},{}) ({},{}) (0,0))", lower.x, lower.y, upper.x, upper.y);
    std::string data = fmt::format("FAB ((8, (32 8 23 0 1 9 0 127)),(4, (4 3 2 1))){} 1\n", box);
    for (int y = lower.y; y <= upper.y; ++y)
      for (int x = lower.x; x <= upper.x; ++x) data += encoded(x + 10 * y, {4, std::endian::little});
    const fs::path where = folder / fmt::format("Level_{}", number);
    fs::create_directories(where);
    write_text(where / "Cell_D_00000", data);
    write_text(where / "Cell_H",
               fmt::format("1\n1\n1\n0\n(1 0\n{}\n)\n1\nFabOnDisk: Cell_D_00000 0\n\n1,1\n0,\n\n1,1\n9,\n\n", box));
  };
  level(0, Vec3i(0), Vec3i(4, 2, 1));
  level(1, Vec3i(2, 0, 0), Vec3i(4, 2, 1));
  write_text(folder / "Header",
             "HyperCLaw-V1.1\n1\nphi\n2\n0.5\n1\n-1 0 \n1 1 \n2 \n((0,0) (3,1) (0,0)) ((0,0) (7,3) (0,0)) \n5 5 \n0.5 0.5 \n0.25 "
             "0.25 \n0\n"
             "0\n0 1 0.5\n5\n-1 1\n0 1\nLevel_0/Cell\n1 1 0.5\n5\n-0.5 0.5\n0 0.5\nLevel_1/Cell\n");
  return folder;
}

TEST_F(AmrexReader, TwoDimensionsBecomeASlab) {
  const MeshDescription mesh = read_mesh(write_flat_plotfile(folder_ / "plt"));
  EXPECT_EQ(mesh.dimensions, 2);
  EXPECT_EQ(mesh.ratios, std::vector<int>{2});
  EXPECT_EQ(mesh.root_cells, Vec3i(4, 2, 1));
  EXPECT_EQ(mesh.domain_upper - mesh.domain_lower, Vec3d(2, 1, 0.25)) << "as deep as the edge of a finest cell";
  EXPECT_EQ(mesh.levels[1][0].box, (Box{Vec3i(2, 0, 0), Vec3i(6, 2, 2)}));
  const AmrHierarchy h(mesh);
  EXPECT_EQ(h.leaf_cells(0), 6);
  EXPECT_EQ(h.leaf_cells(1), 16);
  // the sums of the leaves' values, by the areas of their cells and the depth
  const double coarse = (0 + 3 + 10 + 11 + 12 + 13) * 0.25;
  const double fine = (2 * (2 + 3 + 4 + 5) + 4 * 10) * 0.0625;
  EXPECT_NEAR(h.statistics(0).volume_integral, (coarse + fine) * 0.25, 1e-13);
}

TEST_F(AmrexReader, OneDimensionIsRefused) {
  const fs::path plt = write_flat_plotfile(folder_ / "plt");
  edit(plt / "Header", "phi\n2\n", "phi\n1\n");
  EXPECT_THAT(message_of([&] { read_mesh(plt); }), testing::HasSubstr("1-dimensional; 2 and 3 dimensions can be read"));
}

}  // namespace
}  // namespace amrtex
