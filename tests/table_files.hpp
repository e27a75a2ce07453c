// For tests of what a tables.json makes of records: a folder for the file, and the cells of a table.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "bench/report/table.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/json.hpp"

namespace amrtex::test {

/// A test with a folder of its own, which goes with it.
class TablesFileTest : public testing::Test {
 protected:
  TablesFileTest() {
    std::string name = (std::filesystem::temp_directory_path() / "amrtex_tables_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~TablesFileTest() override { std::filesystem::remove_all(folder_); }

  /// The path of a tables.json with this text.
  std::filesystem::path tables_file(const std::string& text) const {
    std::ofstream(folder_ / "tables.json") << text;
    return folder_ / "tables.json";
  }

 private:
  std::filesystem::path folder_;
};

/// `context` of a record, of which the renderer alone is known.
inline Json context_of(const std::string& renderer) {
  Json context = {{"renderer", renderer}};
  for (const char* key : {"gl_version", "extensions_missing", "cpu", "cores", "environment", "build_type", "compiler", "commit",
                          "dirty", "shader_hash", "date", "device", "shader_cache"})
    context[key] = nullptr;
  return context;
}

/// A column as it is printed.
inline std::vector<std::string> cells(const Table& table, const std::string& key) {
  for (std::size_t c = 0; c < table.columns.size(); ++c)
    if (table.columns[c].key == key) {
      std::vector<std::string> list;
      for (const auto& row : table.rows) list.push_back(format_cell(row[c]));
      return list;
    }
  return {"no such column"};
}

}  // namespace amrtex::test
