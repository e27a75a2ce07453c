#include "structures/readers/npz_mesh/npz_mesh.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>

#include "structures/mesh/npz_file.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/mesh/unfinished_folder.hpp"
#include "structures/readers/memory_check.hpp"
#include "structures/readers/reader_tools.hpp"
#include "structures/readers/wanted_fields.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;

using Arrays = std::map<std::string, NpyArray>;
using Shape = std::vector<std::int64_t>;

constexpr int kMostLevel = 63;

/// The arrays of a file, each of the shape and type that it has to have.
class ArrayReader {
 public:
  explicit ArrayReader(const fs::path& path) : path_(path), file_(path) {}

  [[noreturn]] void refuse(const std::string& what) const { throw Error(fmt::format("{}: {}", path_.string(), what)); }

  bool has(const std::string& name) const { return file_.has(name); }
  /// Whole numbers of 32 or 64 bits.
  std::vector<std::int64_t> integers(const std::string& name, const Shape& shape) const {
    const NpyHeader header = find(name, shape);
    if (header.type != "<i4" && header.type != "<i8")
      refuse(fmt::format("the array {} has type {}; accepted: <i4, <i8", name, header.type));
    const NpyArray array = file_.read(name);
    if (array.type == "<i8") return values<std::int64_t>(array);
    const auto small = values<std::int32_t>(array);
    return {small.begin(), small.end()};
  }
  std::vector<double> reals(const std::string& name, const Shape& shape) const {
    const RealType type = real_type(name, shape);
    const NpyArray array = file_.read(name);
    if (type == RealType::float64) return values<double>(array);
    const auto small = values<float>(array);
    return {small.begin(), small.end()};
  }
  RealType real_type(const std::string& name, const Shape& shape) const {
    const NpyHeader header = find(name, shape);
    if (header.type != "<f8" && header.type != "<f4")
      refuse(fmt::format("the array {} has type {}; accepted: <f4, <f8", name, header.type));
    return header.type == "<f4" ? RealType::float32 : RealType::float64;
  }
  std::string text(const std::string& name) const {
    const NpyHeader header = find(name, {length(name)});
    if (header.type != "|u1") refuse(fmt::format("the array {} has type {}; accepted: |u1", name, header.type));
    return file_.read(name).bytes;
  }
  /// Of the first axis.
  std::int64_t length(const std::string& name) const {
    if (!file_.has(name)) refuse(fmt::format("holds no array {}; it is no mesh", quote(name)));
    const NpyHeader header = file_.header(name);
    if (header.shape.empty()) refuse(fmt::format("the array {} is a single number", name));
    return header.shape.front();
  }
  const NpzFile& file() const { return file_; }

 private:
  NpyHeader find(const std::string& name, const Shape& shape) const {
    static_cast<void>(length(name));
    NpyHeader header = file_.header(name);
    if (header.shape != shape)
      refuse(
          fmt::format("the array {} has shape ({}); expected ({})", name, fmt::join(header.shape, ", "), fmt::join(shape, ", ")));
    return header;
  }
  template <class T>
  static std::vector<T> values(const NpyArray& array) {
    std::vector<T> out(array.bytes.size() / sizeof(T));
    std::memcpy(out.data(), array.bytes.data(), array.bytes.size());
    return out;
  }

  fs::path path_;
  NpzFile file_;
};

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

int as_index(const ArrayReader& in, std::int64_t value, const char* what) {
  if (value < 0 || value > std::numeric_limits<std::int32_t>::max())
    in.refuse(fmt::format("{} is {}; accepted: 0 to {}", what, value, std::numeric_limits<std::int32_t>::max()));
  return static_cast<int>(value);
}

Box box_of(const ArrayReader& in, const std::int64_t* corners) {
  std::array<int, 6> c{};
  for (std::size_t i = 0; i < 6; ++i) c[i] = as_index(in, corners[i], "a corner of a box");
  return {{c[0], c[1], c[2]}, {c[3], c[4], c[5]}};
}

