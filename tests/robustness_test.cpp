// Bad input of every kind: what it is answered with, how long that takes, and that messages stay short and printable.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>

#include "bench/settings/experiment.hpp"
#include "bench/settings/json_file.hpp"
#include "renderers/scene/picture.hpp"
#include "renderers/scene/triangle_reader.hpp"
#include "structures/common/encoding.hpp"
#include "structures/generators/synthetic.hpp"
#include "structures/mesh/amr_hierarchy.hpp"
#include "structures/mesh/checked.hpp"
#include "structures/mesh/quoted.hpp"
#include "structures/readers/mesh_io.hpp"
#include "structures/readers/reader_tools.hpp"
#include "tests/optional_data.hpp"

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

// ---- helpers ----

/// What the action is answered with, within a second of a processor: "accepted" or the message of an Error. Anything else ends
/// the test.
std::string answer(const std::function<void()>& action) {
  const std::clock_t begin = std::clock();
  std::string message = "accepted";
  try {
    action();
  } catch (const Error& e) {
    message = e.what();
  }
  EXPECT_LT(std::clock() - begin, CLOCKS_PER_SEC) << message;
  return message;
}

std::string answer_to_json(const std::string& text) {
  return answer([&] { JsonFile(text, "e.json"); });
}

class BadFiles : public testing::Test {
 protected:
  BadFiles() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("amrtex_robustness_{}_{}", info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~BadFiles() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& bytes) const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  std::string answer_to_triangles(const std::string& name, const std::string& bytes) const {
    const fs::path path = write(name, bytes);
    return answer([&] { read_triangles(path); });
  }
  /// One that draws these triangles, beside the folder's other files.
  std::string answer_to_experiment(const std::string& triangles) const {
    const std::string text = fmt::format(R"({{"datasets": [{{"generate": {{"field": "blobs_shell", "levels": 2}}}}],
      "encodings": [{{"name": "uniform"}}], "render": {{"triangles": [{{"file": "{}"}}]}}}})",
                                         triangles);
    return answer([&] { parse_experiment(text, folder_ / "experiment/e.json"); });
  }

  fs::path folder_;
};

// ---- foreign text ----

TEST(ForeignText, LosesWhatATerminalObeys) {
  EXPECT_EQ(printable("plain text, ä€\xF0\x9F\x98\x80"), "plain text, ä€\xF0\x9F\x98\x80");
  EXPECT_EQ(printable("\x1b[31mred\a\x7f"), "\\x1b[31mred\\x07\\x7f");
  EXPECT_EQ(printable("\xC2\x9B"
                      "2J"),
            "\\u{9b}2J")
      << "a control sequence in one character";
  EXPECT_EQ(printable("a\u202Eb\u2028\uFEFF"), "a\\u{202e}b\\u{2028}\\u{feff}") << "turned writing, another line, nothing";
  EXPECT_EQ(printable("\xff|\xC0\x80|\xED\xA0\x80|\xE2\x82"), "\\xff|\\xc0\\x80|\\xed\\xa0\\x80|\\xe2\\x82") << "no UTF-8";
  EXPECT_TRUE(is_utf8("ä€\xF0\x9F\x98\x80"));
  for (const char* bad : {"\xff", "\xC0\x80", "\xED\xA0\x80", "\xE2\x82", "\xF5\x80\x80\x80", "\x80"}) EXPECT_FALSE(is_utf8(bad));
}

TEST(ForeignText, IsCutBehindEightyCharacters) {
  EXPECT_EQ(clipped(std::string(80, 'x')), std::string(80, 'x'));
  EXPECT_EQ(clipped(std::string(81, 'x')), std::string(77, 'x') + "...");
  EXPECT_EQ(clipped(std::string(1 << 20, '\x1b')).size(), 4 * 19 + 3);
  std::string umlauts, cut;
  for (int i = 0; i < 100; ++i) umlauts += "ä";
  for (int i = 0; i < 77; ++i) cut += "ä";
  EXPECT_EQ(quote(umlauts), "'" + cut + "...'") << "characters count, not bytes";
  EXPECT_EQ(shown(Json{{"a", std::string(200, 'x')}}).size(), 80U);
  EXPECT_EQ(listed(std::vector<std::string>{"a", "b\n"}), "a, b\\x0a");
  const std::string list = listed(std::vector<std::string>(1000, std::string(1000, 'x')));
  EXPECT_LT(list.size(), 260U);
  EXPECT_THAT(list, HasSubstr("... and 99"));
}

