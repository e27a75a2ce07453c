// AMReX's HDF5 plot files: both arrangements of components, packing, and what is refused.
#include <functional>

#include "structures/readers/chombo_hdf5/chombo_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using ::testing::HasSubstr;

class AmrexHdf5 : public FolderTest {
 protected:
  fs::path file() const { return folder_ / "plt00012.h5"; }
  std::string refusal() const {
    return message_of([&] { read_mesh(file()); });
  }
  void write(ChomboOptions options = {}) const {
    options.amrex = true;
    write_chombo(file(), mesh_of_blocks({"density", "phi"}), options);
  }
  void change(const std::function<void(hid_t)>& change) const {
    const hid_t opened = H5Fopen(file().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    change(opened);
    H5Fclose(opened);
  }
};

void set_integers(hid_t file, const char* object, const char* name, const std::vector<int>& values) {
  change_attribute(file, object, name, H5T_NATIVE_INT, values.data());
}

void set_text(hid_t file, const char* name, const char* value) {
  H5Adelete(file, name);
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::string_view(value).size() + 1);
  const hid_t space = H5Screate(H5S_SCALAR);
  const hid_t attribute = H5Acreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
  H5Awrite(attribute, type, value);
  H5Aclose(attribute);
  H5Sclose(space);
  H5Tclose(type);
}

// ngrow is 1 in all of them: ghost cells are counted, and never written
TEST_F(AmrexHdf5, ReadsOneDataSetAndOneForEachComponent) {
  for (const bool set_for_each : {false, true})
    for (const Packing packing : {Packing::contiguous, Packing::deflate}) {
      write({.packing = packing, .set_for_each = set_for_each});
      expect_mesh(read_mesh(file()), mesh_of_blocks({"density", "phi"}));
      const MeshDescription phi = read_mesh(file(), {"phi"});
      EXPECT_EQ(phi.levels[2][3].values[0].doubles(), mesh_of_blocks({"density", "phi"}).levels[2][3].values[1].doubles());
    }
}

TEST_F(AmrexHdf5, RefusesOtherVersionsCoordinatesAndCentrings) {
  write();
  change([](hid_t opened) { set_text(opened, "version_name", "HyperCLaw-V9"); });
  EXPECT_THAT(refusal(), HasSubstr("version_name is 'HyperCLaw-V9'; accepted: HyperCLaw-V1.1, NavierStokes-V1.1, CartGrid-V2.0"));
  write();
  change([](hid_t opened) { set_text(opened, "plotfile_type", "Other"); });
  EXPECT_THAT(refusal(), HasSubstr("plotfile_type is 'Other'; accepted: VanillaHDF5"));
  write();
  change([](hid_t opened) { set_integers(opened, "/", "coordinate_system", {2}); });
  EXPECT_THAT(refusal(), HasSubstr("the coordinate system is 2 (spherical)"));
  write();
  change([](hid_t opened) { set_integers(opened, "/", "coordinate_system", {1}); });
  EXPECT_THAT(refusal(), HasSubstr("the coordinate system is 1 (cylindrical)"));
  write();
  change([](hid_t opened) { set_integers(opened, "level_1", "domain_type", {0, 1, 0}); });
  EXPECT_THAT(refusal(), HasSubstr("level_1: its values are not cell-centred"));
}

TEST_F(AmrexHdf5, RefusesCornersThatContradictTheCells) {
  write();
  change([](hid_t opened) {
    const double upper[] = {4, 1, 1.5};
    change_attribute(opened, "level_0", "prob_hi", H5T_NATIVE_DOUBLE, upper);
  });
  EXPECT_THAT(refusal(),
              HasSubstr("level_0: its cells are said to be 0.5 wide along x, but the domain and its cells make them 0.625"));
}

TEST_F(AmrexHdf5, RefusesFilesThatAreCut) {
  write({.set_for_each = true});
  expect_cuts_to_be_refused(file(), 61, [&] { return read_mesh(file()); });
}

TEST(AmrexHdf5Sample, HasTheHashOfThePlotfileOfTheSameState) {
  AMRTEX_NEEDS(kSharedData, "amrex_hdf5/plt00012_h5.h5");
  const AmrHierarchy in_hdf5(read_mesh(kSharedData / "amrex_hdf5/plt00012_h5.h5"));
  const AmrHierarchy in_folder(read_mesh(kSharedData / "amrex_hdf5/plt00012"));
  EXPECT_EQ(in_hdf5.content_hash(0), in_folder.content_hash(0));
  EXPECT_EQ(in_hdf5.domain_lower(), in_folder.domain_lower());
  EXPECT_EQ(in_hdf5.domain_upper(), in_folder.domain_upper());
}

}  // namespace
}  // namespace amrtex
