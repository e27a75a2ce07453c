// Data sets written in several formats: what is read back, and what is left behind where that fails.
#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "structures/generators/random_mesh.hpp"
#include "structures/mesh/json.hpp"
#include "structures/mesh/npz_file.hpp"
#include "structures/mesh/unfinished_folder.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/npz_mesh/npz_mesh.hpp"
#include "structures/readers/vtkhdf/vtkhdf_writer.hpp"
#include "structures/readers/write_mesh.hpp"
#include "tests/reader_files.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class Convert : public FolderTest {};

void expect_same(const AmrHierarchy& a, const AmrHierarchy& b, const std::string& what) {
  ASSERT_EQ(a.fields().size(), b.fields().size()) << what;
  EXPECT_EQ(a.leaf_cells(), b.leaf_cells()) << what;
  for (int field = 0; field < static_cast<int>(a.fields().size()); ++field) {
    EXPECT_EQ(a.content_hash(field), b.content_hash(field)) << what;
    EXPECT_EQ(a.statistics(field).cells_without_value, b.statistics(field).cells_without_value) << what;
  }
}

TEST_F(Convert, EachFormatThatIsReadGivesTheMeshBack) {
  const auto go_round = [&](const AmrHierarchy& mesh, const std::string& what, bool two) {
    for (const char* name : {"m", "m.npz", "m.vtkhdf", "m.cells"}) {
      if (!two && name == std::string("m.cells")) continue;
      const fs::path folder = at(what);
      fs::create_directory(folder);
      write_mesh(mesh, folder / name);
      expect_same(mesh, AmrHierarchy(read_mesh(folder / name)), fmt::format("{}, {}", what, name));
    }
  };
  go_round(nested(waves).hierarchy(), "nested", true);
  go_round(nested(waves, {3, 2}).hierarchy(), "ratio 3", false);
  go_round(jump_of_two(waves).hierarchy(), "jump", true);
  go_round(holes_and_missing(waves).hierarchy(), "holes", true);
  go_round(fields_with_gaps().hierarchy(), "two fields", true);
  go_round(hole_of_single_cells(waves).hierarchy(), "single cells", true);
  RandomMeshOptions options;
  options.fields = 2;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
    go_round(AmrHierarchy(random_mesh(seed, options)), fmt::format("seed {}", seed), false);
}

TEST_F(Convert, NpzKeepsTheWorldTheLevelsAndTheNames) {
  const AmrHierarchy mesh = fields_with_gaps().hierarchy();
  write_npz_mesh(mesh, at("m.npz"));
  const AmrHierarchy back(read_mesh(at("m.npz")));
  EXPECT_EQ(back.fields(), mesh.fields());
  EXPECT_EQ(back.domain_lower(), mesh.domain_lower());
  EXPECT_EQ(back.domain_upper(), mesh.domain_upper());
  EXPECT_EQ(back.level_count(), mesh.level_count());
  EXPECT_EQ(AmrHierarchy(read_mesh(at("m.npz"), {"g"})).content_hash(0), mesh.content_hash(1));
  const auto arrays = read_npz(at("m.npz"));
  EXPECT_EQ(arrays.at("boxes").shape, (std::vector<std::int64_t>{2, 2, 3}));
  EXPECT_EQ(arrays.at("leaf").shape.front(), mesh.stored_cells());
}