TEST(ForeignText, OfAMessageIsOneLineOfBoundedLength) {
  EXPECT_EQ(one_line("two\nlines", 400), "two lines");
  const std::string line = one_line("file: " + std::string(5000, 'x') + "; accepted: a, b", 400);
  EXPECT_EQ(line.size(), 400U);
  EXPECT_THAT(line, AllOf(StartsWith("file: xxx"), HasSubstr("x ... x"), testing::EndsWith("; accepted: a, b")));
}

TEST(ForeignText, OfNamesAndValuesIsCutAndEscapedInTheMessagesOfEncodings) {
  const std::string name = "\x1b[2J" + std::string(500, 'x');
  std::vector<std::function<void()>> actions = {[&] { parse_storage(name); }, [&] { parse_filtering(name); },
                                                [&] { parse_filter(name); }, [&] { find_encoding(name); }};
  for (const Encoding* encoding : all_encodings()) {
    actions.push_back([&name, encoding] { complete_parameters(*encoding, {{name, 1}}); });
    for (const ParameterInfo& parameter : encoding->parameters())
      actions.push_back([&name, encoding, key = parameter.name] { complete_parameters(*encoding, {{key, name + "\xff"}}); });
  }
  for (const auto& action : actions)
    EXPECT_THAT(answer(action), AllOf(HasSubstr("\\x1b[2Jxxx"), Not(HasSubstr("\x1b")), Not(HasSubstr("\xff")),
                                      Not(HasSubstr(std::string(80, 'x')))));
}

// ---- sizes ----

