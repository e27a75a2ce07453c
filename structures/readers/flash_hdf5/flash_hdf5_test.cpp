// Files of FLASH: variants of the format, written by the test, and bad input of every kind.
#include <functional>

#include "structures/readers/flash_hdf5/flash_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using ::testing::HasSubstr;

const std::vector<std::string> kFields{"dens", "h1", "pres"};

class FlashHdf5 : public FolderTest {
 protected:
  fs::path file() const { return folder_ / "run_hdf5_plt_cnt_0007"; }
  std::string refusal() const {
    return message_of([&] { read_mesh(file()); });
  }
  /// Writes the mesh of blocks with another data set in place of one of its own.
  void write_with(const std::string& set, const std::function<void(Hdf5Writer&)>& write) const {
    write_flash(file(), mesh_of_blocks(kFields));
    const fs::path other = folder_ / "other";
    {
      Hdf5Writer out(other);
      write(out);
    }
    const hid_t opened = H5Fopen(file().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t from = H5Fopen(other.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    H5Ldelete(opened, set.c_str(), H5P_DEFAULT);
    if (H5Lexists(from, set.c_str(), H5P_DEFAULT) > 0) H5Ocopy(from, set.c_str(), opened, set.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    H5Fclose(from);
    H5Fclose(opened);
  }
};

TEST_F(FlashHdf5, ReadsEveryVersionPackingAndPadding) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  for (const int version : {7, 8, 9})
    for (const bool padded : {false, true})
      for (const Packing packing : {Packing::contiguous, Packing::chunked, Packing::deflate})
        for (const hid_t type : {H5T_IEEE_F32LE, H5T_IEEE_F32BE}) {
          write_flash(file(), mesh, {.version = version, .padded_sets = padded, .type = type, .packing = packing});
          expect_mesh(read_mesh(file()), mesh);
        }
}

TEST_F(FlashHdf5, FindsTheDomainFromBlocksWithoutParameters) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  for (const int version : {7, 9}) {
    write_flash(file(), mesh, {.version = version, .parameters = false});
    expect_mesh(read_mesh(file()), mesh);
  }
}

TEST_F(FlashHdf5, DrawsTwoDimensionsAsASlab) {
  const MeshDescription mesh = mesh_of_blocks(kFields, 2);
  for (const int version : {7, 9}) {
    write_flash(file(), mesh, {.version = version});
    expect_mesh(read_mesh(file()), mesh);
  }
}

TEST_F(FlashHdf5, ReadsOnlyTheFieldAskedFor) {
  write_flash(file(), mesh_of_blocks(kFields));
  const MeshDescription mesh = read_mesh(file(), {"h1"});
  EXPECT_EQ(mesh.fields, (std::vector<std::string>{"h1"}));
  ASSERT_EQ(mesh.levels[2][5].values.size(), 1U);
  EXPECT_EQ(mesh.levels[2][5].values[0].doubles(), mesh_of_blocks(kFields).levels[2][5].values[1].doubles());
  EXPECT_THAT(message_of<UsageError>([&] { read_mesh(file(), {"dnes"}); }),
              HasSubstr("did you mean 'dens'?; its fields are dens, h1, pres"));
}

TEST_F(FlashHdf5, ReadsPlotFilesOfDoublesAndRefusesCheckpoints) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  write_flash(file(), mesh, {.double_plot_files = true, .type = H5T_IEEE_F64LE});
  expect_mesh(read_mesh(file()), mesh);
  for (const int version : {7, 9}) {
    write_flash(file(), mesh, {.version = version, .type = H5T_IEEE_F64LE});
    EXPECT_THAT(refusal(), HasSubstr("dens: a checkpoint"));
  }
}

TEST_F(FlashHdf5, RefusesOtherVersionsDimensionsAndGeometries) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  for (const int version : {6, 11}) {
    write_flash(file(), mesh, {.version = version});
    EXPECT_THAT(refusal(), HasSubstr(fmt::format("version {} of FLASH's file format; versions 7 to 9 can be read", version)));
  }
  write_flash(file(), mesh, {.dimensionality = 1});
  EXPECT_THAT(refusal(), HasSubstr("the data are 1-dimensional"));
  write_flash(file(), mesh, {.dimensionality = 2});
  EXPECT_THAT(refusal(), HasSubstr("two dimensions, but blocks of 2 cells along z"));
  for (const char* geometry : {"cylindrical", "spherical", "polar"}) {
    write_flash(file(), mesh, {.geometry = geometry});
    EXPECT_THAT(refusal(), HasSubstr(fmt::format("the geometry is '{}'; only cartesian", geometry)));
  }
  write_flash(file(), mesh, {.version = 7, .geometry = "cylindrical"});
  EXPECT_THAT(refusal(), HasSubstr("igeomx is 1"));
}

