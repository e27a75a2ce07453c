// The layer over the HDF5 library: what is read, what is refused, and that nothing is printed.
#include "structures/readers/hdf5_file.hpp"

#include <numeric>

#include "structures/readers/hdf5_test_tools.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using namespace test;
using ::testing::HasSubstr;

class Hdf5Layer : public FolderTest {
 protected:
  fs::path file() const { return folder_ / "file.h5"; }
  template <class F>
  std::string refusal(F&& f) const {
    ::testing::internal::CaptureStderr();
    const std::string message = message_of([&] { f(Hdf5File(file())); });
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
    return message;
  }
};

std::vector<double> counted(std::size_t count) {
  std::vector<double> values(count);
  std::iota(values.begin(), values.end(), 0.5);
  return values;
}

TEST_F(Hdf5Layer, KnowsFilesByTheirFirstBytesAndBehindAUserBlock) {
  write_bytes(folder_ / "text", "not HDF5 at all");
  { const Hdf5Writer out(file()); }
  write_bytes(folder_ / "block", std::string(1024, '#') + bytes_of_file(file()));
  EXPECT_TRUE(Hdf5File::has_signature(file()));
  EXPECT_TRUE(Hdf5File::has_signature(folder_ / "block"));
  EXPECT_FALSE(Hdf5File::has_signature(folder_ / "text"));
  EXPECT_FALSE(Hdf5File::has_signature(folder_));
  EXPECT_FALSE(Hdf5File::has_signature(folder_ / "absent"));
  EXPECT_FALSE(Hdf5File::has_signature("/dev/zero"));
}

TEST_F(Hdf5Layer, ReadsAttributesOfEveryKind) {
  {
    Hdf5Writer out(file());
    out.attribute("/", "whole", 7);
    out.attribute("/", "real", 0.25);
    out.attribute("/", "list", std::vector<int>{3, -4});
    out.attribute("/", "text", "phi  ");
    out.variable_text_attribute("/", "variable", "rho");
    out.record_attribute("/", "record", {"lo_i", "hi_i"}, {1, 9});
  }
  const Hdf5File in(file());
  EXPECT_EQ(in.integer("/", "whole"), 7);
  EXPECT_EQ(in.reals("/", "real"), (std::vector<double>{0.25}));
  EXPECT_EQ(in.reals("/", "whole"), (std::vector<double>{7}));
  EXPECT_EQ(in.integers("/", "list"), (std::vector<std::int64_t>{3, -4}));
  EXPECT_EQ(in.text("/", "text"), "phi");
  EXPECT_EQ(in.text("/", "variable"), "rho");
  EXPECT_EQ(in.integers("/", "record"), (std::vector<std::int64_t>{1, 9}));
  EXPECT_EQ(in.integers("/", "record", {"hi_i"}), (std::vector<std::int64_t>{9}));
  EXPECT_TRUE(in.has_attribute("/", "text"));
  EXPECT_FALSE(in.has_attribute("/", "absent"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.integer("/", "real"); }),
              HasSubstr("file.h5: /, attribute real: of another type"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.integer("/", "list"); }), HasSubstr("attribute list holds 2 values"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.text("/", "whole"); }), HasSubstr("of another type than one text"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.reals("/", "absent"); }), HasSubstr("/, attribute absent: cannot be opened"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.integers("/", "record", {"lo_k"}); }), HasSubstr("no member 'lo_k'"));
}

std::vector<double> read_part(const Hdf5Numbers& numbers, std::uint64_t first, std::size_t count) {
  CellValues values(numbers.type(), count);
  values.visit_stored([&](auto& out) { numbers.read(first, std::span(out)); });
  return values.doubles();
}

