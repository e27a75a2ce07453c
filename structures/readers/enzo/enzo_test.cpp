// Outputs of Enzo: variants of the format, written by the test, and bad input of every kind.
#include "structures/readers/enzo/enzo_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using ::testing::HasSubstr;

const std::vector<std::string> kFields{"Density", "x-velocity", "Total_Energy"};

class Enzo : public FolderTest {
 protected:
  std::string refusal() const {
    return message_of([&] { read_mesh(folder_); });
  }
  /// Replaces the first occurrence in a file; the test is wrong where there is none.
  void edit(const char* file, const std::string& from, const std::string& to) const {
    std::string text = bytes_of_file(folder_ / file);
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_bytes(folder_ / file, text.replace(at, from.size(), to));
  }
};

TEST_F(Enzo, ReadsFolderParameterFileAndHierarchy) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  write_enzo(folder_, mesh);
  for (const fs::path& path : {folder_, folder_ / "run", folder_ / "run.hierarchy"}) {
    expect_mesh(read_mesh(path), mesh);
    EXPECT_THAT(read_mesh(path).name, HasSubstr("/run"));
  }
}

TEST_F(Enzo, ReadsGhostCellsTypesAndPackings) {
  const MeshDescription mesh = mesh_of_blocks(kFields);
  for (const bool ghosts : {false, true})
    for (const hid_t type : {H5T_IEEE_F64LE, H5T_IEEE_F32LE, H5T_IEEE_F64BE})
      for (const Packing packing : {Packing::contiguous, Packing::chunked, Packing::deflate}) {
        write_enzo(folder_, mesh, {.ghosts = ghosts, .type = type, .packing = packing});
        expect_mesh(read_mesh(folder_), mesh);
      }
}

TEST_F(Enzo, ReadsRatioFour) {
  MeshDescription mesh = mesh_of_blocks({"Density"});
  mesh.ratios = {4};
  mesh.levels = {patches_of({{Vec3i(0), mesh.root_cells}}, 0, 1), patches_of({{Vec3i(4, 0, 4), Vec3i(20, 8, 8)}}, 1, 1)};
  write_enzo(folder_, mesh);
  expect_mesh(read_mesh(folder_), mesh);
}

TEST_F(Enzo, TakesPathsOfOtherMachinesForNamesInItsOwnFolder) {
  const MeshDescription mesh = mesh_of_blocks({"Density"});
  for (const char* baked : {"/scratch/of/another/machine/DD0001/", "", "../../"}) {
    write_enzo(folder_, mesh, {.baked = baked});
    expect_mesh(read_mesh(folder_), mesh);
  }
}

TEST_F(Enzo, DrawsTwoDimensionsAsASlab) {
  const MeshDescription mesh = mesh_of_blocks({"Density"}, 2);
  for (const bool ghosts : {false, true}) {
    write_enzo(folder_, mesh, {.ghosts = ghosts});
    expect_mesh(read_mesh(folder_), mesh);
  }
}

TEST_F(Enzo, SaysTheUnitOfStoredValuesAlone) {
  write_enzo(folder_, mesh_of_blocks(kFields));
  const std::string lines = bytes_of_file(folder_ / "run");
  EXPECT_EQ(read_mesh(folder_).units, std::vector<std::string>(kFields.size()));
  write_bytes(folder_ / "run", lines + "DataUnits[0] = g/cm^3\n#DataCGSConversionFactor[0] = 1\nDataUnits[1] = none\n");
  EXPECT_EQ(read_mesh(folder_).units[0], "g/cm^3");
  EXPECT_EQ(read_mesh(folder_).units[1], "");
  write_bytes(folder_ / "run", lines + "DataUnits[0] = g/cm^3\n#DataCGSConversionFactor[0] = 1.67e-24\n");
  EXPECT_EQ(read_mesh(folder_).units[0], "") << "what is stored has another unit";
}

TEST_F(Enzo, ReadsOnlyTheFieldAskedFor) {
  write_enzo(folder_, mesh_of_blocks(kFields));
  EXPECT_EQ(read_mesh(folder_).fields, kFields);
  const MeshDescription mesh = read_mesh(folder_, {"x-velocity"});
  ASSERT_EQ(mesh.levels[1][2].values.size(), 1U);
  EXPECT_EQ(mesh.levels[1][2].values[0].doubles(), mesh_of_blocks(kFields).levels[1][2].values[1].doubles());
  EXPECT_THAT(message_of<UsageError>([&] { read_mesh(folder_, {"density"}); }), HasSubstr("did you mean 'Density'?"));
}