/// Ratios, domain and root cells, which stand in arrays of their own.
MeshDescription read_frame(const ArrayReader& in) {
  MeshDescription mesh;
  const auto ratios = in.integers("ratios", {in.length("ratios")});
  if (ratios.size() > kMostLevel)
    in.refuse(fmt::format("{} refinement ratios; at most {} are supported", ratios.size(), kMostLevel));
  for (const std::int64_t ratio : ratios) mesh.ratios.push_back(as_index(in, ratio, "a refinement ratio"));
  const auto root = in.integers("root_cells", {3});
  for (int axis = 0; axis < 3; ++axis)
    mesh.root_cells[axis] = as_index(in, root[static_cast<std::size_t>(axis)], "a number of root cells");
  const auto domain = in.reals("domain", {2, 3});
  mesh.domain_lower = {domain[0], domain[1], domain[2]};
  mesh.domain_upper = {domain[3], domain[4], domain[5]};
  mesh.levels.resize(ratios.size() + 1);
  return mesh;
}

}  // namespace

bool is_npz_mesh(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return false;
  std::array<char, 4> magic{};
  std::ifstream(path, std::ios::binary).read(magic.data(), magic.size());
  return std::string_view(magic.data(), magic.size()) == "PK\x03\x04";
}

namespace {

/// Patches without values, in the order of the file, each of them in its level.
std::vector<Patch*> place_patches(const ArrayReader& in, std::int64_t cells, MeshDescription& mesh) {
  const std::int64_t patches = in.length("levels");
  const auto levels = in.integers("levels", {patches});
  const auto boxes = in.integers("boxes", {patches, 2, 3});
  std::vector<std::pair<std::size_t, std::size_t>> places;  // level and patch
  std::int64_t at = 0;
  for (std::size_t k = 0; k < levels.size(); ++k) {
    if (levels[k] < 0 || levels[k] >= std::ssize(mesh.levels))
      in.refuse(fmt::format("patch {} is of level {}; there are {} levels", k, levels[k], mesh.levels.size()));
    auto& level = mesh.levels[static_cast<std::size_t>(levels[k])];
    level.push_back({box_of(in, &boxes[6 * k]), std::vector<CellValues>(mesh.fields.size())});
    const std::int64_t count = level.back().box.cells();
    if (count > cells - at) in.refuse(fmt::format("the boxes hold more cells than there are values, {}", cells));
    at += count;
    places.emplace_back(static_cast<std::size_t>(levels[k]), level.size() - 1);
  }
  if (at != cells) in.refuse(fmt::format("the boxes hold {} cells, but there are {} values", at, cells));
  std::vector<Patch*> in_order;
  for (const auto& [level, patch] : places) in_order.push_back(&mesh.levels[level][patch]);
  return in_order;
}

/// Passes over the rows of other fields.
void read_values(const ArrayReader& in, RealType type, std::size_t fields, std::int64_t cells,
                 const std::vector<std::size_t>& wanted, const std::vector<Patch*>& patches) {
  const auto row_bytes = static_cast<std::uint64_t>(cells) * bytes_of(type);
  in.file().stream("values", [&](const NpzFile::NextBytes& read) {
    for (std::size_t field = 0; field < fields; ++field) {
      const auto found = std::find(wanted.begin(), wanted.end(), field);
      if (found == wanted.end()) {
        read(nullptr, row_bytes);
        continue;
      }
      for (Patch* patch : patches) {
        CellValues values(type, static_cast<std::size_t>(patch->box.cells()));
        values.visit_stored([&](auto& stored) { read(stored.data(), stored.size() * sizeof(stored[0])); });
        patch->values[static_cast<std::size_t>(found - wanted.begin())] = std::move(values);
      }
    }
  });
  for (std::size_t i = 0; i < wanted.size(); ++i)  // a field that is asked for twice
    if (const auto first = std::find(wanted.begin(), wanted.end(), wanted[i]);
        first - wanted.begin() < static_cast<std::ptrdiff_t>(i))
      for (Patch* patch : patches) patch->values[i] = patch->values[static_cast<std::size_t>(first - wanted.begin())];
}

}  // namespace

