// What tests of the HDF5 readers share: files written with the library, a mesh that every format holds.
#pragma once

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"
#include "tests/reader_files.hpp"

namespace amrtex::test {

enum class Packing { contiguous, chunked, deflate };

/// Writes an HDF5 file; a step that fails fails the test. Groups above an object are made.
class Hdf5Writer {
 public:
  explicit Hdf5Writer(const std::filesystem::path& path)
      : file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)), making_groups_(H5Pcreate(H5P_LINK_CREATE)) {
    EXPECT_GE(file_, 0) << path;
    H5Pset_create_intermediate_group(making_groups_, 1);
  }
  ~Hdf5Writer() {
    H5Pclose(making_groups_);
    H5Fclose(file_);
  }
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  hid_t file() const { return file_; }

  void group(const std::string& name) {
    H5Gclose(check(H5Gcreate2(file_, name.c_str(), making_groups_, H5P_DEFAULT, H5P_DEFAULT)));
  }

  void attribute(const std::string& object, const std::string& name, int value) {
    write_attribute(object, name, H5T_NATIVE_INT, {}, &value);
  }
  void attribute(const std::string& object, const std::string& name, double value) {
    write_attribute(object, name, H5T_NATIVE_DOUBLE, {}, &value);
  }
  void attribute(const std::string& object, const std::string& name, const std::vector<int>& values) {
    write_attribute(object, name, H5T_NATIVE_INT, {values.size()}, values.data());
  }
  void attribute(const std::string& object, const std::string& name, const std::vector<double>& values) {
    write_attribute(object, name, H5T_NATIVE_DOUBLE, {values.size()}, values.data());
  }
  void attribute(const std::string& object, const std::string& name, const char* value) {
    const hid_t type = text_type(std::string_view(value).size() + 1);
    write_attribute(object, name, type, {}, value);
    H5Tclose(type);
  }
  void variable_text_attribute(const std::string& object, const std::string& name, const char* value) {
    const hid_t type = text_type(H5T_VARIABLE);
    write_attribute(object, name, type, {}, &value);
    H5Tclose(type);
  }
  void record_attribute(const std::string& object, const std::string& name, const std::vector<std::string>& members,
                        const std::vector<int>& values) {
    const hid_t type = record_type(members);
    write_attribute(object, name, type, {}, values.data());
    H5Tclose(type);
  }

  void numbers(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<double>& values,
               hid_t type = H5T_NATIVE_DOUBLE, Packing packing = Packing::contiguous) {
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    if (packing != Packing::contiguous) {
      std::vector<hsize_t> chunk(shape);
      chunk.front() = (chunk.front() + 1) / 2;
      H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
      if (packing == Packing::deflate) H5Pset_deflate(creation, 4);
    }
    write_set(name, type, shape, creation, H5T_NATIVE_DOUBLE, values.data());
    H5Pclose(creation);
  }
  void integers(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<std::int64_t>& values,
                hid_t type = H5T_NATIVE_INT64) {
    write_set(name, type, shape, H5P_DEFAULT, H5T_NATIVE_INT64, values.data());
  }
  void records(const std::string& name, const std::vector<std::string>& members, const std::vector<int>& values) {
    const hid_t type = record_type(members);
    write_set(name, type, {values.size() / members.size()}, H5P_DEFAULT, type, values.data());
    H5Tclose(type);
  }
  /// Texts of one width, filled up with blanks.
  void texts(const std::string& name, const std::vector<std::string>& values, std::size_t width) {
    std::string bytes;
    for (std::string value : values) {
      value.resize(width, ' ');
      bytes += value;
    }
    const hid_t type = text_type(width);
    write_set(name, type, {values.size(), 1}, H5P_DEFAULT, type, bytes.data());
    H5Tclose(type);
  }
  /// Pairs as FLASH writes them: names of 80 characters, filled up with blanks.
  template <class T>
  void named(const std::string& set, const std::vector<std::pair<std::string, T>>& pairs) {
    constexpr bool kTexts = std::is_same_v<T, std::string>;
    constexpr std::size_t kWidth = 80;
    const std::size_t each = kWidth + (kTexts ? kWidth : sizeof(T));
    std::string bytes;
    for (auto [name, value] : pairs) {
      name.resize(kWidth, ' ');
      bytes += name;
      if constexpr (kTexts) {
        value.resize(kWidth, ' ');
        bytes += value;
      } else {
        bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
      }
    }
    const hid_t text = text_type(kWidth);
    const hid_t type = H5Tcreate(H5T_COMPOUND, each);
    H5Tinsert(type, "name", 0, text);
    if constexpr (kTexts)
      H5Tinsert(type, "value", kWidth, text);
    else
      H5Tinsert(type, "value", kWidth, std::is_same_v<T, double> ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT);
    write_set(set, type, {pairs.size()}, H5P_DEFAULT, type, bytes.data());
    H5Tclose(type);
    H5Tclose(text);
  }
  void write_set(const std::string& name, hid_t type, const std::vector<hsize_t>& shape, hid_t creation, hid_t memory,
                 const void* values) {
    const hid_t space = check(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr));
    const hid_t set = check(H5Dcreate2(file_, name.c_str(), type, space, making_groups_, creation, H5P_DEFAULT));
    if (values != nullptr) {
      EXPECT_GE(H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0) << name;
    }
    H5Dclose(set);
    H5Sclose(space);
  }

 private:
  static hid_t check(hid_t id) {
    EXPECT_GE(id, 0);
    return id;
  }
  static hid_t text_type(std::size_t width) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, width);
    return type;
  }
  static hid_t record_type(const std::vector<std::string>& members) {
    const hid_t type = H5Tcreate(H5T_COMPOUND, members.size() * sizeof(int));
    for (std::size_t i = 0; i < members.size(); ++i) H5Tinsert(type, members[i].c_str(), i * sizeof(int), H5T_NATIVE_INT);
    return type;
  }
  void write_attribute(const std::string& object, const std::string& name, hid_t type, const std::vector<hsize_t>& shape,
                       const void* values) {
    const hid_t space = shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, shape.data(), nullptr);
    const hid_t attribute =
        check(H5Acreate_by_name(file_, object.c_str(), name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    EXPECT_GE(H5Awrite(attribute, type, values), 0) << name;
    H5Aclose(attribute);
    H5Sclose(space);
  }

  hid_t file_;
  hid_t making_groups_;
};