TEST_F(Hdf5Layer, ReadsPartsOfDataSetsTheSameInEveryPacking) {
  const std::vector<double> all = counted(6 * 4 * 5);
  for (const hid_t type : {H5T_IEEE_F64LE, H5T_IEEE_F32LE, H5T_IEEE_F64BE, H5T_IEEE_F32BE})
    for (const Packing packing : {Packing::contiguous, Packing::chunked, Packing::deflate}) {
      { Hdf5Writer(file()).numbers("a/b/values", {6, 4, 5}, all, type, packing); }
      const Hdf5Numbers numbers = Hdf5File(file()).open_numbers("a/b/values", 3);
      EXPECT_EQ(numbers.shape(), (Hdf5Shape{6, 4, 5}));
      EXPECT_EQ(numbers.count(), all.size());
      EXPECT_EQ(numbers.parallel(), packing == Packing::contiguous && (type == H5T_IEEE_F64LE || type == H5T_IEEE_F32LE));
      const bool narrow = type == H5T_IEEE_F32LE || type == H5T_IEEE_F32BE;
      EXPECT_EQ(numbers.type(), narrow ? RealType::float32 : RealType::float64);
      EXPECT_EQ(read_part(numbers, 60, 40), std::vector<double>(all.begin() + 60, all.begin() + 100));
      const CellValues inner = numbers.read_box(0, {Vec3i(0), Vec3i(5, 4, 6)}, {Vec3i(1), Vec3i(4, 3, 5)});
      std::size_t i = 0;
      for_each_cell({Vec3i(1), Vec3i(4, 3, 5)}, [&](const Vec3i& c) { EXPECT_EQ(inner[i++], 0.5 + c.x + 5 * (c.y + 4 * c.z)); });
      EXPECT_THAT(message_of([&] { read_part(numbers, 100, 40); }), HasSubstr("40 values from 100 on are wanted; it holds 120"));
    }
}

TEST_F(Hdf5Layer, ReadsBehindAUserBlock) {
  { Hdf5Writer(file()).numbers("values", {1000}, counted(1000)); }
  write_bytes(file(), std::string(2048, '#') + bytes_of_file(file()));
  EXPECT_EQ(read_part(Hdf5File(file()).open_numbers("values", 1), 0, 1000), counted(1000));
}

TEST_F(Hdf5Layer, ReadsMoreThanOnePieceAtATime) {
  constexpr std::size_t kCount = 700001;
  { Hdf5Writer(file()).numbers("values", {kCount}, counted(kCount), H5T_IEEE_F32LE); }
  const std::vector<double> found = read_part(Hdf5File(file()).open_numbers("values", 1), 1, kCount - 1);
  for (std::size_t i = 0; i < found.size(); i += 997) EXPECT_EQ(found[i], static_cast<double>(i) + 1.5);
  EXPECT_EQ(found.back(), 700000.5);
}

TEST_F(Hdf5Layer, ListsMembersAndLooksThemUp) {
  {
    Hdf5Writer out(file());
    out.group("b/inner");
    out.group("a");
    out.numbers("c", {2}, {1, 2});
    H5Lcreate_soft("/nowhere", out.file(), "dangling", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/b", out.file(), "link", H5P_DEFAULT, H5P_DEFAULT);
  }
  const Hdf5File in(file());
  EXPECT_EQ(in.members("/"), (std::vector<std::string>{"a", "b", "c", "dangling", "link"}));
  EXPECT_TRUE(in.has("b/inner"));
  EXPECT_TRUE(in.has("link/inner"));
  for (const char* absent : {"b/other", "absent/inner", "dangling", "dangling/x"}) EXPECT_FALSE(in.has(absent)) << absent;
  EXPECT_EQ(in.rank_of_reals("c"), 1U);
  EXPECT_EQ(in.rank_of_reals("b"), 0U);
}

TEST_F(Hdf5Layer, FollowsNoLinkIntoAnotherFile) {
  { Hdf5Writer(folder_ / "other.h5").numbers("values", {4}, counted(4)); }
  {
    Hdf5Writer out(file());
    H5Lcreate_external((folder_ / "other.h5").c_str(), "/values", out.file(), "values", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_external((folder_ / "other.h5").c_str(), "/", out.file(), "group", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/group/values", out.file(), "soft", H5P_DEFAULT, H5P_DEFAULT);
  }
  for (const char* name : {"values", "group/values", "soft"}) {
    EXPECT_THAT(refusal([&](const Hdf5File& f) { f.open_numbers(name, 1); }), HasSubstr("a link to another file")) << name;
    EXPECT_THAT(refusal([&](const Hdf5File& f) { f.read_reals(name); }), HasSubstr("a link to another file")) << name;
    EXPECT_THAT(refusal([&](const Hdf5File& f) { f.has(name); }), HasSubstr("a link to another file")) << name;
    EXPECT_THAT(refusal([&](const Hdf5File& f) { f.has_attribute(name, "x"); }), HasSubstr("a link to another file")) << name;
    EXPECT_THAT(refusal([&](const Hdf5File& f) { f.reals(name, "x"); }), HasSubstr("a link to another file")) << name;
  }
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.members("group"); }), HasSubstr("a link to another file"));
}

