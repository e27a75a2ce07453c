// What each folder may include: the table "Folders" in CONTRIBUTING.md is read and checked.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace amrtex {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::SizeIs;

const fs::path kRoot = AMRTEX_SOURCE_DIR;
constexpr const char* kEncodings = "structures/<encoding>";

struct Include {
  std::string file;  ///< that includes, from the project's root
  std::string path;  ///< as written
};

/// A row of the table a folder: what it may include.
using Table = std::map<std::string, std::set<std::string>>;

/// The words in backticks.
std::vector<std::string> quoted(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t open = text.find('`'); open != std::string::npos;) {
    const std::size_t close = text.find('`', open + 1);
    words.push_back(text.substr(open + 1, close - open - 1));
    open = text.find('`', close + 1);
  }
  return words;
}

Table folder_table() {
  std::ifstream file(kRoot / "CONTRIBUTING.md");
  Table table;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("## ")) inside = line == "## Folders";
    if (!inside || !line.starts_with("| `")) continue;
    const std::size_t column = line.find('|', 1);
    const std::vector<std::string> allowed = quoted(line.substr(column));
    table[quoted(line.substr(0, column)).at(0)] = {allowed.begin(), allowed.end()};
  }
  return table;
}

std::string parent(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

/// The row that a folder stands in: its own, that of all encodings or formats, or that of the folder around it.
std::string row_of(const Table& table, std::string folder) {
  for (; !folder.empty(); folder = parent(folder)) {
    if (table.contains(folder)) return folder;
    for (const char* name : {"/<encoding>", "/<format>"})
      if (table.contains(parent(folder) + name)) return parent(folder) + name;
  }
  return "";
}

bool is_test(const std::string& file) {
  return file.starts_with("tests/") || file.ends_with("_test.cpp") || file.ends_with("_test_tools.hpp");
}

/// CMake fills in an encoding's folder.
std::string filled_in(std::string path) {
  const std::string folder = "@folder@/";
  return path.starts_with(folder) ? "structures/<encoding>/" + path.substr(folder.size()) : path;
}

bool allows(const std::set<std::string>& allowed, const std::string& row) {
  for (const std::string& entry : allowed)
    if (entry == row || (entry.ends_with("/*") && row.starts_with(entry.substr(0, entry.size() - 1)))) return true;
  return false;
}

/// Includes that their folder's row does not have.
std::vector<std::string> violations(const Table& table, const std::vector<Include>& includes) {
  std::vector<std::string> found;
  for (const Include& include : includes) {
    const std::string from = parent(include.file);
    const std::string to = parent(include.path);
    if (to.empty() || to == from) continue;  // a file beside it
    const std::string row = is_test(include.file) ? "tests" : row_of(table, from);
    if (!table.contains(row) || !allows(table.at(row), row_of(table, to)))
      found.push_back(include.file + " includes " + include.path);
  }
  return found;
}

std::vector<Include> includes_of(const fs::path& path) {
  const std::string start = "#include \"";
  std::ifstream file(path);
  std::vector<Include> includes;
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(start))
      includes.push_back(
          {fs::relative(path, kRoot), filled_in(line.substr(start.size(), line.find('"', start.size()) - start.size()))});
  return includes;
}

std::vector<fs::path> source_files() {
  std::vector<fs::path> files;
  for (const char* folder : {"structures", "renderers", "shaders", "bench", "python", "tests"})
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder))
      for (const char* extension : {".cpp", ".hpp", ".in"})
        if (entry.path().extension() == extension) files.push_back(entry.path());
  return files;
}

