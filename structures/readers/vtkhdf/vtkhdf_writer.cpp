#include "structures/readers/vtkhdf/vtkhdf_writer.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "structures/mesh/quoted.hpp"
#include "structures/mesh/unfinished_folder.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

/// An object of the HDF5 library, closed with this one.
class Handle {
 public:
  Handle(hid_t id, herr_t (*closer)(hid_t)) : id_(id), closer_(closer) {}
  ~Handle() {
    if (id_ >= 0) closer_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  hid_t operator*() const { return id_; }

  /// Closes and tells whether that went well: a file is complete only then.
  bool close() { return closer_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_;
  herr_t (*closer_)(hid_t);
};

/// The library prints its errors unless it is told not to.
class Silence {
 public:
  Silence() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Silence() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

class VtkhdfFile {
 public:
  VtkhdfFile(const fs::path& file, const fs::path& target)
      : target_(target), file_(H5Fcreate(file.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT), H5Fclose) {
    require(*file_ >= 0, "the file");
  }

  void write(const AmrHierarchy& mesh) {
    const Handle root = make_group(*file_, "VTKHDF");
    write_numbers(*root, "Version", H5T_NATIVE_INT64, std::array<std::int64_t, 2>{1, 0});
    write_text(*root, "Type", "OverlappingAMR");
    const Vec3d lower = mesh.domain_lower();
    write_numbers(*root, "Origin", H5T_NATIVE_DOUBLE, std::array{lower.x, lower.y, lower.z});
    write_text(*root, "GridDescription", "XYZ");
    for (int level = 0; level < mesh.level_count(); ++level) write_level(*root, mesh, level);
    require(file_.close(), "the file");
  }

 private:
  void require(bool well, std::string_view what) const {
    if (!well) throw Error(fmt::format("{}: {} cannot be written", target_.string(), what));
  }

  Handle make_group(hid_t parent, const std::string& name) const {
    const hid_t id = H5Gcreate2(parent, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    require(id >= 0, name);
    return {id, H5Gclose};
  }

  template <class T, std::size_t n>
  void write_numbers(hid_t object, const char* name, hid_t type, const std::array<T, n>& numbers) const {
    const hsize_t count = n;
    const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
    const Handle attribute(H5Acreate2(object, name, type, *space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    require(*attribute >= 0 && H5Awrite(*attribute, type, numbers.data()) >= 0, name);
  }

  /// VTK wants texts of fixed length in ASCII.
  void write_text(hid_t object, const char* name, const std::string& text) const {
    const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(*type, text.size());
    H5Tset_strpad(*type, H5T_STR_NULLPAD);
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    const Handle attribute(H5Acreate2(object, name, *type, *space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    require(*attribute >= 0 && H5Awrite(*attribute, *type, text.c_str()) >= 0, name);
  }

  void write_level(hid_t root, const AmrHierarchy& mesh, int level) const {
    const Handle group = make_group(root, fmt::format("Level{}", level));
    const Vec3d spacing = mesh.spacing(level);
    write_numbers(*group, "Spacing", H5T_NATIVE_DOUBLE, std::array{spacing.x, spacing.y, spacing.z});
    write_boxes(*group, mesh, level);
    for (const char* other : {"PointData", "FieldData"}) make_group(*group, other);
    const Handle cells = make_group(*group, "CellData");
    for (std::size_t field = 0; field < mesh.fields().size(); ++field) write_field(*cells, mesh, level, field);
  }

  /// Both corners inclusive, axis after axis.
  void write_boxes(hid_t group, const AmrHierarchy& mesh, int level) const {
    std::vector<std::int32_t> boxes;
    for (const Patch& patch : mesh.patches(level))
      for (int axis = 0; axis < 3; ++axis) boxes.insert(boxes.end(), {patch.box.lower[axis], patch.box.upper[axis] - 1});
    const std::array<hsize_t, 2> shape = {mesh.patches(level).size(), 6};
    const Handle space(H5Screate_simple(2, shape.data(), nullptr), H5Sclose);
    const Handle data(H5Dcreate2(group, "AMRBox", H5T_NATIVE_INT32, *space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
    require(*data >= 0 && (boxes.empty() || H5Dwrite(*data, H5T_NATIVE_INT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, boxes.data()) >= 0),
            "AMRBox");
  }

  /// The values of all patches, one after the other.
  void write_field(hid_t group, const AmrHierarchy& mesh, int level, std::size_t field) const {
    const std::string& name = mesh.fields()[field];
    const hsize_t total = static_cast<hsize_t>(mesh.stored_cells(level));
    const Handle space(H5Screate_simple(1, &total, nullptr), H5Sclose);
    const Handle data(H5Dcreate2(group, name.c_str(), H5T_NATIVE_DOUBLE, *space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                      H5Dclose);
    require(*data >= 0, quote(name));
    hsize_t at = 0;
    for (const Patch& patch : mesh.patches(level)) {
      const std::vector<double> values = patch.values[field].doubles();
      const hsize_t count = values.size();
      const Handle part(H5Screate_simple(1, &count, nullptr), H5Sclose);
      H5Sselect_hyperslab(*space, H5S_SELECT_SET, &at, nullptr, &count, nullptr);
      require(H5Dwrite(*data, H5T_NATIVE_DOUBLE, *part, *space, H5P_DEFAULT, values.data()) >= 0, quote(name));
      at += count;
    }
  }

  fs::path target_;
  Handle file_;
};

/// Names become names of data sets, in which '/' makes folders.
void check_field_names(const AmrHierarchy& mesh, const fs::path& target) {
  for (const std::string& name : mesh.fields())
    if (name.empty() || name == "." || name.find('/') != std::string::npos || name.find('\0') != std::string::npos)
      throw UnsupportedError(fmt::format("{}: the field name {} cannot be that of a data set", target.string(), quote(name)));
}

}  // namespace

void write_vtkhdf(const AmrHierarchy& mesh, const fs::path& path) {
  const fs::path target = without_slash(path);
  check_field_names(mesh, target);
  refuse_existing(target);
  UnfinishedFolder folder(target);
  const std::string name = target.filename().string();
  const Silence silence;
  VtkhdfFile(folder.path() / name, target).write(mesh);
  folder.publish_files({name});
}

}  // namespace amrtex