MeshDescription read_npz_mesh(const fs::path& path, const FieldChoice& fields) {
  const ArrayReader in(path);
  MeshDescription mesh = read_frame(in);
  mesh.name = dataset_name(path);
  mesh.fields_there = lines_of(in.text("fields"));
  const std::int64_t cells = in.length("leaf");  // one number a stored cell
  const RealType type = in.real_type("values", {std::ssize(mesh.fields_there), cells});
  std::vector<std::string> units(mesh.fields_there.size());
  if (in.has("units")) units = lines_of(in.text("units"));
  if (units.size() != mesh.fields_there.size())
    in.refuse(fmt::format("{} units for {} fields", units.size(), mesh.fields_there.size()));
  const std::vector<std::size_t> wanted = fields.among(path, mesh.fields_there);
  for (const std::size_t field : wanted) {
    mesh.fields.push_back(mesh.fields_there[field]);
    mesh.units.push_back(units[field]);
  }
  const std::vector<Patch*> patches = place_patches(in, cells, mesh);
  require_memory(path, cells, wanted.size(), bytes_of(type));
  read_values(in, type, mesh.fields_there.size(), cells, wanted, patches);
  return mesh;
}

namespace {

template <class T>
NpyArray array_of(const char* type, Shape shape, const std::vector<T>& values) {
  return NpyArray::of<T>(type, std::move(shape), values);
}

std::string one_line_of(const std::string& text) { return text.substr(0, text.find('\n')); }

/// What is not the patches' own.
Arrays frame_of(const AmrHierarchy& mesh) {
  std::vector<std::int32_t> ratios;
  for (int level = 0; level < mesh.finest_level(); ++level) ratios.push_back(mesh.ratio_to_finer(level));
  const Vec3i root = mesh.cells(0);
  const Vec3d lower = mesh.domain_lower();
  const Vec3d upper = mesh.domain_upper();
  const std::string names = fmt::format("{}", fmt::join(mesh.fields(), "\n"));
  std::string units;
  for (int field = 0; field < std::ssize(mesh.fields()); ++field)
    units += (field > 0 ? "\n" : "") + one_line_of(mesh.unit(field));
  return {{"ratios", array_of<std::int32_t>("<i4", {std::ssize(ratios)}, ratios)},
          {"root_cells", array_of<std::int32_t>("<i4", {3}, {root.x, root.y, root.z})},
          {"domain", array_of<double>("<f8", {2, 3}, {lower.x, lower.y, lower.z, upper.x, upper.y, upper.z})},
          {"fields", NpyArray{"|u1", {std::ssize(names)}, names}},
          {"units", NpyArray{"|u1", {std::ssize(units)}, units}}};
}

}  // namespace

void write_npz_mesh(const AmrHierarchy& mesh, const fs::path& path) {
  const fs::path target = without_slash(path);
  for (const std::string& name : mesh.fields())
    if (name.find('\n') != std::string::npos)
      throw UnsupportedError(
          fmt::format("{}: the field name {} cannot be written, names stand one a line", target.string(), quote(name)));
  refuse_existing(target);
  Arrays arrays = frame_of(mesh);
  std::vector<std::int32_t> levels;
  std::vector<std::int32_t> boxes;
  std::string leaf;
  std::string values;
  for (int level = 0; level < mesh.level_count(); ++level)
    for (std::size_t k = 0; k < mesh.patches(level).size(); ++k) {
      const Box& box = mesh.patches(level)[k].box;
      levels.push_back(level);
      boxes.insert(boxes.end(), {box.lower.x, box.lower.y, box.lower.z, box.upper.x, box.upper.y, box.upper.z});
      const auto mask = mesh.leaf_mask(level, static_cast<int>(k));
      leaf.append(mask.begin(), mask.end());
    }
  for (std::size_t field = 0; field < mesh.fields().size(); ++field)
    for (int level = 0; level < mesh.level_count(); ++level)
      for (const Patch& patch : mesh.patches(level))
        for (const double value : patch.values[field].doubles())
          values.append(reinterpret_cast<const char*>(&value), sizeof value);
  const std::int64_t cells = std::ssize(leaf);
  arrays["levels"] = array_of<std::int32_t>("<i4", {std::ssize(levels)}, levels);
  arrays["boxes"] = array_of<std::int32_t>("<i4", {std::ssize(levels), 2, 3}, boxes);
  arrays["leaf"] = NpyArray{"|u1", {cells}, std::move(leaf)};
  arrays["values"] = NpyArray{"<f8", {std::ssize(mesh.fields()), cells}, std::move(values)};
  UnfinishedFolder folder(target);
  const std::string name = target.filename().string();
  write_npz(folder.path() / name, arrays);
  folder.publish_files({name});
}

}  // namespace amrtex