std::vector<Include> all_includes() {
  std::vector<Include> all;
  for (const fs::path& file : source_files()) {
    const std::vector<Include> some = includes_of(file);
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

/// x of x.hpp and x.cpp; anything else is a component of its own.
std::string component(const std::string& file) {
  const bool half = file.ends_with(".hpp") || file.ends_with(".cpp");
  return half ? file.substr(0, file.size() - 4) : file;
}

/// Looks for a way from a component back to itself.
class Circles {
 public:
  explicit Circles(const std::vector<Include>& includes) {
    for (const Include& include : includes) {
      const std::string path =
          include.path.find('/') == std::string::npos ? parent(include.file) + "/" + include.path : include.path;
      if (component(path) != component(include.file)) uses_[component(include.file)].insert(component(path));
    }
  }

  /// "a b c a", or nothing.
  std::string find() {
    for (const auto& [name, used] : uses_)
      if (visit(name)) return circle_;
    return "";
  }

 private:
  bool visit(const std::string& name) {
    if (done_.contains(name)) return false;
    way_.push_back(name);
    for (const std::string& next : uses_[name]) {
      if (const auto begin = std::find(way_.begin(), way_.end(), next); begin != way_.end()) {
        for (auto i = begin; i != way_.end(); ++i) circle_ += *i + " ";
        circle_ += next;
        return true;
      }
      if (visit(next)) return true;
    }
    way_.pop_back();
    done_.insert(name);
    return false;
  }

  std::map<std::string, std::set<std::string>> uses_;
  std::set<std::string> done_;
  std::vector<std::string> way_;
  std::string circle_;
};

TEST(Includes, AreThoseThatTheTableOfFoldersAllows) {
  const std::vector<Include> includes = all_includes();
  ASSERT_GT(includes.size(), 500U) << "the sources were not found";
  EXPECT_THAT(violations(folder_table(), includes), IsEmpty());
}

TEST(Includes, OfMadeUpFilesAreRefusedByTheTable) {
  const Table table = folder_table();
  EXPECT_THAT(violations(table, {{"structures/mesh/a.hpp", "structures/common/encoding.hpp"}}), SizeIs(1));
  EXPECT_THAT(violations(table, {{"structures/octree/a.cpp", "structures/uniform/b.hpp"}}), SizeIs(1));
  EXPECT_THAT(violations(table, {{"renderers/reference/a.cpp", "structures/common/encoding.hpp"}}), SizeIs(1));
  EXPECT_THAT(violations(table, {{"renderers/consumers/a.cpp", "structures/mesh/amr_hierarchy.hpp"}}), IsEmpty());
  EXPECT_THAT(violations(table, {{"bench/nowhere/a.cpp", "structures/mesh/error.hpp"}}), SizeIs(1)) << "no row";
}

TEST(Includes, MakeNoCircleOfComponents) {
  EXPECT_EQ(Circles(all_includes()).find(), "");
  EXPECT_EQ(Circles({{"a/x.hpp", "a/y.hpp"}, {"a/y.cpp", "a/z.hpp"}, {"a/z.hpp", "x.hpp"}}).find(), "a/x a/y a/z a/x");
}

TEST(Includes, OfAnEncodingNameNoOther) {
  const Table table = folder_table();
  ASSERT_TRUE(table.contains(kEncodings));
  EXPECT_FALSE(table.at(kEncodings).contains(kEncodings));
}

TEST(Includes, OfTheReferenceNameNoEncoding) {
  const Table table = folder_table();
  for (const char* folder : {"renderers/reference", "renderers/reference/filters", "renderers/scene"})
    for (const char* encodings : {kEncodings, "structures/common"}) EXPECT_FALSE(table.at(folder).contains(encodings)) << folder;
}

TEST(Includes, OfWhatDrawsShowNoMesh) {
  for (const Include& include : all_includes())
    for (const char* folder : {"renderers/bindings/", "renderers/consumers/", "renderers/cpu/", "renderers/gpu/"})
      if (include.file.starts_with(folder)) {
        EXPECT_NE(include.path, "structures/mesh/amr_hierarchy.hpp") << include.file;
      }
}

TEST(Folders, HaveAReadmeEach) {
  for (const fs::path& file : source_files()) {
    const std::string name = fs::relative(file, kRoot);
    if (!name.starts_with("tests/")) {
      EXPECT_TRUE(fs::exists(file.parent_path() / "README.md")) << name;
    }
  }
}

}  // namespace
}  // namespace amrtex
