#include "structures/readers/vtkhdf/vtkhdf_reader.hpp"

#include "structures/readers/hdf5_test_tools.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/vtkhdf/vtkhdf_writer.hpp"

namespace amrtex {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;

struct VtkOptions {
  int version = 2;
  const char* type = "OverlappingAMR";
  const char* axes = "XYZ";
  Vec3i corner{0};  ///< of the domain, in cells of level 0 from the origin on
  hid_t reals = H5T_IEEE_F32LE;
  Packing packing = Packing::contiguous;
};

/// As VTK writes it: with ghost flags and vectors beside the fields.
void write_vtk(const std::filesystem::path& path, const MeshDescription& mesh, const VtkOptions& options = {}) {
  Hdf5Writer out(path);
  out.group("VTKHDF");
  out.attribute("VTKHDF", "Version", std::vector<int>{options.version, 2});
  out.attribute("VTKHDF", "Type", options.type);
  out.attribute("VTKHDF", "GridDescription", options.axes);
  Vec3d spacing = (mesh.domain_upper - mesh.domain_lower) / Vec3d(mesh.root_cells);
  const Vec3d origin = mesh.domain_lower - Vec3d(options.corner) * spacing;
  out.attribute("VTKHDF", "Origin", std::vector<double>{origin.x, origin.y, origin.z});
  Vec3i corner = options.corner;
  for (std::size_t l = 0; l < mesh.levels.size(); ++l) {
    const std::string group = fmt::format("VTKHDF/Level{}", l);
    out.group(group);
    out.attribute(group, "Spacing", std::vector<double>{spacing.x, spacing.y, spacing.z});
    std::vector<std::int64_t> boxes;
    std::vector<std::vector<double>> values(mesh.fields.size());
    std::size_t cells = 0;
    for (const Patch& patch : mesh.levels[l]) {
      for (int axis = 0; axis < 3; ++axis)
        boxes.insert(boxes.end(), {patch.box.lower[axis] + corner[axis], patch.box.upper[axis] + corner[axis] - 1});
      for (std::size_t f = 0; f < values.size(); ++f)
        for (const double v : patch.values[f]) values[f].push_back(v);
      cells += patch.values[0].size();
    }
    out.integers(group + "/AMRBox", {mesh.levels[l].size(), 6}, boxes, H5T_NATIVE_INT);
    for (std::size_t f = 0; f < values.size(); ++f)
      out.numbers(group + "/CellData/" + mesh.fields[f], {cells}, values[f], options.reals, options.packing);
    out.integers(group + "/CellData/vtkGhostType", {cells}, std::vector<std::int64_t>(cells, 8), H5T_NATIVE_UCHAR);
    out.numbers(group + "/CellData/velocity", {cells, 3}, std::vector<double>(3 * cells), options.reals);
    if (l < mesh.ratios.size()) {
      spacing /= mesh.ratios[l];
      corner *= mesh.ratios[l];
    }
  }
}

class Vtkhdf : public FolderTest {
 protected:
  std::filesystem::path file() const { return folder_ / "m.vtkhdf"; }
  std::string refusal() const {
    return message_of([&] { AmrHierarchy(read_mesh(file())).content_hash(0); });
  }
};

TEST_F(Vtkhdf, GivesTheMeshInAnyPackingAndAnywhere) {
  const MeshDescription mesh = mesh_of_blocks({"density", "heat"});
  for (const Packing packing : {Packing::contiguous, Packing::chunked, Packing::deflate})
    for (const Vec3i& corner : {Vec3i(0), Vec3i(-3, 5, 0)}) {
      write_vtk(file(), mesh, {.corner = corner, .packing = packing});
      expect_mesh(read_mesh(file()), mesh);
    }
}

TEST_F(Vtkhdf, ReadsTheWantedFieldInItsType) {
  write_vtk(file(), mesh_of_blocks({"density", "heat"}));
  const MeshDescription one = read_mesh(file(), FieldChoice::first());
  EXPECT_EQ(one.fields, std::vector<std::string>{"density"});
  EXPECT_EQ(one.fields_there, (std::vector<std::string>{"density", "heat"}));
  EXPECT_EQ(one.levels[0][0].values.size(), 1U);
  EXPECT_EQ(one.levels[0][0].values[0].type(), RealType::float32);
  write_vtk(file(), mesh_of_blocks({"density", "heat"}), {.reals = H5T_IEEE_F64BE});
  EXPECT_EQ(read_mesh(file(), {"heat"}).levels[0][0].values[0].type(), RealType::float64);
  EXPECT_THAT(message_of<UsageError>([&] { read_mesh(file(), {"densty"}); }), AllOf(HasSubstr("'densty'"), HasSubstr("density")));
}

TEST_F(Vtkhdf, WrittenHereIsReadHere) {
  const AmrHierarchy mesh(mesh_of_blocks({"a"}));
  write_vtkhdf(mesh, file());
  const AmrHierarchy back(read_mesh(file()));
  EXPECT_EQ(back.content_hash(0), mesh.content_hash(0));
  EXPECT_EQ(back.domain_lower(), mesh.domain_lower());
}

TEST_F(Vtkhdf, OtherKindsAreRefusedWithTheReason) {
  const MeshDescription mesh = mesh_of_blocks({"a"});
  write_vtk(file(), mesh, {.version = 3});
  EXPECT_THAT(refusal(), AllOf(HasSubstr("m.vtkhdf"), HasSubstr("version is 3; 1 and 2")));
  write_vtk(file(), mesh, {.type = "UnstructuredGrid"});
  EXPECT_THAT(refusal(), AllOf(HasSubstr("'UnstructuredGrid'"), HasSubstr("OverlappingAMR")));
  write_vtk(file(), mesh, {.axes = "XY"});
  EXPECT_THAT(refusal(), AllOf(HasSubstr("'XY'"), HasSubstr("XYZ")));
  MeshDescription shorter = mesh;
  shorter.levels[1][0].box.upper.x += 1;
  write_vtk(file(), shorter);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("Level1/CellData/a"), HasSubstr("its boxes hold")));
}

TEST_F(Vtkhdf, CutFilesAreRefused) {
  write_vtk(file(), mesh_of_blocks({"a"}));
  expect_cuts_to_be_refused(file(), 40, [&] { return read_mesh(file()); });
}

}  // namespace
}  // namespace amrtex