TEST_F(Hdf5Layer, RefusesLinksInACircle) {
  {
    Hdf5Writer out(file());
    H5Lcreate_soft("/b", out.file(), "a", H5P_DEFAULT, H5P_DEFAULT);
    H5Lcreate_soft("/a", out.file(), "b", H5P_DEFAULT, H5P_DEFAULT);
  }
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("a", 1); }), HasSubstr("file.h5: a: cannot be opened"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.has("a/x"); }), HasSubstr("file.h5: a: cannot be looked up"));
}

TEST_F(Hdf5Layer, RefusesValuesInOtherFiles) {
  write_bytes(folder_ / "raw", std::string(32, 'x'));
  { Hdf5Writer(folder_ / "other.h5").numbers("values", {4}, counted(4)); }
  {
    Hdf5Writer out(file());
    const hid_t external = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(external, (folder_ / "raw").c_str(), 0, 32);
    out.write_set("external", H5T_NATIVE_DOUBLE, {4}, external, H5T_NATIVE_DOUBLE, nullptr);
    H5Pclose(external);
    const hsize_t extent = 4;
    const hid_t space = H5Screate_simple(1, &extent, nullptr);
    const hid_t made_of = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_virtual(made_of, space, (folder_ / "other.h5").c_str(), "/values", space);
    out.write_set("virtual", H5T_NATIVE_DOUBLE, {4}, made_of, H5T_NATIVE_DOUBLE, nullptr);
    H5Pclose(made_of);
    H5Sclose(space);
  }
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("external", 1); }),
              HasSubstr("external: its values lie in other files"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("virtual", 1); }), HasSubstr("virtual: a virtual data set"));
}

TEST_F(Hdf5Layer, RefusesFiltersThatAPluginWouldHaveToBring) {
  {
    Hdf5Writer out(file());
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = 4;
    H5Pset_chunk(creation, 1, &chunk);
    H5Pset_filter(creation, 32013, H5Z_FLAG_OPTIONAL, 0, nullptr);
    out.write_set("packed", H5T_NATIVE_DOUBLE, {4}, creation, H5T_NATIVE_DOUBLE, counted(4).data());
    H5Pclose(creation);
  }
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("packed", 1); }), HasSubstr("packed: packed by the filter 32013"));
}

/// So that a chunk of the data set is stored, and no other.
void write_first_value(hid_t file, const char* name) {
  const hid_t set = H5Dopen2(file, name, H5P_DEFAULT);
  const hid_t in_file = H5Dget_space(set);
  const hsize_t first = 0;
  const hsize_t one = 1;
  H5Sselect_hyperslab(in_file, H5S_SELECT_SET, &first, nullptr, &one, nullptr);
  const hid_t in_memory = H5Screate_simple(1, &one, nullptr);
  const double value = 1;
  EXPECT_GE(H5Dwrite(set, H5T_NATIVE_DOUBLE, in_memory, in_file, H5P_DEFAULT, &value), 0);
  H5Sclose(in_memory);
  H5Sclose(in_file);
  H5Dclose(set);
}

TEST_F(Hdf5Layer, AllocatesNothingForValuesThatAreNotStored) {
  constexpr hsize_t kHuge = hsize_t{1} << 40;
  {
    Hdf5Writer out(file());
    out.write_set("contiguous", H5T_NATIVE_DOUBLE, {kHuge}, H5P_DEFAULT, H5T_NATIVE_DOUBLE, nullptr);
    out.write_set("whole", H5T_NATIVE_INT, {kHuge}, H5P_DEFAULT, H5T_NATIVE_INT, nullptr);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = hsize_t{1} << 28;
    H5Pset_chunk(creation, 1, &chunk);
    H5Pset_deflate(creation, 1);
    out.write_set("never", H5T_NATIVE_DOUBLE, {kHuge}, creation, H5T_NATIVE_DOUBLE, nullptr);
    const hsize_t small_chunk = 16;
    H5Pset_chunk(creation, 1, &small_chunk);
    out.write_set("chunked", H5T_NATIVE_DOUBLE, {kHuge}, creation, H5T_NATIVE_DOUBLE, nullptr);
    H5Pclose(creation);
    write_first_value(out.file(), "chunked");
  }
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("contiguous", 1); }),
              HasSubstr("contiguous: its 1099511627776 values were never written"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("never", 1); }), HasSubstr("never: its 1099511627776 values"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("chunked", 1); }), HasSubstr("chunked: its extents"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_integers("whole"); }),
              HasSubstr("whole: its 1099511627776 values were never written"));
}