TEST_F(Convert, BadArraysOfNumPyAreRefused) {
  write_npz_mesh(nested(waves).hierarchy(), at("m.npz"));
  const auto good = read_npz(at("m.npz"));
  const auto refusal = [&](const std::string& name, const NpyArray& array) {
    auto arrays = good;
    arrays[name] = array;
    write_npz(at("bad.npz"), arrays);
    return message_of([&] { AmrHierarchy(read_mesh(at("bad.npz"))).content_hash(0); });
  };
  EXPECT_THAT(refusal("levels", {"<f8", {3}, std::string(24, '\0')}),
              AllOf(HasSubstr("bad.npz"), HasSubstr("levels"), HasSubstr("<i4")));
  EXPECT_THAT(refusal("levels", {"<i4", {3}, std::string(12, '\1')}), HasSubstr("there are 3 levels"));
  EXPECT_THAT(refusal("boxes", {"<i4", {3, 6}, std::string(72, '\0')}), AllOf(HasSubstr("(3, 6)"), HasSubstr("(3, 2, 3)")));
  EXPECT_THAT(refusal("boxes", {"<i4", {3, 2, 3}, std::string(72, '\xff')}), HasSubstr("a corner of a box is -1"));
  EXPECT_THAT(refusal("boxes", {"<i4", {3, 2, 3}, std::string(72, '\0')}), HasSubstr("the boxes hold 0 cells"));
  EXPECT_THAT(refusal("leaf", {"|u1", {1}, "\1"}), HasSubstr("values"));
  EXPECT_THAT(refusal("ratios", {"<i4", {2}, std::string(8, '\0')}), HasSubstr("ratio"));
  EXPECT_THAT(refusal("domain", {"<f8", {2, 3}, std::string(48, '\0')}), HasSubstr("corners"));
  write("none.npz", "PK\x03\x04 and nothing");
  EXPECT_THAT(message_of([&] { read_mesh(at("none.npz")); }), HasSubstr("none.npz"));
  write_npz(at("other.npz"), {{"picture", {"<f4", {1}, std::string(4, '\0')}}});
  EXPECT_THAT(message_of([&] { read_mesh(at("other.npz")); }), HasSubstr("no array 'ratios'; it is no mesh"));
}

TEST_F(Convert, CutArraysOfNumPyAreRefused) {
  write_npz_mesh(nested(waves).hierarchy(), at("m.npz"));
  const std::string bytes = bytes_of_file(at("m.npz"));
  for (std::size_t cut = 0; cut < bytes.size(); cut += 7) {
    write("m.npz", std::string_view(bytes).substr(0, cut));
    EXPECT_THAT(message_of([&] { read_mesh(at("m.npz")); }), HasSubstr("m.npz")) << cut;
  }
}

// ---- VTKHDF ----

