// What tests of readers share: a folder of their own, files in it, and what was said of them.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>  // mkdtemp

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "structures/mesh/amr_hierarchy.hpp"

namespace amrtex::test {

inline void write_bytes(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline std::string bytes_of_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A test with a temporary folder, which is removed at its end.
class FolderTest : public ::testing::Test {
 protected:
  FolderTest() {
    std::string name = (std::filesystem::temp_directory_path() / "amrtex_files_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw Error("no temporary folder");
    folder_ = name;
  }
  ~FolderTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  std::filesystem::path at(const std::string& name) const { return folder_ / name; }

  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    write_bytes(at(name), bytes);
    return at(name);
  }
  template <class T>
  std::filesystem::path write_values(const std::string& name, const std::vector<T>& values) const {
    return write(name, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  /// Names of all that is there, hidden ones too.
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) found.push_back(entry.path().filename().string());
    std::sort(found.begin(), found.end());
    return found;
  }

  std::filesystem::path folder_;
};

/// What message_of() answers where an action succeeds.
inline constexpr const char* kNothingThrown = "(nothing was thrown)";

/// What an action says that throws a Failure; any other exception ends the test.
template <class Failure = Error, class F>
std::string message_of(F&& action) {
  try {
    action();
  } catch (const Failure& failure) {
    return failure.what();
  }
  return kNothingThrown;
}

}  // namespace amrtex::test
