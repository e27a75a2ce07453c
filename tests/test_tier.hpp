// How much of a test's combinations a run goes through: chosen pairs, or everything with AMRTEX_FULL=1 (scripts/test.sh --full).
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <string_view>

namespace amrtex::test {

inline bool full_tier() {
  const char* full = std::getenv("AMRTEX_FULL");
  return full != nullptr && std::string_view(full) == "1";
}

/// Of a table of combinations, one in `one_in` along each row and each column: with that many rows every column is met, and with
/// that many columns every row. All of them in the full tier.
inline bool chosen(std::size_t row, std::size_t column, std::size_t one_in) {
  return full_tier() || (row + column) % one_in == 0;
}

/// A number that each test has of its own, the same in every run: where its choice begins.
inline std::size_t turn_of_test() {
  std::size_t turn = 0;
  const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
  for (const std::string_view name : {test->test_suite_name(), test->name()})
    for (const char c : name) turn = turn * 31 + static_cast<unsigned char>(c);
  return turn % 1009;
}

}  // namespace amrtex::test