TEST_F(Enzo, NamesFileLineAndFaultOfBadInput) {
  struct BadCase {
    const char* file;
    std::string from, to;
    std::vector<std::string> message;
  };
  const std::vector<BadCase> cases{
      {"run",
       "VersionNumber              = 2.600000",
       "VersionNumber = 3.0;",
       {"run, line", "version 3 of Enzo; versions 1 and 2"}},
      {"run", "TopGridRank = 3", "TopGridRank = 1", {"run, line 2", "1-dimensional"}},
      {"run", "Coordinate = 0", "Coordinate = 1", {"run, line", "spherical"}},
      {"run", "Coordinate = 0", "Coordinate = 2", {"run, line", "cylindrical"}},
      {"run", "RefineBy = 2", "RefineBy = 1", {"run, line 4", "2 to 65536"}},
      {"run", "TopGridDimensions   = 8 2", "TopGridDimensions   = 8 -2", {"run, line 3"}},
      {"run", "TopGridDimensions   = 8 2 2", "TopGridDimensions   = 8", {"run, line 3", "3 whole numbers"}},
      {"run", "TopGridDimensions", "TopGrid", {"run: no line TopGridDimensions"}},
      {"run", "DomainRightEdge        = 3", "DomainRightEdge        = 4", {"grid 1 of level 0: its edges"}},
      {"run.hierarchy", "GridRank = 3", "GridRank = 1", {"run.hierarchy, line 4", "1-dimensional"}},
      {"run.hierarchy", "Grid = 2", "Grid = 7", {"run.hierarchy, line", "grid 2 is expected"}},
      {"run.hierarchy",
       "GridEndIndex      = 6",
       "GridEndIndex      = 60",
       {"grid 1: its cells from 3 to 60 along x do not lie in its 10"}},
      {"run.hierarchy", "GridEndIndex      = 6", "GridEndIndex      = 5", {"grid 1 of level 0: its edges"}},
      {"run.hierarchy", "GridLeftEdge      = -1", "GridLeftEdge      = -9", {"grid 1 of level 0: its edges"}},
      {"run.hierarchy", "GridLeftEdge      = -1", "GridLeftEdge      = nan", {"run.hierarchy, line 8", "finite"}},
      {"run.hierarchy", "GridLeftEdge", "GridLeft", {"grid 1: no line GridLeftEdge"}},
      {"run.hierarchy", "NumberOfBaryonFields = 3", "NumberOfBaryonFields = 0", {"grid 1: it has no baryon fields"}},
      {"run.hierarchy", "BaryonFileName = ./DD0001/run.cpu0000", "BaryonFileName = ./DD0001/", {"the name of a file"}},
      {"run.hierarchy", "BaryonFileName = ./DD0001/run.cpu0000", "BaryonFileName = nothing.cpu", {"nothing.cpu: no such file"}},
      {"run.hierarchy", "BaryonFileName = ./DD0001/run.cpu0000", "BaryonFileName = run", {"run: cannot be opened as HDF5"}},
      {"run.hierarchy", "BaryonFileName = ./DD0001/run.cpu0000", "BaryonFileName = run.cpu0001", {"run.cpu0001: Grid00000001"}},
      {"run.hierarchy",
       "Grid[1]->NextGridThisLevel = 2",
       "Grid[1]->NextGridThisLevel = 99",
       {"points at grid 99, but there are 18"}},
      {"run.hierarchy",
       "Grid[1]->NextGridThisLevel = 2",
       "Grid[1]->NextGridThisLevel = 1",
       {"grid 1 is pointed at more than once"}},
      {"run.hierarchy", "Grid[1]->NextGridThisLevel = 2", "Grid[1]->NextGridThisLevel = 0", {"1 of 18 grids cannot be reached"}},
      {"run.hierarchy", "Grid[1]->NextGridThisLevel", "Grid[1]->Next", {"NextGridThisLevel or NextGridNextLevel is expected"}},
  };
  for (const BadCase& bad : cases) {
    SCOPED_TRACE(bad.to);
    write_enzo(folder_, mesh_of_blocks(kFields));
    edit(bad.file, bad.from, bad.to);
    for (const std::string& part : bad.message) EXPECT_THAT(refusal(), HasSubstr(part));
  }
}

TEST_F(Enzo, RefusesGridsOfOtherShapes) {
  write_enzo(folder_, mesh_of_blocks(kFields));
  {
    Hdf5Writer out(folder_ / "run.cpu0000");
    out.numbers("Grid00000001/Density", {2, 4, 2}, std::vector<double>(16));
  }
  EXPECT_THAT(refusal(), HasSubstr("run.cpu0000: Grid00000001/Density: extents (2, 4, 2); the hierarchy says 2 x 2 x 4 cells"));
}

TEST_F(Enzo, SaysWhichFilesToName) {
  write_enzo(folder_, mesh_of_blocks({"Density"}));
  EXPECT_THAT(message_of([&] { read_mesh(folder_ / "run.cpu0000"); }), HasSubstr("name its parameter file or its folder"));
  fs::copy_file(folder_ / "run.hierarchy", folder_ / "other.hierarchy");
  EXPECT_THAT(refusal(), HasSubstr("2 outputs of Enzo: other, run; name one of these files"));
  fs::remove(folder_ / "run.hierarchy");
  EXPECT_THAT(message_of([&] { read_mesh(folder_ / "run"); }), HasSubstr("run.hierarchy: no such file"));
}

TEST_F(Enzo, RefusesFilesThatAreCut) {
  for (const char* file : {"run", "run.hierarchy", "run.cpu0001"}) {
    write_enzo(folder_, mesh_of_blocks({"Density"}));
    const std::string whole = bytes_of_file(folder_ / file);
    const std::string hash = AmrHierarchy(read_mesh(folder_)).content_hash(0);
    for (std::size_t i = 0; i < 61; ++i) {
      write_bytes(folder_ / file, std::string_view(whole).substr(0, i * whole.size() / 61));
      try {
        // a hierarchy or a parameter file that ends between two lines may still be whole
        AmrHierarchy(read_mesh(folder_)).content_hash(0);
      } catch (const Error& refused) {
        EXPECT_THAT(refused.what(), HasSubstr(folder_.filename().string())) << i;
      }
    }
  }
}

}  // namespace
}  // namespace amrtex