/// What the HDF5 library finds in a file.
class Hdf5Answers {
 public:
  explicit Hdf5Answers(const fs::path& path) : file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT)) {}
  ~Hdf5Answers() { H5Fclose(file_); }
  Hdf5Answers(const Hdf5Answers&) = delete;
  Hdf5Answers& operator=(const Hdf5Answers&) = delete;

  template <class T>
  std::vector<T> attribute(const char* object, const char* name, hid_t type) const {
    const hid_t id = H5Aopen_by_name(file_, object, name, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t space = H5Aget_space(id);
    std::vector<T> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    EXPECT_GE(H5Aread(id, type, values.data()), 0);
    H5Sclose(space);
    H5Aclose(id);
    return values;
  }
  std::string text(const char* object, const char* name) const {
    const hid_t id = H5Aopen_by_name(file_, object, name, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t type = H5Aget_type(id);
    EXPECT_EQ(H5Tget_cset(type), H5T_CSET_ASCII);
    EXPECT_EQ(H5Tis_variable_str(type), 0) << "VTK reads texts of fixed length";
    std::string value(H5Tget_size(type), '\0');
    EXPECT_GE(H5Aread(id, type, value.data()), 0);
    H5Tclose(type);
    H5Aclose(id);
    return value;
  }
  template <class T>
  std::vector<T> values(const std::string& name, hid_t type, std::vector<hsize_t>& shape) const {
    const hid_t id = H5Dopen2(file_, name.c_str(), H5P_DEFAULT);
    const hid_t space = H5Dget_space(id);
    shape.resize(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, shape.data(), nullptr);
    std::vector<T> found(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    EXPECT_GE(H5Dread(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, found.data()), 0);
    H5Sclose(space);
    H5Dclose(id);
    return found;
  }

 private:
  hid_t file_;
};

TEST_F(Convert, VtkhdfHoldsWhatItsSpecificationAsksFor) {
  const AmrHierarchy mesh = nested(waves, {4, 2}).hierarchy();
  write_vtkhdf(mesh, at("m.vtkhdf"));
  const Hdf5Answers file(at("m.vtkhdf"));
  EXPECT_EQ(file.text("/VTKHDF", "Type"), "OverlappingAMR");
  EXPECT_EQ(file.text("/VTKHDF", "GridDescription"), "XYZ");
  EXPECT_THAT(file.attribute<std::int64_t>("/VTKHDF", "Version", H5T_NATIVE_INT64), ElementsAre(1, 0));
  EXPECT_THAT(file.attribute<double>("/VTKHDF", "Origin", H5T_NATIVE_DOUBLE), ElementsAre(0, 0, 0));
  for (int level = 0; level < mesh.level_count(); ++level) {
    const std::string group = fmt::format("/VTKHDF/Level{}", level);
    const Vec3d h = mesh.spacing(level);
    EXPECT_THAT(file.attribute<double>(group.c_str(), "Spacing", H5T_NATIVE_DOUBLE), ElementsAre(h.x, h.y, h.z));
    std::vector<hsize_t> shape;
    const auto boxes = file.values<int>(group + "/AMRBox", H5T_NATIVE_INT, shape);
    ASSERT_EQ(shape, (std::vector<hsize_t>{mesh.patches(level).size(), 6}));
    const auto values = file.values<double>(group + "/CellData/f", H5T_NATIVE_DOUBLE, shape);
    ASSERT_EQ(shape, std::vector<hsize_t>{static_cast<hsize_t>(mesh.stored_cells(level))});
    std::size_t at = 0;
    for (std::size_t k = 0; k < mesh.patches(level).size(); ++k) {
      const Patch& patch = mesh.patches(level)[k];
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(boxes[6 * k + static_cast<std::size_t>(2 * axis)], patch.box.lower[axis]);
        EXPECT_EQ(boxes[6 * k + static_cast<std::size_t>(2 * axis) + 1], patch.box.upper[axis] - 1);
      }
      for (const double v : patch.values[0]) EXPECT_EQ(values[at++], v);
    }
  }
}

/// Runs a script in a Python that has the module; 77 where none has.
int run_python(const std::vector<const char*>& pythons, const fs::path& script, const fs::path& data) {
  int code = 77;
  for (const char* python : pythons) {
    code = WEXITSTATUS(
        std::system(fmt::format("{} '{}' '{}' > '{}.log' 2>&1", python, script.string(), data.string(), data.string()).c_str()));
    if (code == 127) code = 77;
    if (code != 77) break;
  }
  return code;
}

TEST_F(Convert, H5pyReadsVtkhdf) {
  const AmrHierarchy mesh = nested(waves).hierarchy();
  write_vtkhdf(mesh, at("m.vtkhdf"));
  write("check.py", fmt::format(R"(
import sys
try:
    import h5py
except ImportError:
    sys.exit(77)
root = h5py.File(sys.argv[1], 'r')['VTKHDF']
assert root.attrs['Type'] == b'OverlappingAMR', root.attrs['Type']
assert sorted(k for k in root if k.startswith('Level')) == ['Level0', 'Level1', 'Level2']
total = sum(float(root['Level%d/CellData/f' % l][...].sum()) for l in range(3))
expected = {}
assert abs(total - expected) <= 1e-12 * abs(expected), (total, expected)
)",
                                [&] {
                                  double total = 0;
                                  for (int level = 0; level < mesh.level_count(); ++level)
                                    for (const Patch& patch : mesh.patches(level))
                                      for (const double v : patch.values[0]) total += v;
                                  return total;
                                }()));
  const int code = run_python({"python3", "/usr/bin/python3"}, at("check.py"), at("m.vtkhdf"));
  if (code == 77) GTEST_SKIP() << "no python3 here can import h5py (Debian: python3-h5py)";
  EXPECT_EQ(code, 0) << bytes_of_file(at("m.vtkhdf.log"));
}

TEST_F(Convert, ParaViewReadsVtkhdf) {
  const AmrHierarchy mesh = nested(waves).hierarchy();
  write_vtkhdf(mesh, at("m.vtkhdf"));
  write("check.py", fmt::format(R"(
import sys
try:
    from paraview.simple import VTKHDFReader
except ImportError:
    sys.exit(77)
reader = VTKHDFReader(FileName=sys.argv[1])
reader.UpdatePipeline()
data = reader.GetClientSideObject().GetOutputDataObject(0)  # of ParaView 5.11 servermanager.Fetch() loses an AMR's grids
assert data.GetClassName() == 'vtkOverlappingAMR', data.GetClassName()
assert data.GetNumberOfLevels() == 3, data.GetNumberOfLevels()
grid = data.GetDataSet(0, 0) if hasattr(data, 'GetDataSet') else data.GetUniformGrid(0, 0)
assert grid.GetCellData().GetArray('f').GetNumberOfTuples() == {}
)",
                                mesh.stored_cells(0)));
  const int code = run_python({"pvpython"}, at("check.py"), at("m.vtkhdf"));
  if (code == 77) GTEST_SKIP() << "no pvpython here (Debian: paraview)";
  EXPECT_EQ(code, 0) << bytes_of_file(at("m.vtkhdf.log"));
}