/// Places of a text in another one.
std::vector<std::size_t> places_of(const std::string& part, const std::string& text) {
  std::vector<std::size_t> places;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) places.push_back(at);
  return places;
}

// the offset of a member stands in the four bytes behind its name, which is filled up to eight: with 0xffff there the
// library would write outside of its buffer
TEST_F(Hdf5Layer, RefusesCompoundsWhoseMembersLieOutsideOfThem) {
  {
    Hdf5Writer out(file());
    out.records("records", {"lo_i", "hi_i"}, {1, 2, 3, 4});
    out.record_attribute("/", "record", {"lo_i", "hi_i"}, {1, 9});
  }
  std::string bytes = bytes_of_file(file());
  const auto places = places_of("hi_i", bytes);
  ASSERT_EQ(places.size(), 2U);
  for (const std::size_t at : places) bytes.replace(at + 8, 2, "\xff\xff");
  write_bytes(file(), bytes);
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_records("records", {"lo_i"}); }),
              HasSubstr("records: its type is not one of"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.integers("/", "record"); }),
              HasSubstr("attribute record: its type is not one of"));
}

TEST_F(Hdf5Layer, SaysWhatIsWrongWithAFile) {
  { Hdf5Writer(file()).numbers("values", {1000}, counted(1000)); }
  const std::string whole = bytes_of_file(file());
  const auto nothing = [](const Hdf5File&) {};
  write_bytes(file(), std::string_view(whole).substr(0, 4000));
  EXPECT_THAT(refusal(nothing), HasSubstr("file.h5: cannot be opened as HDF5: truncated file"));
  write_bytes(file(), "not HDF5");
  EXPECT_THAT(refusal(nothing), HasSubstr("file.h5: cannot be opened as HDF5"));
  fs::remove(file());
  EXPECT_THAT(refusal(nothing), HasSubstr("file.h5: no such file or directory"));
  EXPECT_THAT(message_of([&] { Hdf5File{folder_}; }), HasSubstr("a folder, not a regular file"));
}

TEST_F(Hdf5Layer, RefusesOtherTypesAndShapes) {
  {
    Hdf5Writer out(file());
    out.integers("whole", {2, 2}, {1, 2, 3, 4});
    out.numbers("reals", {2}, {1, 2});
    out.texts("texts", {"a", "bc"}, 4);
    out.records("records", {"x", "y"}, {1, 2, 3, 4});
    out.group("group");
  }
  const Hdf5File in(file());
  EXPECT_EQ(in.read_integers("whole").values, (std::vector<std::int64_t>{1, 2, 3, 4}));
  EXPECT_EQ(in.read_integers("whole").shape, (Hdf5Shape{2, 2}));
  EXPECT_EQ(in.read_reals("whole").values, (std::vector<double>{1, 2, 3, 4}));
  EXPECT_EQ(in.read_texts("texts"), (std::vector<std::string>{"a   ", "bc  "}));
  EXPECT_EQ(in.read_records("records", {"y"}), (std::vector<std::int64_t>{2, 4}));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("whole", 2); }), HasSubstr("whole: of another type than reals"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("reals", 3); }), HasSubstr("reals: extents (2) where 3 axes"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_integers("reals"); }),
              HasSubstr("reals: of another type than whole numbers"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_texts("reals"); }), HasSubstr("reals: of another type than texts"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_records("reals", {"x"}); }),
              HasSubstr("reals: of another type than a compound"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_records("records", {"z"}); }), HasSubstr("records: no member 'z'"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.read_named_reals("records"); }), HasSubstr("records: no member 'name'"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("group", 1); }), HasSubstr("group: cannot be opened as a data set"));
  EXPECT_THAT(refusal([](const Hdf5File& f) { f.open_numbers("absent", 1); }),
              HasSubstr("absent: cannot be opened as a data set"));
}

}  // namespace
}  // namespace amrtex