/// Gives an attribute that there is another value.
inline void change_attribute(hid_t file, const char* object, const char* name, hid_t type, const void* value) {
  const hid_t opened = H5Oopen(file, object, H5P_DEFAULT);
  const hid_t attribute = H5Aopen(opened, name, H5P_DEFAULT);
  EXPECT_GE(H5Awrite(attribute, type, value), 0) << object << ", " << name;
  H5Aclose(attribute);
  H5Oclose(opened);
}

/// Value of a cell, exact in float32.
inline double value_at(std::size_t level, std::size_t field, const Vec3i& cell) {
  return 100000.0 * static_cast<double>(field) + 10000.0 * static_cast<double>(level) + cell.x + 16 * cell.y + 256 * cell.z + 0.5;
}

/// Fills the patches of a level with these boxes.
inline std::vector<Patch> patches_of(const std::vector<Box>& boxes, std::size_t level, std::size_t fields) {
  std::vector<Patch> patches;
  for (const Box& box : boxes) {
    Patch patch{box, {}};
    for (std::size_t f = 0; f < fields; ++f) {
      std::vector<double> values;
      for_each_cell(box, [&](const Vec3i& cell) { values.push_back(value_at(level, f, cell)); });
      patch.values.emplace_back(values);
    }
    patches.push_back(std::move(patch));
  }
  return patches;
}

/// The eight blocks, or four in two dimensions, that a block is refined into by 2.
inline std::vector<Box> children_of(const Box& block, bool flat) {
  const Vec3i size = block.size();
  std::vector<Box> children;
  for (int i = 0; i < (flat ? 4 : 8); ++i) {
    const Vec3i step(i & 1, (i >> 1) & 1, flat ? 0 : i >> 2);
    const Vec3i lower = Vec3i(block.lower.x * 2, block.lower.y * 2, flat ? 0 : block.lower.z * 2) + step * size;
    children.push_back({lower, lower + size});
  }
  return children;
}

