#include "bench/measure/environment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "bench/records/record.hpp"

namespace amrtex {
namespace {

TEST(ContextJson, IsWhatARecordExpects) {
  Json record = blank_record(Status::failed, "no picture");
  record["context"] = context_json();
  EXPECT_NO_THROW(validate_record(record));
  EXPECT_TRUE(record["context"]["renderer"].is_null());
  EXPECT_FALSE(record["context"]["compiler"].get<std::string>().empty());
}

TEST(DriverVariables, AreThoseOfDriversOnlyAndSorted) {
  ::setenv("MESA_AMRTEX_TEST", "b=c", 1);
  ::setenv("LP_AMRTEX_TEST", "1", 1);
  ::setenv("AMRTEX_TEST", "secret", 1);
  const Json variables = driver_variables();
  EXPECT_EQ(variables["MESA_AMRTEX_TEST"], "b=c");
  EXPECT_FALSE(variables.contains("AMRTEX_TEST"));
  EXPECT_LT(variables.dump().find("LP_AMRTEX_TEST"), variables.dump().find("MESA_AMRTEX_TEST"));
  for (const char* name : {"MESA_AMRTEX_TEST", "LP_AMRTEX_TEST", "AMRTEX_TEST"}) ::unsetenv(name);
}

TEST(UtcDate, IsIso8601) {
  EXPECT_THAT(utc_date(), testing::MatchesRegex("20[0-9][0-9]-[01][0-9]-[0-3][0-9]T[0-2][0-9]:[0-5][0-9]:[0-6][0-9]Z"));
}

TEST(BuildInformation, HasAFullCommitOrNone) {
  const BuildInfo info = build_info();
  if (info.commit) {
    EXPECT_EQ(info.commit->size(), 40u);
  }
}

}  // namespace
}  // namespace amrtex
