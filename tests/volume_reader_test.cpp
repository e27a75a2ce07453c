// Volumes of equal cells: what their headers say, and where blocks of them become coarse.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <utility>

#include "structures/mesh/npy.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/raw_volume/raw_volume.hpp"
#include "tests/reader_files.hpp"
#include "tests/test_meshes.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

/// 4 x 3 x 2 values that count up, in the file's type.
template <class T>
std::vector<T> counted(std::size_t count = 24) {
  std::vector<T> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<T>(i));
  return values;
}

template <class T>
std::string bytes_of_values(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string swapped(std::string bytes, std::size_t width) {
  for (auto at = bytes.begin(); at != bytes.end(); at += static_cast<std::ptrdiff_t>(width))
    std::reverse(at, at + static_cast<std::ptrdiff_t>(width));
  return bytes;
}

std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(bytes.size() + 1000, '\0');
  std::string copy = bytes;
  stream.next_in = reinterpret_cast<Bytef*>(copy.data());
  stream.avail_in = static_cast<uInt>(copy.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

std::string nrrd(const std::string& fields, const std::string& values) {
  return "NRRD0004\n# made here\n" + fields + "\n" + values;
}

constexpr const char* kShape = "dimension: 3\nsizes: 4 3 2\n";

std::vector<double> values_of(const Volume& volume) {
  std::vector<double> values(static_cast<std::size_t>(Box{Vec3i(0), volume.cells}.cells()));
  volume.source->read(0, values);
  return values;
}

class VolumeReader : public FolderTest {
 protected:
  void expect_counted(const fs::path& file) const {
    const Volume volume = read_volume(file);
    EXPECT_EQ(volume.cells, Vec3i(4, 3, 2)) << file;
    EXPECT_EQ(values_of(volume), counted<double>()) << file;
  }
  template <class T>
  void expect_raw(const std::string& type) const {
    expect_counted(write(fmt::format("head_4x3x2_{}.raw", type), bytes_of_values(counted<T>())));
  }
  template <class T>
  void expect_npy(const std::string& type) const {
    expect_counted(write("a.npy", npy_text({type, {2, 3, 4}, bytes_of_values(counted<T>())})));
  }
  std::string refusal(const std::string& name, const std::string& bytes) const {
    write(name, bytes);
    return message_of([&] { AmrHierarchy(read_mesh(at(name))).content_hash(0); });
  }
};

TEST_F(VolumeReader, KeepsNarrowNumbersAsFloatsAndSaysTheirUnit) {
  const std::string bytes = bytes_of_values(counted<std::int16_t>());
  const std::string fields = std::string("type: short\nencoding: raw\nendian: little\n") + kShape;
  const MeshDescription mesh = read_mesh(write("a.nrrd", nrrd(fields + "sample units: \"K\"\n", bytes)));
  EXPECT_EQ(mesh.units, std::vector<std::string>{"K"});
  EXPECT_EQ(mesh.levels.back()[0].values[0].type(), RealType::float32);
  EXPECT_EQ(read_mesh(write("b.nrrd", nrrd(fields, bytes))).units, std::vector<std::string>{""});
  expect_raw<double>("float64");
  EXPECT_EQ(read_mesh(at("head_4x3x2_float64.raw")).levels.back()[0].values[0].type(), RealType::float64);
}

TEST_F(VolumeReader, RawFilesSayTheirShapeAndTypeInTheirNames) {
  expect_raw<std::uint8_t>("uint8");
  expect_raw<std::int8_t>("int8");
  expect_raw<std::uint16_t>("uint16");
  expect_raw<std::int16_t>("int16");
  expect_raw<std::uint32_t>("uint32");
  expect_raw<std::int32_t>("int32");
  expect_raw<float>("float32");
  expect_raw<double>("float64");
  const MeshDescription mesh = read_mesh(at("head_4x3x2_uint8.raw"));
  EXPECT_EQ(mesh.fields, std::vector<std::string>{"head"});
  EXPECT_EQ(mesh.domain_upper, Vec3d(4, 3, 2)) << "a cell is 1 wide";
  expect_counted(write("foot_of_2_4x3x2_uint8.raw", bytes_of_values(counted<std::uint8_t>())));
}

TEST_F(VolumeReader, ArraysOfNumPyHaveXLast) {
  expect_npy<std::uint8_t>("|u1");
  expect_npy<std::uint16_t>("<u2");
  expect_npy<std::int16_t>("<i2");
  expect_npy<float>("<f4");
  expect_npy<double>("<f8");
}

TEST_F(VolumeReader, NrrdHoldsValuesInEitherOrderOfBytes) {
  const std::string little = bytes_of_values(counted<std::int16_t>());
  const std::string fields = std::string("type: short\n") + kShape + "encoding: raw\n";
  expect_counted(write("a.nrrd", nrrd(fields + "endian: little\n", little)));
  expect_counted(write("a.nrrd", nrrd(fields + "endian: big\n", swapped(little, 2))));
  expect_counted(write("a.nrrd", nrrd("type: uchar\nkey:=value\nencoding: raw\n" + std::string(kShape),
                                      bytes_of_values(counted<std::uint8_t>()))));
  expect_counted(write("a.nrrd", nrrd(std::string("type: double\nendian: big\nencoding: raw\n") + kShape,
                                      swapped(bytes_of_values(counted<double>()), 8))));
  expect_counted(write("under_any_name", nrrd(fields + "endian: little\n", little)));
}

TEST_F(VolumeReader, NrrdMayBePacked) {
  const std::string fields = std::string("type: float\nendian: little\nencoding: gzip\n") + kShape;
  const std::string values = bytes_of_values(counted<float>());
  expect_counted(write("a.nrrd", nrrd(fields, gzipped(values))));
  expect_counted(write("a.nrrd", nrrd(fields + "byte skip: 5\n", gzipped("skip!" + values))));
}

TEST_F(VolumeReader, NrrdMayNameAFileOfValues) {
  const std::string values = bytes_of_values(counted<std::uint8_t>());
  const std::string fields = std::string("NRRD0001\ntype: uint8\nencoding: raw\n") + kShape;
  write("values", values);
  expect_counted(write("a.nhdr", fields + "data file: values\n"));
  write("values", "two\nlines\n12" + values);
  expect_counted(write("a.nhdr", fields + "datafile: values\nline skip: 2\nbyte skip: 2\n"));
  expect_counted(write("a.nhdr", fields + "data file: values\nbyte skip: -1\n"));
}

TEST_F(VolumeReader, NrrdSaysWhereTheVolumeLies) {
  const std::string fields = std::string("type: uchar\nencoding: raw\ncontent: density\n") + kShape;
  const std::string values = bytes_of_values(counted<std::uint8_t>());
  const Volume spaced = read_volume(write("a.nrrd", nrrd(fields + "spacings: 0.5 1 2e3\n", values)));
  EXPECT_EQ(spaced.field, "density");
  EXPECT_EQ(spaced.spacing, Vec3d(0.5, 1, 2000));
  EXPECT_EQ(spaced.lower, Vec3d(0));
  const Volume placed =
      read_volume(write("b.nrrd", nrrd(fields + "space directions: (2,0,0) (0,4,0) (0,0,8)\nspace origin: (1,2,3)\n", values)));
  EXPECT_EQ(placed.spacing, Vec3d(2, 4, 8));
  EXPECT_EQ(placed.lower, Vec3d(0, 0, -1)) << "the origin is the middle of the first cell";
}

// ---- bad input ----

TEST_F(VolumeReader, SizesThatDoNotMatchAreRefused) {
  EXPECT_THAT(refusal("a_4x3x2_uint8.raw", std::string(23, 'a')),
              AllOf(HasSubstr("a_4x3x2_uint8.raw: 23 bytes"), HasSubstr("4 x 3 x 2"), HasSubstr("24")));
  EXPECT_THAT(refusal("a_4x3x2_uint8.raw", std::string(25, 'a')), HasSubstr("25 bytes"));
  EXPECT_THAT(refusal("a_4x3_uint8.raw", std::string(12, 'a')), HasSubstr("2 axes; a volume has 3"));
  EXPECT_THAT(refusal("a_4x0x2_uint8.raw", ""), HasSubstr("4 x 0 x 2"));
  EXPECT_THAT(refusal("a_4x3x2_uint9.raw", std::string(24, 'a')), AllOf(HasSubstr("'uint9'"), HasSubstr("uint16")));
  EXPECT_THAT(refusal("a.raw", std::string(24, 'a')), AllOf(HasSubstr("a.raw: nothing says its shape"), HasSubstr("nhdr")));
  EXPECT_THAT(refusal("a_2000000000x2000000000x2000000000_float64.raw", "a"), HasSubstr("more than 2^63"));
  EXPECT_THAT(refusal("a_99999999999999999999x1x1_uint8.raw", "a"), HasSubstr("2147483647"));
  EXPECT_THAT(refusal("a.npy", npy_text({"<f4", {2, 3}, std::string(24, 'a')})), HasSubstr("2 axes"));
  EXPECT_THAT(refusal("a.npy", npy_text({"<f4", {2, 3, 4}, std::string(95, 'a')})), HasSubstr("95 bytes of values"));
  EXPECT_THAT(refusal("a.npy", npy_text({"<c8", {1, 1, 1}, std::string(8, 'a')})), AllOf(HasSubstr("<c8"), HasSubstr("<f4")));
  EXPECT_THAT(refusal("a.npy", npy_text({"<f8", {4000000000, 4000000000, 4000000000}, ""})), HasSubstr("more than 2^63"));
}

TEST_F(VolumeReader, BadNrrdHeadersAreRefused) {
  const std::string good = std::string("type: uchar\nencoding: raw\n") + kShape;
  const std::string values(24, 'a');
  const auto refused = [&](const std::string& fields) { return refusal("a.nrrd", nrrd(fields, values)); };
  EXPECT_EQ(refused(good), kNothingThrown);
  EXPECT_THAT(refusal("a.nrrd", "NRRD0009\n" + good + "\n" + values),
              AllOf(HasSubstr("NRRD0009"), HasSubstr("NRRD0001 to NRRD0005")));
  EXPECT_THAT(refused("type: block\nencoding: raw\n" + std::string(kShape)), HasSubstr("'type' is 'block'"));
  EXPECT_THAT(refused("type: uchar\nencoding: bzip2\n" + std::string(kShape)),
              HasSubstr("'encoding' is 'bzip2'; accepted: raw, gzip"));
  EXPECT_THAT(refused("type: short\nencoding: raw\n" + std::string(kShape)), HasSubstr("'endian' is missing"));
  EXPECT_THAT(refused("type: uchar\nencoding: raw\ndimension: 4\nsizes: 1 4 3 2\n"), HasSubstr("'dimension' is 4"));
  EXPECT_THAT(refused("type: uchar\nencoding: raw\ndimension: 3\nsizes: 4 3\n"), HasSubstr("2 axes"));
  EXPECT_THAT(refused("type: uchar\nencoding: raw\ndimension: 3\nsizes: 4 3 -2\n"), HasSubstr("4 x 3 x -2"));
  EXPECT_THAT(refused("type: uchar\nencoding: raw\ndimension: 3\nsizes: 4 3 1e30\n"), HasSubstr("accepted along an axis"));
  EXPECT_THAT(refused("type: uchar\nencoding: raw\ndimension: 3\nsizes: 4 3 two\n"), HasSubstr("expected numbers"));
  EXPECT_THAT(refused(good + "spacings: 1 0 1\n"), HasSubstr("width of 0"));
  EXPECT_THAT(refused(good + "space directions: (1,1,0) (0,1,0) (0,0,1)\n"), HasSubstr("turns the axes"));
  EXPECT_THAT(refused(good + "type: uchar\n"), HasSubstr("'type' stands twice"));
  EXPECT_THAT(refused(good + "nonsense\n"), AllOf(HasSubstr("line 7"), HasSubstr("'nonsense' is no field")));
  EXPECT_THAT(refused(good + "byte skip: -2\n"), HasSubstr("'byte skip' is -2"));
  EXPECT_THAT(refused(good + "data file: LIST\n"), HasSubstr("one file"));
  EXPECT_THAT(refused(good + "data file: none\n"), HasSubstr("none: no such file"));
  EXPECT_THAT(refusal("a.nrrd", "NRRD0004\n" + good), HasSubstr("its header has no end"));
  EXPECT_THAT(refusal("a.nrrd", nrrd(good, values + "b")), HasSubstr("25 bytes"));
}

TEST_F(VolumeReader, DamagedPackedValuesAreRefused) {
  const std::string fields = std::string("type: uchar\nencoding: gzip\n") + kShape;
  const std::string packed = gzipped(bytes_of_values(counted<std::uint8_t>()));
  EXPECT_THAT(refusal("a.nrrd", nrrd(fields, std::string(24, 'a'))), HasSubstr("not packed"));
  EXPECT_THAT(refusal("a.nrrd", nrrd(fields, gzipped(std::string(23, 'a')))), HasSubstr("ends before its last value"));
  EXPECT_THAT(refusal("a.nrrd", nrrd(fields, gzipped(std::string(25, 'a')))), HasSubstr("more values"));
  for (std::size_t cut = 0; cut < packed.size() - 8; ++cut)
    EXPECT_NE(refusal("a.nrrd", nrrd(fields, packed.substr(0, cut))), kNothingThrown) << cut;
  const std::string huge = "type: uchar\nencoding: gzip\ndimension: 3\nsizes: 40000 40000 40000\n";
  EXPECT_THAT(refusal("a.nrrd", nrrd(huge, packed)), HasSubstr("packed bytes cannot hold"));
}

TEST_F(VolumeReader, CutFilesAreRefused) {
  const std::string whole =
      nrrd(std::string("type: float\nendian: little\nencoding: raw\n") + kShape, bytes_of_values(counted<float>()));
  for (std::size_t cut = 0; cut < whole.size(); ++cut) EXPECT_NE(refusal("a.nrrd", whole.substr(0, cut)), kNothingThrown) << cut;
  const std::string array = npy_text({"<f4", {2, 3, 4}, bytes_of_values(counted<float>())});
  for (std::size_t cut = 0; cut < array.size(); ++cut) EXPECT_NE(refusal("a.npy", array.substr(0, cut)), kNothingThrown) << cut;
}

TEST_F(VolumeReader, UnknownFieldsAreNamed) {
  write("head_4x3x2_uint8.raw", bytes_of_values(counted<std::uint8_t>()));
  EXPECT_THAT(message_of([&] { read_mesh(at("head_4x3x2_uint8.raw"), {"haed"}); }),
              AllOf(HasSubstr("'haed'"), HasSubstr("head")));
}

// ---- blocks ----

/// Values in memory.
class Values : public VolumeSource {
 public:
  explicit Values(std::vector<double> values) : values_(std::move(values)) {}
  void read(std::size_t first, std::span<double> out) const override {
    ASSERT_LE(first + out.size(), values_.size());
    std::copy_n(values_.begin() + static_cast<std::ptrdiff_t>(first), out.size(), out.begin());
  }

 private:
  std::vector<double> values_;
};

std::vector<double> values_of(const Vec3i& cells, const Function& f) {
  std::vector<double> values;
  for_each_cell({Vec3i(0), cells}, [&](const Vec3i& c) { values.push_back(f((Vec3d(c) + 0.5) / Vec3d(cells))); });
  return values;
}

Volume volume_of(const Vec3i& cells, std::vector<double> values) {
  Volume volume;
  volume.name = "made";
  volume.field = "f";
  volume.cells = cells;
  volume.spacing = Vec3d(1) / Vec3d(cells);
  volume.source = std::make_unique<Values>(std::move(values));
  return volume;
}

Volume volume_of(const Vec3i& cells, const Function& f) { return volume_of(cells, values_of(cells, f)); }

/// 0 but for a ball of waves.
double ball(const Vec3d& p) { return glm::length(p - 0.4) < 0.2 ? 0.1 + waves(p) : 0; }

TEST(CoarsenVolume, EqualValuesAreOneBlock) {
  const AmrHierarchy mesh(coarsen_volume(volume_of(Vec3i(64), constant(3))));
  EXPECT_EQ(mesh.level_count(), 5);
  EXPECT_EQ(mesh.cells(0), Vec3i(4));
  EXPECT_EQ(mesh.leaf_cells(), 64);
  EXPECT_FALSE(mesh.has_holes());
  EXPECT_EQ(mesh.level_value(0, {1, 2, 3}, 0), 3);
}

/// Each leaf is the mean of the volume's cells in it, and none of them differs by more than `tolerance`.
void expect_near(const AmrHierarchy& mesh, const Vec3i& size, const std::vector<double>& values, double tolerance) {
  const Box all{Vec3i(0), size};
  std::int64_t cells = 0;
  for_each_cell(all, [&](const Vec3i& c) {
    const auto leaf = mesh.find_leaf(c);
    ASSERT_TRUE(leaf.has_value());
    const double value = values[all.offset(c)];
    EXPECT_LE(std::abs(mesh.value(*leaf, 0) - value), tolerance * (1 + 1e-12));
    ++cells;
  });
  double integral = 0;
  for (const double v : values) integral += v;
  const Vec3d h = Vec3d(1) / Vec3d(size);
  EXPECT_NEAR(mesh.statistics(0).volume_integral, integral * h.x * h.y * h.z, 1e-12 * std::abs(integral * h.x * h.y * h.z));
}

TEST(CoarsenVolume, NoValueIsFurtherOffThanTheTolerance) {
  for (const Vec3i& cells : {Vec3i(64), Vec3i(61, 40, 35), Vec3i(9, 64, 17), Vec3i(33, 1, 5)})
    for (const double share : {0.0, 1.0 / 256, 0.1}) {
      const std::vector<double> values = values_of(cells, ball);
      const AmrHierarchy mesh(coarsen_volume(volume_of(cells, values), {.tolerance = share}));
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      expect_near(mesh, cells, values, share * (*high - *low));
    }
}

TEST(CoarsenVolume, ALargerToleranceTakesFewerCells) {
  std::int64_t before = std::int64_t{64} * 64 * 64 + 1;
  for (const double share : {0.0, 0.05, 0.15}) {
    const std::int64_t cells = AmrHierarchy(coarsen_volume(volume_of(Vec3i(64), waves), {.tolerance = share})).leaf_cells();
    EXPECT_LT(cells, before) << share;
    before = cells;
  }
}

TEST(CoarsenVolume, HiddenValuesMayDiffer) {
  const Function noise = [](const Vec3d& p) {
    return p.x < 0.5 ? 0.2 + 0.1 * std::sin(1e4 * p.x * p.y + 300 * p.z) : 2 + waves(p * 10.0);
  };
  const std::int64_t seen = AmrHierarchy(coarsen_volume(volume_of(Vec3i(32), noise), {.tolerance = 0})).leaf_cells();
  EXPECT_EQ(seen, 32 * 32 * 32);
  const AmrHierarchy mesh(
      coarsen_volume(volume_of(Vec3i(32), noise), {.tolerance = 0, .hidden = {{-5, -4}, {0, 0.5}}, .levels = 2}));
  EXPECT_EQ(mesh.leaf_cells(0), 8 * 16 * 16);
  EXPECT_EQ(mesh.leaf_cells(1), 16 * 32 * 32);
}

TEST(CoarsenVolume, MissingValuesStayFineAmongOthers) {
  std::vector<double> values = values_of(Vec3i(32), [](const Vec3d& p) { return p.z < 0.5 ? 1 : kNan; });
  values[0] = kInf;
  const AmrHierarchy mesh(coarsen_volume(volume_of(Vec3i(32), values), {.levels = 2}));
  EXPECT_EQ(mesh.find_leaf({0, 0, 0})->level, 1);
  EXPECT_EQ(mesh.find_leaf({31, 31, 0})->level, 0);
  EXPECT_EQ(mesh.find_leaf({31, 31, 31})->level, 0) << "all are missing: nothing is lost";
  EXPECT_EQ(mesh.statistics(0).cells_without_value, 1 + 16 * 16 * 8);
}

TEST(CoarsenVolume, AShapeThatIsNoMultipleEndsInAHole) {
  const AmrHierarchy mesh(coarsen_volume(volume_of({33, 32, 32}, constant(1)), {.levels = 3}));
  EXPECT_EQ(mesh.cells(mesh.finest_level()), Vec3i(36, 32, 32));
  EXPECT_TRUE(mesh.has_holes());
  EXPECT_FALSE(mesh.find_leaf({33, 0, 0}).has_value());
  EXPECT_EQ(mesh.find_leaf({32, 0, 0})->level, 2);
  EXPECT_DOUBLE_EQ(mesh.statistics(0).volume_integral, 1);
  EXPECT_DOUBLE_EQ(mesh.spacing(2).x, 1.0 / 33);
}

/// The criterion as it is defined, block by block, over all values at once.
class Definition {
 public:
  Definition(const Vec3i& cells, std::vector<double> values, const CoarsenCriterion& criterion)
      : all_{Vec3i(0), cells}, values_(std::move(values)), criterion_(criterion) {
    const auto [low, high] = std::minmax_element(values_.begin(), values_.end());
    tolerance_ = criterion.tolerance * (*high - *low);
  }

  void expect(const AmrHierarchy& mesh) const {
    const int top = criterion_.levels - 1;
    for_each_cell({Vec3i(0), ceil_div(all_.upper, criterion_.block << top)}, [&](const Vec3i& b) { expect_block(mesh, top, b); });
  }

 private:
  /// The mean of the eight means under the cell, each of which is one of its own eight.
  double mean(int level, const Vec3i& cell) const {
    if (level == 0) return values_[all_.offset(cell)];
    double sum = 0;
    for_each_cell(Box{cell, cell + 1}.refined(2), [&](const Vec3i& c) { sum += mean(level - 1, c); });
    return sum / 8;
  }
  bool is_near(int level, const Vec3i& cell) const {
    const double of_all = mean(level, cell);
    return !first_cell(Box{cell, cell + 1}.refined(1 << level),
                       [&](const Vec3i& c) { return std::abs(values_[all_.offset(c)] - of_all) > tolerance_; });
  }
  void expect_block(const AmrHierarchy& mesh, int level, const Vec3i& block) const {
    const int width = 1 << level;
    const Box under = intersection(Box{block, block + 1}.refined(criterion_.block * width), all_);
    if (under.empty()) return;
    const Box cells = under.coarsened(width);
    const bool whole = cells.refined(width) == under;
    if (!whole || first_cell(cells, [&](const Vec3i& c) { return !is_near(level, c); })) {
      for_each_cell(Box{block, block + 1}.refined(2), [&](const Vec3i& b) { expect_block(mesh, level - 1, b); });
      return;
    }
    for_each_cell(cells, [&](const Vec3i& c) {
      const auto leaf = mesh.find_leaf(c * width);
      ASSERT_TRUE(leaf.has_value());
      ASSERT_EQ(mesh.finest_level() - leaf->level, level);
      ASSERT_EQ(mesh.value(*leaf, 0), mean(level, c));
    });
  }

  Box all_;
  std::vector<double> values_;
  CoarsenCriterion criterion_;
  double tolerance_ = 0;
};

/// Waves of float32, of which one half is nearly still.
double half_still(const Vec3d& p) { return static_cast<float>(p.x < 0.5 ? 1e-3 * waves(p) : waves(p * 3.0)); }

/// Strips are 16 rows and planes: the sizes are several of them, one of them, and none of them whole.
TEST(CoarsenVolume, StripsMakeWhatTheWholeVolumeDoes) {
  const CoarsenCriterion criterion{.tolerance = 0.01, .levels = 3, .block = 4};
  const std::vector<std::pair<Vec3i, int>> sizes = {
      {{64, 48, 80}, 3}, {{61, 50, 35}, 3}, {{90, 16, 14}, 2}, {{40, 15, 70}, 2}, {{8, 7, 5}, 1}};
  for (const auto& [cells, levels] : sizes) {
    SCOPED_TRACE(fmt::format("{} x {} x {}", cells.x, cells.y, cells.z));
    const std::vector<double> values = values_of(cells, half_still);
    const AmrHierarchy mesh(coarsen_volume(volume_of(cells, values), criterion));
    EXPECT_EQ(mesh.level_count(), levels);
    Definition(cells, values, criterion).expect(mesh);
  }
}

using VolumeFiles = VolumeReader;

void expect_same(const MeshDescription& a, const MeshDescription& b) {
  ASSERT_EQ(a.levels.size(), b.levels.size());
  for (std::size_t level = 0; level < a.levels.size(); ++level) {
    ASSERT_EQ(a.levels[level].size(), b.levels[level].size());
    for (std::size_t k = 0; k < a.levels[level].size(); ++k) {
      EXPECT_EQ(a.levels[level][k].box, b.levels[level][k].box);
      EXPECT_EQ(a.levels[level][k].values[0].doubles(), b.levels[level][k].values[0].doubles());
    }
  }
}

TEST_F(VolumeFiles, PlainAndPackedValuesMakeTheSameMesh) {
  const Vec3i cells(131, 70, 260);  // 9.5 MB: more than one piece of unpacked values
  const std::vector<double> values = values_of(cells, half_still);
  const std::string bytes = bytes_of_values(std::vector<float>(values.begin(), values.end()));
  const std::string fields = "type: float\nendian: little\ndimension: 3\nsizes: 131 70 260\n";
  const MeshDescription mesh = coarsen_volume(volume_of(cells, values));
  EXPECT_GT(mesh.levels.size(), 1u);
  EXPECT_FALSE(mesh.levels.back().empty());
  expect_same(read_mesh(write("a_131x70x260_float32.raw", bytes)), mesh);
  expect_same(read_mesh(write("a.nrrd", nrrd(fields + "encoding: gzip\n", gzipped(bytes)))), mesh);
}

TEST_F(VolumeFiles, AFileThatIsCutMeanwhileIsRefused) {
  const fs::path path = write("a_4x3x2_uint8.raw", bytes_of_values(counted<std::uint8_t>()));
  Volume volume = read_volume(path);
  fs::resize_file(path, 23);
  EXPECT_THAT(message_of([&] { coarsen_volume(std::move(volume)); }),
              AllOf(HasSubstr("a_4x3x2_uint8.raw"), HasSubstr("the file ends")));
}

/// 256 x 256 x 256 values without any order, a plane after the other.
template <class T, class F>
void write_noise(F&& write_plane) {
  std::vector<T> plane(256 * 256);
  std::uint32_t state = 1;
  for (int z = 0; z < 256; ++z) {
    for (T& v : plane) v = static_cast<T>((state = state * 1664525 + 1013904223) >> 28);
    write_plane(plane.data(), plane.size() * sizeof(T));
  }
}

/// 64 MiB of float32 in the mesh: 1.3 times as much, and 24 MiB for what is in work.
void expect_little_memory(const fs::path& path) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer keeps for a while what is given back";
#endif
  const std::int64_t before = peak_bytes();
  const MeshDescription mesh = read_mesh(path);
  EXPECT_LE(peak_bytes() - before, (std::int64_t{64 + 24} << 20) + (std::int64_t{64} << 20) * 3 / 10);
}

TEST_F(VolumeFiles, ReadingTakesLittleMoreMemoryThanTheMesh) {
  std::ofstream plain(at("a_256x256x256_uint8.raw"), std::ios::binary);
  write_noise<std::uint8_t>([&](const void* bytes, std::size_t count) {
    plain.write(static_cast<const char*>(bytes), static_cast<std::streamsize>(count));
  });
  plain.close();
  expect_little_memory(at("a_256x256x256_uint8.raw"));
}

TEST_F(VolumeFiles, UnpackingTakesLittleMoreMemoryThanTheMesh) {
  const gzFile packed = gzopen(at("values").c_str(), "wb1");
  write_noise<float>([&](const void* bytes, std::size_t count) { gzwrite(packed, bytes, static_cast<unsigned>(count)); });
  gzclose(packed);
  expect_little_memory(write(
      "a.nhdr", "NRRD0004\ntype: float\ndimension: 3\nsizes: 256 256 256\nencoding: gzip\nendian: little\ndata file: values\n"));
}

TEST(CoarsenVolume, ParametersAreChecked) {
  const auto refused = [](const CoarsenCriterion& c) {
    return message_of([&] { coarsen_volume(volume_of(Vec3i(2), constant(1)), c); });
  };
  EXPECT_THAT(refused({.tolerance = -1}), AllOf(HasSubstr("tolerance -1"), HasSubstr("0 to 1")));
  EXPECT_THAT(refused({.levels = 0}), HasSubstr("levels 0"));
  EXPECT_THAT(refused({.block = 7}), AllOf(HasSubstr("block 7"), HasSubstr("even")));
  EXPECT_THAT(refused({.hidden = {{2, 1}}}), HasSubstr("hidden range 2 to 1"));
}

}  // namespace
}  // namespace amrtex
