// What other readers found in real files of every format: levels, cells, ranges, volume integrals and point samples of all
// fields. Line integrals through the reference are in reference_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "structures/mesh/json.hpp"
#include "structures/readers/amrex_hdf5/amrex_hdf5.hpp"
#include "structures/readers/chombo_hdf5/chombo_hdf5.hpp"
#include "structures/readers/chombo_hdf5/chombo_test_tools.hpp"
#include "structures/readers/enzo/enzo.hpp"
#include "structures/readers/enzo/enzo_test_tools.hpp"
#include "structures/readers/flash_hdf5/flash_hdf5.hpp"
#include "structures/readers/flash_hdf5/flash_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

struct DataSet {
  const char* data;
  const char* oracle;
};
void PrintTo(const DataSet& d, std::ostream* out) { *out << d.data << " by " << d.oracle; }

class ReadersOracle : public ::testing::TestWithParam<DataSet> {};

/// yt names fields "boxlib/phi"; readers know "phi".
std::string field_name(const std::string& name) { return name.substr(name.find('/') + 1); }

/// In a slab each cell of the plane is a column of as many cells of the mesh.
void expect_levels(const AmrHierarchy& mesh, const Json& oracle) {
  const Json& levels = oracle.at("levels");
  ASSERT_EQ(static_cast<std::size_t>(mesh.level_count()), levels.size());
  std::int64_t leaves = 0;
  for (int l = 0; l < mesh.level_count(); ++l) {
    const Json& level = levels[static_cast<std::size_t>(l)];
    const std::int64_t column = mesh.dimensions() == 2 ? mesh.cells(l).z : 1;
    EXPECT_EQ(mesh.patches(l).size(), level.at("grids").get<std::size_t>()) << "level " << l;
    EXPECT_EQ(mesh.stored_cells(l), column * level.at("cells").get<std::int64_t>()) << "level " << l;
    EXPECT_EQ(mesh.leaf_cells(l), column * level.at("leaf_cells").get<std::int64_t>()) << "level " << l;
    leaves += mesh.leaf_cells(l) / column;
  }
  EXPECT_EQ(leaves, oracle.at("total_leaf_cells").get<std::int64_t>());
}

/// Sum of |value| times cell volume: integrals may vanish where values do not, and are as exact as their terms.
double absolute_integral(const AmrHierarchy& mesh, int field) {
  double sum = 0;
  for (int l = 0; l < mesh.level_count(); ++l) {
    const Vec3d h = mesh.spacing(l);
    for (std::size_t k = 0; k < mesh.patches(l).size(); ++k) {
      const auto leaf = mesh.leaf_mask(l, static_cast<int>(k));
      const auto& values = mesh.patches(l)[k].values[static_cast<std::size_t>(field)];
      for (std::size_t i = 0; i < values.size(); ++i)
        if (leaf[i] != 0) sum += std::abs(values[i]) * h.x * h.y * h.z;
    }
  }
  return sum;
}

void expect_fields(const AmrHierarchy& mesh, const Json& fields) {
  const double depth = mesh.dimensions() == 2 ? mesh.domain_upper().z - mesh.domain_lower().z : 1;
  EXPECT_EQ(mesh.fields().size(), fields.size());
  for (const auto& [name, field] : fields.items()) {
    SCOPED_TRACE(name);
    const int index = mesh.field_index(field_name(name));
    const FieldStatistics& s = mesh.statistics(index);
    EXPECT_EQ(s.min, field.at("min").get<double>());
    EXPECT_EQ(s.max, field.at("max").get<double>());
    EXPECT_NEAR(s.volume_integral, depth * field.at("sum_value_times_volume_code").get<double>(),
                1e-12 * absolute_integral(mesh, index));
    EXPECT_EQ(s.cells_without_value, 0);
  }
}

void expect_points(const AmrHierarchy& mesh, const Json& points) {
  const int field = mesh.field_index(field_name(points.at("field").get<std::string>()));
  EXPECT_GT(points.at("samples").size(), 0U);
  for (const Json& sample : points.at("samples")) {
    const auto p = sample.at("p").get<std::vector<double>>();
    const Vec3d index = (Vec3d(p[0], p[1], p[2]) - mesh.domain_lower()) / mesh.spacing(mesh.finest_level());
    const auto leaf = mesh.find_leaf(Vec3i(glm::floor(index)));
    ASSERT_TRUE(leaf.has_value()) << sample.dump();
    EXPECT_EQ(leaf->level, sample.at("level").get<int>()) << sample.dump();
    EXPECT_EQ(mesh.value(*leaf, field), sample.at("value").get<double>()) << sample.dump();
  }
}