TEST(Sizes, StayAtTheMostInsteadOfWrappingRound) {
  EXPECT_EQ((CheckedSize(3) * 4 + 5).or_most(), 17);
  EXPECT_FALSE((CheckedSize(std::int64_t{1} << 32) * (std::int64_t{1} << 32)).fits());
  EXPECT_FALSE((CheckedSize(CheckedSize::kMost) + 1).fits());
  EXPECT_FALSE(CheckedSize(-1).fits());
  EXPECT_FALSE(CheckedSize::of(std::uint64_t{1} << 63).fits());
  EXPECT_EQ((CheckedSize(0) * CheckedSize::kMost).or_most(), 0);
  constexpr int kEdge = std::numeric_limits<int>::max();
  EXPECT_EQ((Box{Vec3i(0), Vec3i(kEdge)}.cells()), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ((Box{Vec3i(0), Vec3i(kEdge, 2, 1)}.cells()), std::int64_t{2} * kEdge);
}

// ---- JSON ----

TEST(JsonText, MayBeginWithAByteOrderMark) {
  EXPECT_EQ(answer_to_json("\xEF\xBB\xBF{}"), "accepted");
  const JsonFile file("\xEF\xBB\xBF{\"a\":\n[1,\n2]}", "e.json");
  EXPECT_EQ(file.line("a[1]"), 3);
  EXPECT_THAT(answer_to_json("\xEF\xBB"), StartsWith("e.json:1:"));
}

TEST(JsonText, WithANulIsRefusedWithItsPlace) {
  EXPECT_EQ(answer_to_json(std::string("{}\0,", 4)), "e.json:1:3: not valid JSON: a NUL character");
  EXPECT_EQ(answer_to_json(std::string("{\n \"a\": \0}", 10)), "e.json:2:7: not valid JSON: a NUL character");
  const JsonFile escaped(R"({"file": "a\u0000b"})", "e.json");
  EXPECT_THAT(answer([&] { escaped.root().require("file").text(); }), HasSubstr("e.json:1: file: a string without NUL"));
}

TEST(JsonText, KnowsTheLineOfEveryKeyAndElement) {
  const JsonFile file("{\n\"a\": [1,\n\n{\"b\": -2.5e3\n},\n\"x\", [\n[]]],\n\"c\": null}\n", "e.json");
  const struct {
    const char* place;
    int line;
  } places[] = {{"", 1}, {"a", 2}, {"a[0]", 2}, {"a[1]", 4}, {"a[1].b", 4}, {"a[2]", 6}, {"a[3]", 6}, {"a[3][0]", 7}, {"c", 8}};
  for (const auto& p : places) EXPECT_EQ(file.line(p.place), p.line) << p.place;
  EXPECT_EQ(JsonFile("[1\n,2\n]", "e.json").line("[1]"), 2) << "a number ends with the line's end";
  EXPECT_EQ(JsonFile("[1\n]", "e.json").line("[0]"), 1);
  EXPECT_EQ(file.root().json().dump(), R"({"a":[1,{"b":-2500.0},"x",[[]]],"c":null})");
}

TEST(JsonText, ThatIsHostileIsAnsweredAtOnceAndShortly) {
  const std::string longest(1 << 20, 'x');
  std::string keys = "{";
  for (int i = 0; i < 100000; ++i) keys += fmt::format("{}\"{}\":0", i > 0 ? "," : "", i);
  const struct {
    const char* what;
    std::string text, part;
  } cases[] = {{"depth", std::string(1 << 20, '['), "nested more than"},
               {"depth of objects",
                [] {
                  std::string text;
                  for (int i = 0; i < 100000; ++i) text += "{\"a\":";
                  return text;
                }(),
                "nested more than"},
               {"twice", R"({"a": {"b": 1, "b": 2}})", "a.b: this key is given twice"},
               {"many keys", keys + "}", "an object of more than"},
               {"a long word", longest, "not valid JSON"},
               {"a long key", "{\"" + longest + "\":1}", "has 1048576 bytes; at most 1000"},
               {"a long number", std::string(1 << 20, '9') + "e999999", "too large"},
               {"no end", "\"" + longest, "not valid JSON"},
               {"an escape sequence", "{\"a\": \x1b[31m}", "not valid JSON"},
               {"no UTF-8", "{\"a\": \"\xff\"}", "not valid JSON"}};
  for (const auto& c : cases) {
    const std::string message = answer_to_json(c.text);
    EXPECT_THAT(message, HasSubstr(c.part)) << c.what;
    EXPECT_LE(message.size(), 400U) << c.what;
    EXPECT_THAT(message, Not(HasSubstr(std::string(kMostQuoted + 1, 'x')))) << c.what;
    EXPECT_EQ(message, printable(message)) << c.what;
  }
}

TEST(JsonText, ListsInDeepPlacesTakeNoMemoryForEachElement) {
  std::string text;
  for (int depth = 0; depth < 40; ++depth) text += "{\"" + std::string(900, 'x') + "\":\n";
  text += "[0";
  for (int i = 1; i < 100000; ++i) text += ",0";
  text += "]" + std::string(40, '}');
  EXPECT_EQ(answer_to_json(text), "accepted");
}

TEST(JsonText, KeysAndValuesAreQuotedShortly) {
  const std::string longest(1 << 20, 'x');
  const JsonFile file("{\"" + std::string(1000, 'x') + "\": \"" + longest + "\", \"\\u001b[31m\": 1}", "e.json");
  const std::array<std::string_view, 1> accepted{"a"};
  for (const auto& [key, node] : file.root().members()) {
    for (const std::string& message : {answer([&, n = node] { n.number(0, 1); }), answer([&, n = node] { n.one_of(accepted); }),
                                       answer([&] { file.root().accept_keys(accepted); })}) {
      if (message == "accepted") continue;
      EXPECT_LE(message.size(), 400U);
      EXPECT_THAT(message, Not(HasSubstr(std::string(kMostQuoted + 1, 'x'))));
    }
  }
}

// ---- meshes ----

MeshDescription description(const Vec3i& root, std::vector<int> ratios) {
  MeshDescription mesh;
  mesh.name = "bad";
  mesh.root_cells = root;
  mesh.levels.resize(ratios.size() + 1);
  mesh.ratios = std::move(ratios);
  mesh.fields = {"f"};
  return mesh;
}
Patch patch(const Box& box) { return {box, {CellValues(std::vector<double>(static_cast<std::size_t>(box.cells()), 1.0))}}; }

TEST(Meshes, OfTwoCellsInTheLargestDomainAreRead) {
  constexpr int kEdge = std::numeric_limits<int>::max() - 4096;
  MeshDescription mesh = description(Vec3i(kEdge), {});
  mesh.levels[0] = {patch({Vec3i(0), Vec3i(1)}), patch({Vec3i(kEdge - 1), Vec3i(kEdge)})};
  EXPECT_EQ(answer([&] {
              const AmrHierarchy h(mesh);
              EXPECT_EQ(h.leaf_cells(), 2);
              EXPECT_EQ(h.find_patch(0, Vec3i(kEdge - 1)), 1);
              EXPECT_EQ(h.find_patch(0, Vec3i(7)), -1);
              EXPECT_TRUE(h.has_holes());
            }),
            "accepted");
  mesh.root_cells = Vec3i(kEdge + 1);
  EXPECT_THAT(answer([&] { AmrHierarchy h(mesh); }), HasSubstr("level 0 has 2147479552 cells along an axis; at most 2147479551"));
}

TEST(Meshes, WithMoreChildrenThanAnyoneCanVisitAreAnsweredAtOnce) {
  MeshDescription mesh = description(Vec3i(2), {100000, 2});
  mesh.levels[0] = {patch({Vec3i(0), Vec3i(2)})};
  mesh.levels[2] = {patch({Vec3i(0), Vec3i(2)})};
  EXPECT_THAT(answer([&] { AmrHierarchy h(mesh); }), HasSubstr("level 0, patch 0: cell (0, 0, 0) is refined only in part"));
}

TEST(Meshes, RefinedInPiecesOfSeveralLevelsAreRefinedInAll) {
  MeshDescription mesh = description(Vec3i(2), {2, 2, 2});
  mesh.levels[0] = {patch({Vec3i(0), Vec3i(2)})};
  // the first cell: its lower half by level 2, its upper half by two patches of level 3
  mesh.levels[2] = {patch({Vec3i(0), {4, 4, 2}})};
  mesh.levels[3] = {patch({{0, 0, 4}, {4, 8, 8}}), patch({{4, 0, 4}, {8, 8, 8}})};
  EXPECT_EQ(answer([&] { EXPECT_EQ(AmrHierarchy(mesh).leaf_cells(), 7 + 32 + 256); }), "accepted");
  mesh.levels[3].pop_back();
  EXPECT_THAT(answer([&] { AmrHierarchy h(mesh); }), HasSubstr("refined only in part, by level 2, patch 0"));
}

TEST(Meshes, AreRefusedForTheSameCellAtEachRun) {
  MeshDescription mesh = description(Vec3i(64, 8, 8), {2, 2});
  for (int x = 0; x < 64; ++x) {
    mesh.levels[0].push_back(patch({{x, 0, 0}, {x + 1, 8, 8}}));
    if (x >= 5) mesh.levels[2].push_back(patch({{4 * x, 8, 4}, {4 * x + 2, 12, 8}}));
  }
  for (int run = 0; run < 50; ++run)
    EXPECT_EQ(answer([&] { AmrHierarchy h(mesh); }),
              "data set bad: level 0, patch 5: cell (5, 2, 1) is refined only in part, by level 2, patch 0");
}

TEST(Meshes, WithNamesThatAreNoTextAreRefused) {
  MeshDescription mesh = description(Vec3i(1), {});
  mesh.levels[0] = {patch({Vec3i(0), Vec3i(1)})};
  mesh.fields = {"\xff\x1b[31m"};
  EXPECT_EQ(answer([&] { AmrHierarchy h(mesh); }), "data set bad: the name of the field '\\xff\\x1b[31m' is not UTF-8");
  mesh.fields = {std::string(1000, 'x')};
  EXPECT_LE(answer([&] { AmrHierarchy(mesh).field_index("y"); }).size(), 200U);
}

TEST(Specifications, OfMoreCellsThanCanBeMadeAreRefusedBeforeTheyAreMade) {
  for (const char* spec : {R"({"field": "shell", "root": [16777216, 16777216, 16777216], "levels": 1})",
                           R"({"field": "shell", "root": 1024, "patch": 64, "ratio": 64, "levels": 3, "skip_levels": [0]})"})
    EXPECT_THAT(answer([&] { generate_mesh(Json::parse(spec)); }), AllOf(HasSubstr("generator"), HasSubstr("accepted"))) << spec;
  const Json words{{"field", std::string(1 << 20, 'x')}};
  EXPECT_LE(answer([&] { generate_mesh(words); }).size(), 400U);
}

TEST_F(BadFiles, TextOfOneLongLineIsOneShortError) {
  write("plt/Level_0/Cell_H", "");
  for (const char byte : {'x', '1', '\x1b', '\xff'}) {
    write("plt/Header", std::string(1 << 20, byte));
    const std::string message = answer([&] { read_mesh(folder_ / "plt"); });
    EXPECT_THAT(message, AllOf(HasSubstr("plt/Header, line 1: 1048576 bytes; lines of at most 262144 are read")));
    write("plt/Header", std::string(200000, byte));
    EXPECT_LE(answer([&] { read_mesh(folder_ / "plt"); }).size(), folder_.string().size() + 300);
  }
}

TEST_F(BadFiles, WhatALinkLeadsToIsNotQuoted) {
  const fs::path secret = write("elsewhere/secret", "root:x:0:0\n");
  fs::create_directories(folder_ / "plt/Level_0");
  fs::create_symlink(secret, folder_ / "plt/Header");
  EXPECT_THAT(answer([&] { read_mesh(folder_ / "plt"); }),
              AllOf(HasSubstr("its first line is something else"), Not(HasSubstr("root"))));
  for (const char* name : {"t.ply", "t.stl", "t.obj"}) {
    const fs::path target = write(std::string("elsewhere/") + name, "v root:x:0:0 1 2\n");
    fs::create_directories(folder_ / "linked");
    fs::create_symlink(target, folder_ / "linked" / name);
    EXPECT_THAT(answer([&] { read_triangles(folder_ / "linked" / name); }), AllOf(HasSubstr(name), Not(HasSubstr("root"))));
  }
  // a path of an experiment may go through a linked folder, and leave its own by itself
  const fs::path inside = write("experiment/models/t.obj", "v a:b 1 2\n");
  fs::create_directory_symlink(folder_ / "elsewhere", folder_ / "experiment/link");
  for (const char* way : {"link/t.obj", "models/../../elsewhere/t.obj"})
    EXPECT_THAT(answer_to_experiment(way), AllOf(HasSubstr("t.obj"), HasSubstr("something else"), Not(HasSubstr("root")))) << way;
  EXPECT_THAT(answer_to_experiment("models/t.obj"), HasSubstr("'a:b'"));
  EXPECT_THAT(answer_to_experiment(inside.string()), HasSubstr("'a:b'")) << "named in full";
  // a data set that is itself reached by a link is the user's own
  fs::create_directories(folder_ / "own");
  std::ofstream(folder_ / "own/Header") << "hello\n";
  fs::create_directory_symlink(folder_ / "own", folder_ / "link");
  EXPECT_THAT(answer([&] { read_mesh(folder_ / "link"); }), HasSubstr("its first line is 'hello'"));
}

TEST_F(BadFiles, AreNamedWithTheSystemsReason) {
  fs::create_symlink("loop", folder_ / "loop");
  const std::string name(300, 'x');
  write("file", "");
  const struct {
    fs::path path;
    const char* reason;
  } cases[] = {{folder_ / "loop", "too many levels of symbolic links"},
               {folder_ / name, "file name too long"},
               {folder_ / "file" / "below", "not a directory"},
               {folder_ / "absent", "no such file or directory"}};
  for (const auto& c : cases) {
    EXPECT_THAT(answer([&] { read_mesh(c.path); }), HasSubstr(c.reason));
    EXPECT_THAT(answer([&] { JsonFile::read(c.path); }), HasSubstr(c.reason));
    EXPECT_THAT(answer([&] { load_text(c.path); }), HasSubstr(c.reason));
    EXPECT_THAT(answer([&] { load_stream(c.path, 1000); }), HasSubstr(c.reason));
  }
  EXPECT_THAT(answer([&] { JsonFile::read(folder_); }), HasSubstr("a folder, not a file"));
}

TEST_F(BadFiles, PicturesOfMoreNumbersThanCanBeCountedAreRefused) {
  const std::string shapes[] = {"(999999999, 999999999, 16)", "(999999999, 999999999, 1)", "(1, 1, 1)",
                                "(" + std::string(60000, '9')};
  for (const std::string& shape : shapes) {
    std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + ", }\n";
    std::string bytes("\x93NUMPY\x01\x00", 8);
    bytes += static_cast<char>(header.size() & 0xFF);
    bytes += static_cast<char>(header.size() >> 8);
    const fs::path path = write("p.npy", bytes + header);
    const std::string message = answer([&] { read_npy(path); });
    EXPECT_THAT(message, AllOf(StartsWith(path.string()), HasSubstr("npy")));
    EXPECT_LE(message.size(), path.string().size() + 300);
  }
}

// ---- triangles ----

const std::string kPlyHeader =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_index\nend_header\n";
const std::string kPlyVertices = "0 0 0\n1 0 0\n0 1 0\n";
const std::string kPly = kPlyHeader + kPlyVertices + "3 0 1 2\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// The same triangle as kPly in either order of bytes.
std::string binary_ply(bool big) {
  std::string bytes = replaced(kPlyHeader, "ascii", big ? "binary_big_endian" : "binary_little_endian");
  const auto append = [&](auto value) {
    std::string raw(sizeof value, '\0');
    std::memcpy(raw.data(), &value, sizeof value);
    if (big) std::reverse(raw.begin(), raw.end());
    bytes += raw;
  };
  for (const float c : {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F}) append(c);
  bytes += '\3';
  for (const std::int32_t i : {0, 1, 2}) append(i);
  return bytes;
}

const std::string kStl =
    "solid t\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid t\n";
const std::string kObj = "# t\nmtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";

TEST_F(BadFiles, OfTrianglesAreRefusedForEachKindOfFault) {
  const struct {
    const char* name;
    std::string bytes;
    const char* problem;
  } cases[] = {
      {"hang.ply", "ply\nformat ascii 1.0\n", "the header ends before `end_header`"},
      {"segfault.ply", replaced(binary_ply(false), "list uchar int vertex_index\nend_head", "list u"),
       "line 8: expected `property`"},
      {"cut.ply", kPlyHeader + kPlyVertices + "3 ", "its last line, 13, does not end"},
      {"short.ply", kPlyHeader + kPlyVertices + "3 0 1\n", "line 13: a list of 3 numbers; 2 follow"},
      {"long.ply", kPlyHeader + kPlyVertices + "3 0 1 2 0\n", "line 13: '0' stands behind the last number"},
      {"less.ply", kPlyHeader + kPlyVertices, "ends after 3 lines of vertices and faces; its header tells of 4"},
      {"more.ply", kPly + "3 0 1 2\n", "line 14: text behind the last element"},
      {"far.ply", kPlyHeader + kPlyVertices + "3 0 1 3\n", "face 0 names the vertex 3 of 3"},
      {"negative.ply", kPlyHeader + kPlyVertices + "3 0 1 -1\n", "face 0 names the vertex -1 of 3"},
      {"word.ply", replaced(kPly, "1 0 0", "1 x 0"), "line 11: 'x' is not a number"},
      {"nan.ply", replaced(kPly, "1 0 0", "1 nan 0"), "not finite"},
      {"real.ply", replaced(kPly, "3 0 1 2", "3 0 1 2.5"), "'2.5' is not a whole number"},
      {"many.ply", replaced(kPly, "vertex 3", "vertex 999999999999999999"), "999999999999999999 elements of one kind"},
      {"countless.ply", replaced(kPly, "vertex 3", "vertex -3"), "expected `element`, a name and a count"},
      {"plane.ply", replaced(kPly, "property float z\n", ""), "its vertices have no z"},
      {"twice.ply", replaced(kPly, "property float z\n", "property float z\nproperty float z\n"), "no z, or more than one"},
      {"lists.ply", replaced(kPly, "uchar int", "float int"), "the length of a list is a real number"},
      {"corners.ply", replaced(kPly, "uchar int", "uchar float"), "name vertices by real numbers"},
      {"version.ply", replaced(kPly, "1.0", "2.0"), "expected `format`"},
      {"little.ply", binary_ply(false) + "x", "1 bytes stand behind its last element"},
      {"big.ply", binary_ply(true).substr(0, binary_ply(true).size() - 1), "it ends inside face 0 of 1"},
      {"swapped.ply", replaced(binary_ply(true), "big", "little"), "face 0 names the vertex 16777216 of 3"},
      {"cut.stl", kStl.substr(0, kStl.size() - 1), "its last line, 9, does not end"},
      {"endless.stl", replaced(kStl, "endsolid t\n", ""), "ends before `endsolid`"},
      {"four.stl", replaced(kStl, "vertex 0 1 0\n", "vertex 0 1 0\nvertex 1 1 0\n"),
       "line 7: expected `endloop`; found 'vertex'"},
      {"two.stl", replaced(kStl, "vertex 0 1 0", "vertex 0 1"), "2 numbers; three are expected"},
      {"counted.stl", std::string(80, ' ') + std::string("\2\0\0\0", 4) + std::string(50, '\0'), "2 triangles asks for 184"},
      {"tiny.stl", "x", "its last line, 1, does not end"},
      {"cut.obj", kObj.substr(0, kObj.size() - 1), "its last line, 7, does not end"},
      {"word.obj", replaced(kObj, "v 1 0 0", "v 1 x 0"), "line 4: 'x' is not a number of a vertex"},
      {"two.obj", replaced(kObj, "v 1 0 0", "v 1 0"), "a vertex of 2 numbers"},
      {"zero.obj", replaced(kObj, "f 1 2 3", "f 0 2 3"), "'0' names no vertex"},
      {"huge.obj", replaced(kObj, "f 1 2 3", "f 1 2 4294967299"), "'4294967299' names no vertex"},
      {"far.obj", replaced(kObj, "f 1 2 3", "f 1 2 4"), "face 0 names the vertex 3 of 3"},
      {"back.obj", replaced(kObj, "f 1 2 3", "f -1 -2 -4"), "face 0 names the vertex -1 of 3"},
      {"letters.obj", replaced(kObj, "f 1 2 3", "f 1 2 3x"), "'3x' names no vertex"},
      {"parts.obj", replaced(kObj, "f 1 2 3", "f 1/1/1/1 2 3"), "'1/1/1/1' names no vertex"},
      {"nul.obj", replaced(kObj, "# t", std::string("# \0", 3)), "a NUL character"},
  };
  for (const auto& c : cases) {
    const std::string message = answer_to_triangles(c.name, c.bytes);
    EXPECT_THAT(message, AllOf(StartsWith((folder_ / c.name).string() + ": "), HasSubstr(c.problem)));
    EXPECT_LE(message.size(), folder_.string().size() + 300) << c.name;
  }
}

TEST_F(BadFiles, GoodOnesOfTrianglesAreRead) {
  const std::vector<Triangle> one{{Vec3d(0), {1, 0, 0}, {0, 1, 0}}};
  const struct {
    const char* name;
    std::string bytes;
  } cases[] = {
      {"t.ply", kPly},
      {"little.ply", binary_ply(false)},
      {"big.ply", binary_ply(true)},
      {"dos.ply", replaced(kPly, "end_header\n", "comment made elsewhere\r\nend_header\r\n")},
      {"colours.ply", replaced(replaced(kPly, "z\n", "z\nproperty uchar red\n"), kPlyVertices, "0 0 0 255\n1 0 0 9\n0 1 0 0\n")},
      {"t.stl", kStl},
      {"loud.stl", replaced(kStl, "outer loop", "OUTER LOOP")},
      {"t.obj", kObj},
      {"parts.obj", replaced(kObj, "f 1 2 3", "f 1/1 2//7 3/4/5")},
      {"signs.obj", replaced(kObj, "v 1 0 0", "v +1.0e0 -0 .0 1.0")}};
  for (const auto& c : cases) {
    const fs::path path = write(c.name, c.bytes);
    EXPECT_EQ(answer([&] { EXPECT_EQ(read_triangles(path).triangles(), one); }), "accepted") << c.name;
  }
}

TEST_F(BadFiles, PolygonsThatBendAreCutInsideOrRefused) {
  const auto area = [&](const std::string& obj) {
    double sum = 0;
    const TriangleMesh mesh = read_triangles(write("p.obj", obj));
    for (const Triangle& t : mesh.triangles()) sum += glm::length(glm::cross(t[1] - t[0], t[2] - t[0])) / 2;
    return sum;
  };
  const std::string arrow = "v 0 0 0\nv 2 0 0\nv 0.5 0.5 0\nv 0 2 0\n";
  for (const char* face : {"f 1 2 3 4\n", "f 2 3 4 1\n", "f 3 4 1 2\n", "f 4 3 2 1\n"})
    EXPECT_NEAR(area(arrow + face), 1, 1e-12) << face;
  EXPECT_THAT(answer_to_triangles("comb.obj",
                                  "v 0 0 0\nv 5 0 0\nv 5 2 0\nv 4 2 0\nv 4 1 0\nv 3 1 0\nv 3 2 0\nv 2 2 0\nv 2 1 0\nv 1 1 0\n"
                                  "v 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6 7 8 9 10 11 12\n"),
              HasSubstr("face 0 of 12 corners bends"));
}

// ---- damage of every kind ----

TEST_F(BadFiles, CutOrChangedAnywhereAreReadOrRefused) {
  const struct {
    std::string name, bytes;
    std::function<void(const fs::path&)> read;
  } files[] = {
      {"t.ply", kPly, [](const fs::path& p) { read_triangles(p); }},
      {"little.ply", binary_ply(false), [](const fs::path& p) { read_triangles(p); }},
      {"t.stl", kStl, [](const fs::path& p) { read_triangles(p); }},
      {"t.obj", kObj, [](const fs::path& p) { read_triangles(p); }},
      {"e.json", R"({"name": "x", "seed": 12, "list": [1.5e3, true, null, "ä\u00e4"], "o": {"a": [], "b": {}}})",
       [](const fs::path& p) { JsonFile::read(p); }},
  };
  const std::string hostile("0123456789-+.,:/[]{}()\"\\ \n\t\0\x1b\xff\xef", 31);
  std::mt19937 random(7);
  for (const auto& file : files) {
    for (std::size_t cut = 0; cut < file.bytes.size(); ++cut) {
      const fs::path path = write(file.name, file.bytes.substr(0, cut));
      const std::string message = answer([&] { file.read(path); });
      // JSON ends with its last brace, an OBJ may end with any line
      EXPECT_TRUE(message != "accepted" || (file.name == "t.obj" && file.bytes[cut - 1] == '\n'))
          << file.name << " cut to " << cut;
    }
    for (int i = 0; i < 200; ++i) {
      std::string damaged = file.bytes;
      damaged[random() % damaged.size()] = hostile[random() % hostile.size()];
      const fs::path path = write(file.name, damaged);
      const std::string message = answer([&] { file.read(path); });
      EXPECT_EQ(message, printable(message)) << file.name;
    }
  }
}

// ---- the inputs that failed, where they are at hand ----

TEST(FailingInputs, AreAnsweredAtOnce) {
  AMRTEX_NEEDS(test::kFailingInputs, "");
  const fs::path folder = test::kFailingInputs.path();
  const auto mesh = [&](const char* name) { return answer([&] { AmrHierarchy(read_mesh(folder / name)).content_hash(0); }); };
  EXPECT_EQ(mesh("version_line_navierstokes"), "accepted");
  EXPECT_THAT(mesh("cell_size_contradicts_domain"), HasSubstr("the cells of level 0 are said to be 0.5 wide along x"));
  EXPECT_THAT(mesh("segv_corners"), HasSubstr("the cells of level 0 are said to be 1 wide along x"));
  EXPECT_THAT(mesh("hang_plotfile"), HasSubstr("the cells of level 0 are said to be 1 wide along x"));
  EXPECT_EQ(answer([&] { JsonFile::read(folder / "json_bom.json"); }), "accepted");
  EXPECT_THAT(answer([&] { JsonFile::read(folder / "json_nul.json"); }), HasSubstr(":1:3: not valid JSON: a NUL character"));
  for (const char* name : {"ply_hang_21_bytes.ply", "ply_segfault.ply", "ply_cut_accepted.ply"})
    EXPECT_THAT(answer([&] { read_triangles(folder / name); }), HasSubstr("accepted: OBJ, PLY or STL"));
}

}  // namespace
}  // namespace amrtex