TEST_F(FlashHdf5, NamesObjectAndFaultOfBadInput) {
  const auto nothing = [](Hdf5Writer&) {};
  const std::vector<double> bounds(18 * 6, 0.25);
  std::vector<double> not_finite(18 * 6, std::numeric_limits<double>::quiet_NaN());
  write_with("refine level", nothing);
  EXPECT_THAT(refusal(), HasSubstr("refine level: no tree of blocks"));
  write_with("refine level", [](Hdf5Writer& out) { out.integers("refine level", {18}, std::vector<std::int64_t>(18, 0)); });
  EXPECT_THAT(refusal(), HasSubstr("refine level: block 0 is of level 0; 1 to 64"));
  write_with("refine level", [](Hdf5Writer& out) { out.integers("refine level", {18}, std::vector<std::int64_t>(18, 60)); });
  EXPECT_THAT(refusal(), HasSubstr("bounding box: "));
  write_with("refine level", [](Hdf5Writer& out) { out.numbers("refine level", {18}, std::vector<double>(18, 1)); });
  EXPECT_THAT(refusal(), HasSubstr("refine level: of another type than whole numbers"));
  write_with("refine level", [](Hdf5Writer& out) { out.integers("refine level", {3}, {1, 1, 1}); });
  EXPECT_THAT(refusal(), HasSubstr("bounding box: extents (18, 3, 2) for 3 blocks"));
  write_with("bounding box", [&](Hdf5Writer& out) { out.numbers("bounding box", {18, 3, 2}, bounds); });
  EXPECT_THAT(refusal(), HasSubstr("bounding box: block 0 of level 1 lies from 0.25 to 0.25 along x"));
  write_with("bounding box", [&](Hdf5Writer& out) { out.numbers("bounding box", {18, 3, 2}, not_finite); });
  EXPECT_THAT(refusal(), HasSubstr("bounding box: a bound is not finite"));
  write_with("bounding box", [&](Hdf5Writer& out) { out.numbers("bounding box", {18, 6}, bounds); });
  EXPECT_THAT(refusal(), HasSubstr("bounding box: extents (18, 6)"));
  write_with("unknown names", nothing);
  EXPECT_THAT(refusal(), HasSubstr("unknown names: cannot be opened as a data set"));
  write_with("unknown names", [](Hdf5Writer& out) { out.integers("unknown names", {1}, {1}); });
  EXPECT_THAT(refusal(), HasSubstr("unknown names: of another type than texts"));
  write_with("pres", nothing);
  EXPECT_THAT(refusal(), HasSubstr("unknown names: the field 'pres' has no data set"));
  write_with("pres", [](Hdf5Writer& out) { out.numbers("pres", {18, 2, 4, 2}, std::vector<double>(288), H5T_IEEE_F32LE); });
  EXPECT_THAT(refusal(), HasSubstr("pres: extents (18, 2, 4, 2); (18, 2, 2, 4) are expected"));
  write_with("pres", [](Hdf5Writer& out) { out.numbers("pres", {288}, std::vector<double>(288), H5T_IEEE_F32LE); });
  EXPECT_THAT(refusal(), HasSubstr("pres: extents (288) where 4 axes are expected"));
  write_with("pres", [](Hdf5Writer& out) { out.integers("pres", {18, 2, 2, 4}, std::vector<std::int64_t>(288)); });
  EXPECT_THAT(refusal(), HasSubstr("pres: of another type than reals"));
  write_with("integer scalars", [](Hdf5Writer& out) { out.integers("integer scalars", {1}, {1}); });
  EXPECT_THAT(refusal(), HasSubstr("integer scalars: of another type than pairs"));
}

TEST_F(FlashHdf5, RefusesFilesThatAreCut) {
  write_flash(file(), mesh_of_blocks({"dens"}));
  expect_cuts_to_be_refused(file(), 97, [&] { return read_mesh(file()); });
}

}  // namespace
}  // namespace amrtex