/// Three levels of blocks of 4 x 2 x 2 cells: two at the root, the first of them refined, then a child of it. In two
/// dimensions blocks of 4 x 2 cells. Cells are 0.5 wide at the root, and the domain's corner is no 0.
inline MeshDescription mesh_of_blocks(const std::vector<std::string>& fields, int dimensions = 3) {
  const bool flat = dimensions == 2;
  MeshDescription mesh;
  mesh.name = "blocks";
  mesh.dimensions = dimensions;
  mesh.fields = fields;
  mesh.root_cells = Vec3i(8, 2, flat ? 1 : 2);
  mesh.domain_lower = Vec3d(-1, 0, flat ? 0 : 0.5);
  mesh.domain_upper = Vec3d(3, 1, flat ? 0.125 : 1.5);
  mesh.ratios = {2, 2};
  const Vec3i size(4, 2, flat ? 1 : 2);
  const std::vector<Box> root{{Vec3i(0), size}, {Vec3i(4, 0, 0), Vec3i(4, 0, 0) + size}};
  const std::vector<Box> middle = children_of(root[0], flat);
  const std::vector<Box> fine = children_of(middle[3], flat);
  mesh.levels = {patches_of(root, 0, fields.size()), patches_of(middle, 1, fields.size()), patches_of(fine, 2, fields.size())};
  return mesh;
}

/// The mesh read must be the mesh written, value for value; in two dimensions each value a column of the slab.
inline void expect_mesh(const MeshDescription& found, const MeshDescription& written) {
  EXPECT_EQ(found.fields, written.fields);
  EXPECT_EQ(found.ratios, written.ratios);
  EXPECT_EQ(found.root_cells, written.root_cells);
  EXPECT_EQ(found.dimensions, written.dimensions);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_DOUBLE_EQ(found.domain_lower[axis], written.domain_lower[axis]);
    EXPECT_DOUBLE_EQ(found.domain_upper[axis], written.domain_upper[axis]);
  }
  ASSERT_EQ(found.levels.size(), written.levels.size());
  int depth = 1;
  for (std::size_t l = 0; l < found.levels.size(); ++l) {
    ASSERT_EQ(found.levels[l].size(), written.levels[l].size()) << "level " << l;
    for (std::size_t k = 0; k < found.levels[l].size(); ++k) {
      const Patch& patch = found.levels[l][k];
      const Patch& original = written.levels[l][k];
      Box box = original.box;
      if (written.dimensions == 2) box.upper.z = depth;
      ASSERT_EQ(patch.box, box) << "level " << l << ", patch " << k;
      for (std::size_t f = 0; f < written.fields.size(); ++f) {
        ASSERT_EQ(static_cast<std::int64_t>(patch.values[f].size()), box.cells());
        for_each_cell(box, [&](const Vec3i& cell) {
          const Vec3i from = written.dimensions == 2 ? Vec3i(cell.x, cell.y, 0) : cell;
          ASSERT_EQ(patch.values[f][box.offset(cell)], original.values[f][original.box.offset(from)])
              << "level " << l << ", patch " << k;
        });
      }
    }
    if (l < written.ratios.size()) depth *= written.ratios[l];
  }
  EXPECT_NO_THROW(AmrHierarchy(found).content_hash(0));
}

/// A file of a data set cut behind so many of its bytes is refused with an Error that names the file, or holds the mesh.
template <class Read>
void expect_cuts_to_be_refused(const std::filesystem::path& file, std::size_t cuts, Read&& read) {
  const std::string whole_hash = AmrHierarchy(read()).content_hash(0);
  const std::string bytes = bytes_of_file(file);
  for (std::size_t i = 0; i < cuts; ++i) {
    const std::size_t kept = i * bytes.size() / cuts;
    write_bytes(file, std::string_view(bytes).substr(0, kept));
    try {
      EXPECT_EQ(AmrHierarchy(read()).content_hash(0), whole_hash) << kept << " of " << bytes.size() << " bytes";
    } catch (const Error& refused) {
      EXPECT_THAT(refused.what(), ::testing::HasSubstr(file.filename().string())) << kept << " of " << bytes.size() << " bytes";
    }
  }
  write_bytes(file, bytes);
}

}  // namespace amrtex::test
