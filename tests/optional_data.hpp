// Data that may lie beside the project, and does not have to: a test that wants it says what is missing and how to name it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace amrtex::test {

/// A folder beside the project, or where an environment variable says that it lies.
struct OptionalFolder {
  const char* variable;
  const char* name;  ///< below `shared`, beside the project

  std::filesystem::path path() const {
    const char* given = std::getenv(variable);
    return given != nullptr ? std::filesystem::path(given) : beside();
  }
  std::filesystem::path operator/(const std::filesystem::path& inside) const { return path() / inside; }
  /// The folder beside the project, whatever the variable says.
  std::filesystem::path beside() const { return std::filesystem::path(AMRTEX_SOURCE_DIR) / ".." / "shared" / name; }
  /// Why there is nothing to test.
  std::string absent(const std::filesystem::path& file) const {
    return "no " + file.string() + "; set " + variable + " to the folder that holds it to run this test";
  }
};

/// Large data sets with oracles.
inline constexpr OptionalFolder kSharedData{"AMRTEX_DATA", "data"};
/// Inputs that once failed, with what is right.
inline constexpr OptionalFolder kFailingInputs{"AMRTEX_FAILING_INPUTS", "cases"};

}  // namespace amrtex::test

/// Skips the test where `file` of an OptionalFolder is not there.
#define AMRTEX_NEEDS(folder, file)                                                 \
  do {                                                                             \
    const std::filesystem::path needed = (folder) / (file);                        \
    if (!std::filesystem::exists(needed)) GTEST_SKIP() << (folder).absent(needed); \
  } while (false)