// ---- formats ----

TEST_F(Convert, TheEndingOrTheFormatSaysWhatIsWritten) {
  const AmrHierarchy mesh = nested(waves).hierarchy();
  write_mesh(mesh, at("a.vtkhdf"));
  EXPECT_GT(H5Fis_hdf5(at("a.vtkhdf").c_str()), 0);
  write_mesh(mesh, at("folder.2"));
  EXPECT_TRUE(fs::exists(at("folder.2") / "Header"));
  write_mesh(mesh, at("b.cells"), "npz");
  EXPECT_EQ(bytes_of_file(at("b.cells")).substr(0, 2), "PK");
  write_mesh(mesh, at("c"), "exabrick");
  EXPECT_EQ(AmrHierarchy(read_mesh(at("c"))).content_hash(0), mesh.content_hash(0));
  EXPECT_THAT(message_of([&] { write_mesh(mesh, at("d"), "vtk"); }),
              AllOf(HasSubstr("no format 'vtk'"), HasSubstr("vtkhdf (.vtkhdf)")));
  EXPECT_THAT(message_of([&] { write_mesh(mesh, at("d.h5")); }), AllOf(HasSubstr("d.h5"), HasSubstr("are not written")));
}

TEST_F(Convert, NothingIsReplacedAndNothingIsLeftBehind) {
  const AmrHierarchy mesh = nested(waves).hierarchy();
  for (const char* name : {"m", "m.npz", "m.cells", "m.vtkhdf"}) {
    write(name, "taken");
    EXPECT_THAT(message_of([&] { write_mesh(mesh, at(name)); }), AllOf(HasSubstr(name), HasSubstr("exists already")));
    EXPECT_EQ(bytes_of_file(at(name)), "taken");
    EXPECT_THAT(message_of([&] { write_mesh(mesh, at("no") / name); }), HasSubstr("no"));
  }
  MeshDescription unnameable = nested(waves).description();
  unnameable.fields = {"a/b\n"};
  const AmrHierarchy refused(std::move(unnameable));
  for (const char* name : {"r", "r.npz", "r.vtkhdf"})
    EXPECT_THAT(message_of([&] { write_mesh(refused, at(name)); }), HasSubstr("field name"));
  EXPECT_THAT(names(), ElementsAre("m", "m.cells", "m.npz", "m.vtkhdf"));
}

TEST_F(Convert, LeftOversOfKilledRunsAreRemovedByTheNext) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const UnfinishedFolder folder(at("m"));
    std::ofstream(folder.path() / "part") << "half";
    static_cast<void>(!::write(ready[1], "x", 1));
    ::pause();
    ::_exit(0);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  const AmrHierarchy mesh = nested(waves).hierarchy();
  write_mesh(mesh, at("other.npz"));
  EXPECT_EQ(names().size(), 2U) << "the folder of a process that lives stays";
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  write_mesh(mesh, at("another.npz"));
  EXPECT_THAT(names(), ElementsAre("another.npz", "other.npz"));
  ::close(ready[0]);
  ::close(ready[1]);
}

TEST_F(Convert, FilesAreGivenTheirNamesTogether) {
  {
    UnfinishedFolder folder(at("m.cells"));
    write("b", "taken");
    for (const char* name : {"a", "b"}) std::ofstream(folder.path() / name) << "new";
    EXPECT_THAT(message_of([&] { folder.publish_files({"a", "b"}); }), HasSubstr("exists already"));
    EXPECT_THAT(message_of([&] { folder.publish_files({"a", "none"}); }), HasSubstr("none"));
  }
  EXPECT_THAT(names(), ElementsAre("b"));
}

}  // namespace
}  // namespace amrtex