TEST_P(ReadersOracle, LevelsRangesIntegralsAndPoints) {
  AMRTEX_NEEDS(test::kSharedData, GetParam().data);
  AMRTEX_NEEDS(test::kSharedData, GetParam().oracle);
  const Json oracle = Json::parse(std::ifstream(test::kSharedData / GetParam().oracle));
  const AmrHierarchy mesh(read_mesh(test::kSharedData / GetParam().data));
  EXPECT_EQ(mesh.dimensions(), oracle.value("dim", oracle.value("dimensionality", 0)));
  expect_levels(mesh, oracle);
  expect_fields(mesh, oracle.at("fields"));
  if (oracle.contains("point_samples")) expect_points(mesh, oracle.at("point_samples"));
  if (!oracle.contains("domain_left_edge")) return;
  for (int axis = 0; axis < mesh.dimensions(); ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    EXPECT_EQ(mesh.domain_lower()[axis], oracle["domain_left_edge"][i].get<double>());
    EXPECT_EQ(mesh.domain_upper()[axis], oracle["domain_right_edge"][i].get<double>());
    EXPECT_EQ(mesh.cells(0)[axis], oracle["domain_dimensions_level0"][i].get<int>());
  }
}

constexpr const char* kExplosion = "chombo_explosion_r2/explosion.000006.3d.hdf5";
constexpr const char* kMushy = "chombo_mushy/plt000100.2d.hdf5";
constexpr const char* kAmrexHdf5 = "amrex_hdf5/plt00012_h5.h5";
INSTANTIATE_TEST_SUITE_P(Data, ReadersOracle,
                         ::testing::Values(DataSet{kExplosion, "chombo_explosion_r2/oracle.json"},
                                           DataSet{kExplosion, "chombo_explosion_r2/oracle_h5py.json"},
                                           DataSet{kMushy, "chombo_mushy/oracle_2d.json"},
                                           DataSet{kMushy, "chombo_mushy/oracle_2d_h5py.json"},
                                           DataSet{kAmrexHdf5, "amrex_hdf5/oracle_h5py.json"},
                                           DataSet{kAmrexHdf5, "amrex_hdf5/oracle_plt00012.json"},
                                           DataSet{"enzo_noh_manygrids/DD0001", "enzo_noh_manygrids/oracle.json"},
                                           DataSet{"flash_sedov/sedov_forced_hdf5_plt_cnt_0000",
                                                   "flash_sedov/oracle_sedov_forced_hdf5_plt_cnt_0000.json"}));

class Formats : public test::FolderTest {};

TEST_F(Formats, OneMeshHasOneHash) {
  for (const int dimensions : {2, 3}) {
    const MeshDescription mesh = test::mesh_of_blocks({"dens", "pres"}, dimensions);
    test::write_chombo(folder_ / "chombo", mesh, {.ghosts = 2, .packing = test::Packing::deflate});
    test::write_chombo(folder_ / "amrex", mesh, {.amrex = true, .set_for_each = true});
    test::write_flash(folder_ / "flash", mesh);
    fs::create_directories(folder_ / "enzo");
    test::write_enzo(folder_ / "enzo", mesh, {.ghosts = true});
    for (const int field : {0, 1}) {
      std::set<std::string> hashes;
      for (const char* name : {"chombo", "amrex", "flash", "enzo"})
        hashes.insert(AmrHierarchy(read_mesh(folder_ / name)).content_hash(field));
      EXPECT_EQ(hashes.size(), 1U) << dimensions << " dimensions, field " << field;
      if (dimensions == 3) {
        EXPECT_EQ(*hashes.begin(), AmrHierarchy(mesh).content_hash(field));
      }
    }
  }
}

TEST_F(Formats, AreToldByTheirContent) {
  const MeshDescription mesh = test::mesh_of_blocks({"dens"});
  test::write_chombo(folder_ / "a", mesh);
  test::write_chombo(folder_ / "b", mesh, {.amrex = true});
  test::write_flash(folder_ / "c", mesh);
  fs::create_directories(folder_ / "d");
  test::write_enzo(folder_ / "d", mesh);
  using Probe = bool (*)(const fs::path&);
  const std::vector<std::pair<Probe, std::string>> probes{
      {is_amrex_hdf5, "b"}, {is_flash_hdf5, "c"}, {is_enzo, "d"}, {is_chombo_hdf5, "ab"}};  // asked in this order
  for (const char name : {'a', 'b', 'c', 'd'})
    for (const auto& [probe, yes] : probes)
      EXPECT_EQ(probe(folder_ / std::string(1, name)), yes.find(name) != std::string::npos) << name << ", " << yes;
}

TEST_F(Formats, OthersAreRefusedWithAListOfThose) {
  { test::Hdf5Writer(folder_ / "other.h5").numbers("values", {3}, {1, 2, 3}); }
  test::write_bytes(folder_ / "notes.txt", "TopGrid is a word.\n");
  for (const fs::path& path : {folder_, folder_ / "other.h5", folder_ / "notes.txt"}) {
    const std::string message = test::message_of([&] { read_mesh(path); });
    for (const char* part : {"not in a format that can be read", "AMReX plotfile", "AMReX-HDF5", "Chombo", "Enzo", "FLASH"})
      EXPECT_THAT(message, ::testing::HasSubstr(part)) << path;
  }
}

}  // namespace
}  // namespace amrtex
