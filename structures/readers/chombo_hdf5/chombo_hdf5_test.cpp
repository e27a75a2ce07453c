// Chombo files: variants of the format, written by the test, and bad input of every kind.
#include <functional>

#include "structures/readers/chombo_hdf5/chombo_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using ::testing::HasSubstr;

class ChomboHdf5 : public FolderTest {
 protected:
  fs::path file() const { return folder_ / "plt.3d.hdf5"; }
  std::string refusal() const {
    return message_of([&] { read_mesh(file()); });
  }
  /// Writes the mesh of blocks, then what `damage` adds or changes.
  void write_damaged(const std::function<void(hid_t)>& damage) const {
    write_chombo(file(), mesh_of_blocks({"density", "energy"}), {.ghosts = 1});
    const hid_t opened = H5Fopen(file().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    damage(opened);
    H5Fclose(opened);
  }
};

TEST_F(ChomboHdf5, ReadsGhostsComponentsTypesAndPackings) {
  const MeshDescription mesh = mesh_of_blocks({"density", "x-momentum", "energy"});
  for (const int ghosts : {0, 1, 3})
    for (const hid_t type : {H5T_IEEE_F64LE, H5T_IEEE_F32LE, H5T_IEEE_F64BE, H5T_IEEE_F32BE})
      for (const Packing packing : {Packing::contiguous, Packing::chunked, Packing::deflate}) {
        SCOPED_TRACE(fmt::format("{} ghosts, type {}, packing {}", ghosts, type, static_cast<int>(packing)));
        write_chombo(file(), mesh, {.ghosts = ghosts, .type = type, .packing = packing});
        expect_mesh(read_mesh(file()), mesh);
      }
}

TEST_F(ChomboHdf5, ReadsRatiosThatDifferByLevel) {
  for (const auto& [first, second] : {std::pair{2, 4}, std::pair{4, 2}}) {
    MeshDescription mesh = mesh_of_blocks({"a"});
    mesh.ratios = {first, second};
    const Box root{Vec3i(2, 0, 0), Vec3i(6, 2, 2)};
    const Box middle = Box{Vec3i(3, 0, 0), Vec3i(5, 1, 2)}.refined(first);
    mesh.levels = {patches_of({{Vec3i(0), mesh.root_cells}}, 0, 1), patches_of({root.refined(first)}, 1, 1),
                   patches_of({middle.refined(second)}, 2, 1)};
    write_chombo(file(), mesh);
    expect_mesh(read_mesh(file()), mesh);
  }
}

TEST_F(ChomboHdf5, ReadsAttributesAsArrays) {
  const MeshDescription mesh = mesh_of_blocks({"a", "b"});
  write_chombo(file(), mesh, {.arrays = true});
  expect_mesh(read_mesh(file()), mesh);
}

TEST_F(ChomboHdf5, FindsPatchesWithoutOffsets) {
  const MeshDescription mesh = mesh_of_blocks({"a", "b"});
  for (const int ghosts : {0, 2}) {
    write_chombo(file(), mesh, {.ghosts = ghosts, .offsets = false});
    expect_mesh(read_mesh(file()), mesh);
  }
}

TEST_F(ChomboHdf5, ReadsOnlyTheFieldAskedFor) {
  write_chombo(file(), mesh_of_blocks({"density", "energy"}), {.ghosts = 1});
  MeshDescription energy = mesh_of_blocks({"density", "energy"});
  energy.fields = {"energy"};
  for (auto& level : energy.levels)
    for (Patch& patch : level) patch.values.erase(patch.values.begin());
  expect_mesh(read_mesh(file(), {"energy"}), energy);
  const std::string message = message_of<UsageError>([&] { read_mesh(file(), {"enrgy"}); });
  EXPECT_THAT(message, HasSubstr("no field 'enrgy'; did you mean 'energy'?; its fields are density, energy"));
}

TEST_F(ChomboHdf5, ReadsTextsOfVariableLength) {
  write_damaged([](hid_t opened) { H5Adelete_by_name(opened, "/", "component_0", H5P_DEFAULT); });
  const hid_t opened = H5Fopen(file().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, H5T_VARIABLE);
  const hid_t space = H5Screate(H5S_SCALAR);
  const hid_t attribute = H5Acreate2(opened, "component_0", type, space, H5P_DEFAULT, H5P_DEFAULT);
  const char* name = "mass";
  H5Awrite(attribute, type, &name);
  H5Aclose(attribute);
  H5Sclose(space);
  H5Tclose(type);
  H5Fclose(opened);
  EXPECT_EQ(read_mesh(file()).fields, (std::vector<std::string>{"mass", "energy"}));
}

// a column of W / w cells at each cell of a level w finest cells wide: the depth is a finest cell's edge, 4 / 32
TEST_F(ChomboHdf5, DrawsTwoDimensionsAsASlab) {
  const MeshDescription mesh = mesh_of_blocks({"a"}, 2);
  for (const int ghosts : {0, 2}) {
    write_chombo(file(), mesh, {.ghosts = ghosts});
    expect_mesh(read_mesh(file()), mesh);
  }
  const AmrHierarchy slab(read_mesh(file()));
  EXPECT_EQ(slab.dimensions(), 2);
  EXPECT_EQ(slab.domain_upper().z, 4.0 / 32);
  for (int l = 0; l < 3; ++l) EXPECT_EQ(slab.cells(l).z, 1 << l);
}

struct BadCase {
  const char* name;
  std::function<void(hid_t)> damage;
  std::vector<std::string> message;
};

std::vector<BadCase> bad_cases() {
  const auto removes = [](const char* object) {
    return [object](hid_t file) { EXPECT_GE(H5Ldelete(file, object, H5P_DEFAULT), 0); };
  };
  const auto sets = [](const char* object, const char* name, int value) {
    return [=](hid_t file) { change_attribute(file, object, name, H5T_NATIVE_INT, &value); };
  };
  return {
      {"a level is missing", removes("level_1"), {"level_1: this level is missing"}},
      {"no boxes", removes("level_1/boxes"), {"level_1/boxes: cannot be opened as a data set"}},
      {"no data", removes("level_1/data:datatype=0"), {"level_1: it has boxes, but no data set"}},
      {"a checkpoint",
       [](hid_t file) {
         H5Lmove(file, "level_0/data:datatype=0", file, "level_0/Enthalpy:datatype=0", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_0: a checkpoint", "such of Enthalpy"}},
      {"one dimension", sets("Chombo_global", "SpaceDim", 1), {"Chombo_global", "1-dimensional; 2 and 3"}},
      {"six dimensions", sets("Chombo_global", "SpaceDim", 6), {"Chombo_global", "SpaceDim is 6"}},
      {"too many levels", sets("/", "num_levels", 9), {"level_3: this level is missing"}},
      {"more levels than there can be", sets("/", "num_levels", 2000000000), {"num_levels is 2000000000; 1 to 64"}},
      {"no levels", sets("/", "num_levels", 0), {"num_levels is 0"}},
      {"too many components", sets("/", "num_components", 2000000000), {"attribute component_2: cannot be opened"}},
      {"no components", sets("/", "num_components", 0), {"num_components is 0"}},
      {"a component less", sets("/", "num_components", 1), {"comps is 2, but the file names 1 components"}},
      {"ratio of 1", sets("level_0", "ref_ratio", 1), {"level_0: ref_ratio is 1; at least 2"}},
      {"another ratio", sets("level_0", "ref_ratio", 4), {"level_1: its domain", "refined by 4"}},
      {"boxes of reals",
       [](hid_t file) {
         H5Ldelete(file, "level_1/boxes", H5P_DEFAULT);
         H5Lcreate_soft("/level_1/data:datatype=0", file, "level_1/boxes", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1/boxes: of another type than a compound"}},
      {"data of whole numbers",
       [](hid_t file) {
         H5Ldelete(file, "level_1/data:datatype=0", H5P_DEFAULT);
         H5Lcreate_soft("/level_1/data:offsets=0", file, "level_1/data:datatype=0", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1/data:datatype=0: of another type than reals"}},
      {"offsets of another level",
       [](hid_t file) {
         H5Ldelete(file, "level_1/data:offsets=0", H5P_DEFAULT);
         H5Lcreate_soft("/level_0/data:offsets=0", file, "level_1/data:offsets=0", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1/data:offsets=0: 3 offsets for 8 boxes"}},
      {"data of another level",
       [](hid_t file) {
         H5Ldelete(file, "level_1/data:datatype=0", H5P_DEFAULT);
         H5Lcreate_soft("/level_0/data:datatype=0", file, "level_1/data:datatype=0", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1: patch 2", "there are only"}},
      {"a level in another file",
       [](hid_t file) {
         H5Ldelete(file, "level_1/data:datatype=0", H5P_DEFAULT);
         H5Lcreate_external("/etc/passwd", "/x", file, "level_1/data:datatype=0", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1/data:datatype=0: a link to another file"}},
      {"links in a circle",
       [](hid_t file) {
         H5Ldelete(file, "level_1", H5P_DEFAULT);
         H5Lcreate_soft("/level_9", file, "level_1", H5P_DEFAULT, H5P_DEFAULT);
         H5Lcreate_soft("/level_1", file, "level_9", H5P_DEFAULT, H5P_DEFAULT);
       },
       {"level_1: cannot be looked up", "too many"}},
  };
}

TEST_F(ChomboHdf5, NamesFileObjectAndFaultOfBadInput) {
  for (const BadCase& bad : bad_cases()) {
    SCOPED_TRACE(bad.name);
    write_damaged(bad.damage);
    const std::string message = refusal();
    EXPECT_THAT(message, HasSubstr("plt.3d.hdf5: "));
    for (const std::string& part : bad.message) EXPECT_THAT(message, HasSubstr(part));
  }
}

TEST_F(ChomboHdf5, RefusesBoxesOutsideOfTheirLevel) {
  for (const auto& [box, part] : {std::pair{std::vector<int>{0, 0, 1, 8, 1, 2}, "lies outside the domain"},
                                  std::pair{std::vector<int>{0, 0, 1, -3, 1, 2}, "is empty"},
                                  std::pair{std::vector<int>{-2147483647, 0, 1, 2147483647, 1, 2}, "too wide"}}) {
    write_damaged([&values = box](hid_t opened) {
      const hid_t set = H5Dopen2(opened, "level_0/boxes", H5P_DEFAULT);
      const hid_t type = H5Dget_type(set);
      std::vector<int> boxes = values;
      boxes.insert(boxes.end(), values.begin(), values.end());
      H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, boxes.data());
      H5Tclose(type);
      H5Dclose(set);
    });
    EXPECT_THAT(refusal(), HasSubstr("level_0/boxes"));
    EXPECT_THAT(refusal(), HasSubstr(part));
  }
}

/// What PLUTO adds to a level.
void write_pluto(const fs::path& path, int geometry, int logarithmic) {
  write_chombo(path, mesh_of_blocks({"rho"}));
  const hid_t opened = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t space = H5Screate(H5S_SCALAR);
  const double corner = 10;
  const auto add = [&](const char* name, hid_t type, const void* value) {
    const hid_t attribute = H5Acreate_by_name(opened, "level_0", name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, type, value);
    H5Aclose(attribute);
  };
  add("geometry", H5T_NATIVE_INT, &geometry);
  add("logr", H5T_NATIVE_INT, &logarithmic);
  add("domBeg1", H5T_NATIVE_DOUBLE, &corner);
  H5Sclose(space);
  H5Fclose(opened);
}

TEST_F(ChomboHdf5, TakesTheCornerOfPlutoAndRefusesItsCurvedAxes) {
  write_pluto(file(), 1, 0);
  EXPECT_EQ(read_mesh(file()).domain_lower, Vec3d(9, 0, 0.5));
  EXPECT_EQ(read_mesh(file()).domain_upper, Vec3d(13, 1, 1.5));
  write_pluto(file(), 2, 0);
  EXPECT_THAT(refusal(), HasSubstr("level_0: the geometry is 2 (cylindrical)"));
  write_pluto(file(), 4, 0);
  EXPECT_THAT(refusal(), HasSubstr("level_0: the geometry is 4 (spherical)"));
  write_pluto(file(), 1, 1);
  EXPECT_THAT(refusal(), HasSubstr("logarithmic"));
}

TEST_F(ChomboHdf5, RefusesFilesThatAreCut) {
  write_chombo(file(), mesh_of_blocks({"a"}), {.ghosts = 1});
  expect_cuts_to_be_refused(file(), 97, [&] { return read_mesh(file()); });
}

TEST_F(ChomboHdf5, RefusesCheckpoints) {
  AMRTEX_NEEDS(kSharedData, "chombo_mushy/chk000100.3d.hdf5");
  EXPECT_THAT(message_of([&] { read_mesh(kSharedData / "chombo_mushy/chk000100.3d.hdf5"); }), HasSubstr("a checkpoint"));
}

}  // namespace
}  // namespace amrtex
